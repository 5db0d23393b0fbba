"""Tessellate spheres, boxes and capsules into closed meshes, inscribed in the true shape."""

from collections.abc import Sequence

import numpy as np

from visavis.analysis.collisions.meshes import ClosedMesh, Faces, closed_mesh
from visavis.lab.geometry import Vector, unit

_BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip


def box(centre_m: Vector, half_m: Vector, rotation: Vector | None = None) -> ClosedMesh:
    """Return a box; the columns of `rotation` (3, 3) are its axes, `half_m` (3,) half its sides."""
    axes = np.eye(3) if rotation is None else np.asarray(rotation, float)
    corners = np.asarray(centre_m, float) + (_BOX_CORNERS * np.asarray(half_m, float)) @ axes.T
    return closed_mesh(corners, _BOX_FACES, name="box")


def sphere(centre_m: Vector, radius_m: float, *, segments: int = 96, rings: int = 24) -> ClosedMesh:
    """Return a sphere with `segments` round and `rings` rings in each half."""
    return capsule(centre_m, centre_m, radius_m, segments=segments, rings=rings)


def capsule(
    start_m: Vector,
    end_m: Vector,
    radius_m: float,
    *,
    segments: int = 96,
    rings: int = 24,
    along: int = 1,
) -> ClosedMesh:
    """Return all points within a radius of a segment; `along` divides the straight part."""
    start, end = np.asarray(start_m, float), np.asarray(end_m, float)
    length = float(np.linalg.norm(end - start))
    axis = np.array([0.0, 0.0, 1.0]) if length == 0 else (end - start) / length
    side = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    other = np.cross(axis, side)
    bend = np.linspace(0, np.pi / 2, rings + 1)
    height = -np.cos(bend[1:]) * radius_m
    width = np.sin(bend[1:]) * radius_m
    straight = length * np.arange(1, along + 1) / along if length > 0 else np.empty(0)
    heights = np.concatenate([height, straight, length - height[-2::-1]])
    widths = np.concatenate([width, np.full(straight.size, radius_m), width[-2::-1]])
    turn = 2 * np.pi * np.arange(segments) / segments
    around = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    rows = start + heights[:, None, None] * axis + widths[:, None, None] * around
    poles = [start - radius_m * axis, end + radius_m * axis]
    vertices = np.concatenate([rows.reshape(-1, 3), poles])
    return closed_mesh(vertices, _tube_faces(len(heights), segments), name="capsule")


def union(parts: Sequence[ClosedMesh]) -> ClosedMesh:
    """Put meshes together as one body; where they overlap it is still one body."""
    offsets = np.cumsum([0, *(len(p.vertices_m) for p in parts[:-1])])
    return ClosedMesh(
        vertices_m=np.concatenate([p.vertices_m for p in parts]),
        faces=np.concatenate(
            [p.faces + np.int32(o) for p, o in zip(parts, offsets, strict=True)]
        ).astype(np.int32),
        repairs=tuple(r for p in parts for r in p.repairs),
    )


def inside_out(mesh: ClosedMesh) -> ClosedMesh:
    """Turn a mesh into a hole of its shape, to be put together with what surrounds it."""
    return ClosedMesh(mesh.vertices_m, np.ascontiguousarray(mesh.faces[:, ::-1]), mesh.repairs)


def _tube_faces(rows: int, segments: int) -> Faces:
    here = np.arange(segments)
    after = (here + 1) % segments
    faces = []
    for row in range(rows - 1):
        low, high = row * segments, (row + 1) * segments
        faces.append(np.stack([low + here, low + after, high + after], axis=1))
        faces.append(np.stack([low + here, high + after, high + here], axis=1))
    bottom, top = rows * segments, rows * segments + 1
    last = (rows - 1) * segments
    faces.append(np.stack([np.full(segments, bottom), after, here], axis=1))
    faces.append(np.stack([np.full(segments, top), last + here, last + after], axis=1))
    return np.concatenate(faces).astype(np.int32)
