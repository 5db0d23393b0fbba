"""Gaze that is mirrored or rotated as a whole is named; ordinary errors are not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from visavis.analysis.gaze.turned_gaze import turned_gaze
from visavis.lab.geometry import direction_from_yaw_pitch_deg
from visavis.protocol.session.gaze_setup import TARGETS

AIMS = [np.tile(direction_from_yaw_pitch_deg(yaw, pitch), (30, 1)) for _, yaw, pitch in TARGETS]


def gaze_at(matrix, *, noise_deg=0.5, seed=1):
    """Return thirty samples at each target, turned by a matrix."""
    rng = np.random.default_rng(seed)
    directions = []
    for aim in AIMS:
        off = Rotation.from_rotvec(np.radians(rng.normal(0, noise_deg, 3))).as_matrix()
        samples = aim @ (off @ matrix).T
        samples[::7] = np.nan
        directions.append(samples)
    return directions


@pytest.mark.parametrize(
    ("matrix", "across"),
    [
        (np.diag([-1.0, 1.0, 1.0]), "left and right"),
        (np.diag([1.0, -1.0, 1.0]), "up and down"),
    ],
)
def test_mirrored_gaze_is_named_with_its_axis(matrix, across):
    directions = turned_gaze(AIMS, gaze_at(matrix))

    assert (directions.kind, directions.mirrored_across) == ("mirrored", across)
    assert f"gaze is mirrored ({across} exchanged)" in directions.sentence()


@pytest.mark.parametrize("roll_deg", [25.0, -90.0, 180.0])
def test_gaze_rotated_about_the_line_of_sight_is_named_with_its_angle(roll_deg):
    roll = Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()

    directions = turned_gaze(AIMS, gaze_at(roll))

    assert directions.kind == "rolled"
    assert abs(abs(directions.roll_deg) - abs(roll_deg)) < 3.0
    assert "about the line of sight" in directions.sentence()


def test_a_camera_that_looks_down_on_the_head_is_told_as_a_shift():
    down = Rotation.from_euler("x", -12.0, degrees=True).as_matrix()

    directions = turned_gaze(AIMS, gaze_at(down))

    assert directions.kind == "shifted"
    assert abs(directions.up_deg + 12.0) < 1.0
    assert "too low" in directions.sentence()


@pytest.mark.parametrize("seed", range(20))
def test_error_without_a_pattern_is_not_called_a_turn(seed):
    assert turned_gaze(AIMS, gaze_at(np.eye(3), noise_deg=4.0, seed=seed)) is None


def test_good_gaze_is_not_called_a_turn():
    assert turned_gaze(AIMS, gaze_at(np.eye(3))) is None


def test_lost_gaze_says_nothing():
    lost = [np.full((30, 3), np.nan) for _ in AIMS]

    assert turned_gaze(AIMS, lost) is None
