"""Further sections of the report: the source's own analysis, and its numbers."""

from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Bullets, Column, Paragraph, Section, Table
from visavis.analysis.report.notation import decimal, probability
from visavis.analysis.statistics import StatisticsError, oneway_anova, tost_paired, tukey_hsd
from visavis.analysis.statistics.adjust import adjust_p
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
    blocks += subset_table(rows, analysis.people)
    misfits = published.impossible_means()
    misfit_list = "; ".join(f"{mean} ({method}, {subset})" for subset, method, mean in misfits)
    blocks.append(
        Paragraph(
            f"Of the {3 * len(published.SUBSETS)} printed means {len(misfits)} are those of no "
            f"whole-number ratings: {misfit_list}."
        )
    )
    return Extra(Section("printed", "As the source analysed it", tuple(blocks)))


GROUPS: Final = {
    "novice": ("animation_experience", (1, 2, 3)),
    "experienced": ("animation_experience", (4,)),
    "male": ("gender", (2,)),
    "female": ("gender", (1,)),
    "panel": ("recruited_by", (1,)),
}
"""Groups of people that the source analyses: the question, and the answers of the group."""


def subset_rows(rows: pd.DataFrame, people: pd.DataFrame, subset: published.Subset) -> pd.DataFrame:
    """Return the ratings of a printed subset; none where nobody said that they belong to it."""
    if subset.gesture:
        return rows[rows["gesture"] == subset.gesture]
    if subset.name == "main":
        return rows
    column, answers = GROUPS.get(subset.name, ("", ()))
    if column not in people:
        return rows.iloc[:0]
    group = people.loc[pd.to_numeric(people[column], errors="coerce").isin(answers), "participant"]
    return rows[rows["participant"].isin(set(group))]


def subset_table(rows: pd.DataFrame, people: pd.DataFrame) -> list[Block]:
    """Return the source's analysis by experience, gender and gesture, corrected as one family."""
    methods, findings = published.METHODS, []
    for subset in published.SUBSETS:
        own = subset_rows(rows, people, subset)
        own = own[own["naturalness"].notna()]
        try:
            test = oneway_anova(own, "naturalness", factor="method", levels=list(methods))
        except StatisticsError:
            continue
        means = own.groupby("method")["naturalness"].mean()
        findings.append((subset, own["participant"].nunique(), means, float(test.p)))
    if not findings:
        return []
    adjusted = adjust_p([p for *_, p in findings])
    table_rows = tuple(
        (
            subset.name,
            str(people_count),
            *(decimal(float(means[m]), 2) for m in methods),
            probability(float(p)),
            ", ".join(subset.means),
            subset.p,
        )
        for (subset, people_count, means, _), p in zip(findings, adjusted, strict=True)
    )
    heads = ("Subset", "People", "LinEuler", "Slerp", "Squad", "p", "printed means", "printed p")
    return [
        Table(
            tuple(Column(head, "left" if head == "Subset" else "right") for head in heads),
            table_rows,
            "The source's hypotheses: experience, gender, gesture",
            "One-way ANOVA over methods in each subset, Holm-corrected over the rows; printed p "
            "are not corrected. Experienced is whose work animation is or was; panel are those who "
            "say that a panel sent them.",
        )
    ]


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
