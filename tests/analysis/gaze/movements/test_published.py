"""What the papers define, computed by hand."""

import numpy as np
import pytest

from tests.analysis.gaze.streams import stamps
from visavis.analysis.gaze.movements.engbert_kliegl import noise_deg_s, outside_ellipse
from visavis.analysis.gaze.movements.i2mc import clustering_weights, trim_borders
from visavis.analysis.gaze.movements.nystrom_holmqvist import adapted_thresholds
from visavis.analysis.gaze.movements.velocity import velocities_deg_s
from visavis.lab.geometry import direction_from_yaw_pitch_deg


def test_velocity_is_the_five_point_mean_of_engbert_and_kliegl():
    # v = (x[2] + x[1] − x[−1] − x[−2]) / (6 Δt), their equation 1
    right_deg = np.array([0.0, 0.1, 0.4, 0.9, 1.6])
    gaze = direction_from_yaw_pitch_deg(-right_deg, np.zeros(5))
    velocity = velocities_deg_s(stamps(5, 250.0), gaze, np.zeros(5, np.int64), 2)
    assert (1.6 + 0.9 - 0.1 - 0.0) / (6 * 0.004) == pytest.approx(velocity[2, 0], rel=1e-3)
    assert 0 == pytest.approx(velocity[2, 1], abs=1e-9)


def test_upward_velocity_is_positive_at_any_azimuth():
    up_deg = np.linspace(0, 1, 5)
    for yaw in (0.0, 90.0, 180.0, -135.0):
        gaze = direction_from_yaw_pitch_deg(np.full(5, yaw), up_deg)
        velocity = velocities_deg_s(stamps(5, 250.0), gaze, np.zeros(5, np.int64), 2)
        assert [0, 62.5] == pytest.approx(velocity[2], abs=0.01)


def test_noise_is_the_root_of_median_square_less_squared_median():
    # their equation 3: of 1, 2, 3, 4, 100 the median is 3 and of the squares 9; of −1 … it is 1
    velocity = np.array([[1, -1], [2, -1], [3, 1], [4, 1], [100, 0], [np.nan, np.nan]], float)
    assert (0.0, 1.0) == noise_deg_s(velocity)
    shifted = velocity - np.array([3, 0])
    # squares 4, 1, 0, 1, 9409: median 1; median 0
    assert (1.0, 1.0) == noise_deg_s(shifted)


def test_the_ellipse_has_lambda_spreads_as_half_axes():
    rest = np.tile([[-1.0, -2], [1, 2], [-1, 2], [1, -2]], (20, 1))
    assert (1.0, 2.0) == noise_deg_s(rest)
    tried = np.array([[5.9, 0], [6.1, 0], [0, 12.1], [5, 9]])
    velocity = np.concatenate([rest, tried, -tried])
    assert (1.0, 2.0) == noise_deg_s(velocity)
    outside = outside_ellipse(velocity, 6.0, 0.0)
    assert [False] * 80 + [False, True, True, True] * 2 == outside.tolist()
    assert not outside_ellipse(velocity, 6.0, 20.0).any()


def test_peak_threshold_is_the_fixed_point_of_mean_plus_six_spreads():
    slow = np.tile([4.0, 8.0], 50)  # mean 6, spread 2
    speed = np.concatenate([slow, [60.0, 90.0, 250.0]])
    peak, onset = adapted_thresholds(speed, 100.0)
    assert (18.0, 12.0) == (pytest.approx(peak), pytest.approx(onset))


def test_thresholds_of_nothing_are_unknown():
    assert np.isnan(adapted_thresholds(np.full(4, np.nan), 100.0)).all()


def test_one_change_of_cluster_gives_its_row_all_the_weight():
    n = 40
    gaze = direction_from_yaw_pitch_deg(np.where(np.arange(n) < 20, 0.0, 5.0), np.zeros(n))
    weights = clustering_weights(
        stamps(n, 200.0),
        gaze,
        np.zeros(n, np.int64),
        200_000_000,
        200_000_000,
        np.array([1], np.int64),
        10,
    )
    assert {20: 1.0} == {int(i): weights[i] for i in np.flatnonzero(weights)}


def test_weight_is_shared_between_the_changes_of_a_window():
    n = 40
    at = np.arange(n)
    gaze = direction_from_yaw_pitch_deg(np.where((at < 10) | (at >= 30), 0.0, 5.0), np.zeros(n))
    weights = clustering_weights(
        stamps(n, 200.0),
        gaze,
        np.zeros(n, np.int64),
        200_000_000,
        200_000_000,
        np.array([1], np.int64),
        10,
    )
    assert {10: 0.5, 30: 0.5} == {int(i): weights[i] for i in np.flatnonzero(weights)}


def test_rows_far_from_the_cluster_are_taken_off_its_borders():
    degrees = np.concatenate([[3.0, 2.0], np.tile([0.0, 0.1], 20), [2.5]])
    gaze = direction_from_yaw_pitch_deg(degrees, np.zeros(len(degrees)))
    runs = np.array([[0, len(degrees) - 1]])
    assert 1 == trim_borders(gaze, runs, 3.0)
    assert [[2, 41]] == runs.tolist()
