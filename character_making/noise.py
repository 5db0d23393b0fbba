"""Smooth noise in space, the same for the same place on every machine."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector


@compiled
def _hash(x: int, y: int, z: int, seed: int) -> float:
    h = (x * 374761393 + y * 668265263 + z * 2147483647 + seed * 144665) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    h = (h ^ (h >> 16)) & 0xFFFFFFFF
    return h / 4294967295.0


@compiled
def _noise(points: Vector, seed: int, out: Vector) -> None:
    for i in range(points.shape[0]):
        fx, fy, fz = np.floor(points[i, 0]), np.floor(points[i, 1]), np.floor(points[i, 2])
        x, y, z = int(fx), int(fy), int(fz)
        u, v, w = points[i, 0] - fx, points[i, 1] - fy, points[i, 2] - fz
        u, v, w = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
        total = 0.0
        for dx in range(2):
            for dy in range(2):
                for dz in range(2):
                    share = (u if dx else 1 - u) * (v if dy else 1 - v) * (w if dz else 1 - w)
                    total += share * _hash(x + dx, y + dy, z + dz, seed)
        out[i] = 2 * total - 1


def noise(points_m: Vector, per_m: float | npt.ArrayLike, seed: int) -> Vector:
    """Return values (v,) from −1 to 1 that change about `per_m` times a metre (per axis)."""
    out = np.empty(len(points_m))
    _noise(np.ascontiguousarray(points_m * np.asarray(per_m)), seed, out)
    return out
