"""Power: one-way ANOVA in closed form, and the bookkeeping of power by simulation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError, UnknownMethod
from visavis.analysis.statistics.results import Interval, Provenance, Result, Row, number, p_text

ProportionMethod: TypeAlias = Literal["wilson", "clopper-pearson"]
AdequacyRule: TypeAlias = Literal["estimate", "lower bound"]


@dataclass(frozen=True)
class OneWayPower(Result):
    """Power of a one-way between ANOVA: any of n per group, f and power follows from the rest.

    `n_per_group` may be fractional where it was solved for; `n_needed` is the whole number.
    """

    k: int
    n_per_group: float
    f: float
    alpha: float
    power: float
    provenance: Provenance

    @property
    def n_needed(self) -> int:
        """Participants per group, rounded up."""
        return int(np.ceil(self.n_per_group - 1e-9))

    def sentence(self) -> str:
        """Return the result as a sentence."""
        return (
            f"{self.k} groups of {self.n_needed} find f = {number(self.f)} with power "
            f"{number(self.power)} at α = {number(self.alpha)}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "k": self.k,
            "n_per_group": self.n_per_group,
            "f": self.f,
            "alpha": self.alpha,
            "power": self.power,
            **self.provenance.row(),
        }


def oneway_power(*, k: int, n_per_group: float, f: float, alpha: float = 0.05) -> OneWayPower:
    """Return the power of a one-way ANOVA with noncentrality k·n·f²."""
    return _result(k, n_per_group, f, alpha, _oneway(k, n_per_group, f, alpha))


def oneway_sample_size(*, k: int, f: float, power: float = 0.8, alpha: float = 0.05) -> OneWayPower:
    """Return the n per group (fractional) at which effect f reaches the power."""
    _check_power(power, alpha)
    n = _root(lambda v: _oneway(k, v, f, alpha) - power, 1 + 1e-9, "sample size")
    return _result(k, n, f, alpha, power)


def oneway_sensitivity(
    *, k: int, n_per_group: float, power: float = 0.8, alpha: float = 0.05
) -> OneWayPower:
    """Return the effect f that n per group find with the power."""
    _check_power(power, alpha)
    f = _root(lambda v: _oneway(k, n_per_group, v, alpha) - power, 0.0, "effect")
    return _result(k, n_per_group, f, alpha, power)


def proportion_interval(
    hits: int, trials: int, *, level: float = 0.95, method: ProportionMethod = "wilson"
) -> Interval:
    """Return the interval of a proportion: Wilson's score or Clopper and Pearson's exact one."""
    if not 0 <= hits <= trials or trials < 1:
        raise StatisticsError(f"{hits} of {trials} is not a proportion")
    tail = (1 - level) / 2
    if method == "clopper-pearson":
        low = special.betaincinv(hits, trials - hits + 1, tail) if hits else 0.0
        high = special.betaincinv(hits + 1, trials - hits, 1 - tail) if hits < trials else 1.0
        return Interval(float(low), float(high), level)
    if method != "wilson":
        raise UnknownMethod(f"no interval {method!r}; use 'wilson' or 'clopper-pearson'")
    z = float(special.ndtri(1 - tail))
    share = hits / trials
    centre = (share + z**2 / (2 * trials)) / (1 + z**2 / trials)
    reach = z / (1 + z**2 / trials)
    reach *= float(np.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2)))
    return Interval(max(0.0, centre - reach), min(1.0, centre + reach), level)


@dataclass(frozen=True)
class PowerPoint:
    """Simulated power at one number of participants, with its Monte-Carlo interval."""

    n: int
    hits: int
    replicates: int
    interval: Interval

    @property
    def power(self) -> float:
        """Share of replicates with a significant result."""
        return self.hits / self.replicates


@dataclass(frozen=True)
class PowerCurve(Result):
    """Power by number of participants, in rising order of n; `smallest` is None if none is
    adequate.
    """

    points: tuple[PowerPoint, ...]
    target: float
    rule: AdequacyRule
    smallest: int | None
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as a sentence."""
        if self.smallest is None:
            top = self.points[-1]
            return (
                f"no n up to {top.n} reaches power {number(self.target)} "
                f"(at {top.n}: {number(top.power)}, {top.interval})"
            )
        point = next(p for p in self.points if p.n == self.smallest)
        return (
            f"n = {point.n} is the smallest adequate number of participants: power "
            f"{number(point.power)}, {point.interval}, target {number(self.target)} "
            f"({self.rule}, {point.replicates} replicates)"
        )

    def rows(self) -> tuple[Row, ...]:
        """Return one flat table row per number of participants."""
        return tuple(
            {
                "n": p.n,
                "power": p.power,
                "ci_low": p.interval.low,
                "ci_high": p.interval.high,
                "hits": p.hits,
                "replicates": p.replicates,
                "is_smallest_adequate": p.n == self.smallest,
            }
            for p in self.points
        )

    def row(self) -> Row:
        """Return the smallest adequate n as one flat table row."""
        return {"smallest_n": self.smallest, "target": self.target, **self.provenance.row()}


def power_curve(
    hits: Mapping[int, tuple[int, int]],
    *,
    target: float = 0.8,
    level: float = 0.95,
    method: ProportionMethod = "wilson",
    rule: AdequacyRule = "estimate",
) -> PowerCurve:
    """Make a power curve from counts: n → (significant replicates, replicates).

    The smallest adequate n is the first from which power stays at or above `target` for all
    larger n simulated, so that one lucky point does not decide; `rule` "lower bound" applies this
    to the interval's lower end.
    """
    if not hits:
        raise StatisticsError("a power curve needs at least one number of participants")
    if rule not in ("estimate", "lower bound"):
        raise UnknownMethod(f"no rule {rule!r}; use 'estimate' or 'lower bound'")
    points = tuple(
        PowerPoint(n, h, r, proportion_interval(h, r, level=level, method=method))
        for n, (h, r) in sorted(hits.items())
    )
    smallest: int | None = None
    for point in reversed(points):
        if (point.power if rule == "estimate" else point.interval.low) < target:
            break
        smallest = point.n
    fewest = min(p.replicates for p in points)
    provenance = Provenance(
        "power by simulation", fewest, unit="replicates", error_term=f"{method} interval"
    )
    return PowerCurve(points, target, rule, smallest, provenance)


def _oneway(k: int, n: float, f: float, alpha: float) -> float:
    if k < 2 or n <= 1 or f < 0 or not 0 < alpha < 1:
        raise StatisticsError(
            f"no power for {k} groups of {n:g} with f = {f:g} at {p_text(alpha, 'alpha')}"
        )
    df1, df2 = k - 1, k * (n - 1)
    critical = float(special.fdtri(df1, df2, 1 - alpha))
    return float(1 - special.ncfdtr(df1, df2, k * n * f * f, critical))


def _check_power(power: float, alpha: float) -> None:
    if not alpha < power < 1:
        raise StatisticsError(f"power must lie between alpha ({alpha:g}) and 1, got {power:g}")


def _root(function: Callable[[float], float], low: float, what: str) -> float:
    """Find where a rising function crosses zero, from `low` upwards."""
    high = max(1.0, 2 * low)
    while function(high) < 0:
        low, high = high, high * 2
        if high > 1e7:
            raise StatisticsError(f"no {what} below {high:g} reaches this power")
    for _ in range(200):
        middle = (low + high) / 2
        if function(middle) < 0:
            low = middle
        else:
            high = middle
        if high - low < 1e-12 * high:
            break
    return (low + high) / 2


def _result(k: int, n: float, f: float, alpha: float, power: float) -> OneWayPower:
    provenance = Provenance(
        "power of a one-way ANOVA", int(np.ceil(k * n - 1e-9)), error_term="noncentral F"
    )
    return OneWayPower(k, n, f, alpha, power, provenance)
