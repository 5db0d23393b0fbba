"""A verb that cannot go on says what to type next, in words of what was asked."""

import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.session_check import check_session
from cli.main import app
from cli.preview.capture import Capture
from lab.config_files import EXAMPLE
from lab.errors import LabError, SessionAborted
from protocol.session import Session
from recording.reader import Recording
from tests.faults.sessions import lab
from tests.visavis.sessions import STUDIES
from visavis.catalogue import find_study
from visavis.sessions.perform import perform_new, simulated_request


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
