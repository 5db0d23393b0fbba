"""Doctor compares the monitor participants sit before with what the lab says of it."""

from pathlib import Path

import pytest

from cli.doctor import machine as doctor_machine
from cli.doctor.machine import Monitor
from cli.doctor.report import examine
from devices.registry import OPTION_MODELS
from lab.clock import SimClock
from lab.config import load_config, parse_config
from lab.config_files import SCREEN_EXAMPLE

TEXT = SCREEN_EXAMPLE.read_text("utf-8")


def finding(monkeypatch, *monitors, text=TEXT):
    monkeypatch.setattr(doctor_machine, "_monitors", lambda: list(monitors))
    return doctor_machine._screens(parse_config(text, Path("lab_config.yaml"), OPTION_MODELS))


def test_the_monitor_that_is_described_is_ready(monkeypatch):
    assert finding(monkeypatch, Monitor(1920, 1080, 60)).level == "ok"


@pytest.mark.parametrize(
    ("monitors", "text", "level", "said"),
    [
        ([], TEXT, "missing", "no screen"),
        ([Monitor(2560, 1440, 60)], TEXT, "missing", "other pixels"),
        ([Monitor(1920, 1080, 144)], TEXT, "warning", "refreshes otherwise"),
        ([Monitor(1920, 1080, 60)], TEXT.replace("monitor: 0", "monitor: 1"), "missing", "none of"),
        ([Monitor(1920, 1080, 60)], TEXT.replace("0.299", "0.330"), "warning", "not square"),
        (
            [Monitor(1920, 1080, 60)],
            TEXT.replace("fullscreen: true", "fullscreen: false"),
            "warning",
            "in a window",
        ),
    ],
)
def test_what_differs_is_named(monkeypatch, monitors, text, level, said):
    found = finding(monkeypatch, *monitors, text=text)
    assert found.level == level
    assert said in found.found
    assert found.remedy


def test_no_headset_is_missed_where_people_sit_before_a_screen(tmp_path):
    path = tmp_path / "lab_config.yaml"
    path.write_text(TEXT, "utf-8")
    told = examine(load_config(path, OPTION_MODELS), SimClock())
    assert "headset" not in {f.subject for f in told.findings}
    path.write_text(TEXT.replace("show: screen", "show: headset"), "utf-8")
    told = examine(load_config(path, OPTION_MODELS), SimClock())
    assert "headset" in {f.subject for f in told.findings if f.level == "missing"}
