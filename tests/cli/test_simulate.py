"""Simulated studies repeat bit for bit, never overwrite, and are marked everywhere."""

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from typer.testing import CliRunner

import visavis.running.sessions.simulation
from tests.cli.stare_study import TWO, analysed_two_of_stare, simulate, two_of_stare
from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError, DataError, SessionAborted, UsageError
from visavis.recording.reader import Recording
from visavis.recording.sealed import seal, unseal
from visavis.running.sessions.session_request import Request
from visavis.running.sessions.study_folder import StudySettings, read_parameters, settle

REVISION = re.compile(rb'"code_revision": "[^"]*"|"sha256": "[0-9a-f]+"\n}\n\Z')


def digests(folder: Path) -> dict[str, str]:
    """Hash every file; the revision in manifests is left out, as is the checksum over it: it may
    move between two runs. The list of sessions is in the order in which they began and ended.
    """
    return {
        str(p.relative_to(folder)): hashlib.sha256(REVISION.sub(b"", p.read_bytes())).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and not p.name.startswith("sessions.")
    }


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_of_stare(tmp_path_factory.mktemp("étude 1"))


def test_the_same_seed_gives_the_same_bytes_however_many_processes(
    study: Path, tmp_path: Path
) -> None:
    again = simulate(tmp_path / "again", "--processes", "2")

    assert digests(study) == digests(again)


def test_every_file_and_table_says_it_is_simulated(study: Path) -> None:
    for manifest in study.glob("sub-*/ses-*/manifest.json"):
        assert json.loads(manifest.read_text())["is_simulated"] is True
    for journal in study.glob("sub-*/ses-*/part-*/events.jsonl"):
        assert json.loads(journal.read_text().splitlines()[0])["is_simulated"] is True
    assert "simulated" in study.parts


RECORDINGS_PAGE = Path(__file__).parents[2] / "docs" / "recordings.md"
WITH_OTHER_STUDIES = {
    "responses",
    "pointer",
    "drawn",
    "drawn_views",
    "drawn_gpu",
    "gaze_window",
    "choices.csv",
    "detection.csv",
    "psychometric.csv",
}


def told_of(section: str) -> set[str]:
    """Return what the tables of a section of the page name in their first column."""
    page = f"\n{RECORDINGS_PAGE.read_text('utf-8')}"
    text = page.partition(f"# {section}\n")[2].partition("\n## ")[0]
    return {
        name for row in re.findall(r"^\| (`[^|]+) \|", text, re.M) for name in row.split("`")[1::2]
    }


def test_the_page_of_recordings_names_the_paths_that_a_session_has(study: Path) -> None:
    session = min(study.glob("sub-*/ses-001"))
    place = re.search(r"^`(<data_root>/.*)/`$", RECORDINGS_PAGE.read_text("utf-8"), re.M)
    assert place is not None
    told = re.sub(r"<(\w+\|\w+)>", r"(\1)", place[1])
    told = re.sub(r"<NNN>", r"\\d{3}", re.sub(r"<(data_root|study|ID)>", ".+", told))
    assert re.fullmatch(told, str(session))
    files = {
        re.sub(r"/\w+\.arrows", "/<stream>.arrows", str(path.relative_to(session)))
        for path in session.rglob("*")
        if path.is_file()
    }
    assert files == told_of("What a recording holds")
    streams = {path.stem for path in session.rglob("*.arrows")}
    assert streams <= told_of("Streams")
    assert told_of("Streams") <= streams | WITH_OTHER_STUDIES


def test_analysis_writes_a_row_per_trial_in_two_formats_and_a_report(tmp_path: Path) -> None:
    study = analysed_two_of_stare(tmp_path)
    rows = pd.read_csv(study / "derived" / "trials.csv")
    assert 2 * (36 + 1) == len(rows)
    assert rows["is_simulated"].all()
    assert len(rows) == len(pd.read_parquet(study / "derived" / "trials.parquet"))
    described = json.loads((study / "derived" / "trials.json").read_text())
    assert [] == [c for c in rows.columns if c not in described]
    page = (study / "derived" / "report.html").read_text()
    assert "SIMULATED" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    captions = re.findall(r'<span class="caption">([^<]+)</span>', page)
    assert page.count("<table>") == len(captions) > 10
    tables = told_of("Tables of a study")
    assert {"trials.csv", "participants.csv", "statistics.csv"} < tables
    written = {path.name for path in (study / "derived").iterdir()}
    assert tables - written <= WITH_OTHER_STUDIES


def test_sessions_already_there_are_kept(study: Path) -> None:
    before = digests(study)

    simulate(study.parent.parent)

    assert before == digests(study)


def test_another_seed_for_the_same_folder_is_refused(study: Path) -> None:
    with pytest.raises(UsageError, match="begun with seed 5"):
        simulate(study.parent.parent, "--seed", "6")


def test_a_mixture_of_simulated_and_real_is_refused(study: Path, tmp_path: Path) -> None:
    mixed = tmp_path / "mixed"
    for number, session in enumerate(sorted(study.glob("sub-*/ses-001"))):
        manifest = unseal((session / "manifest.json").read_bytes()).content
        manifest["is_simulated"] = number == 0
        target = mixed / session.parent.name / "ses-001"
        target.mkdir(parents=True)
        (target / "manifest.json").write_bytes(seal(manifest))

    result = CliRunner().invoke(app, ["analyse", str(mixed)])

    assert isinstance(result.exception, DataError)
    assert "simulated and real" in str(result.exception)


def test_a_folder_without_sessions_names_the_study_inside_it(study: Path) -> None:
    result = CliRunner().invoke(app, ["analyse", str(study.parent)])

    assert isinstance(result.exception, UsageError)
    assert str(study) in str(result.exception)


def test_parameters_are_read_as_numbers_and_texts() -> None:
    assert {"trial_s": 8, "name": "x"} == read_parameters(["trial_s=8", "name=x"])
    with pytest.raises(UsageError, match="NAME=VALUE"):
        read_parameters(["trial_s"])


def test_a_session_takes_parameters_of_its_study_and_refuses_unknown_ones(tmp_path) -> None:
    config = tmp_path / "lab_config.yaml"
    config.write_text(EXAMPLE.read_text("utf-8"))
    arguments = ["run", "waving", "--participant", "1", "--fast", "--config", str(config)]
    result = CliRunner().invoke(app, [*arguments, "--set", "answer_bye=keyboard"])

    assert isinstance(result.exception, ConfigError)
    assert "answer_by" in str(result.exception)
    assert not (tmp_path / "data").exists()


def test_a_study_that_was_begun_keeps_its_parameters(tmp_path: Path) -> None:
    begun = StudySettings("waving", 1, True, parameters={"answer_by": "keyboard"})
    assert begun == settle(tmp_path, begun, seed_given=True)
    other = replace(begun, parameters={})
    with pytest.raises(UsageError, match="leave --set out"):
        settle(tmp_path, other, seed_given=True)


def test_an_unknown_study_is_answered_with_the_nearest() -> None:
    result = CliRunner().invoke(app, ["simulate", "stair"])

    assert isinstance(result.exception, UsageError)
    assert "did you mean 'stare'" in str(result.exception)


def test_the_same_command_finishes_a_study_that_was_broken_off(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = visavis.running.sessions.simulation.simulated_request

    def interrupt(_: str, done: int, __: int) -> None:
        if done == 5:
            raise KeyboardInterrupt

    def broken_off(*args: Any, **settings: Any) -> Request:
        return replace(own(*args, **settings), on_trial=interrupt)

    with monkeypatch.context() as patched:
        patched.setattr(visavis.running.sessions.simulation, "simulated_request", broken_off)
        with pytest.raises(SessionAborted, match="Give the same command again"):
            simulate(tmp_path)
    folder = simulate(tmp_path)
    sessions = [Recording(p.parent) for p in sorted(folder.glob("sub-*/ses-*/manifest.json"))]
    assert ["complete", "complete"] == [s.status for s in sessions]
    assert [2, 1] == [len(s.manifest.parts) for s in sessions]
    whole = Recording(next(study.glob("sub-S01*/ses-001")))
    for column in ("trial_id", "condition", "status"):
        assert whole.trials()[column].tolist() == sessions[0].trials()[column].tolist()


def test_nothing_left_to_simulate_is_no_error(study: Path) -> None:
    before = digests(study)
    again = [*TWO, "--output", str(study.parent.parent), "--processes", "2"]
    result = CliRunner().invoke(app, again)
    assert 0 == result.exit_code, result.output
    assert before == digests(study)
