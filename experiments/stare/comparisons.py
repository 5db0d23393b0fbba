"""Compare conditions within participants: one family of paired tests after another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.report.notation import counted, decimal, threshold
from analysis.statistics import PairedComparison, SignedRank, compare_paired
from analysis.statistics.errors import StatisticsError
from analysis.statistics.results import Cell, p_text
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.design import CONDITIONS
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import CONDITION_NAMES, MEASURES, Measure


@dataclass(frozen=True)
class Descriptive:
    """One measure in one condition over participants; `sd` NaN below two of them."""

    measure: Measure
    condition: str
    n: int
    mean: float
    sd: float


@dataclass(frozen=True)
class Comparison:
    """One paired test, `first` minus `second`, or why it could not be made.

    Means and standard deviations are over the `n_pairs` participants who have both values;
    `n_incomplete` others have one only. `where` names the place or zone, or is empty.
    `outcome` None comes with `problem`.
    """

    family: str
    where: str
    measure: Measure
    first: str
    second: str
    n_pairs: int
    n_incomplete: int
    first_mean: float
    first_sd: float
    second_mean: float
    second_sd: float
    alpha: float
    n_tests: int
    outcome: PairedComparison | None
    problem: str = ""

    @property
    def name(self) -> str:
        """The comparison in short: 'A – D'."""
        return f"{self.first} – {self.second}"

    @property
    def threshold(self) -> float:
        """What p must stay below."""
        return self.alpha / self.n_tests

    @property
    def is_significant(self) -> bool | None:
        """Tell whether the difference is significant; None when there was no test."""
        return None if self.outcome is None else self.outcome.significant

    @property
    def stars(self) -> str:
        """Return '', '*', '**' or '***' after correction; nothing when there was no test."""
        return "" if self.outcome is None else self.outcome.stars

    @property
    def direction(self) -> int:
        """+1 when the second mean is greater, −1 when smaller, 0 when equal or unknown."""
        difference = self.second_mean - self.first_mean
        return int(np.sign(difference)) if np.isfinite(difference) else 0

    def sentence(self) -> str:
        """Return the conclusion with test, n, statistic, p, effect size and threshold."""
        what = self.measure.label + (f" ({self.where.replace('_', ' ')})" if self.where else "")
        names = f"{CONDITION_NAMES[self.first]} and {CONDITION_NAMES[self.second]} gaze"
        if self.outcome is None:
            return f"{what}, {names}: not tested, {self.problem}."
        unit = f" {self.measure.unit}" if self.measure.unit else ""
        first, second = (
            decimal(m, self.measure.digits) + unit for m in (self.first_mean, self.second_mean)
        )
        verdict = "differs" if self.outcome.significant else "does not differ significantly"
        kind = "paired t test" if self.outcome.is_parametric else "Wilcoxon signed-rank test"
        incomplete = (
            f" ({counted(self.n_incomplete, 'participant')} without both values)"
            if self.n_incomplete
            else ""
        )
        effect = str(self.outcome.effect).replace("r_rb", "rank-biserial r")
        eta = "" if self.outcome.eta is None else f", {self.outcome.eta}"
        return (
            f"{what} {verdict} between {names} ({first} and {second}): {kind} of "
            f"{self.first} minus {self.second}, "
            f"n = {self.n_pairs}{incomplete}, {_statistic(self.outcome)}, "
            f"{p_text(self.outcome.p)}, {effect}{eta}; threshold "
            f"{threshold(self.threshold)} ({threshold(self.alpha)} over {self.n_tests} tests)."
        )

    def row(self) -> dict[str, Cell]:
        """Return the test as one row of the statistics table."""
        row: dict[str, Cell] = {
            "family": self.family,
            "where": self.where,
            "measure": self.measure.column,
            "first": self.first,
            "second": self.second,
            "n_pairs": self.n_pairs,
            "n_incomplete": self.n_incomplete,
            "first_mean": self.first_mean,
            "first_sd": self.first_sd,
            "second_mean": self.second_mean,
            "second_sd": self.second_sd,
            "n_tests": self.n_tests,
            "threshold": self.threshold,
            "problem": self.problem,
            "sentence": self.sentence(),
        }
        if self.outcome is not None:
            row |= {k: v for k, v in self.outcome.row().items() if k not in row and k != "n"}
            if self.outcome.eta is not None and self.outcome.eta.interval is not None:
                row["eta_p2_ci_low"] = self.outcome.eta.interval.low
                row["eta_p2_ci_high"] = self.outcome.eta.interval.high
        return row


def _statistic(outcome: PairedComparison) -> str:
    test = outcome.test
    if isinstance(test, SignedRank):
        return f"V = {decimal(test.V, 1)}, z = {decimal(test.z)}"
    return f"t({test.df:.0f}) = {decimal(test.t)}"


def condition_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant and condition: means over trials and `n_trials`.

    A mean leaves missing values out; it is missing when every trial's value is.
    """
    columns = [m.column for m in MEASURES]
    grouped = rows.groupby(["participant", "condition"], sort=True)
    means = grouped[columns].mean()
    means.insert(0, "n_trials", grouped.size())
    return means.reset_index()


def describe(means: pd.DataFrame) -> tuple[Descriptive, ...]:
    """Describe every measure in every condition over the participants who have it."""
    described = []
    for measure in MEASURES:
        for condition in CONDITIONS:
            values = means.loc[means["condition"] == condition, measure.column].dropna()
            described.append(
                Descriptive(
                    measure,
                    condition,
                    len(values),
                    float(values.mean()) if len(values) else float("nan"),
                    float(values.std(ddof=1)) if len(values) > 1 else float("nan"),
                )
            )
    return tuple(described)


def compare(
    means: pd.DataFrame,
    measure: Measure,
    pair: tuple[str, str],
    parameters: AnalysisParameters,
    *,
    family: str,
    n_tests: int,
    where: str = "",
) -> Comparison:
    """Compare two conditions over the participants who have both values.

    `means` has one row per participant and condition.
    """
    wide = means.pivot(index="participant", columns="condition", values=measure.column)
    first, second = (
        wide[c] if c in wide else pd.Series(float("nan"), index=wide.index) for c in pair
    )
    has_both = first.notna() & second.notna()
    incomplete = int((first.notna() ^ second.notna()).sum())
    x, y = first[has_both].to_numpy(float), second[has_both].to_numpy(float)
    outcome, problem = None, ""
    if len(x) < parameters.minimum_participants:
        problem = (
            f"{counted(len(x), 'participant')} with both values, "
            f"{parameters.minimum_participants} needed"
        )
    else:
        try:
            outcome = compare_paired(
                x,
                y,
                names=pair,
                alpha=parameters.alpha,
                n_tests=n_tests,
                normality_alpha=parameters.normality_alpha,
                level=parameters.interval_level,
            )
        except StatisticsError as error:
            problem = str(error)
    several = len(x) > 1
    return Comparison(
        family=family,
        where=where,
        measure=measure,
        first=pair[0],
        second=pair[1],
        n_pairs=len(x),
        n_incomplete=incomplete,
        first_mean=float(x.mean()) if len(x) else float("nan"),
        first_sd=float(x.std(ddof=1)) if several else float("nan"),
        second_mean=float(y.mean()) if len(y) else float("nan"),
        second_sd=float(y.std(ddof=1)) if several else float("nan"),
        alpha=parameters.alpha,
        n_tests=n_tests,
        outcome=outcome,
        problem=problem,
    )


def compare_conditions(
    means: pd.DataFrame, parameters: AnalysisParameters, *, family: str = "conditions"
) -> tuple[Comparison, ...]:
    """Make the thirty tests: five comparisons of six measures, one Bonferroni family."""
    n_tests = len(COMPARISONS) * len(MEASURES)
    return tuple(
        compare(means, measure, pair, parameters, family=family, n_tests=n_tests)
        for pair in COMPARISONS
        for measure in MEASURES
    )


def find(
    comparisons: Sequence[Comparison], measure: Measure, pair: tuple[str, str], where: str = ""
) -> Comparison:
    """Return the test of one measure between two conditions; KeyError when it is not there."""
    for c in comparisons:
        if c.measure == measure and (c.first, c.second) == pair and c.where == where:
            return c
    raise KeyError(f"no test of {measure.column} between {pair[0]} and {pair[1]} {where}".strip())
