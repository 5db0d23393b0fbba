"""Tell which gaze samples may be used, join two eyes, and count what is missing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, unit
from visavis.lab.sampling import Sampling

Mask = npt.NDArray[np.bool_]

_UNIT_TOLERANCE = 0.01
_SLACK_NS = 20_000


@dataclass(frozen=True, slots=True)
class LossParameters:
    """When a sample counts as lost although a row is there.

    `frozen_ms`: the same direction, to the last bit, for this long is a tracker repeating
    itself. `openness_01` and `confidence_01` are the lowest values that still count (Agtzidis et
    al. 2019 for the confidence).
    """

    frozen_ms: float = 100.0
    openness_01: float = 0.5
    confidence_01: float = 0.25


DEFAULT_LOSS = LossParameters()


def frozen_samples(
    t_ns: Times, direction: npt.NDArray[np.floating], *, frozen_ms: float = 100.0
) -> Mask:
    """Return (n,) the samples of runs that repeat one direction for at least `frozen_ms`.

    Rows of one stamp are one sample. The last sample of a run counts for one step.
    """
    n = t_ns.shape[0]
    if n == 0:
        return np.zeros(0, bool)
    same = np.concatenate([[False], (direction[1:] == direction[:-1]).all(axis=1)])
    run = np.cumsum(~same) - 1
    first = np.flatnonzero(~same)
    last = np.append(first[1:], n) - 1
    distinct = np.concatenate([t_ns[:1], t_ns[1:][np.diff(t_ns) > 0]])
    run_ns = t_ns[last] - t_ns[first] + typical_step_ns(distinct)
    is_long = run_ns + _SLACK_NS >= round(frozen_ms * NS_PER_MS)
    is_frozen: Mask = is_long[run] & (last > first)[run]
    return is_frozen


def usable_samples(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    *,
    valid: Mask | None = None,
    openness_01: npt.NDArray[np.floating] | None = None,
    confidence_01: npt.NDArray[np.floating] | None = None,
    params: LossParameters = DEFAULT_LOSS,
) -> Mask:
    """Return (n,) which samples may be used.

    A row is lost when its direction is zero, not finite or not of unit length, when the tracker
    calls it invalid, when the eye is closed or confidence is low, and in frozen runs. A missing
    (NaN) openness or confidence is ignored.
    """
    length = np.linalg.norm(direction.astype(np.float64), axis=1)
    with np.errstate(invalid="ignore"):
        usable: Mask = np.abs(length - 1.0) <= _UNIT_TOLERANCE
        if valid is not None:
            usable = usable & valid
        if openness_01 is not None:
            usable = usable & ~(openness_01 < params.openness_01)
        if confidence_01 is not None:
            usable = usable & ~(confidence_01 < params.confidence_01)
    return usable & ~frozen_samples(t_ns, direction, frozen_ms=params.frozen_ms)


def combined_direction(
    left: Vector, right: Vector, left_usable: Mask, right_usable: Mask
) -> tuple[Vector, npt.NDArray[np.uint8]]:
    """Return the cyclopean direction (n, 3) and the eyes in it (bit 0 left, bit 1 right).

    Both eyes are averaged when both are usable, else the usable one stands; NaN when neither.
    When one eye drops out its usual offset from the average (half the median of right minus
    left where both are usable) is taken off, so that gaze does not jump.
    """
    both = left_usable & right_usable
    eyes = (left_usable + 2 * right_usable).astype(np.uint8)
    gaze = np.full(left.shape, np.nan)
    gaze[both] = unit(left[both] + right[both])
    half = np.zeros(3)
    if both.any():
        half = np.median(right[both] - left[both], axis=0) / 2
    only_left, only_right = left_usable & ~both, right_usable & ~both
    gaze[only_left] = unit(left[only_left] + half)
    gaze[only_right] = unit(right[only_right] - half)
    return gaze, eyes


@dataclass(frozen=True, slots=True)
class Loss:
    """Counts of missing samples in a stretch of time; shares 0..1, NaN when undefined.

    `invalid_rows_01` = unusable rows / rows. `lost_01` = 1 - usable / (duration × nominal rate),
    which also sees rows that never came: report this one. `rate_hz` comes from the first and
    last stamp, `effective_rate_hz` counts usable samples only. A gap is the time between usable
    samples beyond one step; `blink_gaps_01` is the share of gaps of 50–400 ms.
    """

    rows: int
    usable: int
    duration_ms: float
    invalid_rows_01: float
    lost_01: float
    rate_hz: float
    effective_rate_hz: float
    gaps: int
    longest_gap_ms: float
    median_gap_ms: float
    blink_gaps_01: float
    repeated_stamps: int
    repeated_values: int
    frozen: int


def loss(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    usable: Mask,
    *,
    nominal_rate_hz: float,
    frozen_ms: float = 100.0,
    sampling: Sampling | None = None,
) -> Loss:
    """Count what is missing from one stream; stamps may repeat but not go back.

    With `sampling`, of stamps that are uneven or whose rate changes, what is due comes from it and
    not from the nominal rate, and no long step is a gap before which it misses nothing.
    A repeated value has the exact direction of the row before under another stamp.
    """
    if len(t_ns) and bool((np.diff(t_ns) < 0).any()):
        raise UsageError(
            "stamps go back; sort the rows first (visavis.analysis.gaze.stamps.order_of)"
        )
    n = len(t_ns)
    again = np.concatenate([[False], np.diff(t_ns) == 0])[:n]
    single = ~again
    step_ns = NS_PER_S / nominal_rate_hz
    span_ns = float(t_ns[-1] - t_ns[0]) + step_ns if n else 0.0
    is_usable = usable & single
    gaps_ms = np.zeros(0)
    if n:
        edges = np.concatenate([[t_ns[0] - step_ns], t_ns[is_usable], [t_ns[-1] + step_ns]])
        gaps_ms = (np.diff(edges) - step_ns) / NS_PER_MS
        is_gap = gaps_ms > 0.5 * step_ns / NS_PER_MS
        if sampling is not None:
            rows = np.flatnonzero(is_usable)
            missing = np.concatenate([[0], np.cumsum(sampling.missing)])
            between = missing[rows[1:] + 1] - missing[rows[:-1] + 1]
            is_gap[1:-1] &= (between > 0) | (np.diff(rows) > 1)
        gaps_ms = gaps_ms[is_gap]
    stamps = int(single.sum())
    due = span_ns / step_ns
    if sampling is not None:
        due = len(sampling.missing) + int(sampling.missing.sum())
    same = (direction[1:] == direction[:-1]).all(axis=1) & ~again[1:] & usable[1:]
    is_frozen = frozen_samples(t_ns, direction, frozen_ms=frozen_ms)
    zero = ~np.isfinite(direction).all(axis=1) | (direction == 0).all(axis=1)
    return Loss(
        rows=n,
        usable=int(is_usable.sum()),
        duration_ms=span_ns / NS_PER_MS,
        invalid_rows_01=1 - int(usable.sum()) / n if n else np.nan,
        lost_01=max(0.0, 1 - int(is_usable.sum()) / due) if n else np.nan,
        rate_hz=(stamps - 1) * NS_PER_S / float(t_ns[-1] - t_ns[0]) if stamps > 1 else np.nan,
        effective_rate_hz=int(is_usable.sum()) * NS_PER_S / span_ns if n else np.nan,
        gaps=len(gaps_ms),
        longest_gap_ms=float(gaps_ms.max()) if len(gaps_ms) else 0.0,
        median_gap_ms=float(np.median(gaps_ms)) if len(gaps_ms) else np.nan,
        blink_gaps_01=float(((gaps_ms >= 50) & (gaps_ms <= 400)).mean()) if len(gaps_ms) else 0.0,
        repeated_stamps=int(again.sum()),
        repeated_values=int(same.sum()),
        frozen=int((is_frozen & ~zero).sum()),
    )
