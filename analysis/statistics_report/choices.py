"""Questions about choices between two: Bradley–Terry models."""

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import numpy as np
import pandas as pd

from analysis.statistics.bradley_terry import bradley_terry
from analysis.statistics.contrasts import ContrastAdjustment
from analysis.statistics_report.factorial import CONTRAST_WAYS, TestRun
from analysis.statistics_report.outcome import Outcome, Question
from analysis.statistics_report.table_file import DataTable
from lab.errors import DataError, UsageError

PAIR_SIGN = "|"
"""Parts the two items of a pair that one column names: "orbit|follow"."""


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
    first, second = q.within if len(q.within) == 2 else ("first", "second")
    items: list[str] = []
    if len(q.within) == 1:
        frame[first], frame[second] = _parted(table, q.within[0], labels[q.within[0]])
    for factor in q.within:
        order = q.levels.get(factor) or table.levels.get(factor, ())
        items += [i for level in order for i in str(level).split(PAIR_SIGN)]
    used = {*frame[first], *frame[second]}
    order = tuple(dict.fromkeys(i for i in items if i in used))
    made = bradley_terry(
        frame, q.dv, first=first, second=second, subject=q.subject,
        between=q.between[0] if q.between else "", items=order if used <= set(order) else (),
        side=q.side, missing="listwise" if q.missing == "mixed" else q.missing,
    )  # fmt: skip
    if len(q.within) == 1:
        effects = [replace(e, term=(*q.within, *e.term[2:])) for e in made.effects]
        made = replace(made, effects=tuple(effects))
    families = {"items": made.contrasts(adjust=cast(ContrastAdjustment, adjust))}
    placed = made.place()
    if placed is not None:
        families["place"] = placed
    tested = frame[[q.subject, first, second, *q.between, q.dv]][frame[q.dv].notna()]
    tested = tested[tested[first] != tested[second]].assign(
        **{c: pd.Categorical(tested[c], made.items) for c in (first, second)},
        **{g: pd.Categorical(tested[g]) for g in q.between},
    )
    return Outcome(
        question=q, title=made.provenance.test, rows=made.rows(),
        sentences=(*(f"{e.sentence()}." for e in made.effects), made.order()),
        contrasts=tuple(
            {"family": name, **c.row()} for name, of in families.items() for c in of.contrasts
        ),
        contrast_sentences=tuple(
            f"{c.sentence()}." for of in families.values() for c in of.contrasts
        ),
        cells=tuple(a.row() for a in made.abilities),
        notes=tuple(dict.fromkeys(
            (*table.notes, *(f"left out: {d}" for d in made.provenance.dropped),
             *made.provenance.notes)
        )),
        is_simulated=table.is_simulated,
        data=tested,
    )  # fmt: skip


def _parted(table: DataTable, column: str, labels: list[str]) -> tuple[list[str], list[str]]:
    """Return the two items that each row of a column names."""
    for row, label in enumerate(labels):
        if label.count(PAIR_SIGN) != 1 or not all(label.split(PAIR_SIGN)):
            raise DataError(
                f"{table.name}: {column} is {label!r} in {table.place(row)}; it names the two "
                f"items of a pair, the first and the second: A{PAIR_SIGN}B"
            )
    parts = np.array([label.split(PAIR_SIGN) for label in labels])
    return parts[:, 0].tolist(), parts[:, 1].tolist()


CHOICE_TESTS: Mapping[str, TestRun] = {"bradleyterry": _bradley_terry}
