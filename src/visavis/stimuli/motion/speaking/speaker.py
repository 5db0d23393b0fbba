"""A speaker learnt from annotated recordings: habits, delays, and the pieces of motion to use."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.body_track import RATE_HZ, YAW, BodyTrack
from visavis.stimuli.motion.speaking.gesture_script import HANDS, GesturePhrase, GestureScript
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES, Habits, Phrase

CENTRE_01: Final = 0.15
"""Weight less far from the middle, in widths of the stance, is in the centre."""
FRONT_RAD: Final = float(np.radians(8.0))
"""Hips turned by less face the front."""
MIN_SHIFT_01: Final = 0.05
MIN_TURN_RAD: Final = float(np.radians(2.0))
MIN_TRUNK_RAD: Final = float(np.radians(3.0))
"""Smaller changes within a phrase are taken for sway: no delay is measured from them."""
ONSET_01: Final = 0.02
"""A turn begins where its speed passes this share of its greatest."""
LOOK_BACK_S: Final = 1.0
Posture = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Take:
    """One recording of a speaker with its annotation."""

    name: str
    track: BodyTrack
    script: GestureScript


@dataclass(frozen=True)
class Delay:
    """How long after a moment something happens: mean and standard deviation in seconds, of n."""

    mean_s: float
    sd_s: float
    n: int

    @property
    def error_s(self) -> float:
        """Standard error of the mean; infinite where there are fewer than two."""
        return self.sd_s / float(np.sqrt(self.n)) if self.n > 1 else np.inf


@dataclass(frozen=True, eq=False)
class Clip:
    """A piece of a take that goes with a phrase: frames `first` to `last` of take `take`.

    `stroke_end` is the frame of the stroke's end; `com_end` and `yaw_end` where weight and hips
    come to their extreme (fractions of frames; the stroke's end where they have none).
    """

    take: int
    row: int
    first: int
    last: int
    stroke_end: float
    com_end: float
    yaw_end: float
    start_speed: float
    posture: Posture


def com_class(com: float) -> str:
    """Return where weight is that lies `com` widths of the stance to the right of the middle."""
    if abs(com) < CENTRE_01:
        return "centre"
    return "right" if com > 0 else "left"


def yaw_class(yaw_rad: float) -> str:
    """Return where hips point that are turned by an angle to the left."""
    if abs(yaw_rad) < FRONT_RAD:
        return "front"
    return "left" if yaw_rad > 0 else "right"


@dataclass(frozen=True, eq=False)
class Speaker:
    """Everything that is learnt from a speaker's takes. `beta` is the rules' share.

    With a `model` the body is this speaker's own, and its postures follow the model's habits.

    Raises:
        MotionError: a phrase lies outside of its recording, or there are no phrases.
    """

    takes: tuple[Take, ...]
    beta: float = 0.65
    min_support: float = 0.02
    min_confidence: float = 0.30
    model: "Speaker | None" = None

    def __post_init__(self) -> None:
        if not any(take.script.phrases for take in self.takes):
            raise MotionError("no phrase is annotated; annotate the speaker's gestures")
        for take in self.takes:
            whole_s = (len(take.track.com) - 1) / RATE_HZ
            for i, phrase in enumerate(take.script.phrases, 1):
                if phrase.end_s > whole_s + 0.5 / RATE_HZ:
                    raise MotionError(
                        f"{take.name}: phrase {i} ends at {phrase.end_s:g} s, the recording of the "
                        f"body at {whole_s:.2f} s; check that both begin together"
                    )

    @cached_property
    def phrases(self) -> tuple[tuple[int, GesturePhrase], ...]:
        """Every phrase with the number of its take."""
        return tuple((k, p) for k, take in enumerate(self.takes) for p in take.script.phrases)

    @cached_property
    def postures(self) -> tuple[Posture, ...]:
        """Weight and direction at the end of every phrase."""
        result = []
        for k, phrase in self.phrases:
            track = self.takes[k].track
            row = min(round(phrase.end_s * RATE_HZ), len(track.com) - 1)
            result.append((com_class(float(track.com[row])), yaw_class(float(track.yaw[row]))))
        return tuple(result)

    @cached_property
    def habits(self) -> Habits:
        """Transitions and rules of the postures: the speaker's own, or those of the model."""
        if self.model is not None:
            return self.model.habits
        takes = [k for k, _ in self.phrases]
        return Habits(
            tuple(
                Phrase(HANDS[phrase.hand], phrase.lexeme, *posture)
                for (_, phrase), posture in zip(self.phrases, self.postures, strict=True)
            ),
            self.beta,
            self.min_support,
            self.min_confidence,
            frozenset(i for i in range(1, len(takes)) if takes[i] != takes[i - 1]),
        )

    @cached_property
    def mean_phrase_s(self) -> float:
        """Average length of a phrase."""
        return float(np.mean([p.end_s - p.start_s for _, p in self.phrases]))

    @cached_property
    def _extremes(self) -> Vector:
        """When weight and hips come to an extreme, after the stroke's end: (phrases, 2) s or NaN.

        The extreme of a phrase is the value farthest from the one at its start, where the speed is
        zero; one at the edge of the phrase is none.
        """
        late = np.full((len(self.phrases), 2), np.nan)
        for i, (k, phrase) in enumerate(self.phrases):
            track = self.takes[k].track
            first, last = round(phrase.start_s * RATE_HZ), round(phrase.end_s * RATE_HZ)
            for column, (values, least) in enumerate(
                ((track.com, MIN_SHIFT_01), (track.yaw, MIN_TURN_RAD))
            ):
                off = np.abs(values[first : last + 1] - values[first])
                best = int(np.argmax(off))
                if 0 < best < len(off) - 1 and off[best] >= least:
                    # The top of the parabola through three frames.
                    a, b, c = off[best - 1 : best + 2]
                    shift = 0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c < 0 else 0.0
                    late[i, column] = (first + best + shift) / RATE_HZ - phrase.stroke_end_s
        return late

    @cached_property
    def com_delay(self) -> Delay:
        """When the weight comes to rest, after the end of the stroke."""
        return _delay_of(self._extremes[:, 0])

    @cached_property
    def yaw_delay(self) -> Delay:
        """When the hips come to rest, after the end of the stroke (negative: before)."""
        return _delay_of(self._extremes[:, 1])

    @cached_property
    def trunk_delay(self) -> Delay:
        """When the spine begins to turn, after the start of the phrase."""
        late = []
        for k, phrase in self.phrases:
            trunk = self.takes[k].track.trunk_yaw
            first = max(0, round((phrase.start_s - LOOK_BACK_S) * RATE_HZ))
            last = round(phrase.stroke_end_s * RATE_HZ)
            piece = trunk[first : last + 1]
            if abs(piece[-1] - piece[0]) < MIN_TRUNK_RAD:
                continue
            speed = np.gradient(piece) * np.sign(piece[-1] - piece[0])
            peak = int(np.argmax(speed))
            slow = np.flatnonzero(speed[: peak + 1] < ONSET_01 * speed[peak])
            if len(slow) and slow[-1] < peak:
                a, b = speed[slow[-1]], speed[slow[-1] + 1]
                share = (ONSET_01 * speed[peak] - a) / (b - a)
                late.append((first + slow[-1] + share) / RATE_HZ - phrase.start_s)
        return _delay_of(np.array(late))

    @cached_property
    def scale(self) -> Vector:
        """Standard deviations of weight and yaw over all takes, shape (2,)."""
        spread = np.array(
            [
                np.concatenate([take.track.com for take in self.takes]).std(),
                np.concatenate([take.track.yaw for take in self.takes]).std(),
            ]
        )
        positive: Vector = np.maximum(spread, 1e-9)
        return positive

    def features(self, take: int) -> Vector:
        """Return weight and yaw of a take in their standard deviations, shape (n, 2)."""
        track = self.takes[take].track
        both: Vector = np.stack([track.com, track.yaw], axis=1) / self.scale
        return both

    @cached_property
    def speeds(self) -> tuple[Vector, ...]:
        """Summed speed of weight and yaw in every frame of each take, in SDs per second."""
        return tuple(
            np.abs(np.gradient(self.features(k), axis=0)).sum(axis=1) * RATE_HZ
            for k in range(len(self.takes))
        )

    @cached_property
    def fast(self) -> Vector:
        """95th percentiles of the speed of weight and of yaw, in SDs per second (2,)."""
        each = [np.abs(np.gradient(self.features(k), axis=0)) for k in range(len(self.takes))]
        speeds: Vector = np.quantile(np.concatenate(each), 0.95, axis=0) * RATE_HZ
        return speeds

    @cached_property
    def idle_speed(self) -> float:
        """Average speed while no phrase is spoken; of everything where there is always one."""
        idle = [speeds[~self._is_spoken(k)] for k, speeds in enumerate(self.speeds)]
        slow = np.concatenate(idle)
        return float(np.mean(slow if slow.size else np.concatenate(self.speeds)))

    def _is_spoken(self, take: int) -> npt.NDArray[np.bool_]:
        is_spoken = np.zeros(len(self.takes[take].track.com), np.bool_)
        for phrase in self.takes[take].script.phrases:
            first, last = round(phrase.start_s * RATE_HZ), round(phrase.end_s * RATE_HZ)
            is_spoken[first : last + 1] = True
        return is_spoken

    @cached_property
    def clips(self) -> tuple[Clip, ...]:
        """One piece of motion for every phrase during which both feet stay where they are."""
        pieces = []
        for i, (k, phrase) in enumerate(self.phrases):
            first, last = round(phrase.start_s * RATE_HZ), round(phrase.end_s * RATE_HZ)
            if self.takes[k].track.steps[first : last + 1].any():
                continue
            late = np.nan_to_num(self._extremes[i])
            com_end, yaw_end = (phrase.stroke_end_s + late) * RATE_HZ
            pieces.append(
                Clip(
                    k,
                    i,
                    first,
                    last,
                    phrase.stroke_end_s * RATE_HZ,
                    float(com_end),
                    float(yaw_end),
                    float(self.speeds[k][first]),
                    self.postures[i],
                )
            )
        return tuple(pieces)

    @cached_property
    def neutral(self) -> Vector:
        """The speaker's hips (6,) in the middle: weight in the centre, facing the front."""
        hips = np.concatenate([take.track.hips for take in self.takes])
        com = np.concatenate([take.track.com for take in self.takes])
        is_middle = (np.abs(com) < CENTRE_01) & (np.abs(hips[:, YAW]) < FRONT_RAD)
        middle: Vector = np.median(hips[is_middle] if is_middle.any() else hips, axis=0)
        return middle

    def counts(self) -> dict[Posture, int]:
        """Return how many pieces of motion there are for each of the nine postures."""
        return dict(Counter(clip.posture for clip in self.clips))


def _delay_of(late_s: Vector) -> Delay:
    late_s = late_s[np.isfinite(late_s)]
    if not len(late_s):
        return Delay(0.0, 0.0, 0)
    return Delay(
        float(late_s.mean()), float(late_s.std(ddof=1)) if len(late_s) > 1 else 0.0, len(late_s)
    )


NINE: Final = tuple((com, yaw) for com in CLASSES["com"] for yaw in CLASSES["yaw"])
"""All postures in the order of `Habits.joint`."""
