"""Options of headset runtimes and body trackers."""

from pathlib import Path

import pytest

from devices import registry
from devices.body_options import BODY_OPTION_MODELS
from devices.option_models import OPTION_MODELS
from lab.config import parse_config
from lab.config_files import EXAMPLE
from lab.errors import ConfigError

CONFIG = EXAMPLE.read_text("utf-8")


def with_role(*lines):
    """Return the shipped configuration with another eye tracker; roles do not matter here."""
    before, rest = CONFIG.split("  eye_tracker:\n", 1)
    kept = rest.splitlines(keepends=True)
    while kept and (kept[0].startswith("    ") or not kept[0].strip()):
        kept.pop(0)
    added = "".join(f"    {line}\n" for line in lines)
    return f"{before}  eye_tracker:\n{added}{''.join(kept)}"


def test_every_driver_has_options_and_every_option_a_driver():
    assert set(BODY_OPTION_MODELS) <= set(registry.BUILT_IN)
    assert set(BODY_OPTION_MODELS) <= set(OPTION_MODELS)


@pytest.mark.parametrize("driver", sorted(BODY_OPTION_MODELS))
def test_driver_without_options_is_accepted(driver):
    text = with_role(f"driver: {driver}", "simulated: true")
    config = parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)
    assert config.devices["eye_tracker"].driver == driver


@pytest.mark.parametrize(
    ("driver", "wrong", "told"),
    [
        ("xsens", "prot: 9763", "port"),
        ("natnet", "port: 70000", "65535"),
        ("openvr_trackers", "worn: [a, b]", "worn"),
    ],
)
def test_a_wrong_option_is_told(driver, wrong, told):
    text = with_role(f"driver: {driver}", "simulated: true", wrong)
    with pytest.raises(ConfigError, match=told):
        parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)


def test_worn_trackers_keep_their_serial_numbers():
    text = with_role(
        "driver: openvr_trackers", "simulated: true", "worn: {LHR-0A1B2C3D: left_hand}"
    )
    config = parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)
    assert config.devices["eye_tracker"].options["worn"] == {"LHR-0A1B2C3D": "left_hand"}
