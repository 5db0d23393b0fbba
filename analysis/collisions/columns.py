"""Intersect two surfaces along columns: exact along the column, midpoint rule across."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.spans import CrossingBuffers, Surface, cast
from visavis.analysis.collisions.tiles import (
    MARGIN,
    TILE,
    Crossings,
    Lattice,
    reach,
    spread,
    tile_of,
    tiles_across,
    to_lattice,
)
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector


@compiled
def bounds(vertices_m: Vector) -> Vector:
    """Return (2, 3): the lowest and highest coordinates."""
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for i in range(vertices_m.shape[0]):
        x, y, z = vertices_m[i, 0], vertices_m[i, 1], vertices_m[i, 2]
        x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
        x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    return np.array([[x0, y0, z0], [x1, y1, z1]])


@compiled
def sides_of(vertices_m: Vector, low_m: Vector, high_m: Vector) -> npt.NDArray[np.uint8]:
    """Return (n,) on which sides of a box each vertex lies: bit 2k below, bit 2k + 1 above."""
    n = vertices_m.shape[0]
    sides = np.empty(n, np.uint8)
    x0, y0, z0 = low_m[0], low_m[1], low_m[2]
    x1, y1, z1 = high_m[0], high_m[1], high_m[2]
    for i in range(n):
        x, y, z = vertices_m[i, 0], vertices_m[i, 1], vertices_m[i, 2]
        # Outcodes (Cohen-Sutherland): faces whose corners share a bit lie beyond that side.
        code = np.int32(1) if x < x0 else np.int32(0)
        code |= np.int32(2) if x > x1 else np.int32(0)
        code |= np.int32(4) if y < y0 else np.int32(0)
        code |= np.int32(8) if y > y1 else np.int32(0)
        code |= np.int32(16) if z < z0 else np.int32(0)
        code |= np.int32(32) if z > z1 else np.int32(0)
        sides[i] = code
    return sides


@compiled
def faces_near(faces: Faces, sides: npt.NDArray[np.uint8]) -> Crossings:
    """Return the faces whose corners do not all lie beyond one side of the box."""
    near = np.empty(faces.shape[0] + 1, np.int32)
    k = 0
    for f in range(faces.shape[0]):
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        near[k] = f
        k += (sides[a] & sides[b] & sides[c]) == 0
    return near[:k]


@compiled
def sweep(
    order: npt.NDArray[np.int32],
    start: int,
    end: int,
    height: Vector,
    change: npt.NDArray[np.int8],
    winding_a: int,
    winding_b: int,
    low_w: float,
    high_w: float,
    intervals: Vector,
) -> int:
    """Fill `intervals` (k, 2) with the stretches inside both bodies; return how many.

    `order[start:end]` are the column's crossings in any order; they are sorted here.
    """
    # Insertion sort by height: a column has a handful of crossings, so nothing else is faster.
    for i in range(start + 1, end):
        one = order[i]
        w = height[one]
        j = i - 1
        while j >= start and height[order[j]] > w:
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = one
    # Walk upwards and count how often each surface winds round: `change` is ±1 for a, ±2 for b.
    n = 0
    begin = low_w
    inside = winding_a > 0 and winding_b > 0
    for i in range(start, end):
        w, step = height[order[i]], change[order[i]]
        if step == 1 or step == -1:
            winding_a += step
        else:
            winding_b += step // 2
        now = winding_a > 0 and winding_b > 0
        if now and not inside:
            begin = w
        elif inside and not now and w > begin:
            intervals[n, 0], intervals[n, 1] = begin, w
            n += 1
        inside = now
    if inside and high_w > begin:
        intervals[n, 0], intervals[n, 1] = begin, high_w
        n += 1
    return n


@compiled
def columns_in_both(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    lattice: Lattice,
    low_w: float,
    high_w: float,
    room: int,
) -> tuple[npt.NDArray[np.int32], Vector, Vector]:
    """Return columns (k,) and stretches (k, 2) inside both bodies, and a box.

    Only what lies between `low_w` and `high_w` along the columns counts.
    The box (2, 3) as (u, v in columns, w) holds all that the bodies can share, surfaces that cross
    between columns included; it is inverted when they can share nothing.
    Column number is row * n_u + i. When there are more crossings than `room`, the buffers grow and
    everything is cast again.
    """
    # 1. Heights of both bodies by tile, spread to the neighbours that a face may reach into.
    n_u, n_v = lattice.n_u, lattice.n_v
    cells = n_u * n_v
    across = tiles_across(n_u)
    tiles = across * tiles_across(n_v)
    low_a, low_b = np.full(tiles, np.inf), np.full(tiles, np.inf)
    high_a, high_b = np.full(tiles, -np.inf), np.full(tiles, -np.inf)
    place_a, first_a = to_lattice(vertices_a, lattice, low_a, high_a)
    place_b, first_b = to_lattice(vertices_b, lattice, low_b, high_b)
    low_a, high_a = spread(low_a, across, -1.0), spread(high_a, across, 1.0)
    low_b, high_b = spread(low_b, across, -1.0), spread(high_b, across, 1.0)
    candidates_a = reach(place_a, first_a, faces_a, n_u, n_v, low_a, high_a)
    candidates_b = reach(place_b, first_b, faces_b, n_u, n_v, low_b, high_b)
    live = np.empty((2, 3))
    live[0], live[1] = np.inf, -np.inf
    # 2. `live` is the box of all tiles in which the heights of both bodies overlap.
    for k in range(tiles):  # both bodies can only be between these heights
        low_a[k] = max(low_a[k], low_b[k], low_w)
        high_a[k] = min(high_a[k], high_b[k], high_w)
        if not low_a[k] < high_a[k]:
            high_a[k] = -np.inf
            continue
        u, v = (k % across << TILE) - MARGIN, (k // across << TILE) - MARGIN
        live[0, 0], live[1, 0] = min(live[0, 0], u - 1.0), max(live[1, 0], u + MARGIN + 0.0)
        live[0, 1], live[1, 1] = min(live[0, 1], v - 1.0), max(live[1, 1], v + MARGIN + 0.0)
        live[0, 2], live[1, 2] = min(live[0, 2], low_a[k]), max(live[1, 2], high_a[k])
    if not live[0, 0] < live[1, 0]:
        return np.empty(0, np.int32), np.empty((0, 2)), live
    surface_a = Surface(place_a, first_a, faces_a, candidates_a)
    surface_b = Surface(place_b, first_b, faces_b, candidates_b)
    # 3. Cast both surfaces. `n` counts on when the buffers are full, so that a second round, if one
    # is needed, has exactly the room.
    while True:
        below_a = np.zeros(cells, np.int32)
        below_b = np.zeros(cells, np.int32)
        count = np.zeros(cells, np.int32)
        column = np.empty(room, np.int32)
        height = np.empty(room)
        change = np.empty(room, np.int8)
        buffers = CrossingBuffers(column, height, change, count)
        n = cast(surface_a, n_u, n_v, low_a, high_a, below_a, buffers, 0, 0)
        n = cast(surface_b, n_u, n_v, low_a, high_a, below_b, buffers, n, 1)
        if n <= room:
            break
        room = n
    # 4. Counting sort of the crossings by column.
    begin = np.empty(cells + 1, np.int32)
    total = 0
    longest = 0
    for k in range(cells):
        begin[k] = total
        total += count[k]
        longest = max(longest, count[k])
    begin[cells] = total
    order = np.empty(total, np.int32)
    next_place = begin[:cells].copy()
    for i in range(n):
        at = np.uint32(column[i])
        order[next_place[at]] = i
        next_place[at] += 1
    intervals = np.empty((longest + 1, 2))
    columns = np.empty(total + cells, np.int32)
    stretches = np.empty((total + cells, 2))
    n_stretches = 0
    # 5. Sweep every column that a crossing touches, or that lies inside both bodies throughout.
    for k in range(cells):
        if count[k] == 0 and (below_a[k] <= 0 or below_b[k] <= 0):
            continue
        tile = tile_of(k % n_u, k // n_u, across)
        m = sweep(
            order,
            begin[k],
            begin[k + 1],
            height,
            change,
            below_a[k],
            below_b[k],
            low_a[tile],
            high_a[tile],
            intervals,
        )
        for i in range(m):
            columns[n_stretches] = k
            stretches[n_stretches, 0], stretches[n_stretches, 1] = intervals[i, 0], intervals[i, 1]
            n_stretches += 1
    return columns[:n_stretches], stretches[:n_stretches], live
