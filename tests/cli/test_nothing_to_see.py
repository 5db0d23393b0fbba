"""A session with a person shows something, or does not begin."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from visavis.cli.doctor.machine import computer
from visavis.cli.main import app
from visavis.lab.clock import SystemClock
from visavis.lab.config import DeviceConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError


def visavis(*command: str) -> Result:
    result = CliRunner().invoke(app, list(command))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    text = EXAMPLE.read_text("utf-8")
    assert "  show: none\n" in text
    (tmp_path / "lab_config.yaml").write_text(text, "utf-8")
    return tmp_path


def test_real_devices_without_a_picture_are_refused_before_anything_is_written(here: Path) -> None:
    remedy = (
        r"lab_config\.yaml: display\.show is none.*"
        r"set it to headset, screen or window.*--devices sim"
    )
    with pytest.raises(ConfigError, match=remedy):
        visavis("run", "stare", "--participant", "1", "--devices", "real")
    assert ["lab_config.yaml"] == [path.name for path in here.iterdir()]


def test_a_rehearsal_needs_no_picture(here: Path) -> None:
    short = [f"--set={name}" for name in ("trial_s=0.2", "intertrial_s=0.1", "repetitions=1")]
    result = visavis("simulate", "stare", "--participants", "1", "--processes", "1", *short)
    assert "1 participant simulated" in result.output


def test_doctor_says_so_too() -> None:
    lab = load_config(EXAMPLE)
    tracker = DeviceConfig(role="eye_tracker", driver="pupil_core", simulated=False, options={})
    real = lab.model_copy(update={"devices": {"eye_tracker": tracker}})
    (simulated_lab,) = (f for f in computer(lab, SystemClock()) if f.subject == "display")
    (real_lab,) = (f for f in computer(real, SystemClock()) if f.subject == "display")
    assert "ok" == simulated_lab.level
    assert "missing" == real_lab.level
    assert "headset, screen or window" in real_lab.remedy
