"""The section of a report with psychometric functions: every person's, and everybody's together."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.plots import BLACK, BLUE, GREY, ReportFigure, draw, new_figure
from visavis.analysis.plots.panels import name_after
from visavis.analysis.psychometric import NoFitError, share_right
from visavis.analysis.report import Block, Paragraph, Section, Table
from visavis.analysis.report import Column as Head
from visavis.analysis.report.notation import count_of
from visavis.protocol.plan.columns import Column
from visavis.recording.csv_file import csv_text
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.psychometric import FittedValue, Psychometric
from visavis.study.sections import Extra
from visavis.study.texts import label_of

NAME: Final = "psychometric"
EVERYBODY: Final = "everybody"
MAX_ACROSS: Final = 3
PANEL_IN: Final = 3.6
_ESTIMATES: Final = (
    ("threshold", "threshold: half of the way of a normal function, 63 % of a Weibull function's"),
    ("slope", "slope: exponent of a Weibull function, standard deviation of a normal one"),
)
COLUMNS: Final = (
    Column("function", "", "the psychometric function, as the study names it"),
    Column("fitted_to", "", f"one person's answers, or those of {EVERYBODY} together"),
    *(
        Column(f"{name}{end}", "1", f"{words}{meaning}")
        for name, words in _ESTIMATES
        for end, meaning in (
            ("", ""),
            ("_low", ", lower end of its 95 % interval"),
            ("_high", ", upper end of its 95 % interval"),
        )
    ),
    Column("lapse_01", "1", "share of wrong answers whatever the level"),
    Column("guess_01", "1", "share of right answers without seeing anything"),
    Column("trials", "1", "answers that it is fitted to"),
    Column("why_not", "", "why there is no fit; empty where there is one"),
)


def psychometric_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return the psychometric functions that the study measures; empty where it measures none."""
    of_cells = [m.of_cell for m in analysis.measures]
    functions = tuple(dict.fromkeys(f.of for f in of_cells if isinstance(f, FittedValue)))
    trials = analysis.selection.counted
    there = [f for f in functions if {f.level_column, f.right_column} <= set(trials.columns)]
    if not there:
        return Extra()
    rows: list[dict[str, Any]] = []
    blocks: list[Block] = []
    figures: list[ReportFigure] = []
    for of in there:
        own = list(_rows(of, analysis))
        rows += own
        figures.append(_figure_of(of, own, analysis, experiment))
        blocks += [picture_of(figures[-1]), _table(of, own, analysis, experiment)]
    without_fit = [row for row in rows if row["why_not"] and row["fitted_to"] != EVERYBODY]
    if without_fit:
        whys = "; ".join(
            f"{row['participant']}: {row['why_not']}" for row in without_fit[: 2 * MAX_ACROSS]
        )
        more = len(without_fit) - 2 * MAX_ACROSS
        blocks.append(
            Paragraph(
                f"{count_of(len(without_fit), 'function')} could not be fitted and are missing "
                f"({whys}{f'; and {more} more, in psychometric.csv' if more > 0 else ''})."
            )
        )
    section = Section(NAME, "Psychometric functions", tuple(blocks))
    return Extra(section, tuple(figures), {NAME: pd.DataFrame(rows)}, COLUMNS)


def _factors(of: Psychometric, analysis: StudyAnalysis) -> list[str]:
    """Return the factors whose cells have a function each: all but its levels."""
    return [f for f in analysis.cells if f not in (of.level_column, of.right_column)]


def _cells(of: Psychometric, analysis: StudyAnalysis) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the levels of every cell, in their order, and its trials."""
    factors, trials = _factors(of, analysis), analysis.selection.counted
    if not factors:
        yield (), trials
        return
    for key in itertools.product(*(analysis.levels[factor] for factor in factors)):
        is_in_cell = (trials[factors] == list(key)).all(axis=1)
        if is_in_cell.any():
            yield key, trials[is_in_cell]


def _rows(of: Psychometric, analysis: StudyAnalysis) -> Iterator[dict[str, Any]]:
    factors = _factors(of, analysis)
    for key, cell in _cells(of, analysis):
        about = {"function": of.name, **dict(zip(factors, key, strict=True))}
        for participant, own in cell.groupby("participant", observed=True):
            yield about | {"participant": participant, "fitted_to": "one"} | _fit_row(of, own)
        yield about | {"participant": "", "fitted_to": EVERYBODY} | _fit_row(of, cell)


def _fit_row(of: Psychometric, trials: pd.DataFrame) -> dict[str, Any]:
    names = [c.name for c in COLUMNS[2:-1]]
    answers = int(trials[[of.level_column, of.right_column]].notna().all(axis=1).sum())
    try:
        fit = of.fit(trials)
    except NoFitError as error:
        return {**dict.fromkeys(names, None), "trials": answers, "why_not": str(error)}
    return {**{name: getattr(fit, name) for name in names}, "why_not": ""}


def _table(
    of: Psychometric,
    rows: Sequence[dict[str, Any]],
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
) -> Table:
    """Return thresholds and slopes of each cell: the middle person, and everybody together."""
    factors = _factors(of, analysis)
    table = pd.DataFrame(rows)
    lines: list[tuple[str, ...]] = []
    for row in (r for r in rows if r["fitted_to"] == EVERYBODY):
        own = table[table["fitted_to"] != EVERYBODY]
        for factor in factors:
            own = own[own[factor] == row[factor]]
        there = own[own["threshold"].notna()]
        lines.append(
            (
                ", ".join(label_of(experiment.texts, str(row[f])) for f in factors) or "all",
                f"{len(there)} of {len(own)}",
                *(_number(there[name].median()) for name in ("threshold", "slope")),
                *(_with_interval(row, name) for name in ("threshold", "slope")),
                _number(row["lapse_01"]),
            )
        )
    heads = (
        *("People fitted", "Median threshold", "Median slope"),
        *("Threshold of all", "Slope of all", "Lapses of all"),
    )
    return Table(
        (Head("Condition"), *(Head(head, "right") for head in heads)),
        tuple(lines),
        f"Psychometric functions of {of.name.replace('_', ' ')}",
        "Medians are of the functions fitted to each person. That of everybody's answers together, "
        "with 95 % intervals, is flatter than those of single people whose thresholds differ.",
    )


def _number(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.3g}"


def _with_interval(row: dict[str, Any], name: str) -> str:
    if row[name] is None:
        return "–"
    return f"{row[name]:.3g} ({row[f'{name}_low']:.3g} to {row[f'{name}_high']:.3g})"


def _figure_of(
    of: Psychometric,
    rows: Sequence[dict[str, Any]],
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
) -> ReportFigure:
    words = of.name.replace("_", " ")
    people = len({row["participant"] for row in rows if row["fitted_to"] != EVERYBODY})
    return draw(
        f"{NAME}_{of.name}",
        lambda: _figure(of, rows, analysis, experiment),
        title=f"Psychometric functions of {words}",
        caption=f"Thin lines: the function fitted to each of {count_of(people, 'participant')}; "
        "black: everybody's answers together, as shares by level (area: number of answers) and "
        "their function, with the 95 % interval of its threshold below.",
        alternative=f"Share of right answers by level of {words}, of every participant and all.",
        is_simulated=analysis.is_simulated,
        data=csv_text(pd.DataFrame(rows).assign(is_simulated=analysis.is_simulated)),
    )


def _figure(
    of: Psychometric,
    rows: Sequence[dict[str, Any]],
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
) -> Figure:
    cells = list(_cells(of, analysis))
    factors = _factors(of, analysis)
    across = min(len(cells), MAX_ACROSS)
    down = -(-len(cells) // across)
    figure = new_figure(PANEL_IN * across, PANEL_IN * down)
    panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(cells) :]:
        axes.set_visible(False)
    for axes, (key, trials) in zip(panels.flat, cells, strict=False):
        about = dict(zip(factors, key, strict=True))
        own = [row for row in rows if all(row[f] == level for f, level in about.items())]
        _panel(axes, of, own, trials)
        axes.set_title(", ".join(label_of(experiment.texts, str(v)) for v in key).capitalize())
        axes.set_xlabel(f"Level of {of.name.replace('_', ' ')}")
    for axes in panels[:, 0]:
        axes.set_ylabel("Share of right answers")
    return figure


def _panel(
    axes: Axes, of: Psychometric, rows: Sequence[dict[str, Any]], trials: pd.DataFrame
) -> None:
    answers = trials[[of.level_column, of.right_column]].dropna().astype(float)
    shares = answers.groupby(of.level_column)[of.right_column].agg(["mean", "size"])
    if shares.empty:
        return
    ends = shares.index.min(), shares.index.max()
    if of.function == "weibull" and ends[0] > 0:
        axes.set_xscale("log")
        levels = np.geomspace(*ends, 120)
    else:
        levels = np.linspace(*ends, 120)
    for row in (r for r in rows if not r["why_not"]):
        right = share_right(
            levels, row["threshold"], row["slope"], row["guess_01"], row["lapse_01"], of.function
        )
        if row["fitted_to"] == EVERYBODY:
            axes.plot(levels, right, color=BLACK, linewidth=2.2)
            low = axes.get_ylim()[0] if of.guess is None else max(of.guess - 0.06, -0.04)
            axes.plot(
                [row["threshold_low"], row["threshold_high"]], [low, low], color=BLACK, linewidth=3
            )
        else:
            name_after(row["participant"], *axes.plot(levels, right, color=BLUE, alpha=0.5))
    area = 120 * shares["size"] / shares["size"].max()
    axes.scatter(shares.index, shares["mean"], s=area, color=GREY, alpha=0.7, zorder=3)
    axes.set_ylim(top=1.03)
