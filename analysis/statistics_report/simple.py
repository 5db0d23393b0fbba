"""Tests of one or two samples: pairs, groups, correlation, normality, equivalence, reliability."""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import combinations
from typing import Any, TypeVar, cast

import numpy as np
import pandas as pd

from visavis.analysis.statistics import (
    Design,
    TTest,
    adjust_p,
    compare_paired,
    correct_family,
    cronbach_alpha,
    independent_t,
    mann_whitney,
    one_sample_t,
    paired_t,
    pearson,
    shapiro_wilk,
    spearman,
    tost_independent,
    tost_one_sample,
    tost_paired,
    wilcoxon_signed_rank,
)
from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME, Adjustment
from visavis.analysis.statistics.bayes import MEDIUM_SCALE, bayes_text, jzs_bayes_factor
from visavis.analysis.statistics.equivalence import BoundUnit
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    MissingValue,
    TooFewLevels,
    option_text,
)
from visavis.analysis.statistics.results import MINUS, Array, Row, p_text
from visavis.analysis.statistics_report.factorial import RANK_WAYS, TestRun
from visavis.analysis.statistics_report.outcome import Outcome, Question, Samples
from visavis.analysis.statistics_report.prepare import (
    TidyTable,
    outcome_of,
    prepare,
    read,
    uneven_groups,
)
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import UsageError

_Result = TypeVar("_Result")


def columns_of(design: Design) -> dict[str, Array]:
    """Return one value per subject by level of the single within factor, or by group."""
    factor = design.factors[0]
    if factor.is_within:
        table = design.table(design.y)
        return {str(v): table[:, i] for i, v in enumerate(factor.levels)}
    return {str(v): design.y[factor.codes == i] for i, v in enumerate(factor.levels)}


def _paired_comparisons(table: DataTable, q: Question) -> Outcome:
    q.one_within()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    results, reasons = _each_pair(
        columns,
        lambda a, b: compare_paired(
            columns[a], columns[b], names=(a, b), alpha=q.decision.alpha, unit=q.wording.measured_in
        ),
    )
    comparisons = tuple(results.values())
    if len(comparisons) > 1:
        way = q.adjustment("holm", RANK_WAYS)
        comparisons = correct_family(comparisons, cast(Adjustment, way))
    path = [
        f"{c.names[0]} {MINUS} {c.names[1]}: {step}" if len(comparisons) > 1 else str(step)
        for c in comparisons
        for step in c.steps
    ]
    notes = tuple(n for c in comparisons for n in c.test.provenance.notes)
    return outcome_of(
        table,
        q,
        "Paired comparison" + ("s" if len(comparisons) > 1 else ""),
        tidy,
        design,
        tuple(c.row() for c in comparisons),
        (*(c.sentence() for c in comparisons), *reasons),
        path=tuple(path),
        notes=notes,
    )


def _each_pair(
    columns: Mapping[str, Array], test: Callable[[str, str], _Result]
) -> tuple[dict[tuple[str, str], _Result], tuple[str, ...]]:
    """Test all pairs of columns, and return sentences about those that cannot be.

    One of several pairs without any spread does not keep the others from being tested.
    """
    results: dict[tuple[str, str], _Result] = {}
    reasons: list[str] = []
    pairs = list(combinations(columns, 2))
    for a, b in pairs:
        try:
            results[a, b] = test(a, b)
        except ConstantResponse as error:
            if len(reasons) + 1 == len(pairs):
                raise
            reasons.append(f"{a} {MINUS} {b}: not compared; {error}.")
    return results, tuple(reasons)


def family(
    q: Question, columns: Mapping[str, Array], test: Callable[[str, str], Any]
) -> tuple[tuple[Row, ...], tuple[str, ...]]:
    """Test all pairs of columns; more than one pair is adjusted as a family."""
    tests, reasons = _each_pair(columns, test)
    way = q.adjustment("holm", RANK_WAYS) if len(columns) > 2 else "none"
    all_p_adjusted = adjust_p([t.p for t in tests.values()], cast(Adjustment, way)).tolist()
    rows, sentences = [], []
    for ((a, b), result), p in zip(tests.items(), all_p_adjusted, strict=True):
        sentence = f"{a} {MINUS} {b}: {result.sentence()}"
        row: dict[str, Any] = {"first": a, "second": b, **result.row()}
        if way != "none":
            sentence += f", adjusted {p_text(p)} ({ADJUSTMENT_NAME[cast(Adjustment, way)]})"
            row |= {"p_adjusted": p, "adjustment": way}
        rows.append(row)
        sentences.append(sentence + ".")
    return tuple(rows), (*sentences, *reasons)


def _t(table: DataTable, q: Question) -> Outcome:
    if not q.within and not q.between:
        return _one_sample_t(table, q)
    if q.within and q.between:
        raise UsageError("the test t takes a within or a between factor, not both; see the test rm")
    _ = q.one_within() if q.within else q.one_between()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    run: Callable[..., TTest] = partial(paired_t, unit=q.wording.measured_in)
    title = "Paired t test"
    if q.between:
        run = partial(
            independent_t, equal_variances=q.model.equal_variances, unit=q.wording.measured_in
        )
        title = "Student's t test" if q.model.equal_variances else "Welch's t test"
    rows, sentences = family(q, columns, lambda a, b: run(columns[a], columns[b], names=(a, b)))
    notes: tuple[str, ...] = ()
    if q.between and q.model.equal_variances:
        notes = uneven_groups(design, "Welch's test, without equal_variances")
    if q.model.bayes:
        pairs = [(columns[str(row["first"])], columns[str(row["second"])]) for row in rows]
        factors = [_bayes_factor(x, y, paired=bool(q.within)) for x, y in pairs]
        rows, sentences = _with_bayes(rows, sentences, factors)
        notes += (_BAYES_NOTE,) if q.within else (_BAYES_NOTE, "the Bayes factor is Student's t's")
    if q.reference.low is not None or q.reference.high is not None:
        equal = _tost(table, q) if len(columns) == 2 else None
        if equal is None:
            raise TooFewLevels(f"equivalence is tested for two conditions, not {len(columns)}")
        rows = ({**rows[0], "p_equivalence": equal.rows[0]["p"]},)
        sentences = (*sentences, *equal.sentences)
    return outcome_of(table, q, title, tidy, design, rows, sentences, notes=notes)


_BAYES_NOTE = (
    f"Bayes factor with a Cauchy prior of scale {MEDIUM_SCALE:.3f} on the effect in SD (JZS); "
    "above 1 it speaks for a difference, below 1 for none"
)


def _bayes_factor(x: Array, y: Array, *, paired: bool) -> float:
    if paired:
        return jzs_bayes_factor(paired_t(x, y).t, x.size)
    return jzs_bayes_factor(independent_t(x, y).t, x.size, y.size)


def _with_bayes(
    rows: tuple[Row, ...], sentences: tuple[str, ...], factors: list[float]
) -> tuple[tuple[Row, ...], tuple[str, ...]]:
    """Return rows with a column BF10 and sentences with the Bayes factor at their end.

    Sentences about pairs that were not tested, which have no row, come last and stay as they are.
    """
    return (
        tuple({**row, "BF10": bf} for row, bf in zip(rows, factors, strict=True)),
        (
            *(
                f"{s.rstrip('.')}, {bayes_text(bf)}."
                for s, bf in zip(sentences, factors, strict=False)
            ),
            *sentences[len(factors) :],
        ),
    )


def single_column(table: DataTable, q: Question) -> tuple[TidyTable, Array]:
    """Return a column without factors; missing values as the question says."""
    tidy = prepare(table, q)
    y = tidy.frame[q.dv].to_numpy(float)
    missing = np.isnan(y)
    if missing.any() and q.missing == "error":
        row = int(np.flatnonzero(missing)[0])
        raise MissingValue(
            f"{table.name}: {q.dv} is missing in {table.place(row)}; repair it, or leave such "
            f"rows out with {option_text('missing', 'listwise')}"
        )
    if missing.any():
        notes = (*tidy.notes, f"{int(missing.sum())} rows without {q.dv} left out")
        tidy = TidyTable(tidy.frame, tidy.levels, notes)
    return tidy, y[~missing]


def _one_sample_t(table: DataTable, q: Question) -> Outcome:
    tidy, y = single_column(table, q)
    test = one_sample_t(y, mu=q.reference.mu, name=q.dv, unit=q.wording.measured_in)
    rows: tuple[Row, ...] = (test.row(),)
    sentences: tuple[str, ...] = (f"{q.dv} against {q.reference.mu:g}: {test.sentence()}.",)
    notes: tuple[str, ...] = ()
    if q.model.bayes:
        rows, sentences = _with_bayes(rows, sentences, [jzs_bayes_factor(test.t, y.size)])
        notes = (_BAYES_NOTE,)
    return outcome_of(
        table,
        q,
        "One-sample t test",
        tidy,
        None,
        rows,
        sentences,
        notes=notes,
        data=pd.DataFrame({q.dv: y}),
    )


def _wilcoxon(table: DataTable, q: Question) -> Outcome:
    q.one_within()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    rows, sentences = family(
        q, columns, lambda a, b: wilcoxon_signed_rank(columns[a], columns[b], names=(a, b))
    )
    title = "Wilcoxon signed-rank test"
    return outcome_of(table, q, title, tidy, design, rows, sentences)


def _mann_whitney(table: DataTable, q: Question) -> Outcome:
    q.one_between()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    rows, sentences = family(
        q, columns, lambda a, b: mann_whitney(columns[a], columns[b], names=(a, b))
    )
    notes = uneven_groups(design, "the test t, which is Welch's")
    return outcome_of(table, q, "Mann-Whitney test", tidy, design, rows, sentences, notes=notes)


def _shapiro(table: DataTable, q: Question) -> Outcome:
    if not q.within and not q.between:
        tidy, y = single_column(table, q)
        test = shapiro_wilk(y, name=q.dv)
        row: Row = {"sample": q.dv, **test.row()}
        sentence = f"{q.dv}: {test.sentence()}."
        return outcome_of(
            table,
            q,
            "Shapiro-Wilk test",
            tidy,
            None,
            (row,),
            (sentence,),
            data=pd.DataFrame({q.dv: y}),
        )
    factor = q.one_within() if q.within else q.one_between()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    samples = {f"{factor} {k}": v for k, v in columns.items()}
    if q.within:
        samples |= {
            f"{a} {MINUS} {b}": columns[a] - columns[b] for a, b in combinations(columns, 2)
        }
    results = {k: shapiro_wilk(v, name=k) for k, v in samples.items()}
    return outcome_of(
        table,
        q,
        "Shapiro-Wilk test",
        tidy,
        design,
        tuple({"sample": k, **r.row()} for k, r in results.items()),
        tuple(f"{k}: {r.sentence()}." for k, r in results.items()),
        notes=("a paired t test needs normal differences, not normal conditions",)
        if q.within
        else (),
    )


def _correlation(run: Callable[..., Any], title: str) -> TestRun:
    def test(table: DataTable, q: Question) -> Outcome:
        q.need("partner")
        if q.within or q.between:
            raise UsageError(
                f"the test {q.test} takes two columns, dv and with, and no within or between factor"
            )
        x, notes_x = _by_subject(table, q, q.partner)
        y, notes_y = _by_subject(table, q, q.dv)
        both = ~(np.isnan(x) | np.isnan(y))
        notes = [*notes_x, *notes_y]
        if not both.all():
            row = int(np.flatnonzero(~both)[0])
            if q.missing == "error":
                raise MissingValue(
                    f"{table.name}: {q.dv} or {q.partner} is missing "
                    f"({'subject' if q.subject else 'row'} number {row + 1} and "
                    f"{int((~both).sum()) - 1} more); leave them out with "
                    f"{option_text('missing', 'listwise')}"
                )
            notes.append(f"{int((~both).sum())} pairs without both values left out")
        correlation = run(x[both], y[both], names=(q.partner, q.dv))
        samples = Samples(
            f"{q.partner}_{q.dv}",
            f"{q.dv} against {q.partner}",
            {q.partner: x[both], q.dv: y[both]},
            kind="scatter",
        )
        return Outcome(
            question=q,
            title=title,
            rows=(correlation.row(),),
            sentences=(f"{q.partner} and {q.dv}: {correlation.sentence()}.",),
            notes=tuple(dict.fromkeys((*table.notes, *notes, *correlation.provenance.notes))),
            samples=(samples,),
            is_simulated=table.is_simulated,
            data=pd.DataFrame({q.partner: x[both], q.dv: y[both]}),
        )

    return test


def _by_subject(table: DataTable, q: Question, column: str) -> tuple[Array, tuple[str, ...]]:
    one = Question(q.test, dv=column, subject=q.subject, missing=q.missing)
    tidy = prepare(table, one)
    return tidy.frame[column].to_numpy(float), tidy.notes


def _tost(table: DataTable, q: Question) -> Outcome:
    if q.reference.low is None or q.reference.high is None:
        raise UsageError(
            "the test tost needs low and high: the smallest difference that matters, fixed "
            "before looking at the data"
        )
    if q.reference.unit not in ("raw", "sd"):
        raise UsageError(f"unit takes raw or sd, not {q.reference.unit!r}")
    unit = cast(BoundUnit, q.reference.unit)
    bounds: dict[str, Any] = {
        "low": q.reference.low,
        "high": q.reference.high,
        "unit": unit,
        "alpha": q.decision.alpha,
    }
    if not q.within and not q.between:
        tidy, y = single_column(table, q)
        test = tost_one_sample(y, name=q.dv, **bounds)
        sentence = f"{q.dv}: {test.sentence()}."
        return outcome_of(
            table,
            q,
            "Equivalence test",
            tidy,
            None,
            (test.row(),),
            (sentence,),
            data=pd.DataFrame({q.dv: y}),
        )
    _ = q.one_within() if q.within else q.one_between()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    if len(columns) != 2:
        raise TooFewLevels(
            f"an equivalence test compares two conditions, {design.factors[0].name} has "
            f"{len(columns)} ({', '.join(columns)}); keep two of them in the file"
        )
    (a, x), (b, y) = columns.items()
    if q.within:
        test = tost_paired(x, y, names=(a, b), **bounds)
    else:
        equal = q.model.equal_variances
        test = tost_independent(x, y, names=(a, b), equal_variances=equal, **bounds)
    sentence = f"{a} {MINUS} {b}: {test.sentence()}."
    return outcome_of(
        table,
        q,
        "Equivalence test",
        tidy,
        design,
        (test.row(),),
        (sentence,),
        notes=test.provenance.notes,
    )


def _cronbach(table: DataTable, q: Question) -> Outcome:
    q.need("items")
    columns = {name: table.numbers(name) for name in q.reliability.items}
    values = np.column_stack(list(columns.values()))
    missing = np.isnan(values).any(axis=1)
    notes = list(table.notes)
    if missing.any():
        row = int(np.flatnonzero(missing)[0])
        item = q.reliability.items[int(np.flatnonzero(np.isnan(values[row]))[0])]
        if q.missing == "error":
            raise MissingValue(
                f"{table.name}: {item} is missing in {table.place(row)}; repair it, or leave such "
                f"persons out with {option_text('missing', 'listwise')}"
            )
        notes.append(f"{int(missing.sum())} persons without all items left out")
    alpha = cronbach_alpha(
        {k: v[~missing] for k, v in columns.items()},
        list(q.reliability.items),
        reverse=q.reliability.reverse,
    )
    return Outcome(
        question=q,
        title="Cronbach's alpha",
        rows=(alpha.row(),),
        sentences=(alpha.sentence() + ".",),
        contrasts=tuple(
            {"family": "item left out", "item": i, "alpha_without": a}
            for i, a in zip(alpha.items, alpha.without_item, strict=True)
        ),
        notes=tuple(dict.fromkeys((*notes, *alpha.provenance.notes))),
        is_simulated=table.is_simulated,
        data=pd.DataFrame({k: v[~missing] for k, v in columns.items()}),
    )


SIMPLE_TESTS: Mapping[str, TestRun] = {
    "paired": _paired_comparisons,
    "t": _t,
    "wilcoxon": _wilcoxon,
    "mannwhitney": _mann_whitney,
    "shapiro": _shapiro,
    "spearman": _correlation(spearman, "Spearman's rank correlation"),
    "pearson": _correlation(pearson, "Pearson's correlation"),
    "tost": _tost,
    "cronbach": _cronbach,
}
