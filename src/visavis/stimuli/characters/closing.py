"""One closed surface round a body made of many open ones, for measuring volumes."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter
from scipy.ndimage import label as connected
from scipy.spatial import cKDTree

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character, SkinnedMesh
from visavis.stimuli.characters.tagging import parts_of_weights
from visavis.stimuli.motion.skeleton import Skeleton

CELL_M = 0.02
"""Side of the cells a body is filled with; hollows narrower than that are closed."""


def collision_mesh(character: Character) -> SkinnedMesh:
    """Return a closed, outward body of about 15,000 triangles that is skinned like the others."""
    if character.closed is not None:
        return character.closed
    return closed_surface(character.levels[0], character.skeleton)


def is_closed(mesh: SkinnedMesh) -> bool:
    """Return whether every edge is used equally often in both directions."""
    edges = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    n = len(mesh.vertices_m)
    there, count = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    back, count_back = np.unique(edges[:, 1] * n + edges[:, 0], return_counts=True)
    return np.array_equal(there, back) and np.array_equal(count, count_back)


def volume_m3(vertices_m: npt.NDArray[np.float32], triangles: npt.NDArray[np.int32]) -> float:
    """Return the volume a closed surface holds; negative when it is inside out."""
    a, b, c = (vertices_m[triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


def closed_surface(mesh: SkinnedMesh, skeleton: Skeleton) -> SkinnedMesh:
    """Fill the body with cells and wrap them; weights come from the nearest vertices."""
    samples = _samples(mesh)
    low = samples.min(axis=0) - 3 * CELL_M
    cells = np.floor((samples - low) / CELL_M).astype(np.int64)
    shape = cells.max(axis=0) + 4
    shell = np.zeros(shape, dtype=bool)
    shell[tuple(cells.T)] = True
    spaces = np.zeros(shell.shape, dtype=np.int32)
    connected(~shell, output=spaces)
    solid = (spaces != spaces.item(0)).astype(np.float64)
    field = np.asarray(gaussian_filter(solid, 0.8)) - 0.55
    vertices, triangles = _nets(field)
    place = low + (vertices + 0.5) * CELL_M
    distance, nearest = cKDTree(samples).query(place)
    near = distance < CELL_M
    place[near] = 0.1 * place[near] + 0.9 * samples[np.asarray(nearest)[near]]
    _, source = cKDTree(mesh.vertices_m).query(place)
    a, b, c = (place[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(place)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    joints, weights = mesh.joints[source], mesh.weights[source]
    dense = np.zeros((len(place), len(skeleton.names)))
    rows = np.arange(len(place))
    for k in range(4):
        np.add.at(dense, (rows, joints[:, k]), weights[:, k])
    parts = parts_of_weights(dense, triangles, skeleton.names)
    return SkinnedMesh(
        vertices_m=place.astype(np.float32),
        normals=normals.astype(np.float32),
        colour_srgb=np.full((len(place), 3), 200, dtype=np.uint8),
        uv=None,
        joints=joints,
        weights=weights,
        triangles=triangles.astype(np.int32),
        triangle_part=parts.astype(np.uint8),
        triangle_material=np.zeros(len(triangles), dtype=np.uint8),
        morphs={},
    )


def _samples(mesh: SkinnedMesh) -> Vector:
    """Return points all over a surface, no further apart than half a cell."""
    corners = mesh.vertices_m[mesh.triangles].astype(np.float64)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.ceil(longest / (0.45 * CELL_M)).astype(np.int64)
    points = [mesh.vertices_m.astype(np.float64)]
    for n in np.unique(steps[steps > 1]):
        i, j = np.mgrid[0 : n + 1, 0 : n + 1]
        inside = i + j <= n
        u, v = i[inside] / n, j[inside] / n
        shares = np.stack([1 - u - v, u, v], axis=1)
        points.append(np.einsum("sk,tkc->tsc", shares, corners[steps == n]).reshape(-1, 3))
    return np.concatenate(points)


def _nets(field: Vector) -> tuple[Vector, npt.NDArray[np.int64]]:
    """Wrap where a field is positive: one vertex in each mixed cell, a quad over each crossing."""
    inside = field > 0
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    shape = np.array(field.shape) - 1

    def corner(values: npt.NDArray[np.generic], c: tuple[int, int, int]) -> npt.NDArray[np.generic]:
        i, j, k = c
        return values[i : i + shape[0], j : j + shape[1], k : k + shape[2]]

    count = sum(corner(inside, c).astype(np.int64) for c in corners)
    is_mixed = (np.asarray(count) > 0) & (np.asarray(count) < 8)
    number = np.full(tuple(shape), -1, dtype=np.int64)
    cells = np.argwhere(is_mixed)
    number[is_mixed] = np.arange(len(cells))
    # Surface nets: a cell's vertex is the mean of the points where its edges cross zero.
    total, weight = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a in corners:
        for axis in range(3):
            if a[axis]:
                continue
            step = [0, 0, 0]
            step[axis] = 1
            b = (a[0] + step[0], a[1] + step[1], a[2] + step[2])
            fa = corner(field, a)[is_mixed].astype(np.float64)
            fb = corner(field, b)[is_mixed].astype(np.float64)
            crosses = (fa > 0) != (fb > 0)
            t = np.where(crosses, fa / np.where(fa == fb, 1, fa - fb), 0)
            at = np.array(a) + t[:, None] * np.array(step)
            total += np.where(crosses[:, None], at, 0)
            weight += crosses
    vertices = cells + total / weight[:, None]
    quads = []
    for axis in range(3):
        others = [(axis + 1) % 3, (axis + 2) % 3]
        after = np.take(inside, range(1, field.shape[axis]), axis=axis)
        before = np.take(inside, range(field.shape[axis] - 1), axis=axis)
        # Each crossed edge is shared by four cells; their vertices make a quad that faces outwards.
        for leaves in (True, False):
            edges = np.argwhere((before & ~after) if leaves else (~before & after))
            edges = edges[(edges[:, others] > 0).all(axis=1)]
            around = []
            for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
                cell = edges.copy()
                cell[:, others[0]] += du
                cell[:, others[1]] += dv
                around.append(number[tuple(cell.T)])
            ring = np.stack(around, axis=1)
            quads.append(ring if leaves else ring[:, ::-1])
    quad = np.concatenate(quads)
    return vertices, np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
