"""Questions about choices: Bradley–Terry models, sign and binomial tests."""

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import numpy as np
import pandas as pd

from visavis.analysis.statistics.binomial import binomial_test, sign_test, sign_test_of_one
from visavis.analysis.statistics.bradley_terry import bradley_terry
from visavis.analysis.statistics.contrasts import ContrastAdjustment
from visavis.analysis.statistics.errors import DuplicateCell, NotNumeric, option_text
from visavis.analysis.statistics_report.factorial import CONTRAST_WAYS, TestRun
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.prepare import outcome_of, prepare, read
from visavis.analysis.statistics_report.simple import columns_of, family, single_column
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import DataError, UsageError

PAIR_SIGN = "|"
"""Separates the two items of a pair that one column names: "orbit|follow"."""


def _bradley_terry(table: DataTable, q: Question) -> Outcome:
    q.need("dv", "subject", "within")
    if len(q.within) > 2 or len(q.between) > 1:
        raise UsageError(
            "the test bradleyterry takes within the two columns of the items compared (or one that "
            f"names both, A{PAIR_SIGN}B) and at most one between factor"
        )
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    labels = {name: table.labels(name) for name in (q.subject, *q.within, *q.between)}
    frame = pd.DataFrame({**labels, q.dv: table.numbers(q.dv)})
    # One column may name both items of a pair: "A|B".
    first, second = q.within if len(q.within) == 2 else ("first", "second")
    items: list[str] = []
    if len(q.within) == 1:
        frame[first], frame[second] = _items_of_pairs(table, q.within[0], labels[q.within[0]])
    for factor in q.within:
        order = q.levels.get(factor) or table.levels.get(factor, ())
        items += [i for level in order for i in str(level).split(PAIR_SIGN)]
    items_in_use = {*frame[first], *frame[second]}
    order = tuple(dict.fromkeys(i for i in items if i in items_in_use))
    model = bradley_terry(
        frame,
        q.dv,
        first=first,
        second=second,
        subject=q.subject,
        between=q.between[0] if q.between else "",
        items=order if items_in_use <= set(order) else (),
        side=q.model.side,
        missing="listwise" if q.missing == "mixed" else q.missing,
        random=q.model.random,
        nodes=q.model.nodes,
    )
    if len(q.within) == 1:
        effects = [replace(e, term=(*q.within, *e.term[2:])) for e in model.effects]
        model = replace(model, effects=tuple(effects))
    # Comparisons: all items two by two, and the odds of the first place.
    families = {"items": model.contrasts(adjust=cast(ContrastAdjustment, adjust))}
    place_contrasts = model.place()
    if place_contrasts is not None:
        families["place"] = place_contrasts
    tested_rows = frame[[q.subject, first, second, *q.between, q.dv]][frame[q.dv].notna()]
    tested_rows = tested_rows[tested_rows[first] != tested_rows[second]].assign(
        **{c: pd.Categorical(tested_rows[c], model.items) for c in (first, second)},
        **{g: pd.Categorical(tested_rows[g]) for g in q.between},
    )
    return Outcome(
        question=q,
        title=model.provenance.test,
        rows=model.rows(),
        sentences=(*(f"{e.sentence()}." for e in model.effects), model.order()),
        contrasts=tuple(
            {"family": name, **c.row()} for name, of in families.items() for c in of.contrasts
        ),
        contrast_sentences=tuple(
            f"{c.sentence()}." for of in families.values() for c in of.contrasts
        ),
        cells=tuple(a.row() for a in model.abilities),
        notes=tuple(
            dict.fromkeys(
                (
                    *table.notes,
                    *(f"left out: {d}" for d in model.provenance.dropped),
                    *model.provenance.notes,
                )
            )
        ),
        is_simulated=table.is_simulated,
        data=tested_rows,
    )


def _items_of_pairs(
    table: DataTable, column: str, labels: list[str]
) -> tuple[list[str], list[str]]:
    """Return the two items that each row of a column names."""
    for row, label in enumerate(labels):
        if label.count(PAIR_SIGN) != 1 or not all(label.split(PAIR_SIGN)):
            raise DataError(
                f"{table.name}: {column} is {label!r} in {table.place(row)}; it names the two "
                f"items of a pair, the first and the second: A{PAIR_SIGN}B"
            )
    parts = np.array([label.split(PAIR_SIGN) for label in labels])
    return parts[:, 0].tolist(), parts[:, 1].tolist()


def _sign(table: DataTable, q: Question) -> Outcome:
    if not q.within:
        tidy, y = single_column(table, q)
        test = sign_test_of_one(y, mu=q.reference.mu, name=q.dv)
        words = f"{q.dv} above {q.reference.mu:g}: {test.sentence()}."
        return outcome_of(
            table,
            q,
            "Sign test",
            tidy,
            None,
            (test.row(),),
            (words,),
            data=pd.DataFrame({q.dv: y}),
            notes=test.provenance.notes,
        )
    q.one_within()
    tidy = prepare(table, q)
    design = read(tidy, q)
    columns = columns_of(design)
    rows, sentences = family(
        q, columns, lambda a, b: sign_test(columns[a], columns[b], names=(a, b))
    )
    return outcome_of(table, q, "Sign test", tidy, design, rows, sentences)


def _binomial(table: DataTable, q: Question) -> Outcome:
    if q.within or q.between:
        raise UsageError("the test binomial has no factors; for 0 or 1 by conditions take gee")
    tidy, y = single_column(table, q)
    if len(tidy.frame) < len(table.texts(q.dv)):
        raise DuplicateCell(
            f"{table.name}: some {q.subject} have several rows, which are not independent; test "
            f"their means with the test sign, {option_text('mu', 0.5)}, or wilcoxon, or take gee"
        )
    if not set(np.unique(y)) <= {0.0, 1.0}:
        raise NotNumeric(f"{table.name}: {q.dv} holds other numbers than 0 and 1")
    test = binomial_test(int(y.sum()), y.size, expected=q.reference.mu or 0.5)
    sentence = f"{q.dv}: {test.sentence()}."
    return outcome_of(
        table,
        q,
        "Exact binomial test",
        tidy,
        None,
        (test.row(),),
        (sentence,),
        data=pd.DataFrame({q.dv: y}),
    )


CHOICE_TESTS: Mapping[str, TestRun] = {
    "bradleyterry": _bradley_terry,
    "sign": _sign,
    "binomial": _binomial,
}
