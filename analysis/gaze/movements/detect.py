"""Find fixations, saccades, oscillations after them, pursuit and blinks in gaze.

Three published detectors find the saccades, or the fixations, with thresholds that follow the
recording's own noise; what follows (blinks, oscillations, joining, pursuit, least durations) is
the same for all. With a moving head give the eye in the head, too: an eye that turns against the
head keeps gaze in world at rest (the vestibulo-ocular reflex), a head that follows a target
carries a resting eye, and only in a saccade are both fast.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.event_kernels import fill_gaps, merge_runs, runs_where, speeds_deg_s
from visavis.analysis.gaze.events import checked_samples, half_window, limit_ns
from visavis.analysis.gaze.movements.engbert_kliegl import noise_deg_s, outside_ellipse
from visavis.analysis.gaze.movements.finish_kernels import (
    describe_events,
    drop_short,
    mark_between,
    mark_blinks,
    mark_fast_runs,
)
from visavis.analysis.gaze.movements.i2mc import clustering_weights, trim_borders
from visavis.analysis.gaze.movements.kinds import Detector, Kinds, Movement, Movements
from visavis.analysis.gaze.movements.nystrom_holmqvist import (
    FIRST_PEAK_DEG_S,
    adapted_thresholds,
    mark_saccades,
)
from visavis.analysis.gaze.movements.pursuit import is_pursuit
from visavis.analysis.gaze.movements.velocity import Rows, velocities_deg_s
from visavis.analysis.gaze.stamps import Times
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, angle_deg

DETECTOR_NAMES: Final[dict[Detector, str]] = {
    "engbert_kliegl": "Engbert–Kliegl",
    "nystrom_holmqvist": "Nyström–Holmqvist",
    "i2mc": "I2MC",
}


@dataclass(frozen=True, slots=True)
class MovementParameters:
    """Thresholds of the adaptive detectors; durations in ms, angles in degrees.

    `detector` is one of them or "auto". Velocity is taken over `windows_ms`, the next wider one
    while the noise would lift the threshold above `max_threshold_deg_s`. `noise_multiple` (λ),
    `saccade_samples`: Engbert & Kliegl (2003); a saccade lasts that many samples, kept between
    `min_saccade_ms` and `max_min_saccade_ms`, so that rates of 60 to 1000 Hz mean the same.
    `minimum_deg_s` is the least speed of a saccade, whatever the noise. Two fixations become one
    when at most `merge_ms` and at most `merge_spreads` times what noise displaces gaze within a
    window (but `min_merge_deg` to `max_merge_deg`) lie between them. Losses up to `fill_ms` are
    interpolated, longer ones up to `max_blink_ms` are blinks, with the fast rows that touch them.
    `pursuit=False` calls slow drift fixation, as published.
    """

    detector: Detector | Literal["auto"] = "auto"
    windows_ms: tuple[float, ...] = (20.0, 40.0, 60.0)
    max_threshold_deg_s: float = 100.0
    noise_multiple: float = 6.0
    minimum_deg_s: float = 30.0
    saccade_samples: int = 3
    min_saccade_ms: float = 8.0
    max_min_saccade_ms: float = 12.0
    oscillation_ms: float = 40.0
    fill_ms: float = 75.0
    max_blink_ms: float = 500.0
    merge_ms: float = 75.0
    merge_spreads: float = 3.0
    min_merge_deg: float = 0.1
    max_merge_deg: float = 1.0
    border_ms: float = 100.0
    min_fixation_ms: float = 60.0
    pursuit: bool = True
    pursuit_change_cost: float = 3.0
    min_pursuit_ms: float = 100.0
    cluster_window_ms: float = 200.0
    cluster_advance_ms: float = 20.0
    cluster_max_changes: int = 10
    cluster_spreads: float = 2.0
    cluster_merge_deg: float = 0.7
    cluster_merge_ms: float = 40.0
    cluster_border_spreads: float = 3.0
    max_saccade_ms: float = 150.0
    nominal_rate_hz: float | None = None


AUTO: Final = MovementParameters()


@dataclass(frozen=True, slots=True)
class _Signal:
    """A recording prepared for detection: losses filled, velocity and its noise measured."""

    t_ns: Times
    v: Vector
    stretch: Rows
    step_ns: int
    half: int
    window_ms: float
    velocity: Vector
    noise: tuple[float, float]
    first_noise: tuple[float, float]
    head_free: npt.NDArray[np.bool_] | None

    @property
    def noise_deg_s(self) -> float:
        """Return the spread of velocity over the first window, right and up together."""
        return float(np.hypot(*self.first_noise))

    @property
    def noise_deg(self) -> float:
        """Return how far noise displaces gaze within the window in use."""
        return float(np.nan_to_num(np.hypot(*self.noise))) * self.window_ms / 1000.0

    @property
    def rate_hz(self) -> float:
        return NS_PER_S / self.step_ns


def _signal(
    t_ns: Times,
    in_world: npt.NDArray[np.floating],
    in_head: npt.NDArray[np.floating] | None,
    params: MovementParameters,
) -> _Signal:
    t, v, step_ns = checked_samples(t_ns, in_world, params.nominal_rate_hz)
    stretch = fill_gaps(t, v, limit_ns(params.fill_ms), step_ns)
    half, window_ms = 1, params.windows_ms[0]
    velocity = np.full((len(t), 2), np.nan)
    noise = first_noise = (np.nan, np.nan)
    for window_ms in params.windows_ms:
        half = half_window(window_ms, step_ns)
        velocity = velocities_deg_s(t, v, stretch, half)
        noise = noise_deg_s(velocity)
        first_noise = noise if window_ms == params.windows_ms[0] else first_noise
        if not params.noise_multiple * max(noise) > params.max_threshold_deg_s:
            break
    eye_moves = None
    if in_head is not None:
        eye_speed = np.linalg.norm(_velocity_of(t, in_head, half, step_ns, params), axis=1)
        with np.errstate(invalid="ignore"):
            eye_moves = ~(eye_speed < params.minimum_deg_s)
    return _Signal(t, v, stretch, step_ns, half, window_ms, velocity, noise, first_noise, eye_moves)


def _velocity_of(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    half: int,
    step_ns: int,
    params: MovementParameters,
) -> Vector:
    _, v, _ = checked_samples(t_ns, direction, params.nominal_rate_hz)
    stretch = fill_gaps(t_ns, v, limit_ns(params.fill_ms), step_ns)
    return velocities_deg_s(t_ns, v, stretch, half)


I2MC_BELOW_HZ: Final = 50.0
I2MC_ABOVE_DEG_S: Final = 15.0
"""Where I2MC finds fixations better than Engbert–Kliegl: on the tuned half of GazeCom, thinned
and with noise added (`python -m benchmarks.gaze_detectors.choice`)."""


def chosen_detector(rate_hz: float, noise_deg_s: float) -> tuple[Detector, str]:
    """Return which detector suits a rate and a spread of velocity, and a sentence why."""
    signal = f"{rate_hz:.0f} Hz, velocity noise {noise_deg_s:.1f}°/s"
    if rate_hz < I2MC_BELOW_HZ:
        return "i2mc", f"{signal}: below {I2MC_BELOW_HZ:.0f} Hz a saccade is too few samples"
    if noise_deg_s > I2MC_ABOVE_DEG_S:
        return "i2mc", f"{signal}: above {I2MC_ABOVE_DEG_S:.0f}°/s noise hides saccades"
    return "engbert_kliegl", f"{signal}: saccades stand out of the noise"


def detect_movements(
    t_ns: Times,
    in_world: npt.NDArray[np.floating],
    params: MovementParameters = AUTO,
    *,
    in_head: npt.NDArray[np.floating] | None = None,
    head_deg_s: npt.NDArray[np.floating] | None = None,
) -> Movements:
    """Find eye movements in gaze (n, 3) with stamps (n,) strictly increasing.

    `in_world` for a free head, any frame for a still one; NaN or zero rows are lost. `in_head`
    (n, 3) is the eye in the head at the same rows, `head_deg_s` (n,) the head's speed; give both
    when the head moves. Raises DataError for stamps that go back, UsageError for repeated ones,
    shapes that do not fit, or an unknown detector.
    """
    signal = _signal(t_ns, in_world, in_head, params)
    n = len(signal.t_ns)
    if head_deg_s is not None and head_deg_s.shape != (n,):
        raise UsageError(f"head speeds {head_deg_s.shape} do not fit {n} stamps (n,)")
    if params.detector == "auto":
        name, why = chosen_detector(signal.rate_hz, signal.noise_deg_s)
    elif params.detector in DETECTOR_NAMES:
        name, why = params.detector, "asked for"
    else:
        raise UsageError(
            f"no detector {params.detector!r}; there are auto, " + ", ".join(DETECTOR_NAMES)
        )
    movement, runs = _rough(signal, name, params)
    _finish(signal, movement, runs, params)
    return _movements_of(signal, movement, in_head, head_deg_s, name, why, params)


def runs_between_saccades(
    t_ns: Times, in_world: npt.NDArray[np.floating], params: MovementParameters
) -> tuple[Times, Vector, Rows, int]:
    """Return stamps, filled directions, first and last rows (k, 2) between saccades, the step."""
    signal = _signal(t_ns, in_world, None, params)
    name, _ = chosen_detector(signal.rate_hz, signal.noise_deg_s)
    _, runs = _rough(signal, name, params)
    return signal.t_ns, signal.v, runs, signal.step_ns


def _rough(s: _Signal, name: Detector, params: MovementParameters) -> tuple[Kinds, Rows]:
    """Return saccades, oscillations and blinks marked (n,), and the rest as joined runs (k, 2)."""
    movement = np.zeros(len(s.t_ns), np.int8)
    minimum_ms = min(
        params.max_min_saccade_ms,
        max(params.min_saccade_ms, params.saccade_samples * s.step_ns / NS_PER_MS),
    )
    minimum_ns = min(limit_ns(minimum_ms, -1), s.step_ns * params.saccade_samples)
    merge_deg = float(
        np.clip(params.merge_spreads * s.noise_deg, params.min_merge_deg, params.max_merge_deg)
    )
    merge_ms = params.merge_ms
    oscillation_ns = round(params.oscillation_ms * NS_PER_MS)
    fast = outside_ellipse(s.velocity, params.noise_multiple, params.minimum_deg_s)
    if s.head_free is not None:
        fast &= s.head_free
    if name == "nystrom_holmqvist":
        speed = np.empty(len(s.t_ns))
        speeds_deg_s(s.t_ns, s.v, s.stretch, s.half, speed)
        if s.head_free is not None:
            speed[~s.head_free] = 0.0
        peak, onset = adapted_thresholds(speed, FIRST_PEAK_DEG_S)
        mark_saccades(
            s.t_ns,
            speed,
            s.stretch,
            max(peak, params.minimum_deg_s),
            onset,
            oscillation_ns,
            minimum_ns,
            oscillation_ns,
            s.step_ns,
            movement,
        )
    elif name == "i2mc":
        rest = ~_clustered_jumps(s, params) & (s.stretch >= 0)
        merge_deg, merge_ms = max(merge_deg, params.cluster_merge_deg), params.cluster_merge_ms
        runs = _merged_runs(s, rest, merge_ms, merge_deg, params)
        runs = runs[: trim_borders(s.v, runs, params.cluster_border_spreads)]
        duration_ns = s.t_ns[runs[:, 1]] - s.t_ns[runs[:, 0]] + s.step_ns
        runs = np.ascontiguousarray(runs[duration_ns >= limit_ns(params.min_fixation_ms, -1)])
        mark_between(s.t_ns, s.stretch, runs, limit_ns(params.max_saccade_ms), s.step_ns, movement)
        mark_blinks(s.t_ns, s.stretch, movement, limit_ns(params.max_blink_ms), s.step_ns)
        return movement, runs
    else:
        mark_fast_runs(
            s.t_ns, s.velocity, s.stretch, fast, minimum_ns, oscillation_ns, s.step_ns, movement
        )
    mark_blinks(s.t_ns, s.stretch, movement, limit_ns(params.max_blink_ms), s.step_ns)
    rest = (movement == Movement.UNKNOWN) & (s.stretch >= 0)
    return movement, _merged_runs(s, rest, merge_ms, merge_deg, params)


def _clustered_jumps(s: _Signal, params: MovementParameters) -> npt.NDArray[np.bool_]:
    """Return (n,) where I2MC's weight is above its mean by `cluster_spreads`: gaze moves there."""
    weights = clustering_weights(
        s.t_ns,
        s.v,
        s.stretch,
        round(params.cluster_window_ms * NS_PER_MS),
        round(params.cluster_advance_ms * NS_PER_MS),
        np.array([1, 2, 5, 10], np.int64),
        params.cluster_max_changes,
    )
    finite_weights = weights[np.isfinite(weights)]
    if not finite_weights.size:
        return np.zeros(len(weights), np.bool_)
    with np.errstate(invalid="ignore"):
        jumps: npt.NDArray[np.bool_] = (
            weights > finite_weights.mean() + params.cluster_spreads * finite_weights.std()
        )
    return jumps


def _merged_runs(
    s: _Signal,
    rest: npt.NDArray[np.bool_],
    merge_ms: float,
    merge_deg: float,
    params: MovementParameters,
) -> Rows:
    runs = np.empty((len(s.t_ns), 2), np.int64)
    count = runs_where(rest, s.stretch, runs)
    count = merge_runs(
        s.t_ns,
        s.v,
        runs,
        count,
        limit_ns(merge_ms),
        np.radians(merge_deg),
        round(params.border_ms * NS_PER_MS),
        s.step_ns,
    )
    return np.ascontiguousarray(runs[:count])


def _finish(s: _Signal, movement: Kinds, runs: Rows, params: MovementParameters) -> None:
    """Write fixations and pursuit into `movement`, and clear what is too short."""
    pursues = np.zeros(len(movement), np.bool_)
    if params.pursuit:
        pursues = is_pursuit(s.t_ns, s.v, runs, s.step_ns, change_cost=params.pursuit_change_cost)
    drop_short(
        s.t_ns,
        runs,
        pursues,
        limit_ns(params.min_fixation_ms, -1),
        limit_ns(params.min_pursuit_ms, -1),
        s.step_ns,
        movement,
    )


def _movements_of(
    s: _Signal,
    movement: Kinds,
    in_head: npt.NDArray[np.floating] | None,
    head_deg_s: npt.NDArray[np.floating] | None,
    name: Detector,
    why: str,
    params: MovementParameters,
) -> Movements:
    edges = np.flatnonzero(np.diff(movement, prepend=np.int8(-1), append=np.int8(-1)))
    first, last = edges[:-1], edges[1:] - 1
    is_named = movement[first] != Movement.UNKNOWN if len(first) else np.zeros(0, np.bool_)
    first, last = first[is_named], last[is_named]
    speed = np.linalg.norm(s.velocity, axis=1)
    direction, peak = describe_events(s.v, speed, first, last)
    duration = np.minimum(
        s.t_ns[last] - s.t_ns[first] + s.step_ns,
        np.append(s.t_ns[1:], np.iinfo(np.int64).max)[last] - s.t_ns[first],
    )
    all_missing = np.full(len(first), np.nan)
    eye = all_missing
    if in_head is not None:
        of_eye = np.linalg.norm(_velocity_of(s.t_ns, in_head, s.half, s.step_ns, params), axis=1)
        eye = _means(of_eye, first, last)
    return Movements(
        movement=movement,
        kind=movement[first],
        first_row=first,
        last_row=last,
        onset_ns=s.t_ns[first],
        duration_ns=duration,
        direction=direction,
        amplitude_deg=np.asarray(angle_deg(s.v[first], s.v[last])) if len(first) else all_missing,
        peak_deg_s=peak,
        head_deg_s=all_missing if head_deg_s is None else _means(head_deg_s, first, last),
        eye_deg_s=eye,
        detector=name,
        why=why,
        noise_deg_s=s.noise_deg_s,
        window_ms=s.window_ms,
    )


def _means(values: npt.NDArray[np.floating], first: Rows, last: Rows) -> Vector:
    """Return the mean of the known values of every event; NaN where none is."""
    is_known = np.isfinite(values)
    sums = np.concatenate([[0.0], np.cumsum(np.where(is_known, values, 0.0))])
    counts = np.concatenate([[0], np.cumsum(is_known)])
    many = counts[last + 1] - counts[first]
    with np.errstate(invalid="ignore", divide="ignore"):
        means: Vector = np.where(many > 0, (sums[last + 1] - sums[first]) / many, np.nan)
    return means
