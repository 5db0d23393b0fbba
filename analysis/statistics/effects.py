"""Effect sizes with exact (noncentral) or named approximate intervals."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import Array, Effect, Interval

HUGE_NONCENTRALITY = 1e6
"""Noncentrality beyond which only the error's χ² still matters and SciPy's functions give up."""


def partial_eta_squared(
    F: float, df1: float, df2: float, *, cases: float | None = None, level: float = 0.95
) -> Effect:
    """Return partial eta squared of an F test with the noncentral F interval (Steiger 2004).

    The bounds of the noncentrality λ are mapped by λ / (λ + cases), the share of variance in the
    population. `cases` are the independent values behind the error before means are taken out:
    the rows of groups, n (k − 1) of n people in k conditions. Left out it is df1 + df2 + 1, the
    rows of a one-way design. For a t test pass F = t², df1 = 1 and n.
    """
    interval = eta_interval(F, df1, df2, cases=cases, level=level)
    # An F so small that not even no effect explains it has bounds of zero, which hold nothing.
    return Effect("η²p", eta_squared_of_f(F, df1, df2), interval if interval.high > 0 else None)


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
        bounds = [
            _solve_noncentrality(lambda nc: float(special.ncfdtr(df1, df2, nc, F)), tail, F * df1)
            for tail in tails
        ]
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
    here, low, high = (float(_root_odds(np.float64(v))) for v in (value, plain.low, plain.high))
    own = jackknife_error(_root_odds(without_each))
    normal = (high - low) / (2 * float(special.ndtri(0.5 + level / 2)))
    wider = float(np.clip(own / normal, 1.0, 2.0))
    lowest, highest = max(0.0, here - wider * (here - low)), here + wider * (high - here)
    interval = Interval(lowest**2 / (1 + lowest**2), highest**2 / (1 + highest**2), level)
    return Effect(name, value, interval)


def jackknife_error(without_each: Array) -> float:
    """Return the standard error of a statistic from its values without each of n cases."""
    n = without_each.size
    if n == 0:
        return 0.0
    return float(np.sqrt((n - 1) / n * ((without_each - without_each.mean()) ** 2).sum()))


def _root_odds(share: npt.NDArray[np.float64] | np.float64) -> npt.NDArray[np.float64]:
    inside = np.clip(share, 0, 1 - 1e-6)
    return np.asarray(np.sqrt(inside / (1 - inside)), dtype=np.float64)


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
    name: str, t: float, df: float, scale: float, *, value: float, level: float = 0.95
) -> Effect:
    """Return a d with interval: the bounds of t's noncentrality times `scale` (1/√n or alike)."""
    low, high = noncentral_t_bounds(t, df, level=level)
    return Effect(name, float(value), Interval(float(low * scale), float(high * scale), level))


def d_average(x: Array, y: Array) -> float:
    """Return the mean difference over the mean of the two standard deviations."""
    return float((x.mean() - y.mean()) / ((x.std(ddof=1) + y.std(ddof=1)) / 2))
