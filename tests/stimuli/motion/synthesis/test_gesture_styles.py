"""Gestures blend as walks do: by their own key moments, without anything that is about walks."""

import numpy as np
import pytest

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.gesture_styles import GESTURES, gesture_examples
from visavis.stimuli.motion.synthesis.pose_distance import Likeness, compared_joints
from visavis.stimuli.motion.synthesis.style_weights import fit_weights


def hands_m(blend: Blend) -> Vector:
    """Return the places of the right hand at 60 moments of a round."""
    frames = blend.at(np.arange(60) * blend.cycle_s / 60)
    body = forward(blend.skeleton, frames.root_m, frames.orientation_wxyz)
    return body.position_m[:, blend.skeleton.index("right_hand")]


@pytest.mark.parametrize("which", GESTURES)
def test_one_hot_weights_give_the_gesture_itself(which: str) -> None:
    examples = gesture_examples(which)
    for i, style in enumerate(GESTURES[which].values()):
        blend = Blend(examples, np.eye(len(examples))[i])
        assert blend.cycle_s == pytest.approx(style.frames / 30)
        clip = examples.clip(i)
        frames = blend.at(clip.frame_times_s)
        made = forward(clip.skeleton, frames.root_m, frames.orientation_wxyz).position_m
        own = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz).position_m
        assert np.abs(made - own).max() < 1e-6


@pytest.mark.parametrize("which", GESTURES)
def test_a_blend_lies_between_and_its_key_moments_are_the_means(which: str) -> None:
    examples = gesture_examples(which)
    shy, large = (examples.index(name) for name in ("shy", "large"))
    weights = np.zeros(len(examples))
    weights[[shy, large]] = 0.5
    both = Blend(examples, weights)
    assert both.key_s == pytest.approx((examples.key_s[shy] + examples.key_s[large]) / 2)
    reach = [
        np.ptp(hands_m(b), axis=0).max()
        for b in (Blend(examples, np.eye(5)[shy]), both, Blend(examples, np.eye(5)[large]))
    ]
    assert reach[0] < reach[1] < reach[2]
    steps = np.linalg.norm(np.diff(hands_m(both), axis=0, append=hands_m(both)[:1]), axis=1)
    assert steps.max() < 4 * np.median(steps) + 0.02  # no jump, neither where a round begins again


def test_feet_of_a_gesture_stand_and_hands_of_a_wave_are_raised() -> None:
    examples = gesture_examples("waves", load_character("anna").skeleton)
    blend = Blend(examples, np.full(5, 0.2))
    frames = blend.at(np.linspace(0, blend.cycle_s, 40))
    body = forward(blend.skeleton, frames.root_m, frames.orientation_wxyz).position_m
    for name in ("left_foot", "right_toes"):
        assert np.ptp(body[:, blend.skeleton.index(name)], axis=0).max() < 1e-6
    elbow, hand = (body[:, blend.skeleton.index(f"right_{j}"), 1] for j in ("lower_arm", "hand"))
    assert (hand > elbow).all()


def test_gestures_are_led_by_parameters_and_compared_as_walks_are() -> None:
    examples = gesture_examples("beats")
    size = np.array([[0.5], [1.0], [0.0], [0.6], [0.3]])
    fit = fit_weights(size)
    assert np.abs(fit.at(size) - np.eye(5)).max() < 1e-12
    target = fit.at(np.array([0.8]))
    likeness = Likeness(examples, target, 10, compared_joints(examples.skeleton))
    assert likeness.exact_m(target) == pytest.approx(0.0, abs=1e-12)
    for value in (0.0, 0.5, 1.0):
        weights = fit.at(np.array([value]))
        assert likeness.rough_m(weights) == pytest.approx(likeness.exact_m(weights), abs=0.02)


def test_another_gesture_is_refused_by_name() -> None:
    with pytest.raises(MotionError, match="no set of gestures 'nods'; there are waves, beats"):
        gesture_examples("nods")
