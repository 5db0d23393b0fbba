"""One fixed type for each column of a table, independent of the data.

Inferred types change with the data: an integer column becomes a float with its first missing
value, a flag nobody set becomes an object. Fixed types let two studies' tables be concatenated.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from visavis.lab.errors import DataError
from visavis.protocol.plan.columns import Column
from visavis.study.look_measures import AFTER, BEFORE, RAW

_DTYPES: dict[str, Any] = {
    "Int64": pd.Int64Dtype(),
    "Float64": pd.Float64Dtype(),
    "boolean": pd.BooleanDtype(),
    "string": pd.StringDtype(),
}
_FLAGS = ("on_at_onset", "cut_at_end", "calibration_accepted", "came_back", "track_right")
_NUMBERS = (
    "recording_part",
    "participant_index",
    "session",
    "part",
    "number",
    "block",
    "attempt",
    "active_index",
)


def column_type(column: Column) -> str:
    """Return the pandas type: Int64, Float64, boolean or string.

    Times in ns and counts are whole; shares (names that end in _01), other units are not.
    """
    name = column.name
    for prefix in (RAW, BEFORE, AFTER):
        name = name.removeprefix(prefix)
    if column.unit == "ns" or name in _NUMBERS:
        return "Int64"
    if column.unit == "1":
        return "Float64" if name.endswith("_01") else "Int64"
    if column.unit:
        return "Float64"
    return "boolean" if name in _FLAGS or name.startswith("is_") else "string"


def with_column_types(table: pd.DataFrame, columns: Mapping[str, Column]) -> pd.DataFrame:
    """Return a table with the types of its dictionary; columns it does not name stay.

    Raises DataError naming a column whose values do not fit its type.
    """
    series = {}
    for name, values in table.items():
        column = columns.get(str(name))
        series[name] = values if column is None else _cast(str(name), values, column_type(column))
    return pd.DataFrame(series, index=table.index)


def _cast(name: str, values: "pd.Series[Any]", kind: str) -> "pd.Series[Any]":
    plain_values: list[Any] = [
        None if missing else v for v, missing in zip(values, values.isna(), strict=True)
    ]
    if kind == "string":
        plain_values = [None if v is None else str(v) for v in plain_values]
    try:
        return pd.Series(pd.array(plain_values, dtype=_DTYPES[kind]), index=values.index)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"the column {name} does not hold {kind} values ({error}); it was not "
            "written by a session of this study"
        ) from error
