"""Blends and transitions: exact at their ends and without a pop in between."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.motion.motions import CANONICAL, Spinning, random_clip, wandering
from tests.stimuli.motion.rotation_cases import Array, apart_deg, same, seeds
from visavis.lab.geometry import quat_conjugate, quat_multiply
from visavis.stimuli.motion.blending import (
    CrossFade,
    InertialTransition,
    blend_frames,
    smootherstep,
)
from visavis.stimuli.motion.clip import Motion
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import slerp

quick = settings(max_examples=20, deadline=None)


def fastest_deg_s(motion: Motion, start_s: float, end_s: float, step_s: float = 1e-3) -> float:
    q = motion.at(np.arange(start_s, end_s, step_s)).orientation_wxyz
    return float(apart_deg(q[1:], q[:-1]).max() / step_s)


def angular_velocity(motion: Motion, t_s: Array, step_s: float) -> Array:
    a, b = (motion.at(t_s + d).orientation_wxyz for d in (0.0, step_s))
    turn = quat_multiply(b, quat_conjugate(a))
    return 2 * turn[..., 1:] * np.sign(turn[..., :1]) / step_s


@quick
@given(seeds)
def test_blend_with_one_weight_is_that_pose_and_all_equal_is_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 0.5, 7)
    poses = [wandering(rng).at(t) for _ in range(3)]

    one = blend_frames(poses, [0.0, 2.0, 0.0])
    alike = blend_frames([poses[0]] * 3, rng.uniform(0.1, 1, (3, 7)))

    assert same(poses[1].orientation_wxyz, one.orientation_wxyz, 1e-9)
    assert np.abs(poses[1].root_m - one.root_m).max() < 1e-12
    assert same(poses[0].orientation_wxyz, alike.orientation_wxyz, 1e-9)


def test_blend_weights_may_change_with_time() -> None:
    t = np.array([0.0, 1.0])
    poses = [Spinning(CANONICAL, (0, 1, 0), 0.0, a).at(t) for a in (0.0, 40.0)]

    mixed = blend_frames(poses, np.array([[1.0, 0.0], [0.0, 5.0]]))

    expected = [poses[0].orientation_wxyz[0], poses[1].orientation_wxyz[1]]
    assert same(np.stack(expected), mixed.orientation_wxyz, 1e-12)


@pytest.mark.parametrize("weights", [[0.0, 0.0], [1.0, -0.5], [1.0], [np.nan, 1.0]])
def test_blend_weights_that_mean_nothing_are_refused(weights: list[float]) -> None:
    pose = wandering(np.random.default_rng(0)).at(0.1)

    with pytest.raises(MotionError, match="weight"):
        blend_frames([pose, pose], weights)


def test_eased_share_starts_and_ends_at_rest() -> None:
    d = 1e-4

    assert [0.0, 0.0, 0.5, 1.0, 1.0] == smootherstep([-1, 0, 0.5, 1, 2]).tolist()
    assert smootherstep(d) < 1e-10
    assert 1 - smootherstep(1 - d) < 1e-10


@quick
@given(seeds)
def test_cross_fade_is_before_until_it_starts_and_after_when_it_has_ended(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = wandering(rng, 120), wandering(rng, 120)
    fade = CrossFade(a, b, start_s=0.5, duration_s=0.4, after_start_s=0.3)

    early, late = np.linspace(0, 0.5, 9), np.linspace(0.9, 1.2, 9)

    assert same(a.at(early).orientation_wxyz, fade.at(early).orientation_wxyz, 1e-12)
    assert same(b.at(late - 0.2).orientation_wxyz, fade.at(late).orientation_wxyz, 1e-9)
    assert np.abs(b.at(late - 0.2).root_m - fade.at(late).root_m).max() < 1e-9


@quick
@given(seeds)
def test_cross_fade_is_never_faster_than_its_motions_and_its_turn_allow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (wandering(rng, 90, swing_deg=170.0) for _ in range(2))
    fade = CrossFade(a, b, 0.4, 0.3)
    # The eased share rises at most 15/8 per duration, the turn is at most 360°.
    limit = fastest_deg_s(a, 0, 1.4) + fastest_deg_s(b, 0, 1.4) * 2 + 360 * 15 / 8 / 0.3

    assert fastest_deg_s(fade, 0.3, 0.8) < limit


def test_cross_fade_does_not_pop_where_the_motions_pass_180_degrees() -> None:
    before = Spinning(CANONICAL, (0, 1, 0), 0.0)
    after = Spinning(CANONICAL, (0, 1, 0), 100.0, start_deg=130.0)
    fade = CrossFade(before, after, 0.0, 1.0)
    t = np.arange(0, 1, 1e-3)
    a, b = before.at(t), after.at(t)

    shorter = slerp(a.orientation_wxyz, b.orientation_wxyz, smootherstep(t)[:, None])

    assert apart_deg(shorter[1:], shorter[:-1]).max() > 90.0
    assert fastest_deg_s(fade, 0, 1.2) < 600.0
    assert same(after.at(1.0).orientation_wxyz, fade.at(1.0).orientation_wxyz, 1e-9)


def test_cross_fade_answers_one_time_as_it_answers_many() -> None:
    before = Spinning(CANONICAL, (0, 1, 0), 0.0)
    fade = CrossFade(before, Spinning(CANONICAL, (0, 1, 0), 100.0, 130.0), 0.0, 1.0)
    t = np.linspace(0, 1.2, 13)

    many = fade.at(t)

    for i, x in enumerate(t):
        assert same(many.orientation_wxyz[i], fade.at(x).orientation_wxyz, 0.0)


@pytest.mark.parametrize("kind", [CrossFade, InertialTransition])
def test_velocity_is_continuous_at_both_ends_of_a_transition(
    kind: type[CrossFade] | type[InertialTransition],
) -> None:
    before = Spinning(CANONICAL, (0, 1, 0.2), 90.0, velocity_m_s=(0.5, 0, 0))
    after = Spinning(CANONICAL, (1, 0.5, 0), -40.0, 100.0, velocity_m_s=(0, 0, -1.0))
    change = kind(before, after, 1.0, 0.5, 0.2)
    ends, d = np.array([1.0, 1.5]), 1e-5

    turning = [angular_velocity(change, ends + s, d) for s in (-d, 0.0)]
    root = [(change.at(ends + s + d).root_m - change.at(ends + s).root_m) / d for s in (-d, 0.0)]

    assert np.abs(turning[1] - turning[0]).max() < 1e-2
    assert np.abs(root[1] - root[0]).max() < 1e-2
    assert pytest.approx(np.radians(90.0), rel=1e-3) == np.linalg.norm(turning[0][0, 5])


@quick
@given(seeds, st.floats(0.1, 1.0))
def test_inertial_transition_leaves_and_arrives_exactly(seed: int, duration_s: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = wandering(rng, 120), wandering(rng, 120)
    change = InertialTransition(a, b, 0.5, duration_s)
    late = 0.5 + duration_s + np.linspace(0, 0.2, 5)

    assert same(a.at(0.4).orientation_wxyz, change.at(0.4).orientation_wxyz, 0.0)
    assert same(a.at(0.5).orientation_wxyz, change.at(0.5).orientation_wxyz, 1e-9)
    assert np.abs(a.at(0.5).root_m - change.at(0.5).root_m).max() < 1e-12
    assert same(b.at(late - 0.5).orientation_wxyz, change.at(late).orientation_wxyz, 1e-9)
    assert np.abs(b.at(late - 0.5).root_m - change.at(late).root_m).max() < 1e-12


@quick
@given(seeds)
def test_inertial_transition_does_not_pop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (wandering(rng, 90, swing_deg=170.0) for _ in range(2))
    speeds = fastest_deg_s(a, 0, 1.4) + fastest_deg_s(b, 0, 1.4)

    # The offset is at most 180° and its fall at most 15/8 per duration.
    assert (
        fastest_deg_s(InertialTransition(a, b, 0.4, 0.3), 0.3, 0.8)
        < 3 * speeds + 180 * 15 / 8 / 0.3
    )


@pytest.mark.parametrize("kind", [CrossFade, InertialTransition])
def test_motions_that_cannot_be_joined_are_refused(
    kind: type[CrossFade] | type[InertialTransition],
) -> None:
    clip = wandering(np.random.default_rng(0))

    with pytest.raises(MotionError, match="different skeletons"):
        kind(clip, random_clip(np.random.default_rng(0), 3, 4), 0.0, 1.0)
    with pytest.raises(MotionError, match="above 0"):
        kind(clip, clip, 0.0, 0.0)
