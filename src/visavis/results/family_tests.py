"""The tests of a family: pairs of levels compared, scores correlated, and a source's results.

Two levels are compared as in many reports of eye tracking: by a paired t test where Shapiro–Wilk
does not reject the normality of the differences, by Wilcoxon's signed-rank test otherwise. A family
shares its alpha (Bonferroni). Scores of questionnaires are correlated by Spearman's coefficient.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import factorial
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.special import stdtrit

from visavis.analysis.report.notation import count_of, decimal, fraction, signed, threshold
from visavis.analysis.statistics import (
    Correlation,
    PairedComparison,
    SignedRank,
    adjust_p,
    compare_paired,
    spearman,
)
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import Cell, Interval, p_text, percent
from visavis.lab.errors import DataError, UsageError
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import combinations_of
from visavis.study.declaration import Study
from visavis.study.measures import Measure, aggregate_cells
from visavis.study.pairs import Correlate, Family, Pairs, Printed

MIN_CORRELATED: Final = 4
"""Fewer participants are not correlated."""


@dataclass(frozen=True)
class TestRules:
    """Thresholds of testing; `analyse --set alpha=0.01` replaces one for a study's whole analysis.

    Raises:
        UsageError: a threshold is out of range.
    """

    __test__ = False  # not a test of pytest's
    alpha: float = 0.05
    normality_alpha: float = 0.05
    interval_level: float = 0.95
    minimum_participants: int = 3

    def __post_init__(self) -> None:
        for name in ("alpha", "normality_alpha", "interval_level"):
            if not 0 < getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a number between 0 and 1")
        if self.minimum_participants < 3:
            raise UsageError(
                f"minimum_participants is {self.minimum_participants}; a paired test needs 3"
            )

    def with_settings(self, settings: Mapping[str, Any]) -> "TestRules":
        """Return the rules with these settings in place of the defaults."""
        names = {f.name for f in fields(self)}
        return replace(self, **{k: v for k, v in settings.items() if k in names})


DEFAULT_TEST_RULES: Final = TestRules()


@dataclass(frozen=True)
class PairTest:
    """One paired test, `first` minus `second`, or why it could not be made.

    Means and standard deviations are over the `n_pairs` participants who have both values;
    `n_incomplete` others have one only. `where` names the level of `each`, or is empty.
    `outcome` None comes with `problem`. `interval` is that of the second mean minus the first (t),
    whichever test decides.
    """

    of: Pairs = field(repr=False)
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
    family: str = ""
    interval: Interval | None = None

    @property
    def name(self) -> str:
        """The comparison in short: 'A – D'."""
        return f"{self.first} – {self.second}"

    @property
    def threshold(self) -> float:
        """The value that p must stay below: alpha, shared by the tests of the family."""
        return self.alpha / max(self.n_tests, 1)

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

    @property
    def can_reach(self) -> bool | None:
        """Tell whether any data of this size could be significant; None when there was no test.

        The exact signed-rank test of n non-zero differences cannot go below p = 2/2ⁿ; a t test
        has no such bound.
        """
        if self.outcome is None:
            return None
        ranks = self.outcome.test
        if not isinstance(ranks, SignedRank) or ranks.method != "exact":
            return True
        return 2.0 / 2.0**ranks.n_nonzero < self.threshold

    @property
    def published_result(self) -> Printed | None:
        """The source's result of this test; None where it prints none."""
        return None if self.of.printed is None else self.of.printed(self)

    def which_way(self) -> str:
        """Return how far the second mean lies above or below the first, with its interval."""
        where = f" ({self.where.replace('_', ' ')})" if self.where else ""
        unit = f" {self.measure.unit}" if self.measure.unit not in ("", "1") else ""
        digits = max(self.measure.digits, 2) if not unit else self.measure.digits
        off = signed(self.second_mean - self.first_mean, digits)
        names = f"{self.of.level_words(self.second)} minus {self.of.level_words(self.first)}"
        between = self._bounds(self.interval, digits)
        return f"{self.measure.words.lower()}{where}, {names}: {off}{unit}{between}"

    def _bounds(self, interval: Interval | None, digits: int) -> str:
        if interval is None:
            return ""
        low, high = (signed(v, digits) for v in (interval.low, interval.high))
        return f", {percent(interval.level)} CI [{low}, {high}]"

    def sentence(self) -> str:
        """Return the conclusion with test, n, statistic, p, effect size and threshold."""
        what = self.measure.words + (f" ({self.where.replace('_', ' ')})" if self.where else "")
        noun = f" {self.of.noun}" if self.of.noun else ""
        names = f"{self.of.level_words(self.first)} and {self.of.level_words(self.second)}{noun}"
        if self.outcome is None:
            return f"{what}, {names}: not tested, {self.problem}."
        unit = f" {self.measure.unit}" if self.measure.unit not in ("", "1") else ""
        first, second = (
            decimal(m, self.measure.digits) + unit for m in (self.first_mean, self.second_mean)
        )
        verdict = "differs" if self.outcome.significant else "does not differ significantly"
        kind = "paired t test" if self.outcome.is_parametric else "Wilcoxon signed-rank test"
        incomplete = (
            f" ({count_of(self.n_incomplete, 'participant')} without both values)"
            if self.n_incomplete
            else ""
        )
        effect = str(self.outcome.effect).replace("r_rb", "rank-biserial r")
        eta = "" if self.outcome.eta is None else f", {self.outcome.eta}"
        difference_text = (
            f"{self.of.level_words(self.first)} minus {self.of.level_words(self.second)}"
        )
        return (
            f"{what} {verdict} between {names} ({first} and {second}{self._difference()}): "
            f"{kind} of {difference_text}, n = {self.n_pairs}{incomplete}, {self.statistic()}, "
            f"{p_text(self.outcome.p)}, {effect}{eta}; threshold "
            f"{threshold(self.threshold)} ({threshold(self.alpha)} over {self.n_tests} tests)."
        )

    def _difference(self) -> str:
        """Return the first mean minus the second with its interval, after the means."""
        if self.interval is None:
            return ""
        reversed_interval = Interval(-self.interval.high, -self.interval.low, self.interval.level)
        off = signed(self.first_mean - self.second_mean, self.measure.digits)
        return f", difference {off}{self._bounds(reversed_interval, self.measure.digits)}"

    def statistic(self) -> str:
        """Return V and z, or t with its degrees of freedom."""
        if self.outcome is None:
            return ""
        test = self.outcome.test
        if isinstance(test, SignedRank):
            ranked = f", {test.n_nonzero} ranked" if test.n_nonzero < self.n_pairs else ""
            return f"V = {decimal(test.V, 1)}, z = {decimal(test.z)}{ranked}"
        return f"t({test.df:.0f}) = {decimal(test.t)}"

    def row(self) -> dict[str, Cell]:
        """Return the test as one row of the statistics table."""
        row: dict[str, Cell] = {
            "family": self.family or self.of.family,
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


def printed_pair_tests(study: Study, of: Pairs) -> Iterator[PairTest]:
    """Yield the tests of a family whose result the source prints, each unmade (no people)."""
    measures, nan = {m.column: m for m in study.analysis.measures}, float("nan")
    n_tests = (len(of.levels) if "levels" in of.shared else 1) * (
        len(of.measures) if "measures" in of.shared else 1
    )
    for where in _levels_of_each(study, of.each):
        for pair in of.levels:
            for column in of.measures:
                test = PairTest(
                    of, where, measures[column], *pair, 0, 0, nan, nan, nan, nan, nan, n_tests, None
                )
                if test.published_result is not None:
                    yield test


def _levels_of_each(study: Study, each: str) -> tuple[str, ...]:
    """Return the levels of a factor or derived column; without one, an empty name."""
    if not each:
        return ("",)
    derive = study.design.derived.get(each)
    cells = combinations_of(study.design.factors)
    return tuple(dict.fromkeys(str(derive(c) if derive else c[each]) for c in cells))


@dataclass(frozen=True)
class CorrelationTest:
    """One correlation with a score, or why there is none.

    `p_adjusted` is Holm's over all `n_tests` correlations of the family that could be computed.
    """

    of: Correlate = field(repr=False)
    measure: Measure
    level: str
    n: int
    alpha: float
    outcome: Correlation | None
    problem: str = ""
    p_adjusted: float = float("nan")
    n_tests: int = 1

    @property
    def is_significant(self) -> bool | None:
        """Tell whether Holm's p stays below alpha: the decision of headlines, text and tables."""
        return None if self.outcome is None else self.p_adjusted < self.alpha

    @property
    def is_significant_alone(self) -> bool | None:
        """Tell whether p stays below alpha without correction, as sources often decide."""
        return None if self.outcome is None else self.outcome.p < self.alpha

    @property
    def direction(self) -> int:
        """The sign of the coefficient."""
        return 0 if self.outcome is None else int(np.sign(self.outcome.r))

    @property
    def can_reach(self) -> bool | None:
        """Tell whether any data of this size could be significant: exact p is at least 2/n!."""
        if self.outcome is None:
            return None
        smallest_p = self.n_tests * 2.0 / factorial(self.n)
        return self.outcome.method != "exact" or smallest_p < self.alpha

    @property
    def published_result(self) -> Printed | None:
        """The source's result of this test; None where it prints none."""
        return None if self.of.printed is None else self.of.printed(self)

    def which_way(self) -> str:
        """Return the coefficient and its level."""
        return f"{self.measure.words.lower()}, {self.level}: {self.coefficient()}"

    def coefficient(self) -> str:
        """Return Spearman's coefficient with its interval."""
        if self.outcome is None:
            return f"rs = {fraction(None)}"
        interval = self.outcome.interval
        between = ""
        if interval is not None:
            ends = ", ".join(fraction(v) for v in (interval.low, interval.high))
            between = f", {percent(interval.level)} CI [{ends}]"
        return f"rs = {fraction(self.outcome.r)}{between}"

    def sentence(self) -> str:
        """Return the conclusion with test, n, statistic, p, interval and threshold."""
        noun = f" {self.of.noun}" if self.of.noun else ""
        what = f"{self.measure.words} under {self.of.names.get(self.level, self.level)}{noun}"
        if self.outcome is None:
            return f"{what} and {self.of.score_words}: not tested, {self.problem}."
        verdict = "is" if self.is_significant else "is not significantly"
        return (
            f"{what} {verdict} correlated with {self.of.score_words}: Spearman, "
            f"{self.outcome.sentence()}; Holm-adjusted over {self.n_tests} tests "
            f"{p_text(self.p_adjusted)}, threshold {threshold(self.alpha)}."
        )

    def row(self) -> dict[str, Cell]:
        """Return the test as one row of the statistics table."""
        row: dict[str, Cell] = {
            "family": self.of.family,
            "where": "",
            "measure": self.measure.column,
            "first": self.level,
            "second": self.of.score,
            "n_pairs": self.n,
            "threshold": self.alpha,
            "problem": self.problem,
            "sentence": self.sentence(),
        }
        if self.outcome is not None:
            row |= {k: v for k, v in self.outcome.row().items() if k != "n"}
            row |= {
                "n_tests": self.n_tests,
                "p_adjusted": self.p_adjusted,
                "significant": self.is_significant,
            }
        return row


Test = PairTest | CorrelationTest


@dataclass(frozen=True)
class Agreement:
    """A published verdict compared with ours.

    `ours` None: not tested. `is_decidable` False: with so few participants the test could not
    reach its threshold, so it neither agrees nor disagrees. Verdicts agree when both are not
    significant, or both are in the same direction; the direction counts only where one is printed.
    """

    published_significant: bool
    ours: bool | None
    same_direction: bool = True
    is_decidable: bool = True

    @property
    def agrees(self) -> bool | None:
        """Tell whether the verdicts agree; None when there is none to compare."""
        if self.ours is None or not self.is_decidable:
            return None
        return self.published_significant == self.ours and (
            not self.published_significant or self.same_direction
        )


@dataclass(frozen=True)
class AgreementCount:
    """Numbers of verdicts that agree, that could be compared, and that are published."""

    agree: int
    comparable_count: int
    published_count: int

    def __str__(self) -> str:
        text = f"{self.agree} of {self.published_count}"
        left = self.published_count - self.comparable_count
        return f"{text} ({left} undecided)" if left else text


def agreement(test: Test) -> Agreement | None:
    """Compare a test's verdict with the source's; None where the source prints none.

    Of correlations, whose sources do not correct, the verdicts without correction are compared.
    """
    printed_result = test.published_result
    if printed_result is None:
        return None
    same = printed_result.direction in (0, test.direction)
    ours = test.is_significant
    if isinstance(test, CorrelationTest):
        test = replace(test, n_tests=1)
        ours = test.is_significant_alone
    return Agreement(printed_result.is_significant, ours, same, test.can_reach is not False)


def published_cells(test: Test) -> dict[str, Cell]:
    """Return the source's verdict and whether ours agrees, as cells of the statistics table."""
    verdicts = agreement(test)
    if verdicts is None:
        return {}
    return {
        "published_significant": verdicts.published_significant,
        "agrees_with_published": verdicts.agrees,
    }


def count_agreement(tests: Iterable[Test]) -> AgreementCount:
    """Count the verdicts that agree."""
    agreements = [a for a in map(agreement, tests) if a is not None]
    comparable = [a for a in agreements if a.agrees is not None]
    return AgreementCount(sum(bool(a.agrees) for a in comparable), len(comparable), len(agreements))


def compare(
    wide: pd.DataFrame,
    measure: Measure,
    pair: tuple[str, str],
    of: Pairs,
    rules: TestRules = DEFAULT_TEST_RULES,
    *,
    n_tests: int,
    where: str = "",
    family: str = "",
) -> PairTest:
    """Compare two levels over the participants who have both values.

    `wide` has one row per participant and one column per level.
    """
    first, second = (
        wide[c] if c in wide else pd.Series(float("nan"), index=wide.index) for c in pair
    )
    has_both = first.notna() & second.notna()
    incomplete = int((first.notna() ^ second.notna()).sum())
    x, y = first[has_both].to_numpy(float), second[has_both].to_numpy(float)
    outcome, problem = None, ""
    if len(x) < rules.minimum_participants:
        problem = (
            f"{count_of(len(x), 'participant')} with both values, "
            f"{rules.minimum_participants} needed"
        )
    else:
        try:
            outcome = compare_paired(
                x,
                y,
                names=pair,
                alpha=rules.alpha,
                n_tests=n_tests,
                normality_alpha=rules.normality_alpha,
                level=rules.interval_level,
            )
        except StatisticsError as error:
            problem = str(error)
    several = len(x) > 1
    return PairTest(
        of=of,
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
        alpha=rules.alpha,
        n_tests=n_tests,
        outcome=outcome,
        problem=problem,
        family=family,
        interval=_of_means(y - x, rules.interval_level) if outcome is not None else None,
    )


def _of_means(differences: npt.NDArray[np.float64], level: float) -> Interval:
    """Return the t interval of a mean difference."""
    n = differences.size
    half = float(stdtrit(n - 1, 0.5 + level / 2) * differences.std(ddof=1) / np.sqrt(n))
    middle = float(differences.mean())
    return Interval(middle - half, middle + half, level)


def with_level_names(
    rows: pd.DataFrame, names: Iterable[str], levels: Mapping[str, Sequence[Any]]
) -> pd.DataFrame:
    """Return rows whose factors and derived columns have the names of levels like 0.5, 1 and 2:
    tables hold them as 0.5, 1.0 and 2.0, which no test knew by name.
    """
    columns: dict[str, list[Any]] = {}
    for name in names:
        name_of = {level: str(level) for level in levels[name]}
        if len(set(map(type, name_of))) > 1:
            columns[name] = [name_of.get(value, value) for value in rows[name]]
    return rows.assign(**columns) if columns else rows


def compare_pairs(
    of: Pairs,
    trials: pd.DataFrame,
    measures: Mapping[str, Measure],
    levels: Mapping[str, Sequence[Any]],
    rules: TestRules = DEFAULT_TEST_RULES,
    *,
    family: str = "",
    only: Collection[tuple[tuple[str, str], str]] | None = None,
) -> tuple[PairTest, ...]:
    """Make every test of a family on the trials that count; `only` names some pairs and measures.

    `levels` are those of this design by factor or derived column. A pair with a level that the
    design leaves out is not tested: its result says so, and it takes no share of alpha.
    """
    family_measures = [measures[name] for name in of.measures]
    there = set(map(str, levels[of.factor]))
    places = [str(v) for v in levels[of.each]] if of.each else [""]
    possible = [pair for pair in of.levels if there >= set(pair)]
    sizes = {"measures": len(family_measures), "levels": len(possible), "each": len(places)}
    n_tests = int(np.prod([sizes[name] for name in of.shared]))
    names = (of.factor, *((of.each,) if of.each else ()))
    named_trials = with_level_names(trials, names, levels)
    means = aggregate_cells(named_trials, family_measures, list(names))
    tests = []
    for place in places:
        here = means[means[of.each].astype(str) == place] if of.each else means
        # once for all pairs: it takes longer than a test
        wide = {
            m.column: here.pivot(index="participant", columns=of.factor, values=m.column)
            for m in family_measures
        }
        for pair in of.levels:
            for measure in (m for m in family_measures if only is None or (pair, m.column) in only):
                test = compare(
                    wide[measure.column],
                    measure,
                    pair,
                    of,
                    rules,
                    n_tests=n_tests,
                    where=place,
                    family=family,
                )
                absent = " and ".join(level for level in pair if level not in there)
                if absent:
                    test = replace(
                        test, outcome=None, problem=f"the study was performed without {absent}"
                    )
                tests.append(test)
    return tuple(tests)


def scores_of(people: pd.DataFrame, column: str) -> "pd.Series[float]":
    """Return a score by participant; those without one are left out.

    Raises:
        DataError: a participant has two scores.
    """
    if people.empty or column not in people:
        return pd.Series(dtype=float)
    people_with_score = people.dropna(subset=[column])
    names = people_with_score["participant"].astype(str)
    if names.duplicated().any():
        twice = names[names.duplicated()].iloc[0]
        raise DataError(f"participant {twice} has two scores {column}; keep the valid one")
    return pd.Series(people_with_score[column].to_numpy(float), index=names.to_numpy()).sort_index()


def correlate(
    of: Correlate,
    means: pd.DataFrame,
    scores: "pd.Series[float]",
    measures: Mapping[str, Measure],
    levels: Sequence[Any],
    rules: TestRules = DEFAULT_TEST_RULES,
) -> tuple[CorrelationTest, ...]:
    """Correlate every measure at every level with the score.

    `means` has one row per participant and level.
    """
    correlations = [
        _correlate_at_level(of, means, scores, measures[name], str(level), rules)
        for name in of.measures
        for level in levels
    ]
    test_indices = [i for i, c in enumerate(correlations) if c.outcome is not None]
    if not test_indices:
        return tuple(correlations)
    holm_p = adjust_p([c.outcome.p for c in correlations if c.outcome is not None])
    for i, p in zip(test_indices, holm_p.tolist(), strict=True):
        correlations[i] = replace(correlations[i], p_adjusted=p, n_tests=len(test_indices))
    return tuple(correlations)


def _correlate_at_level(
    of: Correlate,
    means: pd.DataFrame,
    scores: "pd.Series[float]",
    measure: Measure,
    level: str,
    rules: TestRules,
) -> CorrelationTest:
    at_level = means[means[of.factor].astype(str) == level]
    here = at_level.set_index("participant")[measure.column].dropna()
    both = here.index.intersection(scores.index)
    n, alpha = len(both), rules.alpha
    min_people = max(MIN_CORRELATED, rules.minimum_participants)
    if n < min_people:
        problem = f"{count_of(n, 'participant')} with measure and score, {MIN_CORRELATED} needed"
        return CorrelationTest(of, measure, level, n, alpha, None, problem)
    try:
        outcome = spearman(
            scores[both].to_numpy(float),
            here[both].to_numpy(float),
            level=rules.interval_level,
            names=(of.score_name, measure.words),
        )
    except StatisticsError as error:
        return CorrelationTest(of, measure, level, n, alpha, None, str(error))
    return CorrelationTest(of, measure, level, n, alpha, outcome)


def results_of(
    of: Family,
    trials: pd.DataFrame,
    people: pd.DataFrame,
    measures: Mapping[str, Measure],
    levels: Mapping[str, Sequence[Any]],
    rules: TestRules = DEFAULT_TEST_RULES,
) -> tuple[Test, ...]:
    """Make every test of a family: pairs of levels, or correlations with a score."""
    if isinstance(of, Pairs):
        return compare_pairs(of, trials, measures, levels, rules)
    named_trials = with_level_names(trials, [of.factor], levels)
    means = aggregate_cells(named_trials, [measures[name] for name in of.measures], [of.factor])
    return correlate(of, means, scores_of(people, of.score), measures, levels[of.factor], rules)


def same_verdicts(first: Sequence[PairTest], second: Sequence[PairTest]) -> int:
    """Count the tests, in the same order, with the same verdict and direction."""
    return sum(
        a.is_significant == b.is_significant
        and (not a.is_significant or a.direction == b.direction)
        for a, b in zip(first, second, strict=True)
    )


def find_test(
    tests: Iterable[Test], measure: str, pair: tuple[str, str], where: str = ""
) -> PairTest:
    """Return the test of one measure between two levels.

    Raises:
        KeyError: it is not there.
    """
    for test in tests:
        if isinstance(test, PairTest) and test.measure.column == measure:
            if (test.first, test.second, test.where) == (*pair, where):
                return test
    raise KeyError(f"no test of {measure} between {pair[0]} and {pair[1]} {where}".strip())


def columns_of_tests(families: Iterable[Family]) -> dict[str, Column]:
    """Return the columns, by name, that describe tables of these families.

    They add to the columns of all tables of tests, or replace them.
    """
    all_families = list(families)
    kinds = {of.family: of.words for of in all_families}
    names = {level: name for of in all_families for level, name in of.names.items()}
    seconds = {
        **names,
        **{of.score: of.score_words for of in all_families if isinstance(of, Correlate)},
    }
    of_measure = "unit of the measure"
    columns = (
        Column("family", "", "tests made together", kinds),
        Column("where", "", "place at which the tests were made; empty: everywhere"),
        Column("first", "", "first level compared; the level in correlations", names),
        Column("second", "", "second level compared, or the score in correlations", seconds),
        Column("n_pairs", "1", "participants with both values"),
        Column("n_incomplete", "1", "participants with one value only"),
        Column("first_mean", of_measure, "mean of the first level over the pairs"),
        Column("first_sd", of_measure, "standard deviation of the first level"),
        Column("second_mean", of_measure, "mean of the second level over the pairs"),
        Column("second_sd", of_measure, "standard deviation of the second level"),
        Column("n_tests", "1", "tests that share alpha (Bonferroni; correlations: Holm)"),
        Column("problem", "", "why there was no test; empty: there was"),
        Column("estimate", of_measure, "mean (t) or median (Wilcoxon) of first minus second"),
        Column("effect", "", "name of the effect size, first minus second",
               {"dz": "standardised mean difference", "r_rb": "rank-biserial correlation"}),
        Column("eta_p2_ci_low", "1", "lower end of the confidence interval of eta_p2"),
        Column("eta_p2_ci_high", "1", "upper end of it"),
        Column("p_adjusted", "1", "p after correction: Bonferroni; correlations: Holm"),
        Column("significant", "", "after correction; headlines and sentences say the same"),
        Column("stars", "", "level reached after correction",
               {"*": "alpha", "**": "a fifth of it", "***": "a fiftieth of it"}),
        Column("r", "1", "Spearman's coefficient"),
    )  # fmt: skip
    return {c.name: c for c in columns}
