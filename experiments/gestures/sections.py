"""Further sections of both reports: the source's own tests, and its numbers beside ours."""

from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Bullets, Column, Paragraph, Section, Table
from visavis.analysis.report.notation import decimal, probability
from visavis.analysis.statistics import StatisticsError, independent_t, one_sample_t, paired_t
from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import FILLS
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

NAMES: Final = {"still": "no body motion", "corpus": "corpus", "holds": "holds"}


def person_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the mean rating of every person (rows) by body (columns)."""
    table: pd.DataFrame = rows.pivot_table(
        index="participant", columns="body", values="naturalness"
    )
    return table.reindex(columns=list(FILLS))


def ratings_as_printed(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return means and SDs beside those printed, the printed unpaired t, and paired ones."""
    means = person_means(analysis.selection.counted).dropna()
    rows = [
        (
            NAMES[body],
            decimal(float(means[body].mean()), 2),
            decimal(float(means[body].std(ddof=1)), 2) if len(means) > 1 else "",
            decimal(published.RATINGS[body].mean, 2),
            decimal(published.RATINGS[body].sd, 2),
        )
        for body in FILLS
    ]
    tests = []
    for (one, other), t_printed in published.TESTS.items():
        try:
            x, y = np.asarray(means[one]), np.asarray(means[other])
            unpaired_test = independent_t(x, y)
            paired = paired_t(x, y)
        except StatisticsError as problem:
            tests.append((f"{NAMES[one]}, {NAMES[other]}", f"not computed: {problem}", "", "", ""))
            continue
        tests.append(
            (
                f"{NAMES[one]}, {NAMES[other]}",
                f"{decimal(unpaired_test.t, 2)} ({probability(unpaired_test.p)})",
                f"{decimal(paired.t, 2)} ({probability(paired.p)})",
                decimal(t_printed, 2),
                str(2 * published.PEOPLE - 2),
            )
        )
    blocks: list[Block] = [
        Paragraph(
            "The source tests people's means as if three groups of people had seen the three "
            "bodies. Everybody saw all of them, so paired tests stand beside, and the planned "
            "comparison above decides."
        ),
        Table(
            (
                Column("body"),
                Column("mean", "right"),
                Column("SD", "right"),
                Column("printed mean", "right"),
                Column("printed SD", "right"),
            ),
            tuple(rows),
            "Naturalness, mean over people of their means of twelve films",
        ),
        Table(
            (
                Column("bodies"),
                Column("unpaired t", "right"),
                Column("paired t", "right"),
                Column("printed t", "right"),
                Column("its df", "right"),
            ),
            tuple(tests),
            "Tests of two bodies, unpaired as printed and paired",
        ),
        Bullets(published.SLIPS),
    ]
    return Extra(Section("printed", "As the source analysed it", tuple(blocks)))


def votes_as_printed(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return the mean vote with the source's test, beside what is printed."""
    means = analysis.selection.counted.groupby("participant")["vote_for_holds"].mean().dropna()
    try:
        sentence = one_sample_t(np.asarray(means), name="mean vote").sentence()
    except StatisticsError as problem:
        sentence = f"That cannot be computed: {problem}"
    printed_result = (
        f"The source prints a mean of {decimal(published.VOTES_MEAN, 2)} and "
        f"t({published.PEOPLE - 1}) = {decimal(published.VOTES_T, 2)}."
    )
    blocks = (Bullets((sentence, printed_result, *published.SLIPS)),)
    return Extra(Section("printed", "As the source analysed it", blocks))
