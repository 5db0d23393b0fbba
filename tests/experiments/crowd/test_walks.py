"""What of a recorded body is believed before a walk is measured."""

import numpy as np

from visavis.experiments.crowd.walks import later_than_all_before, standing_still, steps_within

MS = 1_000_000


def moving(n):
    t_ns = np.arange(n, dtype=np.int64) * 10 * MS
    position = np.cumsum(np.full((n, 2, 3), 0.001), axis=0)
    return t_ns, position


def test_a_live_body_is_believed():
    assert not standing_still(*moving(50)).any()
    assert not standing_still(*moving(1)).any()


def test_a_body_that_repeats_itself_for_longer_than_the_limit_is_not_believed():
    t_ns, position = moving(60)
    position[20:40] = position[20]
    assert list(range(21, 40)) == np.flatnonzero(standing_still(t_ns, position)).tolist()
    t_ns, position = moving(60)
    position[20:36] = position[20]  # 150 ms and no more
    assert not standing_still(t_ns, position).any()


def test_a_frozen_body_is_not_believed_though_one_joint_is_lost():
    t_ns, position = moving(60)
    position[20:40] = position[20]
    position[:, 1] = np.nan
    assert list(range(21, 40)) == np.flatnonzero(standing_still(t_ns, position)).tolist()


def test_samples_that_repeat_or_step_back_in_time_are_dropped():
    t_ns = np.array([10, 20, 15, 17, 20, 30], np.int64)
    assert [True, True, False, False, False, True] == later_than_all_before(t_ns).tolist()
    assert 0 == len(later_than_all_before(np.empty(0, np.int64)))


def test_a_tracker_that_stopped_early_leaves_missing_steps_and_a_last_interval_does_not():
    t_ns = np.arange(0, 1000, 11, dtype=np.int64) * MS
    assert 990 * MS == steps_within(0, 995 * MS, 10 * MS, t_ns)[-1]
    assert 1990 * MS == steps_within(0, 2000 * MS, 10 * MS, t_ns)[-1]
