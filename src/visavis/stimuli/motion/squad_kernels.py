"""Compiled Squad of many joints at many times.

The two arcs between keys and between control points are known beforehand, so their angles are
computed once (`arcs_of`); at a time only their sines are, by a series that runs on vectors of
joints.
"""

import math

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.rhythm_kernels import S1, S2, S3, S4, S5, S6, S7, S8
from visavis.stimuli.motion.slerp_kernels import (
    LONG_SERIES_DOT,
    MAX_TERMS,
    Index,
    series_row,
    slerp_one,
    terms_of_series,
)

SIDE_BY_SIDE = 8
"""As many joints as a processor's widest vectors hold: what is left over is computed one by one."""
MAX_ANGLE_RAD = 0.5 * math.pi + 1e-6
"""Arcs up to here, half a turn of a joint, are computed by the series of the half angle's sine; the
term after `S8` is below 1e-19 there.
"""


def arcs_of(a: Vector, b: Vector) -> tuple[Vector, Vector]:
    """Lay out arcs between rotations a, b (segments, joints, 4) as the kernel reads them.

    The first array (segments, 8, joints) holds a and b component by component; the second
    (segments, 3, joints) the angle w squared, w cot w and w / sin w, infinite where the arc is
    too long for the series. Joints that rest are added up to a multiple of `SIDE_BY_SIDE`.
    """
    rest = np.zeros((a.shape[0], -a.shape[1] % SIDE_BY_SIDE, 4))
    rest[..., 0] = 1.0
    a, b = np.concatenate([a, rest], axis=1), np.concatenate([b, rest], axis=1)
    ends = np.ascontiguousarray(np.concatenate([a, b], axis=-1).transpose(0, 2, 1))
    w = 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    sinc, cosine = np.sinc(w / np.pi), np.cos(w)
    with np.errstate(divide="ignore", over="ignore"):
        angles = np.stack([w * w, cosine / sinc, 1.0 / sinc], axis=1)
    angles[:, 0][w > MAX_ANGLE_RAD] = np.inf
    return ends, np.ascontiguousarray(angles)


@compiled
def _arc_row(ends: Vector, angles: Vector, h: float, out: Vector) -> None:
    """Interpolate one segment's joints at share h; `ends` (8, joints), `out` (4, joints)."""
    for j in range(ends.shape[1]):
        # By a series in the half angle squared, from whose sine both others follow: no call and no
        # branch, so joints go side by side.
        y = 0.25 * h * h * angles[0, j]
        tail = S5 + y * (S6 + y * (S7 + y * S8))
        half = 1.0 + y * (S1 + y * (S2 + y * (S3 + y * (S4 + y * tail))))
        square = y * half * half
        share = h * half * np.sqrt(1.0 - square)
        u = 1.0 - 2.0 * square - share * angles[1, j]
        v = share * angles[2, j]
        out[0, j] = u * ends[0, j] + v * ends[4, j]
        out[1, j] = u * ends[1, j] + v * ends[5, j]
        out[2, j] = u * ends[2, j] + v * ends[6, j]
        out[3, j] = u * ends[3, j] + v * ends[7, j]


@compiled
def squad_segments(
    keys: Vector, key_angles: Vector, controls: Vector, control_angles: Vector,
    segment: Index, h: Vector, out: Vector,
) -> None:  # fmt: skip
    """Interpolate key arcs with control arcs, both from `arcs_of`, into out (n, joints, 4)."""
    n = keys.shape[2]
    p, c = np.empty((4, n)), np.empty((4, n))
    x, u, v, terms = np.empty(n), np.empty(n), np.empty(n), np.empty(MAX_TERMS)
    for r in range(h.shape[0]):
        s, share = segment[r], h[r]
        # Squad (Shoemake, 1987): slerp of the key arc and the control arc at 2 h (1 − h).
        k = 2.0 * share * (1.0 - share)
        _arc_row(keys[s], key_angles[s], share, p)
        _arc_row(controls[s], control_angles[s], share, c)
        for j in range(n):
            dot = p[0, j] * c[0, j] + p[1, j] * c[1, j] + p[2, j] * c[2, j] + p[3, j] * c[3, j]
            x[j] = dot - 1.0
        # Eberly's series for sin(h θ)/sin θ holds where arcs are short; all joints of a row at once
        # it vectorises.
        is_within = 0.0 <= share <= 1.0
        n_terms, n_long = terms_of_series(x, is_within)
        series_row(1.0 - k, n_terms, x, terms, u)
        series_row(k, n_terms, x, terms, v)
        for j in range(out.shape[1]):
            # Four numbers that lie together are written together.
            one, other = u[j], v[j]
            out[r, j, 0] = one * p[0, j] + other * c[0, j]
            out[r, j, 1] = one * p[1, j] + other * c[1, j]
            out[r, j, 2] = one * p[2, j] + other * c[2, j]
            out[r, j, 3] = one * p[3, j] + other * c[3, j]
        if n_long == 0:
            continue
        # The few joints with long arcs, or beyond the segment, take the exact way.
        for j in range(out.shape[1]):
            if is_within and x[j] > LONG_SERIES_DOT - 1.0:
                continue
            a = slerp_one(
                keys[s, 0, j], keys[s, 1, j], keys[s, 2, j], keys[s, 3, j],
                keys[s, 4, j], keys[s, 5, j], keys[s, 6, j], keys[s, 7, j], share,
            )  # fmt: skip
            b = slerp_one(
                controls[s, 0, j], controls[s, 1, j], controls[s, 2, j], controls[s, 3, j],
                controls[s, 4, j], controls[s, 5, j], controls[s, 6, j], controls[s, 7, j], share,
            )  # fmt: skip
            out[r, j, 0], out[r, j, 1], out[r, j, 2], out[r, j, 3] = slerp_one(
                a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], k
            )
