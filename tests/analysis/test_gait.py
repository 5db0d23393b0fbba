"""A walk measured from its track: what counts as a hesitation."""

import numpy as np
import pytest

from analysis.gait import walk_measures

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
    found = walked((2, 0.0), (3, 0.5), (1.5, 0.0), (3, 0.5))
    assert 1 == found.hesitations
    assert found.hesitation_s == pytest.approx(1.5, abs=0.3)


def test_a_short_slowing_is_no_hesitation():
    assert 0 == walked((3, 0.5), (0.3, 0.05), (3, 0.5)).hesitations


def test_somebody_who_never_walks_does_not_hesitate():
    found = walked((5, 0.0))
    assert (0, 0.0) == (found.hesitations, found.hesitation_s)


def test_a_way_lost_for_a_while_has_a_speed_and_no_length():
    t_ns = np.arange(0, 10_000_000_000, 10_000_000)
    place = np.stack([np.arange(1000) * 0.005, np.zeros(1000)], axis=1)
    whole = walk_measures(t_ns, place, (0.0, 50.0), 0.1)
    assert 0.005 * 999 == pytest.approx(whole.path_m)
    place[200:205] = np.nan
    assert 0.005 * 993 == pytest.approx(walk_measures(t_ns, place, (0.0, 50.0), 0.1).path_m)
    place[200:300] = np.nan
    found = walk_measures(t_ns, place, (0.0, 50.0), 0.1)
    assert np.isnan(found.path_m)
    assert 0.5 == pytest.approx(found.speed_m_s)
    assert 1.01 == pytest.approx(found.lost_s)
