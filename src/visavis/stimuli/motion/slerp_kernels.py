"""Compiled spherical interpolation of many joints at many times.

The kernels never change a sign: callers put keys into one hemisphere, and control points of Squad
keep their signs.
"""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Index = npt.NDArray[np.int64]
Quat = tuple[float, float, float, float]

SERIES_DOT = 0.9
"""Above this dot product twelve series terms reach double precision (0.05^12 is below 1e-15)."""
MAX_TERMS = 28
LONG_SERIES_DOT = 0.5
"""Above this one `MAX_TERMS` do (0.25^28 is below 1e-16); below it trigonometry is used."""


@compiled
def _series(h: float, dot: float) -> float:
    """Return sin(h w) / sin w for cos w = dot near 1, by its series in (dot - 1).

    The series is Eberly's: each term is the one before times (h²/(i(2i+1)) - i/(2i+1)) (dot - 1).
    """
    # Without sines of small angles, whose quotient would lose digits where poses hardly differ.
    x, h2 = dot - 1.0, h * h
    term, total = 1.0, 1.0
    for i in range(1, 13):
        term *= (h2 / (i * (2 * i + 1.0)) - i / (2 * i + 1.0)) * x
        total += term
    return h * total


@compiled
def slerp_one(
    a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float, h: float
) -> Quat:
    """Turn from unit quaternion a towards b by share h of the arc between them as given."""
    dot = a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
    if dot > SERIES_DOT and -1.0 <= h <= 2.0:
        u, v = _series(1.0 - h, dot), _series(h, dot)
    else:
        s = np.sqrt((a0 + b0) ** 2 + (a1 + b1) ** 2 + (a2 + b2) ** 2 + (a3 + b3) ** 2)
        d = np.sqrt((a0 - b0) ** 2 + (a1 - b1) ** 2 + (a2 - b2) ** 2 + (a3 - b3) ** 2)
        w = 2.0 * np.arctan2(d, s)
        if s < 1e-9:
            # Opposite signs of one rotation: no arc is given, so take one through a fixed axis.
            c, n = np.cos(w * h), np.sin(w * h)
            return c * a0 - n * a1, c * a1 + n * a0, c * a2 - n * a3, c * a3 + n * a2
        if d < 1e-9:
            u, v = 1.0 - h, h
        else:
            sin_w = 0.5 * s * d
            u, v = np.sin((1.0 - h) * w) / sin_w, np.sin(h * w) / sin_w
    return u * a0 + v * b0, u * a1 + v * b1, u * a2 + v * b2, u * a3 + v * b3


@compiled
def slerp_rows(a: Vector, b: Vector, h: Vector, out: Vector) -> None:
    """Interpolate rows a, b (n, 4) at h (n,) into out (n, 4)."""
    for r in range(h.shape[0]):
        out[r, 0], out[r, 1], out[r, 2], out[r, 3] = slerp_one(
            a[r, 0], a[r, 1], a[r, 2], a[r, 3], b[r, 0], b[r, 1], b[r, 2], b[r, 3], h[r]
        )


@compiled
def terms_of_series(x: Vector, is_within: bool) -> tuple[int, int]:
    """Return how many terms of the series all short arcs of a row need, and how many arcs are long.

    `x` are cosines minus 1, of arcs whose shares are, `is_within`, where the series holds at all.
    Arcs are counted, not compared with the widest so far, because counts run on vectors.
    """
    n_short = n_20 = n_12 = n_9 = n_7 = 0
    for j in range(x.shape[0]):
        is_short = x[j] > LONG_SERIES_DOT - 1.0
        n_short += is_short
        n_20 += is_short & (x[j] + 1.0 > 0.7)
        n_12 += is_short & (x[j] + 1.0 > SERIES_DOT)
        n_9 += is_short & (x[j] + 1.0 > 0.97)
        n_7 += is_short & (x[j] + 1.0 > 0.99)
    # As many terms as ((1 - dot) / 2)^n needs to fall below 1e-16 for the widest.
    n_terms = MAX_TERMS
    if n_20 == n_short:
        n_terms = 20
    if n_12 == n_short:
        n_terms = 12
    if n_9 == n_short:
        n_terms = 9
    if n_7 == n_short:
        n_terms = 7
    return n_terms, x.shape[0] - n_short if is_within else x.shape[0]


@compiled
def series_row(h: float, n_terms: int, x: Vector, terms: Vector, share: Vector) -> None:
    """Write sin(h w) / sin w for every x = cos w - 1 near 0; the same series as `_series`.

    Nested from the last of `n_terms` inwards, joint by joint within a term, so that it runs on
    vectors.
    """
    for i in range(1, n_terms + 1):
        terms[i - 1] = (h * h - i * i) / (i * (2 * i + 1.0))
    last = terms[n_terms - 1]
    for j in range(x.shape[0]):
        share[j] = 1.0 + last * x[j]
    for i in range(n_terms - 2, 0, -1):
        term = terms[i]
        for j in range(x.shape[0]):
            share[j] = 1.0 + term * x[j] * share[j]
    for j in range(x.shape[0]):
        share[j] = h * (1.0 + terms[0] * x[j] * share[j])


@compiled
def slerp_segments(a: Vector, b: Vector, segment: Index, h: Vector, out: Vector) -> None:
    """Interpolate all joints of segments a, b (segments, joints, 4) into out (n, joints, 4)."""
    n = a.shape[1]
    x, u, v, terms = np.empty(n), np.empty(n), np.empty(n), np.empty(MAX_TERMS)
    for r in range(h.shape[0]):
        s, share = segment[r], h[r]
        is_near = -1.0 <= share <= 2.0
        for j in range(n):
            x[j] = (
                a[s, j, 0] * b[s, j, 0]
                + a[s, j, 1] * b[s, j, 1]
                + a[s, j, 2] * b[s, j, 2]
                + a[s, j, 3] * b[s, j, 3]
                - 1.0
            )
        n_terms, n_long = terms_of_series(x, is_near)
        series_row(1.0 - share, n_terms, x, terms, u)
        series_row(share, n_terms, x, terms, v)
        for j in range(n):
            for i in range(4):
                out[r, j, i] = u[j] * a[s, j, i] + v[j] * b[s, j, i]
        if n_long == 0:
            continue
        for j in range(n):
            # Wide arcs, and shares far outside, are computed by sines instead.
            if not (is_near and x[j] > LONG_SERIES_DOT - 1.0):
                out[r, j, 0], out[r, j, 1], out[r, j, 2], out[r, j, 3] = slerp_one(
                    a[s, j, 0],
                    a[s, j, 1],
                    a[s, j, 2],
                    a[s, j, 3],
                    b[s, j, 0],
                    b[s, j, 1],
                    b[s, j, 2],
                    b[s, j, 3],
                    share,
                )


@compiled
def forward_rows(
    parents: Index, offsets: Vector, root: Vector, local: Vector, positions: Vector, world: Vector
) -> None:
    """Chain local turns (n, joints, 4) from roots (n, 3) into world positions and turns."""
    for r in range(local.shape[0]):
        for j in range(local.shape[1]):
            p = parents[j]
            bw, bx, by, bz = local[r, j, 0], local[r, j, 1], local[r, j, 2], local[r, j, 3]
            if p < 0:
                positions[r, j, 0], positions[r, j, 1] = root[r, 0], root[r, 1]
                positions[r, j, 2] = root[r, 2]
                world[r, j, 0], world[r, j, 1], world[r, j, 2], world[r, j, 3] = bw, bx, by, bz
                continue
            w, x, y, z = world[r, p, 0], world[r, p, 1], world[r, p, 2], world[r, p, 3]
            # Rotate the bone by the parent's turn, v + w t + q × t with t = 2 q × v, then multiply
            # turns.
            vx, vy, vz = offsets[j, 0], offsets[j, 1], offsets[j, 2]
            tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
            positions[r, j, 0] = positions[r, p, 0] + vx + w * tx + y * tz - z * ty
            positions[r, j, 1] = positions[r, p, 1] + vy + w * ty + z * tx - x * tz
            positions[r, j, 2] = positions[r, p, 2] + vz + w * tz + x * ty - y * tx
            world[r, j, 0] = w * bw - x * bx - y * by - z * bz
            world[r, j, 1] = w * bx + x * bw + y * bz - z * by
            world[r, j, 2] = w * by - x * bz + y * bw + z * bx
            world[r, j, 3] = w * bz + x * by - y * bx + z * bw
