"""Further sections of the report: votes cell by cell, and the sides."""

from typing import Final

import pandas as pd

from visavis.analysis.report import Block, Paragraph, Section
from visavis.analysis.report.blocks import Column, Table
from visavis.analysis.report.notation import fraction
from visavis.analysis.statistics.binomial import binomial_test
from visavis.experiments.hybrid.clips import CLIPS
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

SCALE: Final = (
    (-2, "clip significantly"),
    (-1, "clip slightly"),
    (0, "equal"),
    (1, "hybrid slightly"),
    (2, "hybrid significantly"),
)


def votes(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return every cell's votes with a sign test of each person's mean, corrected over cells."""
    rows = analysis.selection.counted
    rows = rows[rows["preference"].notna()]
    cells = [
        (c, i)
        for c in CLIPS
        for i in experiment.levels["increment"]
        if ((rows["clip"] == c) & (rows["increment"] == i)).any()
    ]
    table_rows = []
    for clip, increment in cells:
        own = rows[(rows["clip"] == clip) & (rows["increment"] == increment)]
        counts = [int((own["preference"] == value).sum()) for value, _ in SCALE]
        p = min(1.0, sign_test_p(own) * len(cells))
        table_rows.append(
            (
                f"{clip}, increment {increment}",
                *map(str, counts),
                fraction(p, 3) if p >= 0.001 else "< .001",
            )
        )
    blocks: list[Block] = [
        Table(
            (Column("pair"), *(Column(words, "right") for _, words in SCALE), Column("p", "right")),
            tuple(table_rows),
            "Votes by motion and number of poses",
            "p: sign test over people of their mean vote against no preference, "
            f"Bonferroni-corrected over {len(cells)} cells.",
        ),
        Paragraph(consistency(rows)),
    ]
    return Extra(Section("votes", "Votes", tuple(blocks)))


def sign_test_p(own: pd.DataFrame) -> float:
    """Return the two-sided p of a sign test of people's mean votes; ties are left out."""
    means = own.groupby("participant")["preference"].mean()
    above, below = int((means > 0).sum()), int((means < 0).sum())
    if above + below == 0:
        return 1.0
    return binomial_test(above, above + below).p


def consistency(rows: pd.DataFrame) -> str:
    """Return how alike votes are when the sides are swapped, in words."""
    both = rows.pivot_table(
        index=["participant", "clip", "increment"], columns="hybrid_side", values="preference"
    )
    if not {"left", "right"} <= set(both):
        return "Pairs were not shown on both sides."
    both = both.dropna()
    n_opposite = int((both["left"] * both["right"] < 0).sum())
    mean_right = float(
        (rows["preference"].where(rows["hybrid_side"] == "right", -rows["preference"])).mean()
    )
    return (
        f"With sides swapped, {n_opposite} of {len(both)} pairs of votes contradict each other. "
        f"The mean vote for the right side is {mean_right:+.2f} steps."
    )
