"""A device's clock over a whole recording: piecewise lines between exchanges, cut at its jumps.

In a session only the past is known, so a driver dates samples by its latest exchanges. Afterwards
all of them are known: drift is followed between them, and a jump of the clock is found and placed
between the two samples around it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_MS, NS_PER_S

KNOT_NS = 60 * NS_PER_S
"""Time between the points of a fit."""
WANDER_PPM = 2.0
"""By how much a quartz' drift changes in a minute, as when it warms."""
DRIFT_PPM = 100.0
"""How large drift is, where there is too little to measure it."""
SAME_NS = 1000
MIN_BOUND_NS = 100.0
ARRIVAL_BOUND_NS = 50_000.0
WINDOW_NS = 10 * NS_PER_S
STEP_NS = 2 * NS_PER_MS
DRIFT_BOUND_PPM = 200
"""Between two exchanges a clock that does not jump moves by less than both together, beside
what their round trips leave open: coarse stamps, and the worst quartz."""
ONE_WAY_JUMP_NS = 250 * NS_PER_MS
"""The same for a device without exchanges, whose delivery may stall."""
LATE_NS = 5 * NS_PER_S
"""Samples arrive at most so long after they were taken."""
EARLY_NS = NS_PER_MS
UNKNOWN_NS = -(2**63)
"""Value of an unknown device time: `visavis.devices.streams.NO_DEVICE_TIME`."""

Times = npt.NDArray[np.int64]


@dataclass(frozen=True)
class ClockStretch:
    """A stretch without a jump: host minus device time (k,) at device times (k,), lines between.

    `from_ns` and `until_ns` are the session times of its first and last exchange (or arrival).
    """

    at_device_ns: Times
    offset_ns: Times
    from_ns: int
    until_ns: int

    def to_host_ns(self, t_device_ns: Times) -> Times:
        """Map device times (n,) to the session's clock; ends go on with their drift."""
        at, offset = self.at_device_ns, self.offset_ns
        if len(at) == 1:
            steady: Times = t_device_ns + offset[0]
            return steady
        x = (t_device_ns - at[0]).astype(np.float64)
        knots = (at - at[0]).astype(np.float64)
        heights = (offset - offset[0]).astype(np.float64)
        left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
        slope = np.diff(heights) / np.diff(knots)
        offset_ns = heights[left] + slope[left] * (x - knots[left])
        host: Times = t_device_ns + offset[0] + np.rint(offset_ns).astype(np.int64)
        return host


@dataclass(frozen=True)
class ClockJump:
    """A jump of a device's clock: it showed `by_ns` more from session time `t_ns` on."""

    t_ns: int
    by_ns: int


@dataclass(frozen=True)
class DeviceTimes:
    """Samples of one stream on the session's clock, in order of arrival.

    `t_ns` (n,) are their times, `jumps` where the clock jumped; `drift_ppm` is how much faster the
    session's clock runs than the device's over the longest stretch, `exchanges` how many time
    exchanges the fit rests on (0: on arrivals, and times contain the least delay).
    """

    t_ns: Times
    jumps: tuple[ClockJump, ...]
    drift_ppm: float
    exchanges: int


def device_times(
    t_device_ns: Times, t_host_ns: Times, exchanges: Sequence[Sequence[int]] = ()
) -> DeviceTimes:
    """Date samples (n,) by all time exchanges (send, device, receive) of a recording.

    Without exchanges the quickest arrivals date them; a sample without a stamp is dated by its
    own. Raw stamps are not changed.
    """
    if not len(t_device_ns):
        return DeviceTimes(t_device_ns.copy(), (), 0.0, 0)
    is_stamped = t_device_ns != UNKNOWN_NS
    if not is_stamped.all():
        dated_samples = device_times(t_device_ns[is_stamped], t_host_ns[is_stamped], exchanges)
        t_ns = t_host_ns.copy()
        t_ns[is_stamped] = dated_samples.t_ns
        return replace(dated_samples, t_ns=t_ns)
    table = np.array(exchanges, np.int64).reshape(-1, 3)
    table = table[table[:, 2] >= table[:, 0]]
    table = table[np.argsort(table[:, 2], kind="stable")]
    if len(table):
        stretches = _by_exchanges(*table.T)
    elif np.array_equal(t_device_ns, t_host_ns):
        return DeviceTimes(t_host_ns.copy(), (), 0.0, 0)
    else:
        stretches = _by_arrivals(t_device_ns, t_host_ns)
    of_stretch, t_ns = _dated(t_device_ns, t_host_ns, stretches)
    jumps = [
        _jump(before, after, t_ns[of_stretch == number + 1])
        for number, (before, after) in enumerate(pairwise(stretches))
    ]
    longest = max(stretches, key=lambda s: s.until_ns - s.from_ns)
    drift = 0.0
    if len(longest.at_device_ns) > 1:
        moved_ns = int(longest.offset_ns[-1] - longest.offset_ns[0])
        drift = 1e6 * moved_ns / int(longest.at_device_ns[-1] - longest.at_device_ns[0])
    return DeviceTimes(t_ns, tuple(jumps), drift, len(table))


def _by_exchanges(send: Times, device: Times, receive: Times) -> list[ClockStretch]:
    """Cut where two exchanges cannot both be right without a jump, and fit each stretch."""
    trip, offset = receive - send, (send + receive) // 2 - device
    # One exchange alone between two that agree was answered wrongly; the clock did not jump twice.
    is_lone = np.zeros(len(trip), np.bool_)
    if len(trip) > 2:
        off = _apart(offset[:-1], offset[1:], trip[:-1], trip[1:], send[:-1], send[1:])
        agree = ~_apart(offset[:-2], offset[2:], trip[:-2], trip[2:], send[:-2], send[2:])
        is_lone[1:-1] = off[:-1] & off[1:] & agree
    send, device, receive, trip, offset = (
        a[~is_lone] for a in (send, device, receive, trip, offset)
    )
    off = _apart(offset[:-1], offset[1:], trip[:-1], trip[1:], send[:-1], send[1:])
    bounds = [0, *(np.flatnonzero(off) + 1).tolist(), len(trip)]
    stretches = []
    for first, end in pairwise(bounds):
        rows = first + _quick(send[first:end], trip[first:end])
        # Each way takes its least time at least, so only what a round trip exceeds the quickest
        # by can displace the offset: evenly, up to a half of it.
        bound_ns = (trip[rows] - trip[first:end].min()) / np.sqrt(12)
        bound_ns = np.maximum(bound_ns, max(float(np.median(bound_ns)) / 10, MIN_BOUND_NS))
        at, height = _fit(device[rows], offset[rows], bound_ns)
        stretches.append(ClockStretch(at, height, int(send[first]), int(receive[end - 1])))
    return stretches


def _apart(
    offset: Times, next_offset: Times, trip: Times, next_trip: Times, sent: Times, next_sent: Times
) -> npt.NDArray[np.bool_]:
    """Tell of pairs of exchanges whether their offsets differ by more than a steady clock's can.

    An offset is wrong by at most half its round trip.
    """
    open_ns = (trip + next_trip) // 2 + STEP_NS
    drift_ns = np.abs(next_sent - sent) // 1_000_000 * DRIFT_BOUND_PPM
    apart: npt.NDArray[np.bool_] = np.abs(next_offset - offset) > open_ns + drift_ns
    return apart


def _fit(device: Times, offset: Times, bound_ns: npt.NDArray[np.float64]) -> tuple[Times, Times]:
    """Return device times and offsets (k,) of lines through measured offsets (n,).

    The smoothest lines that the measurements allow: least squares with each weighted by the bound
    of its error, and drift that changes little from minute to minute.
    """
    first = int(device.min())
    span_ns = int(device.max()) - first
    count = max(round(span_ns / KNOT_NS), 1) + 1 if span_ns >= NS_PER_S else 1
    base = int(offset[np.argmin(bound_ns)])
    height = (offset - base).astype(np.float64)
    weight = 1 / bound_ns
    if count == 1:
        mean = float(weight**2 @ height / (weight**2).sum())
        return np.array([first], np.int64), np.array([base + round(mean)], np.int64)
    step_ns = span_ns / (count - 1)
    place = (device - first) / step_ns
    left = np.minimum(place.astype(np.intp), count - 2)
    lever = np.zeros((len(device), count))
    rows = np.arange(len(device))
    lever[rows, left], lever[rows, left + 1] = 1 - (place - left), place - left
    bend = np.diff(np.eye(count), 2, axis=0) / (step_ns * np.sqrt(step_ns / KNOT_NS) * WANDER_PPM)
    drift = np.diff(np.eye(count)[[0, -1]], axis=0) / (span_ns * DRIFT_PPM)
    table = np.concatenate([lever * weight[:, None], bend * 1e6, drift * 1e6])
    right_side = np.concatenate([height * weight, np.zeros(len(bend) + 1)])
    heights = np.linalg.lstsq(table, right_side, rcond=None)[0]
    if np.ptp(heights) < SAME_NS:  # no drift: an exact offset stays exact
        return np.array([first], np.int64), np.array([base], np.int64)
    at = first + np.rint(np.arange(count) * step_ns).astype(np.int64)
    return at, base + np.rint(heights).astype(np.int64)


def _quick(sent: Times, trip: Times) -> npt.NDArray[np.intp]:
    """Return the rows of the quickest third of the exchanges of every half minute."""
    number = (sent - sent[0]) // (KNOT_NS // 2)
    best: list[int] = []
    for one in np.unique(number):
        rows = np.flatnonzero(number == one)
        best += rows[np.argsort(trip[rows], kind="stable")[: -(-len(rows) // 3)]].tolist()
    return np.sort(np.array(best, np.intp))


def _by_arrivals(device: Times, host: Times) -> list[ClockStretch]:
    """Cut where stamps step away from arrivals; fit the quickest sample of every ten seconds."""
    offset = host - device
    is_jump = np.diff(device) < -ONE_WAY_JUMP_NS
    # A late sample waited; what follows it has not jumped, unless it came sooner than all before.
    for rows in np.split(np.arange(len(device)), np.flatnonzero(is_jump) + 1):
        least = _recent_minimum(host[rows], offset[rows])
        is_jump[rows[:-1]] |= offset[rows][1:] < least[:-1] - ONE_WAY_JUMP_NS
    bounds = [0, *(np.flatnonzero(is_jump) + 1).tolist(), len(device)]
    stretches = []
    for first, end in pairwise(bounds):
        own, delay = device[first:end], offset[first:end]
        order = np.lexsort((delay, (own - own.min()) // WINDOW_NS))
        number = ((own - own.min()) // WINDOW_NS)[order]
        best = order[np.flatnonzero(np.diff(number, prepend=-1))]
        at, height = _fit(own[best], delay[best], np.full(len(best), ARRIVAL_BOUND_NS))
        stretches.append(ClockStretch(at, height, int(host[first]), int(host[end - 1])))
    return stretches


def _recent_minimum(host: Times, offset: Times) -> Times:
    """Return for each sample (n,) the least offset of those of about ten seconds up to it."""
    if len(host) < 2:
        return offset
    count = round(WINDOW_NS / max(1.0, float(np.median(np.diff(host)))))
    count = min(max(1, count), len(offset))
    # Least of the window's part in its own block, and of its part in the block before.
    blocks = np.pad(offset, (0, -len(offset) % count), mode="edge").reshape(-1, count)
    to_here = np.minimum.accumulate(blocks, axis=1).ravel()[: len(offset)]
    from_here = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    least: Times = to_here.copy()
    least[count - 1 :] = np.minimum(
        least[count - 1 :], from_here[: max(0, len(offset) - count + 1)]
    )
    return least


def _dated(
    device: Times, host: Times, stretches: Sequence[ClockStretch]
) -> tuple[npt.NDArray[np.intp], Times]:
    """Return for each sample (n,) the stretch that it was stamped in, and its time.

    Around a jump both clocks are possible. A sample cannot arrive before it was taken, and the one
    that makes it younger is right.
    """
    of_stretch = np.zeros(len(device), np.intp)
    t_ns = stretches[0].to_host_ns(device)
    if len(stretches) == 1:
        return of_stretch, t_ns
    never = np.iinfo(np.int64).max
    least = np.full(len(device), never)
    for number, stretch in enumerate(stretches):
        begins = stretches[number - 1].until_ns if number else -never
        ends = stretches[number + 1].from_ns + LATE_NS if number + 1 < len(stretches) else never
        rows = np.flatnonzero((host >= begins) & (host <= ends))
        there = stretch.to_host_ns(device[rows])
        age = host[rows] - there
        cost = np.where(age >= -EARLY_NS, np.abs(age), never // 2 - age)
        is_better = cost < least[rows]
        better_rows = rows[is_better]
        least[better_rows], of_stretch[better_rows] = cost[is_better], number
        t_ns[better_rows] = there[is_better]
    return of_stretch, t_ns


def _jump(before: ClockStretch, after: ClockStretch, samples_ns: Times) -> ClockJump:
    """Return the jump between two stretches: at the first sample after it, if there is one."""
    middle_ns = (before.until_ns + after.from_ns) // 2
    by_ns = int(before.offset_ns[-1] - after.offset_ns[0])
    t_ns = int(samples_ns.min()) if len(samples_ns) else middle_ns
    return ClockJump(t_ns, by_ns)
