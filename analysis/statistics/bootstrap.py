"""Bootstrap intervals: percentile, and bias-corrected and accelerated (BCa)."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import StatisticsError, UnknownMethod
from visavis.analysis.statistics.inputs import sample
from visavis.analysis.statistics.results import (
    Array,
    Interval,
    Provenance,
    Result,
    Row,
    number,
    percent,
)

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
    participants with several trials pass one value per participant. BCa after Efron (1987), by
    SciPy.
    """
    if method not in ("bca", "percentile"):
        raise UnknownMethod(f"no bootstrap {method!r}; use 'bca' or 'percentile'")
    if n_replicates < 100:
        raise StatisticsError(f"{n_replicates} replicates are too few for an interval; use 2000")
    column = sample(values, name=name)
    from scipy import stats  # late: half a second that tables need not pay

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an interval that cannot be had is refused below
        resampling = stats.bootstrap(
            (column,),
            statistic,
            n_resamples=n_replicates,
            confidence_level=level,
            method="BCa" if method == "bca" else "percentile",
            vectorized=True,
            rng=rng,
        )
    low, high = (float(bound) for bound in resampling.confidence_interval)
    if not (np.isfinite(low) and np.isfinite(high)):
        raise StatisticsError(
            f"leaving out one value of {name} at a time never changes the statistic, so it has no "
            "BCa interval; pass method='percentile'"
        )
    return Bootstrap(
        float(statistic(column, axis=0)),
        Interval(low, high, level),
        np.asarray(resampling.bootstrap_distribution, dtype=np.float64),
        method,
        Provenance(
            "bootstrap", int(column.size), unit="values", error_term=f"{method}, {n_replicates}"
        ),
    )
