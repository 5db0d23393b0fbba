"""What would hold up a frame is done before anything is shown, with a bar that says so."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "lab_config.yaml"
    path.write_bytes(EXAMPLE.read_bytes())
    return path


def visavis(config: Path, *arguments: str) -> str:
    result = CliRunner().invoke(app, [*arguments, "--config", str(config)])
    assert result.exception is None or isinstance(result.exception, UsageError), result.exception
    return " ".join(result.output.split())


@pytest.fixture
def readied(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what happens, in order; nothing is computed, and nothing is performed."""
    happened: list[str] = []

    def get_ready(study: Any, _: object, __: object, told: Callable[[int, int], None]) -> str:
        happened.append(f"{study.name} readied")
        told(1, 1)
        return "not rehearsed: no such wire"

    def screen(*_: object, **__: object) -> None:
        happened.append("operator's screen")
        raise UsageError("enough")

    monkeypatch.setattr("visavis.running.sessions.perform.get_ready", get_ready)
    monkeypatch.setattr("visavis.cli.commands.session.TerminalOperator", screen)
    monkeypatch.setattr("visavis.cli.commands.session.station_findings", lambda *_: ())
    return happened


def test_prepare_does_it_the_evening_before(config: Path, readied: list[str]) -> None:
    said = visavis(config, "prepare", "waving")
    assert ["waving readied"] == readied
    assert "getting waving ready" in said
    assert "not rehearsed: no such wire" in said
    assert "waving is ready after" in said


def test_no_screen_stands_empty_while_a_crowd_is_made_ready(
    config: Path, readied: list[str]
) -> None:
    said = visavis(config, "run", "crowd", "--participant", "1", "--body", "female")
    assert ["crowd readied", "operator's screen"] == readied
    assert "getting crowd ready" in said
