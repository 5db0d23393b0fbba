"""Conditions on a column, and groups of people made of them.

    groups={"experience": {"novice": "animation < 4", "expert": "animation = 4"}}

A condition is `COLUMN = VALUE` (also several: `COLUMN = ONE, OTHER`), `COLUMN != VALUE`, a number
behind `<`, `<=`, `>` or `>=`, or a column of truths by its name alone. A missing value fulfils no
condition.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from visavis.analysis.statistics_report.chosen_rows import ORDERS, condition_parts
from visavis.lab.errors import DataError, DesignError

Groups: TypeAlias = Mapping[str, Mapping[str, str]]
"""Groups of people by name: the condition of each level."""
TRUE: tuple[str, ...] = ("true", "1", "1.0", "yes")


@dataclass(frozen=True)
class Condition:
    """One condition: a column, its sign and the values behind it."""

    column: str
    sign: str
    values: tuple[str, ...]


def condition_of(text: str, about: str) -> Condition:
    """Return the condition that a text writes; `about` begins the message.

    Raises:
        DesignError: the text is none.
    """
    parts = condition_parts(text)
    if parts is None:
        name = text.strip()
        if name.isidentifier():
            return Condition(name, "=", TRUE)
        raise DesignError(
            f'{about}: {text!r} is no condition; write "gender = 1", "gender = 1, 3", '
            '"gender != 1", "age >= 30", or the name of a column of truths'
        )
    column, sign, value = parts
    if sign in ORDERS:
        try:
            float(value)
        except ValueError:
            raise DesignError(f"{about}: {text!r} compares with {value!r}, no number") from None
        return Condition(column, sign, (value,))
    values = tuple(v.strip() for v in value.split(","))
    return Condition(column, "!=" if sign == "!=" else "=", values)


def fulfils(rows: pd.DataFrame, condition: Condition) -> "pd.Series[bool]":
    """Tell of every row whether it fulfils a condition; where the column is missing, none does."""
    if condition.column not in rows:
        return pd.Series(False, index=rows.index)
    cells = rows[condition.column]
    numbers = pd.to_numeric(cells, errors="coerce").astype(float)
    if condition.sign in ORDERS:
        holds = ORDERS[condition.sign](numbers.to_numpy(), float(condition.values[0]))
        return pd.Series(np.asarray(holds, dtype=bool), index=rows.index)
    texts = cells.astype(object).where(cells.notna(), "").map(str)
    # Codes of answers are numbers, which a table may hold as 4, "4" or 4.0.
    is_one = texts.str.lower().isin([v.lower() for v in condition.values])
    is_one |= numbers.isin([float(v) for v in condition.values if _is_number(v)])
    there = cells.notna() & (texts != "")
    return (there & ~is_one) if condition.sign == "!=" else (there & is_one)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def columns_asked(where: Sequence[str], names: Sequence[str], groups: Groups) -> tuple[str, ...]:
    """Return the columns that conditions and groups of people read.

    `names` are those of factors and levels of a comparison; groups among them read their columns.
    """
    read = [condition_of(text, "where").column for text in where]
    columns = []
    for name in (*read, *names):
        own = groups.get(name)
        if own is None:
            columns += [name]
        else:
            columns += [condition_of(text, name).column for text in own.values()]
    return tuple(dict.fromkeys(columns))


def with_people(
    trials: pd.DataFrame, people: pd.DataFrame | None, columns: Sequence[str], groups: Groups
) -> pd.DataFrame:
    """Return trials with what their participants answered, and the groups that follow from it.

    `columns` are those wanted; the trials' own are not replaced. Somebody in none of the levels of
    a group has none there.

    Raises:
        DataError: a participant has two rows in `people`, or belongs to two levels of a group.
    """
    missing = [] if people is None else [c for c in columns if c not in trials and c in people]
    if people is not None and missing:
        names = people["participant"].astype(str)
        if names.duplicated().any():
            raise DataError(
                f"participant {names[names.duplicated()].iloc[0]} has two rows of answers; keep "
                "the valid one"
            )
        answers = people[["participant", *missing]]
        trials = trials.merge(answers, on="participant", how="left")
    for group, levels in groups.items():
        if group not in trials:
            trials = trials.assign(**{group: _levels_of(trials, group, levels)})
    return trials


def _levels_of(rows: pd.DataFrame, group: str, levels: Mapping[str, str]) -> "pd.Series[Any]":
    level_of: pd.Series[Any] = pd.Series([None] * len(rows), index=rows.index, dtype=object)
    for level, text in levels.items():
        mine = fulfils(rows, condition_of(text, f"group {group}, {level}"))
        both = mine & level_of.notna()
        if both.any():
            who = rows.loc[both, "participant"].iloc[0] if "participant" in rows else "a row"
            raise DataError(
                f"{who} is {level_of[both].iloc[0]} and {level} of {group}; make the conditions of "
                "its levels exclude each other"
            )
        level_of[mine] = level
    if "participant" in rows:  # a column of trials can differ from row to row of one person
        there = level_of[level_of.notna()]
        for who, own in there.groupby(rows.loc[there.index, "participant"]):
            if own.nunique() > 1:
                raise DataError(
                    f"{who} is {' and '.join(own.unique())} of {group} in different trials; make "
                    "groups of what is the same in all trials of a participant"
                )
    return level_of
