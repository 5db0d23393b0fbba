"""Read a table as labs have it: commas or semicolons, points or decimal commas, or Parquet."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.statistics.errors import (
    InfiniteValue,
    MissingValue,
    NotNumeric,
    UnknownColumn,
)
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import (
    MISSING_WORDS,
    NumberStyle,
    decode_text,
    file_decimal,
    read_rows,
    remark_on_codes,
    style_of_numbers,
)

SIMULATED_COLUMN = "is_simulated"
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_WORDS = {"true": "1", "false": "0"}
_TRUE, _FALSE = frozenset({"true", "1", "yes"}), frozenset({"false", "0", "no"})


@dataclass(frozen=True)
class DataTable:
    """A table as text, one string per cell ('' where nothing stands).

    `lines` are the line numbers of the rows in the file, 0 where it has none. `notes` say how the
    file was read; `levels` are the orders of categorical columns. `delimiter` parts the columns of
    the file and `decimal` is the decimal sign that they show beyond doubt, "" where there is none.
    `spellings_differ`: labels that differ by case, blanks or zeros alone are different ones.
    """

    name: str
    cells: pd.DataFrame = field(repr=False)
    lines: tuple[int, ...] = field(repr=False)
    is_simulated: bool
    notes: tuple[str, ...] = ()
    levels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    delimiter: str = ","
    decimal: str = ""
    spellings_differ: bool = False

    def labels(self, column: str) -> list[str]:
        """Return a label column; MissingValue names the first row without one."""
        values = self.texts(column)
        for row, value in enumerate(values):
            if value == "":
                raise MissingValue(
                    f"{self.name}: {column} is missing in {self.place(row)}; every row needs it"
                )
        return values

    def numbers(self, column: str, where: Sequence[str] | None = None) -> npt.NDArray[np.float64]:
        """Return a column of numbers, NaN where missing.

        Columns of true and false are 1 and 0. `where` names each row for messages. Raises
        NotNumeric or InfiniteValue for the first row that holds something else.
        """
        values = self.texts(column)
        words = {v.lower() for v in values} - MISSING_WORDS
        if words and words <= _WORDS.keys():
            values = [_WORDS.get(v.lower(), v) for v in values]
        style = self.style(column, values)
        out = np.empty(len(values))
        for row, value in enumerate(values):
            if value.lower() in MISSING_WORDS:
                out[row] = np.nan
                continue
            about = f" ({where[row]})" if where is not None else ""
            if _INFINITE.fullmatch(value):
                raise InfiniteValue(
                    f"{self.name}: {column} is infinite in {self.place(row)}{about}; find out how "
                    "it was computed"
                )
            plain = style.plain(value)
            if not _POINT.fullmatch(plain):
                raise NotNumeric(
                    f"{self.name}: {column} holds the text {value!r} in {self.place(row)}{about}; "
                    "it must be a number (leave the cell empty where it is missing)"
                )
            out[row] = float(plain)
        return out

    def style(self, column: str, values: Sequence[str] | None = None) -> NumberStyle:
        """Return how a column writes its numbers; NotNumeric when that may mean two things."""
        try:
            return style_of_numbers(
                self.texts(column) if values is None else values,
                delimiter=self.delimiter,
                of_file=self.decimal,
                place=self.place,
            )
        except ValueError as error:
            raise NotNumeric(f"{self.name}: {column} {error}") from error

    def remarks(self, column: str) -> tuple[str, ...]:
        """Return what to say of a column of numbers: thousands, values like codes for missing."""
        style = self.style(column).remark
        codes = remark_on_codes(column, self.numbers(column).tolist())
        return tuple(text for text in (f"{column}: {style}" if style else "", codes) if text)

    def place(self, row: int) -> str:
        """Name a row for messages: 'row 4 (line 5)'."""
        line = self.lines[row]
        return f"row {row + 1}" + (f" (line {line})" if line else "")

    def texts(self, column: str) -> list[str]:
        """Return a column as it stands, '' where nothing does; UnknownColumn names what is near."""
        if column not in self.cells:
            names = [str(c) for c in self.cells.columns]
            lower = {c.lower(): c for c in names}
            near = get_close_matches(column.lower(), lower, 1, 0.5)
            hint = (
                f"; did you mean {lower[near[0]]!r}?" if near else f"; there are {', '.join(names)}"
            )
            raise UnknownColumn(f"{self.name} has no column {column!r}{hint}")
        return [str(v) for v in self.cells[column]]


def read_table(path: Path) -> DataTable:
    """Read CSV (comma, semicolon or tab) or Parquet.

    Raises:
        UsageError: it is not there.
        DataError: no table, rows of different length, a column named twice, or
            simulated and real rows together.
    """
    if not path.is_file():
        near = get_close_matches(path.name, [p.name for p in path.parent.glob("*")], 1)
        hint = f"; did you mean {path.parent / near[0]}?" if near else ""
        raise UsageError(f"there is no file {path}{hint}")
    if path.suffix.lower() in (".parquet", ".pq"):
        return _from_parquet(path)
    try:
        text, notes = decode_text(path.read_bytes())
    except ValueError as error:
        raise DataError(
            f"{path.name} is no text table ({error}); save it as CSV or Parquet"
        ) from error
    read = read_rows(text, what=path.name)
    cells = pd.DataFrame(
        [[cell.strip() for cell in row] for row in read.rows],
        columns=list(read.names),
        dtype=object,
    )
    table = _table(path.name, cells, tuple(read.lines), (*notes, *read.remarks))
    columns = {name: table.texts(name) for name in read.names}
    return replace(table, delimiter=read.delimiter, decimal=file_decimal(columns))


def _from_parquet(path: Path) -> DataTable:
    try:
        frame = pd.read_parquet(path)
    except Exception as error:  # pandas' metadata in a damaged file can raise anything
        raise DataError(f"{path} cannot be read as Parquet ({error})") from error
    return table_of(frame, name=path.name)


def table_of(frame: pd.DataFrame, *, name: str = "the table") -> DataTable:
    """Return a tidy frame as a table; `name` is what messages call it.

    Raises:
        DataError: no rows, a column named twice, or simulated and real rows together.
    """
    if frame.empty:
        raise DataError(f"{name} holds no rows; there is nothing to test")
    with_text_names = frame.set_axis([str(c) for c in frame.columns], axis="columns")
    _refuse_names(name, list(with_text_names.columns))
    cells = pd.DataFrame(
        {c: [_text(v) for v in with_text_names[c].tolist()] for c in with_text_names}, dtype=object
    )
    levels = {}
    for column in with_text_names:
        if isinstance(with_text_names[column].dtype, pd.CategoricalDtype):
            there = set(cells[column])
            categories = (_text(v) for v in with_text_names[column].cat.categories)
            levels[str(column)] = tuple(v for v in categories if v in there)
    return _table(name, cells, (0,) * len(cells), (), levels)


def _text(value: object) -> str:
    if value is None or value is pd.NA or value is pd.NaT:
        return ""
    if isinstance(value, float):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)


def _table(
    name: str,
    cells: pd.DataFrame,
    lines: tuple[int, ...],
    notes: tuple[str, ...],
    levels: Mapping[str, tuple[str, ...]] | None = None,
) -> DataTable:
    return DataTable(name, cells, lines, _is_simulated(name, cells), notes, levels or {})


def _is_simulated(name: str, cells: pd.DataFrame) -> bool:
    if SIMULATED_COLUMN not in cells:
        return False
    marks = set(truth_of(name, SIMULATED_COLUMN, [str(v) for v in cells[SIMULATED_COLUMN]]))
    if len(marks) == 2:
        raise DataError(
            f"{name} mixes simulated and real rows ({SIMULATED_COLUMN}); take them apart "
            "first, a test of both means nothing"
        )
    return True in marks


def truth_of(name: str, column: str, texts: Sequence[str]) -> list[bool]:
    """Return a column of true and false; `name` is what messages call the table.

    Raises:
        DataError: a row holds something else.
    """
    words = [text.lower() for text in texts]
    other_words = sorted(set(words) - _TRUE - _FALSE)
    if other_words:
        raise DataError(
            f"{name}: {column} holds {other_words[0]!r}; it says true or false in every row"
        )
    return [word in _TRUE for word in words]


def _refuse_names(table: str, names: Sequence[str]) -> None:
    twice = sorted(name for name, n in Counter(names).items() if n > 1)
    if twice:
        raise DataError(
            f"{table} names the column {twice[0]!r} twice; give every column its own name"
        )


def natural_order(labels: Sequence[str]) -> list[str]:
    """Return the different labels: by value when all are numbers, else alphabetically."""
    distinct = sorted(set(labels))
    if all(_POINT.fullmatch(v) for v in distinct):
        return sorted(distinct, key=float)
    return distinct
