"""Measures of the waving study: accuracy, realism and response time per cell, answers by place."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from experiments.waving.design import DIRECTIONS, TECHNIQUES
from stimuli.scenes.office import CUSTOMERS

PLACES: Final = tuple(c.name for c in CUSTOMERS)
EYE_HEIGHT_TOLERANCE_M: Final = 0.05
"""At this distance from the planned eye height a warped wave loses or wins some 3 % of coverage,
a quarter of what warping adds (`benchmarks.waving_participants --eye-heights`)."""
MEASURES: Final = ("accuracy", "realism", "response_ms")


@dataclass(frozen=True)
class Column:
    """A column of a table: its unit ("" for none) and what it holds."""

    name: str
    unit: str
    description: str


def analysed_trials(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the trials that count: finished, not training, with an answer to the first question.

    Of a trial that was performed again the last attempt counts.
    """
    kept = trials[(trials["status"] == "complete") & ~trials["is_practice"].astype(bool)]
    kept = kept[kept["who"].notna()]
    key = [c for c in ("participant", "session", "trial_id") if c in kept]
    found: pd.DataFrame = kept.drop_duplicates(key, keep="last").reset_index(drop=True)
    return found


def cell_means(trials: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant, technique and direction, of trials that count.

    `accuracy` is the share of right answers, `realism` the mean rating (NaN when none was
    given), `response_ms` the median time from the question to the answer, `n` the trials.
    """
    frame = trials.assign(
        accuracy=trials["is_right"].astype(float),
        realism=trials["realism"].astype(float),
        response_ms=trials["who_ms"].astype(float),
    )
    grouped = frame.groupby(["participant", "technique", "direction"], sort=True)
    means = grouped.agg(
        accuracy=("accuracy", "mean"),
        realism=("realism", "mean"),
        response_ms=("response_ms", "median"),
        n=("accuracy", "size"),
    ).reset_index()
    order = {name: i for i, name in enumerate((*TECHNIQUES, *DIRECTIONS))}
    found: pd.DataFrame = means.sort_values(
        ["participant", "technique", "direction"],
        key=lambda column: column.map(order) if column.name != "participant" else column,
        ignore_index=True,
    )
    return found


def complete_participants(means: pd.DataFrame) -> tuple[str, ...]:
    """Return the participants who have every cell; only they can be compared within."""
    wanted = len(TECHNIQUES) * len(DIRECTIONS)
    sizes = means.groupby("participant").size()
    return tuple(map(str, sizes.index[sizes == wanted]))


def confusion(trials: pd.DataFrame, technique: str | None = None) -> npt.NDArray[np.int64]:
    """Return how often a place (row) was answered as a place (column), (5, 5)."""
    chosen = trials if technique is None else trials[trials["technique"] == technique]
    counts = np.zeros((len(PLACES), len(PLACES)), dtype=np.int64)
    for target, who in zip(chosen["target_place"], chosen["who"], strict=True):
        counts[PLACES.index(str(target)), PLACES.index(str(who))] += 1
    return counts


def relative_confusion(trials: pd.DataFrame) -> pd.DataFrame:
    """Return counts of answers relative to one's own place by technique and direction.

    Answers are self, left, right, and farther.
    """
    own = trials["participant_place"].map(PLACES.index)
    steps = trials["who"].map(PLACES.index) - own
    told = steps.map({0: "self", -1: "left", 1: "right"}).fillna("farther")
    frame = trials.assign(told=told)
    table = frame.groupby(["technique", "direction", "told"]).size().unstack("told", fill_value=0)
    index = pd.MultiIndex.from_product([TECHNIQUES, DIRECTIONS], names=["technique", "direction"])
    found: pd.DataFrame = table.reindex(
        index=index, columns=["left", "self", "right", "farther"], fill_value=0
    ).reset_index()
    return found


def eye_heights(trials: pd.DataFrame) -> pd.DataFrame:
    """Return each participant's eye height, how far it is from the planned one, whether too far.

    One row per participant; NaN and False where no head was tracked. Empty for recordings that do
    not have it.
    """
    columns = ["participant", "eye_height_m", "eye_height_off_m", "eye_height_is_off"]
    if not {"eye_height_m", "planned_eye_height_m"} <= set(trials.columns):
        return pd.DataFrame(columns=columns)
    done = trials[trials["status"] == "complete"]
    height = pd.to_numeric(done["eye_height_m"], errors="coerce")
    off = height - pd.to_numeric(done["planned_eye_height_m"], errors="coerce")
    frame = pd.DataFrame({
        "participant": done["participant"], "eye_height_m": height, "eye_height_off_m": off,
    })  # fmt: skip
    found = frame.groupby("participant", sort=True).median().reset_index()
    too_far = found["eye_height_off_m"].abs() > EYE_HEIGHT_TOLERANCE_M
    table: pd.DataFrame = found.assign(eye_height_is_off=too_far)
    return table[columns]
