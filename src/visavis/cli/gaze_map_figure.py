"""The figure of maps of gaze: a panel for each level, then where pairs of levels differ."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from visavis.analysis.gaze.maps import SMOOTHING_DEG, Cluster, Grid, Values
from visavis.analysis.gaze.sphere_maps import SPHERE_SMOOTHING_DEG, SphereGrid
from visavis.analysis.plots import ReportFigure, draw, new_figure, write_figure
from visavis.analysis.plots.labels import Anchor, Box, Lettering, best_anchor, settle
from visavis.analysis.plots.panels import in_lines
from visavis.analysis.plots.style import COLUMN_WIDTH_IN
from visavis.analysis.report.notation import count_of
from visavis.cli.gaze_map import GazeMaps, MapDifference
from visavis.recording.csv_file import write_csv
from visavis.results.figures.gaze_map_files import MAP_NAME
from visavis.results.opened_study import OpenedStudy
from visavis.study.texts import label_of

ON_ANY_COLOUR: Final = (withStroke(linewidth=1.4, foreground="#202020"),)
AROUND_OUTLINE: Final = (withStroke(linewidth=2.6, foreground="#202020"),)
Reach = tuple[float, float, float, float]
NAME_PT: Final = 8.5
TITLE_IN: Final = 0.17
"""Height of a line of a title."""
TICKS_IN: Final = 0.22
BAR_IN: Final = 0.62
MAX_STACKED: Final = 4
"""Panels that stand below each other; more stand in two columns."""


@dataclass(frozen=True)
class Layout:
    """How many panels stand beside each other, and rows of levels and of differences."""

    across: int
    level_rows: int
    difference_rows: int

    @property
    def rows(self) -> int:
        """Rows of panels."""
        return self.level_rows + self.difference_rows


def figure_of_maps(result: GazeMaps, study: OpenedStudy, *, is_simulated: bool) -> ReportFigure:
    """Return the figure: a panel for each level, and the differences of those compared."""
    texts = study.experiment({}, is_recorded=True).texts
    names = {level: label_of(texts, level) for level in result.levels}
    factor = label_of(texts, result.factor)
    n = count_of(len({who for of in result.people.values() for who in of}), "participant")
    on_picture = f" on {result.picture}" if result.picture else ""
    smoothing = f"{SMOOTHING_DEG:g}°"
    place = "The scene is that of one trial, seen from the middle of all eyes."
    if isinstance(result.grid, SphereGrid):
        smoothing = f"{SPHERE_SMOOTHING_DEG:g}° on the sphere"
        place = (
            "The whole picture, 360 by 180 degrees: degrees to the right of its middle, and "
            "upwards."
        )
    return draw(
        "_".join(filter(None, (f"{MAP_NAME}_{result.factor}", result.picture))),
        lambda: figure_of_panels(result, names),
        title=f"Where people looked{on_picture}, by {factor}",
        caption=f"Mean over {n} of the time of gaze on what was drawn, in ms per square degree and "
        f"trial, smoothed by {smoothing}. {difference_words(result, study)} {place}",
        alternative=f"The scene with the time of gaze on it, a picture for each {factor}.",
        is_simulated=is_simulated,
    )


def difference_words(result: GazeMaps, study: OpenedStudy) -> str:
    """Return in sentences where levels differ, or why they were not compared."""
    texts = study.experiment({}, is_recorded=True).texts
    names = {level: label_of(texts, level) for level in result.levels}
    if not result.differences:
        return f"Not compared: {result.why_not}."
    words = [_words_of(difference, names) for difference in result.differences]
    count = len(result.differences)
    if count > 1 and any(one.clusters is not None for one in result.differences):
        words.append(f"Each p is times {count}, for {count} pairs were compared.")
    if count == 1 and len(result.levels) > 2:
        words.append(
            f"Of {len(result.levels)} levels these two were compared; --compare chooses others."
        )
    return " ".join(dict.fromkeys(words))


def _words_of(difference: MapDifference, names: Mapping[str, str]) -> str:
    which = _title_of_pair(difference, names)
    if difference.clusters is None:
        return f"Not compared: {difference.why_not}."
    if not difference.clusters:
        return f"{which}: no cluster of cells differs (permutation test, p < .05)."
    ps = ", ".join(f"p = {c.p:.3f}".replace("0.", ".") for c in difference.clusters)
    return f"{which}: outlined clusters differ (permutation of signs, {ps})."


def _layout(result: GazeMaps) -> Layout:
    levels, differences = len(result.levels), len(result.differences)
    count = levels + differences
    # Names of areas and degrees need the width of a column, scenes without them half of it.
    is_plain = not result.outlines and not isinstance(result.grid, SphereGrid)
    across = 2 if count > MAX_STACKED or (is_plain and count > 1) else 1
    return Layout(across, -(-levels // across), -(-differences // across))


def figure_of_panels(result: GazeMaps, names: Mapping[str, str]) -> Figure:
    """Return the panels, to be read in a column of 85 mm."""
    layout = _layout(result)
    left, right, bottom, top = result.grid.reach
    row_in = COLUMN_WIDTH_IN / layout.across * (top - bottom) / (right - left)
    row_in += TICKS_IN * isinstance(result.grid, SphereGrid)
    height_in = BAR_IN * (1 + bool(result.differences))
    for count, titles in (
        (layout.level_rows, [_title_of_level(level, result, names) for level in result.levels]),
        (layout.difference_rows, [_title_of_pair(one, names) for one in result.differences]),
    ):
        lines = max((_title(title, layout.across).count("\n") + 1 for title in titles), default=0)
        height_in += count * (row_in + TITLE_IN * lines)
    figure = new_figure(COLUMN_WIDTH_IN, height_in)
    panels = figure.subplots(layout.rows, layout.across, squeeze=False)
    for axes in panels.flat:
        axes.set_axis_off()
    of_levels = list(panels[: layout.level_rows].flat)[: len(result.levels)]
    of_pairs = list(panels[layout.level_rows :].flat)[: len(result.differences)]
    for axes in (*of_levels, *of_pairs):
        _lay_ground(axes, result, layout.across)
    _draw_levels(figure, of_levels, result, names, layout.across)
    if of_pairs:
        _draw_differences(figure, of_pairs, result, names, layout.across)
    if result.outlines:
        settle(figure)
        for axes in of_levels:
            _put_names(axes, result)
    return figure


def _lay_ground(axes: Axes, result: GazeMaps, across: int) -> None:
    """Draw the scene in grey, and the degrees of a picture all around."""
    reach = result.grid.reach
    axes.imshow(
        result.image.mean(axis=2),
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=reach,
        interpolation="bilinear",
    )
    if isinstance(result.grid, SphereGrid):
        axes.set_axis_on()
        axes.set_xticks(range(-180, 181, 90) if across == 1 else (-90, 0, 90))
        axes.set_yticks(range(-90, 91, 45 * across))
        axes.xaxis.set_major_formatter("{x:.0f}°")
        axes.yaxis.set_major_formatter("{x:.0f}°")
        axes.tick_params(labelsize=NAME_PT)
    axes.set(xlim=reach[:2], ylim=reach[2:], aspect="equal")


def _title_of_level(level: str, result: GazeMaps, names: Mapping[str, str]) -> str:
    return f"{names[level]} (n = {len(result.people[level])})"


def _title_of_pair(difference: MapDifference, names: Mapping[str, str]) -> str:
    return f"{names[difference.first]} minus {names[difference.second]}"


def _title(words: str, across: int) -> str:
    return in_lines(words, 46 // across)


def _lay_over(axes: Axes, values: Values, reach: Reach, most: float, **look: Any) -> Any:
    """Lay values over the scene, the less of them the more transparent."""
    return axes.imshow(
        values,
        vmax=most,
        alpha=np.clip(np.abs(values) / most * 1.6, 0, 0.85),
        extent=reach,
        interpolation="bilinear",
        **look,
    )


def _mean(result: GazeMaps, level: str) -> Values:
    mean: Values = 1000 * result.maps[level].mean(axis=0)
    return mean


def _draw_levels(
    figure: Figure,
    panels: Sequence[Axes],
    result: GazeMaps,
    names: Mapping[str, str],
    across: int,
) -> None:
    means = {level: _mean(result, level) for level in result.levels}
    most = max(float(np.quantile(mean, 0.999)) for mean in means.values()) or 1.0
    for axes, level in zip(panels, result.levels, strict=True):
        colours = _lay_over(axes, means[level], result.grid.reach, most, cmap="inferno", vmin=0)
        for _, lines in result.outlines:
            for line in lines:
                axes.fill(
                    *line.T,
                    fill=False,
                    edgecolor="white",
                    linewidth=0.6,
                    path_effects=ON_ANY_COLOUR,
                )
        axes.set_title(_title(_title_of_level(level, result, names), across))
    _bar(figure, colours, panels, "ms per deg² and trial")


def _draw_differences(
    figure: Figure,
    panels: Sequence[Axes],
    result: GazeMaps,
    names: Mapping[str, str],
    across: int,
) -> None:
    apart = [_mean(result, one.first) - _mean(result, one.second) for one in result.differences]
    most = max(float(np.quantile(np.abs(values), 0.999)) for values in apart) or 1.0
    for axes, one, values in zip(panels, result.differences, apart, strict=True):
        colours = _lay_over(axes, values, result.grid.reach, most, cmap="PuOr_r", vmin=-most)
        for cluster in one.clusters or ():
            outline_cluster(axes, result.grid, cluster)
        axes.set_title(_title(_title_of_pair(one, names), across))
    _bar(figure, colours, panels, "difference (ms per deg²)")


def _bar(figure: Figure, colours: Any, panels: Sequence[Axes], label: str) -> None:
    bar = figure.colorbar(colours, ax=list(panels), location="bottom", aspect=30, label=label)
    bar.ax.tick_params(labelsize=NAME_PT)


def outline_cluster(axes: Axes, grid: Grid | SphereGrid, cluster: Cluster) -> QuadContourSet:
    """Draw a line along the edge of a cluster's cells, closed at the picture's edge; all around,
    where there is no edge, it goes on at the other side.
    """
    x, y = grid.centres()
    x = np.concatenate([[2 * x[0] - x[1]], x, [2 * x[-1] - x[-2]]])
    y = np.concatenate([[2 * y[0] - y[1]], y, [2 * y[-1] - y[-2]]])
    cells = cluster.cells.astype(float)
    if isinstance(grid, SphereGrid):
        cells = np.pad(np.pad(cells, ((1, 1), (0, 0)), "edge"), ((0, 0), (1, 1)), "wrap")
    else:
        cells = np.pad(cells, 1)
    outline = axes.contour(x, y, cells, [0.5], colors="white", linewidths=1.4)
    outline.set_path_effects(list(AROUND_OUTLINE))
    axes.set(xlim=grid.reach[:2], ylim=grid.reach[2:])
    return outline


def _put_names(axes: Axes, result: GazeMaps) -> None:
    """Write each area's name at a corner of it, where it hides no other name if there is room."""
    look = {"color": "white", "path_effects": ON_ANY_COLOUR, "annotation_clip": True}
    lettering = Lettering(axes, NAME_PT, look)
    left, right, bottom, top = result.grid.reach
    taken: list[Box] = []
    for name, lines in result.outlines:
        line = np.clip(lines[0], [left, bottom], [right, top])  # the longest, where one sees it
        (x, y), (u, v) = line.min(axis=0), line.max(axis=0)
        corners = [((x, y), (1, -1)), ((x, v), (1, 1)), ((u, y), (-1, -1)), ((u, v), (-1, 1))]
        corners += [((x, y), (-1, 1)), ((u, y), (1, 1)), ((x, v), (-1, -1)), ((u, v), (1, -1))]
        corners += [((x, y), (1, 1)), ((x, v), (1, -1)), ((u, v), (-1, -1)), ((u, y), (-1, 1))]
        anchors = [Anchor((float(a), float(b)), side) for (a, b), side in corners]
        anchor, box, _ = best_anchor(lettering, name, anchors, taken)
        lettering.write(name, anchor)
        taken.append(box)


def table_of_maps(result: GazeMaps, *, is_simulated: bool) -> pd.DataFrame:
    """Return a row for each level and cell: its place in degrees, mean and SD over people."""
    right_deg, up_deg = np.meshgrid(*result.grid.centres_deg())
    return pd.concat(
        [
            pd.DataFrame(
                {
                    result.factor: level,
                    "right_deg": right_deg.ravel().round(3),
                    "up_deg": up_deg.ravel().round(3),
                    "dwell_ms_per_deg2": (1000 * of.mean(axis=0)).ravel().round(4),
                    "sd_ms_per_deg2": (1000 * of.std(axis=0, ddof=1)).ravel().round(4)
                    if len(of) > 1
                    else np.nan,
                    "participants": len(of),
                    "is_simulated": is_simulated,
                }
            )
            for level, of in result.maps.items()
        ],
        ignore_index=True,
    )


def write_maps(
    result: GazeMaps, study: OpenedStudy, folder: Path, *, is_simulated: bool
) -> list[Path]:
    """Write the figure (SVG and PNG) and the table beside it; return their paths."""
    figure = figure_of_maps(result, study, is_simulated=is_simulated)
    paths = list(write_figure(figure, folder))
    table = folder / f"{figure.name}.csv"
    write_csv(table_of_maps(result, is_simulated=is_simulated), table)
    return [*paths, table]
