"""Walk a path through the cells of a crowd: which cells in which order, and where it crosses.

Segments between samples are walked, not samples, so no cell is missed at any rate. Ties (a sample
on a person or an edge, a step along an edge) are decided as if the whole path were shifted by
(e, e²) with e infinitely small: no sample then lies on an edge and no step meets a corner, and
each crossing leaves the cell that the one before it entered.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.cells.errors import MalformedPositions
from visavis.analysis.cells.triangulation import (
    MICROMETRES,
    Cell,
    Edge,
    Point,
    Triangulation,
    as_cell,
    orientation,
    to_micrometres,
)
from visavis.lab.geometry import Vector


@dataclass(frozen=True)
class Crossing:
    """A passage between two characters.

    `edge` the two (rising), `at_m` (2,) the place, `s` the sample before it plus the fraction of
    the step, `heading` (2,) the unit direction of the step, `before` and `after` the cells.
    """

    edge: Edge
    at_m: tuple[float, float]
    s: float
    heading: tuple[float, float]
    before: Cell | None
    after: Cell | None


@dataclass(frozen=True)
class CellPath:
    """A path as cells: `cells` in the order entered, None outside the crowd, and `crossings`.

    Crossing k leads from one cell to the next. Where samples were lost the path starts anew:
    `starts` are the indices into `cells` that no crossing leads to (0 first), `n_lost` counts
    lost samples.
    """

    cells: tuple[Cell | None, ...]
    crossings: tuple[Crossing, ...]
    starts: tuple[int, ...]
    n_lost: int

    @property
    def cell_set(self) -> frozenset[Cell]:
        """The cells visited, without the outside."""
        return frozenset(c for c in self.cells if c is not None)


def walk(triangulation: Triangulation, path_m: npt.ArrayLike) -> CellPath:
    """Walk (n, 2) samples in metres, in order; rows of NaN are lost samples.

    Nothing is invented for lost samples: the path ends before them and starts anew after.
    Raises MalformedPositions for a path without any sample or farther than a kilometre away.
    """
    path = np.asarray(path_m, float)
    if path.ndim != 2 or path.shape[1] != 2:
        raise MalformedPositions(f"the path has shape {path.shape}; give (n, 2) in metres")
    is_lost = np.isnan(path).any(axis=1)
    if is_lost.all():
        raise MalformedPositions("the path has no sample; leave out trials without tracking")
    whole = to_micrometres(np.where(is_lost[:, None], 0.0, path), "path")
    points = [(int(x), int(y)) for x, y in whole]
    cells: list[Cell | None] = []
    crossings: list[Crossing] = []
    starts: list[int] = []
    triangle: Cell | None = None
    for i, point in enumerate(points):
        if is_lost[i]:
            continue
        if i == 0 or is_lost[i - 1]:
            triangle = locate(triangulation, point)
            starts.append(len(cells))
            cells.append(None if triangle is None else as_cell(triangle))
        if i + 1 < len(points) and not is_lost[i + 1]:
            triangle = _step(triangulation, triangle, points, i, cells, crossings)
    return CellPath(tuple(cells), tuple(crossings), tuple(starts), int(is_lost.sum()))


def locate(triangulation: Triangulation, point_um: Point) -> Cell | None:
    """Return the triangle (corners counter-clockwise) that holds a point, None outside."""
    at = triangulation.points_um
    for a, b, c in triangulation.triangles:
        if all(is_left(at[p], at[q], point_um) for p, q in ((a, b), (b, c), (c, a))):
            return a, b, c
    return None


def is_left(a: Point, b: Point, p: Point) -> bool:
    """Tell whether p, shifted by (e, e²), lies to the left of a to b."""
    area = orientation(a, b, p) or a[1] - b[1] or b[0] - a[0]
    return area > 0


def _leaves_left(p: Point, q: Point, corner: Point) -> bool:
    """Tell whether a corner lies to the left of the step p to q when that is shifted."""
    area = orientation(p, q, corner) or q[1] - p[1] or p[0] - q[0]
    return area > 0


def _step(
    triangulation: Triangulation,
    triangle: Cell | None,
    points: list[Point],
    i: int,
    cells: list[Cell | None],
    crossings: list[Crossing],
) -> Cell | None:
    """Follow one step; append what it crosses; return the triangle it ends in."""
    p, q = points[i], points[i + 1]
    if p == q:
        return triangle
    at, beside = triangulation.points_um, triangulation.beside
    while True:
        if triangle is None:
            edge = _way_in(triangulation, p, q)
        else:
            a, b, c = triangle
            edge = next(
                (
                    (u, v)
                    for u, v in ((a, b), (b, c), (c, a))
                    if not is_left(at[u], at[v], q)
                    and not _leaves_left(p, q, at[u])
                    and _leaves_left(p, q, at[v])
                ),
                None,
            )
        if edge is None:
            return triangle
        u, v = edge if triangle is None else (edge[1], edge[0])
        opposite = beside.get((u, v))
        after = None if opposite is None else (u, v, opposite)
        crossings.append(_crossing(at, edge, p, q, i, triangle, after))
        cells.append(None if after is None else as_cell(after))
        left_crowd = after is None
        triangle = after
        if left_crowd:  # the crowd's hull is convex: this step does not come back
            return None


def _way_in(triangulation: Triangulation, p: Point, q: Point) -> Edge | None:
    at = triangulation.points_um
    for a, b in triangulation.hull:
        if (
            not is_left(at[a], at[b], p)
            and is_left(at[a], at[b], q)
            and _leaves_left(p, q, at[a])
            and not _leaves_left(p, q, at[b])
        ):
            return a, b
    return None


def _crossing(
    at: tuple[Point, ...],
    edge: Edge,
    p: Point,
    q: Point,
    i: int,
    before: Cell | None,
    after: Cell | None,
) -> Crossing:
    from_p = orientation(at[edge[0]], at[edge[1]], p)
    from_q = orientation(at[edge[0]], at[edge[1]], q)
    # a step along the edge itself crosses it only by the shift: at its beginning
    share = from_p / (from_p - from_q) if from_p != from_q else 0.0
    share = min(max(share, 0.0), 1.0)
    dx, dy = q[0] - p[0], q[1] - p[1]
    length = float(np.hypot(dx, dy))
    return Crossing(
        edge=(min(edge), max(edge)),
        at_m=((p[0] + share * dx) / MICROMETRES, (p[1] + share * dy) / MICROMETRES),
        s=i + share,
        heading=(dx / length, dy / length),
        before=None if before is None else as_cell(before),
        after=None if after is None else as_cell(after),
    )


def folded_angle_deg(axis: npt.ArrayLike, other: npt.ArrayLike) -> Vector:
    """Return the angle between lines (..., 2), folded to 0..90°; NaN where one has no length."""
    a, b = np.asarray(axis, float), np.asarray(other, float)
    cross = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    along = np.abs((a * b).sum(axis=-1))
    angle = np.degrees(np.arctan2(cross, along))
    return np.where((cross == 0) & (along == 0), np.nan, angle)


def gap_angles_deg(
    triangulation: Triangulation, crossings: tuple[Crossing, ...], shoulder_axes: npt.ArrayLike
) -> tuple[Vector, Vector]:
    """Return (n,) the angle of the shoulders to each gap, and to the walking direction.

    `shoulder_axes` is (n, 2), one per crossing, or (2,) for all. The published angle is the first:
    0° shoulders along the gap, 90° turned through it. It mixes turning with passing obliquely; the
    second (0° shoulders along the way walked) does not.
    """
    n = len(crossings)
    axes = np.broadcast_to(np.asarray(shoulder_axes, float), (n, 2))
    points = triangulation.positions_m
    gaps = np.array([points[c.edge[1]] - points[c.edge[0]] for c in crossings]).reshape(n, 2)
    headings = np.array([c.heading for c in crossings]).reshape(n, 2)
    return folded_angle_deg(axes, gaps), folded_angle_deg(axes, headings)
