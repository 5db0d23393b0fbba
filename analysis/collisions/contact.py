"""Find where two surfaces cross: the box around their crossing curves."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import Crossings
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_CELL_M = 0.02
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
    cells = grid.shape[0] * grid.shape[1]
    boxes, spans = _boxes(vertices_b, faces_b, near_b, low_m, high_m, grid)
    mine, reach = _boxes(vertices_a, faces_a, near_a, low_m, high_m, grid)
    floor, ceiling = np.full(cells, -np.inf), np.full(cells, np.inf)
    _narrow(boxes, spans, grid, floor, ceiling)
    _narrow(mine, reach, grid, floor, ceiling)
    # Faces of b by cell, their boxes one after the other.
    begin = np.zeros(cells + 1, np.int32)
    for j in range(near_b.shape[0]):
        for x in range(spans[j, 0], spans[j, 2]):
            for y in range(spans[j, 1], spans[j, 3]):
                cell = x * grid.shape[1] + y
                begin[cell + 1] += boxes[j, 2] <= ceiling[cell] and boxes[j, 5] >= floor[cell]
    most = 0
    for cell in range(cells):
        most = max(most, begin[cell + 1])
        begin[cell + 1] += begin[cell]
    box = np.empty((2, 3))
    box[0], box[1] = np.inf, -np.inf
    n_meetings = 0
    if most == 0:
        return 0, box
    owner, theirs = np.empty(begin[cells], np.int32), np.empty((begin[cells], 6))
    after = begin[:cells].copy()
    for j in range(near_b.shape[0]):
        for x in range(spans[j, 0], spans[j, 2]):
            for y in range(spans[j, 1], spans[j, 3]):
                cell = x * grid.shape[1] + y
                if boxes[j, 2] <= ceiling[cell] and boxes[j, 5] >= floor[cell]:
                    owner[after[cell]] = j
                    theirs[after[cell]] = boxes[j]
                    after[cell] += 1
    hits = np.empty(most + 1, np.int32)
    for i in range(near_a.shape[0]):
        for x in range(reach[i, 0], reach[i, 2]):
            for y in range(reach[i, 1], reach[i, 3]):
                cell = x * grid.shape[1] + y
                if mine[i, 2] > ceiling[cell] or mine[i, 5] < floor[cell]:
                    continue
                n_hits = boxes_meeting(mine[i], theirs[begin[cell] : begin[cell + 1]], hits)
                for hit in hits[:n_hits]:
                    j = owner[begin[cell] + hit]
                    # a pair that shares several cells is looked at in the first alone
                    if x != max(reach[i, 0], spans[j, 0]) or y != max(reach[i, 1], spans[j, 1]):
                        continue
                    # nor one that could not widen the box
                    inside = True
                    for k in range(3):
                        low = max(mine[i, k], boxes[j, k]) - _ROUNDING_M
                        high = min(mine[i, k + 3], boxes[j, k + 3]) + _ROUNDING_M
                        inside &= (low >= box[0, grid.axes[k]]) & (high <= box[1, grid.axes[k]])
                    if inside:
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
def _narrow(boxes: Vector, spans: Crossings, grid: _Grid, floor: Vector, ceiling: Vector) -> None:
    """Raise floors to the lowest face over each cell, and lower ceilings to the highest."""
    lowest, highest = np.full(floor.size, np.inf), np.full(floor.size, -np.inf)
    for j in range(spans.shape[0]):
        for x in range(spans[j, 0], spans[j, 2]):
            for y in range(spans[j, 1], spans[j, 3]):
                cell = x * grid.shape[1] + y
                lowest[cell] = min(lowest[cell], boxes[j, 2])
                highest[cell] = max(highest[cell], boxes[j, 5])
    for k in range(floor.size):
        floor[k], ceiling[k] = max(floor[k], lowest[k]), min(ceiling[k], highest[k])


@compiled
def _boxes(
    vertices_m: Vector,
    faces: Faces,
    near: Crossings,
    low_m: Vector,
    high_m: Vector,
    grid: _Grid,
) -> tuple[Vector, Crossings]:
    """Return each face's box (k, 6), its sides in the order of the grid's axes, and the first cell
    and the one after the last (k, 4) that it lies over.
    """
    boxes = np.empty((near.shape[0], 6))
    spans = np.zeros((near.shape[0], 4), np.int32)
    for i in range(near.shape[0]):
        f = np.uint32(near[i])
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        apart = False
        for k in range(3):
            axis = grid.axes[k]
            p, q, r = vertices_m[a, axis], vertices_m[b, axis], vertices_m[c, axis]
            least, most = min(p, q, r), max(p, q, r)
            boxes[i, k], boxes[i, k + 3] = least, most
            apart |= most < low_m[axis] or least > high_m[axis]
        if apart:
            continue  # it lies over no cell
        for k in range(2):
            last = grid.shape[k] - 1.0
            spans[i, k] = int(min(max((boxes[i, k] - grid.low_m[k]) * grid.per_m[k], 0.0), last))
            end = (boxes[i, k + 3] - grid.low_m[k]) * grid.per_m[k]
            spans[i, k + 2] = int(min(max(end, 0.0), last)) + 1
    return boxes, spans


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
