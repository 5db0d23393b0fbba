"""Detect fixations by velocity (I-VT) or by dispersion (I-DT) on the sphere.

Neither can tell smooth pursuit from fixation: a slow enough movement is a fixation to both.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.event_kernels import (
    compact_runs,
    fill_gaps,
    merge_runs,
    runs_where,
    speeds_deg_s,
    sums_of_runs,
    unit_rows,
)
from visavis.analysis.gaze.stamps import Times, order_of, typical_step_ns
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, unit

SLACK_NS = 20_000
"""Added where a duration meets a threshold, for clock drift and rounded stamps."""


@dataclass(frozen=True, slots=True)
class IvtParameters:
    """Velocity thresholds; the default follows Olsen (2012) for a screen or a still head.

    Speed is the least-squares slope of the direction over a window. `windows_ms` are tried in
    turn: the next, wider one is taken while the median speed exceeds `noise_share` of the
    threshold, so a noisy tracker is smoothed and a good one is not.
    Runs are joined when the time between them and the angle across it (mean directions of
    `border_ms` on either side) are both within limits; the minimum duration is a separate test.
    """

    threshold_deg_s: float = 30.0
    windows_ms: tuple[float, ...] = (20.0, 40.0, 60.0)
    noise_share: float = 2 / 3
    fill_ms: float = 75.0
    merge_ms: float = 75.0
    merge_deg: float = 0.5
    border_ms: float = 100.0
    minimum_ms: float = 60.0
    nominal_rate_hz: float | None = None


IVT_SCREEN = IvtParameters()
IVT_HEADSET = IvtParameters(minimum_ms=100.0, merge_ms=100.0, merge_deg=3.0)
"""The defaults of the Tobii XR fixation filter, on gaze in world."""
IVT_MOVING_HEAD = replace(IVT_SCREEN, threshold_deg_s=100.0)
"""Tolerates head movement and slow targets; reported speeds decide the share of fixations."""


@dataclass(frozen=True, slots=True)
class IdtParameters:
    """Dispersion thresholds; dispersion is the largest angle between any two samples."""

    dispersion_deg: float = 1.0
    minimum_ms: float = 100.0
    bridge_ms: float = 75.0
    nominal_rate_hz: float | None = None


IDT_SCREEN = IdtParameters()
IDT_HEADSET = IdtParameters(minimum_ms=250.0)
"""Best of Llanes-Jurado et al. (2020) in a headset: 1.0°, 250 ms."""


@dataclass(frozen=True, slots=True)
class Fixations:
    """Detected fixations, in order; k fixations in n samples.

    `onset_ns`, `duration_ns` (k,), the last sample held one step; `first_row`, `last_row` (k,)
    index the samples given; `direction` (k, 3) the mean unit vector of valid samples;
    `in_fixation` (n,) per sample; `window_ms` the velocity window used (None for I-DT).
    """

    onset_ns: Times
    duration_ns: Times
    first_row: npt.NDArray[np.int64]
    last_row: npt.NDArray[np.int64]
    direction: Vector
    in_fixation: npt.NDArray[np.bool_]
    window_ms: float | None

    def __len__(self) -> int:
        return int(self.onset_ns.shape[0])


def checked_samples(
    t_ns: Times, direction: npt.NDArray[np.floating], rate_hz: float | None
) -> tuple[Times, Vector, int]:
    """Return stamps, unit directions (n, 3) and the step in ns; refuse what cannot be used."""
    if direction.shape != (t_ns.shape[0], 3):
        raise UsageError(f"directions {direction.shape} do not fit {t_ns.shape[0]} stamps (n, 3)")
    order = order_of(t_ns, direction)
    if order.rows is not None:
        raise UsageError(
            "stamps repeat; drop repeated rows first "
            "(visavis.analysis.gaze.stamps.order_of says which)"
        )
    v = np.empty(direction.shape)
    unit_rows(np.ascontiguousarray(direction, np.float64), v)
    step_ns = typical_step_ns(t_ns) if rate_hz is None else round(NS_PER_S / rate_hz)
    return np.ascontiguousarray(t_ns, np.int64), v, step_ns


def limit_ns(limit_ms: float, side: Literal[-1, 1] = 1) -> int:
    """Return a limit in ns with the slack added (an upper limit) or taken off (a lower one)."""
    return round(limit_ms * NS_PER_MS) + side * SLACK_NS


def half_window(window_ms: float, step_ns: int) -> int:
    """Return the steps on either side whose span is nearest to the window, the shorter of two."""
    whole, rest = divmod(round(window_ms * NS_PER_MS / 2), step_ns)
    return max(1, whole + (2 * (rest - SLACK_NS) > step_ns))


def _fixations_of_runs(
    t_ns: Times,
    v: Vector,
    runs: npt.NDArray[np.int64],
    minimum_ns: int,
    step_ns: int,
    window_ms: float | None,
) -> Fixations:
    first, last = runs[:, 0], runs[:, 1]
    duration = t_ns[last] - t_ns[first] + step_ns
    has_next = last + 1 < t_ns.shape[0]
    following = t_ns[last + has_next]
    duration = np.where(has_next, np.minimum(duration, following - t_ns[first]), duration)
    keep = duration >= minimum_ns
    first, last, duration = first[keep], last[keep], duration[keep]
    sums, in_fixation = np.empty((len(first), 3)), np.empty(t_ns.shape[0], np.bool_)
    sums_of_runs(v, first, last, sums, in_fixation)
    return Fixations(
        onset_ns=t_ns[first],
        duration_ns=duration,
        first_row=first,
        last_row=last,
        direction=unit(sums),
        in_fixation=in_fixation,
        window_ms=window_ms,
    )


def detect_ivt(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    params: IvtParameters = IVT_SCREEN,
) -> Fixations:
    """Find fixations as runs of slow gaze.

    `t_ns` (n,) strictly increasing, `direction` (n, 3) in world (in head the counter-rotation of
    the eyes is movement); NaN or zero rows are lost. Losses up to `fill_ms` are interpolated.
    Raises DataError for backward stamps, UsageError for repeated ones.
    """
    t, v, step_ns = checked_samples(t_ns, direction, params.nominal_rate_hz)
    gaze_without_fill = v.copy()
    stretch = fill_gaps(t, v, limit_ns(params.fill_ms), step_ns)
    speed = np.empty(t.shape[0])
    window_ms = params.windows_ms[0]
    for window_ms in params.windows_ms:
        half = half_window(window_ms, step_ns)
        speeds_deg_s(t, v, stretch, half, speed)
        finite_speed = speed[np.isfinite(speed)]
        if (
            not finite_speed.size
            or np.median(finite_speed) <= params.noise_share * params.threshold_deg_s
        ):
            break
    runs = np.empty((t.shape[0], 2), np.int64)
    count = runs_where(speed <= params.threshold_deg_s, stretch, runs)
    count = merge_runs(
        t,
        v,
        runs,
        count,
        limit_ns(params.merge_ms),
        np.radians(params.merge_deg),
        round(params.border_ms * NS_PER_MS),
        step_ns,
    )
    minimum_ns = limit_ns(params.minimum_ms, -1)
    return _fixations_of_runs(t, gaze_without_fill, runs[:count], minimum_ns, step_ns, window_ms)


def detect_idt(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    params: IdtParameters = IDT_SCREEN,
) -> Fixations:
    """Find fixations as runs of samples that all lie close together (Salvucci & Goldberg 2000).

    Arguments and errors as for `detect_ivt`.
    """
    t, v, step_ns = checked_samples(t_ns, direction, params.nominal_rate_hz)
    runs = np.empty((t.shape[0], 2), np.int64)
    minimum_ns = limit_ns(params.minimum_ms, -1)
    count = compact_runs(
        t,
        v,
        np.radians(params.dispersion_deg),
        minimum_ns,
        limit_ns(params.bridge_ms),
        step_ns,
        runs,
    )
    return _fixations_of_runs(t, v, runs[:count], minimum_ns, step_ns, None)
