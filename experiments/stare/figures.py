"""The figures of the study, from its analysis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from analysis.plots import BLUE, GREEN, PURPLE, VERMILION, Drawn, draw, new_figure
from analysis.plots.flow import Stage, flow_chart
from analysis.plots.panels import (
    Values,
    differences,
    no_data,
    paired_lines,
    published_mark,
)
from analysis.plots.style import BLACK, GREY
from analysis.report.notation import counted, fraction, probability
from analysis.statistics.ranks import average_ranks
from experiments.stare import published
from experiments.stare.analysis import StareAnalysis
from experiments.stare.design import CONDITIONS
from experiments.stare.figures_places import place_figure
from experiments.stare.terms import CONDITION_NAMES, DWELL, FIXATION_COUNT, MEASURES
from visavis.figures import quality_figure
from visavis.measures import Measure
from visavis.pairs import find_test
from visavis.quality import Quality

COLOURS = {"A": BLUE, "D": VERMILION, "AD": PURPLE, "DA": GREEN}


@dataclass(frozen=True)
class TrialExample:
    """The gaze of one trial against its active agent.

    `t_ms` (n,) from the trial's start; `angle_deg` (n,) from the gaze to the head's centre, NaN
    where lost; `radius_deg` the head's angular radius with padding; `looks_ms` onset and duration
    of each look, with whether it is a fixation; `switch_ms` when the agent's gaze changed;
    `end_ms` when the trial ended (None: with the last sample).
    """

    label: str
    t_ms: npt.NDArray[np.float64]
    angle_deg: npt.NDArray[np.float64]
    radius_deg: float
    looks_ms: Sequence[tuple[float, float, bool]]
    switch_ms: float | None = None
    end_ms: float | None = None


def study_figures(
    analysis: StareAnalysis, quality: Quality, example: TrialExample | None = None
) -> dict[str, Drawn]:
    """Return every figure by its name; all of them marked when the data are simulated."""
    simulated = analysis.is_simulated
    level = f"{100 * analysis.parameters.interval_level:.0f} %"
    n = counted(analysis.n_participants, "participant")
    figures = [
        draw(
            "effect",
            lambda: _effect(analysis),
            title="Averted against directed gaze",
            caption=f"Each line is one participant (mean over trials; {n}). Discs are means with "
            f"{level} confidence intervals; the right-hand panels show directed minus averted "
            "(D − A; the tests in the text are of A − D). "
            "Open diamonds: published means (dashed: ± SD).",
            alternative="Dwell time and fixation count of each participant under averted and "
            "directed gaze, and their differences.",
            is_simulated=simulated,
        ),
        draw(
            "conditions",
            lambda: _conditions(analysis),
            title="Measures by condition",
            caption=f"Each line is one participant ({n}); discs are means with {level} "
            "confidence intervals. Open diamonds with dashed bars, to the right of each: "
            "published mean ± SD. A averted, D directed, AD averted-then-directed, DA "
            "directed-then-averted.",
            alternative="Six panels, one per measure, with every participant in four conditions.",
            is_simulated=simulated,
        ),
        draw(
            "differences",
            lambda: _differences(analysis),
            title="Differences between conditions",
            caption="Each dot is one participant's difference, the second condition minus the "
            "first (D − A; the tables' statistics are of A − D). "
            f"Discs are means with {level} "
            "confidence intervals, open diamonds the published difference of means. Stars: "
            "significance after Bonferroni over 30 tests (.05, .01, .001).",
            alternative="Six panels, one per measure, with participants' differences for the "
            "five comparisons.",
            is_simulated=simulated,
        ),
        draw(
            "places",
            lambda: place_figure(analysis),
            title="Dwell time by the active agent's place",
            caption="Left and middle: mean dwell time in ms when the agent at this place is "
            "active. Right: directed minus averted, with stars where significant (.05, .01, .001 "
            "over nine places). Grey: the two places that are never active. Top: from above, the "
            "triangle is the participant. Bottom: the heads as the participant sees them.",
            alternative="Seating plan from above and from the participant's view, coloured by "
            "dwell time.",
            is_simulated=simulated,
        ),
        draw(
            "anxiety",
            lambda: _anxiety(analysis),
            title="Dwell time and social anxiety",
            caption="One dot per participant. Top: dwell time against the score (0 to 144). "
            "Bottom: the ranks that Spearman's coefficient correlates. p uncorrected.",
            alternative="Scatter plots of dwell time against the social anxiety score in four "
            "conditions, in values and in ranks.",
            is_simulated=simulated,
        ),
        quality_figure(
            quality,
            max_error_deg=analysis.parameters.max_error_deg,
            max_trial_lost_01=analysis.parameters.max_trial_lost_01,
            out={e.participant for e in analysis.selection.excluded if e.trial_id is None},
            is_simulated=simulated,
        ),
        draw(
            "flow",
            lambda: flow_chart(_stages(analysis)),
            title="Participants and trials",
            caption="From what was performed to what was analysed.",
            alternative="Flow chart with counts of participants and trials.",
            is_simulated=simulated,
        ),
    ]
    if example is not None:
        figures.append(
            draw(
                "trial",
                lambda: _trial(example),
                title=f"Gaze in one trial ({example.label})",
                caption="Angle from the gaze to the centre of the active agent's head; gaze "
                "within the shaded band is on the head. Bars: looks, filled when they are "
                "fixations. Gaps: lost gaze.",
                alternative="Angle between gaze and the active agent's head over one trial.",
                is_simulated=simulated,
            )
        )
    return {f.name: f for f in figures}


def _table(analysis: StareAnalysis, measure: Measure, conditions: Sequence[str]) -> Values:
    wide = analysis.means.pivot(index="participant", columns="condition", values=measure.column)
    return wide.reindex(columns=list(conditions)).to_numpy(float)


def _effect(analysis: StareAnalysis) -> Figure:
    figure = new_figure(9.6, 3.9)
    panels = figure.subplots(1, 4, width_ratios=(1.5, 1, 1.5, 1))
    for i, measure in enumerate((DWELL, FIXATION_COUNT)):
        both, difference = panels[2 * i], panels[2 * i + 1]
        table = _table(analysis, measure, ("A", "D"))
        paired_lines(both, table, ("averted", "directed"), (BLUE, VERMILION))
        means = [published.MEANS[c][measure.column] for c in ("A", "D")]
        for x, value in zip((-0.3, 1.3), means, strict=True):
            published_mark(both, x, value.mean, value.sd)
        both.set_ylabel(measure.axis)
        both.set_ylim(bottom=min(0.0, means[1].mean - means[1].sd))
        both.set_title(measure.words)
        paired_lines(difference, table[:, 1:] - table[:, :1], ("D − A",), (BLACK,))
        published_mark(difference, 0.3, means[1].mean - means[0].mean)
        difference.axhline(0, color=BLACK, linewidth=0.8)
        difference.set_ylabel("Difference" + (f" ({measure.unit})" if measure.unit != "1" else ""))
        difference.set_title(find_test(analysis.comparisons, measure.column, ("A", "D")).stars)
    return figure


def _conditions(analysis: StareAnalysis) -> Figure:
    figure = new_figure(9.6, 6.6)
    colours = [COLOURS[c] for c in CONDITIONS]
    for axes, measure in zip(figure.subplots(2, 3).flat, MEASURES, strict=True):
        paired_lines(axes, _table(analysis, measure, CONDITIONS), CONDITIONS, colours)
        for x, condition in enumerate(CONDITIONS):
            value = published.MEANS[condition][measure.column]
            published_mark(axes, x + 0.26, value.mean, value.sd)
        axes.set_ylabel(measure.axis)
        axes.set_ylim(bottom=0)
    return figure


def _differences(analysis: StareAnalysis) -> Figure:
    figure = new_figure(9.6, 6.0)
    for i, (axes, measure) in enumerate(zip(figure.subplots(2, 3).flat, MEASURES, strict=True)):
        columns, labels = [], []
        for j, pair in enumerate(published.COMPARISONS):
            table = _table(analysis, measure, pair)
            columns.append(table[:, 1] - table[:, 0])
            stars = find_test(analysis.comparisons, measure.column, pair).stars
            labels.append(f"{pair[1]} − {pair[0]} {stars:<3}" if i % 3 == 0 else stars)
            first, second = (published.MEANS[c][measure.column].mean for c in pair)
            published_mark(axes, j + 0.3, second - first, horizontal=True)
        differences(axes, columns, labels, BLUE)
        axes.set_title(measure.words)
        axes.set_xlabel("Difference" + (f" ({measure.unit})" if measure.unit != "1" else ""))
    return figure


def _anxiety(analysis: StareAnalysis) -> Figure:
    figure = new_figure(9.6, 5.4)
    grid = figure.subplots(2, 4, sharey="row", sharex="row")
    wide = analysis.means.pivot(index="participant", columns="condition", values=DWELL.column)
    wide = wide.reindex(columns=list(CONDITIONS))
    for j, condition in enumerate(CONDITIONS):
        top, bottom = grid[0, j], grid[1, j]
        known = wide[condition].dropna()
        both = known.index.intersection(analysis.anxiety_scores.index)
        found = next(c for c in analysis.anxiety if c.measure == DWELL and c.level == condition)
        top.set_title(f"{condition} – {CONDITION_NAMES[condition]}", fontsize=9.5)
        bottom.set_xlabel("Rank of anxiety")
        top.set_xlabel("Social anxiety score")
        if len(both) == 0:
            no_data(top, "no anxiety\nscores")
            no_data(bottom, "")
            continue
        x = np.asarray(analysis.anxiety_scores[both], np.float64)
        y = np.asarray(known[both], np.float64)
        colour = COLOURS[condition]
        top.scatter(x, y, s=22, color=colour, alpha=0.8, linewidths=0)
        bottom.scatter(
            average_ranks(x), average_ranks(y), s=22, color=colour, alpha=0.8, linewidths=0
        )
        top.set_xlim(0, 144)
        top.set_xticks((0, 50, 100))
        if found.outcome is not None:
            p = probability(found.outcome.p)
            text = f"rₛ = {fraction(found.outcome.r)}, p {p if p[0] in '<>' else '= ' + p}"
            bottom.set_title(text, fontsize=9.5, fontweight="normal")
    grid[0, 0].set_ylabel(DWELL.axis)
    grid[0, 0].set_ylim(bottom=0)
    grid[1, 0].set_ylabel("Rank of dwell time")
    return figure


def _stages(analysis: StareAnalysis) -> list[Stage]:
    flow, parameters = analysis.selection.flow, analysis.parameters
    unfinished = [
        text
        for number, text in (
            (flow.unfinished, f"{counted(flow.unfinished, 'attempt')} interrupted or skipped"),
            (flow.damaged, f"{counted(flow.damaged, 'trial')} unreadable: damaged recording"),
            (flow.superseded, f"{counted(flow.superseded, 'trial')} finished, then repeated"),
        )
        if number
    ]
    out = [
        f"{counted(flow.participants_out, 'participant')} out "
        f"({counted(flow.with_participants, 'trial')})"
    ]
    lost = (
        f"{counted(flow.lost, 'trial')} out: more than\n"
        f"{100 * parameters.max_trial_lost_01:.0f} % of the gaze lost"
    )
    with_them = flow.complete - flow.with_participants
    return [
        Stage(
            f"{counted(flow.participants, 'participant')}\n"
            f"{counted(flow.performed, 'trial')} begun",
            "\n".join(unfinished) or "none interrupted, skipped or repeated",
        ),
        Stage(f"{counted(flow.complete, 'trial')} finished", out[0]),
        Stage(
            f"{counted(flow.participants_in, 'participant')} in\n{counted(with_them, 'trial')}",
            lost,
        ),
        Stage(
            f"{counted(flow.participants_in, 'participant')} analysed\n"
            f"{counted(flow.analysed, 'trial')}"
        ),
    ]


def _trial(example: TrialExample) -> Figure:
    figure = new_figure(9.6, 3.3)
    axes = figure.add_subplot()
    seconds = example.t_ms / 1000
    axes.axhspan(0, example.radius_deg, color=VERMILION, alpha=0.15, linewidth=0)
    axes.plot(seconds, example.angle_deg, color=BLUE, linewidth=0.9)
    top = float(np.nanmax(example.angle_deg)) if np.isfinite(example.angle_deg).any() else 10.0
    for onset, duration, is_fixation in example.looks_ms:
        axes.barh(
            -0.07 * top,
            duration / 1000,
            left=onset / 1000,
            height=0.06 * top,
            facecolor=VERMILION if is_fixation else "white",
            edgecolor=VERMILION,
            linewidth=0.9,
        )
    if example.switch_ms is not None:
        x = example.switch_ms / 1000
        axes.axvline(x, color=BLACK, linestyle=(0, (4, 3)), linewidth=1)
        axes.text(x, 1.04 * top, " gaze changes", va="top", fontsize=9.5)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set_ylim(-0.13 * top, 1.08 * top)
    end_ms = example.end_ms
    if end_ms is None and example.t_ms.size:
        end_ms = float(example.t_ms[-1])
    axes.set_xlim(0, None if end_ms is None else end_ms / 1000)
    axes.set_xlabel("Time from the start of the trial (s)")
    axes.set_ylabel("Angle to the head (°)")
    return figure
