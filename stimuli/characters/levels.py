"""Lighter copies of a mesh: every tagged part is thinned by itself, so no part grows or shrinks."""

import ctypes
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.character import Morph, SkinnedMesh
from stimuli.characters.errors import CharacterError

LEVEL_TRIANGLES = (26000, 6000, 2000)
_FACE = {PART_INDEX["face"]: 1.6, PART_INDEX["left_eye"]: 1.0, PART_INDEX["right_eye"]: 1.0}


def thinned(mesh: SkinnedMesh, n_triangles: int) -> SkinnedMesh:
    """Return the mesh with about n_triangles; borders between parts keep their vertices.

    Raises:
        CharacterError: the library that thins meshes is not installed.
    """
    total = len(mesh.triangles)
    if total <= n_triangles:
        return mesh
    groups = mesh.triangle_part.astype(np.int64) * 256 + mesh.triangle_material
    unique, counts = np.unique(groups, return_counts=True)
    importance = np.array([_FACE.get(int(g) // 256, 1.0) for g in unique])
    share = counts * importance
    wanted = np.minimum(np.maximum(share / share.sum() * n_triangles, 8), counts)
    locked = _between_groups(mesh, groups)
    kept_triangles, kept_groups = [], []
    for group, n in zip(unique, wanted, strict=True):
        triangles = mesh.triangles[groups == group]
        thin = _thin(mesh, triangles, int(n), locked)
        kept_triangles.append(thin)
        kept_groups.append(np.full(len(thin), group))
    return _compacted(mesh, np.concatenate(kept_triangles), np.concatenate(kept_groups))


def _between_groups(mesh: SkinnedMesh, groups: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Tell which vertices (v,) stand where two groups meet, copies at seams included."""
    places = np.round(mesh.vertices_m * 1e5).astype(np.int64)
    _, place = np.unique(places, axis=0, return_inverse=True)
    corners = place.ravel()[mesh.triangles]
    n = int(place.max()) + 1
    low, high = np.full(n, 1 << 40), np.full(n, -1)
    for k in range(3):
        np.minimum.at(low, corners[:, k], groups)
        np.maximum.at(high, corners[:, k], groups)
    between: npt.NDArray[np.bool_] = (low != high)[place.ravel()]
    return between


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
    weights = [0.02, 0.02, 0.02, 0.03, 0.03, 0.03]
    if mesh.uv is not None:
        attributes.append(mesh.uv[used])
        weights += [0.02, 0.02]
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


def _compacted(
    mesh: SkinnedMesh, triangles: npt.NDArray[np.int32], groups: npt.NDArray[np.int64]
) -> SkinnedMesh:
    """Return the mesh with only the vertices that triangles use."""
    used, indices = np.unique(triangles, return_inverse=True)
    new = np.full(len(mesh.vertices_m), -1, dtype=np.int32)
    new[used] = np.arange(len(used), dtype=np.int32)
    morphs = {}
    for name, morph in mesh.morphs.items():
        stays = new[morph.vertices] >= 0
        morphs[name] = Morph(new[morph.vertices[stays]], morph.delta_m[stays])
    return replace(
        mesh,
        vertices_m=mesh.vertices_m[used],
        normals=mesh.normals[used],
        colour_srgb=mesh.colour_srgb[used],
        uv=None if mesh.uv is None else mesh.uv[used],
        joints=mesh.joints[used],
        weights=mesh.weights[used],
        triangles=indices.reshape(-1, 3).astype(np.int32),
        triangle_part=(groups // 256).astype(np.uint8),
        triangle_material=(groups % 256).astype(np.uint8),
        morphs=morphs,
    )
