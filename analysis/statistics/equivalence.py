"""Show that a difference is too small to matter: two one-sided tests."""

from dataclasses import dataclass
from math import comb
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import ConstantResponse, StatisticsError, option_text
from visavis.analysis.statistics.inputs import differences, paired, sample
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
    when p < α. Bounds and estimate are in the units of the data. Where nothing varies there is no
    t: then `is_exact` says that both tests are exact ones of signs, or of ranks of two groups, and
    t, df and `difference` are infinite, NaN and None.
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
    difference: TTest | None
    provenance: Provenance

    @property
    def is_exact(self) -> bool:
        """Tell whether nothing varied, so that exact tests stand in for t."""
        return self.difference is None

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        verdict = "equivalent" if self.is_equivalent else "not shown to be equivalent"
        if self.difference is None:
            return (
                f"{verdict} within [{number(self.low, 3)}, {number(self.high, 3)}]: the difference "
                f"is {number(self.estimate, 3)} without exception, {p_text(self.p)} "
                f"({self.provenance.test.partition(', ')[2]})"
            )
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
            "t_low": None if self.is_exact else self.t_low,
            "t_high": None if self.is_exact else self.t_high,
            "df": None if self.is_exact else self.df,
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
    try:
        test = paired_t(x, y, names=names, level=1 - 2 * alpha)
    except ConstantResponse:
        always = differences(*paired(x, y, names=names))
        return _of_signs(float(always[0]), always.size, low, high, unit, alpha)
    return _tost(test, low, high, unit, alpha)


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
    try:
        test = one_sample_t(x, name=name, level=1 - 2 * alpha, for_skew=False)
    except ConstantResponse:
        always = sample(x, name=name, vary=False)
        return _of_signs(float(always[0]), always.size, low, high, unit, alpha)
    return _tost(test, low, high, unit, alpha)


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
    try:
        test = independent_t(
            x, y, names=names, equal_variances=equal_variances, level=1 - 2 * alpha
        )
    except ConstantResponse:
        first, second = (sample(v, name=n, vary=False) for v, n in zip((x, y), names, strict=True))
        sizes = first.size, second.size
        chance = 1 / comb(sum(sizes), sizes[0])
        how = "exact rank-sum tests against both bounds"
        estimate, n = float(first[0] - second[0]), sum(sizes)
        return _exact(estimate, n, chance, how, (low, high), unit, alpha)
    return _tost(test, low, high, unit, alpha)


def _of_signs(
    estimate: float, n: int, low: float, high: float, unit: BoundUnit, alpha: float
) -> Equivalence:
    """Test n differences that are all the same: each lies on one side of a bound, or on it."""
    how = "exact sign tests against both bounds"
    return _exact(estimate, n, 0.5**n, how, (low, high), unit, alpha)


def _exact(
    estimate: float,
    n: int,
    chance: float,
    how: str,
    bounds: tuple[float, float],
    unit: BoundUnit,
    alpha: float,
) -> Equivalence:
    """Return the outcome where nothing varies; `chance` is p of all values beyond a bound."""
    low, high = bounds
    _refuse_bounds(low, high, alpha)
    if unit == "sd":
        raise ConstantResponse(
            f"the difference is {estimate:g} without exception, so bounds in its standard "
            f"deviation have no size; give them in the unit of the data, "
            + option_text("unit", "raw")
        )
    p_low, p_high = (chance if inside else 1.0 for inside in (estimate > low, estimate < high))
    p = max(p_low, p_high)
    far = float("inf")
    return Equivalence(
        estimate,
        low,
        high,
        far if estimate > low else -far,
        far if estimate > high else -far,
        float("nan"),
        p_low,
        p_high,
        p,
        Interval(estimate, estimate, 1 - 2 * alpha),
        alpha,
        bool(np.less(p, alpha)),
        None,
        Provenance(
            f"equivalence, {how}",
            n,
            error_term="none: nothing varies",
            notes=(
                f"bounds {number(low, 3)} to {number(high, 3)}",
                "nothing varies, so that t has no error: exact tests take its place",
            ),
        ),
    )


def _refuse_bounds(low: float, high: float, alpha: float) -> None:
    if not low < high:
        raise StatisticsError(f"the lower bound {low} must lie below the upper bound {high}")
    if not 0 < alpha < 0.5:
        raise StatisticsError(f"alpha must lie between 0 and .5, got {alpha}")


def _tost(test: TTest, low: float, high: float, unit: BoundUnit, alpha: float) -> Equivalence:
    _refuse_bounds(low, high, alpha)
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
