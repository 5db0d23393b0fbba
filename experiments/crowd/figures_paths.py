"""Figures of paths and cells: everybody's way through a crowd, how often each cell was walked."""

import json
from collections import Counter
from collections.abc import Mapping
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from visavis.analysis.cells import Triangulation
from visavis.analysis.cells.triangulation import Cell, as_cell
from visavis.analysis.plots import BLUE, GREY, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.plots.panels import no_data
from visavis.analysis.plots.style import BLACK
from visavis.experiments.crowd import published
from visavis.experiments.crowd.comparisons import PAIRS
from visavis.experiments.crowd.measures import crowd_cells
from visavis.experiments.crowd.paths import VARIANT_NAMES, VARIANTS, GroupPaths
from visavis.lab.geometry import Vector
from visavis.results.analysis import StudyAnalysis
from visavis.stimuli.scenes.station_crowd import (
    BOARD_M,
    DENSITY_PER_M2,
    READ_WITHIN_M,
    START_M,
    station_crowd,
)

SHORT_PAIRS = dict(zip(PAIRS, ("before–haptic", "haptic–after", "before–after"), strict=True))
UPRIGHT = np.array([1.0, -1.0])
"""Seen from above, −z is up the page, so that right stays right."""


def path_figures(analysis: StudyAnalysis, group: GroupPaths) -> list[ReportFigure]:
    """Return a figure of similarities and one of paths per configuration that was walked."""
    is_simulated = analysis.is_simulated
    figures = [
        draw(
            "similarity",
            lambda: _similarity(group),
            title="Similarity of the paths of two blocks",
            caption="Left: as published, Dice of all cells of one block with all of another, one "
            "dot per configuration, beside random halves of one block (grey) and the published "
            "means (diamonds). Larger groups and the same people on both sides make blocks more "
            "alike than halves even where a block changes nothing. Right: groups of equal size "
            "with different people on both sides, within a block and between blocks, in three "
            "variants of Dice, each for the same three pairs of blocks; p by permutation.",
            alternative="Dice between blocks and within blocks, as published and compared fairly.",
            is_simulated=is_simulated,
        )
    ]
    rows = group.rows_of(analysis.tables["cells"])
    figures += [
        draw(
            f"paths_{configuration}",
            partial(_paths, group, rows, configuration),
            title=f"Paths and cells, configuration {configuration}",
            caption="From above; one line per participant, there and back. Colour: how many "
            "participants walked through the triangle between three people. Dots: people. Square: "
            "start. Arc: where the board can be read.",
            alternative=f"Three maps of configuration {configuration}, one per block.",
            is_simulated=is_simulated,
        )
        for configuration in group.paths.configurations
    ]
    return figures


def _similarity(group: GroupPaths) -> Figure:
    figure = new_figure(9.6, 3.9)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
    paths = group.paths
    within = paths.within["union"].ravel()
    within = within[np.isfinite(within)]
    if not within.size:
        no_data(left, "too few people")
        no_data(right, "too few people")
        return figure
    pairs = paths.block_pairs
    for x, pair in enumerate(pairs):
        values = paths.pair(pair).by_configuration
        left.scatter(np.full(len(values), x), values, s=22, color=BLUE, alpha=0.7)
        published_dice = published.DICE_BETWEEN_ALL[pair]
        _diamond(left, x + 0.22, published_dice.mean, published_dice.sd)
    offset = np.linspace(-0.18, 0.18, within.size)
    left.scatter(len(pairs) + offset, within, s=10, color=GREY, alpha=0.6)
    _diamond(left, len(pairs) + 0.3, published.DICE_WITHIN.mean, published.DICE_WITHIN.sd)
    names = [SHORT_PAIRS[pair].replace("–", "–\n") for pair in pairs]
    left.set_xticks(range(len(pairs) + 1), [*names, "within\n(halves)"])
    left.set_ylabel("Dice (union of cells)")
    left.set_title("As published")
    at = 0.0
    ticks: list[float] = []
    labels: list[str] = []
    for variant in VARIANTS:
        for k, pair in enumerate(pairs):
            fair = paths.pair(pair, variant).fair
            if fair is None:
                continue
            right.plot([at, at], [fair.within, fair.between], color=GREY, linewidth=1)
            kinds = ("within", "between") if at == 0.0 else (None, None)
            right.plot([at], [fair.within], "o", color=BLUE, label=kinds[0])
            right.plot([at], [fair.between], "s", color=VERMILION, label=kinds[1])
            top = max(fair.within, fair.between)
            right.text(at, top + 0.012, f"p {fair.p:.2f}", ha="center", fontsize=8, color=BLACK)
            if k == len(pairs) // 2:
                ticks.append(at)
                labels.append(
                    VARIANT_NAMES[variant].replace(" of ", "\nof ").replace(" over ", "\nover ")
                )
            at += 0.7
        at += 0.5
    if ticks:
        right.set_xticks(ticks, labels)
        right.legend(loc="lower left")
        low, high = right.get_ylim()
        right.set_ylim(low, high + 0.05)
    else:
        no_data(right, "too few people")
    right.set_title("Equal sizes, different people")
    right.set_ylabel("Dice")
    return figure


def _diamond(axes: Axes, x: float, mean: float, sd: float) -> None:
    axes.plot([x, x], [mean - sd, mean + sd], color=BLACK, linewidth=1, linestyle=(0, (3, 2)))
    axes.plot([x], [mean], "D", color="white", mec=BLACK, markersize=6.5)


def _paths(group: GroupPaths, rows: pd.DataFrame, configuration: int) -> Figure:
    figure = new_figure(9.6, 3.75)
    blocks = group.paths.blocks
    panels = figure.subplots(1, len(blocks), sharex=True, sharey=True, squeeze=False)[0]
    density = group.counted_walks.get("crowd_density_per_m2", pd.Series([DENSITY_PER_M2])).iloc[0]
    cells = crowd_cells(station_crowd(configuration, float(density)))
    visits = {c: Counter[Cell]() for c in blocks}
    lines: dict[str, list[Vector]] = {c: [] for c in blocks}
    for row in rows[rows["configuration"] == configuration].to_dict("records"):
        condition = str(row["condition"])
        visits[condition].update(
            {(c[0], c[1], c[2]) for c in json.loads(row["cells"]) if c is not None}
        )
        lines[condition].append(np.array(json.loads(row["track_m"])).reshape(-1, 2) * UPRIGHT)
    most = max((n for v in visits.values() for n in v.values()), default=1)
    for axes, condition in zip(panels, blocks, strict=True):
        picture = _map(axes, cells, visits[condition], most)
        axes.add_collection(
            LineCollection(lines[condition], colors=BLACK, linewidths=0.5, alpha=0.35, zorder=3)
        )
        axes.set_title(condition)
    bar = figure.colorbar(
        picture, ax=list(panels), shrink=0.8, pad=0.01, ticks=MaxNLocator(integer=True)
    )
    bar.set_label("Participants")
    return figure


def _map(axes: Axes, cells: Triangulation, visits: Mapping[Cell, int], most: int) -> PolyCollection:
    points = cells.positions_m * UPRIGHT
    triangles = [as_cell(t) for t in cells.triangles]
    picture = PolyCollection(
        [points[list(t)] for t in triangles],
        array=np.array([visits.get(t, 0) for t in triangles], float),
        cmap="YlGnBu",
        edgecolors="#c9d1da",
        linewidths=0.35,
    )
    picture.set_clim(0, most)
    axes.add_collection(picture)
    draw_place(axes, cells.positions_m)
    return picture


def draw_place(axes: Axes, people_m: Vector) -> None:
    """Draw people (n, 2), the mark, and where the board can be read, from above."""
    points = people_m * UPRIGHT
    axes.scatter(points[:, 0], points[:, 1], s=5, color=GREY, zorder=2)
    axes.plot([START_M[0]], [-START_M[1]], "s", color=VERMILION, markersize=6, zorder=4)
    turn = np.linspace(0, 2 * np.pi, 90)
    axes.plot(
        BOARD_M[0] + READ_WITHIN_M * np.cos(turn),
        -BOARD_M[2] + READ_WITHIN_M * np.sin(turn),
        color="#2c8a57",
        linewidth=1,
    )
    axes.set_aspect("equal")
    axes.set_xlim(-5.1, 5.1)
    axes.set_ylim(-5.1, 5.1)
    axes.set_xlabel("x (m)")
