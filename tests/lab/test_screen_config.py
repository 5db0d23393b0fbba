"""A screen is described once, in full, and whoever needs it is told."""

from pathlib import Path

import pytest

from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import parse_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.yaml_lines import ProblemsError

SCREEN = "{width_m: 0.6, height_m: 0.34, width_px: 2560, height_px: 1440, distance_m: 0.7}"
LAB = """
lab: L
data_root: d
key_root: k
display: {show: SHOW, screen: SCREEN}
privacy: {consent_version: "1"}
devices: {eye_tracker: TRACKER}
"""


def read(*, show="screen", screen=SCREEN, tracker="{driver: gazepoint}"):
    text = LAB.replace("SHOW", show).replace("SCREEN", screen).replace("TRACKER", tracker)
    return parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)


def refusal(**given):
    with pytest.raises(ProblemsError) as refused:
        read(**given)
    return str(refused.value)


def test_a_screen_based_tracker_takes_the_screen_from_the_display():
    options = read().devices["eye_tracker"].options
    assert options["screen_width_mm"] == 600.0
    assert options["screen_height_mm"] == 340.0
    assert options["screen_distance_mm"] == 700.0


def test_an_eyelink_is_told_the_pixels_too():
    options = read(tracker="{driver: eyelink}").devices["eye_tracker"].options
    assert (options["screen_width_px"], options["screen_height_px"]) == (2560, 1440)


def test_a_second_description_that_differs_is_refused():
    said = refusal(tracker="{driver: gazepoint, screen_distance_mm: 650}")
    assert "display.screen says 700" in said
    assert read(tracker="{driver: gazepoint, screen_distance_mm: 700}").devices


def test_a_tracker_keeps_its_own_screen_where_participants_wear_a_headset():
    options = read(show="headset").devices["eye_tracker"].options
    assert options["screen_distance_mm"] == 650.0


def test_show_screen_without_a_screen_says_what_is_missing():
    assert "size, pixels and distance" in refusal(screen="null")


def test_an_unknown_setting_of_the_screen_gets_the_nearest_one():
    said = refusal(screen=SCREEN.replace("distance_m", "distence_m"))
    assert "distance_m" in said


def test_eyes_that_look_past_the_screen_are_refused():
    assert "past the screen" in refusal(screen=SCREEN.replace("{", "{center_up_m: 0.2, "))


def test_the_example_of_a_screen_lab_is_a_valid_configuration():
    config = parse_config(SCREEN_EXAMPLE.read_text("utf-8"), SCREEN_EXAMPLE, OPTION_MODELS)
    assert config.display.on_screen is not None
    assert config.display.on_screen.flat.width_px == 1920
