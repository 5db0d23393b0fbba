"""The surface of a posed person: linear blend skinning with the face's shapes."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.stimuli.characters.character import MORPHS, Character, SkinnedMesh
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.motion.rotations import matrix_of_quat
from visavis.stimuli.motion.skeleton import Placement, Skeleton

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Skin:
    """A posed surface in world: `vertices_m` and unit `normals` (v, 3)."""

    vertices_m: Floats
    normals: Floats


@compiled
def _blend(
    rest: Floats,
    normals: Floats,
    joints: npt.NDArray[np.uint8],
    weights: Floats,
    matrices: Floats,
    vertices_out: Floats,
    normals_out: Floats,
    with_normals: bool,
) -> None:
    for v in range(rest.shape[0]):
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        # Linear blend skinning by up to four joints; normals turn by the same matrices, without the
        # translation, and are normalised after.
        px = py = pz = np.float32(0)
        nx = ny = nz = np.float32(0)
        for k in range(4):
            w = weights[v, k]
            if w == 0:
                continue
            m = matrices[joints[v, k]]
            px += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            py += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            pz += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
            if with_normals:
                a, b, c = normals[v, 0], normals[v, 1], normals[v, 2]
                nx += w * (m[0, 0] * a + m[0, 1] * b + m[0, 2] * c)
                ny += w * (m[1, 0] * a + m[1, 1] * b + m[1, 2] * c)
                nz += w * (m[2, 0] * a + m[2, 1] * b + m[2, 2] * c)
        vertices_out[v, 0], vertices_out[v, 1], vertices_out[v, 2] = px, py, pz
        if with_normals:
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0:
                nx, ny, nz = nx / length, ny / length, nz / length
            normals_out[v, 0], normals_out[v, 1], normals_out[v, 2] = nx, ny, nz


def bone_matrices(skeleton: Skeleton, placement: Placement) -> Floats:
    """Return the moves (n, 3, 4) that take points at rest to world, one a joint.

    `placement` has positions (n, 3) and orientations (n, 4).
    """
    n = len(skeleton.names)
    if placement.position_m.shape != (n, 3):
        raise CharacterError(
            f"placement of shape {placement.position_m.shape} for {n} joints; pass one person's"
        )
    turns = matrix_of_quat(placement.orientation_wxyz)
    shift = placement.position_m - np.einsum("jab,jb->ja", turns, skeleton.rest_m)
    return np.concatenate([turns, shift[..., None]], axis=-1).astype(np.float32)


def shaped_m(mesh: SkinnedMesh, morphs_01: npt.ArrayLike | None) -> Floats:
    """Return the vertices at rest with the face's shapes, weights in the order of `MORPHS`."""
    if morphs_01 is None:
        return mesh.vertices_m
    weights = np.asarray(morphs_01, dtype=np.float32)
    if weights.shape != (len(MORPHS),):
        raise CharacterError(f"{weights.shape} weights of shapes; give {len(MORPHS)}, as MORPHS")
    if not weights.any():
        return mesh.vertices_m
    vertices = mesh.vertices_m.copy()
    for name, weight in zip(MORPHS, weights, strict=True):
        if weight and name in mesh.morphs:
            morph = mesh.morphs[name]
            vertices[morph.vertices] += weight * morph.delta_m
    return vertices


def skin(
    mesh: SkinnedMesh,
    skeleton: Skeleton,
    placement: Placement,
    morphs_01: npt.ArrayLike | None = None,
) -> Skin:
    """Return vertices and normals of one posed person in world."""
    rest = shaped_m(mesh, morphs_01)
    vertices, normals = np.empty_like(mesh.vertices_m), np.empty_like(mesh.normals)
    matrices = bone_matrices(skeleton, placement)
    _blend(rest, mesh.normals, mesh.joints, mesh.weights, matrices, vertices, normals, True)
    return Skin(vertices, normals)


def skin_vertices(
    mesh: SkinnedMesh,
    skeleton: Skeleton,
    placement: Placement,
    morphs_01: npt.ArrayLike | None = None,
    out: Floats | None = None,
) -> Floats:
    """Return vertices (v, 3) alone, written into `out` when given: for collisions and warping."""
    vertices = np.empty_like(mesh.vertices_m) if out is None else out
    matrices = bone_matrices(skeleton, placement)
    rest = shaped_m(mesh, morphs_01)
    _blend(rest, mesh.normals, mesh.joints, mesh.weights, matrices, vertices, vertices, False)
    return vertices


def skin_of(character: Character, placement: Placement, level: int = 0) -> Skin:
    """Return the posed surface of a character at one level of detail."""
    return skin(character.levels[level], character.skeleton, placement)
