"""The copy of a person that measures are taken from: every part is seen as large as in the full
mesh. It is bent for that and never shown; what is shown keeps the looks (`levels`).
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX, PARTS
from visavis.stimuli.characters.character import SkinnedMesh
from visavis.stimuli.characters.coverage import seen_areas_m2

MEASURING_TRIANGLES = (6000, 2000)
_EYES = (PART_INDEX["left_eye"], PART_INDEX["right_eye"])
_LID_M = 0.006
_MIN_M2 = 5e-4
"""Parts that are seen smaller than this on average are not matched; eyes always are."""
_GOOD = 0.012
_PROBE_M, _PROBE_STEP_M, _STEP_M, _MAX_M, _DAMPING = 0.002, 0.004, 0.004, 0.014, 400.0
Indices = npt.NDArray[np.int64]


def match_areas(thin: SkinnedMesh, full: SkinnedMesh, rounds: int = 8) -> SkinnedMesh:
    """Move the surface of a thinned mesh out or in until parts are seen as large as in the full.

    Thinning cuts corners off round limbs; a millimetre or two along the normals gives them back.
    How each part's surface changes what is seen of all parts (a collar hides the neck) is
    measured, and the smallest moves that mend all of them are made.
    """
    full_areas_m2 = seen_areas_m2(full)
    parts = np.flatnonzero(
        full_areas_m2 > np.where(np.isin(np.arange(len(PARTS)), _EYES), 2e-5, _MIN_M2)
    )
    movable_parts = range(1, len(PARTS))
    normals, place, uses = _shared_normals(thin)
    ways = uses[:, :, None] * normals[:, None]
    for eye in _EYES:
        ways[:, eye] = _opening(thin, place, eye, len(uses))
    sides = np.zeros(len(PARTS))

    def errors(sides: Vector, step_m: float = 0.002) -> tuple[Vector, npt.NDArray[np.float32]]:
        out = np.einsum("vpk,p->vk", ways, sides)
        vertices = (thin.vertices_m + out[place]).astype(np.float32)
        return seen_areas_m2(thin, vertices, step_m)[parts] / full_areas_m2[parts] - 1, vertices

    error, best = errors(sides)
    for _ in range(rounds):
        if np.abs(error).max(initial=0.0) < _GOOD:
            break
        coarse = errors(sides, _PROBE_STEP_M)[0]
        slopes = np.zeros((len(parts), len(PARTS)))
        for p in movable_parts:
            probe = sides.copy()
            probe[p] += _PROBE_M
            slopes[:, p] = (errors(probe, _PROBE_STEP_M)[0] - coarse) / _PROBE_M
        damped_matrix = slopes.T @ slopes + _DAMPING * np.eye(len(PARTS))
        step = np.clip(-np.linalg.solve(damped_matrix, slopes.T @ error), -_STEP_M, _STEP_M)
        trials = []
        for k in (1.0, 0.5, 0.25):
            s = np.clip(sides + k * step, -_MAX_M, _MAX_M)
            e, v = errors(s)
            trials.append((np.abs(e).max(), s, e, v))
            if trials[-1][0] < np.abs(error).max():
                break
        worst, s, e, v = min(trials, key=lambda row: float(row[0]))
        if worst >= np.abs(error).max():
            break
        sides, error, best = s, e, v
    return replace(thin, vertices_m=best)


def worst_area_error(thin: SkinnedMesh, full: SkinnedMesh) -> float:
    """Return the largest share by which a part is seen larger or smaller than in the full mesh."""
    full_areas_m2 = seen_areas_m2(full)
    parts = np.flatnonzero(full_areas_m2 > _MIN_M2)
    return float(np.abs(seen_areas_m2(thin)[parts] / full_areas_m2[parts] - 1).max(initial=0.0))


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
