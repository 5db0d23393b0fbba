"""Compiled measures of how gaze drifts between saccades, in windows around every row."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.movements.velocity import Rows
from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

NEIGHBOUR_NS = 150_000_000
"""Runs further apart than this are not used to describe each other."""
SLOWEST_DEG_S = 0.5


@compiled
def _cumulate(t_ns: Times, v: Vector, first: int, last: int, sums: Vector) -> None:
    """Fill rows `first` to `last` + 1 of `sums` (n + 1, 12) with sums over the run before a row.

    Columns: count, s, s², then x y z, their squares and their products with s; seconds and
    directions are taken from the run's first row.
    """
    for c in range(12):
        sums[first, c] = 0.0
    for i in range(first, last + 1):
        s = (t_ns[i] - t_ns[first]) * 1e-9
        sums[i + 1, 0] = sums[i, 0] + 1.0
        sums[i + 1, 1] = sums[i, 1] + s
        sums[i + 1, 2] = sums[i, 2] + s * s
        for k in range(3):
            # From the first row: squares of small differences keep their digits.
            x = v[i, k] - v[first, k]
            sums[i + 1, 3 + k] = sums[i, 3 + k] + x
            sums[i + 1, 6 + k] = sums[i, 6 + k] + x * x
            sums[i + 1, 9 + k] = sums[i, 9 + k] + x * s


@compiled
def _fit(sums: Vector, first: int, last: int, out: Vector) -> None:
    """Fill `out` (5,) with a line's slope x, y, z per s, its share of variance, its seconds."""
    n = sums[last + 1, 0] - sums[first, 0]
    out[:] = 0.0
    if n < 3:
        return
    # Differences of cumulated sums give the moments of any window at a constant cost.
    mean_s = (sums[last + 1, 1] - sums[first, 1]) / n
    spread = sums[last + 1, 2] - sums[first, 2] - n * mean_s * mean_s
    total = 0.0
    along = 0.0
    for k in range(3):
        mean = (sums[last + 1, 3 + k] - sums[first, 3 + k]) / n
        total += sums[last + 1, 6 + k] - sums[first, 6 + k] - n * mean * mean
        common = sums[last + 1, 9 + k] - sums[first, 9 + k] - n * mean * mean_s
        out[k] = common / spread
        along += common * common / spread
    out[3] = min(1.0, max(0.0, along / total)) if total > 1e-18 else 0.0
    # A uniform spread of times has variance T² / 12.
    out[4] = np.sqrt(12.0 * spread / n)


@compiled
def _log_speed(fit: Vector) -> float:
    speed = np.sqrt(fit[0] ** 2 + fit[1] ** 2 + fit[2] ** 2)
    logarithm: float = np.log(np.degrees(speed) + SLOWEST_DEG_S)
    return logarithm


@compiled
def drift_features(
    t_ns: Times, v: Vector, runs: Rows, trim_ns: int, windows_ns: Rows, every: int
) -> tuple[Rows, Rows, Vector]:
    """Return every few rows of runs: row (m,), run (m,), features (m, 2 windows + 9).

    Features: log speed and share of variance of a line in each window; the same and the log
    duration of the whole run; log speed, likeness of direction and presence of the run before
    and of the one after. Windows at the edge of a run reach further inwards instead.
    """
    count = runs.shape[0]
    w = windows_ns.shape[0]
    sums = np.zeros((t_ns.shape[0] + 2, 12))
    whole = np.zeros((count, 5))
    bounds = np.zeros((count, 2), np.int64)
    m = 0
    # First pass: cut the ends off every run, where saccades begin and end.
    for r in range(count):
        a = runs[r, 0]
        b = runs[r, 1]
        while a < b and t_ns[a] - t_ns[runs[r, 0]] < trim_ns:
            a += 1
        while b > a and t_ns[runs[r, 1]] - t_ns[b] < trim_ns:
            b -= 1
        bounds[r, 0] = a
        bounds[r, 1] = b
        m += (runs[r, 1] - runs[r, 0]) // every + 1
    rows = np.empty(m, np.int64)
    of = np.empty(m, np.int64)
    out = np.zeros((m, 2 * w + 9))
    fit = np.zeros(5)
    low = np.empty(w, np.int64)
    high = np.empty(w, np.int64)
    j = 0
    # Second pass: a line in every window round every row; the windows slide, so two pointers do.
    for r in range(count):
        a = bounds[r, 0]
        b = bounds[r, 1]
        _cumulate(t_ns, v, a, b, sums)
        _fit(sums, a, b, whole[r])
        low[:] = a
        high[:] = a
        for i in range(runs[r, 0], runs[r, 1] + 1, every):
            rows[j] = i
            of[j] = r
            at = t_ns[min(max(i, a), b)]
            for q in range(w):
                # Centred on the row, shifted inwards at the run's ends.
                begin = max(t_ns[a], min(at - windows_ns[q] // 2, t_ns[b] - windows_ns[q]))
                end = min(t_ns[b], begin + windows_ns[q])
                while t_ns[low[q]] < begin:
                    low[q] += 1
                while high[q] < b and t_ns[high[q] + 1] <= end:
                    high[q] += 1
                _fit(sums, low[q], high[q], fit)
                out[j, 2 * q] = _log_speed(fit)
                out[j, 2 * q + 1] = fit[3]
            j += 1
    # Third pass: features of the whole run and of its neighbours, the same for all of its rows.
    of_run = np.empty(9)
    j = 0
    for r in range(count):
        of_run[:] = 0.0
        of_run[0] = _log_speed(whole[r])
        of_run[1] = whole[r, 3]
        of_run[2] = np.log(whole[r, 4] + 0.02)
        own = np.sqrt(whole[r, 0] ** 2 + whole[r, 1] ** 2 + whole[r, 2] ** 2)
        for side in range(2):
            o = r - 1 + 2 * side
            if o < 0 or o >= count:
                continue
            later = max(r, o)
            if t_ns[runs[later, 0]] - t_ns[runs[later - 1, 1]] >= NEIGHBOUR_NS:
                continue
            other = np.sqrt(whole[o, 0] ** 2 + whole[o, 1] ** 2 + whole[o, 2] ** 2)
            dot = 0.0
            for k in range(3):
                dot += whole[o, k] * whole[r, k]
            of_run[3 + 3 * side] = _log_speed(whole[o])
            of_run[4 + 3 * side] = dot / (other * own + 1e-9) * whole[o, 3]
            of_run[5 + 3 * side] = 1.0
        while j < m and of[j] == r:
            for c in range(9):
                out[j, 2 * w + c] = of_run[c]
            j += 1
    return rows, of, out


@compiled
def cheapest_path(
    rows: Rows,
    of: Rows,
    runs: Rows,
    log_odds: Vector,
    change_cost: float,
    out: npt.NDArray[np.bool_],
) -> None:
    """Set `out` (n,) where the best path through each run says yes.

    The path gains the log odds of every row at which it says yes and pays `change_cost` for
    every change within a run.
    """
    m = rows.shape[0]
    came_from = np.zeros((m, 2), np.bool_)
    is_yes = np.zeros(m, np.bool_)
    i = 0
    while i < m:
        end = i
        no = 0.0
        yes = 0.0
        # Viterbi over two states: best value of a path that ends in "no" and in "yes".
        while end < m and of[end] == of[i]:
            came_from[end, 0] = yes - change_cost > no
            came_from[end, 1] = yes >= no - change_cost
            best_no = max(no, yes - change_cost)
            yes = max(yes, no - change_cost) + log_odds[end]
            no = best_no
            end += 1
        state = yes > no
        # Walk back along the choices made.
        for j in range(end - 1, i - 1, -1):
            is_yes[j] = state
            state = came_from[j, 1] if state else came_from[j, 0]
        i = end
    for j in range(m):
        if is_yes[j]:
            same = j + 1 < m and of[j + 1] == of[j]
            end = rows[j + 1] if same else runs[of[j], 1] + 1
            for row in range(rows[j], end):
                out[row] = True
