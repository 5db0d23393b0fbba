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
from visavis.analysis.statistics.errors import DuplicateCell, MissingValue
from visavis.analysis.statistics.results import Array, Result
from visavis.analysis.statistics_report.factorial import TestRun
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.table_file import MISSING_WORDS, DataTable, natural_order
from visavis.lab.errors import UsageError


def _wide(table: DataTable, q: Question, *, named: bool) -> tuple[Array, pd.DataFrame]:
    """Return ratings (things, raters), NaN where there is none, and the rows they come from.

    `named` ratings are categories: numbers stand for them.
    """
    q.need("dv")
    if q.between:
        raise UsageError(f"the test {q.test} has no between factor; test each group by itself")
    rater = q.one_within()
    things, raters = table.labels(q.subject), table.labels(rater)
    if named:
        texts = table.texts(q.dv)
        there = [t for t in texts if t.lower() not in MISSING_WORDS]
        known = {label: float(i) for i, label in enumerate(natural_order(there))}
        values = np.array([known.get(t, np.nan) for t in texts])
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
    codes, known_things = pd.factorize(rows[q.subject])
    wide = np.full((len(known_things), len(order)), np.nan)
    wide[codes, [order.index(r) for r in raters]] = values
    tested = rows.assign(**{rater: pd.Categorical(rows[rater], order)})
    return wide, tested[rows[q.dv].notna()]


def _outcome(
    table: DataTable,
    q: Question,
    title: str,
    made: tuple[Result, ...],
    tested: pd.DataFrame,
    notes: tuple[str, ...],
) -> Outcome:
    return Outcome(
        question=q,
        title=title,
        rows=tuple(m.row() for m in made),
        sentences=tuple(f"{m.sentence()}." for m in made),
        notes=tuple(dict.fromkeys((*table.notes, *notes))),
        is_simulated=table.is_simulated,
        data=tested,
    )


def _icc(table: DataTable, q: Question) -> Outcome:
    ratings, tested = _wide(table, q, named=False)
    whole = ~np.isnan(ratings).any(axis=1)
    notes: tuple[str, ...] = ()
    if not whole.all():
        if q.missing == "error":
            raise MissingValue(
                f"{table.name}: {int((~whole).sum())} of {whole.size} {q.subject} lack a rating; "
                "leave them out with missing=listwise, or take the test krippendorff"
            )
        notes = (f"{int((~whole).sum())} {q.subject} without all ratings left out",)
        names = list(dict.fromkeys(table.labels(q.subject)))
        kept = {names[i] for i in np.flatnonzero(whole)}
        tested = tested[tested[q.subject].isin(kept)]
    made = icc(ratings[whole], above=q.mu)
    notes += made[0].provenance.notes
    if q.kind:
        if q.kind not in ICC_KINDS:
            raise UsageError(f"there is no {q.kind!r} of the test icc; {', '.join(ICC_KINDS)}")
        made = tuple(one for one in made if one.kind == q.kind)
    notes += (
        "ICC1: raters of its own for each; ICC2: raters stand for others; ICC3: these raters, "
        "their levels apart; k: of the raters' mean",
    )
    return _outcome(table, q, "Intraclass correlation", made, tested, notes)


def _krippendorff(table: DataTable, q: Question) -> Outcome:
    if not q.scale:
        raise UsageError("the test krippendorff needs scale: nominal, ordinal, interval or ratio")
    ratings, tested = _wide(table, q, named=q.scale == "nominal")
    made = krippendorff_alpha(ratings, scale=cast(Scale, q.scale), above=q.mu)
    return _outcome(table, q, "Krippendorff's alpha", (made,), tested, made.provenance.notes)


def _kappa(table: DataTable, q: Question) -> Outcome:
    scale = cast(Scale, q.scale or "nominal")
    ratings, tested = _wide(table, q, named=scale == "nominal")
    made = cohen_kappa(ratings, scale=scale, above=q.mu)
    notes = (*(f"left out: {d}" for d in made.provenance.dropped), *made.provenance.notes)
    title = "Cohen's kappa" if scale == "nominal" else "Weighted kappa"
    return _outcome(table, q, title, (made,), tested, notes)


AGREEMENT_TESTS: Mapping[str, TestRun] = {
    "icc": _icc,
    "krippendorff": _krippendorff,
    "kappa": _kappa,
}
