"""Columns of tables, first those that the session writes into every trial row."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final


@dataclass(frozen=True)
class Column:
    """A column of a table: its unit ("1" for counts and shares, "" for none) and what it holds.

    `levels` say what codes mean.
    """

    name: str
    unit: str
    description: str
    levels: Mapping[str, str] = field(default_factory=dict, hash=False)


def read_columns(path: Path) -> dict[str, tuple[Column, ...]]:
    """Return the columns that a CSV file describes, by table: table, name, unit, description."""
    columns: dict[str, tuple[Column, ...]] = {}
    with path.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            column = Column(row["name"], row["unit"], row["description"])
            columns[row["table"]] = (*columns.get(row["table"], ()), column)
    return columns


_COLUMNS: Final = read_columns(Path(__file__).with_suffix(".csv"))

IDENTITY_COLUMNS: Final = _COLUMNS["identity"]
"""Columns that say whose trial a row is and how it ended."""
DELIVERY_COLUMNS: Final = _COLUMNS["delivered"]
"""The last columns of every trial row: what was delivered while the trial ran."""
ENGINE_COLUMNS: Final = (*IDENTITY_COLUMNS, *DELIVERY_COLUMNS)
"""Every column that the session writes in any study."""
ANALYSED_COLUMNS: Final = _COLUMNS["analysed"]
"""Columns that the analysis adds to the trials of any study."""
