"""Figures of families of tests: levels, their differences, measures against a score."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.plots import BLUE, ReportFigure, draw, new_figure
from visavis.analysis.plots.panels import (
    ALL,
    MIN_WITH_INTERVAL,
    Values,
    differences,
    dots,
    in_lines,
    left_out_lines,
    no_data,
    paired_lines,
    published_mark,
)
from visavis.analysis.report.notation import count_of, fraction, probability, threshold
from visavis.analysis.statistics.ranks import average_ranks
from visavis.results.analysis import StudyAnalysis
from visavis.results.family_tests import scores_of, with_level_names
from visavis.results.figures.study_figures import (
    COLOURS,
    data_of_cells,
    trials_of_who_is_out,
    trials_with_left_out,
)
from visavis.study.measures import Measure, aggregate_cells
from visavis.study.pairs import Correlate, Pairs
from visavis.study.texts import Texts, label_of

COLUMNS = 3
MAX_PAIRS = 4
"""Panels in a row of scatter plots."""
"""Largest number of panels in one row."""
PUBLISHED_MARKS = " Open diamonds with dashed bars: published mean ± SD."


def figure_names(family: str) -> tuple[str, str]:
    """Return the file stems of a family's figures: levels (or a score), differences."""
    stem = family.replace(" ", "_")
    return stem, f"{stem}_differences"


def opening_name(family: str) -> str:
    """Return the file stem of the figure of a family's first measure alone."""
    return f"{figure_names(family)[0]}_opening"


def family_figures(analysis: StudyAnalysis, texts: Texts) -> Iterator[ReportFigure]:
    """Yield the figures of every family, each drawn on request; families with `each` have none.

    Of the first with pairs, the first measure comes alone, too: a report begins with it.
    """
    has_opening = bool(analysis.findings)
    for family in analysis.families():
        of = next(r.of for r in analysis.results if r.of.family == family)
        if isinstance(of, Correlate):
            yield _scores(analysis, of, texts)
        elif not of.each:
            if not has_opening:
                yield _levels_of_one(analysis, family, of, texts)
                has_opening = True
            yield from _pairs(analysis, family, of, texts)


def _levels_of_one(analysis: StudyAnalysis, family: str, of: Pairs, texts: Texts) -> ReportFigure:
    measure = analysis.pairs_of(family)[0].measure
    factor = label_of(texts, of.factor)
    n = count_of(analysis.n_participants, "participant")
    levels = [str(v) for v in analysis.levels[of.factor]]
    source = analysis.study.report.source
    has_published = source is not None and measure.column in source.cells

    def panel(axes: Axes, one: Measure, _: int) -> None:
        _levels(axes, analysis, of, one)
        axes.set_xticks(range(len(levels)), [in_lines(of.level_words(v), 14) for v in levels])

    return draw(
        opening_name(family),
        lambda: _grid([measure], 3.4, panel, width=5.2),
        title=f"{measure.words} by {factor}",
        caption=f"Each line is one participant ({n}); discs are means"
        + _interval_words(analysis)
        + ("." + PUBLISHED_MARKS if has_published else "."),
        alternative=f"{measure.words} of every participant by {factor}.",
        is_simulated=analysis.is_simulated,
        data=_data(analysis, of, [measure]),
    )


def _data(analysis: StudyAnalysis, of: Pairs, measures: Sequence[Measure]) -> str:
    trials, is_simulated = analysis.selection.counted, analysis.is_simulated
    return data_of_cells(trials, measures, [of.factor], is_simulated=is_simulated)


def _interval_words(analysis: StudyAnalysis) -> str:
    """Return how intervals are named beneath a figure; nothing where there are too few people."""
    if analysis.n_participants < MIN_WITH_INTERVAL:
        return ""
    return f" with {100 * analysis.rules.interval_level:.0f} % confidence intervals"


def _pairs(analysis: StudyAnalysis, family: str, of: Pairs, texts: Texts) -> Iterator[ReportFigure]:
    tests = analysis.pairs_of(family)
    measures = list(dict.fromkeys(t.measure for t in tests))
    factor = label_of(texts, of.factor)
    n = count_of(analysis.n_participants, "participant")
    cells = {} if analysis.study.report.source is None else analysis.study.report.source.cells
    has_published = any(m.column in cells for m in measures)
    level_names = ", ".join(f"{v} {of.level_words(str(v))}" for v in analysis.levels[of.factor])
    stars = ", ".join(threshold(analysis.rules.alpha / divisor) for divisor in (1, 5, 50))
    names = figure_names(family)
    yield draw(
        names[0],
        lambda: _grid(measures, 3.3, lambda axes, m, _: _levels(axes, analysis, of, m)),
        title=f"Measures by {factor}",
        caption=f"Each line is one participant ({n}); discs are means{_interval_words(analysis)}. "
        f"{level_names}." + (PUBLISHED_MARKS if has_published else ""),
        alternative=f"A panel for each measure, with every participant by {factor}.",
        is_simulated=analysis.is_simulated,
        data=_data(analysis, of, measures),
    )
    yield draw(
        names[1],
        lambda: _grid(measures, 3.0, lambda axes, m, i: _offs(axes, analysis, family, m, i)),
        title=f"Differences by {factor}",
        caption="Each dot is one participant's difference, the first level minus the second as "
        f"in the tables. Discs are means{_interval_words(analysis)}. {level_names}. "
        f"Stars: significant after Bonferroni ({stars})."
        + (" Open diamonds: the published difference of means." if has_published else ""),
        alternative="A panel for each measure, with participants' differences by comparison.",
        is_simulated=analysis.is_simulated,
    )


def _grid(
    measures: Sequence[Measure],
    height: float,
    panel: Callable[[Axes, Measure, int], None],
    width: float = 3.2,
) -> Figure:
    """Draw a panel for each measure."""
    across = min(COLUMNS, len(measures))
    down = ceil(len(measures) / across)
    figure = new_figure(width * across, height * down)
    every = figure.subplots(down, across, squeeze=False).flat
    for i, (axes, measure) in enumerate(zip(every, measures, strict=False)):
        panel(axes, measure, i)
    for axes in list(figure.axes)[len(measures) :]:
        axes.set_visible(False)
    return figure


def _values(
    trials: pd.DataFrame,
    factor: str,
    measure: Measure,
    of: Sequence[str],
    levels: Mapping[str, Sequence[Any]],
) -> tuple[Values, list[str]]:
    """Return a measure, one row per participant and one column per level, NaN where missing, and
    whose the rows are.
    """
    means = aggregate_cells(with_level_names(trials, [factor], levels), [measure], [factor])
    means[factor] = means[factor].astype(str)
    if measure.column not in means or means.empty:
        return np.empty((0, len(of))), []
    wide = means.pivot(index="participant", columns=factor, values=measure.column)
    return wide.reindex(columns=list(of)).to_numpy(float), [str(p) for p in wide.index]


def _published_means(
    analysis: StudyAnalysis, measure: Measure
) -> dict[str, tuple[float, float | None]]:
    source = analysis.study.report.source
    return {} if source is None else dict(source.cells.get(measure.column, {}))


def _levels(axes: Axes, analysis: StudyAnalysis, of: Pairs, measure: Measure) -> None:
    levels = [str(v) for v in analysis.levels[of.factor]]
    colours = [COLOURS[i % len(COLOURS)] for i in range(len(levels))]
    table, people = _values(analysis.selection.counted, of.factor, measure, levels, analysis.levels)
    paired_lines(axes, table, levels, colours, people=people)
    outside = trials_of_who_is_out(analysis)
    published_means = _published_means(analysis, measure)
    for x, level in enumerate(levels):
        if level in published_means:
            published_mark(axes, x + 0.26, *published_means[level])
    axes.set_ylabel(in_lines(measure.axis, 30))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    left_out_lines(axes, *_values(outside, of.factor, measure, levels, analysis.levels))
    besides = trials_with_left_out(analysis)
    left_out_lines(axes, *_values(besides, of.factor, measure, levels, analysis.levels), kind=ALL)


def _offs(axes: Axes, analysis: StudyAnalysis, family: str, measure: Measure, panel: int) -> None:
    tests = [t for t in analysis.pairs_of(family) if t.measure == measure]
    published_means = _published_means(analysis, measure)
    columns, labels = [], []
    people: list[str] = []
    for j, test in enumerate(tests):
        pair = (test.first, test.second)
        table, people = _values(
            analysis.selection.counted, test.of.factor, measure, pair, analysis.levels
        )
        columns.append(table[:, 0] - table[:, 1])
        name = f"{test.first} − {test.second} {test.stars:<3}"
        labels.append(name if panel % COLUMNS == 0 else test.stars)
        if set(pair) <= set(published_means):
            first, second = (published_means[level][0] for level in pair)
            published_mark(axes, j + 0.3, first - second, horizontal=True)
    differences(axes, columns, labels, BLUE, people=people)
    axes.set_title(in_lines(measure.words))
    axes.set_xlabel("Difference" + (f" ({measure.unit})" if measure.unit not in ("", "1") else ""))


def _scores(analysis: StudyAnalysis, of: Correlate, texts: Texts) -> ReportFigure:
    measure = analysis.measure(of.measures[0])
    return draw(
        figure_names(of.family)[0],
        lambda: _score_panels(analysis, of, measure),
        title=f"{measure.words} and {of.score_words}",
        caption=f"One dot per participant. Top: {measure.words.lower()} against the score. "
        "Bottom: the ranks that Spearman's coefficient correlates. p uncorrected.",
        alternative=f"Scatter plots of {measure.words.lower()} against {of.score_words} by "
        f"{label_of(texts, of.factor)}, in values and in ranks.",
        is_simulated=analysis.is_simulated,
    )


def pairs_of_panels(count: int) -> tuple[Figure, list[Axes], list[Axes]]:
    """Return a figure with so many panels, and one of the same scale below each, in rows that can
    be read across two columns (180 mm); the upper ones share their axes, as the lower ones do.
    """
    across = min(count, MAX_PAIRS)
    down = -(-count // across)
    figure = new_figure(2.4 * max(across, 2), 5.4 * down)
    grid = figure.subplots(2 * down, across, squeeze=False)
    tops, bottoms = (list(grid[first::2].flat) for first in (0, 1))
    for panels in (tops, bottoms):
        for k, axes in enumerate(panels):
            axes.set_visible(k < count)
            if k:
                axes.sharex(panels[0])
                axes.sharey(panels[0])
            if k % across:
                axes.tick_params(labelleft=False)
    return figure, tops[:count], bottoms[:count]


def _score_panels(analysis: StudyAnalysis, of: Correlate, measure: Measure) -> Figure:
    levels = [str(v) for v in analysis.levels[of.factor]]
    figure, tops, bottoms = pairs_of_panels(len(levels))
    scores = scores_of(analysis.people, of.score)
    trials = with_level_names(analysis.selection.counted, [of.factor], analysis.levels)
    means = aggregate_cells(trials, [measure], [of.factor])
    for j, level in enumerate(levels):
        top, bottom = tops[j], bottoms[j]
        here = means[means[of.factor].astype(str) == level].set_index("participant")
        values = here[measure.column].dropna()
        both = values.index.intersection(scores.index)
        top.set_title(" – ".join(dict.fromkeys((level, of.names.get(level, level)))), fontsize=9.5)
        top.set_xlabel(of.score_words.capitalize())
        bottom.set_xlabel(f"Rank of {of.score_words}")
        if len(both) == 0:
            no_data(top, f"no {of.score_words}\nscores")
            no_data(bottom, "")
            continue
        x, y = np.asarray(scores[both], np.float64), np.asarray(values[both], np.float64)
        colour = COLOURS[j % len(COLOURS)]
        people = [str(p) for p in both]
        dots(top, x, y, people, s=22, color=colour, alpha=0.8, mew=0)
        ranks = average_ranks(x), average_ranks(y)
        dots(bottom, *ranks, people, s=22, color=colour, alpha=0.8, mew=0)
        tests = analysis.correlations_of(of.family)
        correlation = next(c for c in tests if c.measure == measure and c.level == level)
        if correlation.outcome is not None:
            p = probability(correlation.outcome.p)
            text = f"rₛ = {fraction(correlation.outcome.r)}, p {p if p[0] in '<>' else '= ' + p}"
            bottom.set_title(text, fontsize=9.5, fontweight="normal")
    for top, bottom in zip(tops[::MAX_PAIRS], bottoms[::MAX_PAIRS], strict=True):
        top.set_ylabel(measure.axis)
        bottom.set_ylabel(f"Rank of {measure.words.lower()}")
    tops[0].set_ylim(bottom=min(0.0, tops[0].get_ylim()[0]))
    return figure
