"""Read a table as labs have it: commas or semicolons, points or decimal commas, or Parquet."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

SIMULATED_COLUMN = "is_simulated"
MISSING_WORDS = frozenset({"", "na", "nan", "n/a", "null", "none", "#n/a", "."})
"""Texts that mean a missing number, in any case; a label is missing only when empty."""
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?")
_WITH_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+")
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_WORDS = {"true": "1", "false": "0"}
_TRUE, _FALSE = frozenset({"true", "1", "yes"}), frozenset({"false", "0", "no"})


@dataclass(frozen=True)
class DataTable:
    """A table as text, one string per cell ('' where nothing stands).

    `lines` are the line numbers of the rows in the file, 0 where it has none. `notes` say how the
    file was read; `levels` are the orders of categorical columns.
    """

    name: str
    cells: pd.DataFrame = field(repr=False)
    lines: tuple[int, ...] = field(repr=False)
    is_simulated: bool
    notes: tuple[str, ...] = ()
    levels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

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
        decimal = self._decimal(column, values)
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
            if not (_COMMA if decimal == "," else _POINT).fullmatch(value):
                raise NotNumeric(
                    f"{self.name}: {column} holds the text {value!r} in {self.place(row)}{about}; "
                    "it must be a number (leave the cell empty where it is missing)"
                )
            out[row] = float(value.replace(",", "."))
        return out

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

    def _decimal(self, column: str, values: Sequence[str]) -> str:
        """Return the decimal sign of a column; a mixture or a doubt is an error."""
        with_comma = [r for r, v in enumerate(values) if "," in v and _COMMA.fullmatch(v)]
        if not with_comma:
            return "."
        with_point = [r for r, v in enumerate(values) if "." in v and _POINT.fullmatch(v)]
        if with_point:
            raise NotNumeric(
                f"{self.name}: {column} has decimal commas ({self.place(with_comma[0])}: "
                f"{values[with_comma[0]]}) and decimal points ({self.place(with_point[0])}: "
                f"{values[with_point[0]]}); write all numbers one way"
            )
        if all(_WITH_THOUSANDS.fullmatch(values[r]) for r in with_comma):
            row = with_comma[0]
            raise NotNumeric(
                f"{self.name}: {column} holds {values[row]} in {self.place(row)}, which may be a "
                "decimal comma or thousands; write numbers without grouping"
            )
        return ","


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
    text, notes = _read_text(path)
    sign = _separator(text)
    rows = [
        (number, row)
        for number, row in _rows_with_line_numbers(text, sign, path)
        if any(cell.strip() for cell in row)
    ]
    if len(rows) < 2:
        raise DataError(f"{path.name} holds no rows below its header; there is nothing to test")
    names = [cell.strip() for cell in rows[0][1]]
    _refuse_names(path.name, names)
    for number, row in rows[1:]:
        if len(row) != len(names):
            hint = (
                "; if its numbers have decimal commas, save it with semicolons between columns"
                if sign == "," and len(row) > len(names)
                else "; look at that line in a text editor"
            )
            raise DataError(
                f"{path.name} has {len(row)} cells in line {number} and {len(names)} in its "
                f"header{hint}"
            )
    cells = pd.DataFrame(
        [[cell.strip() for cell in row] for _, row in rows[1:]], columns=names, dtype=object
    )
    return _table(path.name, cells, tuple(n for n, _ in rows[1:]), notes)


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


def _read_text(path: Path) -> tuple[str, tuple[str, ...]]:
    raw = path.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16"), ()
    if b"\x00" in raw[:4096]:
        raise DataError(f"{path.name} is no text table; save it as CSV or Parquet")
    try:
        return raw.decode("utf-8-sig"), ()
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace"), ("read as Windows-1252, it is not UTF-8",)


def _separator(text: str) -> str:
    header = next((line for line in text.splitlines() if line.strip()), "")
    bare = re.sub(r'"[^"]*"', "", header)
    return max((",", ";", "\t"), key=bare.count)


def _rows_with_line_numbers(text: str, sign: str, path: Path) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=sign, strict=True)
    try:
        return [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise DataError(f"{path.name}, line {reader.line_num}: {error}; repair the line") from error


def _refuse_names(table: str, names: Sequence[str]) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
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
