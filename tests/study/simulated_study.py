"""A study file that is simulated before a screen and analysed; an example that is killed once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import visavis.running.sessions.simulation
from tests.faults.sessions import TIMING
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
    with quick_targets():
        invoked(*words)
    folder = file.parent / "simulated" / file.stem
    invoked("analyse", str(folder), "--processes", "1")
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


@contextmanager
def quick_targets(request_of: Callable[..., Request] = simulated_request) -> Iterator[None]:
    """Let targets of calibrations stand for less time in sessions that `visavis simulate` begins:
    they take longer than the trials of a small study. `request_of` makes the requests.
    """

    def quick_request(*words: Any, **keywords: Any) -> Request:
        return replace(request_of(*words, **keywords), timing=TIMING)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(visavis.running.sessions.simulation, "simulated_request", quick_request)
        yield


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
    with quick_targets(_killed_once):
        stopped = CliRunner().invoke(app, words)
    assert stopped.exception is not None
    with quick_targets():
        assert "1 were interrupted; their rest is simulated" in invoked(*words)
    found = folder / "out" / "simulated" / name
    assert 2 == len(read_manifest(found / "sub-S02C" / "ses-001").parts)
    invoked("analyse", str(found), "--processes=1")
    return found
