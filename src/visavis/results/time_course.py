"""Looks over time: how often people looked at the agent, by condition and moment of the trial."""

from collections.abc import Mapping, Sequence
from typing import Final

import pandas as pd

from visavis.protocol.plan.columns import Column
from visavis.results.selection import Selection
from visavis.study.look_course import ON_01, STEP_MS, T_MS

TIME_COURSE: Final = "time_course"
"""The table of looks over time, by participant; before selection, by trial."""
TIME_COURSE_COLUMNS: Final = (
    Column(T_MS, "ms", f"middle of a step of {STEP_MS} ms, from the start of looking"),
    Column(
        ON_01,
        "1",
        "share of usable gaze on the agent in this step (of a crowd: on anybody), mean over trials",
    ),
    Column("trials", "1", "trials with usable gaze in this step"),
)
KEY: Final = ["participant", "session", "trial_id", "attempt"]


def with_time_course(
    tables: Mapping[str, pd.DataFrame], selection: Selection, cells: Sequence[str]
) -> dict[str, pd.DataFrame]:
    """Return tables with looks over time by participant and level of the first of `cells`.

    `tables` may have them by trial; only trials that count enter.
    """
    by_trial = tables.get(TIME_COURSE)
    others = {name: table for name, table in tables.items() if name != TIME_COURSE}
    if by_trial is None or by_trial.empty or not cells:
        return others
    factor = cells[0]
    steps = by_trial[[*KEY, T_MS, ON_01]]
    trials = steps.merge(selection.counted[[*KEY, factor]], on=KEY, how="inner")
    usable = trials.dropna(subset=[ON_01])
    by = usable.groupby(["participant", factor, T_MS], observed=True)[ON_01]
    course = by.agg(["mean", "size"]).reset_index()
    return {**others, TIME_COURSE: course.rename(columns={"mean": ON_01, "size": "trials"})}
