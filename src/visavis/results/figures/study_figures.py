"""The standard figures of a study: every comparison with all participants, and exclusions."""

import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.plots import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILION,
    ReportFigure,
    draw,
    new_figure,
)
from visavis.analysis.plots.flow import Stage, flow_chart
from visavis.analysis.plots.panels import (
    ALL,
    MIN_WITH_INTERVAL,
    Values,
    dots,
    dots_with_limit,
    draw_mean,
    in_lines,
    left_out_lines,
    no_data,
    paired_lines,
    published_mark,
    spread_out,
)
from visavis.analysis.report.notation import count_of
from visavis.recording.csv_file import csv_text
from visavis.results.analysis import StudyAnalysis
from visavis.results.findings import Finding
from visavis.results.quality import QUALITY_COLUMNS, Quality
from visavis.results.selection import IS_ANALYSED, Selection, rule_words
from visavis.study.exclusions import Exclusion
from visavis.study.measures import Measure, aggregate_cells
from visavis.study.texts import Texts, label_of

MAX_ACROSS: Final = 3
"""Panels in a row."""
SCALE_MARGIN_01: Final = 0.04
"""Margin beyond each end of a rating scale, as a share of its length."""
COLOURS: Final = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, BLACK)


def study_figures(analysis: StudyAnalysis, texts: Texts) -> Iterator[ReportFigure]:
    """Yield every figure, each drawn on request; marked when the data are simulated."""
    for finding in {figure_name(f): f for f in analysis.findings}.values():
        if finding.measure.is_in(analysis.selection.rows) and _factors(finding):
            yield _comparison(analysis, finding, texts)
    yield exclusions_figure(
        analysis.selection, analysis.study.analysis.exclusions, is_simulated=analysis.is_simulated
    )


def figure_name(finding: Finding) -> str:
    """Return the file stem of a comparison's figure."""
    words = (*_factors(finding), *finding.compare.restrictions)
    return re.sub(r"\W+", "_", f"{finding.measure.column}_by_" + "_".join(words))


def _factors(finding: Finding) -> tuple[str, ...]:
    return (*finding.compare.within, *finding.compare.between)


def _comparison(analysis: StudyAnalysis, finding: Finding, texts: Texts) -> ReportFigure:
    factors = _factors(finding)
    names = " and ".join(label_of(texts, f) for f in factors)
    n = _people_count(analysis, finding)
    source = analysis.study.report.source
    cells = {} if source is None else source.cells.get(finding.measure.column, {})
    notes = " Open diamonds: published means (dashed: ± SD)." if cells else ""
    if analysis.measured_by:
        notes += f" Measured by {analysis.measured_by}."
    if of := _trials_shown(finding, texts):
        notes += f" Only trials with {of} are shown."
    lines = "Each line is one participant. " if finding.compare.within else "Each dot is one. "
    return draw(
        figure_name(finding),
        lambda: _panels(analysis, finding, texts),
        title=f"{finding.measure.words} by {names}",
        caption=f"{lines}Discs are means over {count_of(n, 'participant')}"
        f"{' with 95 % confidence intervals' if n >= MIN_WITH_INTERVAL else ''}.{notes}",
        alternative=f"{finding.measure.words} of every participant by {names}.",
        is_simulated=analysis.is_simulated,
        data=data_of_cells(
            analysis.rows_of(finding.compare, analysis.selection.counted),
            [finding.measure],
            factors[:2],
            is_simulated=analysis.is_simulated,
        ),
    )


def _trials_shown(finding: Finding, texts: Texts) -> str:
    """Return the levels and conditions of the trials that a comparison uses; of all nothing."""
    only = (
        f"{label_of(texts, name)} {label_of(texts, str(level))}"
        for name, level in finding.compare.only.items()
    )
    return ", ".join((*only, *finding.compare.where))


def data_of_cells(
    trials: pd.DataFrame,
    measures: Sequence[Measure],
    factors: Sequence[str],
    *,
    is_simulated: bool,
) -> str:
    """Return a CSV file of what a figure shows: a row per participant and cell, means of trials."""
    cells = aggregate_cells(trials, measures, factors)
    columns = ["participant", *factors, *(m.column for m in measures if m.column in cells)]
    return csv_text(cells[columns].assign(is_simulated=is_simulated))


def _people_count(analysis: StudyAnalysis, finding: Finding) -> int:
    """Return how many participants a comparison is about."""
    rows = analysis.rows_of(finding.compare, analysis.selection.counted)
    return int(rows["participant"].nunique())


def panels_in_rows(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many panels, in rows that can be read across two columns (180 mm)."""
    across = min(count, MAX_ACROSS)
    down = -(-count // across)
    figure = new_figure(3.2 + 2.6 * across, 3.9 * down)
    every = list(figure.subplots(down, across, sharey=True, squeeze=False).flat)
    for axes in every[count:]:
        axes.set_visible(False)
    return figure, every[:count]


def _panels(analysis: StudyAnalysis, finding: Finding, texts: Texts) -> Figure:
    factors = _factors(finding)
    x, panels = factors[0], factors[1:2]
    panel_levels = analysis.levels[panels[0]] if panels else ("",)
    figure, axes = panels_in_rows(len(panel_levels))
    levels = analysis.levels[x]
    labels = [label_of(texts, str(v)) for v in levels]
    counted_rows = analysis.rows_of(finding.compare, analysis.selection.counted)
    cells = aggregate_cells(counted_rows, [finding.measure], factors[:2])
    outside = aggregate_cells(
        analysis.rows_of(finding.compare, trials_of_who_is_out(analysis)),
        [finding.measure],
        factors[:2],
    )
    besides = aggregate_cells(
        analysis.rows_of(finding.compare, trials_with_left_out(analysis)),
        [finding.measure],
        factors[:2],
    )
    for ax, panel in zip(axes, panel_levels, strict=True):
        mine = cells if not panels else cells[cells[panels[0]] == panel]
        table, people = _wide(mine, x, finding.measure.column, levels)
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(levels))]
        if x in finding.compare.between:
            _dots(ax, table, labels, colours, people)
        else:
            paired_lines(ax, table, labels, colours, people=people)
            theirs = outside if not panels else outside[outside[panels[0]] == panel]
            left_out_lines(ax, *_wide(theirs, x, finding.measure.column, levels))
            others = besides if not panels else besides[besides[panels[0]] == panel]
            left_out_lines(ax, *_wide(others, x, finding.measure.column, levels), kind=ALL)
        ax.set_xlabel(label_of(texts, x))
        if panels:
            ax.set_title(f"{label_of(texts, panels[0])}: {label_of(texts, str(panel))}")
        elif analysis.study.report.source is not None:
            published_means = analysis.study.report.source.cells.get(finding.measure.column, {})
            for i, level in enumerate(levels):
                if str(level) in published_means:
                    published_mark(ax, i + 0.22, *published_means[str(level)])
    for first in axes[::MAX_ACROSS]:
        first.set_ylabel(in_lines(finding.measure.axis, 34))
    if finding.measure.scale is not None:
        low, high = finding.measure.scale
        beyond = SCALE_MARGIN_01 * (high - low)
        axes[0].set_ylim(low - beyond, high + beyond)
    return figure


def trials_of_who_is_out(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the finished trials of participants who do not count."""
    people = analysis.selection.people
    out = people.loc[~people[IS_ANALYSED].astype(bool), "participant"]
    trials = analysis.selection.finished
    their_trials: pd.DataFrame = trials[trials["participant"].isin(out)]
    return their_trials


def trials_with_left_out(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the finished trials of participants who count but lost some to a rule."""
    trials, people = analysis.selection.finished, analysis.selection.people
    counts = people.loc[people[IS_ANALYSED].astype(bool), "participant"]
    mine = trials[trials["participant"].isin(counts)]
    names = mine.loc[~mine[IS_ANALYSED].astype(bool), "participant"].unique()
    their_trials: pd.DataFrame = mine[mine["participant"].isin(names)]
    return their_trials


def _wide(
    cells: pd.DataFrame, factor: str, column: str, levels: Sequence[object]
) -> tuple[Values, list[str]]:
    """Return a measure (participants, levels) and each row's participant; NaN where missing."""
    if column not in cells or cells.empty:
        return np.empty((0, len(levels))), []
    wide = cells.pivot_table(index="participant", columns=factor, values=column)
    return wide.reindex(columns=list(levels)).to_numpy(float), [str(p) for p in wide.index]


def _dots(
    ax: Axes,
    table: Values,
    labels: Sequence[str],
    colours: Sequence[str],
    people: Sequence[str],
) -> None:
    for i in range(table.shape[1]):
        there = np.isfinite(table[:, i])
        values = table[there, i]
        names = [p for p, is_there in zip(people, there, strict=True) if is_there]
        x = i + spread_out(values, 0.12)
        dots(ax, x, values, names, s=14, color=colours[i], alpha=0.5)
        draw_mean(ax, i, values, colours[i])
    ax.set_xticks(range(len(labels)), labels)
    ax.set_xlim(-0.5, len(labels) - 0.5)


def exclusions_figure(
    selection: Selection, rules: Sequence[Exclusion], *, is_simulated: bool
) -> ReportFigure:
    """Return the flow chart of what was performed, what every rule left out, and what counts."""
    people, counts = selection.people, selection.counted
    stages = [
        Stage(
            f"{count_of(len(people), 'participant')}, {count_of(selection.row_count, 'trial')} "
            "performed",
            "\n".join(
                f"{count_of(left.count, left.level)}: {rule_words(selection, rules, left.rule)}"
                for left in selection.left
            ),
        ),
        Stage(
            f"{count_of(int(counts['participant'].nunique()), 'participant')}, "
            f"{count_of(len(counts), 'trial')} analysed"
        ),
    ]
    return draw(
        "exclusions",
        lambda: flow_chart(stages),
        title="What was performed, what was left out, what counts",
        caption="Rules in the order in which they act; thresholds stand in the methods.",
        alternative="; ".join(s.text for s in stages),
        is_simulated=is_simulated,
    )


def figure_of_quality(analysis: StudyAnalysis, quality: Quality) -> ReportFigure:
    """Return accuracy, precision and loss of everybody, with the limits of the study's rules."""
    people = analysis.selection.people
    out = set(people.loc[~people["is_analysed"].astype(bool), "participant"].astype(str))
    max_error_deg, max_trial_lost_01 = quality.max_error_deg, quality.max_trial_lost_01

    def panels() -> Figure:
        table = quality.participants
        figure = new_figure(9.6, max(2.2, 1.1 + 0.21 * len(table)))
        grid = figure.subplots(1, 3, sharey=True)
        max_lost_percent = None if max_trial_lost_01 is None else 100 * max_trial_lost_01
        over = np.array([str(p) in out for p in table["participant"]], dtype=bool)
        names = ("Accuracy (° error)", "Precision (° RMS-S2S)", "Lost gaze (%)")
        limits = (max_error_deg, None, max_lost_percent)
        for axes, column, limit, name in zip(grid, QUALITY_COLUMNS, limits, names, strict=True):
            values = table[column].to_numpy(float)
            if not np.isfinite(values).any():
                no_data(axes, "not recorded")
                axes.set_xlabel(name)
                continue
            scale = 100.0 if column == "lost_01" else 1.0
            dots_with_limit(
                axes,
                scale * values,
                BLUE,
                over=over,
                limit=limit,
                name=name,
                people=table["participant"].astype(str).tolist(),
            )
        grid[0].set_yticks(np.arange(len(table)), table["participant"].astype(str).tolist())
        grid[0].set_ylabel("Participant")
        return figure

    return draw(
        "quality",
        panels,
        title="Data quality by participant",
        caption="Accuracy and precision from the validations in force, loss as the mean "
        "over all finished trials. Dashed: the limits of a participant's mean error and of "
        "one trial's loss. Crosses: participants excluded.",
        alternative="Accuracy, precision and data loss of every participant.",
        is_simulated=analysis.is_simulated,
    )
