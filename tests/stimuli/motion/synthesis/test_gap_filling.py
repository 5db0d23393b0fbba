"""A gap is filled with what fits best, without a jump at either end."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.gap_filling import Hold, best_segment, fill_gap

SEEDS = st.integers(0, 2**31)


@given(SEEDS, st.integers(1, 20), st.integers(0, 6))
def test_piece_cut_out_of_its_own_source_is_found_and_put_back(
    seed: int, gap: int, window: int
) -> None:
    source = np.random.default_rng(seed).normal(size=(90, 3)).cumsum(axis=0)
    k = 40
    before, after = source[k - window : k + 1], source[k + gap + 1 :][: window + 1]
    best = best_segment(source, before, after, gap, window)
    assert k == best.start
    assert 0.0 == best.distance
    assert best.runner_up > 0
    assert np.allclose(source[k + 1 : k + 1 + gap], fill_gap(source, before, after, gap, k))


@given(SEEDS)
def test_filled_frames_meet_both_ends_by_the_steps_of_their_source(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, before, after = (rng.normal(size=(60, 2)) for _ in range(3))
    piece = fill_gap(source, before, after, 10, 20)
    off = piece - source[21:31]
    first, last = before[-1] - source[20], after[0] - source[31]
    assert np.allclose(np.diff(off, axis=0), (last - first) / 11)
    assert np.allclose(off[0] - first, (last - first) / 11)


@pytest.mark.parametrize(("length", "gap", "window"), [(20, 10, 5), (20, 0, 2), (40, 5, 12)])
def test_too_short_a_source_or_surrounding_is_refused(length: int, gap: int, window: int) -> None:
    source, around = np.zeros((length, 2)), np.zeros((8, 2))
    with pytest.raises(MotionError, match="frames"):
        best_segment(source, around, around, gap, window)


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 10))
def test_hold_begins_and_ends_where_it_should_and_rests_between(
    end: float, speed: float, following: float, gap_s: float
) -> None:
    hold = Hold(end, speed, following, gap_s)
    assert [end, following] == pytest.approx(hold.at([0.0, gap_s]).tolist(), abs=1e-12)
    resting = hold.at(np.linspace(hold.from_s, hold.to_s, 7))
    assert np.allclose(end + 0.02 * speed * gap_s, resting)


def test_hold_without_time_is_refused() -> None:
    with pytest.raises(MotionError, match="above 0"):
        Hold(0.0, 0.0, 1.0, 0.0)
