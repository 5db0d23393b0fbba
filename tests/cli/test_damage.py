"""Damaged recordings are refused by whatever makes something of them, and say what is missing."""

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from tests.cli.stare_study import analysed_two_of_stare, two_of_stare
from visavis.cli.main import app
from visavis.lab.errors import DataError
from visavis.protocol.people.exports_register import registered_exports
from visavis.recording.reader import Recording
from visavis.running.scripts import open_study
from visavis.running.sessions.folder_check import study_problems


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_of_stare(tmp_path_factory.mktemp("intact"))


@pytest.fixture(scope="module")
def damaged(intact: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a study of which the second half of one person's gaze and two rows are unreadable."""
    study = tmp_path_factory.mktemp("damaged") / "simulated" / "stare"
    shutil.copytree(intact, study)
    part = sorted(study.glob("sub-*/ses-001/part-01"))[0]
    gaze, journal = part / "gaze.arrows", part / "events.jsonl"
    data = gaze.read_bytes()
    rewrite(gaze, data[: len(data) // 2] + bytes(len(data) - len(data) // 2))
    lines = journal.read_bytes().splitlines(True)
    rows = [i for i, line in enumerate(lines) if b'"kind":"trial"' in line]
    for i in rows[3:5]:
        lines[i] = b"#" + lines[i][1:]
    rewrite(journal, b"".join(lines))
    return study


def rewrite(path: Path, data: bytes) -> None:
    path.chmod(0o644)
    path.write_bytes(data)


def visavis(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def test_analysis_of_damaged_recordings_is_refused_with_what_is_missing(damaged: Path) -> None:
    refused = visavis("analyse", str(damaged), "--processes", "1")

    assert isinstance(refused.exception, DataError)
    assert 5 == refused.exception.exit_code
    said = str(refused.exception)
    assert "1 of 2 recordings is damaged" in said
    assert "2 lines of the journal cannot be read: with them 2 trials" in said
    assert re.search(r"gaze \(part 1\): [\d,]+ of [\d,]+ rows cannot be read, during \d+ tr", said)
    assert "--accept-damage" in said
    assert not (damaged / "derived").exists()


def test_accepted_damage_is_missing_and_marked_and_nobodys_fault(damaged: Path) -> None:
    accepted = visavis("analyse", str(damaged), "--processes", "1", "--accept-damage")

    assert 0 == accepted.exit_code, accepted.output
    assert "1 of 2 recordings is damaged" in accepted.output
    rows = pd.read_csv(damaged / "derived" / "trials.csv")
    first = rows[rows["participant"] == rows["participant"].min()]
    assert 2 == (first["status"] == "lost").sum()
    assert 36 + 1 == first["trial_id"].nunique()
    struck = first[first["status"].isin(["lost", "damaged"])]
    assert len(struck) > 10
    assert struck[["dwell_ms", "fixation_count", "lost_01"]].isna().all(axis=None)
    assert struck["reason"].str.contains("cannot be read").all()
    assert not struck["is_analysed"].any()
    assert first.loc[first["status"] == "complete", "dwell_ms"].notna().all()
    people = pd.read_csv(damaged / "derived" / "participants.csv")
    assert people["left_out_because"].isna().all(), people["left_out_because"].tolist()
    listed = pd.read_csv(damaged / "derived" / "damage.csv")
    assert set(struck["trial_id"]) == set(listed["trial_id"].dropna())
    page = (damaged / "derived" / "report.html").read_text()
    assert "damaged; 2 lines of the journal cannot be read" in page
    assert "--accept-damage" in page


def test_an_intact_study_leaves_no_list_of_damage(tmp_path: Path) -> None:
    study = analysed_two_of_stare(tmp_path)

    assert not (study / "derived" / "damage.csv").exists()
    assert () == study_problems(study)
    table = study / "derived" / "trials.csv"
    table.write_text(table.read_text().replace("complete", "compLete", 1))
    (said,) = study_problems(study)
    assert "trials.csv is not as analysis wrote it" in said


def test_export_of_a_damaged_recording_is_refused(damaged: Path, tmp_path: Path) -> None:
    session = sorted(damaged.glob("sub-*/ses-001"))[0]
    refused = visavis("export", str(session), "-o", str(tmp_path / "out"))

    assert isinstance(refused.exception, DataError)
    assert not (tmp_path / "out").exists()
    again = visavis("export", str(session), "-o", str(tmp_path / "out"), "--accept-damage")
    assert 0 == again.exit_code, again.output


def test_check_says_per_stream_and_trial_what_is_missing(damaged: Path, intact: Path) -> None:
    session = sorted(damaged.glob("sub-*/ses-001"))[0]
    checked = visavis("check", str(session))

    assert 5 == checked.exit_code
    assert "gaze (part 1)" in checked.output
    assert "2 lines of the journal" in checked.output.replace("\n", " ")
    same = intact / session.parent.name / session.name
    assert "every file closed and verified" in visavis("check", str(same)).output
    assert "crashed" == Recording(session).status


@pytest.mark.parametrize(
    "verb",
    [
        ("view", "-o", "page.html"),
        ("film", "--trial", "T01", "-o", "trial.avi"),
        ("redraw", "--frame", "1", "--png", "frame.png"),
        ("quality", "-o", "quality"),
    ],
    ids=lambda verb: verb[0],
)
def test_nothing_is_shown_of_a_damaged_recording_unasked(
    verb: tuple[str, ...], damaged: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    session = sorted(damaged.glob("sub-*/ses-001"))[0]
    refused = visavis(verb[0], str(session), *verb[1:])

    assert isinstance(refused.exception, DataError), refused.output
    assert "2 lines of the journal cannot be read" in str(refused.exception)
    assert [] == list(tmp_path.iterdir())


def test_what_is_left_of_a_damaged_recording_is_shown_where_that_is_asked(
    damaged: Path, tmp_path: Path
) -> None:
    session = sorted(damaged.glob("sub-*/ses-001"))[0]
    shown = visavis("quality", str(session), "-o", str(tmp_path / "quality"), "--accept-damage")

    assert 0 == shown.exit_code, shown.output
    assert "1 of 1 recordings is damaged" in shown.output.replace("\n", " ")
    assert "gaze quality" == registered_exports(damaged)[-1].what


def test_a_script_measures_nothing_of_a_damaged_recording_unasked(damaged: Path) -> None:
    with pytest.raises(DataError, match="2 lines of the journal cannot be read"):
        open_study(damaged).participants()
    assert 2 == len(open_study(damaged, accept_damage=True).participants())
