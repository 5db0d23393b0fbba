"""Boards in the scene: what a ray meets, where choices are, where a board hangs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ImageFont

import visavis
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, rotate
from visavis.stage.panel_image import panel_image
from visavis.stimuli.panels import (
    DISTANCE_M,
    SIZE_M,
    board_pose,
    choice_boxes_01,
    choice_centre_m,
    choice_met,
    place_m,
    place_met_01,
    track_01,
    track_boxes_01,
)
from visavis.stimuli.picture import Panel
from visavis.stimuli.text_font import font_for

FORWARD = np.array([0.0, 0.0, -1.0])


def board(yaw_deg: float = 0.0, n: int = 5, head_m: tuple[float, ...] = (0.0, 1.6, 0.0)) -> Panel:
    head = Pose(np.array(head_m), quat_from_yaw_pitch_deg(yaw_deg, -20.0))
    return Panel("How real?", tuple(map(str, range(n))), board_pose(head), SIZE_M)


@given(st.floats(-180, 180), st.integers(1, 9), st.data())
def test_ray_towards_the_middle_of_a_choice_meets_it(
    yaw_deg: float, n: int, data: st.DataObject
) -> None:
    panel = board(yaw_deg, n)
    choice = data.draw(st.integers(0, n - 1))
    eye_m = np.array([0.1, 1.4, 0.05])
    assert choice == choice_met(panel, eye_m, choice_centre_m(panel, choice) - eye_m)


@pytest.mark.parametrize(
    "direction", [FORWARD, -FORWARD, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])]
)
def test_ray_beside_the_choices_or_away_from_the_board_meets_none(direction: np.ndarray) -> None:
    assert choice_met(board(), np.array([0.0, 1.75, 0.0]), direction) is None


def test_board_is_not_met_from_behind() -> None:
    panel = board()
    behind = panel.pose.position_m + np.array([0.0, 0.0, -1.0])
    assert choice_met(panel, behind, choice_centre_m(panel, 2) - behind) is None


@given(st.floats(-180, 180))
def test_board_hangs_upright_at_eye_height_straight_ahead(yaw_deg: float) -> None:
    panel = board(yaw_deg)
    away = panel.pose.position_m - np.array([0.0, 1.6, 0.0])
    assert away == pytest.approx(
        DISTANCE_M * rotate(quat_from_yaw_pitch_deg(yaw_deg, 0.0), FORWARD), abs=1e-9
    )
    front = rotate(panel.pose.orientation_wxyz, -FORWARD)
    assert front == pytest.approx(-away / DISTANCE_M, abs=1e-9)


def test_words_of_every_language_are_drawn_with_their_own_characters() -> None:
    text = "„Größe“ – déjà vu, « œuvre » …’ ÄÖÜß"
    font, box = font_for(text, 24), bytes(font_for(text, 24).getmask("\uffff"))
    lacking = [c for c in text if not c.isspace() and bytes(font.getmask(c)) == box]
    assert [] == lacking
    assert font_for("How lively?", 24).getname() == ImageFont.load_default(24).getname()


def test_no_other_module_chooses_a_font() -> None:
    root = Path(visavis.__file__).parent
    users = {p.stem for p in root.rglob("*.py") if "load_default(" in p.read_text("utf-8")}
    assert {"text_font"} == users


def test_a_board_has_a_row_for_every_name_with_its_track_and_a_ray_finds_it() -> None:
    panel = replace(board(n=1), tracks=("active", "large"), size_m=(0.3, 0.64))
    boxes = track_boxes_01(panel)
    assert boxes[0, 3] == pytest.approx(boxes[1, 1])
    assert boxes[1, 3] < choice_boxes_01(panel)[0, 1]
    begin, end, down = track_01(panel, 1)
    eye = np.array([0.1, 1.3, 0.0])
    place = place_m(panel, 0.5 * (begin + end), down)
    assert place_met_01(panel, eye, place - eye) == pytest.approx((0.5 * (begin + end), down))
    assert place_met_01(panel, eye, eye - place) is None
    without = panel_image(replace(panel, tracks=()))
    assert not np.array_equal(panel_image(panel), without)
