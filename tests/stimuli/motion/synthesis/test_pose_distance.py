"""A match is judged by the mean over poses and joints."""

import numpy as np
import pytest

from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.pose_distance import pose_distance


def test_mean_is_over_poses_and_joints_and_a_match_lies_below_the_limit() -> None:
    target = np.zeros((11, 20, 3))
    apart = pose_distance(target, target + np.array([0.0, 0.06, 0.0]))
    assert 220 == apart.samples
    assert 13.2 == pytest.approx(apart.sum_m)
    assert not apart.matches(0.0599)
    assert apart.matches(0.0601)
    assert not pose_distance(target, target + np.array([0.0625, 0.0, 0.0])).matches()


def test_poses_that_are_missing_or_do_not_fit_are_refused() -> None:
    target = np.zeros((3, 2, 3))
    with pytest.raises(MotionError, match="missing"):
        pose_distance(target, target + np.nan)
    with pytest.raises(MotionError, match="poses"):
        pose_distance(target, target[:2])
