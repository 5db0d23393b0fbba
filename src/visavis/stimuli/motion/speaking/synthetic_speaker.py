"""A speaker that we made: twenty minutes of gestures with transitions, rules and delays we planted.

No recorded monologue may be passed on with Visavis. This one proves that what is planted is
found again, and lets films be made before a lab has recorded a speaker of its own.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.body_plan import TRUNK_RAD, Turn, trunk_of
from visavis.stimuli.motion.speaking.body_track import (
    LEAN,
    RATE_HZ,
    ROLL,
    YAW,
    X,
    Y,
    Z,
    measure_body,
)
from visavis.stimuli.motion.speaking.gesture_script import GesturePhrase, GestureScript
from visavis.stimuli.motion.speaking.gesturing import gesture_arms
from visavis.stimuli.motion.speaking.performance import performed
from visavis.stimuli.motion.speaking.speaker import Posture, Speaker, Take
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES

MINUTES: Final = 20.0
TRANSITIONS: Final[dict[str, Vector]] = {
    "com": np.array([[0.30, 0.35, 0.35], [0.35, 0.25, 0.40], [0.40, 0.30, 0.30]]),
    "yaw": np.array([[0.35, 0.40, 0.25], [0.30, 0.40, 0.30], [0.20, 0.45, 0.35]]),
}
"""Share of every class (columns, in the order of `CLASSES`) after every class (rows)."""
HANDS: Final = ("L", "R", "both")
HANDS_AT: Final = {
    "left": (0.60, 0.15, 0.25),
    "centre": (0.20, 0.20, 0.60),
    "right": (0.10, 0.70, 0.20),
}
"""Share of each hand where the weight is; the same for every direction of the hips."""
LEXEMES_AT: Final[dict[str, tuple[str, ...]]] = {
    "left": ("point_side", "wipe", "weigh", "cup"),
    "front": ("cup", "frame", "beat", "offer"),
    "right": ("cup_flip", "chop", "progressive", "frame"),
}
"""Gestures, equally often, where the hips point; some go with two directions."""
COM_AFTER_S: Final = 0.20
YAW_BEFORE_S: Final = 0.10
TRUNK_AFTER_S: Final = 0.08
TRUNK_SD_S: Final = 0.06
DELAY_SD_S: Final = 0.04
COM_AT: Final = {"left": -0.36, "centre": 0.0, "right": 0.36}
COM_SPREAD: Final = 0.05
YAW_AT_DEG: Final = {"left": 16.0, "front": 0.0, "right": -16.0}
YAW_SPREAD_DEG: Final = 3.0
BACK_01: Final = 0.10
"""After its extreme the body gives way by so much of the change."""
SWAY_01: Final = 0.006
SWAY_DEG: Final = 0.25


@dataclass(frozen=True)
class Planted:
    """What was planted: postures at the end of each phrase, and delays in seconds (mean)."""

    postures: tuple[Posture, ...]
    com_after_s: float
    yaw_before_s: float
    trunk_after_s: float
    trunk_sd_s: float


@lru_cache(maxsize=4)
def synthetic_speaker(seed: int = 1, minutes: float = MINUTES) -> tuple[Speaker, Planted]:
    """Return a speaker measured from a motion that we made, and what was planted in it."""
    clip, script, planted = synthetic_take(seed, minutes)
    return Speaker((Take("synthetic", measure_body(clip, "synthetic"), script),)), planted


def synthetic_take(seed: int, minutes: float) -> tuple[Clip, GestureScript, Planted]:
    """Return a monologue as a motion of a whole body, its annotation, and what was planted."""
    rng = np.random.default_rng((seed, 50))
    script, postures = _monologue(rng, 60.0 * minutes)
    n = int(np.floor(script.duration_s * RATE_HZ)) + 1
    t_s = np.arange(n) / RATE_HZ
    # Weight and hips go to the target of each phrase, are there at their planted times, and then
    # give way a little.
    com_s = [ph.stroke_end_s + rng.normal(COM_AFTER_S, DELAY_SD_S) for ph in script.phrases]
    yaw_s = [ph.stroke_end_s - YAW_BEFORE_S + rng.normal(0, DELAY_SD_S) for ph in script.phrases]
    spread = rng.uniform(-1.0, 1.0, (len(postures), 2))
    com_to = [COM_AT[c] + COM_SPREAD * s for (c, _), s in zip(postures, spread[:, 0], strict=True)]
    yaw_to = [
        np.radians(YAW_AT_DEG[y] + YAW_SPREAD_DEG * s)
        for (_, y), s in zip(postures, spread[:, 1], strict=True)
    ]
    starts = [ph.start_s for ph in script.phrases]
    ends = [ph.end_s for ph in script.phrases]
    hips = np.zeros((n, 6))
    hips[:, X] = _course(t_s, starts, com_s, ends, com_to) + SWAY_01 * _sway(t_s, rng)
    hips[:, YAW] = _course(t_s, starts, yaw_s, ends, yaw_to) + np.radians(SWAY_DEG) * _sway(
        t_s, rng
    )
    hips[:, Y] = 0.985 - 0.12 * hips[:, X] ** 2
    hips[:, Z] = 0.012 + 0.004 * _sway(t_s, rng)
    hips[:, LEAN] = np.radians(3.0) + np.radians(0.3) * _sway(t_s, rng)
    hips[:, ROLL] = -np.radians(12.0) * hips[:, X]
    turns, at = [], {"left": TRUNK_RAD, "front": 0.0, "right": -TRUNK_RAD}
    for phrase, (_, yaw) in zip(script.phrases, postures, strict=True):
        onset_s = phrase.start_s + rng.normal(TRUNK_AFTER_S, TRUNK_SD_S)
        turns.append(Turn(onset_s, phrase.stroke_end_s, at[yaw]))
    build = build_of_skeleton(canonical_skeleton())
    arms = gesture_arms(script, t_s, build.lengths_m, seed)
    clip = performed(build, t_s, hips, trunk_of(turns, t_s), arms, seed)
    planted = Planted(postures, COM_AFTER_S, YAW_BEFORE_S, TRUNK_AFTER_S, TRUNK_SD_S)
    return clip, script, planted


def _monologue(
    rng: np.random.Generator, seconds: float
) -> tuple[GestureScript, tuple[Posture, ...]]:
    """Return an annotation and the posture at the end of each phrase.

    Postures follow each other, and gestures go with them, from decks that are dealt out and
    shuffled anew: so frequencies are the planted ones as nearly as whole numbers allow, and twenty
    minutes suffice to tell whether they are found again.
    """
    follow = {
        part: {name: _Deck(rng, shares) for name, shares in zip(CLASSES[part], rows, strict=True)}
        for part, rows in TRANSITIONS.items()
    }
    hands = {name: _Deck(rng, np.array(shares)) for name, shares in HANDS_AT.items()}
    lexemes = {
        (yaw, hand): _Deck(rng, np.full(len(names), 1 / len(names)))
        for yaw, names in LEXEMES_AT.items()
        for hand in HANDS
    }
    phrases: list[GesturePhrase] = []
    postures: list[Posture] = []
    com, yaw = "centre", "front"
    at_s = 1.0
    while True:
        com = CLASSES["com"][follow["com"][com].deal()]
        yaw = CLASSES["yaw"][follow["yaw"][yaw].deal()]
        hand = HANDS[hands[com].deal()]
        lexeme = LEXEMES_AT[yaw][lexemes[yaw, hand].deal()]
        strokes = 1 if rng.random() < 0.75 else 2
        ways_s = (
            rng.uniform(0.45, 0.70),
            strokes * rng.uniform(0.28, 0.42),
            rng.uniform(0.10, 0.30),
            rng.uniform(0.45, 0.70),
        )
        start_s, stroke_s, stroke_end_s, hold_end_s, end_s = (
            round(float(t), 3) for t in at_s + np.cumsum((0.0, *ways_s))
        )
        if end_s > seconds - 1.0:
            break
        phrases.append(
            GesturePhrase(start_s, stroke_s, stroke_end_s, hold_end_s, end_s, hand, lexeme, strokes)
        )
        postures.append((com, yaw))
        at_s = end_s + rng.uniform(0.25, 1.2)
    return GestureScript(tuple(phrases), seconds), tuple(postures)


class _Deck:
    """Numbers dealt with given shares, as exactly as twenty cards allow."""

    CARDS: Final = 20

    def __init__(self, rng: np.random.Generator, shares: Vector) -> None:
        counts = np.round(self.CARDS * shares).astype(np.int64)
        self._cards = np.repeat(np.arange(len(shares)), counts)
        self._rng = rng
        self._left: list[int] = []

    def deal(self) -> int:
        """Return the next number."""
        if not self._left:
            self._left = self._rng.permutation(self._cards).tolist()
        return self._left.pop()


def _course(
    t_s: Vector,
    starts_s: list[float],
    extremes_s: list[float],
    ends_s: list[float],
    to: list[float],
) -> Vector:
    """Return values that are at their targets at the extremes and give way until phrases end."""
    values = np.zeros(len(t_s))
    at = 0.0
    for start, extreme, end, target in zip(starts_s, extremes_s, ends_s, to, strict=True):
        returns_s = max(end - extreme, 0.3)
        # Before and after both ways nothing changes any more.
        first, past = np.searchsorted(t_s, (start, extreme + returns_s))
        share = np.clip((t_s[first:past] - start) / (extreme - start), 0.0, 1.0)
        back = np.clip((t_s[first:past] - extreme) / returns_s, 0.0, 1.0)
        rest = target - BACK_01 * (target - at)
        values[first:past] += (target - at) * share**3 * (10.0 + share * (6.0 * share - 15.0))
        values[first:past] += (rest - target) * back**2 * (3.0 - 2.0 * back)
        values[past:] += target - at
        values[past:] += rest - target
        at = rest
    return values


def _sway(t_s: Vector, rng: np.random.Generator) -> Vector:
    """Return slow noise of unit size."""
    rates, phases = rng.uniform(0.08, 0.45, 5), rng.uniform(0, 2 * np.pi, 5)
    sway: Vector = np.sin(2 * np.pi * rates * t_s[:, None] + phases).sum(axis=1) / np.sqrt(2.5)
    return sway
