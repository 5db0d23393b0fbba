"""From the rows of a study's trials to cell means and an answer to each comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import pandas as pd

from visavis.analysis.report.notation import count_of
from visavis.analysis.statistics import adjust_p
from visavis.analysis.statistics_report import answer
from visavis.lab.errors import DataError, LabError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.steps import Scalar
from visavis.recording.reader import Recording
from visavis.recording.remarks import Remark
from visavis.results.differences import as_planned_sided
from visavis.results.family_tests import (
    DEFAULT_TEST_RULES,
    CorrelationTest,
    PairTest,
    Test,
    TestRules,
    compare_pairs,
    results_of,
    with_level_names,
)
from visavis.results.findings import Finding, Term
from visavis.results.planned_tests import primary_tests
from visavis.results.selection import Selection
from visavis.results.sensitivity import SensitivityRow, sensitivity
from visavis.study.comparisons import AGREEMENT, THING, Compare
from visavis.study.conditions import Groups, columns_asked, condition_of, with_people
from visavis.study.declaration import Study
from visavis.study.look_measures import MAIN_MEASURES
from visavis.study.measures import Measure, aggregate_cells, count_column, whom
from visavis.study.pairs import Family, Pairs
from visavis.study.responses import Rating
from visavis.study.sections import Conclusion

SIMULATED_COLUMN: Final = "is_simulated"
DECIDING: Final = ("p_used", "p_above", "p")
"""Columns of a test's row that may hold the p that decides; the first one present does."""
MIN_PARTICIPANTS: Final = 3
"""Fewer participants are not tested."""


@dataclass(frozen=True)
class Results:
    """The tests of one family."""

    of: Family
    tests: tuple[Test, ...] = field(repr=False)


@dataclass(frozen=True)
class StudyAnalysis:
    """Everything the analysis of a study found.

    `results` are those of its families of tests, made by `rules`. Two fields repeat the first
    family of pairs and are empty where there is none: `without_rules` on every finished trial,
    `sensitivity` by padding and minimum duration of looks.
    """

    study: Study
    is_simulated: bool
    selection: Selection
    people: pd.DataFrame = field(repr=False)
    levels: Mapping[str, tuple[Scalar, ...]]
    measures: tuple[Measure, ...]
    findings: tuple[Finding, ...]
    cells: tuple[str, ...]
    """The factors whose combinations tables describe."""
    results: tuple[Results, ...] = ()
    without_rules: tuple[PairTest, ...] = field(default=(), repr=False)
    sensitivity: tuple[SensitivityRow, ...] = field(default=(), repr=False)
    rules: TestRules = DEFAULT_TEST_RULES
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict, repr=False)
    """Further tables of the study by name."""
    thresholds: Any = None
    """Thresholds of the study's own analysis: `Study.thresholds` with the settings in force."""
    how: Any = None
    """How trials were measured one by one."""
    further: Any = field(default=None, repr=False)
    """Further findings of the study's own; None in a power analysis."""
    example: Recording | None = field(default=None, repr=False)
    """A session from which sections may show a trial."""

    remarks: tuple[Remark, ...] = ()
    """What was noted or excluded by hand after the sessions."""

    @property
    def n_participants(self) -> int:
        """Participants with trials that count."""
        return int(self.selection.counted["participant"].nunique())

    @property
    def measured_by(self) -> str:
        """How trials were measured one by one ("rule volume, surface fine"); else nothing."""
        pieces = self.study.analysis.measured_in_pieces
        if pieces is None or self.how is None:
            return ""
        return ", ".join(f"{name} {getattr(self.how, name)}" for name in pieces.kept_by)

    def rows_of(self, compare: Compare, trials: pd.DataFrame) -> pd.DataFrame:
        """Return the trials that a comparison is about, with the columns that it names."""
        groups = self.study.analysis.groups
        return compare.select(rows_to_compare(compare, trials, self.people, groups))

    def measure(self, column: str) -> Measure:
        """Return a measure by its column."""
        return next(m for m in self.measures if m.column == column)

    def finding(self, column: str) -> Finding | None:
        """Return what came of the first comparison of a measure; None where there is none."""
        return next((f for f in self.findings if f.compare.dv == column), None)

    def families(self) -> tuple[str, ...]:
        """Return the names of the families of tests that were made."""
        return tuple(dict.fromkeys(r.of.family for r in self.results))

    def tests_of(self, family: str) -> tuple[Test, ...]:
        """Return the tests of a family."""
        return tuple(t for r in self.results if r.of.family == family for t in r.tests)

    def pairs_of(self, family: str) -> tuple[PairTest, ...]:
        """Return the paired tests of a family."""
        return tuple(t for t in self.tests_of(family) if isinstance(t, PairTest))

    def correlations_of(self, family: str) -> tuple[CorrelationTest, ...]:
        """Return the correlations of a family."""
        return tuple(t for t in self.tests_of(family) if isinstance(t, CorrelationTest))

    @property
    def primary(self) -> tuple[str, ...]:
        """The names of the study's primary claims (`primary_tests`)."""
        return primary_tests(self.study, [f.compare for f in self.findings])

    @property
    def conclusions(self) -> tuple[Conclusion, ...]:
        """The study's own answers to its questions."""
        of = self.study.analysis.conclude_of
        return () if of is None else tuple(of(self))

    def cell_means(self) -> pd.DataFrame:
        """Return one row per participant and cell, levels in their order, with every measure."""
        means = aggregate_cells(self.selection.counted, self.measures, self.cells)
        order = {f: {level: i for i, level in enumerate(self.levels[f])} for f in self.cells}
        sorted_means: pd.DataFrame = means.sort_values(
            ["participant", *self.cells],
            key=lambda c: c if c.name == "participant" else c.map(order[str(c.name)]),
            ignore_index=True,
        )
        return sorted_means


def measures_of(study: Study, responses: Mapping[str, Any]) -> tuple[Measure, ...]:
    """Return a study's measures: its own, and every answer that is a number, share or time, and
    every distance at one.
    """
    measures = {m.column: m for m in study.analysis.measures}
    for name, response in responses.items():
        words = name.replace("_", " ").capitalize()
        if response.aggregate == "mean":
            ends = (response.low, response.high) if isinstance(response, Rating) else None
            unit = getattr(response, "unit", "1")
            measures.setdefault(name, Measure(name, unit, words, scale=ends))
        if getattr(response, "right", None) is not None and response.aggregate == "share":
            right = f"{name}_is_right"
            measures.setdefault(right, Measure(right, "1", f"{words} right", None, "share"))
        if (role := getattr(response, "distance_to", None)) is not None:
            far, of_whom = f"{name}_distance_m", f"Distance to {whom(role)} at {words.lower()}"
            measures.setdefault(far, Measure(far, "m", of_whom))
        measures.setdefault(
            f"{name}_ms",
            Measure(f"{name}_ms", "ms", f"Time to answer {name.replace('_', ' ')}", None, "median"),
        )
    return tuple(measures.values())


@dataclass(frozen=True)
class AnalysisInForce:
    """What a study's analysis goes by, once its parameters and settings are in force."""

    levels: Mapping[str, tuple[Scalar, ...]]
    """The levels of every factor, in their order."""
    measures: Sequence[Measure]
    """What was measured."""
    cells: Sequence[str] = ()
    """The factors whose combinations tables describe; all that have levels if left out."""
    compare: Sequence[Compare] | None = None
    """The comparisons that this design can make; all of the study if left out."""
    rules: TestRules = DEFAULT_TEST_RULES
    """How families of tests decide."""
    thresholds: Any = None
    """Thresholds of the study's own analysis."""
    how: Any = None
    """How trials were measured one by one."""
    level_words: Mapping[str, str] | None = None
    """What sentences call levels; their names if left out."""


def analyse_rows(
    study: Study,
    selection: Selection,
    people: pd.DataFrame,
    in_force: AnalysisInForce,
    *,
    is_simulated: bool,
    sensitivity_rows: pd.DataFrame | None = None,
    tables: Mapping[str, pd.DataFrame] | None = None,
) -> StudyAnalysis:
    """Answer every planned comparison and make every family of tests; untested ones say why.

    `sensitivity_rows` holds the main measures of looks by padding and minimum duration, where there
    are any; `tables` are further ones for sections and further findings.

    Raises:
        DataError: no trial counts.
    """
    if selection.counted.empty:
        why = "; ".join(f"{left.count} {left.level}s: {left.words}" for left in selection.left)
        raise DataError(
            f"no trial of {study.name} counts ({why or 'there is none'}); nothing can be analysed"
        )
    groups = study.analysis.groups
    levels = {**in_force.levels, **{group: tuple(of) for group, of in groups.items()}}
    by_column = {m.column: m for m in in_force.measures}
    comparisons = study.analysis.compare if in_force.compare is None else in_force.compare
    findings = [
        answer_comparison(
            c,
            rows_to_compare(c, selection.counted, people, groups),
            by_column,
            levels,
            is_simulated=is_simulated,
            level_words=in_force.level_words,
        )
        for c in comparisons
    ]
    analysis = StudyAnalysis(
        study,
        is_simulated,
        selection,
        people,
        levels,
        tuple(in_force.measures),
        with_corrected_p(findings),
        tuple(in_force.cells or in_force.levels),
        rules=in_force.rules,
        tables=tables or {},
        thresholds=in_force.thresholds,
        how=in_force.how,
    )
    # Families need the measures' names, and further findings may read the families.
    analysis = _with_families(analysis, by_column, sensitivity_rows)
    further_of = study.analysis.further_of
    return analysis if further_of is None else replace(analysis, further=further_of(analysis))


def columns_of(compare: Compare, groups: Groups) -> tuple[str, ...]:
    """Return the columns of trials or people that a comparison's factors and conditions read."""
    by = (compare.by,) if compare.by else ()
    return columns_asked(
        compare.where,
        (*compare.within, *compare.between, *compare.only, *by, *compare.covariates),
        groups,
    )


def rows_to_compare(
    compare: Compare, trials: pd.DataFrame, people: pd.DataFrame | None, groups: Groups
) -> pd.DataFrame:
    """Return trials with every column that a comparison names, answers of people among them."""
    conditions = [condition_of(text, compare.name).column for text in compare.where]
    names = (*compare.within, *compare.between, *compare.only, *conditions)
    named_groups = {name: of for name, of in groups.items() if name in names}
    return with_people(trials, people, columns_of(compare, groups), named_groups)


def _with_families(
    analysis: StudyAnalysis, measures: Mapping[str, Measure], sensitivity_rows: pd.DataFrame | None
) -> StudyAnalysis:
    """Make every family of tests whose measures are all in the trials."""
    trials, levels, rules = analysis.selection.counted, analysis.levels, analysis.rules
    results = tuple(
        Results(of, results_of(of, trials, analysis.people, measures, levels, rules))
        for of in analysis.study.analysis.families
        if all(name in trials for name in of.measures)
    )
    analysis = replace(analysis, results=results)
    main = next((r.of for r in results if isinstance(r.of, Pairs) and not r.of.each), None)
    if main is None:
        return analysis
    finished_trials = analysis.selection.finished
    again = compare_pairs(
        main, finished_trials, measures, levels, rules, family="without exclusions"
    )
    analysis = replace(analysis, without_rules=again)
    if (
        sensitivity_rows is None
        or sensitivity_rows.empty
        or not set(main.measures) <= set(MAIN_MEASURES)
    ):
        return analysis
    first = analysis.pairs_of(main.family)
    return replace(
        analysis,
        sensitivity=sensitivity(sensitivity_rows, trials, first, main, measures, levels, rules),
    )


def answer_comparison(
    compare: Compare,
    trials: pd.DataFrame,
    measures: Mapping[str, Measure],
    levels: dict[str, tuple[Scalar, ...]],
    *,
    is_simulated: bool,
    level_words: Mapping[str, str] | None = None,
) -> Finding:
    """Test one comparison on the trials that count; `level_words` are the words for levels.

    Raises:
        DataError: there is no such measure or factor.
    """
    measure = measures.get(compare.dv)
    if measure is None:
        raise DataError(
            f"the comparison {compare.name} asks for {compare.dv}, which is no measure of this "
            f"study; there are {names_or_none(measures)}"
        )
    factors = (*compare.within, *compare.between)
    unknown = [f for f in factors if f not in levels]
    if unknown:
        raise DataError(
            f"the comparison {compare.name} names {', '.join(unknown)}, which is no factor of this "
            f"study; there are {names_or_none(levels)}"
        )
    # From here a comparison that cannot be tested is a finding that says why, so that the others
    # are still analysed.
    names = (*factors, *compare.only, *compare.covariates)
    if absent := [name for name in names if name not in trials]:
        return Finding(compare, measure, None, (), f"no trial has {', '.join(absent)}")
    everybody = trials["participant"].nunique()
    trials = compare.select(trials)
    if compare.restrictions and trials.empty:
        why = f"no trial of {', '.join(compare.restrictions)} counts"
        return Finding(compare, measure, None, (), why)
    if not measure.is_in(trials):
        return Finding(compare, measure, None, (), f"no trial has {measure.column}")
    if measure.of_cell is not None and (why := _unfit(compare, measure)):
        return Finding(compare, measure, None, (), why)
    in_no_group = trials[list(factors)].isna().any(axis=1)
    notes: tuple[str, ...] = ()
    if in_no_group.any():
        trials = trials[~in_no_group]
        out = everybody - trials["participant"].nunique()
        notes = (f"left out: {count_of(out, 'participant')} in no group of this comparison",)
    if compare.model:  # models take single trials, not the means of cells
        frame = trials[["participant", *factors, measure.column]].copy()
        frame[measure.column] = pd.to_numeric(frame[measure.column], errors="coerce").astype(float)
    else:
        frame = aggregate_cells(trials, [measure], factors)
        frame = frame.drop(columns=count_column(factors))
        if compare.covariates:
            covariates = trials[["participant", *compare.covariates]].drop_duplicates()
            if covariates["participant"].duplicated().any():
                why = f"somebody has several values of {' or '.join(compare.covariates)}"
                return Finding(compare, measure, None, (), why)
            frame = frame.merge(covariates, on="participant", how="left")
    n = frame.dropna(subset=[measure.column])["participant"].nunique()
    if n < MIN_PARTICIPANTS:
        words = measure.words[:1].lower() + measure.words[1:]
        who = "1 participant has" if n == 1 else f"{n} participants have"
        why = f"{who} {words}; tests need {MIN_PARTICIPANTS}"
        return Finding(compare, measure, None, (), why)
    if compare.test in AGREEMENT:
        frame, notes = _agreement_rows(compare, frame)
    frame = with_level_names(frame, factors, levels)
    question = compare.question(
        {f: tuple(map(str, levels[f])) for f in factors},
        level_words=level_words,
        unit="" if measure.unit == "1" else measure.unit,
    )
    frame = frame.assign(**{SIMULATED_COLUMN: is_simulated})
    try:
        outcome = answer(frame, question, name="the trials that count")
    except LabError as error:
        return Finding(compare, measure, None, (), str(error))
    outcome = replace(outcome, notes=(*notes, *outcome.notes))
    # Tests name the p that decides differently; rows without one are no effects.
    terms = tuple(
        Term(
            str(row.get("term") or ":".join(factors) or compare.dv),
            float(p),
            float(p),
            compare.alpha,
            row,
        )
        for row in outcome.rows
        if isinstance(p := next((row[n] for n in DECIDING if row.get(n) is not None), None), float)
        and compare.is_asked(str(row.get("term", "")))
    )
    return as_planned_sided(Finding(compare, measure, outcome, terms))


def _unfit(compare: Compare, measure: Measure) -> str:
    """Return why a number that is fitted to many trials cannot be compared so; "" if it can."""
    if compare.model:
        return f"{measure.column} is fitted to the trials of a cell; a model takes single trials"
    levels = set(compare.within) & set(() if measure.of_cell is None else measure.of_cell.reads)
    if levels:
        return f"{measure.column} is fitted over {levels.pop()}, so that its levels have none each"
    return ""


def _agreement_rows(compare: Compare, frame: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return rows with a column for the rated thing, and notes for the report.

    An ICC needs every rating of each rater: participants with gaps are left out of it.
    """
    notes: tuple[str, ...] = ()
    if compare.raters != "participant":
        notes = ("what one participant rated counts as independent of each other",)
    things = frame[list(compare.things)].astype(str)
    frame = frame.assign(**{THING: things.agg(", ".join, axis=1)})
    if compare.test == "icc" and compare.raters == "participant":
        rating_counts = frame.dropna(subset=[compare.dv]).groupby("participant")[THING].nunique()
        gaps = rating_counts.index[rating_counts < frame[THING].nunique()]
        if 0 < len(gaps):
            frame = frame[~frame["participant"].isin(gaps)]
            notes = (f"left out: {len(gaps)} participants without all ratings",)
    return frame[["participant", *compare.within, THING, compare.dv]], notes


def with_corrected_p(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings with every term's p corrected over its family."""
    families: dict[tuple[str, str], list[float]] = {}
    for finding in findings:
        key = (finding.compare.family, finding.compare.correction)
        families.setdefault(key, []).extend(t.p for t in finding.terms)
    adjusted_p = {
        key: iter(adjust_p(ps, key[1]).tolist() if ps else [])  # type: ignore[arg-type]  # the corrections of Compare are those of adjust_p
        for key, ps in families.items()
    }
    return tuple(
        replace(
            f,
            terms=tuple(
                replace(t, p_corrected=next(adjusted_p[(f.compare.family, f.compare.correction)]))
                for t in f.terms
            ),
        )
        for f in findings
    )
