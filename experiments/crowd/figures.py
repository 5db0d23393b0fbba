"""The figures of the study, from its analysis."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from visavis.analysis.plots import BLUE, GREEN, GREY, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.plots.panels import no_data
from visavis.analysis.plots.style import BLACK
from visavis.experiments.crowd.design import AFTER, BEFORE, HAPTIC
from visavis.experiments.crowd.paths import GroupPaths
from visavis.results.analysis import StudyAnalysis

COLOURS = {BEFORE: BLUE, HAPTIC: VERMILION, AFTER: GREEN}
SHORT = {BEFORE: "before", HAPTIC: "haptic", AFTER: "after"}
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


def collision_figures(
    analysis: StudyAnalysis, group: GroupPaths
) -> tuple[ReportFigure, ReportFigure]:
    """Return collisions by body part, volume and duration; shoulders by the width of gaps."""
    return (
        draw(
            "collisions",
            lambda: _collisions(group, analysis.tables["collisions"]),
            title="Collisions by body part, volume and duration",
            caption="Left: counted collisions per walk by the participant's body part nearest the "
            "common volume, left and right taken together. Middle and right: how large and how "
            "long collisions are, on logarithmic axes, as a share of a block's collisions. "
            f"Measured by {analysis.measured_by}.",
            alternative="Bars of collisions by body part; histograms of volume and duration.",
            is_simulated=analysis.is_simulated,
        ),
        draw(
            "shoulders",
            lambda: _shoulders(group, analysis.tables["crossings"]),
            title="Shoulders at the gaps",
            caption="Mean angle of the shoulders at a crossing by the width between the two "
            "people's centres, with 95 % intervals over participants. Left: to the gap, as "
            "published. Right: to the walking direction, which passing obliquely does not change.",
            alternative="Shoulder angle against the distance between two people, by block.",
            is_simulated=analysis.is_simulated,
        ),
    )


def analysed_collisions(group: GroupPaths, collisions: pd.DataFrame) -> pd.DataFrame:
    """Return the counted collisions of a group's walks that are analysed."""
    mine = group.rows_of(collisions)
    return mine if mine.empty else mine[mine["counted"].to_numpy(bool)]


def _collisions(group: GroupPaths, collisions: pd.DataFrame) -> Figure:
    figure = new_figure(9.6, 3.6)
    parts, volumes, durations = figure.subplots(1, 3, width_ratios=(1.4, 1, 1))
    if collisions.empty or not collisions["counted"].any():
        for axes in (parts, volumes, durations):
            no_data(axes, "no collision")
        return figure
    counted_rows = analysed_collisions(group, collisions)
    walks = group.counted_walks.groupby("condition").size()
    y = np.arange(len(BODY_PARTS))
    for k, condition in enumerate(group.paths.blocks):
        block = counted_rows[counted_rows["condition"] == condition]
        n = max(int(walks.get(condition, 0)), 1)
        per_walk = [float((block["body_part"] == part).sum()) / n for part, _ in BODY_PARTS]
        parts.barh(
            y + 0.27 * (k - 1), per_walk, 0.25, color=COLOURS[condition], label=SHORT[condition]
        )
        for axes, column in ((volumes, "max_volume_dm3"), (durations, "duration_s")):
            values = np.log10(np.maximum(block[column].to_numpy(float), 1e-4))
            if len(values):
                weights = np.full(len(values), 100 / len(values))
                low = -3 if axes is volumes else -2
                bins = np.linspace(low, 1, 25)
                axes.hist(
                    np.clip(values, low, 1),
                    bins,
                    weights=weights,
                    histtype="step",
                    color=COLOURS[condition],
                    linewidth=1.6,
                )
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


def _shoulders(group: GroupPaths, crossings: pd.DataFrame) -> Figure:
    figure = new_figure(9.6, 3.6)
    panels = figure.subplots(1, 2, sharey=True)
    edges = np.array([0.65, 0.75, 0.85, 0.95, 1.05, 1.15, 1.3])
    middles = (edges[1:] + edges[:-1]) / 2
    columns = ("shoulders_to_gap_deg", "shoulders_to_way_deg")
    names = ("To the gap (°)", "To the walking direction (°)")
    mine = group.rows_of(crossings)
    for axes, column, name in zip(panels, columns, names, strict=True):
        axes.set_ylabel(name)
        axes.set_xlabel("Between the two people (m)")
        if mine.empty:
            no_data(axes, "no crossing")
            continue
        bins = np.digitize(mine["centres_apart_m"].to_numpy(float), edges) - 1
        for k, condition in enumerate(group.paths.blocks):
            means, spreads = [], []
            in_block = (mine["condition"] == condition).to_numpy(bool)
            for b in range(len(middles)):
                rows = mine[in_block & (bins == b)]
                values = rows.groupby("participant")[column].mean().to_numpy(float)
                values = values[np.isfinite(values)]
                means.append(values.mean() if values.size else np.nan)
                spreads.append(
                    1.96 * values.std(ddof=1) / np.sqrt(values.size) if values.size > 2 else np.nan
                )
            axes.errorbar(
                middles + 0.012 * (k - 1),
                means,
                spreads,
                color=COLOURS[condition],
                marker="o",
                markersize=5,
                linewidth=1.4,
                label=SHORT[condition],
            )
        axes.axhline(45, color=GREY, linewidth=0.7, linestyle=(0, (4, 3)))
        axes.set_ylim(0, 90)
    if mine.empty:
        return figure
    panels[0].legend(loc="lower left")
    panels[0].text(1.29, 46, "45°", color=BLACK, ha="right", fontsize=8.5)
    return figure
