"""Boards in the scene: what a ray meets, where choices are, where a board hangs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.panels import DISTANCE_M, SIZE_M, board_pose, choice_centre_m, choice_met
from visavis.stimuli.picture import Panel

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
