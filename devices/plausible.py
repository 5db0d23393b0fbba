"""Check positions from devices: finite, and within a kilometre of the origin."""

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

MAX_FAR_M = 1000.0


def is_place(x: float, y: float, z: float) -> bool:
    """Tell whether a position (m) is plausible; NaN and infinity are not."""
    return abs(x) <= MAX_FAR_M and abs(y) <= MAX_FAR_M and abs(z) <= MAX_FAR_M


def are_places(position_m: Vector) -> npt.NDArray[np.bool_]:
    """Tell which positions, shape (..., 3), are plausible; shape (...)."""
    return np.asarray((np.abs(position_m) <= MAX_FAR_M).all(axis=-1))
