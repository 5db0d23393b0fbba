"""A study file that is simulated before a screen and analysed; an example that is killed once."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import visavis.running.sessions.simulation
from visavis.cli.main import app
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.recording.manifest import read_manifest
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.session_request import Request, simulated_request


def simulate_and_analyse(file: Path, text: str, *more: str, participants: int) -> Path:
    """Write a study file, let people perform it, and return the folder of the analysed study.

    `more` are further words of `visavis simulate`.
    """
    file.write_text(text, "utf-8")
    words = ["simulate", str(file), "--participants", str(participants), "--processes=1"]
    words += ["--output", str(file.parent), "--config", str(SCREEN_EXAMPLE), *more]
    result = CliRunner().invoke(app, words)
    assert 0 == result.exit_code, result.output
    folder = file.parent / "simulated" / file.stem
    result = CliRunner().invoke(app, ["analyse", str(folder), "--processes", "1"])
    assert 0 == result.exit_code, result.output
    return folder


def invoked(*words: str) -> str:
    """Return what a command prints."""
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return result.output


def _killed_once(study: OpenedStudy, *words: Any, **keywords: Any) -> Request:
    """Return a request that ends in the middle of one person's session."""
    request = simulated_request(study, *words, **keywords)

    def on_trial(_: object, count: int, __: object) -> None:
        if count == 3:
            raise KeyboardInterrupt

    return replace(request, on_trial=on_trial) if keywords["label"] == "S02C" else request


def killed_and_analysed(
    name: str,
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    *more: str,
    shows: str,
    participants: int = 4,
) -> Path:
    """Take an example from plan, which `shows` something, to its report, with a session that is
    killed once; return the folder of the study. `more` are further words of `visavis init`.
    """
    monkeypatch.chdir(folder)
    invoked("init", *more)
    invoked("examples")
    study = f"examples/{name}.py"
    assert shows in invoked("plan", study)
    words = ["simulate", study, "--participants", str(participants)]
    words += ["--output", "out", "--processes=1"]
    with monkeypatch.context() as patch:
        patch.setattr(visavis.running.sessions.simulation, "simulated_request", _killed_once)
        stopped = CliRunner().invoke(app, words)
    assert stopped.exception is not None
    assert "1 were interrupted; their rest is simulated" in invoked(*words)
    found = folder / "out" / "simulated" / name
    assert 2 == len(read_manifest(found / "sub-S02C" / "ses-001").parts)
    invoked("analyse", str(found), "--processes=1")
    return found
