"""Carry rows of posture numbers from a person's own frame to world, and mix them."""

import numpy as np
import numpy.typing as npt

from lab.compiled import compiled
from lab.geometry import Vector
from stimuli.motion import posture as p
from stimuli.motion.rhythm_kernels import ease


@compiled
def _moved(c: Vector, start: int, place: Vector, cosine: float, sine: float) -> None:
    x, z = c[start], c[start + 2]
    c[start] = place[0] + cosine * x + sine * z
    c[start + 1] += place[1]
    c[start + 2] = place[2] - sine * x + cosine * z


@compiled
def placed_rows(controls: Vector, place_m: Vector, heading_rad: Vector) -> None:
    """Move rows (n, SIZE) to places (n, 3) on the floor and headings (n,), left of −z."""
    for r in range(controls.shape[0]):
        c, heading = controls[r], heading_rad[r]
        cosine, sine = np.cos(heading), np.sin(heading)
        _moved(c, p.HIPS, place_m[r], cosine, sine)
        c[p.HIPS_YAW] += heading
        c[p.FRONT] += heading
        for side in range(2):
            start = p.LEG + side * p.LEG_SIZE
            _moved(c, start + p.ANKLE, place_m[r], cosine, sine)
            c[start + p.FOOT_YAW] += heading


@compiled
def mix_rows(controls: Vector, rows: npt.NDArray[np.int64], other: Vector, share: Vector) -> None:
    """Mix `other` (k, SIZE) into the rows (k,) of `controls` by an eased share 0..1."""
    for i in range(rows.shape[0]):
        s = ease(share[i])
        for j in range(controls.shape[1]):
            controls[rows[i], j] = (1.0 - s) * controls[rows[i], j] + s * other[i, j]
