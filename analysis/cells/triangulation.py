"""Triangulate crowd positions after Delaunay, exactly, in whole micrometres.

Positions are rounded to whole micrometres once. Every test on them is then exact: orientations
fit 64 bits, circle tests use Python's integers.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.analysis.cells.errors import AllInLine, Cocircular, MalformedPositions, SamePlace
from visavis.lab.geometry import Vector

Cell: TypeAlias = tuple[int, int, int]
"""Three characters (indices, rising)."""
Edge: TypeAlias = tuple[int, int]
Point: TypeAlias = tuple[int, int]

MICROMETRES = 1_000_000
FARTHEST_M = 1000.0
JITTER_UM = 50


@dataclass(frozen=True)
class Triangulation:
    """Cells between people of a crowd.

    `positions_m` (n, 2) are as given, `points_um` in whole micrometres; `triangles` lists corners
    counter-clockwise; `beside` gives, for a directed edge, the corner opposite in the triangle to
    its left, so an edge that is missing has the outside to its left. `jitter_um` is the largest
    shift that was needed to make the triangulation unique, 0 if none.
    """

    positions_m: Vector
    points_um: tuple[Point, ...]
    triangles: tuple[Cell, ...]
    beside: dict[Edge, int]
    jitter_um: int = 0

    @property
    def cells(self) -> tuple[Cell, ...]:
        """All cells as rising triples, in order."""
        return tuple(sorted(as_cell(t) for t in self.triangles))

    @cached_property
    def hull(self) -> tuple[Edge, ...]:
        """All edges with the outside to their right."""
        return tuple((a, b) for a, b in self.beside if (b, a) not in self.beside)


def as_cell(triangle: Cell) -> Cell:
    """Return a triangle's corners in rising order."""
    a, b, c = sorted(triangle)
    return a, b, c


def to_micrometres(points_m: npt.ArrayLike, what: str) -> npt.NDArray[np.int64]:
    """Round (n, 2) metres to whole micrometres. Raises MalformedPositions naming the row."""
    points = np.asarray(points_m, float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise MalformedPositions(f"{what} have shape {points.shape}; give (n, 2) in metres")
    bad = ~(np.abs(points) < FARTHEST_M).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise MalformedPositions(
            f"{what}, row {row}: {points[row].tolist()} is no place within a kilometre; "
            "leave out who was not tracked"
        )
    whole: npt.NDArray[np.int64] = np.rint(points * MICROMETRES).astype(np.int64)
    return whole


def orientation(a: Point, b: Point, p: Point) -> int:
    """Return twice the area of a, b, p: positive where p is to the left of a to b."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def triangulate(
    positions_m: npt.ArrayLike,
    *,
    cocircular: Literal["refuse", "jitter"] = "refuse",
    rng: np.random.Generator | None = None,
) -> Triangulation:
    """Return the Delaunay triangulation of (n, 2) positions in metres.

    With `cocircular="jitter"` positions that leave a choice are moved by up to 50 µm, drawn from
    `rng`, until there is none. Raises MalformedPositions, SamePlace, AllInLine or Cocircular.
    """
    points = to_micrometres(positions_m, "positions")
    if len(points) < 3:
        raise AllInLine(f"{len(points)} people make no triangle; give at least three")
    _, first, count = np.unique(points, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        place = points[first[np.argmax(count > 1)]]
        who = np.flatnonzero((points == place).all(axis=1)).tolist()
        raise SamePlace(f"characters {who} stand at the same place; move one of them")
    if cocircular == "jitter" and rng is None:
        raise Cocircular("jitter needs a random generator (rng), so that it can be repeated")
    jittered_points = points
    while True:
        point_list = [(int(x), int(y)) for x, y in jittered_points]
        try:
            triangles = _delaunay(point_list)
        except Cocircular:
            if cocircular == "refuse" or rng is None:
                raise
            jittered_points = points + rng.integers(-JITTER_UM, JITTER_UM + 1, points.shape)
            continue
        beside = {}
        for a, b, c in triangles:
            beside[a, b], beside[b, c], beside[c, a] = c, a, b
        shift = int(np.abs(jittered_points - points).max())
        return Triangulation(
            np.array(positions_m, float), tuple(point_list), tuple(triangles), beside, shift
        )


def _delaunay(points: list[Point]) -> list[Cell]:
    beside = _sweep(points)
    waiting = [edge for edge in beside if edge[0] < edge[1] and (edge[1], edge[0]) in beside]
    while waiting:
        a, b = waiting.pop()
        if (a, b) not in beside or (b, a) not in beside:
            continue
        c, d = beside[a, b], beside[b, a]
        if in_circle(points[a], points[b], points[c], points[d]) <= 0:
            continue
        for edge in ((a, b), (b, c), (c, a), (b, a), (a, d), (d, b)):
            del beside[edge]
        for p, q, r in ((c, a, d), (d, b, c)):
            beside[p, q], beside[q, r], beside[r, p] = r, p, q
        waiting += [(a, d), (d, b), (b, c), (c, a)]
    for (a, b), c in beside.items():
        if a > b or (b, a) not in beside:
            continue
        d = beside[b, a]
        if in_circle(points[a], points[b], points[c], points[d]) == 0:
            raise Cocircular(
                f"characters {sorted((a, b, c, d))} stand on one circle, so the cells are not "
                'unique; move one, or ask for cocircular="jitter"'
            )
    return sorted((a, b, c) for (a, b), c in beside.items() if a < b and a < c)


def _sweep(points: list[Point]) -> dict[Edge, int]:
    """Triangulate from left to right, joining each point to the hull edges it sees."""
    order = sorted(range(len(points)), key=points.__getitem__)
    line = 2
    while line < len(order) and orientation(*(points[order[i]] for i in (0, 1, line))) == 0:
        line += 1
    if line == len(order):
        raise AllInLine("all people stand on one line; there is no cell between them")
    beside: dict[Edge, int] = {}
    hull = order[:line]
    apex = order[line]
    if orientation(points[hull[0]], points[hull[1]], points[apex]) < 0:
        hull = hull[::-1]
    for a, b in pairwise(hull):
        beside[a, b], beside[b, apex], beside[apex, a] = apex, a, b
    hull = [*hull, apex]
    for p in order[line + 1 :]:
        n = len(hull)
        sees = [
            orientation(points[hull[i]], points[hull[(i + 1) % n]], points[p]) < 0 for i in range(n)
        ]
        start = next(i for i in range(n) if sees[i] and not sees[i - 1])
        hull = hull[start:] + hull[:start]
        length = sum(sees)
        for a, b in zip(hull[:length], [*hull[1 : length + 1], hull[0]], strict=False):
            beside[b, a], beside[a, p], beside[p, b] = p, b, a
        hull = [hull[0], p, *hull[length:]]
    return beside


def in_circle(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return a number that is positive where d is inside the circle through a, b, c (left turn)."""
    ax, ay, bx, by = a[0] - d[0], a[1] - d[1], b[0] - d[0], b[1] - d[1]
    cx, cy = c[0] - d[0], c[1] - d[1]
    return (
        (ax * ax + ay * ay) * (bx * cy - by * cx)
        - (bx * bx + by * by) * (ax * cy - ay * cx)
        + (cx * cx + cy * cy) * (ax * by - ay * bx)
    )
