"""Draw power curves with their Monte-Carlo intervals."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.plots import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILION,
    ReportFigure,
    draw,
)
from visavis.analysis.plots.style import new_figure
from visavis.analysis.power.summary import PowerSummary, TestPower, target_text

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, GREY)
MARKERS = ("o", "s", "^", "D", "v", "P")


def draw_power(summary: PowerSummary) -> ReportFigure:
    """Draw every test shown; replicates are simulated or resampled, so the figure is marked.

    A curve resampled from real people is marked too: no such study was performed.
    """
    first = summary.tests[0].curve
    caption = (
        f"Share of {first.points[0].replicates} replicates in which each planned test is "
        f"significant ({summary.rule_of_significance}), by number of participants; bars are 95 % "
        f"Wilson intervals of the Monte-Carlo error. {summary.effect_meaning}. "
        f"Adequate: {target_text(first.target, first.rule)}."
    )
    return draw(
        "power",
        lambda: _figure(summary),
        title=f"Power of {summary.study}",
        caption=caption,
        alternative=summary.sentence(),
        is_simulated=True,
    )


def _figure(summary: PowerSummary) -> Figure:
    figure = new_figure(8.4, 4.8)
    axes = figure.add_subplot()
    numbers = np.array(summary.request.numbers, dtype=float)
    gap = float(np.diff(numbers).min()) if numbers.size > 1 else 1.0
    shift = min(0.035 * gap, 0.5 * gap / max(1, len(summary.tests)))
    middle = (len(summary.tests) - 1) / 2
    for i, test in enumerate(summary.tests):
        _curve(axes, test, i, (i - middle) * shift, is_first=i == 0)
    _target(axes, summary, gap)
    axes.set_xticks(numbers)
    axes.set_xlim(numbers[0] - 0.6 * gap, numbers[-1] + 0.6 * gap)
    axes.set_ylim(-0.02, 1.04)
    axes.set_yticks(np.arange(0, 1.01, 0.2))
    axes.yaxis.grid(True, color=GREY, alpha=0.25, linewidth=0.6)
    axes.set_xlabel("Participants")
    axes.set_ylabel("Power")
    axes.set_title(f"Power of {summary.study}, effect × {summary.request.effect:g}")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), handlelength=2.4, labelspacing=0.9)
    return figure


def _curve(axes: Axes, test: TestPower, place: int, shift: float, *, is_first: bool) -> None:
    x = np.array([p.n for p in test.curve.points], dtype=float) + shift
    y = np.array([p.power for p in test.curve.points])
    low = np.array([p.interval.low for p in test.curve.points])
    high = np.array([p.interval.high for p in test.curve.points])
    colour = COLOURS[place % len(COLOURS)]
    axes.errorbar(
        x,
        y,
        yerr=np.clip(np.stack([y - low, high - y]), 0, None),
        color=colour,
        marker=MARKERS[place % len(MARKERS)],
        markersize=6.5 if is_first else 4.5,
        linewidth=2.2 if is_first else 1.2,
        elinewidth=1.2,
        capsize=2.5,
        zorder=5 if is_first else 3,
        label=_label(test.claim),
    )


def _label(claim: str, width: int = 26) -> str:
    lines = [""]
    for word in claim.split():
        if lines[-1] and len(lines[-1]) + len(word) + 1 > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)


def _target(axes: Axes, summary: PowerSummary, gap: float) -> None:
    curve = summary.tests[0].curve
    axes.axhline(curve.target, color=BLACK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    if curve.smallest is not None:
        axes.axvline(
            curve.smallest,
            color=BLACK,
            linewidth=0.9,
            linestyle=(0, (1, 2)),
            zorder=1,
            label=f"n = {curve.smallest}: enough for the\nthick curve"
            if len(summary.tests) > 1
            else f"n = {curve.smallest}: enough",
        )
