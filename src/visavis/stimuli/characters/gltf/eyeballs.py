"""Eyeballs without eye bones, as in many of Mixamo's figures: found by their shape."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.eyes import (
    MAX_RADIUS_M,
    MIN_RADIUS_M,
    STANDS_BY,
    balls_on,
    fit_sphere,
)
from visavis.stimuli.characters.gltf.figure import Figure, Surface
from visavis.stimuli.characters.gltf.file import GltfFile

MIN_POINTS = 24
MAX_UNROUND = 0.03
"""Largest median distance of a ball's points from the sphere, as a share of its radius."""
MIN_BETWEEN_M, MAX_BETWEEN_M = 0.035, 0.1
"""Range of the distance between two eyes."""
MAX_ASKEW_M = 0.005
"""Largest distance of one eye from the mirror image of the other."""
ROUND_ABOUT = 1.15
"""Within so many radii of an eyeball's centre everything, such as a cornea, belongs to that eye."""
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Piece:
    """A connected piece of a surface: the surface's number and the piece's points."""

    surface: int
    points: Indices
    centre_m: Vector
    radius_m: float


def with_eyeballs(file: GltfFile, figure: Figure) -> Figure:
    """Return the figure with both eyes on bones of their own.

    Where no ball hangs on an eye bone, two alike balls on the head are eyes, each on a new bone.

    Raises:
        CharacterError: an eye has no bone, and there are no two such balls.
    """
    if all(balls_on(figure, side) for side in ("left", "right")):
        return figure
    pieces = list(_pieces(figure))
    pair = _pair(figure, pieces)
    if pair is not None:
        return _hang_eyes(figure, pieces, pair)
    missing = [f"{s}_eye" for s in ("left", "right") if f"{s}_eye" not in figure.bone_of]
    if missing:
        raise CharacterError(
            f"{file.path}: no bone for {' and '.join(missing)}, and no two eyeballs on the head; "
            "add eye bones (LeftEye, RightEye) below the head, each eyeball bound to its own, say "
            f"with --joint-map FILE which they are, {STANDS_BY}"
        )
    return figure


def _pieces(figure: Figure) -> Iterator[_Piece]:
    """Find what hangs together on the head and is no larger than an eyeball may be."""
    head = _below(figure, figure.bone_of["head"])
    for k, surface in enumerate(figure.surfaces):
        share = (surface.weights * head[surface.joints]).sum(axis=1)
        if share.max(initial=0.0) < 0.5:
            continue
        for points in _parts(surface):
            at = surface.vertices_m[points]
            if share[points].mean() > 0.5 and np.ptp(at, axis=0).max() < 2.2 * MAX_RADIUS_M:
                yield _Piece(k, points, *fit_sphere(at))


def _below(figure: Figure, top: int) -> npt.NDArray[np.bool_]:
    """Return which nodes are `top` or below it."""
    is_below = np.zeros(len(figure.names), dtype=bool)
    for node in range(len(is_below)):
        at = node
        while at not in (top, -1):
            at = int(figure.parents[at])
        is_below[node] = at == top
    return is_below


def _parts(surface: Surface) -> list[Indices]:
    """Return the points of each part of a surface; what lies in one place hangs together."""
    _, same = np.unique(np.round(surface.vertices_m, 5), axis=0, return_inverse=True)
    same = same.reshape(-1)
    n = int(same.max()) + 1
    corners = same[surface.triangles]
    edges = np.concatenate([corners[:, :2], corners[:, 1:]])
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    part = connected_components(graph, directed=False)[1][same]
    order = np.argsort(part, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(part[order])) + 1)


def _pair(figure: Figure, pieces: list[_Piece]) -> tuple[_Piece, _Piece] | None:
    """Return the largest two balls that lie as a left and a right eye do."""
    head = figure.at_m[figure.bone_of["head"]]
    balls = [piece for piece in pieces if _is_ball(figure, piece)]
    best: tuple[_Piece, _Piece] | None = None
    for left in balls:
        for right in balls:
            a, b = left.centre_m - head, right.centre_m - head
            same_size = 0.95 < left.radius_m / right.radius_m < 1.05
            level = np.abs(a * [-1.0, 1.0, 1.0] - b).max() < MAX_ASKEW_M
            ahead = max(a[2], b[2]) < 0.0 < min(a[1], b[1])
            if same_size and level and ahead and MIN_BETWEEN_M < b[0] - a[0] < MAX_BETWEEN_M:
                if best is None or left.radius_m > best[0].radius_m:
                    best = left, right
    return best


def _is_ball(figure: Figure, piece: _Piece) -> bool:
    at = figure.surfaces[piece.surface].vertices_m[piece.points]
    away = np.abs(np.linalg.norm(at - piece.centre_m, axis=1) - piece.radius_m)
    large = MIN_RADIUS_M < piece.radius_m < MAX_RADIUS_M and len(at) >= MIN_POINTS
    return bool(large and np.median(away) < MAX_UNROUND * piece.radius_m)


def _hang_eyes(figure: Figure, pieces: list[_Piece], pair: tuple[_Piece, _Piece]) -> Figure:
    """Return the figure with a new bone for each eye, and on it the ball and what is about it."""
    n = len(figure.names)
    surfaces = list(figure.surfaces)
    for node, eye in enumerate(pair, start=n):
        for piece in pieces:
            surface = surfaces[piece.surface]
            away = np.linalg.norm(surface.vertices_m[piece.points] - eye.centre_m, axis=1)
            if away.max() < ROUND_ABOUT * eye.radius_m:
                joints, weights = surface.joints.copy(), surface.weights.copy()
                joints[piece.points, 0] = node
                weights[piece.points] = np.eye(weights.shape[1])[0]
                surfaces[piece.surface] = replace(surface, joints=joints, weights=weights)
    head = figure.bone_of["head"]
    return Figure(
        (*figure.names, "left eye, found by its shape", "right eye, found by its shape"),
        np.append(figure.parents, [head, head]),
        np.vstack([figure.at_m, *(eye.centre_m for eye in pair)]),
        {**figure.bone_of, "left_eye": n, "right_eye": n + 1},
        tuple(surfaces),
    )
