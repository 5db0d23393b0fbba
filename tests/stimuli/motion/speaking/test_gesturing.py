"""Arms by lexeme: 38 of them, none through the body, the right hand as the left one's mirror."""

import numpy as np
import pytest

from tests.stimuli.motion.speaking.touching import clearance_m
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.build import Build, build_of_character, build_of_skeleton
from visavis.stimuli.motion.clip import Clip, placed_joints
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.gesture_script import GesturePhrase, GestureScript
from visavis.stimuli.motion.speaking.gesturing import gesture_arms
from visavis.stimuli.motion.speaking.lexemes import LEXEMES
from visavis.stimuli.motion.speaking.performance import performed

CANONICAL = build_of_skeleton(canonical_skeleton())
UPRIGHT = np.array([0.0, 0.985, 0.012, 0.0, 0.052, 0.0])


def performed_alone(
    script: GestureScript, build: Build, *, seed: int = 1, rate_hz: float = 30.0
) -> Clip:
    t_s = np.arange(0.0, script.duration_s, 1 / rate_hz)
    hips = np.repeat(UPRIGHT[None], len(t_s), axis=0)
    arms = gesture_arms(script, t_s, build.lengths_m, seed)
    return performed(build, t_s, hips, np.zeros(len(t_s)), arms, seed)


def script_of(lexeme: str, hand: str, strokes: int = 1) -> GestureScript:
    phrase = GesturePhrase(0.2, 0.7, 0.7 + 0.4 * strokes, 1.3 + 0.4 * strokes, 2.4, hand, lexeme)
    return GestureScript((phrase,), 2.8)


def test_there_are_38() -> None:
    assert len(LEXEMES) == 38


def all_in_a_row(hand: str) -> GestureScript:
    phrases = [
        GesturePhrase(at, at + 0.5, at + 0.9, at + 1.1, at + 1.6, hand, lexeme, 1 + i % 2)
        for i, lexeme in enumerate(LEXEMES)
        for at in [0.2 + 2.6 * i - 0.7 * (i % 2)]
    ]
    return GestureScript(tuple(phrases), phrases[-1].end_s + 0.5)


@pytest.mark.parametrize("hand", ["R", "both"])
@pytest.mark.parametrize("who", ["canonical", "anna", "karim"])
def test_no_arm_passes_through_the_body(who: str, hand: str) -> None:
    build = CANONICAL if who == "canonical" else build_of_character(load_character(who))
    clip = performed_alone(all_in_a_row(hand), build, seed=2, rate_hz=15.0)
    gap_m, parts, when_s = clearance_m(clip, build.stature_m)
    assert gap_m >= 0.0, f"{parts} at {when_s:.2f} s"


def test_the_left_hand_does_what_the_right_does_mirrored() -> None:
    # The person's own looseness is not mirrored, so only the held wrist is compared.
    clips = {hand: performed_alone(script_of("wipe", hand), CANONICAL) for hand in "LR"}
    wrists = {
        hand: placed_joints(clip, 1.2).position_m[CANONICAL.skeleton.index(f"{side}_hand")]
        for (hand, clip), side in zip(clips.items(), ("left", "right"), strict=True)
    }
    assert wrists["L"] == pytest.approx(wrists["R"] * np.array([-1.0, 1.0, 1.0]), abs=0.02)


def test_a_repeated_stroke_ends_where_a_single_one_does() -> None:
    t_s = np.array([0.9, 1.6])
    once = GestureScript((GesturePhrase(0.2, 0.7, 1.6, 1.8, 2.4, "R", "chop", 1),), 3.0)
    thrice = GestureScript((GesturePhrase(0.2, 0.7, 1.6, 1.8, 2.4, "R", "chop", 3),), 3.0)
    one, three = (gesture_arms(s, t_s, CANONICAL.lengths_m, 1)[:, 1] for s in (once, thrice))
    assert one[1] == pytest.approx(three[1])
    assert np.abs(one[0] - three[0]).max() > 0.02


def test_hands_move_without_a_jump() -> None:
    script = all_in_a_row("R")
    t_s = np.arange(0.0, script.duration_s, 1e-3)
    arms = gesture_arms(script, t_s, CANONICAL.lengths_m, 1)
    assert np.abs(np.diff(arms[:, 1, 1:4], axis=0)).max() < 0.01


def test_seeds_vary_a_gesture_and_one_seed_repeats_it() -> None:
    t_s, script = np.array([1.1]), script_of("cup", "R")
    one, again, other = (gesture_arms(script, t_s, CANONICAL.lengths_m, s) for s in (1, 1, 2))
    assert (one == again).all()
    assert 0.001 < np.abs(one - other)[0, 1, 1:4].max() < 0.08


def test_a_hand_without_time_to_get_to_its_stroke_is_named() -> None:
    phrases = (
        GesturePhrase(0.2, 0.7, 1.0, 1.0, 1.0, "R", "cup"),
        GesturePhrase(1.0, 1.05, 1.3, 1.3, 1.8, "R", "chop"),
    )
    with pytest.raises(MotionError, match="phrase 2 at 1 s: its hand has no time"):
        gesture_arms(GestureScript(phrases, 2.0), np.zeros(1), CANONICAL.lengths_m, 1)
