"""Further sections of the report: films as they are, votes, comprehension."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Bullets, Paragraph, Section
from visavis.analysis.report.blocks import Column, Table
from visavis.analysis.report.notation import decimal
from visavis.analysis.statistics import StatisticsError, tost_one_sample
from visavis.experiments.cameras.study import CAMERAS, PAIRS
from visavis.experiments.cameras.walks import WALKS
from visavis.results.analysis import StudyAnalysis
from visavis.running.film_store import film_store
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

NAMES: Final = {
    "topology": "topology",
    "follow": "follow",
    "roadmap": "roadmap",
    "placed": "placed by hand",
}


def cameras(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what the films are like by geometry, then what people said of them."""
    rows = analysis.selection.counted
    rows = rows[rows["preference"].notna()]
    within = float(experiment.parameters["same_within"])
    blocks: list[Block] = [
        _sheets(experiment),
        _comprehension(rows),
        Paragraph(
            f"Two cameras count as equally good where the mean vote lies within ±{within:g} steps, "
            "which the plan fixed before anybody looked. Two one-sided tests over participants' "
            "mean votes, without correction, each at .05:"
        ),
        Bullets(tuple(equivalence(rows, pair, within) for pair in PAIRS)),
        Paragraph(sides(rows)),
    ]
    return Extra(Section("cameras", "The films and what was said of them", tuple(blocks)))


def _sheets(experiment: StudyExperiment) -> Table:
    """Return every camera's objective measures, means over its films."""
    store = film_store(experiment)
    table_rows = []
    for camera, lens in CAMERAS.items():
        sheets = [store.film_seen(film).sheet for film in experiment.films if film.lens == lens]
        if not sheets:
            continue

        def mean(of: Sequence[float | None], digits: int) -> str:
            numbers = [value for value in of if value is not None]
            return decimal(float(np.mean(numbers)), digits) if numbers else "–"

        table_rows.append(
            (
                NAMES[camera],
                mean([None if s.seen_01 is None else 100 * s.seen_01 for s in sheets], 1),
                mean([s.longest_lost_s or 0.0 for s in sheets], 1),
                mean([s.size_off_by for s in sheets], 2),
                mean([s.shots - 1 for s in sheets], 1),
                mean([s.median_shot_s for s in sheets], 1),
                mean([s.cuts_below_30_deg for s in sheets], 1),
                mean([s.lines_crossed for s in sheets], 1),
                mean([s.jerk_mps3 or 0.0 for s in sheets], 1),
                mean([s.collisions for s in sheets], 1),
            )
        )
    heads = (
        "walker seen (%)",
        "longest lost (s)",
        "size off by",
        "cuts",
        "shot (s)",
        "cuts below 30°",
        "lines crossed",
        "jerk (m/s³)",
        "collisions",
    )
    return Table(
        (Column("camera"), *(Column(words, "right") for words in heads)),
        tuple(table_rows),
        "What the films are like",
        f"By geometry, before anybody judged them; means over {len(WALKS)} walks.",
    )


def _comprehension(rows: pd.DataFrame) -> Table:
    """Return in how many showings of each camera's film what was done could be seen."""
    table_rows = []
    parts = rows["pair"].str.split("|", expand=True)
    for camera in CAMERAS:
        saw = (
            pd.concat(
                [
                    rows.loc[parts[0] == camera, "saw_first"],
                    rows.loc[parts[1] == camera, "saw_second"],
                ]
            )
            .dropna()
            .astype(bool)
        )
        share = f"{100 * float(saw.mean()):.0f}" if len(saw) else "–"
        table_rows.append((NAMES[camera], str(int(saw.sum())), str(len(saw)), share))
    return Table(
        (Column("camera"), *(Column(words, "right") for words in ("seen", "of", "%"))),
        tuple(table_rows),
        "What was done on the way could be seen",
    )


def equivalence(rows: pd.DataFrame, pair: str, within: float) -> str:
    """Return whether the films of two cameras are equally good within so many steps of the vote."""
    first, second = pair.split("|")
    name = f"{NAMES[first]} over {NAMES[second]}"
    means = rows[rows["pair"] == pair].groupby("participant")["preference"].mean()
    try:
        return tost_one_sample(
            means.to_numpy(float), low=-within, high=within, name=name
        ).sentence()
    except StatisticsError as problem:
        return f"{name}: equivalence cannot be computed: {problem}"


def sides(rows: pd.DataFrame) -> str:
    """Return whether the film on one side was preferred, in words."""
    for_left = rows["preference"].where(rows["first_side"] == "left", -rows["preference"])
    return (
        f"The first camera's film stood left in {int((rows['first_side'] == 'left').sum())} of "
        f"{len(rows)} trials. The mean vote for the left film is {float(for_left.mean()):+.2f} "
        "steps."
    )
