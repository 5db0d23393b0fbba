"""Read delimited text strictly: every complaint names the file, the line and the column."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times
from visavis.lab.errors import DataError, UsageError

NS_PER_UNIT: Mapping[str, int] = {
    "ns": 1,
    "100ns": 100,
    "us": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
}
_MISSING = frozenset({"", "n/a", "N/A", "NA", "nan", "NaN", "NAN", "null", "None"})


MAX_STAMP_NS = Decimal(10) ** 30
"""Beyond any clock; whole numbers of more digits take ever longer to write out."""


@dataclass(frozen=True)
class TextTable:
    """A file's cells as text, column by column; `lines` are the rows' line numbers."""

    path: Path
    cells: Mapping[str, Sequence[str]]
    lines: Sequence[int]

    def __len__(self) -> int:
        return len(self.lines)

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return all(name in self.cells for name in names)

    def column(self, name: str) -> Sequence[str]:
        """Return a column's text. Raises DataError when there is none of that name."""
        if name not in self.cells:
            raise DataError(f"{self.path}: no column {name!r}; it has {', '.join(self.cells)}")
        return self.cells[name]

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """Return a column as float64, missing as NaN; a decimal comma is understood."""
        text = self.column(name)
        out = np.empty(len(text))
        for i, cell in enumerate(text):
            word = cell.strip()
            try:
                out[i] = np.nan if word in _MISSING else float(word.replace(",", "."))
            except ValueError as error:
                raise DataError(self._complaint(i, name, cell, "not a number")) from error
        return out

    def vectors(self, names: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return several columns side by side, (n, k)."""
        return np.column_stack([self.numbers(name) for name in names])

    def flags(self, name: str) -> npt.NDArray[np.bool_]:
        """Return a column of 0/1, true/false; missing counts as false."""
        values = {"1": True, "true": True, "1.0": True, "0": False, "false": False, "0.0": False}
        out = np.zeros(len(self), bool)
        for i, cell in enumerate(self.column(name)):
            word = cell.strip()
            if word in _MISSING:
                continue
            if word.lower() not in values:
                raise DataError(self._complaint(i, name, cell, "not 0, 1, true or false"))
            out[i] = values[word.lower()]
        return out

    def stamps(self, name: str, unit: str, *, from_first: bool = False) -> Times:
        """Return a column of times as int64 ns, exact to the last digit given.

        `from_first` counts from the first row, for wall clocks whose nanoseconds exceed int64.
        """
        factor = NS_PER_UNIT[unit]
        values = []
        for i, cell in enumerate(self.column(name)):
            try:
                ns = Decimal(cell.strip().replace(",", ".")) * factor
                if not abs(ns) < MAX_STAMP_NS:
                    raise OverflowError
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
    delimiter: str,
    text: str | None = None,
    names: Sequence[str] | None = None,
) -> TextTable:
    """Read all cells as text; empty lines are passed over.

    `text` is the content where the file itself is packed; `names` stands for a header line the
    file lacks. Raises UsageError when the file is not there, DataError when it is not text, ragged,
    names a column twice, or holds no row of data.
    """
    if text is None:
        try:
            text = path.read_text(encoding="utf-8-sig")
        except FileNotFoundError as error:
            raise UsageError(f"{path}: no such file; check the path") from error
        except (OSError, UnicodeDecodeError) as error:
            raise DataError(f"{path}: cannot be read as text ({error})") from error
    rows, lines = [], []
    reader = csv.reader(io.StringIO(text), delimiter=delimiter)
    try:
        for row in reader:
            if not any(row):
                continue
            if names is None:
                names = [cell.strip() for cell in row]
                continue
            if len(row) == len(names) + 1 and not row[-1]:
                row.pop()  # a delimiter at the end of the line
            if len(row) != len(names):
                raise DataError(
                    f"{path}: line {reader.line_num} has {len(row)} cells, the header has "
                    f"{len(names)}; was it cut off, or is the delimiter not {delimiter!r}?"
                )
            rows.append(row)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise DataError(f"{path}: line {reader.line_num} is not a table row ({error})") from error
    if names is None:
        raise DataError(f"{path}: the file is empty; leave it out")
    if len(set(names)) != len(names):
        twice = next(name for name in names if list(names).count(name) > 1)
        raise DataError(f"{path}: two columns are named {twice!r}; rename one")
    if not rows:
        raise DataError(
            f"{path}: a header but no samples; the recording never started, leave the file out"
        )
    return TextTable(path, dict(zip(names, zip(*rows, strict=True), strict=True)), lines)
