"""Options are checked before anything runs, and say line and cure."""

from pathlib import Path

import pytest

from visavis.devices.registry import OPTION_MODELS, built_in
from visavis.lab.config import parse_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError

CONFIG = EXAMPLE.read_text("utf-8")
OF_NEED = (
    "ascii_armband",
    "ble_armband",
    "hid_armband",
    "spp_armband",
    "usb_armband",
    "labjack_triggers",
    "lsl_triggers",
    "parallel_triggers",
    "serial_triggers",
    "xid_triggers",
)
"""Drivers that cannot do without an option."""


def with_tracker(*lines):
    """Return the shipped configuration with another eye tracker; roles do not matter here."""
    before, rest = CONFIG.split("  eye_tracker:\n", 1)
    kept = rest.splitlines(keepends=True)
    while kept and (kept[0].startswith("    ") or not kept[0].strip()):
        kept.pop(0)
    tracker = "".join(f"    {line}\n" for line in lines)
    return f"{before}  eye_tracker:\n{tracker}{''.join(kept)}"


def parsed(*lines):
    return parse_config(with_tracker(*lines), Path("lab_config.yaml"), OPTION_MODELS)


@pytest.mark.parametrize("driver", sorted(set(built_in()) - set(OF_NEED)))
def test_driver_without_options_is_accepted(driver):
    config = parsed(f"driver: {driver}", "simulated: true")
    assert config.devices["eye_tracker"].driver == driver


@pytest.mark.parametrize(
    ("driver", "wrong", "told"),
    [
        ("fove", "librarypath: x", "library_path"),
        ("gazepoint", "port: 99999", "port"),
        ("neon", "focal_length_px: -3", "focal_length_px"),
        ("hid_gaze", "time_unit_us: -1", "time_unit_us"),
        ("lsl_gaze", "streamname: x", "stream_name"),
        ("eyelink", "screen_width_px: 0", "screen_width_px"),
        ("xsens", "prot: 9763", "port"),
        ("natnet", "port: 70000", "65535"),
        ("openvr_trackers", "worn: [a, b]", "worn"),
    ],
)
def test_wrong_option_is_refused_with_its_line(driver, wrong, told):
    text = with_tracker(f"driver: {driver}", "simulated: true", wrong)
    line = text.splitlines().index(f"    {wrong}") + 1

    with pytest.raises(ConfigError) as refusal:
        parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)
    assert told in str(refusal.value)
    assert str(line) in str(refusal.value)


def test_worn_trackers_keep_their_serial_numbers():
    config = parsed("driver: openvr_trackers", "simulated: true", "worn: {LHR-0A1B2C3D: left_hand}")
    assert config.devices["eye_tracker"].options["worn"] == {"LHR-0A1B2C3D": "left_hand"}


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("{kind: los}", "did you mean 'loss'"),
        ("{kind: loss, amont: 0.1}", "did you mean 'amount'"),
        ("{kind: loss, amount: 3}", "share from 0 to 1"),
        ("{kind: loss, start_s: soon}", "wrong or missing value"),
    ],
)
def test_wrong_fault_is_told_with_the_file_that_was_given_and_its_line(fault, told):
    text = with_tracker("driver: neon", "simulated: true", f"faults: [{fault}]")
    line = 1 + text[: text.index("faults:")].count("\n")
    with pytest.raises(ConfigError) as wrong:
        parse_config(text, Path("pilot/other_lab.yaml"), OPTION_MODELS)
    said = str(wrong.value)
    assert told in said
    assert "devices.eye_tracker.faults" in said
    assert f"other_lab.yaml:{line}:" in said
    assert "lab_config.yaml" not in said
