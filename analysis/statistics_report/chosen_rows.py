"""Choose the rows of a table that are tested: those that count, and those a reader asks for."""

import operator
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics_report.spelling import refuse_spellings
from visavis.analysis.statistics_report.table_file import DataTable, natural_order, truth_of
from visavis.lab.errors import DataError, UsageError
from visavis.lab.spelling import plain_name, spellings_of

COUNTED_COLUMN: Final = "is_analysed"
REASON_COLUMN: Final = "left_out_because"
MAX_LEVELS_NAMED: Final = 8

_CONDITION = re.compile(r"\s*([^<>=!]+?)\s*(<=|>=|!=|==|=|<|>)\s*(.*?)\s*")
ORDERS: Final[dict[str, Callable[[Any, float], Any]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
"""The signs of conditions that compare numbers, with what they compute."""


def counted_rows(table: DataTable) -> DataTable:
    """Return the rows that count where a table tells by `is_analysed`, with a note about the rest.

    Raises:
        DataError: the column holds something other than true and false, or no row counts.
    """
    if COUNTED_COLUMN not in table.cells:
        return table
    counts = np.array(truth_of(table.name, COUNTED_COLUMN, table.labels(COUNTED_COLUMN)))
    out = int((~counts).sum())
    if not out:
        return table
    why = ""
    if REASON_COLUMN in table.cells:
        reasons = Counter(str(r) or "no reason given" for r in table.cells[REASON_COLUMN][~counts])
        why = f": {', '.join(f'{n} {reason}' for reason, n in reasons.most_common())}"
    note = (
        f"{out} of {len(counts)} rows do not count ({COUNTED_COLUMN} says so{why}) and are left out"
    )
    return _rows_kept(table, counts, note)


def condition_parts(text: str) -> tuple[str, str, str] | None:
    """Return column, sign and value of a condition; None where a text is none."""
    match = _CONDITION.fullmatch(text)
    return None if match is None or not match[3] else (match[1], match[2], match[3])


def rows_where(table: DataTable, conditions: Sequence[str]) -> DataTable:
    """Return the rows that fulfil every condition, with a note about each.

    A condition is COLUMN=LEVEL (also several: COLUMN=ONE,OTHER), COLUMN!=LEVEL, or a number behind
    <, <=, > or >=. Rows without a value fulfil != alone.

    Raises:
        OneNameSpeltTwice: a condition names a level that is spelt in several ways.
        UsageError: a condition has another form, or names a level that is not there.
        DataError: no row is left.
        StatisticsError: there is no such column, or it holds no numbers.
    """
    for text in conditions:
        parts = condition_parts(text)
        if parts is None:
            raise UsageError(
                f"--where takes COLUMN=LEVEL, COLUMN!=LEVEL or COLUMN>NUMBER, not {text!r}"
            )
        column, sign, value = parts
        if sign in ORDERS:
            keep = _above_or_below(table, column, sign, value)
        else:
            keep = _of_levels(table, column, value)
            keep = ~keep if sign == "!=" else keep
        note = f"where {text}: {int(keep.sum())} of {len(keep)} rows"
        table = _rows_kept(table, keep, note)
    return table


def _above_or_below(table: DataTable, column: str, sign: str, value: str) -> npt.NDArray[np.bool_]:
    try:
        limit = float(value)
    except ValueError as error:
        raise UsageError(f"--where {column}{sign}{value}: {value!r} is no number") from error
    return np.asarray(ORDERS[sign](table.numbers(column), limit), dtype=bool)


def _of_levels(table: DataTable, column: str, value: str) -> npt.NDArray[np.bool_]:
    cells = np.array(table.texts(column), dtype=object)
    there = set(cells)
    names = [value] if value in there else [v.strip() for v in value.split(",")]
    absent = [v for v in names if v not in there]
    if absent:
        levels = natural_order([str(v) for v in there if v])
        level_list = ", ".join(levels[:MAX_LEVELS_NAMED])
        more = ", …" if len(levels) > MAX_LEVELS_NAMED else ""
        raise UsageError(
            f"{table.name} holds no {column} {absent[0]!r}; there are {level_list}{more}"
        )
    spelt_twice = spellings_of([str(v) for v in cells if v])
    if any(plain_name(v) in spelt_twice for v in names):
        refuse_spellings(table, column)
    return np.isin(cells.astype(str), names)


def _rows_kept(table: DataTable, keep: npt.NDArray[np.bool_], note: str) -> DataTable:
    if not keep.any():
        raise DataError(f"{table.name}: {note}; no row is left to test")
    return replace(
        table,
        cells=table.cells[keep].reset_index(drop=True),
        lines=tuple(line for line, is_kept in zip(table.lines, keep, strict=True) if is_kept),
        notes=(*table.notes, note),
        levels={
            column: tuple(v for v in levels if v in set(table.cells[column][keep]))
            for column, levels in table.levels.items()
        },
    )
