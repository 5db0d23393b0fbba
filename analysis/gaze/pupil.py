"""Prepare pupil size for measures: blinks bridged, foreshortening undone, a baseline taken off.

What light does to the pupil is many times what attention or effort does (Mathôt 2018), and gaze
that moves over a scene changes the light that falls on the eye. Nothing here removes that: see
`LIGHT_IS_A_CONFOUND`, which every report of pupil size shows.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, angle_deg, unit

Mask = npt.NDArray[np.bool_]

LIGHT_IS_A_CONFOUND: Final = (
    "Light moves the pupil more than attention or effort do. Compare conditions only where what "
    "was looked at is equally bright, or show that brightness does not explain the difference."
)


@dataclass(frozen=True, slots=True)
class PupilParameters:
    """How pupil size is prepared; durations in ms.

    A loss, or size outside `min_mm` to `max_mm`, is a blink with `pad_ms` on either side, where
    the lid covers part of the pupil; so are rows that change faster than the median speed plus
    `speed_spreads` median deviations. Up to `max_bridge_ms` it is bridged by a straight line,
    longer it stays missing. `camera` is the direction in the head from which the pupil is seen.
    """

    min_mm: float = 1.5
    max_mm: float = 9.0
    pad_ms: float = 50.0
    speed_spreads: float = 16.0
    max_bridge_ms: float = 500.0
    camera: tuple[float, float, float] = (0.0, 0.0, -1.0)
    min_baseline_01: float = 0.5


PUPIL: Final = PupilParameters()
FORESHORTENING_WIDTH: Final = 1.121
"""An eye seen obliquely shows more of its pupil than a flat disc would, because the cornea bends
light: the visible share is cos(angle / 1.121) (Mathur, Gehrmann & Atchison 2013)."""
MAX_FORESHORTENING_DEG: Final = 60.0


def pupil_mm_of(gaze: Mapping[str, npt.NDArray[Any]]) -> Vector | None:
    """Return (n,) the mean of both pupils of a `gaze` stream where both are measured, else the one
    that is; None where the tracker measures none.
    """
    sizes = []
    for eye in ("left", "right"):
        if f"{eye}_pupil_mm" in gaze:
            size = gaze[f"{eye}_pupil_mm"].astype(np.float64)
            sizes.append(np.where(gaze[f"{eye}_valid"] & (size > 0), size, np.nan))
    if not sizes or not np.isfinite(sizes).any():
        return None
    return _mean_of_known(sizes)


def _mean_of_known(sizes: Sequence[Vector]) -> Vector:
    """Return the mean; where only one eye is known, its size moved by its usual difference."""
    if len(sizes) == 1:
        return sizes[0]
    left, right = sizes
    half = (right - left) / 2
    usual = float(np.nanmedian(half)) if np.isfinite(half).any() else 0.0
    both: Vector = (left + right) / 2
    both = np.where(np.isfinite(both), both, left + usual)
    return np.where(np.isfinite(both), both, right - usual)


@dataclass(frozen=True, slots=True)
class Pupil:
    """Prepared pupil size: `diameter_mm` (n,), NaN where unknown; `bridged` (n,) by a line.

    `measured_01` is the share of rows measured, `bridged_01` the share bridged; `blinks` counts
    the bridged stretches.
    """

    diameter_mm: Vector
    bridged: Mask
    measured_01: float
    bridged_01: float
    blinks: int


def foreshortening(
    gaze_in_head: npt.NDArray[np.floating], camera: tuple[float, float, float] = PUPIL.camera
) -> Vector:
    """Return (n,) seen width of the pupil for its true width, by the angle of gaze (n, 3).

    NaN where gaze is unknown or lies more than 60° from the camera.
    """
    angle = angle_deg(unit(gaze_in_head.astype(np.float64)), unit(np.array(camera)))
    seen_width: Vector = np.cos(np.radians(angle) / FORESHORTENING_WIDTH)
    return np.where(angle <= MAX_FORESHORTENING_DEG, seen_width, np.nan)


def prepared_pupil(
    t_ns: Times,
    diameter_mm: npt.NDArray[np.floating],
    gaze_in_head: npt.NDArray[np.floating] | None = None,
    params: PupilParameters = PUPIL,
) -> Pupil:
    """Bridge blinks in pupil size (n,) and, with gaze in the head (n, 3), undo foreshortening.

    A camera that sees a round pupil obliquely sees an ellipse; a tracker that gives the size of
    a circle of the same area shows it smaller by the root of the seen width. Stamps (n,) must
    increase. Raises UsageError for shapes that do not fit.
    """
    n = len(t_ns)
    if diameter_mm.shape != (n,) or (gaze_in_head is not None and gaze_in_head.shape != (n, 3)):
        raise UsageError(f"pupil {diameter_mm.shape} and gaze do not fit {n} stamps (n,), (n, 3)")
    if n and bool((np.diff(t_ns) <= 0).any()):
        raise UsageError("stamps repeat or go back; choose rows first (stamps.order_of)")
    size = diameter_mm.astype(np.float64)
    with np.errstate(invalid="ignore"):
        in_range = (size >= params.min_mm) & (size <= params.max_mm)
    measured_01 = float(in_range.mean()) if n else np.nan
    is_trusted = _without_blink_edges(t_ns, size, in_range, params)
    if gaze_in_head is not None:
        size = size / np.sqrt(foreshortening(gaze_in_head, params.camera))
        is_trusted = is_trusted & np.isfinite(size)
    is_bridged = _bridgeable(t_ns, is_trusted, params)
    if is_trusted.any():
        size = np.where(is_bridged, np.interp(t_ns, t_ns[is_trusted], size[is_trusted]), size)
    size = np.where(is_trusted | is_bridged, size, np.nan)
    starts = int(np.count_nonzero(np.diff(is_bridged.astype(np.int8), prepend=np.int8(0)) == 1))
    return Pupil(size, is_bridged, measured_01, float(is_bridged.mean()) if n else np.nan, starts)


def _without_blink_edges(
    t_ns: Times, size: Vector, in_range: Mask, params: PupilParameters
) -> Mask:
    """Return the rows seen, without those near a loss and those that change impossibly fast."""
    pair = in_range[1:] & in_range[:-1]
    speed = np.full(len(size), np.nan)
    speed[1:][pair] = np.abs(np.diff(size))[pair] / (np.diff(t_ns)[pair] / NS_PER_S)
    finite_speed = speed[np.isfinite(speed)]
    doubtful = ~in_range
    if finite_speed.size:
        middle = np.median(finite_speed)
        deviation = np.median(np.abs(finite_speed - middle))
        if deviation > 0:
            with np.errstate(invalid="ignore"):
                doubtful |= speed > middle + params.speed_spreads * deviation
    at = t_ns[doubtful]
    if not at.size:
        return in_range.copy()
    after = np.searchsorted(at, t_ns)
    nearest = np.minimum(
        np.abs(t_ns - at[np.clip(after - 1, 0, len(at) - 1)]),
        np.abs(t_ns - at[np.clip(after, 0, len(at) - 1)]),
    )
    is_trusted: Mask = nearest > round(params.pad_ms * NS_PER_MS)
    return is_trusted


def _bridgeable(t_ns: Times, is_trusted: Mask, params: PupilParameters) -> Mask:
    """Return rows not kept that lie between two kept rows near enough in time."""
    is_bridged = np.zeros(len(is_trusted), np.bool_)
    rows = np.flatnonzero(is_trusted)
    longest_ns = round(params.max_bridge_ms * NS_PER_MS) + typical_step_ns(t_ns)
    for first, last in itertools.pairwise(rows):
        if last > first + 1 and t_ns[last] - t_ns[first] <= longest_ns:
            is_bridged[first + 1 : last] = True
    return is_bridged


@dataclass(frozen=True, slots=True)
class PupilResponse:
    """Pupil size in a stretch of time against the stretch before it; NaN where data are too few.

    `baseline_mm` and `mean_mm` are medians and means of their stretches, `change_mm` mean less
    baseline (a difference: a ratio would grow where the baseline happens to be small),
    `peak_mm` the largest change; `bridged_01` and `known_01` shares of the stretch itself.
    """

    baseline_mm: float
    mean_mm: float
    change_mm: float
    peak_mm: float
    known_01: float
    bridged_01: float


def response(
    t_ns: Times,
    pupil: Pupil,
    start_ns: int,
    end_ns: int,
    *,
    baseline_ms: float = 200.0,
    params: PupilParameters = PUPIL,
) -> PupilResponse:
    """Measure pupil size from `start_ns` to `end_ns` against the `baseline_ms` before it.

    The baseline needs `min_baseline_01` of its rows known.
    """
    before = (t_ns >= start_ns - round(baseline_ms * NS_PER_MS)) & (t_ns < start_ns)
    inside = (t_ns >= start_ns) & (t_ns < end_ns)
    size = pupil.diameter_mm
    is_known = np.isfinite(size)
    baseline = np.nan
    if before.any() and is_known[before].mean() >= params.min_baseline_01:
        baseline = float(np.median(size[before & is_known]))
    rows = inside & is_known
    mean = float(size[rows].mean()) if rows.any() else np.nan
    return PupilResponse(
        baseline_mm=baseline,
        mean_mm=mean,
        change_mm=mean - baseline,
        peak_mm=float(size[rows].max()) - baseline if rows.any() else np.nan,
        known_01=float(is_known[inside].mean()) if inside.any() else np.nan,
        bridged_01=float(pupil.bridged[inside].mean()) if inside.any() else np.nan,
    )
