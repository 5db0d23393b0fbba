"""Movements of eyes and heads during fixation: drift, micro-saccades, sway.

All of it is a function of time and of who somebody is. Micro-saccades come about once a second, a
quarter of a degree in size, between them the line of gaze drifts by some hundredths (Rolfs 2009,
Vision Research 49:2415); together they stay within `MAX_FIXATION_DEG`. Both eyes move alike.
Amplitudes of the head are ours: a few millimetres at 0.1 to 0.5 Hz, as of somebody who attends.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.rhythm_kernels import drift, stepping

MAX_FIXATION_DEG: Final = 0.45
DRIFT_RAD: Final = np.radians(0.04)
MICRO_RAD: Final = np.radians(0.18)
MICRO_MEAN_S: Final = 0.9
MICRO_LASTS_S: Final = 0.025
SWAY_M: Final = (0.0022, 0.0008, 0.0030)
"""To the side, up, ahead."""
NOD_RAD: Final = np.radians(0.35)


@compiled
def _offset_rad(t_s: float, person: int, purpose: int) -> float:
    micro, _ = stepping(t_s, MICRO_MEAN_S, MICRO_LASTS_S, person, purpose)
    slow = min(1.5, max(-1.5, drift(t_s, 0.35, person, purpose + 1)))
    return float(MICRO_RAD * micro + DRIFT_RAD * slow)


@compiled
def fixation_rows(t_s: float, seeds: npt.NDArray[np.int64], direction: Vector) -> None:
    """Move unit lines of gaze (n, 3), in place, by what fixating eyes add to them."""
    for r in range(direction.shape[0]):
        x, y, z = direction[r, 0], direction[r, 1], direction[r, 2]
        level = np.hypot(x, z)
        if not level > 1e-6:
            continue
        right, up = _offset_rad(t_s, seeds[r], 611), _offset_rad(t_s, seeds[r], 613)
        # Sideways and upwards of the line of gaze.
        sx, sz = -z / level, x / level
        ux, uy, uz = -x * y / level, level, -z * y / level
        nx, ny, nz = x + right * sx + up * ux, y + up * uy, z + right * sz + up * uz
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        direction[r, 0], direction[r, 1], direction[r, 2] = nx / size, ny / size, nz / size


@compiled
def sway_rows(t_s: float, seeds: npt.NDArray[np.int64], eyes_m: Vector, facing: Vector) -> None:
    """Move held heads, eyes (n, 3) and unit facing (n, 3), in place, as nobody holds still."""
    for r in range(eyes_m.shape[0]):
        fx, fz = facing[r, 0], facing[r, 2]
        level = np.hypot(fx, fz)
        if not level > 1e-6:
            continue
        # Sway has its own size ahead and aside, so it goes along the way the body faces.
        fx, fz = fx / level, fz / level
        side = SWAY_M[0] * drift(t_s, 0.11, seeds[r], 601)
        ahead = SWAY_M[2] * drift(t_s, 0.10, seeds[r], 602)
        eyes_m[r, 0] += side * -fz + ahead * fx
        eyes_m[r, 1] += SWAY_M[1] * drift(t_s, 0.16, seeds[r], 603)
        eyes_m[r, 2] += side * fx + ahead * fz
        turn = NOD_RAD * drift(t_s, 0.07, seeds[r], 604)
        facing[r, 0] += turn * -fz
        facing[r, 1] += NOD_RAD * drift(t_s, 0.09, seeds[r], 605)
        facing[r, 2] += turn * fx
        size = np.sqrt(facing[r, 0] ** 2 + facing[r, 1] ** 2 + facing[r, 2] ** 2)
        for k in range(3):
            facing[r, k] /= size
