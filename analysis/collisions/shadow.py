"""Keep the part of a surface above or below a box: all that columns through the box can meet."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.columns import faces_near
from visavis.analysis.collisions.meshes import Faces
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector


@compiled
def in_shadow(
    vertices_m: Vector, faces: Faces, axis: int, low_m: Vector, high_m: Vector
) -> tuple[Vector, Faces]:
    """Return the faces, and their corners alone, that a column through a box may cross.

    Columns run along `axis`; only how the box lies across it matters, so what is below the box
    still tells on which side of the surface a column begins.
    """
    near = faces_near(faces, _sides_across(vertices_m, axis, low_m, high_m))
    n = near.shape[0]
    number = np.full(vertices_m.shape[0], -1, np.int32)
    corners = np.empty((min(3 * n, vertices_m.shape[0]), 3))
    faces_near_box = np.empty((n, 3), np.int32)
    m = 0
    # Renumber corners in the order in which faces name them.
    for i in range(n):
        for k in range(3):
            v = faces[near[i], k]
            if number[v] < 0:
                number[v] = m
                corners[m, 0], corners[m, 1] = vertices_m[v, 0], vertices_m[v, 1]
                corners[m, 2] = vertices_m[v, 2]
                m += 1
            faces_near_box[i, k] = number[v]
    return corners[:m], faces_near_box


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
