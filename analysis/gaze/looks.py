"""Measure looks at one area of interest: runs of samples on it, in integer nanoseconds.

A sample lasts until the next one, at most 1.5 nominal steps; what no sample covers is lost. A
loss of at most 75 ms with the same area on both sides is bridged; a sample elsewhere never is.
A look of at least 150 ms is a fixation, a shorter one a glance.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import LOST
from visavis.analysis.gaze.stamps import Times, order_of, typical_step_ns
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.compiled import compiled
from visavis.lab.errors import DataError, UsageError


@dataclass(frozen=True, slots=True)
class LookParameters:
    """The thresholds of the look measures; reported with every result.

    `slack_ns` is added where a duration meets a threshold: tracker clocks drift by up to 100 ppm
    (15 µs in 150 ms) and stamps are rounded, so a look that lasts the minimum is not lost.
    `bridge_ms` follows the gap fill of Olsen (2012). `onset` says what happens to a look that is
    on when the trial begins: `clip` counts it from there, `exclude` leaves it out entirely (its
    time is `excluded_ns`). `nominal_rate_hz` None takes the step from the stamps.
    """

    minimum_fixation_ms: float = 150.0
    bridge_ms: float = 75.0
    hold_steps: float = 1.5
    slack_ns: int = 20_000
    onset: Literal["clip", "exclude"] = "clip"
    nominal_rate_hz: float | None = None
    backward: Literal["error", "sort"] = "error"
    conflicts: Literal["error", "keep_first"] = "error"

    def __post_init__(self) -> None:
        if self.minimum_fixation_ms < 0 or self.bridge_ms < 0 or self.slack_ns < 0:
            raise UsageError("minimum fixation, bridge and slack cannot be negative")
        if self.hold_steps < 1:
            raise UsageError(f"a sample is held at least one step, not {self.hold_steps}")
        if self.nominal_rate_hz is not None and not self.nominal_rate_hz > 0:
            raise UsageError(f"nominal_rate_hz is {self.nominal_rate_hz}; give a rate above 0")


DEFAULT_LOOK_PARAMETERS = LookParameters()


@dataclass(frozen=True, slots=True)
class Looks:
    """Every look of a stretch of time, in order; arrays of shape (k,), times int64 ns.

    `onset_ns` is on the clock of the samples; `duration_ns` includes bridged loss, `dwell_ns`
    does not.
    """

    onset_ns: Times
    duration_ns: Times
    dwell_ns: Times
    is_fixation: npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Fixation:
    """One fixation: when it began, counted from the trial's start, and how long it lasted."""

    time_ns: int
    duration_ns: int


@dataclass(frozen=True, slots=True)
class LookMeasures:
    """Look measures of one trial (or one part of it) for one target.

    Exact in nanoseconds: dwell + excluded + off + lost = duration. `off_ns` is valid gaze
    elsewhere, other heads included. `on_at_onset`: the first sample was on the target;
    `cut_at_end`: the last look ran into the end. `repeated` counts rows left out because they
    repeat a stamp. `parts` holds the measures before and after the switch, or nothing; looks are
    cut at the switch, so the parts' dwell sums to the whole. A missing fixation is None.
    """

    duration_ns: int
    dwell_ns: int
    dwell_in_fixations_ns: int
    off_ns: int
    lost_ns: int
    excluded_ns: int
    fixation_count: int
    glance_count: int
    first_fixation: Fixation | None
    second_fixation: Fixation | None
    on_at_onset: bool
    cut_at_end: bool
    repeated: int = 0
    parts: "tuple[LookMeasures, ...]" = ()

    @property
    def duration_ms(self) -> float:
        """How long the trial or part lasted."""
        return self.duration_ns / NS_PER_MS

    @property
    def dwell_ms(self) -> float:
        """Time of valid samples on the target."""
        return self.dwell_ns / NS_PER_MS

    @property
    def dwell_in_fixations_ms(self) -> float:
        """Time of valid samples on the target within fixations."""
        return self.dwell_in_fixations_ns / NS_PER_MS

    @property
    def first_fixation_time_ms(self) -> float | None:
        """Onset of the first fixation after the trial's start."""
        return self.first_fixation.time_ns / NS_PER_MS if self.first_fixation else None

    @property
    def first_fixation_duration_ms(self) -> float | None:
        """Duration of the first fixation, bridged loss included."""
        return self.first_fixation.duration_ns / NS_PER_MS if self.first_fixation else None

    @property
    def second_fixation_time_ms(self) -> float | None:
        """Onset of the second fixation after the trial's start."""
        return self.second_fixation.time_ns / NS_PER_MS if self.second_fixation else None

    @property
    def second_fixation_duration_ms(self) -> float | None:
        """Duration of the second fixation, bridged loss included."""
        return self.second_fixation.duration_ns / NS_PER_MS if self.second_fixation else None

    @property
    def lost_01(self) -> float | None:
        """Share of the time without usable gaze; None for an empty trial."""
        return self.lost_ns / self.duration_ns if self.duration_ns else None

    @property
    def off_01(self) -> float | None:
        """Share of the time with gaze elsewhere; None for an empty trial."""
        return self.off_ns / self.duration_ns if self.duration_ns else None

    @property
    def dwell_of_valid_01(self) -> float | None:
        """Share of the time with usable gaze that was dwell; None without any."""
        valid_ns = self.duration_ns - self.lost_ns
        return self.dwell_ns / valid_ns if valid_ns else None

    def as_row(self, prefix: str = "") -> Mapping[str, float | int | bool | None]:
        """Return the measures as columns of a trial table; missing stays None."""
        names = (
            "dwell_ms dwell_in_fixations_ms fixation_count glance_count first_fixation_time_ms "
            "first_fixation_duration_ms second_fixation_time_ms second_fixation_duration_ms "
            "on_at_onset cut_at_end lost_01 off_01 dwell_of_valid_01"
        ).split()
        return {prefix + name: getattr(self, name) for name in names}


@compiled
def _runs(
    t_ns: Times,
    aoi: npt.NDArray[np.integer],
    target: int,
    start_ns: int,
    end_ns: int,
    hold_ns: int,
    bridge_ns: int,
    out: Times,
) -> tuple[int, int, int, bool]:
    """Fill `out` (k, 3) with onset, end, dwell of looks; return k, ns on, ns off, on at onset."""
    n = t_ns.shape[0]
    k, on_ns, off_ns = 0, 0, 0
    is_open, first_valid, on_at_onset = False, True, False
    for i in range(n):
        begin = max(t_ns[i], start_ns)
        if begin >= end_ns:
            break
        # A sample holds until the next one, at most `hold_ns`.
        until = min(t_ns[i] + hold_ns, end_ns)
        if i + 1 < n:
            until = min(until, t_ns[i + 1])
        if until <= begin or aoi[i] == LOST:
            continue
        if aoi[i] != target:
            off_ns += until - begin
            is_open = False
        else:
            on_ns += until - begin
            if first_valid and begin - start_ns <= hold_ns:
                on_at_onset = True
            # A short loss is bridged: it counts in the look's duration, not in its dwell.
            if is_open and begin - out[k - 1, 1] <= bridge_ns:
                out[k - 1, 1] = until
                out[k - 1, 2] += until - begin
            else:
                out[k, 0], out[k, 1], out[k, 2] = begin, until, until - begin
                k += 1
                is_open = True
        first_valid = False
    return k, on_ns, off_ns, on_at_onset


@compiled
def _sums(
    t_ns: Times,
    aoi: npt.NDArray[np.integer],
    start_ns: int,
    end_ns: int,
    hold_ns: int,
    out: Times,
) -> None:
    out[-1] = end_ns - start_ns
    n = t_ns.shape[0]
    for i in range(n):
        begin = max(t_ns[i], start_ns)
        until = min(t_ns[i] + hold_ns, end_ns)
        if i + 1 < n:
            until = min(until, t_ns[i + 1])
        if until <= begin or aoi[i] == LOST:
            continue
        place = aoi[i] if aoi[i] >= 0 else out.shape[0] - 2
        # `out[-1]` starts as the whole duration; what a sample covers is not lost.
        out[place] += until - begin
        out[-1] -= until - begin


@dataclass(frozen=True, slots=True)
class _Track:
    """Ordered samples and how long one may be held."""

    t_ns: Times
    aoi: npt.NDArray[np.integer]
    hold_ns: int
    repeated: int


def _track(t_ns: Times, aoi: npt.NDArray[np.integer], params: LookParameters) -> _Track:
    if t_ns.ndim != 1 or t_ns.shape != aoi.shape:
        raise UsageError(f"times {t_ns.shape} and areas {aoi.shape} disagree; give (n,) and (n,)")
    if t_ns.dtype != np.int64:
        raise UsageError(f"times are {t_ns.dtype}; give int64 nanoseconds")
    order = order_of(t_ns, aoi, backward=params.backward, conflicts=params.conflicts)
    if order.rows is not None:
        t_ns, aoi = t_ns[order.rows], aoi[order.rows]
    if params.nominal_rate_hz is None:
        step_ns = typical_step_ns(t_ns)
    else:
        step_ns = round(NS_PER_S / params.nominal_rate_hz)
    return _Track(
        np.ascontiguousarray(t_ns),
        np.ascontiguousarray(aoi),
        int(params.hold_steps * step_ns),
        order.repeated,
    )


def _check_span(start_ns: int, end_ns: int) -> None:
    if end_ns < start_ns:
        raise DataError(f"the trial ends at {end_ns} ns, before it starts at {start_ns} ns")


def _looks_in_span(
    track: _Track, target: int, start_ns: int, end_ns: int, params: LookParameters
) -> tuple[Looks, int, int, bool]:
    out = np.empty((track.t_ns.shape[0], 3), np.int64)
    bridge_ns = round(params.bridge_ms * NS_PER_MS) + params.slack_ns
    k, on_ns, off_ns, on_at_onset = _runs(
        track.t_ns, track.aoi, target, start_ns, end_ns, track.hold_ns, bridge_ns, out
    )
    onset, end, dwell = out[:k].T
    minimum_ns = round(params.minimum_fixation_ms * NS_PER_MS) - params.slack_ns
    looks = Looks(onset, end - onset, dwell, end - onset >= minimum_ns)
    return looks, on_ns, off_ns, on_at_onset


def looks_on(
    t_ns: Times,
    aoi: npt.NDArray[np.integer],
    target: int,
    t_start_ns: int,
    t_end_ns: int,
    *,
    params: LookParameters = DEFAULT_LOOK_PARAMETERS,
) -> Looks:
    """Return every look on `target` between two times, cut at both."""
    _check_span(t_start_ns, t_end_ns)
    return _looks_in_span(_track(t_ns, aoi, params), target, t_start_ns, t_end_ns, params)[0]


def _measures_of_span(
    track: _Track,
    target: int,
    start_ns: int,
    end_ns: int,
    params: LookParameters,
    excluded_until_ns: int,
) -> LookMeasures:
    looks, on_ns, off_ns, on_at_onset = _looks_in_span(track, target, start_ns, end_ns, params)
    cut = bool(looks.onset_ns.size and looks.onset_ns[-1] + looks.duration_ns[-1] == end_ns)
    counts = looks.onset_ns >= excluded_until_ns
    where = np.flatnonzero(looks.is_fixation & counts)
    first_two = [
        Fixation(int(looks.onset_ns[i]) - start_ns, int(looks.duration_ns[i])) for i in where[:2]
    ]
    excluded_ns = int(looks.dwell_ns[~counts].sum())
    return LookMeasures(
        duration_ns=end_ns - start_ns,
        dwell_ns=on_ns - excluded_ns,
        dwell_in_fixations_ns=int(looks.dwell_ns[where].sum()),
        off_ns=off_ns,
        lost_ns=end_ns - start_ns - on_ns - off_ns,
        excluded_ns=excluded_ns,
        fixation_count=len(where),
        glance_count=int(counts.sum()) - len(where),
        first_fixation=first_two[0] if first_two else None,
        second_fixation=first_two[1] if len(first_two) > 1 else None,
        on_at_onset=on_at_onset,
        cut_at_end=cut,
        repeated=track.repeated,
    )


def measure_trial(
    t_ns: Times,
    aoi: npt.NDArray[np.integer],
    target: int,
    t_start_ns: int,
    t_end_ns: int,
    *,
    switch_ns: int | None = None,
    params: LookParameters = DEFAULT_LOOK_PARAMETERS,
) -> LookMeasures:
    """Measure the looks on `target` in one trial, and in its parts when it has a switch.

    `t_ns` (n,) and `aoi` (n,) as `aoi_of_samples` returns it. Samples outside the trial may be
    given: the one before the start then covers the time until the first within. `switch_ns` is
    on the clock of the samples. Onset policy `exclude` concerns the trial's start only, in the
    parts too.

    Raises DataError for backward or contradictory stamps (naming the row), a trial that ends
    before it starts, or a switch outside it.
    """
    _check_span(t_start_ns, t_end_ns)
    track = _track(t_ns, aoi, params)
    excluded_until_ns = t_start_ns
    if params.onset == "exclude":
        looks, _, _, on_at_onset = _looks_in_span(track, target, t_start_ns, t_end_ns, params)
        if on_at_onset:
            excluded_until_ns = int(looks.onset_ns[0] + looks.duration_ns[0])
    whole = _measures_of_span(track, target, t_start_ns, t_end_ns, params, excluded_until_ns)
    if switch_ns is None:
        return whole
    if not t_start_ns <= switch_ns <= t_end_ns:
        raise DataError(
            f"the switch at {switch_ns} ns lies outside the trial, {t_start_ns} to "
            f"{t_end_ns} ns; check that both come from the same clock"
        )
    before = _measures_of_span(track, target, t_start_ns, switch_ns, params, excluded_until_ns)
    after = _measures_of_span(track, target, switch_ns, t_end_ns, params, excluded_until_ns)
    return replace(whole, parts=(before, after))
