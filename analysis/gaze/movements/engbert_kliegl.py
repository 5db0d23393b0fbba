"""Saccades as velocities outside an ellipse of the recording's own noise."""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

SLOW_DEG_S: Final = 30.0
"""Slower rows are taken for rest, drift and pursuit."""
SLOW_QUANTILE_01: Final = 0.9
SPREADS_AT_QUANTILE: Final = float(np.sqrt(-2.0 * np.log(1.0 - SLOW_QUANTILE_01)))
"""That quantile of speed, in spreads of velocity along either axis (Rayleigh's distribution)."""


def noise_deg_s(velocity: Vector) -> tuple[float, float]:
    """Return the spread of velocity (n, 2) right and up, by medians, so saccades hardly count.

    √(median(v²) − median(v)²), Engbert & Kliegl (2003), equation 3; NaN when nothing is known.
    """
    finite = velocity[np.isfinite(velocity[:, 0])]
    if not len(finite):
        return np.nan, np.nan
    middle = np.median(finite, axis=0)
    spread = np.sqrt(np.maximum(np.median(finite**2, axis=0) - middle**2, 0.0))
    return float(spread[0]), float(spread[1])


def slow_spread_deg_s(velocity: Vector) -> float:
    """Return the spread of slow velocity (n, 2) by the fastest tenth; NaN when nothing is slow.

    Medians see noise alone; drift and pursuit stand in the tail.
    """
    speed = np.linalg.norm(velocity, axis=1)
    slow = speed[speed < SLOW_DEG_S]
    return float(np.quantile(slow, SLOW_QUANTILE_01)) / SPREADS_AT_QUANTILE if len(slow) else np.nan


def outside_ellipse(
    velocity: Vector, noise_multiple: float, minimum_deg_s: float
) -> npt.NDArray[np.bool_]:
    """Return (n,) where velocity lies outside the ellipse of `noise_multiple` spreads.

    Neither half axis is less than `minimum_deg_s` (0: as published).
    """
    right, up = (max(noise_multiple * s, minimum_deg_s) for s in noise_deg_s(velocity))
    if not (right > 0 and up > 0):
        return np.zeros(len(velocity), np.bool_)
    with np.errstate(invalid="ignore"):
        outside: npt.NDArray[np.bool_] = (velocity[:, 0] / right) ** 2 + (
            velocity[:, 1] / up
        ) ** 2 > 1.0
    return outside
