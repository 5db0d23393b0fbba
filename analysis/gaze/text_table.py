"""Read delimited text strictly: every complaint names the file, the line and the column."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import (
    MISSING_WORDS,
    NumberStyle,
    decode_text,
    file_decimal,
    read_rows,
    style_of_numbers,
)
from visavis.lab.plain_files import MAX_UNPACKED_BYTES, read_plain

NS_PER_UNIT: Mapping[str, int] = {
    "ns": 1,
    "100ns": 100,
    "us": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
}
_FLAGS = {
    **dict.fromkeys(("1", "true", "1.0", "valid", "yes"), True),
    **dict.fromkeys(("0", "false", "0.0", "invalid", "no"), False),
}
MAX_VALUES_NAMED = 8
MAX_STAMP_NS = Decimal(10) ** 30
"""Beyond any clock; whole numbers of more digits take ever longer to write out."""


@dataclass(frozen=True)
class TextTable:
    """A file's cells as text, column by column; `lines` are the rows' line numbers.

    `remarks` say what was read otherwise than it stands, `decimal` is the decimal sign that the
    file shows beyond doubt ("" where there is none), `delimiter` parts its columns.
    """

    path: Path
    cells: Mapping[str, Sequence[str]]
    lines: Sequence[int]
    remarks: tuple[str, ...] = ()
    delimiter: str = ","
    decimal: str = ""

    def __len__(self) -> int:
        return len(self.lines)

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return all(self._name_of(name) is not None for name in names)

    def column(self, name: str) -> Sequence[str]:
        """Return a column's text. Raises DataError when there is none of that name.

        A name that ends in * is that of a column with a unit behind it, or without: "TIME*" is
        TIME, TIME(…), TIME (…) or TIME […].
        """
        own_name = self._name_of(name)
        if own_name is None:
            raise DataError(f"{self.path}: no column {name!r}; it has {', '.join(self.cells)}")
        return self.cells[own_name]

    def _name_of(self, name: str) -> str | None:
        if name in self.cells or not name.endswith("*"):
            return name if name in self.cells else None
        base = name.removesuffix("*")
        units = (f"{base} [", f"{base}(", f"{base} (")
        fitting = [c for c in self.cells if c == base or c.startswith(units)]
        # Tobii writes the same in mm, too.
        pixels = [c for c in fitting if "DACS px" in c or "ADCSpx" in c]
        return next(iter(pixels or fitting), None)

    def rows(self, rows: npt.NDArray[np.int64]) -> "TextTable":
        """Return some of the rows."""
        cells = {name: [column[i] for i in rows] for name, column in self.cells.items()}
        return replace(self, cells=cells, lines=[self.lines[i] for i in rows])

    def where(self, name: str, values: Sequence[str | float]) -> "TextTable":
        """Return the rows in which a column holds one of these values.

        Raises DataError when none does.
        """
        words = {plain_value(str(value)) for value in values}
        rows = [i for i, cell in enumerate(self.column(name)) if plain_value(cell) in words]
        if not rows:
            there = sorted({plain_value(cell) for cell in self.column(name)})
            raise DataError(
                f"{self.path}: no row in which {name} is {' or '.join(map(str, values))}; it holds "
                f"{', '.join(there[:MAX_VALUES_NAMED])}"
            )
        return self.rows(np.array(rows))

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """Return a column as float64, missing as NaN; decimals by evidence of the whole column."""
        text = self.column(name)
        style = self._style(name)
        out = np.empty(len(text))
        for i, cell in enumerate(text):
            word = cell.strip()
            try:
                out[i] = np.nan if word.lower() in MISSING_WORDS else float(style.plain(word))
            except ValueError as error:
                raise DataError(self._complaint(i, name, cell, "not a number")) from error
        if np.isinf(out).any():
            row = int(np.flatnonzero(np.isinf(out))[0])
            raise DataError(self._complaint(row, name, text[row], "an infinite number"))
        return out

    def _style(self, name: str) -> NumberStyle:
        try:
            return style_of_numbers(
                self.column(name),
                delimiter=self.delimiter,
                of_file=self.decimal,
                place=lambda row: f"line {self.lines[row]}",
            )
        except ValueError as error:
            raise DataError(f"{self.path}: {name} {error}") from error

    def vectors(self, names: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return several columns side by side, (n, k)."""
        return np.column_stack([self.numbers(name) for name in names])

    def flags(self, name: str, valid: Sequence[str | float] | None = None) -> npt.NDArray[np.bool_]:
        """Return a column of 0/1, true/false, valid/invalid or yes/no; missing counts as false.

        With `valid`, the values that mean so, any other is false: [31], [2], ["Both"].
        """
        cells = [cell.strip().lower() for cell in self.column(name)]
        if valid is not None:
            words = {plain_value(str(value)) for value in valid}
            return np.array([plain_value(cell) in words for cell in cells], bool)
        out = np.zeros(len(self), bool)
        for i, word in enumerate(cells):
            if word in MISSING_WORDS:
                continue
            if word not in _FLAGS:
                values = sorted({plain_value(cell) for cell in cells})
                raise DataError(
                    self._complaint(i, name, self.column(name)[i], "not 0, 1, true or false")
                    + f", or say in the mapping which values are valid: valid: {{column: {name}, "
                    f"is: […]}}; it holds {', '.join(values[:MAX_VALUES_NAMED])}"
                )
            out[i] = _FLAGS[word]
        return out

    def stamps(self, name: str, unit: str, *, from_first: bool = False) -> Times:
        """Return a column of times as int64 ns, exact to the last digit given.

        `from_first` counts from the first row, for wall clocks whose nanoseconds exceed int64.
        """
        factor, style = NS_PER_UNIT[unit], self._style(name)
        values = []
        for i, cell in enumerate(self.column(name)):
            try:
                ns = Decimal(style.plain(cell.strip())) * factor
                if not abs(ns) < MAX_STAMP_NS:
                    raise OverflowError
                if unit == "ns" and ns != ns.to_integral_value():
                    what = (
                        "a fraction of a nanosecond, which no clock shows; is the unit us, ms or s?"
                    )
                    raise DataError(f"{self.path}: line {self.lines[i]}, {name} is {cell}, {what}")
                values.append(int(ns.to_integral_value()))
            except (ArithmeticError, ValueError) as error:
                raise DataError(self._complaint(i, name, cell, "not a time stamp")) from error
        if from_first and values:
            values = [v - values[0] for v in values]
        for i, value in enumerate(values):
            if not -(2**63) <= value < 2**63:
                raise DataError(
                    self._complaint(i, name, str(value), "more nanoseconds than int64 holds")
                )
        return np.array(values, np.int64)

    def _complaint(self, row: int, name: str, cell: str, what: str) -> str:
        return (
            f"{self.path}: line {self.lines[row]}, column {name!r} holds {cell!r}, {what}; "
            "mend or remove the line"
        )


def read_text_table(
    path: Path,
    *,
    delimiter: str | None,
    text: str | None = None,
    names: Sequence[str] | None = None,
    decimal: str = "",
) -> TextTable:
    """Read all cells as text; empty lines are passed over, a last line that is cut is left out.

    `delimiter` None is found in the header. `text` is the content where the file itself is packed;
    `names` stands for a header line the file lacks, `decimal` is the sign that a format asks for,
    which holds where the file itself shows none. Raises UsageError when the file is not there,
    DataError when it is not text, ragged, names a column twice, or holds no row of data.
    """
    remarks: tuple[str, ...] = ()
    if text is None:
        try:
            text, remarks = decode_text(read_plain(path, max_bytes=MAX_UNPACKED_BYTES))
        except FileNotFoundError as error:
            raise UsageError(f"{path}: no such file; check the path") from error
        except (OSError, ValueError) as error:
            raise DataError(f"{path}: cannot be read as text ({error})") from error
    read = read_rows(text, what=str(path), delimiter=delimiter, names=names)
    columns = zip(*read.rows, strict=True) if read.rows else iter(() for _ in read.names)
    cells = dict(zip(read.names, columns, strict=True))
    decimal_in_file = "" if read.delimiter == "," else file_decimal(cells)
    remarks = (*remarks, *read.remarks)
    return TextTable(path, cells, read.lines, remarks, read.delimiter, decimal_in_file or decimal)


def plain_value(text: str) -> str:
    """Return a value as it is compared: without case, and 31.0 as 31."""
    word = text.strip().lower()
    head, point, digits = word.partition(".")
    return head if point and head.lstrip("+-").isdigit() and not digits.strip("0") else word
