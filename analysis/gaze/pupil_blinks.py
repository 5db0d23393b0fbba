"""Find blinks in the pupil signal, whatever its unit, with the edges that the lid covers.

A blink is a run of samples without a pupil, longer by what the lid did to the samples around it:
the smoothed pupil shrinks up to the loss and grows after it (noise-based onset and offset:
Hershman, Henik & Cohen 2018). Gaze within is an artefact, and so is the pupil.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector

SOURCE: Final = "pupil signal, noise-based (Hershman, Henik & Cohen 2018)"


@dataclass(frozen=True, slots=True)
class PupilBlinkParameters:
    """When a loss of the pupil is a blink; durations in ms.

    `smoothing_ms` and `join_ms` (losses so near to each other are one blink) are the source's. Ours
    are the bounds of the loss itself, beyond which it is a flicker or a tracker that lost the eye,
    and `max_edge_ms` and `min_edge_per_s` (the share of the pupil by which a lid changes it in a
    second, at least), so that a slow change of the pupil beside a blink is no part of it.
    """

    smoothing_ms: float = 10.0
    join_ms: float = 100.0
    min_loss_ms: float = 20.0
    max_loss_ms: float = 500.0
    max_edge_ms: float = 150.0
    min_edge_per_s: float = 0.5


PUPIL_BLINKS: Final = PupilBlinkParameters()


@dataclass(frozen=True, slots=True)
class PupilBlinks:
    """Blinks (k,): begin and end with the lid's edges, time without a pupil, and longer losses.

    `onset_ns` is the last sample before the lid covered the pupil, `offset_ns` the first after;
    `loss_ms` is the time without a pupil. `losses` counts losses that are too long for a blink.
    """

    onset_ns: Times
    offset_ns: Times
    loss_ms: Vector
    losses: int

    def __len__(self) -> int:
        return int(self.onset_ns.shape[0])

    @property
    def duration_ms(self) -> Vector:
        """Whole durations (k,), edges included."""
        duration: Vector = (self.offset_ns - self.onset_ns) / NS_PER_MS
        return duration


def pupil_blinks(
    t_ns: Times, size: npt.NDArray[np.floating], params: PupilBlinkParameters = PUPIL_BLINKS
) -> PupilBlinks:
    """Find blinks in pupil size (n,) of any unit; NaN and 0 are missing, stamps must increase.

    A loss at either end of the recording has one edge and is no blink. Raises UsageError for
    shapes that do not fit.
    """
    n = len(t_ns)
    if size.shape != (n,):
        raise UsageError(f"pupil {size.shape} does not fit {n} stamps (n,)")
    if n and bool((np.diff(t_ns) <= 0).any()):
        raise UsageError("stamps repeat or go back; choose rows first (stamps.order_of)")
    with np.errstate(invalid="ignore"):
        is_seen = np.isfinite(size) & (size > 0)
    step_ns, slowest = typical_step_ns(t_ns), params.min_edge_per_s / NS_PER_S
    smooth = _smoothed(size.astype(np.float64), is_seen, params.smoothing_ms, step_ns)
    # Rows that never came are a loss, too: a tracker may leave them out.
    edges = np.flatnonzero(np.diff(is_seen.astype(np.int8)))
    before = edges[is_seen[edges]]
    missing = np.flatnonzero(np.diff(t_ns) > 1.5 * step_ns)
    holes = missing[is_seen[missing] & is_seen[missing + 1]]
    blinks: list[tuple[int, int, float]] = []
    losses = 0
    for last in sorted({*before.tolist(), *holes.tolist()}):
        first = next((k for k in range(last + 1, n) if is_seen[k]), None)
        if first is None:
            continue
        loss_ms = (t_ns[first] - t_ns[last] - step_ns) / NS_PER_MS
        if loss_ms < params.min_loss_ms - step_ns / NS_PER_MS / 2:
            continue
        onset, offset = last, first
        limit_ns = round(params.max_edge_ms * NS_PER_MS)
        while (
            onset > 0
            and is_seen[onset - 1]
            and smooth[onset - 1] > smooth[onset] * (1 + slowest * (t_ns[onset] - t_ns[onset - 1]))
            and t_ns[last] - t_ns[onset - 1] <= limit_ns
        ):
            onset -= 1
        while (
            offset < n - 1
            and is_seen[offset + 1]
            and smooth[offset + 1]
            > smooth[offset] * (1 + slowest * (t_ns[offset + 1] - t_ns[offset]))
            and t_ns[offset + 1] - t_ns[first] <= limit_ns
        ):
            offset += 1
        if blinks and t_ns[onset] - t_ns[blinks[-1][1]] < params.join_ms * NS_PER_MS:
            begun, _, earlier_ms = blinks.pop()
            onset, loss_ms = begun, loss_ms + earlier_ms
        blinks.append((onset, offset, loss_ms))
    short = [blink for blink in blinks if blink[2] <= params.max_loss_ms]
    losses = len(blinks) - len(short)
    return PupilBlinks(
        t_ns[[b[0] for b in short]] if short else np.zeros(0, np.int64),
        t_ns[[b[1] for b in short]] if short else np.zeros(0, np.int64),
        np.array([b[2] for b in short], np.float64),
        losses,
    )


def _smoothed(
    size: Vector, is_seen: npt.NDArray[np.bool_], smoothing_ms: float, step_ns: int
) -> Vector:
    """Return the moving average over what is seen within the window; NaN where nothing is."""
    half = round(smoothing_ms * NS_PER_MS / step_ns / 2)
    sums = np.concatenate([[0.0], np.cumsum(np.where(is_seen, size, 0.0))])
    counts = np.concatenate([[0], np.cumsum(is_seen)])
    rows = np.arange(len(size))
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(size))
    with np.errstate(invalid="ignore", divide="ignore"):
        smooth: Vector = (sums[high] - sums[low]) / (counts[high] - counts[low])
    return np.where(is_seen, smooth, np.nan)
