"""Compiled velocities of gaze on the sphere, and runs of rows."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Rows = npt.NDArray[np.int64]


@compiled
def velocities_deg_s(t_ns: Times, v: Vector, stretch: Rows, half: int) -> Vector:
    """Return (n, 2) velocity right and up: differences over 1 to `half` rows, averaged.

    With `half` 2 this is the five-point velocity of Engbert & Kliegl (2003). The window shrinks
    towards the ends of a stretch; rows alone in theirs, or lost, are NaN.
    """
    n = t_ns.shape[0]
    out = np.full((n, 2), np.nan)
    for i in range(n):
        s = stretch[i]
        if s < 0:
            continue
        first = i
        while first > 0 and i - first < half and stretch[first - 1] == s:
            first -= 1
        last = i
        while last < n - 1 and last - i < half and stretch[last + 1] == s:
            last += 1
        # As many rows on either side as both have.
        k = min(i - first, last - i)
        dx = 0.0
        dy = 0.0
        dz = 0.0
        span = 0.0
        if k == 0:
            if first == last:
                continue
            k = max(i - first, last - i)
            at = first if first < i else last
            sign = 1.0 if last > i else -1.0
            dx = sign * (v[at, 0] - v[i, 0])
            dy = sign * (v[at, 1] - v[i, 1])
            dz = sign * (v[at, 2] - v[i, 2])
            span = abs(t_ns[at] - t_ns[i]) * 1e-9
        else:
            # Σ (v[i + d] − v[i − d]) / Σ (t[i + d] − t[i − d])
            for d in range(1, k + 1):
                dx += v[i + d, 0] - v[i - d, 0]
                dy += v[i + d, 1] - v[i - d, 1]
                dz += v[i + d, 2] - v[i - d, 2]
                span += (t_ns[i + d] - t_ns[i - d]) * 1e-9
        # Right and up at the direction of gaze; straight up or down any right does.
        level = np.sqrt(v[i, 0] ** 2 + v[i, 2] ** 2)
        if level < 1e-9:
            right_x = 1.0
            right_z = 0.0
        else:
            right_x = -v[i, 2] / level
            right_z = v[i, 0] / level
        # up = right × forward
        up_x = -right_z * v[i, 1]
        up_y = right_z * v[i, 0] - right_x * v[i, 2]
        up_z = right_x * v[i, 1]
        out[i, 0] = np.degrees(dx * right_x + dz * right_z) / span
        out[i, 1] = np.degrees(dx * up_x + dy * up_y + dz * up_z) / span
    return out
