"""Compiled loops of the eye-movement detectors, on unit vectors and integer nanoseconds."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Rows = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@compiled
def angle_rad(v: Vector, a: int, b: int) -> float:
    """Return the great-circle angle between rows a and b of unit vectors."""
    minus = 0.0
    plus = 0.0
    for k in range(3):
        minus += (v[a, k] - v[b, k]) ** 2
        plus += (v[a, k] + v[b, k]) ** 2
    angle: float = 2.0 * np.arctan2(np.sqrt(minus), np.sqrt(plus))
    return angle


@compiled
def unit_rows(v: Vector, out: Vector) -> None:
    """Write vectors (n, 3) scaled to length one; zero and non-finite ones become NaN."""
    for r in range(v.shape[0]):
        length = np.sqrt(v[r, 0] * v[r, 0] + v[r, 1] * v[r, 1] + v[r, 2] * v[r, 2])
        if 0.0 < length < np.inf:
            for k in range(3):
                out[r, k] = v[r, k] / length
        else:
            for k in range(3):
                out[r, k] = np.nan


@compiled
def sums_of_runs(v: Vector, first: Rows, last: Rows, sums: Vector, in_run: Flags) -> None:
    """Write sums (runs, 3) of the valid vectors of runs of rows, and which rows are in one (n,).

    Runs are in order and do not overlap. Sums run through all rows and are taken apart at the ends.
    """
    x = y = z = x_before = y_before = z_before = 0.0
    run = 0
    for r in range(v.shape[0]):
        is_run = run < first.shape[0] and r >= first[run]
        if is_run and r == first[run]:
            x_before, y_before, z_before = x, y, z
        in_run[r] = is_run
        if np.isfinite(v[r, 0]):
            x, y, z = x + v[r, 0], y + v[r, 1], z + v[r, 2]
        if is_run and r == last[run]:
            sums[run, 0], sums[run, 1], sums[run, 2] = x - x_before, y - y_before, z - z_before
            run += 1


@compiled
def fill_gaps(t_ns: Times, v: Vector, longest_ns: int, step_ns: int) -> Rows:
    """Interpolate short losses in place; return (n,) the stretch each row belongs to, -1 lost.

    A loss is the time between two valid rows beyond one step, whether rows are there or not.
    """
    n = t_ns.shape[0]
    stretch = np.full(n, -1, np.int64)
    last = -1
    current = -1
    for i in range(n):
        if not np.isfinite(v[i, 0]):
            continue
        if last < 0 or t_ns[i] - t_ns[last] - step_ns > longest_ns:
            current += 1
        elif i - last > 1:
            span = t_ns[i] - t_ns[last]
            for g in range(last + 1, i):
                # Along the chord, back onto the sphere: close to a great circle over short losses.
                share = (t_ns[g] - t_ns[last]) / span
                length = 0.0
                for k in range(3):
                    v[g, k] = (1.0 - share) * v[last, k] + share * v[i, k]
                    length += v[g, k] ** 2
                length = np.sqrt(length)
                if length == 0.0:
                    for k in range(3):
                        v[g, k] = v[last, k]
                else:
                    for k in range(3):
                        v[g, k] /= length
                stretch[g] = current
        stretch[i] = current
        last = i
    return stretch


@compiled
def speeds_deg_s(t_ns: Times, v: Vector, stretch: Rows, half: int, out: Vector) -> None:
    """Fill (n,) speed: least-squares slope of the direction over `half` rows on either side.

    The window is cut at the ends of a stretch; a row alone in its stretch has NaN. With one row
    on either side the slope is the chord between them over the time.
    """
    n = t_ns.shape[0]
    for i in range(n):
        out[i] = np.nan
        s = stretch[i]
        if s < 0:
            continue
        a = i
        while a > 0 and i - a < half and stretch[a - 1] == s:
            a -= 1
        b = i
        while b < n - 1 and b - i < half and stretch[b + 1] == s:
            b += 1
        if b == a:
            continue
        # Slope = Σ(t − mean t)·v / Σ(t − mean t)² by component; times in s from this row.
        mean_s = 0.0
        for j in range(a, b + 1):
            mean_s += (t_ns[j] - t_ns[i]) * 1e-9
        mean_s /= b - a + 1
        spread = 0.0
        x = 0.0
        y = 0.0
        z = 0.0
        for j in range(a, b + 1):
            d = (t_ns[j] - t_ns[i]) * 1e-9 - mean_s
            spread += d * d
            x += d * v[j, 0]
            y += d * v[j, 1]
            z += d * v[j, 2]
        out[i] = np.degrees(np.sqrt(x * x + y * y + z * z) / spread)


@compiled
def runs_where(mask: Flags, stretch: Rows, out: Rows) -> int:
    """Fill `out` (k, 2) with first and last row of runs of True within a stretch; return k."""
    k = 0
    is_open = False
    for i in range(mask.shape[0]):
        if not mask[i]:
            is_open = False
            continue
        if is_open and stretch[i] == stretch[i - 1]:
            out[k - 1, 1] = i
        else:
            out[k, 0] = i
            out[k, 1] = i
            k += 1
            is_open = True
    return k


@compiled
def _border(v: Vector, t_ns: Times, first: int, last: int, span_ns: int, out: Vector) -> None:
    """Fill `out` (2, 3) with mean directions of the first and of the last `span_ns` of a run."""
    out[:] = 0.0
    i = first
    while i <= last and t_ns[i] - t_ns[first] <= span_ns:
        for k in range(3):
            out[0, k] += v[i, k]
        i += 1
    i = last
    while i >= first and t_ns[last] - t_ns[i] <= span_ns:
        for k in range(3):
            out[1, k] += v[i, k]
        i -= 1
    for row in range(2):
        length = np.sqrt(out[row, 0] ** 2 + out[row, 1] ** 2 + out[row, 2] ** 2)
        if length > 0.0:
            for k in range(3):
                out[row, k] /= length


@compiled
def merge_runs(
    t_ns: Times,
    v: Vector,
    runs: Rows,
    count: int,
    gap_ns: int,
    angle_limit_rad: float,
    border_ns: int,
    step_ns: int,
) -> int:
    """Join neighbouring runs in place where gap and angle both allow it; return the new count.

    The gap is the time between the runs beyond one step; the angle lies between the mean
    directions of the `border_ns` before and after it.
    """
    if count == 0:
        return 0
    k = 1
    before = np.empty((2, 3))
    after = np.empty((2, 3))
    pair = np.empty((2, 3))
    _border(v, t_ns, runs[0, 0], runs[0, 1], border_ns, before)
    # `runs` is shortened in place: k runs are final, r is read ahead of them.
    for r in range(1, count):
        _border(v, t_ns, runs[r, 0], runs[r, 1], border_ns, after)
        for axis in range(3):
            pair[0, axis] = before[1, axis]
            pair[1, axis] = after[0, axis]
        near = t_ns[runs[r, 0]] - t_ns[runs[k - 1, 1]] - step_ns <= gap_ns
        if near and angle_rad(pair, 0, 1) <= angle_limit_rad:
            runs[k - 1, 1] = runs[r, 1]
            _border(v, t_ns, runs[k - 1, 0], runs[k - 1, 1], border_ns, before)
        else:
            runs[k, 0] = runs[r, 0]
            runs[k, 1] = runs[r, 1]
            k += 1
            before, after = after, before
    return k


@compiled
def compact_runs(
    t_ns: Times,
    v: Vector,
    widest_rad: float,
    minimum_ns: int,
    bridge_ns: int,
    step_ns: int,
    out: Rows,
) -> int:
    """Fill `out` (k, 2) with runs no two rows of which are further apart than allowed.

    Rows lost (NaN) are passed over; a loss of more than `bridge_ns` ends a run. `v` needs no
    filling. Returns k.
    """
    n = t_ns.shape[0]
    # Squared chords in place of angles: chord = 2 sin(angle / 2), so no arctangent per pair.
    widest_chord = 4.0 * np.sin(0.5 * widest_rad) ** 2
    k = 0
    start = 0
    while start < n:
        if not np.isfinite(v[start, 0]):
            start += 1
            continue
        last = start
        i = start + 1
        while i < n:
            if np.isfinite(v[i, 0]):
                if t_ns[i] - t_ns[last] - step_ns > bridge_ns:
                    break
                wide = False
                # The new row against every row of the run.
                j = i - 1
                while j >= start:
                    chord = 0.0
                    for c in range(3):
                        chord += (v[i, c] - v[j, c]) ** 2
                    if chord > widest_chord:
                        wide = True
                        break
                    j -= 1
                if wide:
                    break
                last = i
            i += 1
        if t_ns[last] - t_ns[start] + step_ns >= minimum_ns:
            out[k, 0] = start
            out[k, 1] = last
            k += 1
            start = last + 1
        else:
            # Too short: try again one row later, as published (Salvucci & Goldberg 2000).
            start += 1
    return k
