"""Effect sizes with noncentral intervals, widened for long tails, or named approximate ones."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import Array, Effect, Interval

HUGE_NONCENTRALITY = 1e6
"""Noncentrality beyond which only the error's χ² still matters and SciPy's functions give up."""

LONG_TAILS_EXPECTED = 12.0
"""Excess kurtosis that is reckoned with before values are seen (exponential ones have 6)."""
PEOPLE_EXPECTED = 20
"""How many people that expectation counts like."""
KURTOSIS_UNSEEN = 6.0
"""By how much samples of 8 to 100 people understate the kurtosis of long-tailed values."""
SKEWNESS_UNSEEN = 2.5
"""By how much they understate the skewness."""
AWAY_FROM_ZERO = 0.7
"""Share of the widening on the side away from zero: an SD without its tail exaggerates effects."""

JACKKNIFE_SHORT = 1.1
"""By how much the jackknife's error falls short of that of long-tailed values of 8 to 40 people."""


@dataclass(frozen=True)
class Tails:
    """How much longer tails than a normal distribution's are to be reckoned with.

    `kurtosis` is the excess kurtosis of the values whose SD is divided by, `cases` how many
    independent ones (people) there are, `skewness` that of values whose own mean is divided: their
    mean and their SD err together.
    """

    kurtosis: float
    cases: int
    skewness: float = 0.0


def tails_of(
    scores: Array, *, of_differences: bool = False, of_one_mean: bool = False, people: int = 0
) -> Tails:
    """Return the tails of values around their means, (n,) or (n, q) of n people.

    `people` says how many there are where a person has several rows; `of_one_mean` that the effect
    is the mean of just these values over their SD, and not a difference between groups.

    Few people seldom show the tails that their measure has, so what they show is counted
    `KURTOSIS_UNSEEN` times and averaged with an expectation, which is half as large for differences
    of two conditions (`of_differences`), as the kurtosis of a difference is. Constants were chosen
    on lognormal values (`python -m benchmarks.interval_coverage`).
    """
    rows = scores.reshape(len(scores), -1)
    squares = np.einsum("ij,ij->i", rows, rows)
    n = len(rows)
    mean = float(squares.sum()) / n
    expected = LONG_TAILS_EXPECTED / (2 if of_differences else 1)
    excess = skewness = 0.0
    if mean > 0:
        shares = squares / mean  # whose squares are numbers, however small the values
        excess = rows.shape[1] * (float(np.vdot(shares, shares)) / n - 1) - 2
        skewness = float((scores**3).mean() / mean**1.5) if of_one_mean else 0.0
    total = PEOPLE_EXPECTED * expected + n * KURTOSIS_UNSEEN * max(excess, 0.0)
    return Tails(total / (PEOPLE_EXPECTED + n), people or n, SKEWNESS_UNSEEN * skewness)


def widened(
    value: float, low: float, high: float, *, share: float, tails: Tails
) -> tuple[float, float]:
    """Return the ends of a standardised effect's interval, widened for long tails.

    The error of an effect f (the root of explained over unexplained variance, `share`) has a part
    f²(kurtosis + 2)/4 from the SD that it is divided by, of which normal values have f²/2, and one
    of −f·skewness where mean and SD err together. No effect has no such parts, so an interval
    without zero stays without it.
    """
    if not np.isfinite(share):
        return low, high
    together = max(0.0, -np.sign(value) * tails.skewness) * share
    error = 1 + share**2 * (tails.kurtosis + 2) / 4 + together
    wider = math.sqrt(error / (1 + share**2 / 2))
    outward = 1 + AWAY_FROM_ZERO * (wider - 1)
    below, above = (wider, outward) if value >= 0 else (outward, wider)
    centre = min(max(value, low), high)
    ends = centre - below * (centre - low), centre + above * (high - centre)
    return max(ends[0], 0.0) if low > 0 else ends[0], min(ends[1], 0.0) if high < 0 else ends[1]


def partial_eta_squared(
    F: float,
    df1: float,
    df2: float,
    *,
    cases: float | None = None,
    tails: Tails | None = None,
    level: float = 0.95,
) -> Effect:
    """Return partial eta squared of an F test with the noncentral F interval (Steiger 2004).

    The bounds of the noncentrality λ are mapped by λ / (λ + cases), the share of variance in the
    population. `cases` are the independent values behind the error before means are taken out:
    the rows of groups, n (k − 1) of n people in k conditions. Left out it is df1 + df2 + 1, the
    rows of a one-way design. For a t test pass F = t², df1 = 1 and n. The interval takes residuals
    for normal unless `tails` says how long theirs are.
    """
    value = eta_squared_of_f(F, df1, df2)
    interval = eta_interval(F, df1, df2, cases=cases, level=level)
    # An F so small that not even no effect explains it has bounds of zero, which hold nothing.
    if interval.high <= 0:
        return Effect("η²p", value)
    if tails is not None and interval.low < 1:
        here, low, high = (_root_odds(v) for v in (value, interval.low, interval.high))
        low, high = widened(here, low, high, share=here, tails=tails)
        interval = Interval(_share_of_root_odds(max(low, 0.0)), _share_of_root_odds(high), level)
    return Effect("η²p", value, interval)


def eta_squared_of_f(F: float, df1: float, df2: float) -> float:
    """Return partial eta squared F·df1 / (F·df1 + df2)."""
    if np.isinf(F):
        return 1.0
    return float(F * df1 / (F * df1 + df2))


def eta_interval(
    F: float, df1: float, df2: float, *, cases: float | None = None, level: float = 0.95
) -> Interval:
    """Return the interval of partial eta squared from the noncentral F distribution."""
    if np.isinf(F):
        return Interval(1.0, 1.0, level)
    tails = (1 - (1 - level) / 2, (1 - level) / 2)
    if F * df1 > HUGE_NONCENTRALITY:
        bounds = [F * df1 * float(special.chdtri(df2, target)) / df2 for target in tails]
    else:
        # Both bounds are looked for from the same ends.
        @cache
        def share_below(nc: float) -> float:
            return float(special.ncfdtr(df1, df2, nc, F))

        bounds = [_solve_noncentrality(share_below, tail, F * df1) for tail in tails]
    rows = df1 + df2 + 1 if cases is None else cases
    low, high = (b / (b + rows) for b in bounds)
    return Interval(float(low), float(high), level)


def rank_effect(
    name: str, value: float, df: tuple[int, int], without_each: Array, *, level: float = 0.95
) -> Effect:
    """Return a share of rank variance (ε² of Kruskal-Wallis, Kendall's W) with its interval.

    Either is eta squared of the ranks, whose F (Conover's, Iman and Davenport's) has `df`; the
    interval is the noncentral one of that F, as if ranks were normal, up to twice as wide where
    the jackknife says so: `without_each` are the shares without each person. Where all ranks agree,
    or where F is smaller than chance makes it, there is none.
    """
    if value >= 1 - 1e-12:
        return Effect(name, value)
    F = value / (1 - value) * df[1] / df[0]
    plain = eta_interval(float(F), *df, level=level)
    if plain.high <= 0:
        return Effect(name, value)
    # On the scale of a standardised difference, on which the noncentral interval is nearly even.
    here, low, high = (_root_odds(v) for v in (value, plain.low, plain.high))
    own = jackknife_error(_roots_of_odds(without_each))
    normal = (high - low) / (2 * float(special.ndtri(0.5 + level / 2)))
    wider = float(np.clip(own / normal, 1.0, 2.0))
    lowest, highest = max(0.0, here - wider * (here - low)), here + wider * (high - here)
    interval = Interval(_share_of_root_odds(lowest), _share_of_root_odds(highest), level)
    return Effect(name, value, interval)


def jackknife_error(without_each: Array) -> float:
    """Return the standard error of a statistic from its values without each of n cases."""
    n = without_each.size
    if n == 0:
        return 0.0
    return float(np.sqrt((n - 1) / n * ((without_each - without_each.mean()) ** 2).sum()))


def at_least_jackknife(
    here: float, low: float, high: float, without_each: Array, level: float
) -> tuple[float, float]:
    """Return the ends of an interval, moved to where the jackknife puts them if that is wider.

    `without_each` are the values without each of n cases, on a scale on which errors are even. Of
    long-tailed values the jackknife's error is too small by `JACKKNIFE_SHORT`.
    """
    if not (np.isfinite(here) and np.isfinite(without_each).all()):
        return low, high
    reach = float(special.stdtrit(without_each.size - 1, 0.5 + level / 2))
    reach *= JACKKNIFE_SHORT * jackknife_error(without_each)
    return min(low, here - reach), max(high, here + reach)


def _roots_of_odds(shares: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    inside = np.clip(shares, 0, 1 - 1e-6)
    return np.asarray(np.sqrt(inside / (1 - inside)), dtype=np.float64)


def _root_odds(share: float) -> float:
    inside = min(max(share, 0.0), 1 - 1e-6)
    return math.sqrt(inside / (1 - inside))


def _share_of_root_odds(root: float) -> float:
    return root**2 / (1 + root**2)


def _solve_noncentrality(cdf: Callable[[float], float], target: float, start: float) -> float:
    """Find nc ≥ 0 with cdf(nc) = target for a cdf falling in nc; 0 when even nc = 0 is below.

    Illinois variant of regula falsi on the logit-free cdf: about ten evaluations.
    """
    low, f_low = 0.0, cdf(0.0) - target
    if f_low <= 0:
        return 0.0
    high = max(4.0, 2.0 * start)
    while (f_high := cdf(high) - target) > 0:
        low, f_low = high, f_high
        high *= 2
        if high > 1e8:
            raise StatisticsError("the noncentrality of this statistic is beyond what can be found")
    side = 0
    for _ in range(200):
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        if abs(high - low) < 1e-10 * (1 + high):
            break
        f_middle = cdf(middle) - target
        if abs(f_middle) < 1e-13:
            break
        if f_middle > 0:
            low, f_low = middle, f_middle
            if side == 1:
                f_high /= 2
            side = 1
        else:
            high, f_high = middle, f_middle
            if side == -1:
                f_low /= 2
            side = -1
    return float(middle)


def noncentral_t_bounds(t: float, df: float, *, level: float = 0.95) -> tuple[float, float]:
    """Return the noncentralities of which t is the upper and the lower tail quantile."""
    tail = (1 - level) / 2
    if t * t > HUGE_NONCENTRALITY:
        reach = sorted(t * float(special.chdtri(df, q) / df) ** 0.5 for q in (tail, 1 - tail))
        return reach[0], reach[1]

    def bound(target: float) -> float:
        step = max(1.0, abs(t) * 0.5)
        low, high = t - step, t + step
        while special.nctdtr(df, low, t) < target:
            low -= step
        while special.nctdtr(df, high, t) > target:
            high += step
        return low + _solve_noncentrality(
            lambda nc: float(special.nctdtr(df, low + nc, t)), target, (high - low) / 2
        )

    return bound(1 - tail), bound(tail)


def standardised_mean(
    name: str,
    t: float,
    df: float,
    scale: float,
    *,
    value: float,
    tails: Tails | None = None,
    level: float = 0.95,
) -> Effect:
    """Return a d with interval: the bounds of t's noncentrality times `scale` (1/√n or alike).

    They take residuals for normal unless `tails` says how long theirs are.
    """
    low, high = noncentral_t_bounds(t, df, level=level)
    if tails is not None:
        low, high = widened(t, low, high, share=abs(t) / tails.cases**0.5, tails=tails)
    return Effect(name, float(value), Interval(float(low * scale), float(high * scale), level))


def d_average(x: Array, y: Array) -> float:
    """Return the mean difference over the mean of the two standard deviations."""
    return float((x.mean() - y.mean()) / ((x.std(ddof=1) + y.std(ddof=1)) / 2))
