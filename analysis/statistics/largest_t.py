"""The greatest of several correlated t values: adjustment for a family of any contrasts."""

import numpy as np
from scipy import special

from visavis.analysis.statistics.results import Array

DIRECTIONS = 1 << 15
"""Directions over which the tail is averaged; the error of a probability is below 1e-4."""
SEED = 1
"""Scrambles the sequence; the same numbers come out every time."""
SMALLEST_EIGENVALUE = 1e-9


def largest_t_sf(t: Array, correlation: Array, df: float) -> Array:
    """Return P(max |T_i| > |t|) for each of t (m,), T multivariate t with this correlation.

    T is a length times a direction in as many dimensions as the correlation has rank. Given the
    direction, the tail of the length is that of F; directions come from a Sobol sequence. In one
    and two dimensions the average is exact to rounding.
    """
    reach, rank = _reaches(correlation)
    values = np.abs(np.asarray(t, dtype=np.float64))
    scaled = (values[:, None] / reach) ** 2
    tail = special.chdtrc(rank, scaled) if np.isinf(df) else special.fdtrc(rank, df, scaled / rank)
    mean: Array = np.asarray(tail.mean(axis=1), dtype=np.float64)
    return mean


def largest_t_quantile(level: float, correlation: Array, df: float) -> float:
    """Return t with P(max |T_i| ≤ t) = level."""
    low, high = 0.0, 4.0
    while largest_t_sf(np.array([high]), correlation, df)[0] > 1 - level:
        low, high = high, 2 * high
    for _ in range(40):
        middle = (low + high) / 2
        if largest_t_sf(np.array([middle]), correlation, df)[0] > 1 - level:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _reaches(correlation: Array) -> tuple[Array, int]:
    """Return the greatest |T_i| per unit length in every direction, and the dimension."""
    values, vectors = np.linalg.eigh(correlation)
    has_extent = values > SMALLEST_EIGENVALUE * values[-1]
    root = vectors[:, has_extent] * np.sqrt(values[has_extent])
    rank = int(has_extent.sum())
    if rank == 1:
        return np.abs(root).max(axis=0), rank
    if rank == 2:
        angle = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS * np.pi
        directions = np.stack([np.cos(angle), np.sin(angle)])
    else:
        from scipy.stats import qmc  # late: half a second that other adjustments need not pay

        points = qmc.Sobol(rank, rng=SEED).random(DIRECTIONS)
        directions = special.ndtri(points).T
        directions /= np.linalg.norm(directions, axis=0)
    return np.abs(root @ directions).max(axis=0), rank
