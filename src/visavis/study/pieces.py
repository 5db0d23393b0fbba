"""Measuring a study trial by trial: each result is saved at once, so a stop loses only one."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.parameters import parameters_from
from visavis.recording.reader import Recording

Rows: TypeAlias = list[dict[str, Any]]


@dataclass(frozen=True)
class MeasuredTrial:
    """The measures of one trial: columns of its row, and rows of further tables by name.

    Values are those of JSON; a number that is missing is None.
    """

    row: Mapping[str, Any]
    tables: Mapping[str, Rows] = field(default_factory=dict)

    @classmethod
    def plain(cls, row: Mapping[str, Any], tables: Mapping[str, Rows]) -> "MeasuredTrial":
        """Return a copy with NumPy's numbers as Python's, and NaN as None."""
        return cls(
            {k: _plain(v) for k, v in row.items()},
            {
                name: [{k: _plain(v) for k, v in one.items()} for one in rows]
                for name, rows in tables.items()
            },
        )


@dataclass(frozen=True)
@of_kinds()
class Pieces:
    """How the trials of a study are measured one by one from the recording.

    `how` is a dataclass of settings (`analyse --set`).
    `trials` names the trials of a session that can be measured, `measure` measures one. Saved
    results are valid for the same `version` and the same values of the fields `kept_by`, which
    every table names as `measure_FIELD`. `of_session` adds measures of the whole session, given its
    rows and tables. `tables` are the columns of further tables by name.
    """

    how: Any
    trials: Callable[[Recording], Sequence[str]]
    measure: Callable[[Recording, str, Any], MeasuredTrial]
    version: int
    kept_by: Sequence[str] = ()
    of_session: (
        Callable[[Recording, Rows, dict[str, Rows], Any], tuple[Rows, dict[str, Rows]]] | None
    ) = None
    tables: Mapping[str, Sequence[Column]] = field(default_factory=dict)

    @property
    def settable(self) -> tuple[str, ...]:
        """Names of the settings that `analyse --set` replaces."""
        return tuple(f.name for f in fields(self.how))

    def how_with(self, settings: Mapping[str, Any]) -> Any:
        """Return `how` with these settings; settings with other names are ignored.

        Raises:
            ConfigError: a value does not exist.
        """
        own = {k: v for k, v in settings.items() if k in self.settable}
        return parameters_from(type(self.how), own, "measuring")

    def marks(self, how: Any) -> dict[str, Any]:
        """Return the columns that say in every table how it was measured."""
        return {f"measure_{name}": getattr(how, name) for name in self.kept_by}

    def measure_all(self, recording: Recording, how: Any) -> dict[str, MeasuredTrial]:
        """Measure every trial of a session that can be measured; return them by identifier."""
        return {name: self.measure(recording, name, how) for name in self.trials(recording)}

    def put_together(
        self,
        recording: Recording,
        rows: pd.DataFrame,
        measures_by_trial: Mapping[str, MeasuredTrial],
        factors: Sequence[str],
        how: Any,
    ) -> tuple[pd.DataFrame, dict[str, pd.DataFrame]]:
        """Return a session's rows with the measures, and its further tables.

        Rows of these begin with participant, trial and the levels of `factors`.
        """
        columns = dict.fromkeys((*rows, *(c for m in measures_by_trial.values() for c in m.row)))
        session_rows: Rows = []
        tables: dict[str, Rows] = {name: [] for name in self.tables}
        for row in rows.to_dict("records"):
            own = {str(k): v for k, v in row.items()} | self.marks(how)
            mine = (
                measures_by_trial.get(str(row["trial_id"])) if row["status"] == "complete" else None
            )
            if mine is not None:
                place = {n: own[n] for n in ("participant", "trial_id", *factors) if n in own}
                own |= mine.row
                for name, several in mine.tables.items():
                    tables[name] += [{**place, **one} for one in several]
            session_rows.append(own)
        if self.of_session is not None:
            session_rows, tables = self.of_session(recording, session_rows, tables, how)
        column_names = [
            str(c) for c in dict.fromkeys((*columns, *(c for row in session_rows for c in row)))
        ]
        return (
            _frame(session_rows, column_names),
            {name: pd.DataFrame(several) for name, several in tables.items()},
        )


def _frame(rows: Rows, columns: Sequence[str]) -> pd.DataFrame:
    """Return a table in which whole numbers stay whole where some are missing."""
    table = pd.DataFrame(rows, columns=list(columns))
    for name in columns:
        values = [v for row in rows if not _is_missing(v := row.get(name))]
        is_whole = all(isinstance(v, int) and not isinstance(v, bool) for v in values)
        if values and is_whole and len(values) < len(rows):
            table[name] = table[name].astype("Int64")
    return table


def _is_missing(value: Any) -> bool:
    return value is None or value is pd.NA or bool(value != value)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value
