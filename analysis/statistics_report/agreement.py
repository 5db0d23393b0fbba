"""Questions about raters: one row per thing rated and rater."""

from collections.abc import Mapping
from typing import cast

import numpy as np
import pandas as pd

from visavis.analysis.statistics.agreement import (
    ICC_KINDS,
    Scale,
    cohen_kappa,
    icc,
    krippendorff_alpha,
)
from visavis.analysis.statistics.errors import DuplicateCell, MissingValue, option_text
from visavis.analysis.statistics.results import Array, Result
from visavis.analysis.statistics_report.factorial import TestRun
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.prepare import not_normal, of_two_ways
from visavis.analysis.statistics_report.table_file import DataTable, natural_order
from visavis.lab.errors import UsageError
from visavis.lab.foreign_text import MISSING_WORDS


def _wide(table: DataTable, q: Question, *, as_categories: bool) -> tuple[Array, pd.DataFrame]:
    """Return ratings (things, raters), NaN where there is none, and the rows they come from.

    `as_categories` ratings are categories: numbers stand for them.
    """
    q.need("dv")
    if q.between:
        raise UsageError(f"the test {q.test} has no between factor; test each group by itself")
    rater = q.one_within()
    things, raters = table.labels(q.subject), table.labels(rater)
    if as_categories:
        texts = table.texts(q.dv)
        there = [t for t in texts if t.lower() not in MISSING_WORDS]
        numbers = {label: float(i) for i, label in enumerate(natural_order(there))}
        values = np.array([numbers.get(t, np.nan) for t in texts])
    else:
        values = table.numbers(q.dv)
    rows = pd.DataFrame({q.subject: things, rater: raters, q.dv: values})
    twice = np.flatnonzero(rows.duplicated([q.subject, rater]))
    if twice.size:
        row = int(twice[0])
        raise DuplicateCell(
            f"{table.name}: {rater} {raters[row]} rated {q.subject} {things[row]} twice, again in "
            f"{table.place(row)}; keep one of them, or name what tells them apart"
        )
    order = natural_order(raters)
    codes, things_in_order = pd.factorize(rows[q.subject])
    wide = np.full((len(things_in_order), len(order)), np.nan)
    wide[codes, [order.index(r) for r in raters]] = values
    tested_rows = rows.assign(**{rater: pd.Categorical(rows[rater], order)})
    return wide, tested_rows[rows[q.dv].notna()]


def _outcome(
    table: DataTable,
    q: Question,
    title: str,
    results: tuple[Result, ...],
    tested_rows: pd.DataFrame,
    notes: tuple[str, ...],
) -> Outcome:
    return Outcome(
        question=q,
        title=title,
        rows=tuple(m.row() for m in results),
        sentences=tuple(f"{m.sentence()}." for m in results),
        notes=tuple(dict.fromkeys((*table.notes, *notes))),
        is_simulated=table.is_simulated,
        data=tested_rows,
    )


def _icc(table: DataTable, q: Question) -> Outcome:
    ratings, tested_rows = _wide(table, q, as_categories=False)
    whole = ~np.isnan(ratings).any(axis=1)
    notes: tuple[str, ...] = ()
    if not whole.all():
        if q.missing == "error":
            raise MissingValue(
                f"{table.name}: {int((~whole).sum())} of {whole.size} {q.subject} lack a rating; "
                f"leave them out with {option_text('missing', 'listwise')}, or take the test "
                "krippendorff"
            )
        notes = (f"{int((~whole).sum())} {q.subject} without all ratings left out",)
        names = list(dict.fromkeys(table.labels(q.subject)))
        complete_things = {names[i] for i in np.flatnonzero(whole)}
        tested_rows = tested_rows[tested_rows[q.subject].isin(complete_things)]
    coefficients = icc(ratings[whole], above=q.reference.mu)
    notes += coefficients[0].provenance.notes
    notes += not_normal(
        of_two_ways(ratings[whole]),
        "the F tests of intraclass correlations take them to be; the test krippendorff does not",
    )
    if q.reliability.kind:
        if q.reliability.kind not in ICC_KINDS:
            raise UsageError(
                f"there is no {q.reliability.kind!r} of the test icc; {', '.join(ICC_KINDS)}"
            )
        coefficients = tuple(one for one in coefficients if one.kind == q.reliability.kind)
    notes += (
        "ICC1: raters of its own for each; ICC2: raters stand for others; ICC3: these raters, "
        "their levels apart; k: of the raters' mean",
    )
    return _outcome(table, q, "Intraclass correlation", coefficients, tested_rows, notes)


def _krippendorff(table: DataTable, q: Question) -> Outcome:
    if not q.reliability.scale:
        raise UsageError("the test krippendorff needs scale: nominal, ordinal, interval or ratio")
    ratings, tested_rows = _wide(table, q, as_categories=q.reliability.scale == "nominal")
    alpha = krippendorff_alpha(
        ratings, scale=cast(Scale, q.reliability.scale), above=q.reference.mu
    )
    return _outcome(table, q, "Krippendorff's alpha", (alpha,), tested_rows, alpha.provenance.notes)


def _kappa(table: DataTable, q: Question) -> Outcome:
    scale = cast(Scale, q.reliability.scale or "nominal")
    ratings, tested_rows = _wide(table, q, as_categories=scale == "nominal")
    kappa = cohen_kappa(ratings, scale=scale, above=q.reference.mu)
    notes = (*(f"left out: {d}" for d in kappa.provenance.dropped), *kappa.provenance.notes)
    title = "Cohen's kappa" if scale == "nominal" else "Weighted kappa"
    return _outcome(table, q, title, (kappa,), tested_rows, notes)


AGREEMENT_TESTS: Mapping[str, TestRun] = {
    "icc": _icc,
    "krippendorff": _krippendorff,
    "kappa": _kappa,
}
