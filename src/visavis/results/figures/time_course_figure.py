"""The figure of looks over time: everybody's share by condition, and each participant's."""

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.plots import ReportFigure, draw, new_figure
from visavis.analysis.plots.panels import MIN_WITH_INTERVAL, Values, mean_interval
from visavis.analysis.plots.style import COLUMN_WIDTH_IN
from visavis.analysis.report.notation import count_of, fraction
from visavis.recording.csv_file import csv_text
from visavis.results.analysis import StudyAnalysis
from visavis.results.figures.study_figures import COLOURS
from visavis.results.time_course import TIME_COURSE
from visavis.study.look_course import ON_01, T_MS
from visavis.study.texts import Texts, label_of

SWITCH_MS: Final = "switch_ms"
"""The moment of a change in the trial, where there is one."""
MAX_SHOWN_01: Final = 1.02
"""Intervals of few people may reach beyond every share there can be."""


def time_course_figure(analysis: StudyAnalysis, texts: Texts) -> ReportFigure | None:
    """Return the figure, drawn; None where nobody's looks were measured over time."""
    course = analysis.tables.get(TIME_COURSE)
    if course is None or course.empty:
        return None
    factor = course.columns[1]
    n = count_of(int(course["participant"].nunique()), "participant")
    what = "the agent's head" if analysis.study.analysis.looks else "people"
    switches, darkest = _switches_s(analysis, factor), _darkest(course)
    note = " Dotted: the median moment of the change." if switches else ""
    return draw(
        TIME_COURSE,
        lambda: _panels(analysis, course, switches, darkest, texts, what),
        title=f"Looks over time by {label_of(texts, factor)}",
        caption=f"Top: share of usable gaze on {what}, mean over {n} with 95 % confidence "
        "intervals. Beneath: a row for each participant, the darker the larger the share: black is "
        f"{fraction(darkest, 1)}.{note}",
        alternative=f"Lines of looks over time by {label_of(texts, factor)}, and rows of people.",
        is_simulated=analysis.is_simulated,
        data=csv_text(course.assign(is_simulated=analysis.is_simulated)),
    )


def _darkest(course: pd.DataFrame) -> float:
    """Return the share that is drawn black: the largest one, rounded up to a tenth."""
    return max(0.1, float(np.ceil(10 * course[ON_01].max() - 1e-9)) / 10)


def _switches_s(analysis: StudyAnalysis, factor: str) -> dict[str, float]:
    """Return the median moment of the change in seconds, by level; levels without one lack."""
    trials = analysis.selection.counted
    if SWITCH_MS not in trials:
        return {}
    medians = trials.groupby(factor, observed=True)[SWITCH_MS].median().dropna()
    return {str(level): float(ms) / 1000 for level, ms in medians.items()}


def _panels(
    analysis: StudyAnalysis,
    course: pd.DataFrame,
    switches: dict[str, float],
    darkest: float,
    texts: Texts,
    what: str,
) -> Figure:
    factor = course.columns[1]
    levels = [level for level in analysis.levels[factor] if (course[factor] == level).any()]
    people = sorted(course["participant"].unique())
    row_height = min(0.16, 2.4 / len(people))
    heights = [2.0] + [max(0.5, row_height * len(people))] * len(levels)
    figure = new_figure(COLUMN_WIDTH_IN, sum(heights) + 0.5 * len(heights))
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    for i, level in enumerate(levels):
        mine = course[course[factor] == level]
        wide = mine.pivot_table(index="participant", columns=T_MS, values=ON_01).reindex(people)
        t_s, shares = wide.columns.to_numpy(float) / 1000, wide.to_numpy(float)
        colour, name = COLOURS[i % len(COLOURS)], label_of(texts, str(level))
        _line(axes[0], t_s, shares, colour, name)
        half_s = (t_s[1] - t_s[0]) / 2 if t_s.size > 1 else 0.125
        axes[i + 1].set_facecolor("0.9")
        axes[i + 1].imshow(
            np.ma.masked_invalid(shares),
            cmap="Greys",
            vmin=0,
            vmax=darkest,
            aspect="auto",
            interpolation="nearest",
            extent=(t_s[0] - half_s, t_s[-1] + half_s, len(people) - 0.5, -0.5),
        )
        axes[i + 1].set_title(name, fontsize=9.5, fontweight="normal", pad=3)
        axes[i + 1].set_yticks([])
        if str(level) in switches:
            axes[0].axvline(switches[str(level)], color=colour, linewidth=1, linestyle=":")
            axes[i + 1].axvline(switches[str(level)], color=colour, linewidth=1.4, linestyle=":")
    axes[0].set_ylabel(f"Share of gaze on {what}")
    axes[0].set_ylim(0, min(axes[0].get_ylim()[1], MAX_SHOWN_01))
    figure.legend(loc="outside upper center", ncols=min(2, len(levels)), frameon=False)
    axes[-1].set_xlabel("Time in the trial (s)")
    return figure


def _line(axes: Axes, t_s: Values, shares: Values, colour: str, name: str) -> None:
    bounds = np.array([mean_interval(shares[:, j]) for j in range(shares.shape[1])])
    axes.plot(t_s, bounds[:, 0], color=colour, linewidth=1.8, label=name)
    # Trials of unlike length: towards the end of the longest few people are left.
    many = np.isfinite(shares).sum(axis=0) >= MIN_WITH_INTERVAL
    low, high = bounds[:, 1], bounds[:, 2]
    axes.fill_between(t_s, low, high, many, color=colour, alpha=0.12, linewidth=0)
