"""In which order people looked: every fixation, moves from area to area, typical trials."""

from collections.abc import Mapping, Sequence
from typing import Final

import pandas as pd

from visavis.protocol.plan.columns import Column
from visavis.results.analysis import StudyAnalysis
from visavis.results.selection import Selection
from visavis.results.time_course import KEY
from visavis.results.unusual import key_of_row
from visavis.study.look_order import (
    AREAS,
    DURATION_MS,
    HEAD,
    NUMBER,
    ON,
    ONSET_MS,
    RIGHT_DEG,
    UP_DEG,
)
from visavis.study.sections import TrialToSee

FIXATIONS: Final = "fixations"
"""The table of fixations, of all trials that count; before selection, of all that were measured."""
MOVES: Final = "gaze_moves"
"""The table of moves of gaze, by participant and condition."""
FROM: Final = "moves_from"
TO: Final = "moves_to"
PER_TRIAL: Final = "moves_per_trial"
MAX_LEVELS: Final = 6
"""Of more conditions than these, the first have their scan paths shown."""
FIXATION_COLUMNS: Final = (
    Column(NUMBER, "1", "place of the fixation in its trial, from 1"),
    Column(ONSET_MS, "ms", "its onset from the start of looking"),
    Column(DURATION_MS, "ms", "its duration, the last sample held one step"),
    Column(ON, "", "what most of its samples are on: agent, others (heads) or elsewhere"),
    Column(HEAD, "1", "index of that head in the scene; missing elsewhere"),
    Column(RIGHT_DEG, "deg", "its mean direction in the world, to the right of −z"),
    Column(UP_DEG, "deg", "its mean direction in the world, upwards"),
)
"""Fixations are those by velocity, as in `ivt_fixation_count`."""
MOVE_COLUMNS: Final = (
    Column(FROM, "", "what a fixation was on: agent, others (heads) or elsewhere"),
    Column(TO, "", "what the next one was on; others to others: to another head"),
    Column(PER_TRIAL, "1", "such moves in a trial, mean over the participant's trials"),
    Column("trials", "1", "trials that count, with at least one fixation"),
)


def with_fixations(
    tables: Mapping[str, pd.DataFrame], selection: Selection, cells: Sequence[str]
) -> dict[str, pd.DataFrame]:
    """Return tables with the fixations of trials that count, and moves by the first of `cells`."""
    every = tables.get(FIXATIONS)
    others = {name: table for name, table in tables.items() if name != FIXATIONS}
    if every is None or every.empty or not cells:
        return others
    factor = cells[0]
    trials = selection.counted[[*KEY, factor]]
    rest = [c.name for c in FIXATION_COLUMNS]
    mine = every.merge(trials, on=KEY, how="inner")[[*KEY, factor, *rest]]
    mine = mine.assign(**{HEAD: mine[HEAD].astype("Int64")})
    return {**others, FIXATIONS: mine, MOVES: moves_of(mine, factor)}


def moves_of(fixations: pd.DataFrame, factor: str) -> pd.DataFrame:
    """Return every participant's moves a trial, for each level of a factor, from and to each area.

    A move leads from a fixation to the next where that is on something else; two in a row on one
    head, or elsewhere, are none. Of a trial without any fixation nothing is known: it does not
    count.
    """
    by = ["participant", factor]
    after = fixations.groupby(KEY, sort=False)[[ON, HEAD, NUMBER]].shift(-1)
    is_move = (after[NUMBER] == fixations[NUMBER] + 1) & (
        (after[ON] != fixations[ON]) | (after[HEAD].fillna(-1) != fixations[HEAD].fillna(-1))
    )
    moves = fixations[is_move].assign(**{FROM: fixations[ON], TO: after[ON]})
    counts = moves.groupby([*by, FROM, TO], observed=True).size()
    of_people_with_gaze = fixations.drop_duplicates([*KEY, factor])
    of_people = of_people_with_gaze.groupby(by, observed=True).size().reset_index(name="trials")
    rows = [
        (who, level, start, end, counts.get((who, level, start, end), 0) / n, n)
        for who, level, n in of_people.itertuples(index=False)
        for start in AREAS
        for end in AREAS
        if start != end or start == "others"
    ]
    return pd.DataFrame(rows, columns=[*by, FROM, TO, PER_TRIAL, "trials"])


def typical_trials(analysis: StudyAnalysis) -> list[tuple[object, TrialToSee, pd.DataFrame]]:
    """Return of each level the trial with the median number of fixations, its name and they.

    Of several the first is taken; levels without any trial are left out, and those after
    `MAX_LEVELS`.
    """
    fixations = analysis.tables.get(FIXATIONS)
    if fixations is None:
        return []
    factor, rows = str(fixations.columns[len(KEY)]), analysis.selection.counted
    typical: list[tuple[object, TrialToSee, pd.DataFrame]] = []
    for level in analysis.levels[factor][:MAX_LEVELS]:
        mine = fixations[fixations[factor] == level]
        counts = mine.groupby(KEY, sort=True).size()
        if counts.empty:
            continue
        key = list(counts.index[int((counts - counts.median()).abs().to_numpy().argmin())])
        trial = mine[(mine[KEY] == key).all(axis=1)]
        row = rows[(rows[KEY] == key).all(axis=1)].iloc[0]
        why = f"{level}: {len(trial)} fixations, the median of its kind"
        typical.append((level, TrialToSee(*key_of_row(row), why), trial))
    return typical


def shown_trials(analysis: StudyAnalysis) -> list[TrialToSee]:
    """Return the trials whose scan paths a report shows."""
    return [trial for _, trial, _ in typical_trials(analysis)]
