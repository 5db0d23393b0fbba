"""Measure gaze accuracy and precision on the sphere, at one target and over a validation.

Definitions follow Holmqvist, Nyström & Mulvey (2012) and Adhanom et al. (2020), on great-circle
angles, so nothing jumps at ±180° of azimuth or stretches at high elevation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector, angle_deg, unit


def _tangent_deg(direction: Vector, centre: Vector) -> Vector:
    """Return (n, 2) angular offsets right and up from a centre, in degrees.

    Azimuthal equidistant about the centre: length is the great-circle angle, so no direction
    and no elevation is stretched.
    """
    up = np.array([0.0, 1.0, 0.0]) if abs(centre[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    right = unit(np.cross(centre, up))
    above = np.cross(right, centre)
    plane = np.stack([direction @ right, direction @ above], axis=-1)
    offset: Vector = np.nan_to_num(unit(plane)) * angle_deg(direction, centre)[:, None]
    return offset


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Gaze error at one target, in degrees; NaN when nothing is usable.

    `of_mean_deg` is the angle between the target and the mean direction (the systematic error);
    `mean_of_samples_deg` the mean of every sample's angle (also contains the noise). `right_deg`
    and `up_deg` say where the mean direction lies, seen from the target.
    """

    of_mean_deg: float
    mean_of_samples_deg: float
    median_of_samples_deg: float
    right_deg: float
    up_deg: float


@dataclass(frozen=True, slots=True)
class Precision:
    """Spread of gaze around its own mean, in degrees (BCEA: square degrees); NaN if unknown.

    `rms_s2s_deg` over pairs of neighbouring samples, without pairs across loss or holes and
    without exact repeats; `std_deg` = √(var right + var up), divided by n; `bcea_deg2` the
    ellipse that holds `bcea_01` of the samples.
    """

    rms_s2s_deg: float
    std_deg: float
    bcea_deg2: float
    bcea_01: float = 0.68


def accuracy(direction: npt.NDArray[np.floating], target: Vector) -> Accuracy:
    """Measure directions (n, 3) against one unit target (3,) in the same frame; NaN = lost."""
    v = unit(direction.astype(np.float64))
    v = v[np.isfinite(v[:, 0])]
    if not len(v):
        return Accuracy(np.nan, np.nan, np.nan, np.nan, np.nan)
    aim = unit(np.asarray(target, np.float64))
    mean = unit(v.sum(axis=0))
    errors = angle_deg(v, aim)
    offset = _tangent_deg(mean[None], aim)[0]
    return Accuracy(
        float(angle_deg(mean, aim)),
        float(errors.mean()),
        float(np.median(errors)),
        float(offset[0]),
        float(offset[1]),
    )


def _rms_s2s_deg(t_ns: Times, v: Vector) -> float:
    if len(v) < 2:
        return np.nan
    distinct = np.concatenate([t_ns[:1], t_ns[1:][np.diff(t_ns) > 0]])
    near = (2 * np.diff(t_ns) <= 3 * typical_step_ns(distinct)) & (np.diff(t_ns) > 0)
    with np.errstate(invalid="ignore"):
        pairs = near & np.isfinite(v[1:, 0]) & np.isfinite(v[:-1, 0])
        pairs &= (v[1:] != v[:-1]).any(axis=1)
    if not pairs.any():
        return np.nan
    steps = angle_deg(v[1:][pairs], v[:-1][pairs])
    return float(np.sqrt(np.mean(steps**2)))


def precision(
    t_ns: Times, direction: npt.NDArray[np.floating], *, bcea_01: float = 0.68
) -> Precision:
    """Measure the spread of directions (n, 3) during one steady look; NaN = lost."""
    v = unit(direction.astype(np.float64))
    usable = v[np.isfinite(v[:, 0])]
    if not len(usable):
        return Precision(np.nan, np.nan, np.nan, bcea_01)
    plane = _tangent_deg(usable, unit(usable.sum(axis=0)))
    cov = np.cov(plane.T, ddof=0)
    k = -np.log(1.0 - bcea_01)
    area = 2 * k * np.pi * np.sqrt(max(0.0, float(np.linalg.det(cov))))
    return Precision(
        _rms_s2s_deg(t_ns, v),
        float(np.sqrt(np.trace(cov))),
        area if len(usable) > 1 else np.nan,
        bcea_01,
    )


def moving_precision_deg(
    t_ns: Times, direction: npt.NDArray[np.floating], *, window_ms: float = 200.0
) -> tuple[float, float]:
    """Return median and least RMS-S2S over consecutive windows, for free viewing.

    Windows with fewer than half their samples usable are left out; NaN when none is left.
    """
    if len(t_ns) < 3:
        return np.nan, np.nan
    v = unit(direction.astype(np.float64))
    width_ns = round(window_ms * NS_PER_MS)
    place = (t_ns - t_ns[0]) // width_ns
    bounds = np.flatnonzero(np.diff(place)) + 1
    min_samples = width_ns / typical_step_ns(np.unique(t_ns)) / 2
    rms_of_windows = [
        _rms_s2s_deg(t, w)
        for t, w in zip(np.split(t_ns, bounds), np.split(v, bounds), strict=True)
        if np.isfinite(w[:, 0]).sum() >= max(min_samples, 3)
    ]
    finite_rms = [f for f in rms_of_windows if np.isfinite(f)]
    return (
        (float(np.median(finite_rms)), float(min(finite_rms))) if finite_rms else (np.nan, np.nan)
    )


# ---- validation ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ValidationPoint:
    """Quality at one validation target; `usable_ms` is usable samples × nominal step."""

    target: Vector
    accuracy: Accuracy
    precision: Precision
    usable_ms: float
    lost_01: float


@dataclass(frozen=True, slots=True)
class ValidationSummary:
    """Quality over all targets of one validation.

    Means are over targets with at least `minimum_usable_ms`; NaN when there is none. It passes
    when every target has enough samples, the mean error is at most `limit_mean_deg` and no
    target's exceeds `limit_worst_deg`.
    """

    points: tuple[ValidationPoint, ...]
    accuracy_deg: float
    worst_deg: float
    rms_s2s_deg: float
    std_deg: float
    lost_01: float
    passed: bool


def validate(
    points: Sequence[tuple[Vector, Times, npt.NDArray[np.floating]]],
    *,
    nominal_rate_hz: float,
    minimum_usable_ms: float = 500.0,
    limit_mean_deg: float = 1.5,
    limit_worst_deg: float = 3.0,
) -> ValidationSummary:
    """Summarise a validation: per target its direction (3,), stamps (n,), gaze (n, 3).

    Target and gaze share a frame (head for head-fixed targets); NaN gaze is lost. The error is
    the angle of the mean direction.
    """
    step_ms = 1000.0 / nominal_rate_hz
    results = []
    for target, t_ns, direction in points:
        n_usable = int(np.isfinite(direction).all(axis=1).sum())
        span_ms = (float(t_ns[-1] - t_ns[0]) / NS_PER_MS + step_ms) if len(t_ns) else 0.0
        results.append(
            ValidationPoint(
                target,
                accuracy(direction, target),
                precision(t_ns, direction),
                n_usable * step_ms,
                max(0.0, 1 - n_usable * step_ms / span_ms) if span_ms else 1.0,
            )
        )
    enough = [p for p in results if p.usable_ms >= minimum_usable_ms]
    errors = np.array([p.accuracy.of_mean_deg for p in enough])
    mean = float(errors.mean()) if len(enough) else np.nan
    worst = float(errors.max()) if len(enough) else np.nan
    return ValidationSummary(
        points=tuple(results),
        accuracy_deg=mean,
        worst_deg=worst,
        rms_s2s_deg=_mean([p.precision.rms_s2s_deg for p in enough]),
        std_deg=_mean([p.precision.std_deg for p in enough]),
        lost_01=_mean([p.lost_01 for p in results]),
        passed=bool(
            results
            and len(enough) == len(results)
            and mean <= limit_mean_deg
            and worst <= limit_worst_deg
        ),
    )


def _mean(values: Sequence[float]) -> float:
    finite = [v for v in values if np.isfinite(v)]
    return float(np.mean(finite)) if finite else np.nan
