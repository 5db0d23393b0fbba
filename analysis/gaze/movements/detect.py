"""Find fixations, saccades, oscillations after them, pursuit and blinks in gaze.

Three published detectors find the saccades, or the fixations, with thresholds that follow the
recording's own noise; what follows (blinks, oscillations, joining, pursuit, least durations) is
the same for all. With a moving head give the eye in the head, too: what the head alone puts into
gaze in world is measured and taken out first (`head_motion`). An eye that turns against the head
keeps gaze in world at rest (the vestibulo-ocular reflex), a head that follows a target carries a
resting eye, and only in a saccade are both fast.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.event_kernels import fill_gaps, merge_runs, runs_where, speeds_deg_s
from visavis.analysis.gaze.events import checked_samples, half_window, limit_ns
from visavis.analysis.gaze.movements.engbert_kliegl import (
    noise_deg_s,
    outside_ellipse,
    slow_spread_deg_s,
)
from visavis.analysis.gaze.movements.finish_kernels import (
    describe_events,
    drop_short,
    mark_between,
    mark_blinks,
    mark_fast_runs,
    sharpen_saccades,
)
from visavis.analysis.gaze.movements.head_motion import STILL, HeadMotion, without_head
from visavis.analysis.gaze.movements.i2mc import clustering_weights, trim_borders
from visavis.analysis.gaze.movements.kinds import Detector, Kinds, Movement, Movements
from visavis.analysis.gaze.movements.nystrom_holmqvist import (
    FIRST_PEAK_DEG_S,
    adapted_thresholds,
    mark_saccades,
)
from visavis.analysis.gaze.movements.parameters import AUTO, I2mcRule, MovementParameters
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
class _Signal:
    """A recording prepared for detection: losses filled, velocity and its noise measured."""

    t_ns: Times
    v: Vector
    gaze: Vector
    """As `v`, with what the head puts in: as it was given."""
    stretch: Rows
    step_ns: int
    half: int
    window_ms: float
    velocity: Vector
    noise: tuple[float, float]
    first_noise: tuple[float, float]
    head_free: npt.NDArray[np.bool_] | None
    head: HeadMotion
    noise_multiple: float
    least_deg_s: float
    """The least speed of a saccade here."""

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
    t, gaze, step_ns = checked_samples(t_ns, in_world, params.nominal_rate_hz)
    v, head = gaze, STILL
    if in_head is not None:
        v, head = without_head(t, gaze, checked_samples(t, in_head, params.nominal_rate_hz)[1])
    stretch = fill_gaps(t, v, limit_ns(params.losses.fill_ms), step_ns)
    half, window_ms = 1, params.velocity.windows_ms[0]
    velocity = np.full((len(t), 2), np.nan)
    noise = first_noise = (np.nan, np.nan)
    rule = params.velocity
    multiple, most_deg_s = rule.noise_multiple, rule.max_threshold_deg_s
    for window_ms in rule.windows_ms:
        half = half_window(window_ms, step_ns)
        velocity = velocities_deg_s(t, v, stretch, half)
        noise = noise_deg_s(velocity)
        is_wide = window_ms > rule.windows_ms[0]
        first_noise = first_noise if is_wide else noise
        if is_wide:
            multiple = rule.wide_noise_multiple
        if is_wide or half < rule.firm_rows:
            most_deg_s = rule.wide_max_threshold_deg_s
        if not multiple * max(noise) > most_deg_s:
            break
    least_deg_s = float(
        np.clip(
            np.nan_to_num(multiple * slow_spread_deg_s(velocity)),
            rule.minimum_deg_s,
            max(rule.minimum_deg_s, rule.max_minimum_deg_s),
        )
    )
    eye_moves = None
    if in_head is not None:
        eye_speed = np.linalg.norm(_velocity_of(t, in_head, half, step_ns, params), axis=1)
        with np.errstate(invalid="ignore"):
            eye_moves = ~(eye_speed < least_deg_s)
    if head == STILL:
        gaze = v
    else:
        fill_gaps(t, gaze, limit_ns(params.losses.fill_ms), step_ns)
    return _Signal(
        t,
        v,
        gaze,
        stretch,
        step_ns,
        half,
        window_ms,
        velocity,
        noise,
        first_noise,
        eye_moves,
        head,
        multiple,
        least_deg_s,
    )


def _velocity_of(
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    half: int,
    step_ns: int,
    params: MovementParameters,
) -> Vector:
    _, v, _ = checked_samples(t_ns, direction, params.nominal_rate_hz)
    stretch = fill_gaps(t_ns, v, limit_ns(params.losses.fill_ms), step_ns)
    return velocities_deg_s(t_ns, v, stretch, half)


MARGIN_NS: Final = 12 * NS_PER_MS
"""Left beside a saccade whose ends were sharpened: what oscillates there is no fixation."""
I2MC_BELOW_HZ: Final = 50.0
"""Where I2MC finds fixations better than Engbert–Kliegl, with noise or without: labelled sets,
thinned and with noise added (`python -m benchmarks.gaze_detectors.choice`)."""


def chosen_detector(rate_hz: float, noise_deg_s: float) -> tuple[Detector, str]:
    """Return which detector suits a rate, and a sentence why, with the spread of velocity."""
    signal = f"{rate_hz:.0f} Hz, velocity noise {noise_deg_s:.1f}°/s"
    if rate_hz < I2MC_BELOW_HZ:
        return "i2mc", f"{signal}: below {I2MC_BELOW_HZ:.0f} Hz a saccade is too few samples"
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
    why += _said_of(signal, params)
    movement, runs = _rough(signal, name, params)
    _finish(signal, movement, runs, params)
    return _movements_of(signal, movement, in_head, head_deg_s, name, why, params)


def _said_of(s: _Signal, params: MovementParameters) -> str:
    """Return in words what was smoothed or taken out before detection; "" for nothing."""
    words = ""
    if s.window_ms > params.velocity.windows_ms[0]:
        words += f"; velocity over {s.window_ms:.0f} ms, as noise asks"
    if s.head.late_ms:
        late = "later" if s.head.late_ms > 0 else "earlier"
        words += f"; eyes were paired with the head {abs(s.head.late_ms):.0f} ms {late}, mended"
    if s.head.slip_01:
        words += f"; {s.head.slip_01:.0%} of the head's turns not compensated, taken out"
    return words


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
    saccades, fixations, i2mc = params.saccades, params.fixations, params.i2mc
    # The same number of samples is 3 ms at 1000 Hz and 50 ms at 60 Hz: limits in ms hold it to
    # what a saccade can last.
    minimum_ms = min(
        saccades.max_min_saccade_ms,
        max(saccades.min_saccade_ms, saccades.saccade_samples * s.step_ns / NS_PER_MS),
    )
    minimum_ns = min(limit_ns(minimum_ms, -1), s.step_ns * saccades.saccade_samples)
    # What noise displaces gaze by within the window is no movement, so it parts no fixation.
    merge_deg = float(
        np.clip(
            fixations.merge_spreads * s.noise_deg, fixations.min_merge_deg, fixations.max_merge_deg
        )
    )
    merge_ms = fixations.merge_ms
    oscillation_ns = round(saccades.oscillation_ms * NS_PER_MS)
    fast = outside_ellipse(s.velocity, s.noise_multiple, s.least_deg_s)
    # With a moving head gaze in world is fast in a pursuit by the head, too; the eye in the head is
    # fast only in a saccade.
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
            max(peak, s.least_deg_s),
            onset,
            oscillation_ns,
            minimum_ns,
            oscillation_ns,
            s.step_ns,
            movement,
        )
    elif name == "i2mc":
        # I2MC finds where gaze rests, and what lies between is saccades; the others the reverse.
        jumps = _clustered_jumps(s, i2mc)
        if s.head_free is not None:
            jumps &= s.head_free
        rest = ~jumps & (s.stretch >= 0)
        merge_deg, merge_ms = max(merge_deg, i2mc.cluster_merge_deg), i2mc.cluster_merge_ms
        runs = _merged_runs(s, rest, merge_ms, merge_deg, params)
        runs = runs[: trim_borders(s.v, runs, i2mc.cluster_border_spreads)]
        duration_ns = s.t_ns[runs[:, 1]] - s.t_ns[runs[:, 0]] + s.step_ns
        runs = np.ascontiguousarray(runs[duration_ns >= limit_ns(fixations.min_fixation_ms, -1)])
        mark_between(s.t_ns, s.stretch, runs, limit_ns(i2mc.max_saccade_ms), s.step_ns, movement)
        mark_blinks(s.t_ns, s.stretch, movement, limit_ns(params.losses.max_blink_ms), s.step_ns)
        return movement, runs
    else:
        mark_fast_runs(
            s.t_ns, s.velocity, s.stretch, fast, minimum_ns, oscillation_ns, s.step_ns, movement
        )
        if s.window_ms > params.velocity.windows_ms[0]:
            sharpen_saccades(s.v, s.stretch, s.half, round(MARGIN_NS / s.step_ns), movement)
    mark_blinks(s.t_ns, s.stretch, movement, limit_ns(params.losses.max_blink_ms), s.step_ns)
    rest = (movement == Movement.UNKNOWN) & (s.stretch >= 0)
    return movement, _merged_runs(s, rest, merge_ms, merge_deg, params)


def _clustered_jumps(s: _Signal, rule: I2mcRule) -> npt.NDArray[np.bool_]:
    """Return (n,) where I2MC's weight is above its mean by `cluster_spreads`: gaze moves there."""
    weights = clustering_weights(
        s.t_ns,
        s.v,
        s.stretch,
        round(rule.cluster_window_ms * NS_PER_MS),
        round(rule.cluster_advance_ms * NS_PER_MS),
        np.array([1, 2, 5, 10], np.int64),
        rule.cluster_max_changes,
    )
    finite_weights = weights[np.isfinite(weights)]
    if not finite_weights.size:
        return np.zeros(len(weights), np.bool_)
    with np.errstate(invalid="ignore"):
        jumps: npt.NDArray[np.bool_] = (
            weights > finite_weights.mean() + rule.cluster_spreads * finite_weights.std()
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
        round(params.fixations.border_ms * NS_PER_MS),
        s.step_ns,
    )
    return np.ascontiguousarray(runs[:count])


def _finish(s: _Signal, movement: Kinds, runs: Rows, params: MovementParameters) -> None:
    """Write fixations and pursuit into `movement`, and clear what is too short."""
    pursues = np.zeros(len(movement), np.bool_)
    if params.pursuits.pursuit:
        pursues = is_pursuit(
            s.t_ns, s.v, runs, s.step_ns, change_cost=params.pursuits.pursuit_change_cost
        )
    drop_short(
        s.t_ns,
        runs,
        pursues,
        limit_ns(params.fixations.min_fixation_ms, -1),
        limit_ns(params.pursuits.min_pursuit_ms, -1),
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
    direction, peak = describe_events(s.gaze, speed, first, last)
    duration = np.minimum(
        s.t_ns[last] - s.t_ns[first] + s.step_ns,
        np.append(s.t_ns[1:], np.iinfo(np.int64).max)[last] - s.t_ns[first],
    )
    all_missing = np.full(len(first), np.nan)
    amplitude = all_missing
    if len(first):
        amplitude = np.asarray(angle_deg(s.gaze[first], s.gaze[last]))
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
        amplitude_deg=amplitude,
        peak_deg_s=peak,
        head_deg_s=all_missing if head_deg_s is None else _means(head_deg_s, first, last),
        eye_deg_s=eye,
        detector=name,
        why=why,
        noise_deg_s=s.noise_deg_s,
        window_ms=s.window_ms,
        eye_late_ms=s.head.late_ms,
        slip_01=s.head.slip_01,
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
