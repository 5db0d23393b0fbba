"""Blends of walks: an example alone comes back, feet stay planted, rounds join without a jump."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import weighted_mean
from visavis.stimuli.motion.skeleton import Placement, forward
from visavis.stimuli.motion.synthesis.blend_kernels import add_rotation, mean_rotation
from visavis.stimuli.motion.synthesis.example_blend import Blend, blend_at
from visavis.stimuli.motion.synthesis.examples import WALK_KEYS, examples_of_clips
from visavis.stimuli.motion.synthesis.walk_styles import walk_set

SETS = pytest.mark.parametrize("which", ["set_a", "set_b"])


def random_weights(n: int, seed: int) -> Vector:
    """Return weights of which a few are heavy, as sliders make them."""
    weights: Vector = np.random.default_rng(seed).dirichlet(np.full(n, 0.3))
    return weights


def body_of(blend: Blend, t_s: Vector) -> Placement:
    frames = blend.at(t_s)
    return forward(blend.skeleton, frames.root_m, frames.orientation_wxyz)


@SETS
def test_the_blend_of_one_example_is_that_example(which: str) -> None:
    examples = walk_set(which)
    for i in range(len(examples)):
        clip = examples.clip(i)
        phases = np.interp(clip.frame_times_s, examples.key_s[i], np.arange(len(WALK_KEYS) + 1.0))
        frames = blend_at(examples, np.eye(len(examples))[i], phases)
        assert np.abs(frames.root_m - clip.root_m).max() < 1e-12
        same = np.abs(np.sum(frames.orientation_wxyz * clip.orientation_wxyz, axis=-1))
        assert np.abs(same - 1.0).max() < 1e-12


def test_equal_examples_blend_to_what_they_are() -> None:
    walks = walk_set("set_a")
    clip = walks.clip(3)
    three = examples_of_clips("abc", [clip] * 3, np.repeat(walks.key_s[3:4], 3, axis=0))
    blend = Blend(three, np.array([0.2, 0.5, 0.3]))
    t_s = np.linspace(0.0, 2 * clip.duration_s, 33)
    expected, got = clip.at(t_s), blend.at(t_s)
    assert np.abs(got.root_m - expected.root_m).max() < 1e-12
    same = np.abs(np.sum(got.orientation_wxyz * expected.orientation_wxyz, axis=-1))
    assert np.abs(same - 1.0).max() < 1e-4  # between frames legs are led to where feet stand


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.sampled_from(["set_a", "set_b"]))
def test_planted_feet_of_a_blend_stay(seed: int, which: str) -> None:
    examples = walk_set(which)
    blend = Blend(examples, random_weights(len(examples), seed))
    rate_hz = 480.0
    t_s = np.arange(0.0, blend.cycle_s, 1.0 / rate_hz)
    phase, body = blend.phase_of(t_s), body_of(blend, t_s)
    for side, stands in (("left", phase < 3.0), ("right", (phase >= 2.0) | (phase < 1.0))):
        foot, toes = (blend.skeleton.index(f"{side}_{part}") for part in ("foot", "toes"))
        ball = body.position_m[:, toes]
        turn = body.orientation_wxyz[:, foot]
        heel = body.position_m[:, foot] + rotate(turn, np.broadcast_to(examples.heel_m, ball.shape))
        both = stands[1:] & stands[:-1]
        speeds = [
            np.linalg.norm(np.diff(point[:, [0, 2]], axis=0), axis=1)[both] * rate_hz * 1e3
            for point in (heel, ball)
        ]
        slip_mm_s = np.minimum(*speeds)
        assert slip_mm_s.max() < 5.0


@SETS
def test_rounds_join_without_a_jump(which: str) -> None:
    examples = walk_set(which)
    blend = Blend(examples, random_weights(len(examples), 5))
    step_s = 1e-5
    for at_s in (0.0, blend.cycle_s, 7 * blend.cycle_s, *blend.key_s[1:-1]):
        places = body_of(blend, at_s + step_s * np.array([-1.0, 0.0, 1.0])).position_m
        assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() < 1e-4
    first, later = blend.at(0.3), blend.at(0.3 + 2 * blend.cycle_s)
    assert later.root_m - first.root_m == pytest.approx(2 * blend.travel_m, abs=1e-9)
    assert np.allclose(first.orientation_wxyz, later.orientation_wxyz)
    treadmill = replace(blend, in_place=True)
    later = treadmill.at(0.3 + 2 * blend.cycle_s)
    assert later.root_m == pytest.approx(treadmill.at(0.3).root_m, abs=1e-9)


@given(st.integers(0, 10_000))
def test_time_warps_rise_and_meet_key_times(seed: int) -> None:
    examples = walk_set("set_b")
    weights = random_weights(len(examples), seed)
    blend = Blend(examples, weights)
    assert blend.key_s == pytest.approx(weights @ examples.key_s)
    assert blend.phase_of(blend.key_s) == pytest.approx(np.arange(5.0))
    assert (np.diff(blend.phase_of(np.linspace(0.0, 3.0, 400))) > 0).all()


@settings(deadline=None)
@given(st.integers(0, 10_000))
def test_the_mean_rotation_is_that_of_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.standard_normal((6, 4)) * 0.4 + np.array([1.0, 0.0, 0.0, 0.0])
    q = q / np.linalg.norm(q, axis=1, keepdims=True) * rng.choice([-1.0, 1.0], (6, 1))
    weights = rng.dirichlet(np.ones(6))
    moment = np.zeros((4, 4))
    for rotation, weight in zip(q, weights, strict=True):
        add_rotation(tuple(rotation), weight, moment)
    heaviest = tuple(q[np.argmax(weights)])
    mean = np.array(mean_rotation(moment, heaviest))
    assert mean == pytest.approx(weighted_mean(q, weights), abs=1e-9)


def test_the_pose_follows_weights_without_a_jump() -> None:
    examples = walk_set("set_b")
    a, b = random_weights(27, 1), random_weights(27, 2)
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    frames = blend_at(examples, (1 - shares) * a + shares * b, np.full(2001, 1.37))
    places = forward(examples.skeleton, frames.root_m, frames.orientation_wxyz).position_m
    assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() < 2e-3


def test_examples_that_do_not_fit_are_named() -> None:
    walks = walk_set("set_a")
    clips, keys = [walks.clip(i) for i in range(3)], walks.key_s[:3]
    with pytest.raises(MotionError, match="at least 3"):
        examples_of_clips("ab", clips[:2], keys[:2])
    with pytest.raises(MotionError, match="two examples are called 'a'"):
        examples_of_clips("aba", clips, keys)
    with pytest.raises(MotionError, match="'b' are"):
        examples_of_clips("abc", clips, keys[[0, 2, 2]] * [[1], [0.5], [1]])
    with pytest.raises(MotionError, match="'c' does not loop"):
        examples_of_clips("abc", [*clips[:2], replace(clips[2], is_loop=False)], keys)
    with pytest.raises(MotionError, match="weights of at least 0"):
        Blend(walks, np.full(10, -1.0))
