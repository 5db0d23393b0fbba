"""Cut a surface by the columns of a lattice.

A triangle is scan-converted row by row of the lattice. Where an edge meets a row is computed
from its lower end, so both triangles at an edge find the same number bit for bit, and columns
belong half-open to what lies between two edges: every column crosses a closed surface in
balanced signs, also through vertices and along edges.

Three loops in place of one, each over the output of the one before: most of a row's cost is
branches that the processor mispredicts, and these loops have none.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import MARGIN, TILE, Crossings, tiles_across
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_BATCH = 4096


def _edges_across() -> npt.NDArray[np.uint8]:
    """Return (8, 4): by which corners lie at or below a row, lower and upper corner of the edge
    that goes up through it in the triangle's turn, and of the one that comes down.
    """
    ends = np.zeros((8, 4), np.uint8)
    for bits in range(1, 7):
        for k in range(3):
            after = (k + 1) % 3
            here, there = bits >> k & 1, bits >> after & 1
            if here and not there:
                ends[bits, :2] = k, after
            elif there and not here:
                ends[bits, 2:] = after, k
    return ends


_ENDS = _edges_across()


class Surface(NamedTuple):
    """A body's surface on a lattice of columns, and what of it may meet them."""

    place: Vector
    """(n, 3) u and v of each vertex in columns, w in metres."""
    first: npt.NDArray[np.int16]
    """(n, 2) the first column at or after each vertex, and the first row."""
    faces: Faces
    candidates: Crossings
    """Those faces that may meet a column."""


class CrossingBuffers(NamedTuple):
    """Where crossings of both bodies are stored; all have the same room but `per_column`."""

    column: Crossings
    height: Vector
    change: npt.NDArray[np.int8]
    """How the winding number changes upwards: ±1 for body 0, ±2 for body 1."""
    per_column: Crossings
    """(columns,) how many crossings each column has in the buffers."""


@compiled
def rows_of_faces(
    surface: Surface,
    start: int,
    n_u: int,
    n_v: int,
    high_w: Vector,
    face: Crossings,
    row: Crossings,
) -> tuple[int, int]:
    """Write faces and the rows they meet until the buffers are full; return how many, and the
    place in `candidates` to go on from.

    Faces above the heights that matter, `high_w`, in all tiles they cover are left out, but for
    faces longer than a tile. Buffers hold four rows more than there are.
    """
    place, first, faces = surface.place, surface.first, surface.faces
    candidates = surface.candidates
    across = tiles_across(n_u)
    room = face.shape[0] - 4
    n = 0
    for i in range(start, candidates.shape[0]):
        f = candidates[i]
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        ra, rb, rc = int(first[a, 1]), int(first[b, 1]), int(first[c, 1])
        ca, cb, cc = int(first[a, 0]), int(first[b, 0]), int(first[c, 0])
        low, past = max(min(ra, rb, rc), 0), min(max(ra, rb, rc), n_v)
        begin, end = max(min(ca, cb, cc), 0), min(max(ca, cb, cc), n_u)
        # No longer than a tile, it covers two by two of them at most.
        first_u, last_u = (begin + MARGIN) >> TILE, (end - 1 + MARGIN) >> TILE
        first_v, last_v = ((low + MARGIN) >> TILE) * across, ((past - 1 + MARGIN) >> TILE) * across
        highest = max(
            max(high_w[np.uint32(first_v + first_u)], high_w[np.uint32(first_v + last_u)]),
            max(high_w[np.uint32(last_v + first_u)], high_w[np.uint32(last_v + last_u)]),
        )
        is_above = min(place[a, 2], place[b, 2], place[c, 2]) >= highest
        is_short = (past - low <= MARGIN) & (end - begin <= MARGIN)
        k = (past - low) * (1 - int(is_above & is_short))
        if n + k > room:
            return n, i
        for j in range(4):  # most triangles meet no more rows; writing four always saves a branch
            face[n + j] = f
            row[n + j] = low + j
        for j in range(4, k):
            face[n + j] = f
            row[n + j] = low + j
        n += k
    return n, candidates.shape[0]


@compiled
def spans_of(
    surface: Surface,
    face: Crossings,
    row: Crossings,
    n: int,
    n_u: int,
    span: Faces,
    ends: Vector,
) -> int:
    """Write what each triangle covers of each row where that holds a column; return how many.

    `span` (k, 3) row, first column and the one after the last; `ends` (k, 4) u of the edge that
    goes up and of the one that comes down, and their w.
    """
    place, first, faces = surface.place, surface.first, surface.faces
    m = 0
    most_u = float(n_u)
    for k in range(n):
        f, r = np.uint32(face[k]), row[k]
        # One bit per corner at or below the row picks the two edges across it without a branch.
        lower = np.uint32(
            int(first[np.uint32(faces[f, 0]), 1] <= r)
            + 2 * int(first[np.uint32(faces[f, 1]), 1] <= r)
            + 4 * int(first[np.uint32(faces[f, 2]), 1] <= r)
        )
        a, b = np.uint32(faces[f, _ENDS[lower, 0]]), np.uint32(faces[f, _ENDS[lower, 1]])
        c, d = np.uint32(faces[f, _ENDS[lower, 2]]), np.uint32(faces[f, _ENDS[lower, 3]])
        v = float(r)
        up = (v - place[a, 1]) / (place[b, 1] - place[a, 1])
        down = (v - place[c, 1]) / (place[d, 1] - place[c, 1])
        u_up = place[a, 0] + up * (place[b, 0] - place[a, 0])
        u_down = place[c, 0] + down * (place[d, 0] - place[c, 0])
        # Half-open, [begin, end): neighbours that share an edge never both take its column.
        begin = np.int32(np.ceil(max(min(u_up, u_down), 0.0)))
        end = np.int32(np.ceil(min(max(u_up, u_down), most_u)))
        ends[m, 0], ends[m, 1] = u_up, u_down
        ends[m, 2] = place[a, 2] + up * (place[b, 2] - place[a, 2])
        ends[m, 3] = place[c, 2] + down * (place[d, 2] - place[c, 2])
        span[m, 0], span[m, 1], span[m, 2] = r, begin, end
        # Spans without a column are overwritten by the next one.
        m += int(begin < end)
    return m


@compiled
def cast(
    surface: Surface,
    n_u: int,
    n_v: int,
    low_w: Vector,
    high_w: Vector,
    below: Crossings,
    buffers: CrossingBuffers,
    n_crossings: int,
    body: int,
) -> int:
    """Append the crossings of one surface with the columns; return their number so far.

    Only crossings between the heights `low_w` and `high_w` of their tile count, those below are
    summed in `below`. When the number returned exceeds the buffers, what did not fit was not
    stored.
    """
    # In batches that fit the cache; a face may need all rows, and `rows_of_faces` writes 4 ahead.
    most = max(_BATCH, n_v) + 4
    face, row = np.empty(most, np.int32), np.empty(most, np.int32)
    span, ends = np.empty((most, 3), np.int32), np.empty((most, 4))
    start = 0
    while start < surface.candidates.shape[0]:
        n, start = rows_of_faces(surface, start, n_u, n_v, high_w, face, row)
        n = spans_of(surface, face, row, n, n_u, span, ends)
        n_crossings = cross(
            span[:n], ends[:n], n_u, low_w, high_w, below, buffers, n_crossings, body
        )
    return n_crossings


@compiled
def cross(
    span: Faces,
    ends: Vector,
    n_u: int,
    low_w: Vector,
    high_w: Vector,
    below: Crossings,
    buffers: CrossingBuffers,
    n_crossings: int,
    body: int,
) -> int:
    """Append the crossings of columns in spans; return their number so far."""
    room = buffers.column.shape[0]
    across = tiles_across(n_u)
    for k in range(span.shape[0]):
        r, begin, end = span[k, 0], span[k, 1], span[k, 2]
        u_up, u_down, w_up, w_down = ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3]
        # Which edge is on the left gives the side: upwards, +1 enters the body and −1 leaves it.
        upward = u_up < u_down
        left = min(u_up, u_down)
        w_left = w_up if upward else w_down
        slope = (w_down - w_up) / (u_down - u_up)
        sign = np.int32(2) * np.int32(upward) - np.int32(1)
        at = r * n_u
        tiles = ((r + MARGIN) >> TILE) * across
        for i in range(begin, end):
            w = w_left + (i - left) * slope
            tile = np.uint32(tiles + ((i + MARGIN) >> TILE))
            # Above the tile nothing matters; below it only the winding number at its floor does.
            if w >= high_w[tile]:
                continue
            cell = np.uint32(at + i)
            if w < low_w[tile]:
                below[cell] += sign
                continue
            # Counted even without room: the caller casts again with buffers of that size.
            if n_crossings < room:
                buffers.column[n_crossings] = cell
                buffers.height[n_crossings] = w
                buffers.change[n_crossings] = sign * (body + 1)
                buffers.per_column[cell] += 1
            n_crossings += 1
    return n_crossings
