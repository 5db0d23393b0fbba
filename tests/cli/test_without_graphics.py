"""Without graphics library or driver, studies are still simulated; whatever draws says why not."""

from pathlib import Path

import moderngl
import pytest
from typer.testing import CliRunner

from tests.sessions import SHORT_STARE
from visavis.cli.main import app
from visavis.stage.errors import StageError


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Hide every driver, as on a machine without EGL; return the attempts to open one."""
    attempts: list[object] = []

    def refuse(**asked: object) -> moderngl.Context:
        attempts.append(asked)
        # The library itself raises bare Exception with a text of this kind.
        raise Exception("requested device index 0, but found 0 devices")

    monkeypatch.setattr(moderngl, "create_context", refuse)
    return attempts


def test_a_study_is_simulated_without_opening_any_graphics(
    tried: list[object], tmp_path: Path
) -> None:
    arguments = ["simulate", "stare", "--participants", "1", "--seed", "5", "--processes", "1"]
    result = CliRunner().invoke(app, [*arguments, "--output", str(tmp_path), *SHORT_STARE])
    assert result.exception is None, result.output
    assert [] == tried
    assert list((tmp_path / "simulated" / "stare").glob("sub-*/ses-*/manifest.json"))


def test_preview_says_in_one_sentence_what_to_install(tried: list[object], tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    result = CliRunner().invoke(app, ["preview", "stare", "--png", str(path), "--at", "0"])
    assert isinstance(result.exception, StageError)
    said = str(result.exception)
    assert "apt install libegl1" in said
    assert "\n" not in said
    assert tried
    assert not path.exists()
