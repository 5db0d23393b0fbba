"""Lighter copies of a mesh, in which every tagged part is seen as large as in the full one."""

import ctypes
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stimuli.characters.body_parts import PART_INDEX, PARTS
from stimuli.characters.character import Morph, SkinnedMesh
from stimuli.characters.coverage import seen_areas_m2
from stimuli.characters.errors import CharacterError

LEVEL_TRIANGLES = (26000, 6000, 2000)
_HEAD = [PART_INDEX[p] for p in ("face", "left_eye", "right_eye", "scalp", "neck")]
_HEAD_IMPORTANCE = 1.7
_EYES = (PART_INDEX["left_eye"], PART_INDEX["right_eye"])
_EYE_SHARES = (0.014, 0.06)
"""Shares of the triangles that eyeballs and lids get."""
_KEEPS_ALL = 12000
"""Levels with fewer triangles drop what lies deep in the sockets."""
_LID_M = 0.006
_UV_WEIGHT = 0.3
_LEAST_M2 = 5e-4
"""Parts that are seen smaller than this on average are not matched; eyes always are."""
_GOOD = 0.012
_PROBE_M, _PROBE_STEP_M, _STEP_M, _MOST_M, _DAMPING = 0.002, 0.004, 0.004, 0.014, 400.0
Indices = npt.NDArray[np.int64]


def thinned(mesh: SkinnedMesh, n_triangles: int) -> SkinnedMesh:
    """Return the mesh with about n_triangles.

    Every triangle keeps its part: parts meet at seams that are thinned on both sides at once.
    Head and body get shares of their own, so that faces stay honest.

    Raises:
        CharacterError: the library that thins meshes is not installed.
    """
    total = len(mesh.triangles)
    if total <= n_triangles:
        return mesh
    apart = _split_by_part(mesh)
    eyes, lids, hidden = _round_the_eyes(apart)
    if n_triangles < _KEEPS_ALL:
        shown = ~hidden
        apart = replace(
            apart,
            triangles=apart.triangles[shown],
            triangle_part=apart.triangle_part[shown],
            triangle_material=apart.triangle_material[shown],
        )
        eyes, lids = eyes[shown], lids[shown]
    on_head = np.isin(apart.triangle_part, _HEAD) & ~eyes & ~lids
    group = np.select([eyes, lids, on_head], [0, 1, 2], 3)
    count = np.bincount(group, minlength=4)
    wanted = count.copy()
    for k, share in enumerate(_EYE_SHARES):
        wanted[k] = min(count[k], round(share * n_triangles) + 16)
    left = n_triangles - int(wanted[:2].sum())
    share = count[2] * _HEAD_IMPORTANCE / max(count[2] * _HEAD_IMPORTANCE + count[3], 1)
    wanted[2] = min(round(share * left), count[2])
    wanted[3] = left - wanted[2]
    locked = _between(apart, group)
    thin = [
        _thin(apart, apart.triangles[group == k], int(wanted[k]), locked)
        for k in range(4)
        if count[k]
    ]
    return _compacted(apart, np.concatenate(thin))


def _round_the_eyes(
    mesh: SkinnedMesh,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Tell which triangles (t,) are eyeballs, which are lids, and which lie deep in the socket."""
    middle = mesh.vertices_m[mesh.triangles].mean(axis=1)
    eyes = np.zeros(len(middle), dtype=bool)
    lids, hidden = eyes.copy(), eyes.copy()
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
        hidden |= behind & (mine | (near & (np.linalg.norm(d, axis=1) < 1.05 * radius)))
    return eyes, lids, hidden


def matched(thin: SkinnedMesh, full: SkinnedMesh, rounds: int = 8) -> SkinnedMesh:
    """Move the surface of a thinned mesh out or in until parts are seen as large as in the full.

    Thinning cuts corners off round limbs; a millimetre or two along the normals gives them back.
    How each part's surface changes what is seen of all parts (a collar hides the neck) is
    measured, and the smallest moves that mend all of them are made.
    """
    wanted = seen_areas_m2(full)
    parts = np.flatnonzero(
        wanted > np.where(np.isin(np.arange(len(PARTS)), _EYES), 2e-5, _LEAST_M2)
    )
    moved = range(1, len(PARTS))
    normals, place, uses = _shared_normals(thin)
    ways = uses[:, :, None] * normals[:, None]
    for eye in _EYES:
        ways[:, eye] = _opening(thin, place, eye, len(uses))
    sides = np.zeros(len(PARTS))

    def errors(sides: Vector, step_m: float = 0.002) -> tuple[Vector, npt.NDArray[np.float32]]:
        out = np.einsum("vpk,p->vk", ways, sides)
        vertices = (thin.vertices_m + out[place]).astype(np.float32)
        return seen_areas_m2(thin, vertices, step_m)[parts] / wanted[parts] - 1, vertices

    error, best = errors(sides)
    for _ in range(rounds):
        if np.abs(error).max(initial=0.0) < _GOOD:
            break
        coarse = errors(sides, _PROBE_STEP_M)[0]
        slopes = np.zeros((len(parts), len(PARTS)))
        for p in moved:
            probe = sides.copy()
            probe[p] += _PROBE_M
            slopes[:, p] = (errors(probe, _PROBE_STEP_M)[0] - coarse) / _PROBE_M
        damped = slopes.T @ slopes + _DAMPING * np.eye(len(PARTS))
        step = np.clip(-np.linalg.solve(damped, slopes.T @ error), -_STEP_M, _STEP_M)
        tried = []
        for k in (1.0, 0.5, 0.25):
            s = np.clip(sides + k * step, -_MOST_M, _MOST_M)
            e, v = errors(s)
            tried.append((np.abs(e).max(), s, e, v))
            if tried[-1][0] < np.abs(error).max():
                break
        worst, s, e, v = min(tried, key=lambda row: float(row[0]))
        if worst >= np.abs(error).max():
            break
        sides, error, best = s, e, v
    return replace(thin, vertices_m=best)


def _opening(mesh: SkinnedMesh, place: Indices, eye: int, n_places: int) -> Vector:
    """Return how places (p, 3) move when the lids of an eye open: eyes stay the spheres they are,
    but rims of lids that thinning has straightened are put back.
    """
    ways = np.zeros((n_places, 3))
    ball = np.unique(mesh.triangles[mesh.triangle_part == eye])
    if not len(ball):
        return ways
    points = mesh.vertices_m[ball]
    radius = float(np.ptp(points[:, 0])) / 2
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    centre[2] = points[:, 2].min() + radius
    face = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["face"]])
    d = mesh.vertices_m[face] - centre
    near = np.clip(1.5 - (np.linalg.norm(d, axis=1) - radius) / _LID_M, 0, 1) * (d[:, 2] < 0)
    ways[place[face], 1] = near * np.clip(d[:, 1] / (0.15 * radius), -1, 1)
    return ways


def _shared_normals(mesh: SkinnedMesh) -> tuple[Vector, Indices, Vector]:
    """Return normals (p, 3) by place, the place of every vertex (v,), and how much of a place
    belongs to each part (p, parts): copies of a vertex at seams must move together.
    """
    codes = np.round(mesh.vertices_m * 1e5).astype(np.int64) + (1 << 20)
    _, place = np.unique(
        (codes[:, 0] << 42) | (codes[:, 1] << 21) | codes[:, 2], return_inverse=True
    )
    normals = np.stack([np.bincount(place, mesh.normals[:, k]) for k in range(3)], axis=1)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    uses = np.zeros((len(normals), len(PARTS)))
    for k in range(3):
        np.add.at(uses, (place[mesh.triangles[:, k]], mesh.triangle_part), 1.0)
    return normals, place, uses / np.maximum(uses.sum(axis=1, keepdims=True), 1)


def joined(parts: Sequence[SkinnedMesh]) -> SkinnedMesh:
    """Return several meshes of the same materials as one."""
    starts = np.cumsum([0, *(len(p.vertices_m) for p in parts)])
    morphs: dict[str, list[Morph]] = {}
    for part, start in zip(parts, starts, strict=False):
        for name, morph in part.morphs.items():
            shifted = Morph((morph.vertices + start).astype(np.int32), morph.delta_m)
            morphs.setdefault(name, []).append(shifted)

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
    locked: npt.NDArray[np.bool_],
) -> npt.NDArray[np.int32]:
    try:
        import meshoptimizer
    except ImportError as e:
        raise CharacterError(
            "thinning a character needs meshoptimizer; run `pip install meshoptimizer`"
        ) from e
    used, places = np.unique(triangles, return_inverse=True)
    indices = places.astype(np.uint32).ravel()
    vertices = np.ascontiguousarray(mesh.vertices_m[used])
    attributes: list[npt.NDArray[np.float32]] = [
        mesh.normals[used],
        (mesh.colour_srgb[used] / 255).astype(np.float32),
    ]
    weights = [0.01, 0.01, 0.01, 0.02, 0.02, 0.02]
    if mesh.uv is not None and np.abs(mesh.uv[used] - 0.5).max() > 0:
        # Places in a picture must not swim: lips would take on the colour of the mouth's inside.
        # Cloth that repeats may; it reaches beyond the picture.
        once = (np.abs(mesh.uv[used] - 0.5) <= 0.51).all(axis=1, keepdims=True)
        attributes.append(np.where(once, mesh.uv[used], 0.0).astype(np.float32))
        weights += [_UV_WEIGHT, _UV_WEIGHT]
    values = np.ascontiguousarray(np.concatenate(attributes, axis=1), dtype=np.float32)
    result = np.zeros_like(indices)
    count = meshoptimizer.simplify_with_attributes(
        result, indices, vertices, values, np.array(weights, dtype=np.float32),
        vertex_lock=locked[used].astype(np.uint8),
        # The wrapper declares no C types for the numbers of this call.
        index_count=ctypes.c_size_t(len(indices)), vertex_count=ctypes.c_size_t(len(vertices)),
        vertex_positions_stride=ctypes.c_size_t(12),
        vertex_attributes_stride=ctypes.c_size_t(4 * values.shape[1]),
        attribute_count=ctypes.c_size_t(values.shape[1]),
        target_index_count=ctypes.c_size_t(3 * n_triangles), target_error=ctypes.c_float(0.5),
        options=ctypes.c_uint(0),
    )  # fmt: skip
    thin: npt.NDArray[np.int32] = used[result[:count].reshape(-1, 3)].astype(np.int32)
    return thin


def _compacted(mesh: SkinnedMesh, triangles: npt.NDArray[np.int32]) -> SkinnedMesh:
    """Return the mesh with only the vertices that triangles use; each belongs to one part."""
    part = np.zeros(len(mesh.vertices_m), dtype=np.uint8)
    material = np.zeros(len(mesh.vertices_m), dtype=np.uint8)
    for k in range(3):
        part[mesh.triangles[:, k]] = mesh.triangle_part
        material[mesh.triangles[:, k]] = mesh.triangle_material
    used, indices = np.unique(triangles, return_inverse=True)
    thin = _copies(mesh, used.astype(np.int64))
    return replace(
        thin,
        triangles=indices.reshape(-1, 3).astype(np.int32),
        triangle_part=part[triangles[:, 0]],
        triangle_material=material[triangles[:, 0]],
    )
