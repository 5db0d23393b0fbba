"""Further sections of the report: the source's own analysis, and its numbers."""

from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Bullets, Paragraph, Section
from visavis.analysis.statistics import StatisticsError, oneway_anova, tost_paired, tukey_hsd
from visavis.experiments.interpolation import published
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

SAME_WITHIN: Final = 0.25
"""Steps of the scale within which two methods count as equally natural."""


def as_printed(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return the source's analysis over all ratings, equivalence, and the printed means."""
    rows = analysis.selection.counted
    blocks: list[Block] = [
        Paragraph(
            "The source takes every rating as independent: a one-way ANOVA over methods and "
            "Tukey's test. That is shown here for comparison; ratings of one person are not "
            "independent, so the planned comparison above decides."
        )
    ]
    methods = [m for m in published.METHODS if m in set(rows["method"])]
    sentences = []
    try:
        sentences.append(
            oneway_anova(rows, "naturalness", factor="method", levels=methods).sentence()
        )
        sentences.append(tukey_hsd(rows, "naturalness", factor="method", levels=methods).sentence())
    except StatisticsError as problem:
        sentences.append(f"That cannot be computed: {problem}")
    sentences.append(equivalence(rows))
    blocks.append(Bullets(tuple(sentences)))
    misfits = published.impossible_means()
    misfit_list = "; ".join(f"{mean} ({method}, {subset})" for subset, method, mean in misfits)
    blocks.append(
        Paragraph(
            f"Of the {3 * len(published.SUBSETS)} printed means {len(misfits)} are those of no "
            f"whole-number ratings: {misfit_list}."
        )
    )
    return Extra(Section("printed", "As the source analysed it", tuple(blocks)))


def equivalence(rows: pd.DataFrame) -> str:
    """Return whether Slerp and LinEuler are equally natural, within a quarter of a step."""
    means = rows.pivot_table(index="participant", columns="method", values="naturalness")
    if not {"slerp", "lineuler"} <= set(means):
        return "Slerp and LinEuler were not both shown."
    both = means[["slerp", "lineuler"]].dropna()
    try:
        return tost_paired(
            np.asarray(both["slerp"]),
            np.asarray(both["lineuler"]),
            low=-SAME_WITHIN,
            high=SAME_WITHIN,
            names=("Slerp", "LinEuler"),
        ).sentence()
    except StatisticsError as problem:
        return f"Whether Slerp and LinEuler are equivalent cannot be computed: {problem}"
