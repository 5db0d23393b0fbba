"""The figures of the waving study, from its analysis."""

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from analysis.plots import BLACK, BLUE, ORANGE, Drawn, draw, new_figure
from analysis.plots.panels import Values, draw_mean, paired_lines, published_mark
from analysis.report.notation import counted
from experiments.waving import published
from experiments.waving.analysis import WavingAnalysis
from experiments.waving.design import DIRECTIONS, TECHNIQUES

COLOURS: Final = {"orientation": ORANGE, "warping": BLUE}
NAMES: Final = {"orientation": "orientation", "warping": "visual warping"}
DIRECTION_NAMES: Final = {"self": "to oneself", "left": "to the left", "right": "to the right"}
AXES: Final = {
    "accuracy": "Share of right answers",
    "realism": "Realism (1 to 9)",
    "response_ms": "Time to the answer (ms)",
}
CHANCE: Final = 0.2


def study_figures(analysis: WavingAnalysis) -> dict[str, Drawn]:
    """Return every figure by its name; all of them marked when the data are simulated."""
    n = counted(analysis.n_participants, "participant")
    means = f"Discs are means over {n} with 95 % confidence intervals."
    simulated = analysis.is_simulated
    figures = [
        draw(
            "accuracy",
            lambda: _main_effects(analysis, "accuracy"),
            title="Whose wave it was: accuracy by technique and direction",
            caption=f"Each line is one participant. {means} Open diamonds: published means "
            "(dashed: ± SD). Dotted: chance among five places.",
            alternative="Accuracy of every participant by technique, and by direction.",
            is_simulated=simulated,
        ),
        draw(
            "realism",
            lambda: _main_effects(analysis, "realism"),
            title="Realism by technique and direction",
            caption=f"Each line is one participant. {means} The source prints no mean ratings.",
            alternative="Realism ratings of every participant by technique, and by direction.",
            is_simulated=simulated,
        ),
        draw(
            "cells",
            lambda: _cells(analysis),
            title="Every cell of the design",
            caption=means,
            alternative="Accuracy, realism and response time by direction, for both techniques.",
            is_simulated=simulated,
        ),
        draw(
            "confusion",
            lambda: _confusion(analysis),
            title="Who was waved at, and who was taken to be",
            caption="Places from the participants' left (1) to right (5). Shades and numbers: "
            "share of the answers in a row; counts below.",
            alternative="Confusion matrices of five places for both techniques.",
            is_simulated=simulated,
        ),
    ]
    return {f.name: f for f in figures}


def _table(analysis: WavingAnalysis, measure: str, factor: str, levels: tuple[str, ...]) -> Values:
    grouped = analysis.means.groupby(["participant", factor])[measure].mean()
    return grouped.unstack(factor).reindex(columns=list(levels)).to_numpy(float)


def _main_effects(analysis: WavingAnalysis, measure: str) -> Figure:
    figure = new_figure(8.4, 3.9)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 1.3))
    table = _table(analysis, measure, "technique", TECHNIQUES)
    paired_lines(left, table, [NAMES[t] for t in TECHNIQUES], [COLOURS[t] for t in TECHNIQUES])
    table = _table(analysis, measure, "direction", DIRECTIONS)
    paired_lines(right, table, [DIRECTION_NAMES[d] for d in DIRECTIONS], [BLACK] * 3)
    if measure == "accuracy":
        for x, technique in zip((-0.3, 1.3), TECHNIQUES, strict=True):
            published_mark(left, x, *published.MEAN_ACCURACY[technique])
        for axes in (left, right):
            axes.axhline(CHANCE, color=BLACK, linewidth=0.8, linestyle=(0, (1, 2)))
        left.set_ylim(0, 1.02)
    left.set_ylabel(AXES[measure])
    left.set_title("Technique")
    right.set_title("Direction")
    return figure


def _cells(analysis: WavingAnalysis) -> Figure:
    figure = new_figure(9.6, 3.6)
    for axes, measure in zip(figure.subplots(1, 3), AXES, strict=True):
        for shift, technique in zip((-0.12, 0.12), TECHNIQUES, strict=True):
            chosen = analysis.means[analysis.means["technique"] == technique]
            middles = []
            for x, direction in enumerate(DIRECTIONS):
                values = chosen.loc[chosen["direction"] == direction, measure].to_numpy(float)
                draw_mean(axes, x + shift, values, COLOURS[technique])
                known = values[np.isfinite(values)]
                middles.append(float(known.mean()) if known.size else np.nan)
            axes.plot(
                np.arange(3) + shift, middles, color=COLOURS[technique], linewidth=1.2,
                label=NAMES[technique], zorder=3,
            )  # fmt: skip
        axes.set_xticks(range(3), list(DIRECTIONS))
        axes.set_xlim(-0.5, 2.5)
        axes.set_ylabel(AXES[measure])
        if measure == "accuracy":
            axes.set_ylim(0, 1.02)
            axes.legend(frameon=False, loc="lower left")
    return figure


def _confusion(analysis: WavingAnalysis) -> Figure:
    figure = new_figure(8.4, 4.2)
    for axes, technique in zip(figure.subplots(1, 2, sharey=True), TECHNIQUES, strict=True):
        counts = analysis.confusion(technique)
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shares, vmin=0, vmax=1, cmap="Blues")
        for i in range(5):
            for j in range(5):
                if counts[i, j]:
                    colour = "white" if shares[i, j] > 0.55 else BLACK
                    axes.text(
                        j, i, f"{shares[i, j]:.2f}\n{counts[i, j]}".replace("0.", "."),
                        ha="center", va="center", fontsize=7.5, color=colour,
                    )  # fmt: skip
        axes.set_xticks(range(5), [str(k) for k in range(1, 6)])
        axes.set_yticks(range(5), [str(k) for k in range(1, 6)])
        axes.set_xlabel("Answered place")
        axes.set_title(NAMES[technique].capitalize())
        axes.grid(visible=False)
        if technique == TECHNIQUES[0]:
            axes.set_ylabel("Place waved at")
    return figure
