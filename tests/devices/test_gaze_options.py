"""Options of the eye trackers are checked before anything runs, and say line and cure."""

from pathlib import Path

import pytest

from devices import registry
from devices.gaze_options import GAZE_OPTION_MODELS
from devices.option_models import OPTION_MODELS
from lab.config import parse_config
from lab.config_files import EXAMPLE
from lab.errors import ConfigError

CONFIG = EXAMPLE.read_text("utf-8")


def with_tracker(*lines):
    before, rest = CONFIG.split("  eye_tracker:\n", 1)
    kept = rest.splitlines(keepends=True)
    while kept and (kept[0].startswith("    ") or not kept[0].strip()):
        kept.pop(0)
    tracker = "".join(f"    {line}\n" for line in lines)
    return f"{before}  eye_tracker:\n{tracker}{''.join(kept)}"


def test_every_driver_has_options_and_every_option_a_driver():
    assert set(GAZE_OPTION_MODELS) <= set(registry.BUILT_IN)
    assert set(GAZE_OPTION_MODELS) <= set(OPTION_MODELS)


@pytest.mark.parametrize("driver", sorted(GAZE_OPTION_MODELS))
def test_driver_without_options_is_accepted(driver):
    text = with_tracker(f"driver: {driver}", "simulated: true")

    config = parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)

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
    ],
)
def test_wrong_option_is_refused_with_its_line(driver, wrong, told):
    text = with_tracker(f"driver: {driver}", "simulated: true", wrong)
    line = text.splitlines().index(f"    {wrong}") + 1

    with pytest.raises(ConfigError) as refusal:
        parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)
    assert told in str(refusal.value)
    assert str(line) in str(refusal.value)
