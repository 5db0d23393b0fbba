"""Bootstrap intervals: percentile, and bias-corrected and accelerated (BCa)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import special

from analysis.statistics.errors import StatisticsError, UnknownMethod
from analysis.statistics.inputs import sample
from analysis.statistics.results import Array, Interval, Provenance, Result, Row, number, percent

BootstrapMethod: TypeAlias = Literal["bca", "percentile"]


@dataclass(frozen=True)
class Bootstrap(Result):
    """A statistic with its bootstrap interval; `replicates` (n_replicates,) for a histogram."""

    estimate: float
    interval: Interval
    replicates: Array
    method: BootstrapMethod
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as text."""
        low, high = number(self.interval.low, 3), number(self.interval.high, 3)
        return (
            f"{number(self.estimate, 3)}, {percent(self.interval.level)} CI [{low}, {high}] "
            f"({self.method} bootstrap, {self.replicates.size} replicates, "
            f"n = {self.provenance.n})"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "estimate": self.estimate,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            **self.provenance.row(),
        }


def bootstrap_interval(
    values: npt.ArrayLike,
    rng: np.random.Generator,
    *,
    statistic: Callable[..., Any] = np.mean,
    n_replicates: int = 10_000,
    method: BootstrapMethod = "bca",
    level: float = 0.95,
    name: str = "sample",
) -> Bootstrap:
    """Resample values and return an interval of a statistic of them.

    `statistic` takes an array and `axis`, as NumPy's do. For pairs pass the differences; for
    participants with several trials pass one value per participant. BCa after Efron (1987).
    """
    if method not in ("bca", "percentile"):
        raise UnknownMethod(f"no bootstrap {method!r}; use 'bca' or 'percentile'")
    if n_replicates < 100:
        raise StatisticsError(f"{n_replicates} replicates are too few for an interval; use 2000")
    column = sample(values, name=name)
    n = column.size
    drawn = rng.integers(0, n, size=(n_replicates, n))
    replicates = np.asarray(statistic(column[drawn], axis=1), dtype=np.float64)
    estimate = float(statistic(column, axis=0))
    tails = np.array([(1 - level) / 2, (1 + level) / 2])
    if method == "bca":
        below = np.mean(replicates < estimate) + np.mean(replicates == estimate) / 2
        shift = float(special.ndtri(np.clip(below, 0.5 / n_replicates, 1 - 0.5 / n_replicates)))
        rows = np.array([np.delete(column, i) for i in range(n)])
        left_out = np.asarray(statistic(rows, axis=1), dtype=np.float64)
        away = left_out.mean() - left_out
        spread = float((away**2).sum()) ** 1.5
        acceleration = float((away**3).sum()) / (6 * spread) if spread > 0 else 0.0
        z = shift + special.ndtri(tails)
        tails = special.ndtr(shift + z / (1 - acceleration * z))
    low, high = np.quantile(replicates, tails)
    return Bootstrap(
        estimate, Interval(float(low), float(high), level), replicates, method,
        Provenance("bootstrap", int(n), unit="values", error_term=f"{method}, {n_replicates}"),
    )  # fmt: skip
