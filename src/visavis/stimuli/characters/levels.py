"""Lighter copies of a mesh: levels of detail that keep faces, and plain thinning by parts."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Morph, SkinnedMesh
from visavis.stimuli.characters.errors import CharacterError

FACE = ("face", "left_eye", "right_eye")


@dataclass(frozen=True)
class LevelBudget:
    """How many triangles a level has, and how many of them at most its face with the eyes."""

    triangles: int
    face: int


LEVELS = (
    LevelBudget(26000, 9000),
    LevelBudget(6000, 1600),
    LevelBudget(2000, 600),
)
"""The levels of detail of everybody, from the finest to the lightest."""
_HEAD = [PART_INDEX[p] for p in ("face", "left_eye", "right_eye", "scalp", "neck")]
_HEAD_IMPORTANCE = 1.7
_EYE_SHARES = (0.014, 0.06)
"""Shares of the triangles that eyeballs and lids get."""
_KEEPS_ALL = 12000
"""Levels with fewer triangles drop what lies deep in the sockets."""
MAX_ERROR = 0.5
"""Error limit of thinning, in sizes of the mesh; so large that the number of triangles decides."""
_LID_M = 0.006
_UV_WEIGHT = 0.3
_NOSE_TO_LIPS, _ROUND_EYES = ((-0.55, 0.55), (-1.35, 0.25)), ((0.2, 0.85), (-0.25, 0.30))
"""Where features lie from between the eyes, right and up, in distances of the eyes."""
_NECK_SHARE = 0.5
"""Weight of the neck, relative to nose, lips and lids."""
_PLAIN_SHARE = 0.3
"""Weight of bends and pictures on cheek and forehead, relative to facial features."""
_FEATURE_WEIGHTS = {"normal": 0.3, "colour": 0.02, "place": 6.0, "uv": 0.5}
Indices = npt.NDArray[np.int64]


def thin_mesh(mesh: SkinnedMesh, n_triangles: int) -> SkinnedMesh:
    """Return the mesh with about n_triangles.

    Every triangle keeps its part: parts meet at seams that are thinned on both sides at once.
    Head and body get shares of their own, so that faces stay honest.

    Raises:
        CharacterError: the library that thins meshes is not installed.
    """
    total = len(mesh.triangles)
    if total <= n_triangles:
        return mesh
    split_mesh = _split_by_part(mesh)
    eyes, lids, in_socket = _round_the_eyes(split_mesh)
    if n_triangles < _KEEPS_ALL:
        is_visible = ~in_socket
        split_mesh = _of_triangles(split_mesh, is_visible)
        eyes, lids = eyes[is_visible], lids[is_visible]
    on_head = np.isin(split_mesh.triangle_part, _HEAD) & ~eyes & ~lids
    group = np.select([eyes, lids, on_head], [0, 1, 2], 3)
    count = np.bincount(group, minlength=4)
    n_wanted = count.copy()
    for k, share in enumerate(_EYE_SHARES):
        n_wanted[k] = min(count[k], round(share * n_triangles) + 16)
    left = n_triangles - int(n_wanted[:2].sum())
    share = count[2] * _HEAD_IMPORTANCE / max(count[2] * _HEAD_IMPORTANCE + count[3], 1)
    n_wanted[2] = min(round(share * left), count[2])
    n_wanted[3] = left - n_wanted[2]
    is_locked = _between(split_mesh, group)
    thin = [
        _thin(split_mesh, split_mesh.triangles[group == k], int(n_wanted[k]), is_locked)
        for k in range(4)
        if count[k]
    ]
    return _compact(split_mesh, np.concatenate(thin))


def _round_the_eyes(
    mesh: SkinnedMesh,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Tell which triangles (t,) are eyeballs, which are lids, and which lie deep in the socket."""
    middle = mesh.vertices_m[mesh.triangles].mean(axis=1)
    eyes = np.zeros(len(middle), dtype=bool)
    lids, in_socket = eyes.copy(), eyes.copy()
    for side in ("left_eye", "right_eye"):
        mine = mesh.triangle_part == PART_INDEX[side]
        if not mine.any():
            continue
        points = mesh.vertices_m[np.unique(mesh.triangles[mine])]
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        radius = float(np.ptp(points, axis=0).max()) / 2
        d = middle - centre
        near = (mesh.triangle_part == PART_INDEX["face"]) & (
            np.linalg.norm(d, axis=1) < radius + _LID_M
        )
        behind = d[:, 2] > -0.1 * radius
        eyes |= mine
        lids |= near
        in_socket |= behind & (mine | (near & (np.linalg.norm(d, axis=1) < 1.05 * radius)))
    return eyes, lids, in_socket


def lighter(mesh: SkinnedMesh, budget: LevelBudget) -> SkinnedMesh:
    """Return the mesh as a level of detail; the face is thinned separately and least.

    Nose, lips, lids and what they border on change last, and no vertex ever leaves the surface of
    the full mesh. Parts meet at seams that are thinned on both sides at once.

    Raises:
        CharacterError: the library that thins meshes is not installed.
    """
    if len(mesh.triangles) <= budget.triangles:
        return mesh
    split_mesh = _split_by_part(mesh)
    if budget.triangles < _KEEPS_ALL:
        split_mesh = _of_triangles(split_mesh, ~_round_the_eyes(split_mesh)[2])
    on_face = np.isin(split_mesh.triangle_part, [PART_INDEX[p] for p in FACE])
    is_locked = _between(split_mesh, on_face.astype(np.int64))
    share = _features(split_mesh)
    face = _thin(split_mesh, split_mesh.triangles[on_face], budget.face, is_locked, share)
    left = budget.triangles - len(face)
    thin = [face, _thin(split_mesh, split_mesh.triangles[~on_face], left, is_locked, share)]
    return _compact(split_mesh, np.concatenate(thin))


def keep_triangles(mesh: SkinnedMesh, is_kept: npt.NDArray[np.bool_]) -> SkinnedMesh:
    """Return the mesh with the triangles `is_kept` (t,) and the vertices they use, as they were."""
    some = _of_triangles(mesh, is_kept)
    corners_used, corners = np.unique(some.triangles, return_inverse=True)
    triangles = corners.reshape(-1, 3).astype(np.int32)
    return replace(_copies(some, corners_used.astype(np.int64)), triangles=triangles)


def _of_triangles(mesh: SkinnedMesh, is_kept: npt.NDArray[np.bool_]) -> SkinnedMesh:
    return replace(
        mesh,
        triangles=mesh.triangles[is_kept],
        triangle_part=mesh.triangle_part[is_kept],
        triangle_material=mesh.triangle_material[is_kept],
    )


def _features(mesh: SkinnedMesh) -> Vector:
    """Return how much each vertex (v,) belongs to nose, lips and lids, 0 to 1, and to the neck."""
    centre = []
    for side in FACE[1:]:
        ball = mesh.vertices_m[np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX[side]])]
        if not len(ball):
            return np.zeros(len(mesh.vertices_m))
        centre.append((ball.min(axis=0) + ball.max(axis=0)) / 2)
    apart_m = float(np.linalg.norm(centre[0] - centre[1]))
    x, y, z = ((mesh.vertices_m - (centre[0] + centre[1]) / 2) / apart_m).T.astype(np.float64)

    def within(value: Vector, bounds: tuple[float, float]) -> Vector:
        edge: Vector = np.clip(np.minimum(value - bounds[0], bounds[1] - value) / 0.2 + 1, 0, 1)
        return edge

    middle = within(x, _NOSE_TO_LIPS[0]) * within(y, _NOSE_TO_LIPS[1])
    eyes = within(np.abs(x), _ROUND_EYES[0]) * within(y, _ROUND_EYES[1])
    front: Vector = np.clip((0.45 - z) / 0.2, 0, 1)
    share = front * np.maximum(middle, eyes)
    # From jaw to shoulder a neck is hollow: spanned by few triangles it would be wider.
    neck = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["neck"]])
    share[neck] = np.maximum(share[neck], _NECK_SHARE)
    return share


def join_skinned_meshes(parts: Sequence[SkinnedMesh]) -> SkinnedMesh:
    """Return several meshes of the same materials as one."""
    starts = np.cumsum([0, *(len(p.vertices_m) for p in parts)])
    morphs: dict[str, list[Morph]] = {}
    for part, start in zip(parts, starts, strict=False):
        for name, morph in part.morphs.items():
            renumbered = Morph((morph.vertices + start).astype(np.int32), morph.delta_m)
            morphs.setdefault(name, []).append(renumbered)

    def all_of(field: str) -> npt.NDArray[Any]:
        return np.concatenate([getattr(p, field) for p in parts])

    triangles = [p.triangles + start for p, start in zip(parts, starts, strict=False)]
    return SkinnedMesh(
        vertices_m=all_of("vertices_m"),
        normals=all_of("normals"),
        colour_srgb=all_of("colour_srgb"),
        uv=all_of("uv"),
        joints=all_of("joints"),
        weights=all_of("weights"),
        triangles=np.concatenate(triangles).astype(np.int32),
        triangle_part=all_of("triangle_part"),
        triangle_material=all_of("triangle_material"),
        morphs={
            name: Morph(
                np.concatenate([m.vertices for m in rows]),
                np.concatenate([m.delta_m for m in rows]),
            )
            for name, rows in morphs.items()
        },
    )


def _split_by_part(mesh: SkinnedMesh) -> SkinnedMesh:
    """Give every part and material vertices of its own."""
    groups = mesh.triangle_part.astype(np.int64) * 256 + mesh.triangle_material
    codes = mesh.triangles.astype(np.int64) * 65536 + groups[:, None]
    unique, index = np.unique(codes, return_inverse=True)
    source = unique // 65536
    copies = _copies(mesh, source)
    return replace(copies, triangles=index.reshape(-1, 3).astype(np.int32))


def _copies(mesh: SkinnedMesh, source: Indices) -> SkinnedMesh:
    """Return the mesh with vertices taken from `source`; triangles are left as they are."""
    morphs = {}
    for name, morph in mesh.morphs.items():
        at = np.full(len(mesh.vertices_m), -1, dtype=np.int64)
        at[morph.vertices] = np.arange(len(morph.vertices))
        moves = np.flatnonzero(at[source] >= 0)
        morphs[name] = Morph(moves.astype(np.int32), morph.delta_m[at[source[moves]]])
    return replace(
        mesh,
        vertices_m=mesh.vertices_m[source],
        normals=mesh.normals[source],
        colour_srgb=mesh.colour_srgb[source],
        uv=None if mesh.uv is None else mesh.uv[source],
        joints=mesh.joints[source],
        weights=mesh.weights[source],
        morphs=morphs,
    )


def _between(mesh: SkinnedMesh, group: Indices) -> npt.NDArray[np.bool_]:
    """Tell which vertices (v,) stand where triangles of different groups (t,) meet."""
    places = np.round(mesh.vertices_m * 1e5).astype(np.int64) + (1 << 20)
    codes = (places[:, 0] << 42) | (places[:, 1] << 21) | places[:, 2]
    _, place = np.unique(codes, return_inverse=True)
    of_place = np.zeros((int(group.max()) + 1, int(place.max()) + 1), dtype=bool)
    for k in range(3):
        of_place[group, place[mesh.triangles[:, k]]] = True
    several: npt.NDArray[np.bool_] = (of_place.sum(axis=0) > 1)[place]
    return several


def _thin(
    mesh: SkinnedMesh,
    triangles: npt.NDArray[np.int32],
    n_triangles: int,
    is_locked: npt.NDArray[np.bool_],
    features_01: Vector | None = None,
) -> npt.NDArray[np.int32]:
    """Return fewer triangles on the same vertices; without `features_01` (v,) all count alike."""
    if len(triangles) <= n_triangles:
        return triangles
    try:
        import meshoptimizer
    except ImportError as e:
        raise CharacterError(
            "thinning a character needs meshoptimizer; run `pip install meshoptimizer`"
        ) from e
    vertex_numbers, places = np.unique(triangles, return_inverse=True)
    indices = places.astype(np.uint32).ravel()
    vertices = np.ascontiguousarray(mesh.vertices_m[vertex_numbers])
    if features_01 is None:
        attributes, weights = _plain_attributes(mesh, vertex_numbers)
    else:
        attributes, weights = _feature_attributes(
            mesh, vertex_numbers, features_01[vertex_numbers, None]
        )
    values = np.ascontiguousarray(np.concatenate(attributes, axis=1), dtype=np.float32)
    result = np.zeros_like(indices)
    count = meshoptimizer.simplify_with_attributes(
        result,
        indices,
        vertices,
        values,
        np.array(weights, dtype=np.float32),
        vertex_lock=is_locked[vertex_numbers].astype(np.uint8),
        # The wrapper declares no C types for the numbers of this call.
        index_count=ctypes.c_size_t(len(indices)),
        vertex_count=ctypes.c_size_t(len(vertices)),
        vertex_positions_stride=ctypes.c_size_t(12),
        vertex_attributes_stride=ctypes.c_size_t(4 * values.shape[1]),
        attribute_count=ctypes.c_size_t(values.shape[1]),
        target_index_count=ctypes.c_size_t(3 * n_triangles),
        target_error=ctypes.c_float(MAX_ERROR),
        options=ctypes.c_uint(0),
    )
    thin: npt.NDArray[np.int32] = vertex_numbers[result[:count].reshape(-1, 3)].astype(np.int32)
    return thin


Attributes = tuple[list[npt.NDArray[np.float32]], list[float]]


def _plain_attributes(mesh: SkinnedMesh, vertex_numbers: npt.NDArray[np.int32]) -> Attributes:
    attributes: list[npt.NDArray[np.float32]] = [
        mesh.normals[vertex_numbers],
        (mesh.colour_srgb[vertex_numbers] / 255).astype(np.float32),
    ]
    weights = [0.01, 0.01, 0.01, 0.02, 0.02, 0.02]
    places = _picture_places(mesh, vertex_numbers)
    if places is not None:
        attributes.append(places)
        weights += [_UV_WEIGHT, _UV_WEIGHT]
    return attributes, weights


def _feature_attributes(
    mesh: SkinnedMesh, vertex_numbers: npt.NDArray[np.int32], features_01: Vector
) -> Attributes:
    """Return what thinning should keep besides places: bends, colours, places in the picture, and
    places once more where features are.
    """
    share = (_PLAIN_SHARE + (1 - _PLAIN_SHARE) * features_01).astype(np.float32)
    points = mesh.vertices_m[vertex_numbers]
    sizes = points - points.mean(axis=0)
    sizes /= max(float(np.ptp(points, axis=0).max()), 1e-9)
    attributes: list[npt.NDArray[np.float32]] = [
        mesh.normals[vertex_numbers] * share,
        (mesh.colour_srgb[vertex_numbers] / 255).astype(np.float32),
        (sizes * features_01).astype(np.float32),
    ]
    of = _FEATURE_WEIGHTS
    weights = 3 * [of["normal"]] + 3 * [of["colour"]] + 3 * [of["place"]]
    places = _picture_places(mesh, vertex_numbers)
    if places is not None:
        attributes.append(places * share)
        weights += 2 * [of["uv"]]
    return attributes, weights


def _picture_places(
    mesh: SkinnedMesh, vertex_numbers: npt.NDArray[np.int32]
) -> npt.NDArray[np.float32] | None:
    """Return places in a picture (k, 2), which must not swim: lips would take on the colour of the
    mouth's inside. Cloth that repeats may swim; it reaches beyond the picture.
    """
    if mesh.uv is None or not np.abs(mesh.uv[vertex_numbers] - 0.5).max() > 0:
        return None
    once = (np.abs(mesh.uv[vertex_numbers] - 0.5) <= 0.51).all(axis=1, keepdims=True)
    return np.where(once, mesh.uv[vertex_numbers], 0.0).astype(np.float32)


def _compact(mesh: SkinnedMesh, triangles: npt.NDArray[np.int32]) -> SkinnedMesh:
    """Return the mesh with only the vertices that triangles use; each belongs to one part."""
    part = np.zeros(len(mesh.vertices_m), dtype=np.uint8)
    material = np.zeros(len(mesh.vertices_m), dtype=np.uint8)
    for k in range(3):
        part[mesh.triangles[:, k]] = mesh.triangle_part
        material[mesh.triangles[:, k]] = mesh.triangle_material
    vertex_numbers, indices = np.unique(triangles, return_inverse=True)
    thin = _copies(mesh, vertex_numbers.astype(np.int64))
    return replace(
        thin,
        triangles=indices.reshape(-1, 3).astype(np.int32),
        triangle_part=part[triangles[:, 0]],
        triangle_material=material[triangles[:, 0]],
    )
