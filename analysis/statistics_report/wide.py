"""Bring wide tables and answers in words to one number per row."""

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import MISSING_WORDS

_SIGNS = ("_", ".", "-", " ")


def long_table(
    table: DataTable, columns: Sequence[str], *, dv: str, factors: Sequence[str]
) -> DataTable:
    """Return a table with one row per person and cell from one with a column per cell.

    `columns` hold the response `dv`; their names are the levels of the one factor, or of several
    factors parted by _, ., - or a blank: near_1, near_2. What the names begin with in common, up
    to such a sign, is left out: rt_near and rt_far are near and far. Other columns are repeated.

    Raises:
        UsageError: no factor, a response without a name, or names that do not part into levels.
        DataError: a column of that name is there already.
    """
    if not dv or not factors:
        raise UsageError("--wide needs --dv, a name for the response, and --within for the columns")
    for column in columns:
        table.texts(column)
    levels = _levels_of(columns, len(factors))
    others = [str(name) for name in table.cells.columns if name not in columns]
    for name in (dv, *factors):
        if name in others:
            raise DataError(f"{table.name} has a column {name!r} already; call it otherwise")
    rows = []
    lines = []
    for at, cells in enumerate(table.cells.to_dict("records")):
        for column in columns:
            own = dict(zip(factors, levels[column], strict=True))
            rows.append({**{name: cells[name] for name in others}, **own, dv: cells[column]})
            lines.append(table.lines[at])
    order = {
        factor: tuple(dict.fromkeys(levels[column][i] for column in columns))
        for i, factor in enumerate(factors)
    }
    note = f"{len(table.lines)} wide rows made {len(rows)}, one per column of {', '.join(columns)}"
    return replace(
        table,
        cells=pd.DataFrame(rows, dtype=object),
        lines=tuple(lines),
        notes=(*table.notes, note),
        levels={**table.levels, **order},
    )


def _levels_of(columns: Sequence[str], count: int) -> dict[str, tuple[str, ...]]:
    for sign in _SIGNS:
        parts = [column.split(sign) for column in columns]
        shared = 0
        while all(len(p) > shared + count for p in parts) and (
            len({p[shared] for p in parts}) == 1
        ):
            shared += 1
        levels = [tuple(p[shared:]) for p in parts]
        if (count > 1 or shared) and all(len(own) == count for own in levels):
            break
    else:
        if count > 1:
            raise UsageError(
                f"--wide: {', '.join(columns)} do not part into levels of {count} factors; name "
                "them as near_1, near_2, far_1, far_2"
            )
        levels = [(column,) for column in columns]
    if len(set(levels)) != len(columns):
        raise UsageError(f"--wide: two of {', '.join(columns)} are the same cell")
    return dict(zip(columns, levels, strict=True))


def with_numbers_for_words(table: DataTable, column: str, words: str) -> DataTable:
    """Return a table whose column holds numbers for words, as in "never=1,rarely=2,often=3".

    Words count without regard to case and blanks around them; cells that are missing stay so.

    Raises:
        UsageError: `words` has another form or gives a word twice.
        DataError: a cell holds another word; it names the row.
    """
    numbers: dict[str, str] = {}
    for part in words.split(","):
        word, sign, number = part.rpartition("=")
        if not sign or not word.strip() or word.strip().casefold() in numbers:
            raise UsageError(f"--words takes WORD=NUMBER,WORD=NUMBER,…, each once, not {words!r}")
        numbers[word.strip().casefold()] = number.strip()
    cells = []
    for row, text in enumerate(table.texts(column)):
        word = text.strip().casefold()
        if word not in numbers and word not in MISSING_WORDS:
            raise DataError(
                f"{table.name}: {column} holds {text!r} in {table.place(row)}, for which --words "
                "has no number"
            )
        cells.append(numbers.get(word, ""))
    note = f"{column}: {', '.join(f'{word} is {number}' for word, number in numbers.items())}"
    new_cells = table.cells.copy()
    new_cells[column] = cells
    return replace(table, cells=new_cells, notes=(*table.notes, note))
