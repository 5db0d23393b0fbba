"""Measure the common volume of two surfaces: coarsely first, finely again where it is small."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.columns import bounds, columns_in_both, faces_near, sides_of
from visavis.analysis.collisions.contact import crossing_box
from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import Crossings, Lattice
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_ROOM = 16384
_MAX_PIECES = 20_000
_LITTLE = 1 / 30
_LEAST = 1 / 100
_WIDE = 1 / 8


@compiled
def measure_pair(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    cell_m: float,
    refine_below_m3: float,
    columns_wanted: int,
) -> tuple[float, Vector, float, int, int]:
    """Return the common volume, its centre (3,), the cell used, columns inside both, meetings.

    Columns run along the longest side of the common box, at most `cell_m` apart. A volume below
    `refine_below_m3`, zero included, is measured again where the surfaces cross, along the
    shortest side there and close enough for `columns_wanted` columns. Where that gives less than a
    hundredth of it, once more with columns twice as close; less than a thirtieth, with columns
    farther apart than an eighth of `cell_m`, four times as close. The centre is NaN where nothing
    is common.
    """
    # Nothing is common outside the common box.
    box_a, box_b = bounds(vertices_a), bounds(vertices_b)
    low, high = np.maximum(box_a[0], box_b[0]), np.minimum(box_a[1], box_b[1])
    return measure_within(
        vertices_a, faces_a, vertices_b, faces_b, low, high, cell_m, refine_below_m3, columns_wanted
    )


@compiled
def measure_within(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    low_m: Vector,
    high_m: Vector,
    cell_m: float,
    refine_below_m3: float,
    columns_wanted: int,
) -> tuple[float, Vector, float, int, int]:
    """Measure as `measure_pair` what two bodies share inside a box."""
    if low_m[0] >= high_m[0] or low_m[1] >= high_m[1] or low_m[2] >= high_m[2]:
        return 0.0, np.full(3, np.nan), cell_m, 0, 0
    axis = longest_side(low_m, high_m)
    own_a, shape_a = in_shadow(vertices_a, faces_a, axis, low_m, high_m)
    own_b, shape_b = in_shadow(vertices_b, faces_b, axis, low_m, high_m)
    return measure_shadows(
        own_a, shape_a, own_b, shape_b, low_m, high_m, cell_m, refine_below_m3, columns_wanted
    )


@compiled
def measure_shadows(
    own_a: Vector,
    shape_a: Faces,
    own_b: Vector,
    shape_b: Faces,
    low_m: Vector,
    high_m: Vector,
    cell_m: float,
    refine_below_m3: float,
    columns_wanted: int,
) -> tuple[float, Vector, float, int, int]:
    """Measure as `measure_within` from what lies in the shadow of the box's longest side alone."""
    nothing = np.full(3, np.nan)
    low, high = low_m, high_m
    axis = longest_side(low, high)
    if shape_a.shape[0] == 0 or shape_b.shape[0] == 0:
        return 0.0, nothing, cell_m, 0, 0
    # Coarse pass over the whole box.
    volume, centre, n, active, common_box = measure_box(
        own_a, shape_a, own_b, shape_b, axis, low, high, cell_m
    )
    if volume >= refine_below_m3:
        return volume, centre, cell_m, n, -1
    if common_box[0, axis] > common_box[1, axis]:
        return 0.0, nothing, cell_m, 0, 0
    # Small or zero: the surfaces must cross if they share anything that columns have missed, so
    # look again where they do.
    low, high = np.maximum(low, common_box[0]), np.minimum(high, common_box[1])
    near_a = faces_near(shape_a, sides_of(own_a, low, high))
    near_b = faces_near(shape_b, sides_of(own_b, low, high))
    n_meetings, crossing = crossing_box(own_a, shape_a, near_a, own_b, shape_b, near_b, low, high)
    if n_meetings == 0:
        return volume, centre, cell_m, n, 0
    if n > 0:
        for k in range(3):
            crossing[0, k] = min(crossing[0, k], active[0, k])
            crossing[1, k] = max(crossing[1, k], active[1, k])
    slack = 1e-9
    fine_low, fine_high = (
        np.maximum(low, crossing[0] - slack),
        np.minimum(high, crossing[1] + slack),
    )
    # So close that about `columns_wanted` columns cover the footprint.
    sides = fine_high - fine_low
    footprint = sides[(axis + 1) % 3] * sides[(axis + 2) % 3]
    fine_m = min(cell_m / 2, np.sqrt(footprint / columns_wanted))
    own_a, shape_a = in_shadow(own_a, shape_a, axis, fine_low, fine_high)
    own_b, shape_b = in_shadow(own_b, shape_b, axis, fine_low, fine_high)
    volume, centre, n, active, common_box = measure_box(
        own_a, shape_a, own_b, shape_b, axis, fine_low, fine_high, fine_m
    )
    closer = 1.0
    if volume < refine_below_m3 * _LITTLE and fine_m > cell_m * _WIDE:
        closer = 4.0  # a little volume in scattered places: a long box, so columns lie far apart
    elif volume < refine_below_m3 * _LEAST:
        closer = 2.0
    if closer > 1.0:
        fine_m /= closer
        volume, centre, n, active, common_box = measure_box(
            own_a, shape_a, own_b, shape_b, axis, fine_low, fine_high, fine_m
        )
    return volume, centre, fine_m, n, n_meetings


@compiled
def longest_side(low_m: Vector, high_m: Vector) -> int:
    """Return the axis along which a box is longest.

    Columns along it are fewest, and most faces lie along them.
    """
    axis = 0
    for k in range(1, 3):
        if high_m[k] - low_m[k] > high_m[axis] - low_m[axis]:
            axis = k
    return axis


@compiled
def measure_box(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    axis: int,
    low_m: Vector,
    high_m: Vector,
    cell_m: float,
) -> tuple[float, Vector, int, Vector, Vector]:
    """Return volume, centre (3,), stretches inside both, and the box (2, 3) they may fill,
    and the box that holds all the bodies can share.
    """
    # Columns run along `axis` (w); u and v are the two other axes in cyclic order.
    iu, iv = (axis + 1) % 3, (axis + 2) % 3
    n_u = min(_MAX_PIECES, max(1, int(np.ceil((high_m[iu] - low_m[iu]) / cell_m))))
    n_v = min(_MAX_PIECES, max(1, int(np.ceil((high_m[iv] - low_m[iv]) / cell_m))))
    step = np.ones(3)
    step[iu] = (high_m[iu] - low_m[iu]) / n_u
    step[iv] = (high_m[iv] - low_m[iv]) / n_v
    low_w, high_w = low_m[axis], high_m[axis]
    lattice = Lattice(axis, low_m, step, n_u, n_v)
    column, stretch, live = columns_in_both(
        vertices_a, faces_a, vertices_b, faces_b, lattice, low_w, high_w, _ROOM
    )
    length = 0.0
    moment = np.zeros(3)
    box = np.empty((2, 3))
    box[0], box[1] = np.inf, -np.inf
    # Midpoint rule: a column stands for a cell of step_u × step_v round it.
    for k in range(column.shape[0]):
        begin, end = stretch[k, 0], stretch[k, 1]
        u = low_m[iu] + (column[k] % n_u + 0.5) * step[iu]
        v = low_m[iv] + (column[k] // n_u + 0.5) * step[iv]
        length += end - begin
        moment[iu] += (end - begin) * u
        moment[iv] += (end - begin) * v
        moment[axis] += (end - begin) * (begin + end) / 2
        box[0, iu], box[1, iu] = min(box[0, iu], u - step[iu]), max(box[1, iu], u + step[iu])
        box[0, iv], box[1, iv] = min(box[0, iv], v - step[iv]), max(box[1, iv], v + step[iv])
        box[0, axis], box[1, axis] = min(box[0, axis], begin), max(box[1, axis], end)
    centre = np.full(3, np.nan)
    if length > 0.0:
        centre = moment / length
    common_box = np.empty((2, 3))
    for k in range(2):
        common_box[k, iu] = low_m[iu] + (live[k, 0] + 0.5) * step[iu]
        common_box[k, iv] = low_m[iv] + (live[k, 1] + 0.5) * step[iv]
        common_box[k, axis] = live[k, 2]
    return length * step[iu] * step[iv], centre, column.shape[0], box, common_box


@compiled
def in_shadow(
    vertices_m: Vector, faces: Faces, axis: int, low_m: Vector, high_m: Vector
) -> tuple[Vector, Faces]:
    """Return the faces, and their corners alone, that a column through a box may cross.

    Columns run along `axis`; only how the box lies across it matters, so what is below the box
    still tells on which side of the surface a column begins.
    """
    near = faces_near(faces, _sides_across(vertices_m, axis, low_m, high_m))
    number = np.full(vertices_m.shape[0], -1, np.int32)
    return corners_of(vertices_m, faces, near, number, vertices_m.shape[0])


@compiled
def corners_of(
    vertices_m: Vector, faces: Faces, near: Crossings, number: Crossings, most: int
) -> tuple[Vector, Faces]:
    """Return the corners of some faces, at most so many, and these faces with them alone.

    `number` (v,) is -1 at every corner, and written.
    """
    n = near.shape[0]
    corners = np.empty((min(3 * n, most), 3))
    renumbered = np.empty((n, 3), np.int32)
    m = 0
    for i in range(n):
        for k in range(3):
            v = faces[near[i], k]
            if number[v] < 0:
                number[v] = m
                corners[m, 0], corners[m, 1] = vertices_m[v, 0], vertices_m[v, 1]
                corners[m, 2] = vertices_m[v, 2]
                m += 1
            renumbered[i, k] = number[v]
    return corners[:m], renumbered


@compiled
def _sides_across(
    vertices_m: Vector, axis: int, low_m: Vector, high_m: Vector
) -> npt.NDArray[np.uint8]:
    """Return (n,) beyond which sides of a box, seen along an axis, each vertex lies."""
    iu, iv = np.uint32((axis + 1) % 3), np.uint32((axis + 2) % 3)
    u0, u1, v0, v1 = low_m[iu], high_m[iu], low_m[iv], high_m[iv]
    beyond = np.empty(vertices_m.shape[0], np.uint8)
    flat = vertices_m.ravel()  # with one index the loop is vectorised
    for i in range(vertices_m.shape[0]):
        u, v = flat[np.uint32(3 * i) + iu], flat[np.uint32(3 * i) + iv]
        code = np.int32(1) if u <= u0 else np.int32(0)
        code |= np.int32(2) if u >= u1 else np.int32(0)
        code |= np.int32(4) if v <= v0 else np.int32(0)
        code |= np.int32(8) if v >= v1 else np.int32(0)
        beyond[i] = code
    return beyond
