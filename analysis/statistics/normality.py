"""Test a sample for normality and measure its skewness."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.inputs import sample
from visavis.analysis.statistics.results import Array, Provenance, Result, Row, number, p_text


@dataclass(frozen=True)
class ShapiroWilk(Result):
    """Outcome of the Shapiro-Wilk test of normality."""

    W: float
    p: float
    n: int
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return f"W = {number(self.W, 3)}, {p_text(self.p)}, n = {self.n}"

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {"W": self.W, "p": self.p, **self.provenance.row()}


def shapiro_wilk(values: npt.ArrayLike, *, name: str = "sample") -> ShapiroWilk:
    """Test normality after Shapiro and Wilk (Royston's 1995 algorithm), n from 3 to 5000."""
    column = sample(values, name=name)
    if column.size > 5000:
        raise StatisticsError(
            f"{name} has {column.size} values; Shapiro-Wilk p values hold up to 5000"
        )
    from scipy import stats  # late: half a second that other tests need not pay

    outcome = stats.shapiro(column)
    return ShapiroWilk(
        float(outcome.statistic),
        float(outcome.pvalue),
        int(column.size),
        Provenance("Shapiro-Wilk", int(column.size), unit="values"),
    )


def skewness(values: Array) -> float:
    """Return the adjusted Fisher-Pearson skewness; 0 for a sample without spread."""
    n = values.size
    about_mean = values - values.mean()
    m2 = float((about_mean**2).mean())
    if n < 3 or m2 <= 1e-24 * max(1e-300, float(np.abs(values).max()) ** 2):
        return 0.0
    return float((about_mean**3).mean() / m2**1.5 * np.sqrt(n * (n - 1)) / (n - 2))


def excess_kurtosis(values: Array) -> float:
    """Return how much longer the tails are than normal ones (0); 0 without spread."""
    about_mean = values - values.mean()
    m2 = float((about_mean**2).mean())
    if m2 <= 1e-24 * max(1e-300, float(np.abs(values).max()) ** 2):
        return 0.0
    return float((about_mean**4).mean() / m2**2 - 3)
