"""Close and orient triangle meshes where that cannot change the body."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from visavis.analysis.collisions.errors import MalformedMesh, NotOrientable, OpenMesh
from visavis.lab.geometry import Vector

Faces = npt.NDArray[np.int32]
Edge = tuple[int, int]

NOTHING_01 = 1e-14
"""A surface with less volume than this share of its size cubed encloses nothing: rounding alone."""


def repaired_faces(
    vertices_m: Vector, faces: Faces, name: str, largest_hole_m: float
) -> tuple[Faces, tuple[str, ...]]:
    """Return closed, outward faces and what was changed.

    Raises OpenMesh, NotOrientable, or MalformedMesh when nothing is enclosed.
    """
    repairs: list[str] = []
    faces = _with_equal_corners_joined(vertices_m, faces, repairs)
    faces = _without_collapsed(faces, name, repairs)
    faces = _one_sided(faces, repairs)
    if _has_unpaired_edges(faces):
        faces = _agreeing(faces, name, repairs)
        faces = _without_holes(vertices_m, faces, name, largest_hole_m, repairs)
    faces = _outward(vertices_m, faces, name, repairs)
    return np.ascontiguousarray(faces, dtype=np.int32), tuple(repairs)


def _with_equal_corners_joined(vertices_m: Vector, faces: Faces, repairs: list[str]) -> Faces:
    _, first, inverse = np.unique(vertices_m + 0.0, axis=0, return_index=True, return_inverse=True)
    corners = np.unique(faces)
    keep = first[inverse.reshape(-1)]
    n_joined = int((keep[corners] != corners).sum())
    if n_joined == 0:
        return faces
    repairs.append(f"joined {n_joined} vertices at equal places")
    with_shared_corners: Faces = keep[faces].astype(np.int32)
    return with_shared_corners


def _without_collapsed(faces: Faces, name: str, repairs: list[str]) -> Faces:
    a, b, c = faces.T
    is_collapsed = (a == b) | (b == c) | (c == a)
    if is_collapsed.all():
        raise MalformedMesh(f"{name}: no face has three different corners; export it again")
    if not is_collapsed.any():
        return faces
    repairs.append(f"dropped {int(is_collapsed.sum())} collapsed faces")
    rest: Faces = faces[~is_collapsed]
    return rest


def _one_sided(faces: Faces, repairs: list[str]) -> Faces:
    """Keep one face of every back-to-back pair, if all faces are in such pairs.

    A surface drawn from both sides has winding number zero everywhere, so it encloses nothing.
    """
    corners, which = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    which = which.reshape(-1)
    least = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    follows, before = faces[rows, (least + 1) % 3], faces[rows, (least + 2) % 3]
    turn = np.where(follows < before, 1, -1)
    up = np.bincount(which, weights=turn > 0, minlength=len(corners))
    down = np.bincount(which, weights=turn < 0, minlength=len(corners))
    if not (up == down).all():
        return faces
    repairs.append(f"kept one side of {len(corners)} faces that were there from both")
    first = np.unique(which, return_index=True)[1]
    one_side: Faces = faces[np.sort(first)]
    return one_side


def _directed_edges(faces: Faces) -> npt.NDArray[np.int64]:
    """Return (3 m, 2) directed edges, face by face."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)


def _balance(faces: Faces) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return undirected edges (k, 2) and how often each runs up minus down, (k,)."""
    edges_of_faces = _directed_edges(faces)
    up = np.where(edges_of_faces[:, 0] < edges_of_faces[:, 1], 1, -1)
    edges, inverse = np.unique(np.sort(edges_of_faces, axis=1), axis=0, return_inverse=True)
    return edges, np.bincount(inverse.reshape(-1), weights=up).astype(np.int64)


def _has_unpaired_edges(faces: Faces) -> bool:
    return bool(_balance(faces)[1].any())


def _agreeing(faces: Faces, name: str, repairs: list[str]) -> Faces:
    """Turn faces so that neighbours across an edge of two faces run it in opposite directions."""
    edges = _directed_edges(faces)
    _, inverse, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    inverse = inverse.reshape(-1)
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in faces]
    order = np.argsort(inverse, kind="stable")
    starts = np.cumsum(count) - count
    for start in starts[count == 2]:
        i, j = order[start], order[start + 1]
        same = bool((edges[i] == edges[j]).all())
        neighbours[i // 3].append((int(j // 3), same))
        neighbours[j // 3].append((int(i // 3), same))
    is_turned = np.full(len(faces), -1, np.int8)
    for seed in range(len(faces)):
        if is_turned[seed] >= 0:
            continue
        is_turned[seed] = 0
        waiting = [seed]
        patch = [seed]
        while waiting:
            face = waiting.pop()
            for other, same in neighbours[face]:
                must_turn = is_turned[face] ^ same
                if is_turned[other] < 0:
                    is_turned[other] = must_turn
                    waiting.append(other)
                    patch.append(other)
                elif is_turned[other] != must_turn:
                    raise NotOrientable(
                        f"{name}: faces {face} and {other} cannot both face outward; "
                        "the surface has no inside, repair it in a modelling program"
                    )
        if 2 * int(is_turned[patch].sum()) > len(patch):
            is_turned[patch] ^= 1
    flip = is_turned == 1
    if flip.any():
        repairs.append(f"turned {int(flip.sum())} faces to agree with their neighbours")
        faces = faces.copy()
        faces[flip] = faces[flip][:, ::-1]
    return faces


def _without_holes(
    vertices_m: Vector, faces: Faces, name: str, largest_hole_m: float, repairs: list[str]
) -> Faces:
    """Close small holes by fans between existing vertices, so that every pose closes them too."""
    edges, balance = _balance(faces)
    after: dict[int, list[int]] = {}
    single = balance != 0
    for (a, b), up in zip(edges[single].tolist(), balance[single].tolist(), strict=True):
        start, end = (b, a) if up > 0 else (a, b)  # the missing face runs the other way
        after.setdefault(start, []).extend([end] * abs(up))
    new_faces = []
    n_holes = 0
    while after:
        loop = _take_loop(after)
        ring = vertices_m[loop]
        perimeter = float(np.linalg.norm(ring - np.roll(ring, -1, axis=0), axis=1).sum())
        if perimeter > largest_hole_m or len(loop) < 3:
            x, y, z = ring.mean(axis=0)
            raise OpenMesh(
                f"{name}: a hole of {len(loop)} edges and {perimeter:.3f} m perimeter near "
                f"({x:.3f}, {y:.3f}, {z:.3f}); close it in a modelling program, or allow larger "
                "holes to be closed (largest_hole_m)"
            )
        new_faces += [[loop[0], loop[i], loop[i + 1]] for i in range(1, len(loop) - 1)]
        n_holes += 1
    if n_holes:
        repairs.append(f"closed {n_holes} holes with {len(new_faces)} faces")
        faces = np.concatenate([faces, np.array(new_faces, np.int32)])
    return faces


def _take_loop(after: dict[int, list[int]]) -> list[int]:
    """Take one loop without repeated vertices out of the edges that miss a face."""
    path = [next(iter(after))]
    at = {path[0]: 0}
    while True:
        follow = after[path[-1]].pop()
        if not after[path[-1]]:
            del after[path[-1]]
        if follow in at:
            begin = at[follow]
            for a, b in pairwise(path[: begin + 1]):
                after.setdefault(a, []).append(b)
            return path[begin:]
        at[follow] = len(path)
        path.append(follow)


def _outward(vertices_m: Vector, faces: Faces, name: str, repairs: list[str]) -> Faces:
    """Turn parts that are inside out, unless they are a cavity of another part."""
    n = len(vertices_m)
    pairs = _directed_edges(faces)
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, part_of_vertex = connected_components(graph, directed=False)
    part = part_of_vertex[faces[:, 0]]
    a, b, c = np.moveaxis(vertices_m[faces] - vertices_m[faces[0, 0]], 1, 0)
    volume = np.bincount(part, weights=np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)
    size_m = float(np.ptp(vertices_m[faces].reshape(-1, 3), axis=0).max())
    if (np.abs(volume) <= NOTHING_01 * size_m**3).all():
        raise MalformedMesh(
            f"{name}: the surface encloses nothing, so nothing could ever be in common with it; "
            "give it thickness in a modelling program"
        )
    present = np.unique(part)
    inside_out = [int(p) for p in present if volume[p] < 0]
    flip = np.zeros(len(faces), bool)
    solid = np.isin(part, [p for p in present if volume[p] > 0])
    for p in inside_out:
        mine = part == p
        points = vertices_m[faces[mine][:: max(1, int(mine.sum()) // 16), 0]]
        within = solid.any() and all(
            winding_number(vertices_m, faces[solid], point) > 0.5 for point in points
        )
        if not within:
            flip |= mine
    if flip.any():
        count = np.unique(part[flip]).size
        repairs.append(f"turned {count} part{'s' * (count != 1)} that faced inward")
        faces = faces.copy()
        faces[flip] = faces[flip][:, ::-1]
    return faces


def winding_number(vertices_m: Vector, faces: Faces, point_m: Vector) -> float:
    """Return how often a surface winds round a point, by solid angles (Van Oosterom 1983)."""
    a, b, c = np.moveaxis(vertices_m[faces] - point_m, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    below = la * lb * lc + ab * lc + bc * la + ca * lb
    return float(np.arctan2(above, below).sum() / (2 * np.pi))
