"""Whoever runs a session blind learns neither condition nor group from any output."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from tests.sessions import lab_in
from visavis.cli.desk.link import status_message
from visavis.cli.desk.scene_view import LastGaze
from visavis.cli.main import app
from visavis.cli.operator_screen import render
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.protocol.session.operator import SessionStatus, UnattendedOperator
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

STUDY = """
from visavis import Choice, Factor, Study, Text

study = Study("arms", factors=[Factor("arm", ["quokka", "zebra"], between=True),
                               Factor("task", ["okapi", "tapir"])],
              repetitions=2, blocked_by="task", calibrate=False, uses=(), texts="words",
              instructions="read"{blind})

@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.1)
    yield t.ask(Choice("seen", ["yes", "no"]))
"""
WORDS = """
blocks: {part: "The {level}"}
instructions: {task: {okapi: "Look for the okapi.", tapir: "Look for the tapir."}}
pause: "Next comes the {level}."
"""
NAMES = ("quokka", "zebra", "okapi", "tapir")


class _Watching(UnattendedOperator):
    """An operator who keeps whatever a terminal and a desk would show."""

    status_period_ns = 1

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def show(self, status: SessionStatus) -> None:
        """Keep a status as the terminal and the desk show it."""
        console = Console(file=StringIO(), width=160, color_system=None)
        console.print(render(status, "", is_simulated=True))
        message = status_message(1, status, LastGaze())
        self.texts += [console.file.getvalue(), json.dumps(message)]  # type: ignore[attr-defined]

    def waits_for_advance(self, prompt: str) -> bool:
        """Keep what is asked."""
        self.texts.append(prompt)
        return super().waits_for_advance(prompt)


def study_file(folder: Path, blind: str = ", blind=True") -> Path:
    (folder / "words").mkdir()
    (folder / "words" / "en.yaml").write_text(WORDS, "utf-8")
    (folder / "arms.py").write_text(STUDY.replace("{blind}", blind), "utf-8")
    return folder / "arms.py"


def given_away(texts: list[str]) -> set[str]:
    return {name for name in NAMES for text in texts if name in text}


def performed(folder: Path, *, is_blind: bool) -> list[str]:
    """Return all that an operator reads during a session, and the names of its files."""
    study = find_study(str(study_file(folder, "")))
    config = lab_in(folder, SCREEN_EXAMPLE)
    operator, progress = _Watching(), []
    request = simulated_request(study, study.experiment({}), config, label="S01B", index=0, seed=1)

    def on_trial(*about: object) -> None:
        progress.append(str(about))

    perform_new(replace(request, operator=operator, blind=is_blind, on_trial=on_trial))
    files = [str(path.relative_to(folder / "data")) for path in (folder / "data").rglob("*")]
    return [*operator.texts, *progress, *files]


def test_a_session_gives_no_condition_and_no_group_away(tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "blind").mkdir()
    assert len(given_away(performed(tmp_path / "open", is_blind=False))) > 2
    assert set() == given_away(performed(tmp_path / "blind", is_blind=True))


def test_a_blind_study_gives_no_group_away_at_any_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said: dict[str, str] = {}

    def type_in(*words: str) -> None:
        result: Any = CliRunner().invoke(app, list(words))
        assert result.exit_code == 0, result.output
        said[" ".join(words)] = result.output

    type_in("init", "--screen")
    file = str(study_file(tmp_path))
    for number in ("1", "2"):
        type_in("participant", "add", file, number)
    type_in("participant", "list", file)
    type_in("run", file, "--participant", "1", "--fast", "--devices", "sim")
    type_in("board", file)
    type_in("plan", file, "--participant", "1")
    type_in("plan", file, "--participant", "1", "--json")
    (session,) = tmp_path.rglob("ses-001")
    type_in("check", str(session))
    type_in("check", file)
    for command, text in said.items():
        assert "quokka" not in text, command
        assert "zebra" not in text, command
    assert "hidden" in said[f"participant list {file}"]
    assert "okapi" in said[f"plan {file} --participant 1"]
