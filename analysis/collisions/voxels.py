"""Count 1 cm cubes of the lattice through the origin: centres in both bodies, or touching both."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.columns import bounds, columns_in_both, faces_near, sides_of
from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import Lattice
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_ROOM = 65536


@compiled
def lattice_of_common_box(
    vertices_a: Vector, vertices_b: Vector, cell_m: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the first cube (3,) and the number of cubes (3,) of the common box; 0 if none."""
    box_a, box_b = bounds(vertices_a), bounds(vertices_b)
    first, shape = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for k in range(3):
        low, high = max(box_a[0, k], box_b[0, k]), min(box_a[1, k], box_b[1, k])
        first[k] = int(np.floor(low / cell_m)) - 1
        shape[k] = int(np.ceil(high / cell_m)) + 1 - first[k]
    if shape.min() < 2:
        shape[:] = 0
    return first, shape


@compiled
def cubes_centred_in(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    first: npt.NDArray[np.int64],
    shape: npt.NDArray[np.int64],
    cell_m: float,
) -> tuple[int, Vector]:
    """Return how many cube centres lie in both bodies, and the sum (3,) of their places."""
    low = first.astype(np.float64) * cell_m
    step = np.full(3, cell_m)
    top = low[1] + shape[1] * cell_m
    lattice = Lattice(1, low, step, shape[2], shape[0])
    column, stretch, _ = columns_in_both(
        vertices_a, faces_a, vertices_b, faces_b, lattice, low[1], top, _ROOM
    )
    count = 0
    total = np.zeros(3)
    for k in range(column.size):
        # Centres lie at (n + 1/2) · cell; those from `begin` up to `end` are within the stretch.
        begin = int(np.ceil(stretch[k, 0] / cell_m - 0.5))
        end = int(np.ceil(stretch[k, 1] / cell_m - 0.5))
        count += end - begin
        total[2] += (end - begin) * (low[2] + (column[k] % shape[2] + 0.5) * cell_m)
        total[0] += (end - begin) * (low[0] + (column[k] // shape[2] + 0.5) * cell_m)
        total[1] += (end - begin) * (begin + end) / 2 * cell_m
    return count, total


@compiled
def cubes_touching(
    vertices_a: Vector,
    faces_a: Faces,
    vertices_b: Vector,
    faces_b: Faces,
    first: npt.NDArray[np.int64],
    shape: npt.NDArray[np.int64],
    cell_m: float,
) -> tuple[int, Vector]:
    """Return how many open cubes touch both bodies, and the sum (3,) of their centres."""
    cubes = np.zeros((shape[0], shape[1], shape[2]), np.uint8)
    # bit 4: the other body may touch the cube; few cubes are then looked at closely
    _fill(vertices_b, faces_b, first, shape, cell_m, cubes, 2 | 4)
    _touch(vertices_b, faces_b, first, cell_m, cubes, 4, 0, False)
    _fill(vertices_a, faces_a, first, shape, cell_m, cubes, 1)
    _touch(vertices_a, faces_a, first, cell_m, cubes, 1, 4, True)
    _touch(vertices_b, faces_b, first, cell_m, cubes, 2, 1, True)
    count = 0
    total = np.zeros(3)
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                if cubes[i, j, k] & 3 == 3:
                    count += 1
                    total[0] += (first[0] + i + 0.5) * cell_m
                    total[1] += (first[1] + j + 0.5) * cell_m
                    total[2] += (first[2] + k + 0.5) * cell_m
    return count, total


@compiled
def _fill(
    vertices_m: Vector,
    faces: Faces,
    first: npt.NDArray[np.int64],
    shape: npt.NDArray[np.int64],
    cell_m: float,
    cubes: npt.NDArray[np.uint8],
    bit: int,
) -> None:
    """Mark cubes whose centre lies in a body."""
    low = first.astype(np.float64) * cell_m
    step = np.full(3, cell_m)
    top = low[1] + shape[1] * cell_m
    lattice = Lattice(1, low, step, shape[2], shape[0])
    column, stretch, _ = columns_in_both(
        vertices_m, faces, vertices_m, faces, lattice, low[1], top, _ROOM
    )
    # The body against itself: the columns' stretches are those inside it.
    for k in range(column.size):
        z, x = column[k] % shape[2], column[k] // shape[2]
        begin = int(np.ceil(stretch[k, 0] / cell_m - 0.5)) - first[1]
        end = int(np.ceil(stretch[k, 1] / cell_m - 0.5)) - first[1]
        for y in range(max(begin, 0), min(end, shape[1])):
            cubes[x, y, z] |= bit


@compiled
def _touch(
    vertices_m: Vector,
    faces: Faces,
    first: npt.NDArray[np.int64],
    cell_m: float,
    cubes: npt.NDArray[np.uint8],
    bit: int,
    where: int,
    closely: bool,
) -> None:
    """Mark open cubes that a surface passes through, by separating axes, of those that have the
    bit `where`; all cubes in the boxes of its faces unless `closely`.
    """
    low = first.astype(np.float64) * cell_m
    high = low + np.array(cubes.shape).astype(np.float64) * cell_m
    near = faces_near(faces, sides_of(vertices_m, low, high))
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    p = np.empty((3, 3))
    for m in range(near.size):
        for c in range(3):
            for k in range(3):  # in cubes, from the first cube's corner
                p[c, k] = vertices_m[faces[near[m], c], k] / cell_m - first[k]
        for k in range(3):
            least, most = min(p[0, k], p[1, k], p[2, k]), max(p[0, k], p[1, k], p[2, k])
            begin[k] = max(0, int(np.floor(least)))
            end[k] = min(cubes.shape[k], int(np.floor(most)) + 1)
        # Only cubes in the face's box, and of these only those the other body may touch.
        for i in range(begin[0], end[0]):
            for j in range(begin[1], end[1]):
                for k in range(begin[2], end[2]):
                    here = cubes[i, j, k]
                    if here & bit or here & where != where:
                        continue
                    if not closely or _passes(p, i, j, k):
                        cubes[i, j, k] = here | bit


@compiled
def _passes(p: Vector, i: int, j: int, k: int) -> bool:
    """Tell whether a triangle (3, 3) meets the inside of the unit cube at (i, j, k)."""
    q = np.empty((3, 3))
    for c in range(3):
        q[c, 0], q[c, 1], q[c, 2] = p[c, 0] - i - 0.5, p[c, 1] - j - 0.5, p[c, 2] - k - 0.5
    # Separating axes of a box and a triangle (Akenine-Möller 2001): the three sides of the cube,
    for d in range(3):
        if min(q[0, d], q[1, d], q[2, d]) >= 0.5 or max(q[0, d], q[1, d], q[2, d]) <= -0.5:
            return False
    # the triangle's normal,
    e, g = q[1] - q[0], q[2] - q[0]
    nx, ny, nz = e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0]
    if abs(nx * q[0, 0] + ny * q[0, 1] + nz * q[0, 2]) >= 0.5 * (abs(nx) + abs(ny) + abs(nz)):
        return False
    # and the nine cross products of edges; touching from outside is not passing.
    for c in range(3):
        edge = q[(c + 1) % 3] - q[c]
        for d in range(3):
            s, t = (d + 1) % 3, (d + 2) % 3
            reach = 0.5 * (abs(edge[s]) + abs(edge[t]))
            x0 = edge[s] * q[c, t] - edge[t] * q[c, s]
            x2 = edge[s] * q[(c + 2) % 3, t] - edge[t] * q[(c + 2) % 3, s]
            if reach > 0.0 and (min(x0, x2) >= reach or max(x0, x2) <= -reach):
                return False
    return True
