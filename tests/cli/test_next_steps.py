"""A verb that cannot go on says what to type next, in words of what was asked."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.faults.sessions import lab
from tests.sessions import STUDIES
from visavis.analysis.session_check import check_session
from visavis.cli.main import app
from visavis.cli.preview.capture import Capture
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import LabError, SessionAborted
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.session.session import Session
from visavis.recording.folder import study_dir
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import StudySettings, settle


def said(folder: Path, *arguments: str) -> str:
    """Return what a verb says in a folder, whether it went on or not."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        result = CliRunner().invoke(app, arguments)
    finally:
        os.chdir(before)
    if isinstance(result.exception, LabError):
        return str(result.exception)
    return " ".join(result.output.split())


@pytest.fixture
def fresh(tmp_path: Path) -> Path:
    """Return a folder in which nothing has been performed yet."""
    (tmp_path / "lab_config.yaml").write_bytes(EXAMPLE.read_bytes())
    return tmp_path


@pytest.mark.parametrize(
    ("verb", "next_step"),
    [
        ("check stare", "visavis run stare --participant 1"),
        ("analyse stare", "visavis run stare --participant 1"),
        ("analyse .", "visavis run"),
        ("resume", "visavis run STUDY --participant ID"),
        ("init", "edit it"),
    ],
)
def test_verb_without_anything_to_work_on_names_the_one_that_makes_it(
    fresh: Path, verb: str, next_step: str
) -> None:
    assert next_step in said(fresh, *verb.split())


def test_new_laboratory_leads_to_the_doctor(tmp_path: Path) -> None:
    assert "next: visavis doctor" in said(tmp_path, "init")


@pytest.mark.parametrize(
    ("verb", "argument"), [("check", "SESSION"), ("run", "STUDY"), ("participant add", "[NUMBER]")]
)
def test_help_names_arguments_as_a_reader_does(verb: str, argument: str) -> None:
    text = said(Path.cwd(), *verb.split(), "--help")
    assert (True, False) == (argument in text, argument.strip("[]").lower() + "_" in text)


def test_plan_of_nobody_in_particular_is_of_the_next_new_participant(fresh: Path) -> None:
    text = said(fresh, "plan", "stare")
    assert (True, False) == (
        "stare next new participant place 1" in text,
        "participant next" in text,
    )


def test_plan_says_what_the_codes_in_its_columns_stand_for(fresh: Path) -> None:
    text = said(fresh, "plan", "stare")

    assert (
        "condition (gaze of the active agent): A averted, AD averted-then-directed, D directed, "
        "DA directed-then-averted" in text
    )
    assert "zone:" not in text  # whose levels are words already


def _interrupted(*_: object) -> None:
    raise KeyboardInterrupt


def test_interrupted_preview_speaks_of_no_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Session, "run", _interrupted)
    study = find_study(str(STUDIES / "duel.py"))
    with pytest.raises(KeyboardInterrupt):
        Capture(study, lab(tmp_path), number=1, index=0, seed=1).perform()


def test_session_that_is_ended_says_once_how_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Session, "run", _interrupted)
    study = find_study(str(STUDIES / "duel.py"))
    request = simulated_request(
        study, study.experiment({}), lab(tmp_path), label="S01B", index=0, seed=1
    )
    with pytest.raises(SessionAborted, match=r"every finished trial is kept$"):
        perform_new(request)


def test_check_of_a_running_session_asks_for_nothing_but_patience(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = find_study(str(STUDIES / "duel.py"))
    request = simulated_request(
        study, study.experiment({}), lab(tmp_path), label="S01B", index=0, seed=1
    )
    redo: list[tuple[str, ...]] = []

    def looked_at(*_: object) -> None:
        path = next(tmp_path.rglob("manifest.json")).parent
        redo.append(tuple(check_session(Recording(path)).redo))

    monkeypatch.setattr(Session, "run", looked_at)
    perform_new(request)
    assert [("wait for its last trial",)] == redo


def test_data_that_lie_with_the_simulated_ones_are_answered_with_the_command_to_type(
    fresh: Path,
) -> None:
    folder = fresh / "data/dry_runs/stare_n2_seed1/simulated/stare"
    folder.mkdir(parents=True)
    for verb in ("analyse", "check"):
        assert f"visavis {verb} {folder}" in said(fresh, verb, "stare")


def test_export_names_every_format_it_knows(fresh: Path) -> None:
    assert "parquet, bids, xdf, pedpy, not 'csv'" in said(
        fresh, "export", "stare", "--format", "csv"
    )


def test_a_study_with_half_a_session_says_so(fresh: Path) -> None:
    study = find_study(str(STUDIES / "asking.py"))
    folder = study_dir(lab(fresh).data_root, "asking", is_simulated=True)
    label = Ledger(folder, SimClock(), prefix="S").add().label
    request = simulated_request(
        study, study.experiment({}), lab(fresh), label=label, index=0, seed=1, effect=True
    )
    path = perform_new(request)
    settle(
        folder, StudySettings("asking", 1, True, source=str(STUDIES / "asking.py")), seed_given=True
    )
    assert "not finished" not in said(fresh, "check", str(folder))
    manifest = read_manifest(path)
    parts = (*manifest.parts[:-1], replace(manifest.parts[-1], status="aborted"))
    write_manifest(path, replace(manifest, parts=parts))

    told = said(fresh, "check", str(folder))
    assert "1 session" in told
    assert f"not finished: {path}" in told.replace(" ", " ")
    assert f"visavis resume {path}" in told
    analysed = said(fresh, "analyse", str(folder), "--processes", "1")
    assert f"not finished: session of {label}" in analysed
    assert "it is included" in analysed
