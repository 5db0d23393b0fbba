"""A walk measured from its track: interpolation, the stop at the board, hesitations, lost time."""

import numpy as np
import pytest

from visavis.analysis.gait import STEP_LENGTH_M, resample, step_length_m, walk_measures
from visavis.lab.errors import DataError

DT_S = 0.01


def walked(*parts):
    """Measure a walk along a line in (seconds, metres per second) parts, the board at its end."""
    speed = np.concatenate([np.full(round(s / DT_S), v) for s, v in parts])
    along = np.concatenate([[0.0], np.cumsum(speed * DT_S)])
    place = np.stack([along, np.zeros_like(along)], axis=1)
    t_ns = (np.arange(len(place)) * DT_S * 1e9).round().astype(np.int64)
    return walk_measures(t_ns, place, (along[-1] + 1.0, 0.0), 0.01)


def test_standing_before_the_first_step_is_no_hesitation():
    assert 0 == walked((2, 0.0), (5, 0.5)).hesitations


def test_standing_in_mid_walk_is_one_hesitation_of_its_length():
    measures = walked((2, 0.0), (3, 0.5), (1.5, 0.0), (3, 0.5))
    assert 1 == measures.hesitations
    assert measures.hesitation_s == pytest.approx(1.5, abs=0.3)


def test_a_short_slowing_is_no_hesitation():
    assert 0 == walked((3, 0.5), (0.3, 0.05), (3, 0.5)).hesitations


def test_somebody_who_never_walks_does_not_hesitate():
    measures = walked((5, 0.0))
    assert (0, 0.0) == (measures.hesitations, measures.hesitation_s)


def test_a_way_lost_for_a_while_has_a_speed_and_no_length():
    t_ns = np.arange(0, 10_000_000_000, 10_000_000)
    place = np.stack([np.arange(1000) * 0.005, np.zeros(1000)], axis=1)
    whole = walk_measures(t_ns, place, (0.0, 50.0), 0.1)
    assert 0.005 * 999 == pytest.approx(whole.path_m)
    place[200:205] = np.nan
    assert 0.005 * 993 == pytest.approx(walk_measures(t_ns, place, (0.0, 50.0), 0.1).path_m)
    place[200:300] = np.nan
    measures = walk_measures(t_ns, place, (0.0, 50.0), 0.1)
    assert np.isnan(measures.path_m)
    assert 0.5 == pytest.approx(measures.speed_m_s)
    assert 1.01 == pytest.approx(measures.lost_s)


def test_the_stop_within_a_step_of_the_point_nearest_the_board_is_left_out():
    along = np.concatenate([np.arange(0, 5, 0.005), np.full(700, 5.0), np.arange(5, 0, -0.005)])
    place = np.stack([along, np.zeros_like(along)], axis=1)
    t_ns = np.arange(len(along)) * 10_000_000
    measures = walk_measures(t_ns, place, (5.5, 1.0), 0.74)
    assert 0.5 == pytest.approx(measures.speed_m_s)
    assert 10 / 27 == pytest.approx(measures.speed_whole_m_s, rel=1e-3)
    assert 7 + 2 * 0.74 / 0.5 == pytest.approx(measures.stop_s, abs=0.05)
    assert 0 == measures.hesitations


def test_a_step_is_that_of_the_source_and_the_mean_for_others():
    assert (0.74, 0.67) == (step_length_m("man"), step_length_m("woman"))
    for unknown in (None, "", "other"):
        assert sum(STEP_LENGTH_M.values()) / 2 == pytest.approx(step_length_m(unknown))


def turned(angle_deg):
    half = np.radians(angle_deg) / 2
    return [np.cos(half), 0.0, np.sin(half), 0.0]


def body(t_ms, angles_deg):
    t_ns = np.array(t_ms, np.int64) * 1_000_000
    position = np.zeros((len(t_ms), 1, 3))
    position[:, 0, 0] = np.array(t_ms) / 1000
    orientation = np.array([[turned(a)] for a in angles_deg])
    return t_ns, position, orientation


def test_poses_between_samples_lie_between_them_along_the_shorter_turn():
    t_ns, position, orientation = body([0, 20, 40], [170, 190, 210])
    orientation[1] *= -1  # the same turn, written the other way round
    grid = np.arange(0, 41, 10, dtype=np.int64) * 1_000_000
    at, turn = resample(t_ns, position, orientation, grid)
    np.testing.assert_allclose([0, 0.01, 0.02, 0.03, 0.04], at[:, 0, 0])
    for angle, measures in zip((170, 180, 190, 200, 210), turn[:, 0], strict=True):
        assert 1 == pytest.approx(abs(np.dot(turned(angle), measures)))


def test_nothing_is_interpolated_across_a_long_gap_or_beyond_the_ends():
    t_ns, position, orientation = body([10, 20, 120, 221, 230], [0] * 5)
    grid = np.arange(0, 241, 10, dtype=np.int64) * 1_000_000
    at, turn = resample(t_ns, position, orientation, grid)
    lost = [0, *range(130, 221, 10), 240]  # 100 ms are bridged, 101 ms are not
    assert lost == (np.flatnonzero(np.isnan(at[:, 0, 0])) * 10).tolist()
    assert (np.isnan(at).all(axis=(1, 2)) == np.isnan(turn).all(axis=(1, 2))).all()


def test_a_lost_joint_stays_lost_on_both_sides_and_alone():
    t_ns, position, orientation = body([0, 20, 40, 60], [0] * 4)
    position = np.repeat(position, 2, axis=1)
    orientation = np.repeat(orientation, 2, axis=1)
    position[1, 1] = np.nan
    grid = np.arange(0, 61, 10, dtype=np.int64) * 1_000_000
    at, _ = resample(t_ns, position, orientation, grid)
    assert [False, True, True, True, False, False, False] == np.isnan(at[:, 1, 0]).tolist()
    assert np.isfinite(at[:, 0]).all()


def test_times_that_do_not_rise_are_refused():
    t_ns, position, orientation = body([0, 20, 20], [0] * 3)
    with pytest.raises(DataError, match="sample 2: time does not rise"):
        resample(t_ns, position, orientation, t_ns)
