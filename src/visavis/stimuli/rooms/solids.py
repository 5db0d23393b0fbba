"""Solid shapes as meshes: boxes, cylinders, turned and flat pieces, moved and joined."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector, quat_from_yaw_pitch_deg, rotate, unit
from visavis.stimuli.picture import StaticMesh

Srgb = tuple[int, int, int]
Point = Sequence[float] | Vector

_BOX_FACES: Final = (
    # normal, first and second edge of the face (counter-clockwise seen from outside)
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
)


def _mesh(
    vertices: Vector, normals: Vector, triangles: npt.ArrayLike, colour: Srgb, uv: Vector
) -> StaticMesh:
    return StaticMesh(
        vertices_m=np.ascontiguousarray(vertices, dtype=np.float32),
        normals=np.ascontiguousarray(normals, dtype=np.float32),
        colour_srgb=np.tile(np.array(colour, dtype=np.uint8), (len(vertices), 1)),
        triangles=np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3),
        uv=np.ascontiguousarray(uv, dtype=np.float32),
    )


def box(
    centre_m: Point, size_m: Point, colour: Srgb, *, chamfer_m: float = 0.0, uv_m: float = 1.0
) -> StaticMesh:
    """Return a box; `chamfer_m` cuts its edges, `uv_m` is how many metres one texture covers."""
    half = np.asarray(size_m, dtype=np.float64) / 2
    if not (half > 0).all():
        raise DesignError(f"a box of size {tuple(size_m)}; give three lengths above 0")
    cut = min(chamfer_m, 0.45 * float(half.min()))
    vertices: list[Vector] = []
    normals: list[Vector] = []
    triangles: list[tuple[int, int, int]] = []
    uv: list[tuple[float, float]] = []
    for normal, u, v in np.array(_BOX_FACES, dtype=np.float64):
        at = len(vertices)
        u_half, v_half = np.abs(u) @ half, np.abs(v) @ half
        for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            p = normal * (np.abs(normal) @ half) + su * u * (u_half - cut) + sv * v * (v_half - cut)
            vertices.append(p)
            normals.append(normal)
            uv.append(((su * u_half + u_half) / uv_m, (v_half - sv * v_half) / uv_m))
        triangles += [(at, at + 1, at + 2), (at, at + 2, at + 3)]
    if cut > 0:
        _bevel(np.array(vertices), np.array(normals), triangles)
    return _mesh(
        np.array(vertices) + np.asarray(centre_m, dtype=np.float64),
        np.array(normals),
        triangles,
        colour,
        np.array(uv),
    )


def _bevel(vertices: Vector, normals: Vector, triangles: list[tuple[int, int, int]]) -> None:
    """Close the gaps between the six shrunk faces of a box with strips and corners."""
    faces = vertices.reshape(6, 4, 3)
    face_normals = normals.reshape(6, 4, 3)[:, 0]
    signs = np.sign(faces)
    corner_of = {
        (face, tuple(signs[face, k].astype(int))): 4 * face + k
        for face in range(6)
        for k in range(4)
    }

    def add(indices: list[int]) -> None:
        points = vertices[indices]
        outward = np.cross(points[1] - points[0], points[2] - points[0])
        if outward @ points.mean(axis=0) < 0:
            indices = indices[::-1]
        triangles.extend(
            (indices[0], indices[i], indices[i + 1]) for i in range(1, len(indices) - 1)
        )

    for a in range(6):
        for b in range(a + 1, 6):
            if face_normals[a] @ face_normals[b] != 0:
                continue
            edge = (face_normals[a] + face_normals[b]).astype(int)
            axis = int(np.flatnonzero(edge == 0)[0])
            ends = []
            for s in (-1, 1):
                corner = edge.copy()
                corner[axis] = s
                ends.append(tuple(corner))
            add(
                [
                    corner_of[a, ends[0]],
                    corner_of[a, ends[1]],
                    corner_of[b, ends[1]],
                    corner_of[b, ends[0]],
                ]
            )
    for corner in {key for _, key in corner_of}:
        add([i for (_, key), i in corner_of.items() if key == corner])


def cylinder(
    start_m: Point,
    end_m: Point,
    radius_m: float,
    colour: Srgb,
    *,
    sides: int = 20,
    end_radius_m: float | None = None,
) -> StaticMesh:
    """Return a closed cylinder, or a cone's trunk when the radii differ."""
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    top = radius_m if end_radius_m is None else end_radius_m
    length = float(np.linalg.norm(end - start))
    if length <= 0 or radius_m <= 0 or top <= 0:
        raise DesignError("a cylinder needs a length and radii above 0")
    axis = (end - start) / length
    side = unit(np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0]))
    other = np.cross(axis, side)
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    around = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other
    slope = unit(around + axis * (radius_m - top) / length)
    wall = np.concatenate([start + radius_m * around, end + top * around])
    uv = np.stack([np.tile(angle / np.pi * radius_m, 2), np.repeat([length, 0.0], sides + 1)], 1)
    i = np.arange(sides)
    quads = np.concatenate(
        [np.stack([i, i + 1, i + sides + 2], 1), np.stack([i, i + sides + 2, i + sides + 1], 1)]
    )
    caps_v: list[Vector] = []
    caps_n: list[Vector] = []
    caps_t: list[npt.NDArray[np.int64]] = []
    for centre, radius, normal, flip in ((start, radius_m, -axis, True), (end, top, axis, False)):
        at = 2 * (sides + 1) + len(caps_v) * (sides + 2)
        caps_v.append(np.concatenate([[centre], centre + radius * around]))
        caps_n.append(np.tile(normal, (sides + 2, 1)))
        fan = np.stack([np.full(sides, at), at + 1 + i, at + 2 + i], 1)
        caps_t.append(fan[:, ::-1] if flip else fan)
    return _mesh(
        np.concatenate([wall, *caps_v]),
        np.concatenate([slope, slope, *caps_n]),
        np.concatenate([quads, *caps_t]),
        colour,
        np.concatenate([uv, np.zeros((2 * (sides + 2), 2))]),
    )


def lathe(profile_m: Sequence[Point], colour: Srgb, *, sides: int = 28) -> StaticMesh:
    """Return a shape turned about the y axis from (radius, height) points, lowest first."""
    points = np.asarray(profile_m, dtype=np.float64)
    tangent = np.gradient(points, axis=0)
    outward = unit(np.stack([tangent[:, 1], -tangent[:, 0]], 1))
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    ring = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], 1)
    vertices = ring[None] * points[:, 0, None, None] + [0.0, 1.0, 0.0] * points[:, 1, None, None]
    normals = ring[None] * outward[:, 0, None, None] + [0, 1, 0] * outward[:, 1, None, None]
    n, row = sides + 1, np.arange(sides)
    triangles = []
    for k in range(len(points) - 1):
        a = k * n + row
        triangles += [np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)]
    uv = np.stack(np.broadcast_arrays(angle[None] / np.pi, points[:, 1, None]), -1).reshape(-1, 2)
    return _mesh(
        vertices.reshape(-1, 3), normals.reshape(-1, 3), np.concatenate(triangles), colour, uv
    )


def flat(
    corner_m: Point, u_m: Point, v_m: Point, colour: Srgb, *, uv_m: float | None = None
) -> StaticMesh:
    """Return a rectangle from its lower left corner along `u_m` and `v_m`; its front is u × v.

    One texture covers `uv_m` metres, or the whole rectangle when None.
    """
    corner, u, v = (np.asarray(p, dtype=np.float64) for p in (corner_m, u_m, v_m))
    normal = unit(np.cross(u, v))
    vertices = np.stack([corner, corner + u, corner + u + v, corner + v])
    width, height = (1.0, 1.0)
    if uv_m is not None:
        width, height = float(np.linalg.norm(u)) / uv_m, float(np.linalg.norm(v)) / uv_m
    uv = np.array([[0, height], [width, height], [width, 0], [0, 0]])
    return _mesh(vertices, np.tile(normal, (4, 1)), [(0, 1, 2), (0, 2, 3)], colour, uv)


def move_mesh(mesh: StaticMesh, by_m: Point = (0, 0, 0), *, yaw_deg: float = 0.0) -> StaticMesh:
    """Turn a mesh about the vertical through the origin (positive to the left), then shift it."""
    turn = quat_from_yaw_pitch_deg(yaw_deg)
    return StaticMesh(
        vertices_m=(rotate(turn, mesh.vertices_m.astype(np.float64)) + np.asarray(by_m)).astype(
            np.float32
        ),
        normals=rotate(turn, mesh.normals.astype(np.float64)).astype(np.float32),
        colour_srgb=mesh.colour_srgb,
        triangles=mesh.triangles,
        uv=mesh.uv,
    )


def join_meshes(*meshes: StaticMesh) -> StaticMesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(m.vertices_m) for m in meshes)])
    return StaticMesh(
        vertices_m=np.concatenate([m.vertices_m for m in meshes]),
        normals=np.concatenate([m.normals for m in meshes]),
        colour_srgb=np.concatenate([m.colour_srgb for m in meshes]),
        triangles=np.concatenate(
            [m.triangles + np.int32(s) for m, s in zip(meshes, starts[:-1], strict=True)]
        ),
        uv=np.concatenate(
            [m.uv if m.uv is not None else np.zeros((len(m.vertices_m), 2), "f4") for m in meshes]
        ),
    )


def volume_m3(mesh: StaticMesh) -> float:
    """Return the enclosed volume of a closed mesh, positive when its faces look outward."""
    a, b, c = np.moveaxis(mesh.vertices_m[mesh.triangles].astype(np.float64), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6)
