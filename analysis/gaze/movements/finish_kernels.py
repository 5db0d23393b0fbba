"""Compiled last steps of every detector: fast runs, blinks, least durations, events."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.movements.kinds import Kinds, Movement
from visavis.analysis.gaze.movements.velocity import Rows
from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

SACCADE, OSCILLATION = int(Movement.SACCADE), int(Movement.OSCILLATION)
FIXATION, PURSUIT = int(Movement.FIXATION), int(Movement.PURSUIT)
BLINK, UNKNOWN = int(Movement.BLINK), int(Movement.UNKNOWN)
NEAR_END = 0.05


@compiled
def mark_fast_runs(
    t_ns: Times,
    velocity: Vector,
    stretch: Rows,
    fast: npt.NDArray[np.bool_],
    minimum_ns: int,
    oscillation_ns: int,
    step_ns: int,
    out: Kinds,
) -> None:
    """Mark runs of fast rows as saccades, and what swings back after them as oscillations.

    A run ends where velocity turns against that of its fastest row. A run that begins within
    half of `oscillation_ns` of a saccade's end and is slower than the saccade is an oscillation
    when it goes the other way, for `oscillation_ns` after the saccade.
    """
    n = t_ns.shape[0]
    saccade_end = -1  # last row of the saccade before
    of_peak = np.zeros(2)
    i = 0
    while i < n:
        if not fast[i]:
            i += 1
            continue
        first = i
        last = i
        peak = i
        while last < n - 1 and fast[last + 1] and stretch[last + 1] == stretch[first]:
            last += 1
            if _square(velocity, last) > _square(velocity, peak):
                peak = last
        # The saccade ends where velocity turns against its peak; what follows is looked at anew.
        end = peak
        while end < last and _dot(velocity, end + 1, velocity[peak]) > 0.0:
            end += 1
        i = end + 1
        if (
            saccade_end >= 0
            and stretch[saccade_end] == stretch[first]
            and t_ns[first] - t_ns[saccade_end] <= oscillation_ns // 2 + step_ns
            and _dot(velocity, peak, of_peak) < 0.0
            and _square(velocity, peak) < of_peak[0] ** 2 + of_peak[1] ** 2
        ):
            for j in range(saccade_end + 1, end + 1):
                if t_ns[j] - t_ns[saccade_end] <= oscillation_ns:
                    out[j] = OSCILLATION
            continue
        if t_ns[end] - t_ns[first] + step_ns < minimum_ns:
            continue
        for j in range(first, end + 1):
            out[j] = SACCADE
        saccade_end = end
        of_peak[0] = velocity[peak, 0]
        of_peak[1] = velocity[peak, 1]


@compiled
def sharpen_saccades(v: Vector, stretch: Rows, half: int, margin: int, out: Kinds) -> None:
    """Shrink saccades found by a window of `half` rows to either side, which smears their ends.

    Gaze lies near its place before, then near that after: the rows between where it last was
    within `NEAR_END` of the way of the one and first within as much of the other are the saccade.
    """
    n = out.shape[0]
    before = np.zeros(3)
    after = np.zeros(3)
    i = 0
    while i < n:
        if out[i] != SACCADE:
            i += 1
            continue
        first = i
        while i < n and out[i] == SACCADE and stretch[i] == stretch[first]:
            i += 1
        last = i - 1
        # Places before and after, over as many rows as the window has on a side.
        before[:] = 0.0
        after[:] = 0.0
        rows_before = 0
        j = first - 1
        while j >= 0 and rows_before <= half and stretch[j] == stretch[first] and out[j] == UNKNOWN:
            before += v[j]
            rows_before += 1
            j -= 1
        rows_after = 0
        j = last + 1
        while j < n and rows_after <= half and stretch[j] == stretch[first] and out[j] == UNKNOWN:
            after += v[j]
            rows_after += 1
            j += 1
        if rows_before == 0 or rows_after == 0:
            continue
        before /= rows_before
        after /= rows_after
        way = after - before
        length = way[0] ** 2 + way[1] ** 2 + way[2] ** 2
        if length <= 0.0:
            continue
        # The step between rows that goes furthest along the way is in the saccade.
        middle = first
        furthest = -np.inf
        for j in range(first, last):
            step = 0.0
            for k in range(3):
                step += (v[j + 1, k] - v[j, k]) * way[k]
            if step > furthest:
                furthest = step
                middle = j
        start = middle + 1
        while start > first and _share(v, start - 1, before, way, length) > NEAR_END:
            start -= 1
        end = middle
        while end < last and _share(v, end + 1, before, way, length) < 1.0 - NEAR_END:
            end += 1
        start = max(min(start, middle + 1) - margin, first)
        end = min(max(end, start) + margin, last)
        for j in range(first, last + 1):
            if j < start or j > end:
                out[j] = UNKNOWN


@compiled
def _share(v: Vector, row: int, place: Vector, way: Vector, length: float) -> float:
    """Return how much of a way from a place gaze has gone."""
    way_deg = 0.0
    for k in range(3):
        way_deg += (v[row, k] - place[k]) * way[k]
    share: float = way_deg / length
    return share


@compiled
def _square(velocity: Vector, row: int) -> float:
    square: float = velocity[row, 0] ** 2 + velocity[row, 1] ** 2
    return square


@compiled
def _dot(velocity: Vector, row: int, other: Vector) -> float:
    dot: float = velocity[row, 0] * other[0] + velocity[row, 1] * other[1]
    return dot


@compiled
def mark_blinks(t_ns: Times, stretch: Rows, out: Kinds, longest_ns: int, step_ns: int) -> None:
    """Mark losses up to `longest_ns` as blinks, with the saccades that touch them.

    The lid drags the pupil's image with it, so gaze seems to move just before and after.
    """
    n = t_ns.shape[0]
    i = 0
    while i < n:
        if stretch[i] >= 0:
            i += 1
            continue
        first = i
        while i < n and stretch[i] < 0:
            i += 1
        last = i - 1
        if t_ns[last] - t_ns[first] + step_ns > longest_ns:
            continue
        for j in range(first, last + 1):
            out[j] = BLINK
        j = first - 1
        while j >= 0 and (out[j] == SACCADE or out[j] == OSCILLATION):
            out[j] = BLINK
            j -= 1
        j = last + 1
        while j < n and (out[j] == SACCADE or out[j] == OSCILLATION):
            out[j] = BLINK
            j += 1


@compiled
def mark_between(
    t_ns: Times, stretch: Rows, runs: Rows, longest_ns: int, step_ns: int, out: Kinds
) -> None:
    """Mark what lies between neighbouring runs (k, 2) of one stretch, if short, as saccades."""
    for r in range(1, runs.shape[0]):
        first = runs[r - 1, 1] + 1
        last = runs[r, 0] - 1
        if first > last or stretch[first - 1] != stretch[last + 1]:
            continue
        if t_ns[last] - t_ns[first] + step_ns <= longest_ns:
            for j in range(first, last + 1):
                out[j] = SACCADE


@compiled
def drop_short(
    t_ns: Times,
    runs: Rows,
    pursues: npt.NDArray[np.bool_],
    fixation_ns: int,
    pursuit_ns: int,
    step_ns: int,
    out: Kinds,
) -> None:
    """Write fixation and pursuit over runs (k, 2); parts too short for their kind are unknown."""
    for r in range(runs.shape[0]):
        i = runs[r, 0]
        while i <= runs[r, 1]:
            # A part of the run in which pursuit does not change.
            last = i
            while last < runs[r, 1] and pursues[last + 1] == pursues[i]:
                last += 1
            duration_ns = t_ns[last] - t_ns[i] + step_ns
            kind = UNKNOWN
            if pursues[i]:
                if duration_ns >= pursuit_ns:
                    kind = PURSUIT
            elif duration_ns >= fixation_ns:
                kind = FIXATION
            for j in range(i, last + 1):
                out[j] = kind
            i = last + 1


@compiled
def describe_events(v: Vector, speed: Vector, first: Rows, last: Rows) -> tuple[Vector, Vector]:
    """Return mean directions (k, 3) of valid rows and peak speeds (k,), NaN where none is."""
    count = first.shape[0]
    direction = np.full((count, 3), np.nan)
    peak = np.full(count, np.nan)
    for e in range(count):
        x = 0.0
        y = 0.0
        z = 0.0
        for i in range(first[e], last[e] + 1):
            if np.isfinite(v[i, 0]):
                x += v[i, 0]
                y += v[i, 1]
                z += v[i, 2]
            # written so that the first speed replaces NaN
            if np.isfinite(speed[i]) and not speed[i] <= peak[e]:
                peak[e] = speed[i]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            direction[e, 0] = x / length
            direction[e, 1] = y / length
            direction[e, 2] = z / length
    return direction, peak
