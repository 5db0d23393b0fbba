"""The studentized range: the distribution behind Tukey's tests."""

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import Array

_NODES = np.arange(-8.0, 9.01, 0.25)
_WEIGHTS = 0.25 * np.exp(-(_NODES**2) / 2) / np.sqrt(2 * np.pi)
_PHI = special.ndtr(_NODES)
KNOWN_SD_DF = 1e7
"""Degrees of freedom beyond which the SD counts as known; the density loses its digits there."""
_NEGLIGIBLE = 46.0
"""−log of the density, relative to its peak, beyond which the integral is cut (1e-20)."""


def studentized_range_sf(q: npt.ArrayLike, k: int, df: float) -> Array:
    """Return P(Q > q) of the range of k means over an independent SD with `df`, elementwise.

    Both integrals are trapezoid sums of analytic integrands (normal range inside, log of the SD
    outside), which converge exponentially: absolute error below 1e-12 for df ≥ 2.
    """
    if k < 2 or not df > 0:
        raise StatisticsError(f"a range needs two means and positive df, got k={k}, df={df}")
    flat = np.abs(np.asarray(q, dtype=np.float64)).ravel()
    shape = np.shape(q)
    if k == 2:
        two: Array = 2 * special.stdtr(df, -flat / np.sqrt(2))
        return np.reshape(two, shape)
    if df > KNOWN_SD_DF:
        return np.reshape(_range_tail(flat, k), shape)
    unique, back = np.unique(flat, return_inverse=True)
    t, weight = _log_sd_nodes(df)
    tails = _range_tail((unique[:, None] * np.exp(t)).ravel(), k).reshape(unique.size, t.size)
    values: Array = np.clip(tails @ weight, 0.0, 1.0)[back]
    return values.reshape(shape)


def studentized_range_quantile(level: float, k: int, df: float) -> float:
    """Return q with P(Q ≤ q) = level."""
    low, high = 0.0, 4.0
    while studentized_range_sf(high, k, df) > 1 - level:
        low, high = high, high * 2
    for _ in range(100):
        middle = (low + high) / 2
        if studentized_range_sf(middle, k, df) > 1 - level:
            low = middle
        else:
            high = middle
        if high - low < 1e-12 * high:
            break
    return (low + high) / 2


def _range_tail(w: Array, k: int) -> Array:
    """Return P(range of k standard normals > w); differences of powers keep small tails exact."""
    below = special.ndtr(_NODES - w[:, None])
    share_below = -np.expm1((k - 1) * np.log1p(-np.minimum(below / _PHI, 1 - 1e-16)))
    tail: Array = k * (share_below @ (_WEIGHTS * _PHI ** (k - 1)))
    return tail


def _log_sd_nodes(df: float) -> tuple[Array, Array]:
    """Return nodes of t = log(s) and their weights: density of s = χ/√df times step."""
    cut = _NEGLIGIBLE / df
    low, high = -min(cut + 0.5, np.sqrt(cut) + cut), np.sqrt(cut)
    step = min(0.12, 0.6 / np.sqrt(2 * df))
    t = np.linspace(low, high, max(24, int(np.ceil((high - low) / step))))
    log_density = (
        df * t
        - df * np.exp(2 * t) / 2
        + np.log(2.0)
        + df / 2 * np.log(df / 2)
        - special.gammaln(df / 2)
    )
    return t, np.exp(log_density) * (t[1] - t[0])
