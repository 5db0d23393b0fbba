"""The arms of a gesture script: from lexemes to rows of posture, one for each time."""

from itertools import pairwise
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.gesture_script import (
    NO_HAND,
    GesturePhrase,
    GestureScript,
)
from visavis.stimuli.motion.speaking.lexemes import LEXEMES, SHAPES

SIDES: Final[dict[str, tuple[int, ...]]] = {"L": (0,), "R": (1,), "both": (0, 1), NO_HAND: ()}
REST_S: Final = 1.5
"""With less time between two gestures a hand waits before the belly; else it hangs."""
MIN_WAY_S: Final = 0.1
"""A hand is given at least so long to get to a stroke."""
WAITING: Final = (-0.27, -0.52, -0.48)
FORTH_01: Final = 0.6
"""Share of a repeated stroke that goes forth; the rest brings the hand back."""
CLEAR: Final = -0.12
"""How far ways to and from rest bend forward, round the belly."""
OWN_SIDE: Final = -0.12
HAND_01: Final = 0.38
"""Wrist to finger tips, and how far both hands keep from the middle, in arm's lengths."""
VARY_SIZE: Final = 0.12
VARY_PLACE: Final = 0.02
ELBOW: Final = (-0.75, -1.0, 0.45)

# What is known of one arm at one time.
_HOLD: Final = slice(0, p.HOLD_SIZE)
_PLACE: Final = slice(1, 4)
_FINGERS: Final = slice(4, 7)
_PALM: Final = slice(7, 10)
_SHAPE: Final = slice(10, 17)
_LIFT: Final = 17
_SIZE: Final = 18


def gesture_arms(script: GestureScript, t_s: Vector, build: Vector, seed: int) -> Vector:
    """Return what both arms do at times (n,), shape (n, 2, 18).

    `build` (B_SIZE,) are the person's lengths. Each phrase is made a little larger or smaller and
    elsewhere by `seed`. `write_arms` puts the numbers into rows of posture.

    Raises:
        MotionError: a hand has no time to get to a stroke.
    """
    arms = np.zeros((len(t_s), 2, _SIZE))
    for side in range(2):
        own = [(i, phrase) for i, phrase in enumerate(script.phrases) if side in SIDES[phrase.hand]]
        poses = [_poses(phrase, side, build, seed, i) for i, phrase in own]
        rests = [_rest(build)]
        for (_, one), (_, other) in pairwise(own):
            rests.append(_waiting(build) if other.start_s - one.end_s < REST_S else _rest(build))
        rests.append(_rest(build))
        arms[:, side] = rests[0]
        free_s = -np.inf
        for k, ((i, phrase), (first, last, bow)) in enumerate(zip(own, poses, strict=True)):
            # A phrase annotated without preparation takes it from the time before, if any.
            begin_s = min(phrase.start_s, max(free_s, phrase.stroke_s - 3 * MIN_WAY_S))
            if phrase.stroke_s - begin_s < MIN_WAY_S:
                raise MotionError(
                    f"phrase {i + 1} at {phrase.start_s:g} s: its hand has no time to get to the "
                    f"stroke; give a preparation of {MIN_WAY_S:g} s"
                )
            end_s = max(phrase.end_s, phrase.hold_end_s + 3 * MIN_WAY_S)
            if k + 1 < len(own):
                end_s = max(phrase.end_s, min(end_s, own[k + 1][1].start_s))
            _write_phrase(
                arms[:, side],
                t_s,
                phrase,
                (begin_s, end_s),
                rests[k : k + 2],
                first,
                last,
                bow,
                build,
            )
            free_s = end_s
    return arms


def write_arms(controls: Vector, arms: Vector) -> None:
    """Put arms (n, 2, 18) into rows of posture (n, SIZE), over those that hang."""
    for side in range(2):
        start = p.ARM + side * p.ARM_SIZE
        arm, own = controls[:, start : start + p.ARM_SIZE], arms[:, side]
        hold = p.HOLD + p.CHEST * p.HOLD_SIZE
        share = own[:, :1]
        arm[:, hold : hold + p.HOLD_SIZE] = own[:, _HOLD]
        arm[:, p.POLE : p.POLE + 3] = ELBOW
        at = [p.CURL, p.CURL + 1, p.CURL + 2, p.CURL + 3, p.THUMB, p.OPPOSE, p.SPREAD]
        # Shapes are weighted as holds are, so that a hand opens on its way.
        arm[:, at] = (1.0 - share) * arm[:, at] + own[:, _SHAPE]
        arm[:, p.SHOULDER_UP] += own[:, _LIFT]


def _vector(
    build: Vector,
    place: Vector,
    fingers: Vector,
    palm: Vector,
    shape: str,
    lift_rad: float,
) -> Vector:
    reach_m = build[p.B_UPPER_ARM] + build[p.B_FOREARM]
    v = np.zeros(_SIZE)
    v[0] = 1.0
    v[_PLACE] = reach_m * np.asarray(place) + np.array([0.0, build[p.B_SHOULDER_Y], 0.0])
    v[_FINGERS] = np.asarray(fingers) / np.linalg.norm(fingers)
    v[_PALM] = np.asarray(palm) / np.linalg.norm(palm)
    v[_SHAPE] = SHAPES[shape]
    v[_SHAPE.stop - 1] = np.radians(SHAPES[shape][-1])
    v[_LIFT] = lift_rad
    return v


def _rest(build: Vector) -> Vector:
    """Return an arm that hangs: nothing is held."""
    return np.zeros(_SIZE)


def _waiting(build: Vector) -> Vector:
    return _vector(
        build,
        np.array(WAITING),
        np.array([0.40, 0.12, -0.9]),
        np.array([0.6, -0.8, 0.0]),
        "loose",
        0.0,
    )


def _poses(
    phrase: GesturePhrase, side: int, build: Vector, seed: int, number: int
) -> tuple[Vector, Vector, Vector]:
    """Return an arm at the stroke's start and at its end, and how its way bends, in metres."""
    lexeme = LEXEMES[phrase.lexeme]
    # Both hands of a phrase vary alike: people do not miss the other hand.
    rng = np.random.default_rng((seed, 41, number))
    size = 1.0 + VARY_SIZE * float(rng.uniform(-1.0, 1.0))
    off = VARY_PLACE * rng.uniform(-1.0, 1.0, 3)
    start, end = np.array(lexeme.start), np.array(lexeme.end)
    middle = (start + end) / 2
    start, end = (middle + size * (x - middle) + off for x in (start, end))
    if phrase.hand == "both":
        # The other hand is there: neither wrist nor fingers cross the middle.
        for at, way in ((start, lexeme.fingers), (end, lexeme.fingers_end or lexeme.fingers)):
            inward = max(0.0, way[0]) / float(np.linalg.norm(way))
            at[0] = min(at[0], OWN_SIDE - HAND_01 * inward)
    lift = np.radians(lexeme.shoulder_deg)
    first = _vector(build, start, np.array(lexeme.fingers), np.array(lexeme.palm), lexeme.shape, 0)
    last = _vector(
        build,
        end,
        np.array(lexeme.fingers_end or lexeme.fingers),
        np.array(lexeme.palm_end or lexeme.palm),
        lexeme.shape,
        lift,
    )
    if lexeme.alternates and phrase.hand == "both" and side == 1:
        first, last = last, first
    reach_m = build[p.B_UPPER_ARM] + build[p.B_FOREARM]
    return first, last, reach_m * np.array(lexeme.bow)


def _ease(share: Vector) -> Vector:
    x = np.clip(share, 0.0, 1.0)
    smooth: Vector = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    return smooth


def _write_phrase(
    arm: Vector,
    t_s: Vector,
    phrase: GesturePhrase,
    span_s: tuple[float, float],
    rests: list[Vector],
    first: Vector,
    last: Vector,
    bow: Vector,
    build: Vector,
) -> None:
    """Write one arm (n, 18) for the time of a phrase and for what follows it; `t_s` rises."""
    reach_m = build[p.B_UPPER_ARM] + build[p.B_FOREARM]
    lexeme = LEXEMES[phrase.lexeme]
    (begin_s, end_s), (before, after) = span_s, rests
    edges_s = (begin_s, phrase.stroke_s, phrase.stroke_end_s, phrase.hold_end_s, end_s)
    begin, stroke, hold, retraction, end = np.searchsorted(t_s, edges_s).tolist()
    arm[end:] = after

    # Preparation: from rest to the stroke's start, round the belly.
    rows = slice(begin, stroke)
    e = _ease((t_s[rows] - begin_s) / (phrase.stroke_s - begin_s))[:, None]
    way = (1.0 - e) * before + e * first
    way[:, _PLACE] += 4.0 * e * (1.0 - e) * np.array([0.0, 0.0, CLEAR * reach_m])
    arm[rows] = way

    # Strokes: all but the last come back; the hold stays at the end.
    rows = slice(stroke, hold)
    place = (t_s[rows] - phrase.stroke_s) / (phrase.stroke_end_s - phrase.stroke_s)
    turn = place * phrase.strokes
    number = np.minimum(np.floor(turn), phrase.strokes - 1)
    within = turn - number
    is_last = number == phrase.strokes - 1
    forth = _ease(within / np.where(is_last, 1.0, FORTH_01))
    back = _ease((within - FORTH_01) / (1.0 - FORTH_01))
    e = np.where(is_last, forth, forth - back)[:, None]
    way = (1.0 - e) * first + e * last
    swing = np.sin(2 * np.pi * lexeme.shakes * place) * np.sin(np.pi * place)
    way[:, _PLACE] += 4.0 * e * (1.0 - e) * bow
    way[:, _PLACE] += reach_m * swing[:, None] * np.array(lexeme.shake)
    arm[rows] = way
    arm[hold:retraction] = last

    # Retraction.
    if retraction < end:
        rows = slice(retraction, end)
        e = _ease((t_s[rows] - phrase.hold_end_s) / (end_s - phrase.hold_end_s))[:, None]
        way = (1.0 - e) * last + e * after
        way[:, _PLACE] += 4.0 * e * (1.0 - e) * np.array([0.0, 0.0, CLEAR * reach_m])
        arm[rows] = way
