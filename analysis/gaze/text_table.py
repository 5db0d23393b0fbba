"""Read delimited text strictly: every complaint names the file, the line and the column."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt
import pandas as pd

from analysis.gaze.stamps import Times
from lab.errors import DataError

NS_PER_UNIT: Mapping[str, int] = {
    "ns": 1,
    "100ns": 100,
    "us": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
}
_MISSING = frozenset({"", "n/a", "N/A", "NA", "nan", "NaN", "NAN", "null", "None"})


@dataclass(frozen=True)
class TextTable:
    """A file's cells as text; `first_line` is the line number of the first row."""

    path: Path
    cells: pd.DataFrame
    first_line: int

    def __len__(self) -> int:
        return len(self.cells)

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return all(name in self.cells.columns for name in names)

    def column(self, name: str) -> npt.NDArray[np.object_]:
        """Return a column's text. Raises DataError when there is none of that name."""
        if name not in self.cells.columns:
            raise DataError(
                f"{self.path}: no column {name!r}; it has {', '.join(map(str, self.cells.columns))}"
            )
        return self.cells[name].to_numpy(dtype=object)

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """Return a column as float64, missing as NaN; a decimal comma is understood."""
        text = self.column(name)
        out = np.empty(len(text))
        for i, cell in enumerate(text):
            stripped = cell.strip()
            try:
                out[i] = np.nan if stripped in _MISSING else float(stripped.replace(",", "."))
            except ValueError as error:
                raise DataError(self._complaint(i, name, cell, "not a number")) from error
        return out

    def vectors(self, names: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return several columns side by side, (n, k)."""
        return np.column_stack([self.numbers(name) for name in names])

    def flags(self, name: str) -> npt.NDArray[np.bool_]:
        """Return a column of 0/1, true/false; missing counts as false."""
        known = {"1": True, "true": True, "1.0": True, "0": False, "false": False, "0.0": False}
        out = np.zeros(len(self), bool)
        for i, cell in enumerate(self.column(name)):
            stripped = cell.strip()
            if stripped in _MISSING:
                continue
            if stripped.lower() not in known:
                raise DataError(self._complaint(i, name, cell, "not 0, 1, true or false"))
            out[i] = known[stripped.lower()]
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
                values.append(int(ns.to_integral_value()))
            except (InvalidOperation, ValueError, OverflowError) as error:
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
            f"{self.path}: line {row + self.first_line}, column {name!r} holds {cell!r}, {what}; "
            "mend or remove the line"
        )


def read_text_table(
    source: Path | IO[str],
    *,
    path: Path,
    delimiter: str,
    names: Sequence[str] | None = None,
) -> TextTable:
    """Read all cells as text; `names` replaces a missing header line.

    Raises DataError when the file is not there, not text, ragged, or without a row of data.
    """
    try:
        cells = pd.read_csv(
            source,
            sep=delimiter,
            dtype=str,
            keep_default_na=False,
            na_filter=False,
            header=0 if names is None else None,
            names=None if names is None else list(names),
            index_col=False,
            skip_blank_lines=False,
            encoding="utf-8-sig",
            on_bad_lines="error",
        )
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file; check the path") from error
    except pd.errors.EmptyDataError as error:
        raise DataError(f"{path}: the file is empty; leave it out") from error
    except (pd.errors.ParserError, pd.errors.ParserWarning, UnicodeDecodeError) as error:
        raise DataError(
            f"{path}: not a table with delimiter {delimiter!r} ({error}); check the format"
        ) from error
    while len(cells) and (cells.iloc[-1].fillna("") == "").all():
        cells = cells.iloc[:-1]
    short = cells.isna().any(axis=1).to_numpy()
    first_line = 2 if names is None else 1
    if short.any():
        line = int(np.flatnonzero(short)[0]) + first_line
        raise DataError(f"{path}: line {line} has fewer cells than the header; was it cut off?")
    if not len(cells):
        raise DataError(
            f"{path}: a header but no samples; the recording never started, leave the file out"
        )
    cells.columns = cells.columns.str.strip()
    return TextTable(path, cells, first_line)
