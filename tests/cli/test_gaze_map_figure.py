"""The figure of maps of gaze: what is outlined, which pairs are compared, how large letters are."""

from itertools import combinations

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from visavis.analysis.gaze.maps import Cluster, Grid
from visavis.analysis.gaze.sphere_maps import SphereGrid
from visavis.analysis.plots import draw
from visavis.analysis.plots.style import new_figure
from visavis.cli.gaze_map import GazeMaps, MapDifference, _difference, _pairs
from visavis.cli.gaze_map_figure import figure_of_panels, outline_cluster

READABLE_PT, COLUMN_MM, MM_PER_IN = 5.8, 85, 25.4
N = 8
GRID = Grid(0.8, 0.5, 32, 20)
HERE = (slice(6, 12), slice(10, 18))
"""Cells where the first level has more."""
EYES = ("left_eye", "right_eye", "nose", "mouth")


def maps_of(
    levels: str,
    *,
    grid: Grid | SphereGrid = GRID,
    areas: tuple[str, ...] = (),
    apart: float = 1.0,
    is_tested: bool = True,
) -> GazeMaps:
    """Made-up maps of eight people; those of level A have more in one place."""
    shape = (N, *grid.centres()[1].shape, *grid.centres()[0].shape)
    maps = {level: np.ones(shape) for level in levels}
    maps["A"][:, *HERE] += apart * (1 + np.arange(N)[:, None, None] / N)
    people = {level: tuple(f"P{k}" for k in range(N)) for level in levels}
    pairs = _pairs(levels)
    differences = tuple(
        _difference(pair, people, maps, grid, len(pairs)) if is_tested else MapDifference(*pair, ())
        for pair in pairs
    )
    box = np.array([[0, 0], [0.1, 0], [0.1, 0.06], [0, 0.06]])
    left, right, bottom, top = grid.reach
    unit = np.array([right - left, top - bottom])
    outlines = tuple(
        (name, ((box + np.array([0.12 * (k % 2), 0.08 * (k // 2)])) * unit,))
        for k, name in enumerate(areas)
    )
    image = np.full((60, 96, 3), 120, np.uint8)
    return GazeMaps(
        "level", tuple(levels), people, maps, grid, image, differences, outlines=outlines
    )


def panels_of(result: GazeMaps) -> Figure:
    names = {level: f"condition {level} of what was seen" for level in result.levels}
    return draw(
        "gaze_map_by_level",
        lambda: figure_of_panels(result, names),
        title="t",
        caption="c",
        alternative="a",
        is_simulated=False,
    ).figure


def outline_of(
    grid: Grid | SphereGrid, cells: npt.NDArray[np.bool_]
) -> list[npt.NDArray[np.float64]]:
    axes = new_figure(4.0, 3.0).subplots()
    outline = outline_cluster(axes, grid, Cluster(cells, True, 0.01))
    return [line for line in outline.get_paths()[0].to_polygons(closed_only=False) if len(line)]


def ticks_of(axes: Axes) -> list[Text]:
    """Numbers beside the axes of a panel; ticks beyond its ends are not drawn."""
    found = []
    for axis in (axes.xaxis, axes.yaxis) if axes.axison else ():
        low, high = sorted(axis.get_view_interval())
        found += [t.label1 for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
    return found


@pytest.mark.parametrize("rows", [slice(6, 12), slice(0, 4)], ids=["within", "at the edge"])
def test_the_outline_of_a_cluster_is_the_closed_edge_of_its_cells(rows: slice) -> None:
    cells = np.zeros(GRID.shape, np.bool_)
    cells[rows, 10:18] = True
    (line,) = outline_of(GRID, cells)
    assert line[0].tolist() == line[-1].tolist()
    wide, high = 1.6 / 32, 1.0 / 20
    edges = [-0.8 + 10 * wide, -0.8 + 18 * wide, 0.5 - rows.stop * high, 0.5 - rows.start * high]
    low, top = line.min(axis=0), line.max(axis=0)
    assert edges == pytest.approx([low[0], top[0], low[1], top[1]])
    x, y = line.T
    beside = np.minimum(abs(x - edges[0]), abs(x - edges[1]))
    above = np.minimum(abs(y - edges[2]), abs(y - edges[3]))
    assert np.minimum(beside, above).max() < 1e-9


def test_a_cluster_that_goes_on_all_around_has_no_line_where_the_picture_ends() -> None:
    cells = np.zeros((180, 360), np.bool_)
    cells[60:90, :20] = cells[60:90, -20:] = True
    lines = outline_of(SphereGrid(), cells)
    assert [-160.0, 160.0] == pytest.approx(sorted(line[:, 0].mean() for line in lines), abs=15)
    x, y = np.concatenate(lines).T
    at_end = abs(x) > 179
    assert set(np.round(y[at_end])) <= {30.0, 0.0}


def test_a_difference_that_holds_is_outlined_and_one_that_does_not_is_not() -> None:
    (difference,) = maps_of("AB").differences
    (cluster,) = difference.clusters or ()
    assert cluster.is_more
    assert cluster.cells[HERE].all()
    assert 48 == cluster.cells.sum()
    for apart, has_outline in ((1.0, True), (0.0, False)):
        panels = [a for a in panels_of(maps_of("AB", apart=apart)).axes if len(a.images) == 2]
        assert [0, 0, int(has_outline)] == [len(axes.collections) for axes in panels]


def test_every_pair_of_three_levels_is_compared_with_its_p_times_three() -> None:
    result = maps_of("ABC")
    assert list(combinations("ABC", 2)) == [(d.first, d.second) for d in result.differences]
    found = [d.clusters for d in result.differences]
    assert [1, 1, 0] == [len(clusters or ()) for clusters in found]
    assert 3 * 2 / 2**N == pytest.approx((found[0] or ())[0].p)


def test_of_more_than_three_levels_the_first_two_are_compared() -> None:
    assert [("A", "B")] == [(d.first, d.second) for d in maps_of("ABCD").differences]


@pytest.mark.parametrize(
    ("levels", "grid", "areas"),
    [
        ("AB", GRID, ()),
        ("ABC", GRID, EYES),
        ("AB", GRID, EYES),
        ("AB", SphereGrid(), EYES),
        ("ABCD", SphereGrid(), ()),
    ],
)
def test_a_gaze_map_is_readable_in_a_column_of_85_mm(
    levels: str, grid: Grid | SphereGrid, areas: tuple[str, ...]
) -> None:
    figure = panels_of(maps_of(levels, grid=grid, areas=areas, is_tested=False))
    shrunk = COLUMN_MM / MM_PER_IN / figure.get_size_inches()[0]
    figure.draw_without_rendering()
    page = figure.bbox.padded(1)
    for axes in figure.axes:
        words = [axes.title, axes.xaxis.label, *axes.texts, *ticks_of(axes)]
        drawn = [text for text in words if text.get_text()]
        assert all(text.get_fontsize() * shrunk >= READABLE_PT for text in drawn)
        for text in drawn:
            box = text.get_window_extent()
            assert page.x0 <= box.x0, text
            assert box.x1 <= page.x1, text
            assert page.y0 <= box.y0 < box.y1 <= page.y1, text
    of_levels = [axes for axes in figure.axes if len(axes.images) == 2][: len(levels)]
    assert {areas} == {tuple(text.get_text() for text in axes.texts) for axes in of_levels}
    for axes in of_levels:  # no name hides another
        boxes = [text.get_window_extent() for text in axes.texts]
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
