"""The section of a report with confusion matrices: answers by the option that was right."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.figure import Figure

from visavis.analysis.plots import BLACK, draw, new_figure
from visavis.analysis.report import Paragraph, Section
from visavis.analysis.report.notation import count_of, fraction
from visavis.protocol.plan.columns import Column as Described
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Confusion, Extra
from visavis.study.texts import label_of

MAX_ACROSS = 3
PANEL_IN = 4.2
DARK_01 = 0.55
"""Share above which a cell is so dark that its text is white."""
MAX_LEVEL_TICK = 10
"""Labels are slanted where an option has more letters."""


def confusion_section(of: Confusion, analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return the section on confusion matrices, its figure and its table."""
    trials = analysis.selection.counted
    options = tuple(experiment.responses[of.answered].options)
    levels = (None,) if of.by is None else experiment.levels[of.by]
    each = {level: confusion_counts(of, trials, options, level) for level in levels}
    figure = draw(
        of.name,
        lambda: _figure(of, each, options, experiment),
        title=of.title,
        caption="Rows: what was right; columns: the answer. Shades and numbers: share of the "
        "answers in a row; counts below.",
        alternative=f"{count_of(len(each), 'confusion matrix', 'confusion matrices')} of "
        f"{len(options)} options.",
        is_simulated=analysis.is_simulated,
    )
    every = confusion_counts(of, trials, options)
    total = int(every.sum())
    sentence = f"No answer is known to {label_of(experiment.texts, of.answered)}."
    if total:
        sentence = (
            f"{fraction(int(every.trace()) / total)} of {count_of(total, 'answer')} were right, "
            f"among {len(options)} options."
        )
    if len(trials) > total:
        sentence += f" {count_of(len(trials) - total, 'trial')} without an answer are left out."
    section = Section(of.name, of.title, (picture_of(figure), Paragraph(sentence)))
    columns = tuple(Described(str(o), "1", f"answers that named {o}") for o in options)
    return Extra(section, (figure,), {of.name: _table(of, each, options)}, columns)


def confusion_counts(
    of: Confusion, trials: pd.DataFrame, options: tuple[str, ...], level: Any = None
) -> npt.NDArray[np.int64]:
    """Return how often an option (row) was answered as an option (column), (n, n)."""
    rows = trials if level is None else trials[trials[str(of.by)] == level]
    right, answers = (
        pd.Categorical(rows[c], categories=options).codes for c in (of.shown, of.answered)
    )
    counts = np.zeros((len(options), len(options)), dtype=np.int64)
    has_both = (right >= 0) & (answers >= 0)
    np.add.at(counts, (right[has_both], answers[has_both]), 1)
    return counts


def _table(
    of: Confusion, each: Mapping[Any, npt.NDArray[np.int64]], options: tuple[str, ...]
) -> pd.DataFrame:
    """Return the matrices as one table, a row per level and option that was right."""
    rows = [
        ({} if of.by is None else {of.by: level})
        | {of.shown: option}
        | dict(zip(options, row.tolist(), strict=True))
        for level, counts in each.items()
        for option, row in zip(options, counts, strict=True)
    ]
    return pd.DataFrame(rows)


def _figure(
    of: Confusion,
    each: Mapping[Any, npt.NDArray[np.int64]],
    options: tuple[str, ...],
    experiment: StudyExperiment,
) -> Figure:
    names = [
        experiment.texts.find(f"choices.{of.answered}.{o}") or label_of(experiment.texts, o)
        for o in map(str, options)
    ]
    is_slanted = max(map(len, names)) > MAX_LEVEL_TICK
    across = min(len(each), MAX_ACROSS)
    down = -(-len(each) // across)
    figure = new_figure(PANEL_IN * across, PANEL_IN * down)
    panels = figure.subplots(down, across, sharey=True, squeeze=False)
    for axes in panels.flat[len(each) :]:
        axes.set_visible(False)
    for axes, (level, counts) in zip(panels.flat, each.items(), strict=False):
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shares, vmin=0, vmax=1, cmap="Blues")
        for i, j in np.argwhere(counts):
            axes.text(
                j,
                i,
                f"{fraction(shares[i, j])}\n{counts[i, j]}",
                ha="center",
                va="center",
                fontsize=7.5,
                color="white" if shares[i, j] > DARK_01 else BLACK,
            )
        axes.set_xticks(range(len(options)), names, rotation=30 if is_slanted else 0)
        axes.set_yticks(range(len(options)), names)
        axes.set_xlabel("Answered")
        if level is not None:
            axes.set_title(label_of(experiment.texts, str(level)).capitalize())
        axes.grid(visible=False)
    for axes in panels[:, 0]:
        axes.set_ylabel("Right")
    return figure
