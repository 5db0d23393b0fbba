"""One segment that repeats its last pose while the body moves on is found, and nothing else is."""

import numpy as np
import pytest

from visavis.devices.segment_watch import SegmentWatch
from visavis.lab.clock import NS_PER_MS

SEGMENTS = ("hips", "head", "left_hand", "left_foot", "right_hand", "right_foot")
STEP_NS = 10 * NS_PER_MS
HAND, FOOT = SEGMENTS.index("left_hand"), SEGMENTS.index("left_foot")


def moving(n=80, walks_m=0.0):
    """Return times, positions and turns of a body that sways, and walks so far in all."""
    rng = np.random.default_rng(5)
    t_ns = np.arange(n, dtype=np.int64) * STEP_NS
    position = rng.normal(size=(n, len(SEGMENTS), 3)) * 0.001
    position[..., 0] += np.linspace(0, walks_m, n)[:, None]
    turn = rng.normal(size=(n, len(SEGMENTS), 4)) * 0.001 + [1.0, 0, 0, 0]
    return t_ns, position, turn


def freeze(segment, position, turn, begin=30, end=60):
    position[begin:end, segment], turn[begin:end, segment] = (
        position[begin, segment],
        turn[begin, segment],
    )


def found(t_ns, position, turn, **options):
    """Return the samples marked by segment, after seeing that the live way ends alike."""
    marked = SegmentWatch(SEGMENTS, **options).repeats(t_ns, position, turn)
    live = SegmentWatch(SEGMENTS, **options)
    for i, at in enumerate(position):
        live.look(at, turn[i], STEP_NS if i else 0)
        assert not (live.frozen & ~marked[i]).any()
    assert (live.frozen_ns > 0).tolist() == marked.any(axis=0).tolist()
    return {
        SEGMENTS[s]: np.flatnonzero(marked[:, s]).tolist() for s in np.flatnonzero(marked.any(0))
    }


def test_a_body_that_moves_has_no_frozen_segment():
    assert {} == found(*moving())


@pytest.mark.parametrize("what", ["both", "position"])
def test_a_segment_that_repeats_its_pose_is_found_from_its_first_repeat_on(what):
    t_ns, position, turn = moving()
    freeze(HAND, position, turn if what == "both" else turn.copy())
    assert {"left_hand": list(range(31, 60))} == found(t_ns, position, turn)


def test_an_orientation_alone_may_rest_for_half_a_second():
    t_ns, position, turn = moving(160)
    freeze(HAND, position.copy(), turn, 30, 81)
    assert {} == found(t_ns, position, turn)
    freeze(HAND, position.copy(), turn, 30, 82)
    assert {"left_hand": list(range(31, 82))} == found(t_ns, position, turn)


def test_a_live_watch_counts_what_came_after_the_limit():
    _, position, turn = moving()
    freeze(HAND, position, turn)
    watch = SegmentWatch(SEGMENTS)
    told = [watch.look(p, q, STEP_NS) for p, q in zip(position, turn, strict=True)]
    assert list(range(46, 60)) == np.flatnonzero(told).tolist()
    assert 140 * NS_PER_MS == watch.frozen_ns[HAND]
    assert not watch.frozen.any()


def test_a_repeat_as_long_as_the_limit_is_none():
    t_ns, position, turn = moving()
    freeze(HAND, position, turn, 30, 46)
    assert {} == found(t_ns, position, turn)


def test_a_segment_that_never_moved_is_not_frozen_and_one_known_to_move_is():
    t_ns, position, turn = moving()
    freeze(HAND, position, turn, 0, 80)
    assert {} == found(t_ns, position, turn)
    known = {("left_hand", 0)}
    assert {"left_hand": list(range(1, 80))} == found(t_ns, position, turn, moved_channels=known)


def test_a_segment_that_is_renewed_less_often_is_not_frozen():
    t_ns, position, turn = moving()
    late = np.arange(80) // 20 * 20
    position[:, HAND], turn[:, HAND] = position[late, HAND], turn[late, HAND]
    assert {} == found(t_ns, position, turn)


def test_segments_of_a_body_that_stands_still_but_for_its_head_are_not_frozen():
    t_ns, position, turn = moving()
    for segment in range(2, len(SEGMENTS)):
        freeze(segment, position, turn)
    assert {} == found(t_ns, position, turn)


@pytest.mark.parametrize(("n", "is_found"), [(4, True), (5, False)])
def test_orientations_are_frozen_on_one_limb_at_most(n, is_found):
    names = (*SEGMENTS, *(f"part_{k}" for k in range(8)))
    rng = np.random.default_rng(6)
    position = rng.normal(size=(120, len(names), 3))
    turn = rng.normal(size=(120, len(names), 4))
    turn[30:100, 6 : 6 + n] = turn[30, 6 : 6 + n]
    t_ns = np.arange(120, dtype=np.int64) * STEP_NS
    assert is_found == SegmentWatch(names).repeats(t_ns, position, turn).any()
    position[30:100, 6 : 6 + n] = position[30, 6 : 6 + n]
    assert n == SegmentWatch(names).repeats(t_ns, position, turn).any(axis=0).sum()


def test_a_body_that_repeats_itself_whole_has_no_frozen_segment():
    t_ns, position, turn = moving()
    position[30:60], turn[30:60] = position[30], turn[30]
    assert {} == found(t_ns, position, turn)


def test_a_frozen_segment_stays_frozen_while_the_others_rest():
    t_ns, position, turn = moving()
    freeze(HAND, position, turn, 20, 70)
    position[50:60], turn[50:60] = position[50], turn[50]
    assert {"left_hand": list(range(21, 70))} == found(t_ns, position, turn)


def test_a_lost_segment_is_lost_and_not_frozen():
    t_ns, position, turn = moving()
    position[30:60, HAND], turn[30:60, HAND] = np.nan, np.nan
    assert {} == found(t_ns, position, turn)


def test_a_foot_held_on_the_floor_is_not_frozen_until_the_body_has_walked_away():
    t_ns, position, turn = moving(walks_m=2.0)
    freeze(FOOT, position, turn, 30, 60)
    assert {} == found(t_ns, position, turn)
    t_ns, position, turn = moving(walks_m=6.0)
    freeze(FOOT, position, turn, 30, 60)
    assert {"left_foot": list(range(31, 60))} == found(t_ns, position, turn)


def test_what_moved_is_remembered_for_the_next_walk():
    t_ns, position, turn = moving()
    turn[:, HAND] = [1.0, 0, 0, 0]
    watch = SegmentWatch(SEGMENTS)
    watch.repeats(t_ns, position, turn)
    everything = {(name, channel) for name in SEGMENTS for channel in (0, 1)}
    assert everything - {("left_hand", 1)} == watch.moved_channels
