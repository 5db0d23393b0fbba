"""Skeletons and clips: forward kinematics, sampling, loops, mirror, time reversal."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.motion.motions import CANONICAL, random_clip, random_skeleton, wandering
from tests.stimuli.motion.rotation_cases import random_quats, same, seeds, steps_of
from visavis.lab.geometry import quat_multiply, rotate
from visavis.stimuli.motion.clip import (
    Clip,
    KeyPoses,
    cut,
    floor_of_rest_m,
    mirror_clip,
    placed_joints,
    sample_clip,
    standing,
    standing_on_floor,
    worn_by,
)
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.interpolation import KeyTimes, Method, interpolate
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton, forward, local_of_world

quick = settings(max_examples=25, deadline=None)


@quick
@given(seeds, st.integers(1, 12))
def test_forward_kinematics_chains_parent_by_parent(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    skeleton, local, root = random_skeleton(rng, n), random_quats(rng, 3, n), rng.normal(size=3)

    placed = forward(skeleton, np.tile(root, (3, 1)), local)

    for j in range(n):
        position, turn, at = np.zeros((3, 3)), np.tile([1.0, 0, 0, 0], (3, 1)), j
        while at != -1:
            turn = quat_multiply(local[:, at], turn)
            position = rotate(local[:, at], position) + skeleton.offsets_m[at]
            at = int(skeleton.parents[at])
        assert same(turn, placed.orientation_wxyz[:, j], 1e-12)
        assert np.abs(position + root - placed.position_m[:, j]).max() < 1e-12
    assert same(local, local_of_world(skeleton, placed.orientation_wxyz), 1e-12)


@pytest.mark.parametrize("height_m", [0.9, 1.75, 2.1])
def test_canonical_skeleton_is_as_tall_as_asked_and_symmetric(height_m: float) -> None:
    skeleton = canonical_skeleton(height_m)
    head = skeleton.index("head")
    crown = (skeleton.rest_m + skeleton.tips_m)[head, 1] - floor_of_rest_m(skeleton)
    partner = skeleton.mirror_index

    assert pytest.approx(height_m) == crown
    assert 55 == len(skeleton.names)
    assert np.array_equal(np.arange(55), partner[partner])
    assert np.allclose(skeleton.offsets_m * [-1, 1, 1], skeleton.offsets_m[partner], atol=0)
    assert skeleton.rest_m[skeleton.index("left_hand"), 0] < -0.4 * height_m
    assert skeleton.offsets_m[skeleton.index("left_toes"), 2] < 0


def test_person_at_rest_stands_with_the_toes_on_the_floor() -> None:
    frames = standing(CANONICAL)
    placed = forward(CANONICAL, frames.root_m, frames.orientation_wxyz)
    toes = [CANONICAL.index(f"{side}_toes") for side in ("left", "right")]

    lowest = placed.position_m[toes, 1] + CANONICAL.tips_m[toes, 1]

    assert np.abs(lowest).max() < 1e-12
    assert placed.position_m[:, 1].min() > 0


@quick
@given(seeds)
def test_clip_meets_its_frames_and_moves_between_them(seed: int) -> None:
    clip = wandering(np.random.default_rng(seed), 10)

    frames = clip.at(clip.frame_times_s)

    assert same(clip.orientation_wxyz, frames.orientation_wxyz, 1e-9)
    assert np.abs(clip.root_m - frames.root_m).max() < 1e-9
    between = clip.at(clip.frame_times_s[:-1] + clip.frame_s / 2)
    assert np.abs((clip.root_m[1:] + clip.root_m[:-1]) / 2 - between.root_m).max() < 1e-9


def test_clip_rests_before_and_after_and_takes_any_shape_of_times() -> None:
    clip = wandering(np.random.default_rng(1), 10)

    frames = clip.at([[-5.0, 0.0], [clip.duration_s, 9.0]])

    assert (2, 2, 55, 4) == frames.orientation_wxyz.shape
    assert np.array_equal(frames.root_m[0], clip.root_m[[0, 0]])
    assert np.abs(frames.root_m[1] - clip.root_m[[-1, -1]]).max() < 1e-12


def test_loop_joins_its_ends_and_travels_on() -> None:
    n = 20
    t = np.arange(n) / n
    turns = np.zeros((n, 1, 4))
    turns[:, 0, 0], turns[:, 0, 2] = np.cos(np.pi * t), np.sin(np.pi * t)
    root = np.stack([np.zeros(n), np.ones(n), -2 * t], axis=-1)
    skeleton = Skeleton(("r",), np.array([-1]), np.zeros((1, 3)), np.zeros((1, 3)))
    clip = Clip(skeleton, 0.05, root, turns, is_loop=True, travel_m=(0.0, 0.0, -2.0))

    x = np.linspace(-3, 5, 801)
    frames = clip.at(x)

    assert pytest.approx(1.0) == clip.duration_s
    assert np.abs(-2 * x - frames.root_m[:, 2]).max() < 1e-9
    expected = np.stack([np.cos(np.pi * x), 0 * x, np.sin(np.pi * x), 0 * x], -1)
    assert same(expected, frames.orientation_wxyz[:, 0], 1e-9)


@quick
@given(seeds)
def test_mirror_commutes_with_forward_kinematics_and_undoes_itself(seed: int) -> None:
    clip = wandering(np.random.default_rng(seed), 5)
    placed = placed_joints(clip, clip.frame_times_s).position_m

    reflected = placed_joints(mirror_clip(clip), clip.frame_times_s).position_m

    expected = (placed * [-1, 1, 1])[:, CANONICAL.mirror_index]
    assert np.abs(expected - reflected).max() < 1e-12
    assert same(clip.orientation_wxyz, mirror_clip(mirror_clip(clip)).orientation_wxyz, 1e-15)


def test_clip_on_a_child_keeps_its_turns_and_scales_its_path() -> None:
    clip, child = wandering(np.random.default_rng(4), 5), canonical_skeleton(0.875)

    worn = worn_by(clip, child)

    assert np.array_equal(clip.orientation_wxyz, worn.orientation_wxyz)
    assert np.allclose(clip.root_m / 2, worn.root_m, atol=1e-12)
    with pytest.raises(MotionError, match="retarget"):
        worn_by(clip, random_skeleton(np.random.default_rng(0), 3))


def test_floating_clip_is_put_on_the_floor() -> None:
    rest = standing(CANONICAL)
    turns = np.tile(rest.orientation_wxyz, (20, 1, 1))
    clip = Clip(CANONICAL, 0.1, np.tile(rest.root_m, (20, 1)), turns)
    clip.root_m[:, 1] += 0.3
    clip.root_m[7, 1] -= 0.05

    grounded = standing_on_floor(clip)

    assert np.abs(np.delete(grounded.root_m - rest.root_m, 7, axis=0)).max() < 1e-12


def test_cut_and_sampled_frames_are_those_of_the_clip() -> None:
    clip = wandering(np.random.default_rng(5), 12)

    part = cut(clip, 3, 9)

    again = sample_clip(clip, 3 * clip.frame_s, clip.frame_s, 7)
    assert np.array_equal(clip.root_m[3:10], part.root_m)
    assert same(part.orientation_wxyz, again.orientation_wxyz, 1e-9)
    with pytest.raises(MotionError):
        cut(clip, 3, 12)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("method", ["lineuler", "slerp", "squad"])
def test_key_poses_pass_their_roots_smoothly(method: Method, closed: bool) -> None:
    rng = np.random.default_rng(6)
    skeleton, root = random_skeleton(rng, 4), rng.normal(size=(5, 3))
    times = KeyTimes(np.array([0.0, 0.5, 0.7, 1.5, 2.0]), 2.6 if closed else None)
    keys = steps_of(rng, 5, 60.0, 4)
    motion = KeyPoses(skeleton, interpolate(method, times, keys), root, smooth_root=True)
    inner = times.t_s if closed else times.t_s[1:-1]
    d = 1e-5

    speeds = [
        (motion.at(inner + s + d).root_m - motion.at(inner + s).root_m) / d for s in (-d, 0.0)
    ]

    assert np.abs(root - motion.at(times.t_s).root_m).max() < 1e-12
    assert np.abs(speeds[1] - speeds[0]).max() < 1e-2
    assert (7, 4, 4) == motion.at(np.zeros(7)).orientation_wxyz.shape


@quick
@given(seeds)
def test_gait_of_two_steps_and_their_mirrors_is_its_mirror_half_a_period_later(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = wandering(rng, 2, swing_deg=80.0, rate_hz=1.0)
    other = mirror_clip(steps)
    keys = np.concatenate([steps.orientation_wxyz, other.orientation_wxyz])
    roots = np.concatenate([steps.root_m, other.root_m])
    turns = interpolate("squad", KeyTimes(np.arange(4.0) / 4, period_s=1.0), keys)
    gait = KeyPoses(CANONICAL, turns, roots, smooth_root=True)

    walk, later = (sample_clip(gait, start_s, 0.05, 20) for start_s in (0.0, 0.5))

    assert same(mirror_clip(walk).orientation_wxyz, later.orientation_wxyz, 1e-9)
    assert np.abs(mirror_clip(walk).root_m - later.root_m).max() < 1e-9


def test_straight_roots_are_those_of_a_line() -> None:
    rng = np.random.default_rng(7)
    skeleton = random_skeleton(rng, 2)
    turns = interpolate("slerp", KeyTimes(np.array([0.0, 2.0])), random_quats(rng, 2, 2))

    motion = KeyPoses(skeleton, turns, np.array([[0.0, 0, 0], [4.0, 0, 2]]))

    assert [1.0, 0.0, 0.5] == motion.at(0.5).root_m.tolist()


def test_clips_and_skeletons_that_cannot_be_are_refused() -> None:
    clip = random_clip(np.random.default_rng(8), 3, 4)
    hole = clip.root_m.copy()
    hole[2, 1] = np.nan

    with pytest.raises(MotionError, match="frame 2"):
        replace(clip, root_m=hole)
    with pytest.raises(MotionError, match="does not fit"):
        replace(clip, root_m=clip.root_m[:2])
    with pytest.raises(MotionError, match="between frames"):
        replace(clip, frame_s=0.0)
    with pytest.raises(MotionError, match="not a number"):
        clip.at(np.inf)
    with pytest.raises(MotionError, match="twice"):
        replace(clip.skeleton, names=("a", "b", "a"))
    with pytest.raises(MotionError, match="parents before children"):
        replace(clip.skeleton, parents=np.array([-1, 2, 0]))
    with pytest.raises(MotionError, match="no joint 'tail'"):
        clip.skeleton.index("tail")
    with pytest.raises(MotionError, match="height"):
        canonical_skeleton(17.5)
