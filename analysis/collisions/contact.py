"""Find where two surfaces cross: the box around their crossing curves."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import Crossings
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_CELL_M = 0.03
_MAX_CELLS = 96
_SLACK = 1e-12
_ROUNDING_M = 1e-9
"""Two faces meet in what their boxes share, but for rounding."""


class _Grid(NamedTuple):
    """Square cells over the two longer sides of a box; `axes` (3,) ends with the shortest."""

    axes: npt.NDArray[np.int64]
    low_m: Vector
    per_m: Vector
    """(2,) cells in a metre."""
    shape: npt.NDArray[np.int64]


@compiled
def crossing_box(
    vertices_a: Vector,
    faces_a: Faces,
    near_a: Crossings,
    vertices_b: Vector,
    faces_b: Faces,
    near_b: Crossings,
    low_m: Vector,
    high_m: Vector,
) -> tuple[int, Vector]:
    """Return how often an edge of one surface meets a face of the other, and the box (2, 3).

    Only faces that reach into the box `low_m`..`high_m` are looked at. Zero meetings mean that
    the surfaces are apart or one encloses the other.
    """
    # Over each cell of a grid both surfaces lie between two heights. Only faces between the higher
    # floor and the lower ceiling can cross, and those of the same cell alone are compared.
    grid = _grid_over(low_m, high_m)
    across = grid.shape[1]
    cells = grid.shape[0] * across
    axis_u, axis_v, axis_w = grid.axes[0], grid.axes[1], grid.axes[2]
    floor, ceiling = np.full(cells, -np.inf), np.full(cells, np.inf)
    near_b, boxes, spans = _boxes(vertices_b, faces_b, near_b, low_m, high_m, grid, floor, ceiling)
    near_a, mine, reach = _boxes(vertices_a, faces_a, near_a, low_m, high_m, grid, floor, ceiling)
    # Faces of b by cell, their boxes one after the other.
    begin = np.zeros(cells + 1, np.int32)
    for j in range(near_b.shape[0]):
        least, most = boxes[j, 2], boxes[j, 5]
        for x in range(spans[j, 0], spans[j, 2]):
            for cell in range(x * across + spans[j, 1], x * across + spans[j, 3]):
                begin[cell + 1] += (least <= ceiling[cell]) & (most >= floor[cell])
    longest = 0
    for cell in range(cells):
        longest = max(longest, begin[cell + 1])
        begin[cell + 1] += begin[cell]
    box = np.empty((2, 3))
    box[0], box[1] = np.inf, -np.inf
    n_meetings = 0
    if longest == 0:
        return 0, box
    owner, theirs = np.empty(begin[cells], np.int32), np.empty((begin[cells], 6))
    after = begin[:cells].copy()
    for j in range(near_b.shape[0]):
        least, most = boxes[j, 2], boxes[j, 5]
        for x in range(spans[j, 0], spans[j, 2]):
            for cell in range(x * across + spans[j, 1], x * across + spans[j, 3]):
                if least <= ceiling[cell] and most >= floor[cell]:
                    at = np.uint32(after[cell])
                    after[cell] += 1
                    owner[at] = j
                    for k in range(6):
                        theirs[at, k] = boxes[j, k]
    hits = np.empty(longest + 1, np.int32)
    for i in range(near_a.shape[0]):
        u0, v0, w0, u1, v1, w1 = (
            mine[i, 0],
            mine[i, 1],
            mine[i, 2],
            mine[i, 3],
            mine[i, 4],
            mine[i, 5],
        )
        for x in range(reach[i, 0], reach[i, 2]):
            for y in range(reach[i, 1], reach[i, 3]):
                cell = x * across + y
                if w0 > ceiling[cell] or w1 < floor[cell]:
                    continue
                n_hits = 0
                for m in range(np.uint32(begin[cell]), np.uint32(begin[cell + 1])):
                    hits[n_hits] = m
                    # no branch: which boxes meet is hard to foresee
                    n_hits += (
                        (theirs[m, 5] >= w0)
                        & (theirs[m, 2] <= w1)
                        & (theirs[m, 3] >= u0)
                        & (theirs[m, 0] <= u1)
                        & (theirs[m, 4] >= v0)
                        & (theirs[m, 1] <= v1)
                    )
                for hit in range(n_hits):
                    entry = np.uint32(hits[hit])
                    j = int(owner[entry])
                    # a pair that shares several cells is looked at in the first alone
                    if x != max(reach[i, 0], spans[j, 0]) or y != max(reach[i, 1], spans[j, 1]):
                        continue
                    # nor one that could not widen the box
                    if (
                        (max(u0, theirs[entry, 0]) - _ROUNDING_M >= box[0, axis_u])
                        & (max(v0, theirs[entry, 1]) - _ROUNDING_M >= box[0, axis_v])
                        & (max(w0, theirs[entry, 2]) - _ROUNDING_M >= box[0, axis_w])
                        & (min(u1, theirs[entry, 3]) + _ROUNDING_M <= box[1, axis_u])
                        & (min(v1, theirs[entry, 4]) + _ROUNDING_M <= box[1, axis_v])
                        & (min(w1, theirs[entry, 5]) + _ROUNDING_M <= box[1, axis_w])
                    ):
                        continue
                    f, g = near_a[i], near_b[j]
                    # Most pairs end here: one triangle lies on one side of the other's plane.
                    if _is_beyond(vertices_a, faces_a, f, vertices_b, faces_b, g):
                        continue
                    if _is_beyond(vertices_b, faces_b, g, vertices_a, faces_a, f):
                        continue
                    n_meetings += edges_through(vertices_a, faces_a, f, vertices_b, faces_b, g, box)
                    n_meetings += edges_through(vertices_b, faces_b, g, vertices_a, faces_a, f, box)
    return n_meetings, box


@compiled
def boxes_meeting(box: Vector, boxes: Vector, hits: Crossings) -> int:
    """Write which of some boxes (n, 6) meet a box (6,), touching included; return how many.

    `hits` has room for one more than there are.
    """
    x0, y0, z0, x1, y1, z1 = box[0], box[1], box[2], box[3], box[4], box[5]
    n = 0
    for k in range(boxes.shape[0]):
        hits[n] = k
        # no branch: which boxes meet is hard to foresee
        n += (
            (boxes[k, 5] >= z0)
            & (boxes[k, 2] <= z1)
            & (boxes[k, 3] >= x0)
            & (boxes[k, 0] <= x1)
            & (boxes[k, 4] >= y0)
            & (boxes[k, 1] <= y1)
        )
    return n


@compiled
def _grid_over(low_m: Vector, high_m: Vector) -> _Grid:
    """Return the grid of cells over a box."""
    sides = high_m - low_m
    axes = np.argsort(-sides)
    low, per = np.empty(2), np.empty(2)
    shape = np.empty(2, np.int64)
    for k in range(2):
        side = max(sides[axes[k]], 1e-9)
        shape[k] = min(_MAX_CELLS, int(side / _CELL_M) + 1)
        low[k], per[k] = low_m[axes[k]], shape[k] / side
    return _Grid(axes, low, per, shape)


@compiled
def _boxes(
    vertices_m: Vector,
    faces: Faces,
    near: Crossings,
    low_m: Vector,
    high_m: Vector,
    grid: _Grid,
    floor: Vector,
    ceiling: Vector,
) -> tuple[Crossings, Vector, Crossings]:
    """Return those faces that lie over a cell, each one's box (k, 6), its sides in the order of the
    grid's axes, and the first cell and the one after the last (k, 4) that it lies over.

    Raises floors to the lowest face over each cell, and lowers ceilings to the highest.
    """
    over, boxes = np.empty(near.shape[0], np.int32), np.empty((near.shape[0], 6))
    spans = np.empty((near.shape[0], 4), np.int32)
    lowest, highest = np.full(floor.size, np.inf), np.full(floor.size, -np.inf)
    across = grid.shape[1]
    axes = np.uint32(grid.axes[0]), np.uint32(grid.axes[1]), np.uint32(grid.axes[2])
    n = 0
    for f in near:
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        apart = False
        for k in range(3):
            axis = axes[k]
            p, q, r = vertices_m[a, axis], vertices_m[b, axis], vertices_m[c, axis]
            least, most = min(p, q, r), max(p, q, r)
            boxes[n, k], boxes[n, k + 3] = least, most
            apart |= (most < low_m[axis]) | (least > high_m[axis])
        if apart:
            continue  # it lies over no cell
        for k in range(2):
            last = grid.shape[k] - 1.0
            spans[n, k] = int(min(max((boxes[n, k] - grid.low_m[k]) * grid.per_m[k], 0.0), last))
            end = (boxes[n, k + 3] - grid.low_m[k]) * grid.per_m[k]
            spans[n, k + 2] = int(min(max(end, 0.0), last)) + 1
        least, most = boxes[n, 2], boxes[n, 5]
        for x in range(spans[n, 0], spans[n, 2]):
            for cell in range(x * across + spans[n, 1], x * across + spans[n, 3]):
                lowest[cell] = min(lowest[cell], least)
                highest[cell] = max(highest[cell], most)
        over[n] = f
        n += 1
    for k in range(floor.size):
        floor[k], ceiling[k] = max(floor[k], lowest[k]), min(ceiling[k], highest[k])
    return over[:n], boxes[:n], spans[:n]


@compiled
def _is_beyond(
    vertices_a: Vector, faces_a: Faces, f: int, vertices_b: Vector, faces_b: Faces, g: int
) -> bool:
    """Tell whether face f lies on one side of the plane of face g, without touching it."""
    g0, g1, g2 = np.uint32(faces_b[g, 0]), np.uint32(faces_b[g, 1]), np.uint32(faces_b[g, 2])
    ox, oy, oz = vertices_b[g0, 0], vertices_b[g0, 1], vertices_b[g0, 2]
    px, py, pz = vertices_b[g1, 0] - ox, vertices_b[g1, 1] - oy, vertices_b[g1, 2] - oz
    qx, qy, qz = vertices_b[g2, 0] - ox, vertices_b[g2, 1] - oy, vertices_b[g2, 2] - oz
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    above, below = 0, 0
    for k in range(3):
        v = np.uint32(faces_a[f, k])
        side = (
            nx * (vertices_a[v, 0] - ox)
            + ny * (vertices_a[v, 1] - oy)
            + nz * (vertices_a[v, 2] - oz)
        )
        above += side > 0.0
        below += side < 0.0
    return above == 3 or below == 3


@compiled
def edges_through(
    vertices_a: Vector,
    faces_a: Faces,
    f: int,
    vertices_b: Vector,
    faces_b: Faces,
    g: int,
    box: Vector,
) -> int:
    """Count edges of face f that meet face g, touching included; widen `box` by the points."""
    # Coordinates from a corner of face g, which keeps digits far from the origin.
    g0, g1, g2 = faces_b[g, 0], faces_b[g, 1], faces_b[g, 2]
    ox, oy, oz = vertices_b[g0, 0], vertices_b[g0, 1], vertices_b[g0, 2]
    px, py, pz = vertices_b[g1, 0] - ox, vertices_b[g1, 1] - oy, vertices_b[g1, 2] - oz
    qx, qy, qz = vertices_b[g2, 0] - ox, vertices_b[g2, 1] - oy, vertices_b[g2, 2] - oz
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    area = nx * nx + ny * ny + nz * nz
    if area == 0.0:
        return 0
    n_meetings = 0
    for k in range(3):
        i, j = faces_a[f, k], faces_a[f, (k + 1) % 3]
        ax, ay, az = vertices_a[i, 0] - ox, vertices_a[i, 1] - oy, vertices_a[i, 2] - oz
        bx, by, bz = vertices_a[j, 0] - ox, vertices_a[j, 1] - oy, vertices_a[j, 2] - oz
        # Signed distances from the plane of g, times twice its area.
        da = nx * ax + ny * ay + nz * az
        db = nx * bx + ny * by + nz * bz
        if (da > 0.0 and db > 0.0) or (da < 0.0 and db < 0.0) or da == db:
            continue
        t = da / (da - db)
        x, y, z = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
        # Barycentric coordinates of the piercing point, times the squared normal.
        along_q = nx * (py * z - pz * y) + ny * (pz * x - px * z) + nz * (px * y - py * x)
        along_p = nx * (y * qz - z * qy) + ny * (z * qx - x * qz) + nz * (x * qy - y * qx)
        slack = _SLACK * area
        if along_q < -slack or along_p < -slack or along_q + along_p > area + slack:
            continue
        n_meetings += 1
        box[0, 0], box[1, 0] = min(box[0, 0], x + ox), max(box[1, 0], x + ox)
        box[0, 1], box[1, 1] = min(box[0, 1], y + oy), max(box[1, 1], y + oy)
        box[0, 2], box[1, 2] = min(box[0, 2], z + oz), max(box[1, 2], z + oz)
    return n_meetings
