"""Key poses: chosen greedily, and passed through by every method."""

import numpy as np
import pytest

from visavis.experiments.interpolation.gestures import source_of
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.key_poses import (
    between_keys,
    continuous_euler_rad,
    key_frames,
    summed_error_rad,
)

CLIP = source_of("deictic")


def test_more_keys_never_raise_the_largest_error() -> None:
    worst = [summed_error_rad(CLIP, list(key_frames(CLIP, n))).max() for n in (2, 4, 8, 16)]
    assert sorted(worst, reverse=True) == worst


def test_with_every_frame_a_key_nothing_is_lost() -> None:
    every = list(range(len(CLIP.root_m)))
    assert pytest.approx(0.0, abs=1e-6) == summed_error_rad(CLIP, every)


def test_the_ends_are_always_keys() -> None:
    keys = key_frames(CLIP, 3)
    assert (0, len(CLIP.root_m) - 1) == (keys[0], keys[-1])


def test_euler_curves_do_not_jump() -> None:
    steps = np.abs(np.diff(continuous_euler_rad(CLIP), axis=0))
    assert float(steps.max()) < np.pi


def test_squad_alone_has_no_kink_at_an_inner_key() -> None:
    keys = key_frames(CLIP, 4)
    at_s, h = CLIP.frame_times_s[keys[1]], 1e-5

    def kink(method: str) -> float:
        motion = between_keys(CLIP, keys, method)  # type: ignore[arg-type]
        q = motion.at(np.array([at_s - h, at_s, at_s + h])).orientation_wxyz
        q = np.where(np.sum(q * q[1], -1, keepdims=True) < 0, -q, q)
        return float(np.abs(q[0] - 2 * q[1] + q[2]).max() / h)

    assert kink("squad") < 0.05
    assert kink("slerp") > 0.5


@pytest.mark.parametrize("count", [1, 0, 10_000])
def test_counts_of_keys_that_cannot_be_are_refused(count: int) -> None:
    with pytest.raises(MotionError):
        key_frames(CLIP, count)
