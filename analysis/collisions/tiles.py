"""Divide a lattice of columns into tiles, and find which faces can matter in which.

In a tile each body lies between two heights. Where these stretches do not meet, the bodies share
nothing, and faces above them need not be looked at.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Crossings = npt.NDArray[np.int32]

TILE = 2
"""A tile is 2 ** TILE columns wide."""
MARGIN = 1 << TILE


class Lattice(NamedTuple):
    """Columns along an axis (w); u and v are the two other axes in cyclic order.

    Column (i, j) stands at the middle of cell (i, j), counted from `low_m`.
    """

    axis: int
    low_m: Vector
    """(3,) the lowest corner of the cells."""
    step_m: Vector
    """(3,) the sides of a cell; that along the axis is not used."""
    n_u: int
    n_v: int


@compiled
def to_lattice(
    vertices_m: Vector,
    lattice: Lattice,
    low_w: Vector,
    high_w: Vector,
) -> tuple[Vector, npt.NDArray[np.int16]]:
    """Return (n, 3) places (u and v in columns, w in metres) and (n, 2) the first column at them.

    `low_w`, `high_w` (tiles) are filled with how deep and how high vertices lie near each tile; a
    tile is a square of columns, with a border of one tile round the lattice.
    """
    axis, n_u, n_v = lattice.axis, lattice.n_u, lattice.n_v
    low_m, step_m = lattice.low_m, lattice.step_m
    n = vertices_m.shape[0]
    place = np.empty((n, 3))
    first = np.empty((n, 2), np.int16)
    iu, iv = (axis + 1) % 3, (axis + 2) % 3
    low_u, low_v = low_m[iu], low_m[iv]
    per_u, per_v = 1.0 / step_m[iu], 1.0 / step_m[iv]
    least = -float(MARGIN)
    most_u, most_v = float(n_u + MARGIN), float(n_v + MARGIN)
    across = tiles_across(n_u)
    for k in range(n):
        u = (vertices_m[k, iu] - low_u) * per_u - 0.5
        v = (vertices_m[k, iv] - low_v) * per_v - 0.5
        w = vertices_m[k, axis]
        # Columns stand at integers; the first one at or after a place is its ceiling.
        place[k, 0] = u
        place[k, 1] = v
        place[k, 2] = w
        first[k, 0] = np.int16(np.ceil(min(max(u, least), most_u)))
        first[k, 1] = np.int16(np.ceil(min(max(v, least), most_v)))
        # Heights count within the border alone: faces further out meet no column.
        if least < u < most_u and least < v < most_v:
            tile = np.uint32(tile_of(first[k, 0], first[k, 1], across))
            low_w[tile] = min(low_w[tile], w)
            high_w[tile] = max(high_w[tile], w)
    return place, first


@compiled
def tiles_across(n: int) -> int:
    """Return the number of tiles that cover n columns and the borders."""
    return ((n + 2 * MARGIN) >> TILE) + 1


@compiled
def tile_of(column: int, row: int, across: int) -> int:
    """Return the tile of a column, counted with the border."""
    return ((row + MARGIN) >> TILE) * across + ((column + MARGIN) >> TILE)


@compiled
def spread(heights: Vector, across: int, sign: float) -> Vector:
    """Return for each tile the largest of sign * height of it and its neighbours, times sign."""
    # A maximum over 3 × 3 tiles is separable: along u first, then along v.
    down = heights.size // across
    spread_u = np.empty(heights.size)
    for v in range(down):
        for u in range(across):
            best = -np.inf
            for x in range(max(u - 1, 0), min(u + 2, across)):
                best = max(best, sign * heights[v * across + x])
            spread_u[v * across + u] = best
    result = np.empty(heights.size)
    for v in range(down):
        for u in range(across):
            best = -np.inf
            for y in range(max(v - 1, 0), min(v + 2, down)):
                best = max(best, spread_u[y * across + u])
            result[v * across + u] = sign * best
    return result


@compiled
def reach(
    place: Vector,
    first: npt.NDArray[np.int16],
    faces: Faces,
    n_u: int,
    n_v: int,
    low_w: Vector,
    high_w: Vector,
) -> Crossings:
    """Return the faces that may meet a column; make tiles under long faces as deep as these.

    A face no longer than a tile lies within the tiles next to each of its corners; longer ones
    are entered here, after heights were spread to neighbours.
    """
    candidates = np.empty(faces.shape[0] + 1, np.int32)
    across = tiles_across(n_u)
    n = 0
    for f in range(faces.shape[0]):
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        ra, rb, rc = first[a, 1], first[b, 1], first[c, 1]
        ca, cb, cc = first[a, 0], first[b, 0], first[c, 0]
        row, past_row = min(ra, rb, rc), max(ra, rb, rc)
        begin, end = min(ca, cb, cc), max(ca, cb, cc)
        near = (past_row >= 0) & (row <= n_v) & (end >= 0) & (begin <= n_u)
        hit = near & (row < past_row) & (begin < end)
        # Written always, counted only if the face lies between columns: no branch to mispredict.
        candidates[n] = f
        n += hit
        # Longer than a tile: enter its heights in every tile that its box covers.
        if near and (past_row - row >= MARGIN or end - begin >= MARGIN):
            low = min(place[a, 2], place[b, 2], place[c, 2])
            high = max(place[a, 2], place[b, 2], place[c, 2])
            first_u = (max(begin, 0) + MARGIN) >> TILE
            past_u = ((min(end, n_u) + MARGIN) >> TILE) + 1
            first_v = (max(row, 0) + MARGIN) >> TILE
            past_v = ((min(past_row, n_v) + MARGIN) >> TILE) + 1
            for v in range(first_v, past_v):
                for tile in range(v * across + first_u, v * across + past_u):
                    low_w[tile] = min(low_w[tile], low)
                    high_w[tile] = max(high_w[tile], high)
    return candidates[:n]
