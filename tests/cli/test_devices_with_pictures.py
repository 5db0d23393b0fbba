"""Devices are tried as a session opens them: with pictures, where the headset is to show some."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

import visavis.devices.drivers.openxr.wiring
from tests.faults.sessions import CONFIG
from visavis.cli.main import app
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.openxr.runtime import SimulatedXrRuntime
from visavis.stage.card.context import offscreen_context, release_offscreen
from visavis.stage.errors import StageError


class WithoutHeadless(SimulatedXrRuntime):
    """A runtime as those of Meta, HTC and Varjo on a PC: no session without pictures."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options, offers_headless=False)


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    pytest.importorskip("xr", reason="pip install pyopenxr")
    if find_compiler() is None:
        pytest.skip("the simulated runtime needs a C compiler: apt-get install gcc")
    try:
        release_offscreen(offscreen_context())
    except StageError as problem:
        pytest.skip(str(problem))
    monkeypatch.setattr(
        visavis.devices.drivers.openxr.wiring, "SimulatedXrRuntime", WithoutHeadless
    )
    path = tmp_path / "lab_config.yaml"
    lab = yaml.safe_load(CONFIG.read_text())
    lab["display"] = {"show": "offscreen"}
    lab["devices"] = {
        "eye_tracker": {"driver": "openxr_gaze", "simulated": True},
        "headset": {"driver": "openxr_headset", "simulated": True},
    }
    path.write_text(yaml.safe_dump(lab))
    return path


def typed(*arguments: str) -> Any:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code in (0, 6), result.output
    return result


@pytest.mark.parametrize("roles", [["headset"], ["eye_tracker"], []])
def test_devices_of_a_runtime_without_headless_sessions_are_tested_with_pictures(
    roles: list[str], config: Path
) -> None:
    result = typed("devices", "test", *roles, "--seconds", "0.5", "--json", "--config", str(config))
    trials = json.loads(result.stdout)
    assert (roles or ["eye_tracker", "headset"]) == [trial["role"] for trial in trials]
    assert {""} == {trial["error"] for trial in trials}
    assert all(trial["health"]["received"] > 10 for trial in trials)


def test_a_capture_is_made_with_pictures(config: Path, tmp_path: Path) -> None:
    wire = tmp_path / "eyes.wire"
    listening = ["--seconds", "0.5", "-o", str(wire), "--config", str(config)]
    typed("devices", "capture", "eye_tracker", *listening)
    assert "gaze" in typed("devices", "replay", str(wire)).output


def test_the_doctor_opens_devices_with_pictures(config: Path) -> None:
    result = CliRunner().invoke(app, ["doctor", "--self-test", "--json", "--config", str(config)])
    trials = json.loads(result.stdout)["trials"]
    assert {"eye_tracker": "", "headset": ""} == {t["role"]: t["error"] for t in trials}
