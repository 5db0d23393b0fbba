"""Fixations by clustering in two, for low rates and noisy recordings.

Own implementation of Hessels, Niehorster, Kemner & Hooge (2017), Behavior Research Methods 49:
a moving window is split into two clusters again and again; rows where the split often falls
get a high weight, because gaze moved there.
"""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.movements.velocity import Rows
from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

MAX_ROUNDS = 10


@compiled
def _flatten(v: Vector, first: int, last: int, x: Vector, y: Vector) -> None:
    """Fill `x` and `y` with rows first to last, seen in the plane that touches the first."""
    ax = v[first, 0]
    ay = v[first, 1]
    az = v[first, 2]
    # Two axes across the first row, from whichever world axis is not along it.
    if abs(ay) < 0.9:
        ux = -az
        uy = 0.0
        uz = ax
    else:
        ux = 0.0
        uy = az
        uz = -ay
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    ux /= length
    uy /= length
    uz /= length
    wx = uy * az - uz * ay
    wy = uz * ax - ux * az
    wz = ux * ay - uy * ax
    for i in range(first, last + 1):
        x[i - first] = ux * v[i, 0] + uy * v[i, 1] + uz * v[i, 2]
        y[i - first] = wx * v[i, 0] + wy * v[i, 1] + wz * v[i, 2]


@compiled
def _split(x: Vector, y: Vector, width: int, every: int, cluster: npt.NDArray[np.bool_]) -> int:
    """Split every few of `width` points in two; return how often the cluster changes in time.

    Lloyd's rounds begin with the point furthest from the mean and the point furthest from that.
    """
    mean_x = 0.0
    mean_y = 0.0
    count = 0
    for j in range(0, width, every):
        mean_x += x[j]
        mean_y += y[j]
        count += 1
    from_x = mean_x / count
    from_y = mean_y / count
    # Start from two far points, so that the result does not depend on chance.
    one = 0
    two = 0
    for turn in range(2):
        widest = -1.0
        for j in range(0, width, every):
            d = (x[j] - from_x) ** 2 + (y[j] - from_y) ** 2
            if d > widest:
                widest = d
                two = j
        if turn == 0:
            one = two
        from_x = x[two]
        from_y = y[two]
    one_x, one_y, two_x, two_y = x[one], y[one], x[two], y[two]
    # Lloyd's rounds: assign to the nearer centre, move the centres, until nothing changes.
    changes = 0
    for turn in range(MAX_ROUNDS):
        any_change = turn == 0
        sum_x = 0.0
        sum_y = 0.0
        second = 0
        changes = 0
        before = False
        for j in range(0, width, every):
            is_two = (x[j] - two_x) ** 2 + (y[j] - two_y) ** 2 < (x[j] - one_x) ** 2 + (
                y[j] - one_y
            ) ** 2
            any_change |= is_two != cluster[j]
            cluster[j] = is_two
            if j > 0 and is_two != before:
                changes += 1
            before = is_two
            if is_two:
                sum_x += x[j]
                sum_y += y[j]
                second += 1
        if not any_change or second == 0 or second == count:
            break
        two_x = sum_x / second
        two_y = sum_y / second
        one_x = (mean_x - sum_x) / (count - second)
        one_y = (mean_y - sum_y) / (count - second)
    return changes


@compiled
def clustering_weights(
    t_ns: Times,
    v: Vector,
    stretch: Rows,
    window_ns: int,
    advance_ns: int,
    thinnings: Rows,
    max_changes: int,
) -> Vector:
    """Return (n,) mean weight of a change of cluster at each row; NaN where gaze is lost.

    In each window, for each thinning (1: all rows), a change of cluster adds 1 / number of
    changes to the rows it lies between. Windows with more than `max_changes` in any thinning
    show noise only and add nothing.
    """
    n = t_ns.shape[0]
    total = np.zeros(n)
    times = np.zeros(n)
    x = np.empty(n)
    y = np.empty(n)
    cluster = np.zeros(n, np.bool_)
    window_weight = np.zeros(n)
    first = 0
    while first < n:
        if stretch[first] < 0:
            first += 1
            continue
        # One window: rows of a stretch within `window_ns` of the first.
        last = first
        while (
            last < n - 1
            and stretch[last + 1] == stretch[first]
            and (t_ns[last + 1] - t_ns[first] < window_ns)
        ):
            last += 1
        is_full = last < n - 1 and stretch[last + 1] == stretch[first]
        width = last - first + 1
        if width >= 4:
            good = True
            for j in range(width):
                window_weight[j] = 0.0
            _flatten(v, first, last, x, y)
            for thinning in thinnings:
                if width < 3 * thinning + 1:
                    continue
                changes = _split(x, y, width, thinning, cluster)
                if changes > max_changes:
                    good = False
                    break
                # A change weighs 1 / (number of changes), shared by the rows it lies between.
                for j in range(thinning, width, thinning):
                    if changes > 0 and cluster[j] != cluster[j - thinning]:
                        for i in range(j - thinning + 1, j + 1):
                            window_weight[i] += 1.0 / changes / thinning
            for j in range(width):
                if good:
                    total[first + j] += window_weight[j]
                times[first + j] += 1.0
        # Move on by `advance_ns`; a window cut by the stretch's end is its last one.
        if is_full:
            begin = t_ns[first]
            i = first
            while i < n and stretch[i] == stretch[first] and t_ns[i] - begin < advance_ns:
                i += 1
            first = max(i, first + 1)
        else:
            first = last + 1
    for i in range(n):
        total[i] = total[i] / times[i] if times[i] > 0 else (np.nan if stretch[i] < 0 else 0.0)
    return total


@compiled
def trim_borders(v: Vector, runs: Rows, spreads: float) -> int:
    """Trim both ends of runs (k, 2) in place; return how many runs are left.

    A row at an end is removed when it lies further from the run's mean than the median distance
    plus `spreads` times the median deviation from it.
    """
    n_runs = 0
    for r in range(runs.shape[0]):
        first = runs[r, 0]
        last = runs[r, 1]
        mean = np.zeros(3)
        for i in range(first, last + 1):
            for k in range(3):
                mean[k] += v[i, k] / (last - first + 1)
        distance = np.empty(last - first + 1)
        for i in range(first, last + 1):
            square = 0.0
            for k in range(3):
                square += (v[i, k] - mean[k]) ** 2
            distance[i - first] = np.sqrt(square)
        # Limits from the run as it was, so that the order of trimming does not matter.
        middle = np.median(distance)
        limit = middle + spreads * np.median(np.abs(distance - middle)) + 1e-12
        start = first
        while first <= last and distance[first - start] > limit:
            first += 1
        while last >= first and distance[last - start] > limit:
            last -= 1
        if first <= last:
            runs[n_runs, 0] = first
            runs[n_runs, 1] = last
            n_runs += 1
    return n_runs
