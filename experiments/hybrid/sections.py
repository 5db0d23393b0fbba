"""Further sections of the report: votes cell by cell, and the sides."""

from collections.abc import Mapping, Sequence
from typing import Final

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from visavis.analysis.plots import draw, new_figure
from visavis.analysis.report import Block, Paragraph, Section
from visavis.analysis.report.blocks import Column, Table
from visavis.analysis.report.notation import fraction, percentage
from visavis.analysis.statistics.binomial import binomial_test
from visavis.experiments.hybrid.clips import CLIPS
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

COLOURS: Final = ("#b35806", "#f1a340", "#d0d0d0", "#998ec3", "#542788")
"""From votes for the clip to votes for the hybrid; told apart without colour vision."""
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
                percentage(positive_01(own), 0),
                fraction(p, 3) if p >= 0.001 else "< .001",
            )
        )
    blocks: list[Block] = [
        Table(
            (
                Column("pair"),
                *(Column(words, "right") for _, words in SCALE),
                Column("positive", "right"),
                Column("p", "right"),
            ),
            tuple(table_rows),
            "Votes by motion and number of poses",
            "Positive, as the source groups votes: all but “clip significantly”. p: "
            "sign test over people of their mean vote against no preference, "
            f"Bonferroni-corrected over {len(cells)} cells.",
        ),
        Paragraph(consistency(rows)),
    ]
    shares = {
        (clip, increment): [
            float((own["preference"] == value).mean())
            for own in [rows[(rows["clip"] == clip) & (rows["increment"] == increment)]]
            for value, _ in SCALE
        ]
        for clip, increment in cells
    }
    figure = draw(
        "votes",
        lambda: _bars(shares),
        title="Votes by motion and number of poses",
        caption="Shares of votes from “clip significantly” (left, negative as the source groups "
        "them) to “hybrid significantly”; all right of the first colour are positive.",
        alternative=f"A bar of five shares for each of {len(shares)} pairs.",
        is_simulated=analysis.is_simulated,
    )
    return Extra(Section("votes", "Votes", (picture_of(figure), *blocks)), (figure,))


def positive_01(own: pd.DataFrame) -> float:
    """Return the share of votes that the source counts as positive: all but for the clip much."""
    return float((own["preference"] > SCALE[0][0]).mean())


def _bars(shares: Mapping[tuple[str, int], Sequence[float]]) -> Figure:
    """Return stacked bars, one for each pair, from votes for the clip to votes for the hybrid."""
    figure = new_figure(6.4, 0.8 + 0.34 * len(shares))
    axes = figure.add_subplot()
    for place, share in enumerate(shares.values()):
        left = 0.0
        for width, colour in zip(share, COLOURS, strict=True):
            axes.barh(place, width, left=left, color=colour, edgecolor="white", height=0.7)
            left += width
    axes.set_yticks(range(len(shares)), [f"{clip}, increment {i}" for clip, i in shares])
    axes.invert_yaxis()
    axes.set(xlim=(0, 1), xlabel="share of votes")
    patches = [Patch(color=c, label=words) for c, (_, words) in zip(COLOURS, SCALE, strict=True)]
    axes.legend(handles=patches, ncols=3, loc="lower center", bbox_to_anchor=(0.4, 1.0))
    return figure


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
