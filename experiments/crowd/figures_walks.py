"""The figure of single walks from above: one of each block, with its contacts."""

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from visavis.analysis.plots import BLUE, GREY, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.report.notation import count_of, decimal
from visavis.experiments.crowd.figures import analysed_collisions
from visavis.experiments.crowd.figures_paths import UPRIGHT, draw_place
from visavis.experiments.crowd.paths import GroupPaths
from visavis.lab.geometry import Vector
from visavis.recording.csv_file import csv_text
from visavis.results.analysis import StudyAnalysis
from visavis.results.unusual import key_of_row
from visavis.stimuli.scenes.station_crowd import BOARD_M, DENSITY_PER_M2, station_crowd
from visavis.study.sections import TrialToSee

WALKS: Final = "walks"
AREA_PT2_PER_DM3: Final = 30.0
MIN_AREA_PT2: Final = 6.0


def walks_figure(
    analysis: StudyAnalysis, group: GroupPaths
) -> tuple[ReportFigure, tuple[TrialToSee, ...]]:
    """Return the figure, drawn, and the walks it shows: of each block that of the median length
    through the first configuration, the first of several.
    """
    configuration = group.paths.configurations[0]
    collisions = analysed_collisions(group, analysis.tables["collisions"])
    tracks = group.rows_of(analysis.tables["cells"])
    tracks = tracks[tracks["configuration"] == configuration]
    walks = [
        walk
        for condition in group.paths.blocks
        for walk in _median_walk(group.counted_walks, tracks, condition)
    ]
    contacts = [_of_walk(collisions, walk) for walk in walks]
    figure = draw(
        WALKS,
        lambda: _panels(walks, contacts, tracks, group, configuration),
        title="Single walks from above, with contacts",
        caption=f"Configuration {configuration}; of each block the walk of median length, over "
        "everybody's (grey). Line: the hips, there (solid) and back (dashed). Discs: where they "
        "were when a counted collision began, the larger the larger its volume. Dots: people. "
        f"Square: start. Arc: where the board can be read. Measured by {analysis.measured_by}.",
        alternative="One walk of each block, drawn from above, with discs where it met people.",
        is_simulated=analysis.is_simulated,
        data=csv_text(_data(walks, contacts).assign(is_simulated=analysis.is_simulated)),
    )
    to_see = [
        TrialToSee(*key_of_row(walk), f"{walk['condition']}: {_reason_of(walk, mine)}")
        for walk, mine in zip(walks, contacts, strict=True)
    ]
    return figure, tuple(to_see)


def _reason_of(walk: pd.Series, contacts: pd.DataFrame) -> str:
    length = walk.get("path_m")
    far = "" if length is None or length != length else f"{decimal(float(length), 1)} m, "
    return f"{far}{count_of(len(contacts), 'collision')}, the median length of its block"


def _median_walk(walks: pd.DataFrame, tracks: pd.DataFrame, condition: str) -> list[pd.Series]:
    """Return the walk of a block whose length is nearest to the median; none where nobody walked.

    Its row has the way, too.
    """
    mine = walks.merge(
        tracks[["participant", "trial_id", "track_m"]], on=["participant", "trial_id"]
    )
    mine = mine[mine["condition"].astype(str) == condition].reset_index(drop=True)
    if mine.empty:
        return []
    lengths_m = pd.to_numeric(mine.get("path_m", pd.Series(np.nan, mine.index)), errors="coerce")
    apart_m = (lengths_m - lengths_m.median()).abs().fillna(np.inf)
    return [mine.iloc[int(apart_m.argmin())]]


def _of_walk(rows: pd.DataFrame, walk: pd.Series) -> pd.DataFrame:
    if rows.empty:
        return rows
    mine: pd.DataFrame = rows[
        (rows["participant"] == walk["participant"]) & (rows["trial_id"] == walk["trial_id"])
    ]
    return mine


def _way_m(track: Any) -> Vector:
    """Return the places (n, 2) of a way, x and z."""
    return np.array(json.loads(track), float).reshape(-1, 2)


def _panels(
    walks: Sequence[pd.Series],
    contacts: Sequence[pd.DataFrame],
    tracks: pd.DataFrame,
    group: GroupPaths,
    configuration: int,
) -> Figure:
    figure = new_figure(9.6, 3.75)
    panels = figure.subplots(1, max(1, len(walks)), sharex=True, sharey=True, squeeze=False)[0]
    density = group.counted_walks.get("crowd_density_per_m2", pd.Series([DENSITY_PER_M2])).iloc[0]
    people_m = station_crowd(configuration, float(density)).position_m
    for axes, walk, mine in zip(panels, walks, contacts, strict=True):
        of_block = tracks[tracks["condition"].astype(str) == str(walk["condition"])]
        ways = [_way_m(track) * UPRIGHT for track in of_block["track_m"]]
        axes.add_collection(LineCollection(ways, colors=GREY, linewidths=0.5, alpha=0.4))
        draw_place(axes, people_m)
        _walk(axes, _way_m(walk["track_m"]), mine)
        axes.set_title(f"{walk['condition']}: {count_of(len(mine), 'collision')}")
    panels[0].set_ylabel("−z (m)")
    return figure


def _walk(axes: Axes, way_m: Vector, contacts: pd.DataFrame) -> None:
    """Draw one walk, and where it met people."""
    apart_m = np.linalg.norm(way_m - np.array([BOARD_M[0], BOARD_M[2]]), axis=1)
    turn = int(np.nanargmin(apart_m)) if np.isfinite(apart_m).any() else 0
    way = way_m * UPRIGHT
    axes.plot(*way[: turn + 1].T, color=BLUE, linewidth=1.5, zorder=3)
    axes.plot(*way[turn:].T, color=BLUE, linewidth=1.2, linestyle=(0, (3, 1.5)), zorder=3)
    if len(contacts):
        x, y = (contacts[["x_m", "z_m"]].to_numpy(float) * UPRIGHT).T
        volume_dm3 = np.nan_to_num(contacts["max_volume_dm3"].to_numpy(float))
        area = MIN_AREA_PT2 + AREA_PT2_PER_DM3 * volume_dm3
        axes.scatter(x, y, area, color=VERMILION, alpha=0.6, linewidths=0, zorder=4)


def _data(walks: Sequence[pd.Series], contacts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Return what is drawn bold: places of the walks in order, and of their collisions."""
    tables = []
    for walk, mine in zip(walks, contacts, strict=True):
        way = pd.DataFrame(_way_m(walk["track_m"]), columns=["x_m", "z_m"])
        columns = ["x_m", "z_m", "start_s", "person", "max_volume_dm3"]
        collisions = mine[[c for c in columns if c in mine]]
        key = {"participant": walk["participant"], "trial_id": walk["trial_id"]}
        key["condition"] = walk["condition"]
        tables += [way.assign(**key, is_of="way"), collisions.assign(**key, is_of="collision")]
    every = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
    first = [c for c in ("participant", "trial_id", "condition", "is_of") if c in every]
    return every[[*first, *(c for c in every if c not in first)]]
