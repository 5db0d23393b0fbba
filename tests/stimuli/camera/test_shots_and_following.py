"""Shots are sized and cuts judged from the subject; the camera follows without swinging."""

import numpy as np
import pytest

from visavis.lab.errors import DesignError
from visavis.stimuli.camera.following import Drive, follow, pull
from visavis.stimuli.camera.shots import (
    LogNormalLengths,
    flow_cosine,
    image_velocity,
    shot_distance_m,
    shot_size_score,
    view_angle_deg,
)
from visavis.stimuli.motion.spring import Spring

HERE = np.array([0.0, 1.6, 0.0])
SOUTH = np.array([0.0, 1.6, 4.0])
ABOVE = np.array([0.0, 5.6, 0.0])


def test_person_fills_the_picture_where_half_of_both_subtend_the_same_angle() -> None:
    assert shot_distance_m(1.8, 90.0, 1.0) == pytest.approx(0.9)
    assert shot_size_score(3.0, 3.0) == 1.0


@pytest.mark.parametrize("wrong", [(0.0, 40.0, 1.0), (1.7, 180.0, 1.0), (1.7, 40.0, 0.0)])
def test_shot_of_nothing_is_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(DesignError, match="no shot shows"):
        shot_distance_m(*wrong)


def test_who_walks_right_in_one_picture_walks_left_in_the_one_from_behind() -> None:
    walking, north = np.array([1.0, 0.0, 0.0]), 2 * HERE - SOUTH

    assert (1.0, 0.0) == pytest.approx(image_velocity(HERE, walking, SOUTH))
    assert -1.0 == pytest.approx(flow_cosine(HERE, walking, SOUTH, north))
    assert 180.0 == pytest.approx(view_angle_deg(HERE, SOUTH, north))


def test_cut_without_motion_or_seen_from_straight_above_has_no_flow() -> None:
    assert np.isnan(flow_cosine(HERE, np.zeros(3), SOUTH, SOUTH))
    assert np.isnan(flow_cosine(HERE, np.array([1.0, 0, 0]), SOUTH, ABOVE))
    assert np.isnan(view_angle_deg(HERE, HERE, SOUTH))


def test_step_may_be_cut_anywhere() -> None:
    drive, start, v = Drive(), np.zeros(3), np.array([0.3, 0.0, -0.2])
    target = np.array([2.0, 1.0, -1.0])

    once = follow(start, v, target, 0.5, drive)
    half = follow(start, v, target, 0.2, drive)
    twice = follow(*half, target, 0.3, drive)

    np.testing.assert_allclose(once, twice, atol=1e-12)


def test_pull_is_that_of_a_critically_damped_spring() -> None:
    place, v, target = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.0, -4.0]), np.ones(3)
    offset, velocity = Spring(3.0, 1.0, 1.0).at(0.4, place - target, v)

    got = pull(place, v, target, 0.4, 3.0)
    np.testing.assert_allclose((target + offset, velocity), got, atol=1e-12)


def test_camera_never_moves_faster_than_allowed() -> None:
    drive = Drive(stiffness_n_m=100.0, max_speed_mps=1.5)
    place, velocity = np.zeros(3), np.zeros(3)
    for _ in range(100):
        before = place
        place, velocity = follow(place, velocity, np.array([20.0, 0, 0]), 1 / 30, drive)
        assert np.linalg.norm(place - before) <= 1.5 / 30 + 1e-12
    assert place[0] == pytest.approx(100 * 1.5 / 30, rel=0.05)


def test_camera_rests_before_a_subject_that_stands_in_its_target() -> None:
    drive, subject = Drive(), np.array([1.0, 0.0, 0.0])
    place, velocity = np.array([-1.0, 0.0, 0.0]), np.zeros(3)
    for _ in range(3000):
        place, velocity = follow(place, velocity, subject, 1 / 90, drive, subject)
    # Forces balance where repulsion x lacking distance equals stiffness x distance to the target.
    balance = drive.keep_off_m * drive.repulsion_n_m / (drive.repulsion_n_m + drive.stiffness_n_m)
    assert 1.0 - place[0] == pytest.approx(balance, abs=1e-3)


def test_impossible_drives_and_lengths_are_refused() -> None:
    for wrong in ({"stiffness_n_m": 0.0}, {"mass_kg": -1.0}, {"repulsion_n_m": -1.0}):
        with pytest.raises(DesignError, match="cannot be driven"):
            Drive(**wrong)
    with pytest.raises(DesignError, match="median"):
        LogNormalLengths(0.0)


def test_shot_lengths_repeat_by_seed() -> None:
    draws = [
        [LogNormalLengths().draw_s(rng) for _ in range(3)]
        for rng in (np.random.default_rng(5), np.random.default_rng(5))
    ]
    assert draws[0] == draws[1]
