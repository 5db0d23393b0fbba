"""Show that a difference is too small to matter: two one-sided tests."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import (
    Interval,
    Provenance,
    Result,
    Row,
    degrees,
    number,
    p_text,
    percent,
)
from visavis.analysis.statistics.t_tests import TTest, independent_t, one_sample_t, paired_t

BoundUnit: TypeAlias = Literal["raw", "sd"]


@dataclass(frozen=True)
class Equivalence(Result):
    """Outcome of two one-sided t tests (Schuirmann 1987).

    `p` is the larger of the two; `interval` has level 1 − 2α and lies inside the bounds exactly
    when p < α. Bounds and estimate are in the units of the data.
    """

    estimate: float
    low: float
    high: float
    t_low: float
    t_high: float
    df: float
    p_low: float
    p_high: float
    p: float
    interval: Interval
    alpha: float
    is_equivalent: bool
    difference: TTest
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        verdict = "equivalent" if self.is_equivalent else "not shown to be equivalent"
        weaker = self.t_low if self.p_low >= self.p_high else self.t_high
        # Of two groups, whether Welch's or Student's: "independent t (Welch)".
        _, is_named, kind = self.difference.provenance.test.partition(" (")
        kind = f", {kind.removesuffix(')')}" if is_named else ""
        return (
            f"{verdict} within [{number(self.low, 3)}, {number(self.high, 3)}]: "
            f"t({degrees(self.df)}) = {number(weaker)}, {p_text(self.p)} "
            f"(two one-sided tests{kind}), difference {number(self.estimate, 3)}, "
            f"{percent(self.interval.level)} CI "
            f"[{number(self.interval.low, 3)}, {number(self.interval.high, 3)}]"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "estimate": self.estimate,
            "bound_low": self.low,
            "bound_high": self.high,
            "t_low": self.t_low,
            "t_high": self.t_high,
            "df": self.df,
            "p": self.p,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            "is_equivalent": self.is_equivalent,
            **self.provenance.row(),
        }


def tost_paired(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    low: float,
    high: float,
    unit: BoundUnit = "raw",
    alpha: float = 0.05,
    names: tuple[str, str] = ("x", "y"),
) -> Equivalence:
    """Test whether the mean of x − y lies between `low` and `high`.

    `unit` "raw" gives the bounds in the units of the data, "sd" in standard deviations of the
    differences. The bounds are the smallest difference that matters, fixed before looking.
    """
    return _tost(paired_t(x, y, names=names, level=1 - 2 * alpha), low, high, unit, alpha)


def tost_one_sample(
    x: npt.ArrayLike,
    *,
    low: float,
    high: float,
    unit: BoundUnit = "raw",
    alpha: float = 0.05,
    name: str = "x",
) -> Equivalence:
    """Test whether the mean lies between `low` and `high` (in SD of the sample for "sd")."""
    return _tost(one_sample_t(x, name=name, level=1 - 2 * alpha), low, high, unit, alpha)


def tost_independent(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    low: float,
    high: float,
    unit: BoundUnit = "raw",
    equal_variances: bool = False,
    alpha: float = 0.05,
    names: tuple[str, str] = ("x", "y"),
) -> Equivalence:
    """Test whether two groups' means differ by between `low` and `high` (pooled SD for "sd")."""
    test = independent_t(x, y, names=names, equal_variances=equal_variances, level=1 - 2 * alpha)
    return _tost(test, low, high, unit, alpha)


def _tost(test: TTest, low: float, high: float, unit: BoundUnit, alpha: float) -> Equivalence:
    if not low < high:
        raise StatisticsError(f"the lower bound {low} must lie below the upper bound {high}")
    if not 0 < alpha < 0.5:
        raise StatisticsError(f"alpha must lie between 0 and .5, got {alpha}")
    scale = test.sd if unit == "sd" else 1.0
    low, high = low * scale, high * scale
    reach = (test.interval.high - test.interval.low) / 2
    se = reach / float(special.stdtrit(test.df, 1 - alpha))
    t_low, t_high = (test.estimate - low) / se, (test.estimate - high) / se
    p_low = float(special.stdtr(test.df, -t_low))
    p_high = float(special.stdtr(test.df, t_high))
    p = max(p_low, p_high)
    notes = (f"bounds {number(low, 3)} to {number(high, 3)}", *test.provenance.notes)
    return Equivalence(
        test.estimate,
        low,
        high,
        float(t_low),
        float(t_high),
        test.df,
        p_low,
        p_high,
        p,
        test.interval,
        alpha,
        bool(np.less(p, alpha)),
        test,
        Provenance(
            "equivalence, " + test.provenance.test,
            test.provenance.n,
            error_term=test.provenance.error_term,
            notes=notes,
        ),
    )
