"""Doctor compares the monitor participants sit before with what the lab says of it."""

from pathlib import Path

import pytest

from visavis.cli.doctor import machine as doctor_machine
from visavis.cli.doctor.machine import Monitor
from visavis.cli.doctor.report import examine
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import SimClock
from visavis.lab.config import load_config, parse_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.errors import ConfigError
from visavis.running.sessions.device_setup import check_rig

TEXT = SCREEN_EXAMPLE.read_text("utf-8")
REAL_KEYS = TEXT.replace(
    "driver: keyboard\n    simulated: true",
    "driver: keyboard\n  headset:\n    driver: simulated_headset\n    simulated: true",
).replace("    keys: {space: trigger, enter: select}\n", "")
"""The keyboard is a real one; a headset is there for when the screen is not."""


def finding(monkeypatch, *monitors, text=TEXT):
    monkeypatch.setattr(doctor_machine, "monitors", lambda: list(monitors))
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
    verdict = finding(monkeypatch, *monitors, text=text)
    assert verdict.level == level
    assert said in verdict.found
    assert verdict.remedy


def test_no_headset_is_missed_where_people_sit_before_a_screen(tmp_path):
    path = tmp_path / "lab_config.yaml"
    path.write_text(TEXT, "utf-8")
    told = examine(load_config(path, OPTION_MODELS), SimClock())
    assert "headset" not in {f.subject for f in told.findings}
    path.write_text(TEXT.replace("show: screen", "show: headset"), "utf-8")
    told = examine(load_config(path, OPTION_MODELS), SimClock())
    assert "headset" in {f.subject for f in told.findings if f.level == "missing"}


def keyboard_lab(show):
    text = REAL_KEYS.replace("show: screen", f"show: {show}")
    return parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)


@pytest.mark.parametrize("show", ["none", "headset", "offscreen"])
def test_a_keyboard_that_no_window_would_hear_is_named_before_anything_is_opened(show):
    lab = keyboard_lab(show)
    (verdict,) = doctor_machine._keyboards(lab)
    assert (verdict.subject, verdict.level) == ("responses", "missing")
    assert f"display.show is {show}" in verdict.found
    assert "screen" in verdict.remedy
    with pytest.raises(ConfigError, match=r"no window hears devices\.responses") as told:
        check_rig(lab)
    assert verdict.remedy in str(told.value)


@pytest.mark.parametrize("show", ["screen", "window"])
def test_a_keyboard_is_heard_in_the_window_people_sit_before(show):
    lab = keyboard_lab(show)
    assert doctor_machine._keyboards(lab) == ()


def test_the_table_of_luminances_is_there_wanting_or_damaged(tmp_path):
    path = tmp_path / "lab_config.yaml"
    path.write_text(TEXT, "utf-8")
    lab = load_config(path, OPTION_MODELS)
    (verdict,) = doctor_machine._luminances(lab)
    assert ("note", "run: visavis devices luminance (docs/screens.md)") == (
        verdict.level,
        verdict.remedy,
    )
    rows = "".join(f"{level},{0.4 + level}\n" for level in (0, 50, 100, 150, 200, 255))
    lab.luminance_path.write_text(f"level,cd_m2\n{rows}", "utf-8")
    (verdict,) = doctor_machine._luminances(load_config(path, OPTION_MODELS))
    assert ("ok", "0.4 to 255.4 cd/m²") == (verdict.level, verdict.found.split(", ")[1])
    lab.luminance_path.write_text("level,cd_m2\n0,1\n", "utf-8")
    (verdict,) = doctor_machine._luminances(load_config(path, OPTION_MODELS))
    assert "missing" == verdict.level
    assert "measure 6 or more" in verdict.found
    lab = parse_config(TEXT.replace("show: screen", "show: headset"), path, OPTION_MODELS)
    assert () == doctor_machine._luminances(lab)
