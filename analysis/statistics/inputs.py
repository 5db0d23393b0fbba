"""Turn what an analyst has into checked arrays, or say which row is wrong."""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import (
    ConstantResponse,
    InfiniteValue,
    MissingValue,
    NotNumeric,
    TooFewSubjects,
    UnequalLength,
)
from visavis.analysis.statistics.results import Array

AT_LEAST: Final = 3
"""The values that a sample needs at least."""


def is_missing(value: object) -> bool:
    """Tell whether a value of an object column stands for nothing (None, NaN, pandas NA, NaT)."""
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return True
    return isinstance(value, float | np.floating) and bool(np.isnan(value))


def as_column(values: object) -> npt.NDArray[Any]:
    """Return a column as an array; a list that mixes text and numbers keeps both."""
    raw: npt.NDArray[Any] = np.asarray(values)
    if raw.dtype.kind in "US" and isinstance(values, list | tuple):
        return np.array(values, dtype=object)
    return raw


def refuse_text(
    raw: npt.NDArray[Any], name: str, where: Callable[[int], str] | None = None
) -> None:
    """Raise `NotNumeric` for the first text that is no number, or for numbers kept as text."""
    texts = [(row, v) for row, v in enumerate(raw.tolist()) if isinstance(v, str | bytes)]
    if not texts:
        return
    words = [(row, v) for row, v in texts if not _reads_as_number(v)]
    row, value = (words or texts)[0]
    place = f" ({where(row)})" if where is not None else ""
    advice = "it must be a number" if words else "convert the column from text to numbers"
    raise NotNumeric(f"{name} holds the text {value!r} in row {row + 1}{place}; {advice}")


def numbers(values: npt.ArrayLike, *, name: str, allow_missing: bool = False) -> Array:
    """Return a column as floats of shape (n,).

    `allow_missing` keeps missing entries as NaN. Raises `NotNumeric`, `MissingValue` or
    `InfiniteValue` naming the first such row, counted from 1 as in a table without its header.
    """
    raw = as_column(values)
    if raw.ndim != 1:
        raise NotNumeric(f"{name} has {raw.ndim} dimensions; pass one column of numbers")
    if raw.dtype.kind in "biuf":
        column = raw.astype(np.float64)
    else:
        refuse_text(raw, name)
        column = np.empty(raw.shape[0])
        for row, value in enumerate(raw.tolist()):
            column[row] = _number(value, name, row)
    missing = np.isnan(column)
    if missing.any() and not allow_missing:
        rows = rows_text(np.flatnonzero(missing))
        raise MissingValue(
            f"{name} is missing in {rows}; repair the rows or say how to treat missing values"
        )
    infinite = np.isinf(column)
    if infinite.any():
        rows = rows_text(np.flatnonzero(infinite))
        raise InfiniteValue(f"{name} is infinite in {rows}; find out how it was computed")
    return column


def sample(
    values: npt.ArrayLike, *, name: str, at_least: int = AT_LEAST, vary: bool = True
) -> Array:
    """Return one checked sample of at least `at_least` numbers which vary unless `vary` is off."""
    column = numbers(values, name=name)
    if column.size < at_least:
        raise TooFewSubjects(f"{name} has {column.size} values; this test needs {at_least}")
    if vary and is_constant(column):
        raise ConstantResponse(
            f"{name} is {column[0]:g} in all {column.size} rows; there is nothing to test"
        )
    return column


def paired(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    names: tuple[str, str] = ("x", "y"),
    at_least: int = AT_LEAST,
) -> tuple[Array, Array]:
    """Return two checked samples of equal length, one row per pair."""
    first = sample(x, name=names[0], at_least=at_least, vary=False)
    second = sample(y, name=names[1], at_least=at_least, vary=False)
    if first.size != second.size:
        raise UnequalLength(
            f"{names[0]} has {first.size} rows and {names[1]} has {second.size}; pairs need both"
        )
    return first, second


def differences(x: Array, y: Array) -> Array:
    """Return x − y with float noise removed (nine digits of the larger operand).

    Ties and zeros of ranked differences depend on it: 0.3 − 0.1 and 0.2 − 0 must be equal.
    """
    largest = max(float(np.abs(x).max()), float(np.abs(y).max()))
    if largest == 0:
        return np.zeros_like(x)
    unit = 10.0 ** np.floor(np.log10(largest))
    without_noise: Array = np.round((x - y) / unit, 9) * unit
    return without_noise


def is_constant(column: Array) -> bool:
    """Tell whether a column does not vary beyond float noise."""
    spread = float(np.ptp(column))
    return spread <= 1e-12 * max(1e-300, float(np.abs(column).max()))


def rows_text(rows: npt.NDArray[np.intp] | Sequence[int], max_rows: int = 5) -> str:
    """Name rows for a message, counted from 1: 'row 4', 'rows 4, 9 and 3 more'."""
    row_numbers = [str(int(r) + 1) for r in rows[:max_rows]]
    rest = len(rows) - len(row_numbers)
    text = ", ".join(row_numbers) + (f" and {rest} more" if rest else "")
    return f"row {text}" if len(rows) == 1 else f"rows {text}"


def _number(value: object, name: str, row: int) -> float:
    if is_missing(value):
        return float("nan")
    try:
        return float(value)  # type: ignore[arg-type]  # anything that says it is a number
    except (TypeError, ValueError) as error:
        kind = type(value).__name__
        raise NotNumeric(f"{name} holds a {kind} in row {row + 1}; it must be a number") from error


def _reads_as_number(value: str | bytes) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True
