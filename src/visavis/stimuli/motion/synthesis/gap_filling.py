"""Fill the time between two motions: with a piece of recorded idle motion, or by holding a pose.

Source: a study of gestures with full-body posture (a speaker's body between two phrases).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError

HOLD_SPEED_01: Final = 0.08
"""Share of the last velocity at which the way into the hold begins to be measured."""
QUARTER: Final = 0.25
CANDIDATES: Final = 64
"""Pieces of a long source that are compared exactly."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of a source that fits a gap.

    `start` is the source's frame that stands for the last one before the gap; `distance` how badly
    the frames around fit; `runner_up` how much worse the next best start is (NaN: there is none).
    """

    start: int
    distance: float
    runner_up: float


def best_segment(source: Vector, before: Vector, after: Vector, gap: int, window: int) -> Segment:
    """Return the piece of `source` (n, d) whose surroundings are most like those of a gap.

    Raises:
        MotionError: the source or the surroundings are too short.
    """
    return ranked_segments(source, before, after, gap, window)[0]


def ranked_segments(
    source: Vector, before: Vector, after: Vector, gap: int, window: int
) -> list[Segment]:
    """Return pieces of `source` (n, d), those first whose surroundings are most like a gap's; of a
    long source the best `CANDIDATES`.

    `before` (≥ window + 1, d) ends with the last frame before the gap of `gap` frames, `after`
    begins with the first one after it. Squared differences of `window` + 1 frames on either side
    are summed, weighted 1 at the gap and falling linearly to 1 / (window + 1).

    Raises:
        MotionError: the source or the surroundings are too short.
    """
    weight = 1.0 - np.arange(window + 1) / (window + 1)
    if len(before) <= window or len(after) <= window:
        raise MotionError(
            f"{len(before)} frames before and {len(after)} after the gap; a window of {window} "
            f"needs {window + 1} of each"
        )
    starts = np.arange(window, len(source) - gap - window - 1)
    if gap < 1 or not len(starts):
        raise MotionError(
            f"no piece of {len(source)} frames holds a gap of {gap} and {window + 1} frames on "
            "either side; give a longer source or a smaller window"
        )
    sooner = before[::-1][: window + 1]
    if len(starts) > 2 * CANDIDATES:
        # Correlations find the few best starts fast, but lose digits; these are compared exactly.
        rough = _rough_distance(source, sooner, after[: window + 1], gap, weight)
        starts = starts[np.sort(np.argpartition(rough, CANDIDATES)[:CANDIDATES])]
    offsets = np.arange(window + 1)
    off_before = sooner - source[starts[:, None] - offsets]
    off_after = after[: window + 1] - source[starts[:, None] + gap + 1 + offsets]
    each = (off_before**2).sum(axis=-1) + (off_after**2).sum(axis=-1)
    distance = each @ weight
    order = np.argsort(distance, kind="stable")
    more = np.diff(distance[order], append=np.nan)
    return [
        Segment(int(starts[k]), float(distance[k]), float(further))
        for k, further in zip(order, more, strict=True)
    ]


def _rough_distance(
    source: Vector, sooner: Vector, after: Vector, gap: int, weight: Vector
) -> Vector:
    """Return the distance of every start, without what is the same for all of them."""
    window = len(weight) - 1
    # Values about their mean, so that little is lost where squares are subtracted.
    middle = source.mean(axis=0)
    values = source - middle
    size = (values**2).sum(axis=1)
    past = np.convolve(size, weight, "valid")
    ahead = np.correlate(size, weight, "valid")
    for column in range(values.shape[1]):
        own = values[:, column]
        past -= 2 * np.convolve(own, weight * (sooner[:, column] - middle[column]), "valid")
        ahead -= 2 * np.correlate(own, weight * (after[:, column] - middle[column]), "valid")
    # `past` begins with start `window`, `ahead` with frame 0; the last start leaves a window after.
    count = len(source) - gap - 2 * window - 1
    rough: Vector = past[:count] + ahead[window + gap + 1 :][:count]
    return rough


def fill_gap(source: Vector, before: Vector, after: Vector, gap: int, start: int) -> Vector:
    """Return the frames (gap, d) of a piece, bent linearly so that it meets both ends."""
    first_off = before[-1] - source[start]
    last_off = after[0] - source[start + gap + 1]
    share = (np.arange(1, gap + 1) / (gap + 1))[:, None]
    piece: Vector = source[start + 1 : start + gap + 1] + (1 - share) * first_off + share * last_off
    return piece


@dataclass(frozen=True)
class Hold:
    """Come to rest after a motion, hold, and ease into the next one, all within `gap_s`.

    `end` and `speed` are the value and velocity at the end of the motion before, `following` the
    value at the start of the next.
    """

    end: float
    speed: float
    following: float
    gap_s: float

    def __post_init__(self) -> None:
        if not 0 < self.gap_s < np.inf:
            raise MotionError(f"a gap of {self.gap_s} s; give a time above 0")

    @property
    def value(self) -> float:
        """The value that is held."""
        return self.end + HOLD_SPEED_01 * self.speed * QUARTER * self.gap_s

    @property
    def from_s(self) -> float:
        """When the hold begins, seconds after the gap's start."""
        return QUARTER * self.gap_s

    @property
    def to_s(self) -> float:
        """When the hold ends."""
        return 2 * QUARTER * self.gap_s

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return the value at times of any shape, clamped to the gap."""
        t = np.asarray(t_s, dtype=np.float64)
        into = _smooth(t / self.from_s)
        out = _smooth((t - self.to_s) / (self.gap_s - self.to_s))
        resting = self.end + into * (self.value - self.end)
        moving: Vector = resting + out * (self.following - self.value)
        return moving


def _smooth(share: Vector) -> Vector:
    x = np.clip(share, 0.0, 1.0)
    smooth: Vector = x * x * (3.0 - 2.0 * x)
    return smooth
