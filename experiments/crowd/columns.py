"""Descriptions of the crowd study's own columns; the kit describes those of every session."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from visavis.experiments.crowd.design import CROWDS
from visavis.protocol.plan.columns import Column, read_columns
from visavis.results.time_course import TIME_COURSE, TIME_COURSE_COLUMNS

_COLUMNS: Final = read_columns(Path(__file__).with_suffix(".csv"))

TRIALS: Final = _COLUMNS["trials"]
"""Columns that a walk writes into its row, and its measures."""
SIMILARITY: Final = (
    *_COLUMNS["similarity"],
    *(
        Column(f"between_{crowd}", "1", f"Dice of whole blocks in configuration {crowd}")
        for crowd in CROWDS
    ),
)
TABLES: Final[Mapping[str, Sequence[Column]]] = {
    **{name: _COLUMNS[name] for name in ("collisions", "crossings", "cells", "pulses")},
    TIME_COURSE: TIME_COURSE_COLUMNS,
}
"""Tables beside those of every study."""
