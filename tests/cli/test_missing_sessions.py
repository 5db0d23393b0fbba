"""Who vanishes from a study is missed, by check, by analyse and by scripts."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.cli.test_changed_design import STUDY, simulated
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.errors import DataError, LabError, RecordingError
from visavis.protocol.people.ledger import Ledger
from visavis.recording.folder import open_session
from visavis.recording.sealed import copy_path
from visavis.running.scripts import open_study
from visavis.running.sessions.bill_of_lading import bill_of_lading
from visavis.running.sessions.recorded_part import begin_part
from visavis.running.sessions.session_list import list_session


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a study's file and two simulated sessions."""
    root = tmp_path_factory.mktemp("recorded")
    (root / "meet.py").write_text(STUDY, "utf-8")
    simulated(root / "meet.py", root / "out", 2)
    return root


@pytest.fixture
def study(recorded: Path, tmp_path: Path) -> Path:
    shutil.copytree(recorded / "out", tmp_path / "out")
    return tmp_path / "out/simulated/meet"


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, [*arguments])
    assert result.exception is None or isinstance(result.exception, (LabError, SystemExit))
    text = f"{result.output} {result.exception or ''}"
    return result.exit_code or int(result.exception is not None), " ".join(text.split())


def both(path: Path, change: Callable[[Path], object]) -> None:
    for one in (path, copy_path(path)):
        change(one)


def cut_by_a_line(path: Path) -> None:
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))


def as_link(folder: Path) -> None:
    folder.rename(folder.parent.parent / "elsewhere")
    folder.symlink_to(folder.parent.parent / "elsewhere")


def as_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def as_link_to_itself(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


@pytest.mark.parametrize("name", ["sessions.jsonl", "study.json", "participants.jsonl"])
@pytest.mark.parametrize("change", [as_pipe, as_link_to_itself])
def test_what_is_no_file_is_named_and_no_internal_error(
    change: Callable[[Path], None], name: str, study: Path
) -> None:
    change(study / name)
    code, text = run("check", str(study))
    assert 0 != code
    assert name in text
    code, text = run("recover", str(study))  # puts some back from their copies, names the others
    assert name in text


PART_2 = "sub-S02C/ses-001/part-02"
HEAD = "sub-S02C/ses-001/part-01/head.arrows"
LOSSES: dict[str, tuple[Callable[[Path], None], str]] = {
    "a person": (lambda s: shutil.rmtree(s / "sub-S02C"), "sub-S02C/ses-001 is gone"),
    "a session": (lambda s: shutil.rmtree(s / "sub-S02C/ses-001"), "sub-S02C/ses-001 is gone"),
    "a part": (lambda s: shutil.rmtree(s / "sub-S02C/ses-001/part-01"), "sub-S02C/ses-001 is gone"),
    "the ledger": (lambda s: both(s / "participants.jsonl", Path.unlink), "does not know sub-S01B"),
    "what the ledger held": (
        lambda s: both(s / "participants.jsonl", lambda p: void(p.write_bytes(b""))),
        "does not know sub-S01B",
    ),
    "a line of the ledger": (
        lambda s: both(s / "participants.jsonl", cut_by_a_line),
        "does not know sub-S02C",
    ),
    "the settings": (lambda s: both(s / "study.json", Path.unlink), "study.json and its copy"),
    "a part that is there twice": (
        lambda s: void(shutil.copytree(s / "sub-S02C/ses-001/part-01", s / PART_2)),
        "part-02 does not belong to this recording",
    ),
    "a stream that is there twice": (
        lambda s: void(shutil.copyfile(s / HEAD, (s / HEAD).with_name("other.arrows"))),
        "other.arrows is no file of this part",
    ),
    "the list of sessions": (lambda s: both(s / "sessions.jsonl", Path.unlink), "is gone or empty"),
    "what the list held": (
        lambda s: both(s / "sessions.jsonl", lambda p: void(p.write_bytes(b""))),
        "is gone or empty",
    ),
    "a line of the list": (
        lambda s: both(s / "sessions.jsonl", cut_by_a_line),
        "does not say how sub-S02C/ses-001 ended",
    ),
    "two lines of the list": (
        lambda s: both(s / "sessions.jsonl", lambda p: [cut_by_a_line(p) for _ in "ab"]),
        "does not know sub-S02C/ses-001",
    ),
    "a session for a link": (lambda s: as_link(s / "sub-S02C/ses-001"), "ses-001 is a link"),
    "a list for a link": (lambda s: as_link(s / "sessions.jsonl"), "sessions.jsonl is a link"),
    "a folder for a link": (lambda s: as_link(s / "sub-S02C"), "sub-S02C is a link"),
}


def void(_: object) -> None:
    """Return nothing of something."""


@pytest.mark.parametrize(("lose", "said"), LOSSES.values(), ids=list(LOSSES))
def test_what_is_gone_from_a_study_is_named(
    study: Path, lose: Callable[[Path], None], said: str
) -> None:
    assert 0 == run("check", str(study))[0]
    lose(study)
    code, text = run("check", str(study))
    assert 0 != code
    assert said in text


def test_recover_adds_to_the_list_how_a_session_ended(study: Path) -> None:
    both(study / "sessions.jsonl", cut_by_a_line)
    assert 0 == run("recover", str(study))[0]
    assert 0 == run("check", str(study))[0]


def test_sessions_of_a_study_from_before_there_was_a_list_are_not_missed_by_it(study: Path) -> None:
    for path in study.glob("*sessions*"):
        path.unlink()
    assert 0 == run("check", str(study))[0]
    session = study / "sub-S02C/ses-001"
    list_session(session, 1, "complete", "2026-01-01T00:00:00+00:00")
    assert 0 == run("check", str(study))[0]
    shutil.rmtree(study / "sub-S01B")  # which an earlier version recorded, and nobody listed
    assert "does not know" not in run("check", str(study))[1]


def test_half_of_the_people_are_not_analysed_as_if_they_were_all(study: Path) -> None:
    shutil.rmtree(study / "sub-S02C")
    code, text = run("analyse", str(study), "--processes", "1")
    assert 0 != code
    assert "sub-S02C/ses-001 is gone" in text
    with pytest.raises(DataError, match="sub-S02C/ses-001 is gone"):
        open_study(study).trials()


def test_a_damaged_list_is_named_before_a_session_begins_and_leaves_no_part_open(
    study: Path,
) -> None:
    both(study / "sessions.jsonl", lambda path: void(path.write_bytes(b"x" + path.read_bytes())))
    session = study / "sub-S02C/ses-001"
    before = (session / "manifest.json").read_bytes()
    folder, _ = open_session(session)
    with folder, pytest.raises(RecordingError, match=r"sessions.jsonl.*visavis recover"):
        begin_part(SimClock(), folder)
    assert before == (session / "manifest.json").read_bytes()


def test_who_withdrew_or_was_signed_off_is_not_missed(study: Path) -> None:
    Ledger(study, SimClock(), prefix="S").withdraw("S02C", [study])
    assert 0 == run("check", str(study))[0]
    shutil.rmtree(study / "sub-S01B")
    assert 0 != run("check", str(study))[0]
    code, text = run("check", str(study), "--sign")
    assert (0, True) == (code, "signed off, no part of the study any more: sub-S01B" in text), text
    assert 0 == run("check", str(study))[0]


def test_a_bill_of_lading_says_what_a_copy_on_another_computer_lacks(
    study: Path, tmp_path: Path
) -> None:
    bill = tmp_path / "bill.json"
    code, text = run("check", str(study), "--baseline", str(bill))
    digits = text.partition("bill of lading: ")[2][:64]
    assert (0, 64) == (code, len(digits))
    copy = tmp_path / "elsewhere/simulated/meet"
    shutil.copytree(study, copy, ignore=shutil.ignore_patterns("derived", ".*"))
    for baseline in (str(bill), digits, digits[:16]):
        assert 0 == run("check", str(copy), "--against", baseline)[0]

    stream = next((copy / "sub-S01B/ses-001/part-01").glob("*.arrows"))
    content = stream.read_bytes()
    stream.unlink()
    assert f"not {digits}" in run("check", str(copy), "--against", digits)[1]
    stream.write_bytes(content)
    remark = copy / "sub-S01B/remarks.jsonl"
    remark.write_text("{}", "utf-8")
    assert f"not {digits}" in run("check", str(copy), "--against", digits)[1]
    remark.unlink()
    for said in (("--baseline", str(bill)), ("--against", digits)):
        session = copy / "sub-S01B/ses-001"
        assert "are of a whole study" in run("check", str(session), *said)[1]
    written = bill.read_bytes()
    assert "exists already" in run("check", str(copy), "--baseline", str(bill))[1]
    assert written == bill.read_bytes()

    shutil.rmtree(copy / "sub-S02C")
    for path in copy.glob("*sessions*"):
        path.unlink()  # so that only the bill knows
    code, text = run("check", str(copy), "--against", str(bill))
    assert (5, True) == (code, "sub-S02C/ses-001 is gone: complete" in text), text
    code, text = run("check", str(copy), "--against", digits)
    assert (5, True) == (code, f"not {digits}" in text), text
    code, text = run("check", str(copy), "--against", "yesterday")
    assert "neither a file" in text
    bill.write_bytes(bill.read_bytes().replace(b"sub-S02C", b"sub-S09C").replace(b"S02C", b"S03C"))
    assert "is no bill of lading" in run("check", str(copy), "--against", str(bill))[1]


def test_the_bill_names_who_is_missing_and_when_they_were_last_seen(study: Path) -> None:
    Ledger(study, SimClock(), prefix="S").add()
    before = bill_of_lading(study)
    shutil.rmtree(study / "sub-S02C")
    states = {line.participant: line.state for line in bill_of_lading(study).lines}
    assert {"S01B": "complete", "S02C": "missing"} == {k: states[k] for k in ("S01B", "S02C")}
    assert ["has not come"] == [s for label, s in states.items() if label not in ("S01B", "S02C")]
    gone = next(line for line in bill_of_lading(study).lines if line.participant == "S02C")
    assert gone.last_seen
    assert before.sha256 != bill_of_lading(study).sha256


def test_an_analysis_and_its_report_name_the_hash_of_the_data(study: Path) -> None:
    code, text = run("analyse", str(study), "--processes", "1")
    assert 0 == code, text
    digits = bill_of_lading(study).sha256[:16]
    assert f"bill of lading: {digits}" in text
    report = (study / "derived/report.html").read_text("utf-8")
    assert f"--against {digits}" in report
