"""The rank-biserial correlation with an interval that holds at large effects and small numbers.

An interval from the error under no effect is far too narrow where there is one. These are score
intervals: they hold every value whose own error makes the correlation at hand plausible. The error
at a value is that of normal samples shifted to it, which has no gap at ±1 (as Newcombe 2006 has it
for two groups, in a simpler model); where people at hand spread further, as in skewed or unequal
samples, it is widened to theirs.
"""

from functools import lru_cache

import numpy as np
from scipy import special

from visavis.analysis.statistics.effects import jackknife_error
from visavis.analysis.statistics.results import Array, Effect, Interval

SHIFTS = np.linspace(-6.0, 6.0, 1201)
"""Shifts of a normal sample, in SD, that are tried."""
MAX_WIDENING = 2.0
ALMOST_ONE = 0.98
"""Correlation from which people's own spread says nothing any more: hardly anybody differs."""


def matched_rank_biserial(d: Array, *, level: float = 0.95) -> Effect:
    """Return the matched rank-biserial correlation of non-zero differences (n,), n ≥ 1.

    It is (W+ − W−) / (W+ + W−), and estimates how much more often the sum of two people's
    differences is positive than negative. Its own error is the jackknife's over people.
    """
    n = d.size
    ordered = np.sort(d)
    # Σ_j sign(d_i + d_j) of every person; ranks of the signs of all pairs and of each one alone.
    signs = (n - np.searchsorted(ordered, -d, side="right")) - np.searchsorted(ordered, -d)
    total = (signs.sum() + np.sign(d).sum()) / 2
    value = float(total / (n * (n + 1) / 2))
    if n < 2:
        return Effect("r_rb", value, Interval(-1.0, 1.0, level))
    without = (total - signs) / (n * (n - 1) / 2)
    own_error = jackknife_error(without)
    expected, error = _of_one_sample(n)
    population = 2 * special.ndtr(np.sqrt(2) * SHIFTS) - 1
    return _score(value, population, expected, error, own_error, n - 1.0, level)


def groups_rank_biserial(x: Array, y: Array, *, level: float = 0.95) -> Effect:
    """Return the rank-biserial correlation of two groups, P(x > y) − P(x < y).

    Its own error is DeLong's (1988), from the spread of both groups' placements in the other.
    """
    m, n = x.size, y.size
    of_x, of_y = _placements(x, y), -_placements(y, x)
    value = float(of_x.mean())
    shares = np.array([of.var(ddof=1) / of.size if of.size > 1 else 0.0 for of in (of_x, of_y)])
    own_error = float(np.sqrt(shares.sum()))
    df = float(m + n - 2)
    if own_error > 0:
        df = shares.sum() ** 2 / (shares**2 / np.maximum([m - 1, n - 1], 1)).sum()
    p = special.ndtr(SHIFTS)
    both = p - 2 * special.owens_t(SHIFTS, np.sqrt(1 / 3))
    error = 2 * np.sqrt(np.maximum(p * (1 - p) + (m + n - 2) * (both - p**2), 0) / (m * n))
    return _score(value, 2 * p - 1, 2 * p - 1, error, own_error, df, level)


def _placements(x: Array, y: Array) -> Array:
    """Return for each of x the share of y below minus that above."""
    ordered = np.sort(y)
    below = np.searchsorted(ordered, x)
    above = y.size - np.searchsorted(ordered, x, side="right")
    return np.asarray((below - above) / y.size, dtype=np.float64)


@lru_cache(maxsize=64)
def _of_one_sample(n: int) -> tuple[Array, Array]:
    """Return mean and error of the correlation of n normal differences at every shift."""
    pairs = n * (n + 1) / 2
    one, two = special.ndtr(SHIFTS), special.ndtr(np.sqrt(2) * SHIFTS)
    # P(D1 + D2 > 0 and D1 + D3 > 0), and P(D1 > 0 and D1 + D2 > 0), by Owen's T.
    both = two - 2 * special.owens_t(np.sqrt(2) * SHIFTS, np.sqrt(1 / 3))
    alone = (one + two - one * (1 - one)) / 2
    variance = n * (n - 1) / 2 * (2 * (n - 2) * (both - two**2) + two * (1 - two))
    variance += n * one * (1 - one) + 2 * n * (n - 1) * (alone - one * two)
    mean = (n * (n - 1) / 2 * two + n * one) / pairs
    return 2 * mean - 1, 2 * np.sqrt(np.maximum(variance, 0)) / pairs


def _score(
    value: float,
    population: Array,
    expected: Array,
    error: Array,
    own_error: float,
    df: float,
    level: float,
) -> Effect:
    """Return all population values from which `value` lies at most t errors away."""
    here = float(np.interp(value, expected, error))
    widening = 1.0
    if abs(value) < ALMOST_ONE and here > 0:
        widening = float(np.clip(own_error / here, 1.0, MAX_WIDENING))
    reach = float(special.stdtrit(df, 0.5 + level / 2)) * widening * error
    slack = 1e-12
    low_at = int(np.argmax(expected + reach >= value - slack))
    high_at = population.size - 1 - int(np.argmax((expected - reach <= value + slack)[::-1]))
    low = -1.0 if value <= -1 + slack else _between(value, expected + reach, population, low_at, -1)
    high = 1.0 if value >= 1 - slack else _between(value, expected - reach, population, high_at, 1)
    return Effect("r_rb", value, Interval(min(low, value), max(high, value), level))


def _between(value: float, bound: Array, population: Array, at: int, side: int) -> float:
    """Return where a bound meets the value, between a shift and its neighbour on that side."""
    beside = at + side
    if not 0 <= beside < bound.size:
        return float(side)
    share = (value - bound[beside]) / (bound[at] - bound[beside])
    return float(population[beside] + np.clip(share, 0, 1) * (population[at] - population[beside]))
