"""The figures of the study, from its analysis."""

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

from analysis.plots import BLUE, GREEN, GREY, VERMILION, Drawn, draw, new_figure
from analysis.plots.panels import no_data, paired_lines, published_mark
from analysis.plots.style import BLACK
from analysis.report.notation import counted
from experiments.crowd import published
from experiments.crowd.analysis import CrowdAnalysis, Tables
from experiments.crowd.analysis_parameters import RULES
from experiments.crowd.collision_table import counted_of
from experiments.crowd.design import AFTER, BEFORE, CONDITIONS, HAPTIC
from experiments.crowd.figures_paths import path_figures
from experiments.crowd.terms import (
    CLEARANCE,
    CONTACT_SPEED,
    DURATION,
    HESITATIONS,
    PATH,
    PRIMARY,
    RATINGS,
    TIME,
    TO_WAY,
    Measure,
)
from lab.geometry import Vector
from visavis.figures import exclusions_figure

COLOURS = {BEFORE: BLUE, HAPTIC: VERMILION, AFTER: GREEN}
SHORT = ("before", "haptic", "after")
BODY_PARTS = (
    ("upper_arm", "upper arm"),
    ("lower_arm", "forearm"),
    ("hand", "hand"),
    ("shoulder", "shoulder"),
    ("upper_chest", "chest"),
    ("spine", "waist"),
    ("hips", "hips"),
    ("head", "head"),
    ("neck", "neck"),
    ("upper_leg", "thigh"),
    ("lower_leg", "calf"),
    ("foot", "foot"),
)


def study_figures(
    analysis: CrowdAnalysis, tables: Tables, tracks: Mapping[tuple[str, str], Vector]
) -> dict[str, Drawn]:
    """Return every figure by its name; all of them marked when the data are simulated.

    `tracks` holds each walk's way over the floor (n, 2) by participant and trial.
    """
    simulated = analysis.is_simulated
    n = counted(len(analysis.main.people), "participant")
    about = (
        f"Each line is one participant (mean over the walks of a block; {n}). Discs are means "
        "with 95 % confidence intervals. Open diamonds with dashed bars: published mean ± SD."
    )
    volumes = f" Volumes by rule and surface: {', '.join(analysis.rules)}."
    figures = [
        draw(
            "blocks",
            lambda: _measures(analysis, PRIMARY, 2),
            title="The published measures by block",
            caption=about + volumes,
            alternative="Four panels with collisions, volume, shoulder rotation and speed of every "
            "participant in three blocks.",
            is_simulated=simulated,
        ),
        draw(
            "further",
            lambda: _measures(
                analysis, (TO_WAY, DURATION, CONTACT_SPEED, CLEARANCE, TIME, HESITATIONS), 2
            ),
            title="Further measures by block",
            caption=about.partition(" Open")[0] + volumes.replace("Volumes", "Collisions"),
            alternative="Six panels of further measures of every participant in three blocks.",
            is_simulated=simulated,
        ),
        draw(
            "ratings",
            lambda: _measures(analysis, RATINGS, 1),
            title="Presence and embodiment by block",
            caption=about + " Ratings from 1 to 7.",
            alternative="Four panels of ratings of every participant in three blocks.",
            is_simulated=simulated,
        ),
        draw(
            "collisions",
            lambda: _collisions(analysis, tables),
            title="Collisions by body part, volume and duration",
            caption="Left: counted collisions per walk by the participant's body part nearest the "
            "common volume, left and right taken together. Middle and right: how large and how "
            "long collisions are, on logarithmic axes, as a share of a block's collisions."
            + volumes,
            alternative="Bars of collisions by body part; histograms of volume and duration.",
            is_simulated=simulated,
        ),
        draw(
            "shoulders",
            lambda: _shoulders(analysis, tables),
            title="Shoulders at the gaps",
            caption="Mean angle of the shoulders at a crossing by the width between the two "
            "people's centres, with 95 % intervals over participants. Left: to the gap, as "
            "published. Right: to the walking direction, which passing obliquely does not change.",
            alternative="Shoulder angle against the distance between two people, for three blocks.",
            is_simulated=simulated,
        ),
    ]
    figures += path_figures(analysis, tables, tracks)
    figures.append(exclusions_figure(analysis.selection, RULES, is_simulated=simulated))
    return {f.name: f for f in figures}


def _measures(analysis: CrowdAnalysis, measures: Sequence[Measure], rows: int) -> Figure:
    columns = -(-len(measures) // rows)
    figure = new_figure(9.6, 3.1 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    colours = [COLOURS[c] for c in CONDITIONS]
    for axes, measure in zip(panels.flat, measures, strict=True):
        found = analysis.main.comparison(measure)
        axes.set_title(measure.label)
        if not len(found.table):
            no_data(axes, fill(found.problem or "not measured", 18))
            continue
        paired_lines(axes, found.table, SHORT, colours)
        printed = published.MEANS.get(measure.column, {})
        for x, condition in enumerate(CONDITIONS):
            if condition in printed:
                published_mark(axes, x + 0.26, printed[condition].mean, printed[condition].sd)
        axes.set_ylabel(measure.axis if measure.unit else measure.label)
        if measure.is_rating:
            axes.set_ylim(0.8, 7.2)
        elif measure not in (PATH,):
            axes.set_ylim(bottom=0)
    return figure


def _collisions(analysis: CrowdAnalysis, tables: Tables) -> Figure:
    figure = new_figure(9.6, 3.6)
    parts, volumes, durations = figure.subplots(1, 3, width_ratios=(1.4, 1, 1))
    found = tables["collisions"]
    if found.empty or not found["counted"].any():
        for axes in (parts, volumes, durations):
            no_data(axes, "no collision")
        return figure
    counted_rows = counted_of(analysis.main, found)
    walks = analysis.main.kept.groupby("condition").size()
    y = np.arange(len(BODY_PARTS))
    for k, condition in enumerate(CONDITIONS):
        block = counted_rows[counted_rows["condition"] == condition]
        n = max(int(walks.get(condition, 0)), 1)
        per_walk = [float((block["body_part"] == part).sum()) / n for part, _ in BODY_PARTS]
        parts.barh(y + 0.27 * (k - 1), per_walk, 0.25, color=COLOURS[condition], label=SHORT[k])
        for axes, column in ((volumes, "max_volume_dm3"), (durations, "duration_s")):
            values = np.log10(np.maximum(block[column].to_numpy(float), 1e-4))
            if len(values):
                weights = np.full(len(values), 100 / len(values))
                low = -3 if axes is volumes else -2
                bins = np.linspace(low, 1, 25)
                axes.hist(
                    np.clip(values, low, 1), bins, weights=weights, histtype="step",
                    color=COLOURS[condition], linewidth=1.6,
                )  # fmt: skip
    parts.set_yticks(y, [label for _, label in BODY_PARTS])
    parts.invert_yaxis()
    parts.set_xlabel("Collisions per walk")
    parts.legend(loc="lower right")
    for axes, low, label in (
        (volumes, -3, "Largest common volume (dm³)"),
        (durations, -2, "Duration (s)"),
    ):
        ticks = list(range(low, 2))
        axes.set_xticks(ticks, [f"{10.0**t:g}" for t in ticks])
        axes.set_xlabel(label)
        axes.set_ylabel("Share of collisions (%)")
    return figure


def _shoulders(analysis: CrowdAnalysis, tables: Tables) -> Figure:
    figure = new_figure(9.6, 3.6)
    panels = figure.subplots(1, 2, sharey=True)
    crossings = tables["crossings"]
    edges = np.array([0.65, 0.75, 0.85, 0.95, 1.05, 1.15, 1.3])
    middles = (edges[1:] + edges[:-1]) / 2
    columns = ("shoulders_to_gap_deg", "shoulders_to_way_deg")
    names = ("To the gap (°)", "To the walking direction (°)")
    mine = crossings
    if len(crossings):
        walks = analysis.main.walks
        keys = zip(crossings["participant"], crossings["trial_id"], strict=True)
        mine = crossings[np.array([(str(p), str(t)) in walks for p, t in keys])]
    for axes, column, name in zip(panels, columns, names, strict=True):
        axes.set_ylabel(name)
        axes.set_xlabel("Between the two people (m)")
        if mine.empty:
            no_data(axes, "no crossing")
            continue
        bins = np.digitize(mine["centres_apart_m"].to_numpy(float), edges) - 1
        for k, condition in enumerate(CONDITIONS):
            means, spreads = [], []
            chosen = (mine["condition"] == condition).to_numpy(bool)
            for b in range(len(middles)):
                rows = mine[chosen & (bins == b)]
                values = rows.groupby("participant")[column].mean().to_numpy(float)
                values = values[np.isfinite(values)]
                means.append(values.mean() if values.size else np.nan)
                spreads.append(
                    1.96 * values.std(ddof=1) / np.sqrt(values.size) if values.size > 2 else np.nan
                )
            axes.errorbar(
                middles + 0.012 * (k - 1), means, spreads, color=COLOURS[condition],
                marker="o", markersize=5, linewidth=1.4, label=SHORT[k],
            )  # fmt: skip
        axes.axhline(45, color=GREY, linewidth=0.7, linestyle=(0, (4, 3)))
        axes.set_ylim(0, 90)
    if mine.empty:
        return figure
    panels[0].legend(loc="lower left")
    panels[0].text(1.29, 46, "45°", color=BLACK, ha="right", fontsize=8.5)
    return figure
