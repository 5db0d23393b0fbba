"""Let cloth hang: garments are cut wider than the body and fall into folds under their weight.

The solver is extended position-based dynamics with small steps (Macklin, Müller and Chentanez 2016;
Macklin et al. 2019): one pass over all constraints a step, many short steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, cKDTree

from character_making.makehuman import Indices
from character_making.pieces import Piece, vertex_normals
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector, unit

_STEP_S = 1 / 400
_STEPS, _TOUCHES = 640, 40
"""Steps in all, and how often the nearest places of the body are looked up."""
_GRAVITY_M_S2 = 9.81
_DRAG_PER_S = 6.0
_SLICE_M = 0.012
_AROUND, _MIN_POINTS = 90, 8
_SEWN_M, _NEAR_M, _LIMB_SHARE = 0.07, 0.05, 0.3


@dataclass(frozen=True)
class Fabric:
    """How a cloth falls: `ease` is what it is longer by than the shape it is cut to, around and
    along; `bend` how soft it bends, in metres per newton (0 not at all).
    """

    ease_around: float = 0.05
    ease_along: float = 0.03
    bend: float = 2.0


@compiled
def _settled(
    place: Vector,
    weight: Vector,
    pairs: Indices,
    rest: Vector,
    soft: Vector,
    body: Vector,
    outward: Vector,
    clearance: Vector,
    speed: Vector,
    steps: int,
    step_s: float,
    gravity: float,
    drag: float,
) -> None:
    """Move `place` (v, 3) and `speed` on by some steps; where `weight` is 0 nothing moves."""
    before = np.empty_like(place)
    for _ in range(steps):
        for i in range(len(place)):
            for k in range(3):
                before[i, k] = place[i, k]
            if weight[i] > 0:
                speed[i, 1] -= gravity * step_s
                for k in range(3):
                    place[i, k] += speed[i, k] * step_s
        for c in range(len(pairs)):
            a, b = pairs[c, 0], pairs[c, 1]
            total = weight[a] + weight[b]
            if total == 0:
                continue
            x = place[a, 0] - place[b, 0]
            y = place[a, 1] - place[b, 1]
            z = place[a, 2] - place[b, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length < 1e-9:
                continue
            away = (length - rest[c]) / (total + soft[c] / (step_s * step_s)) / length
            for k, d in enumerate((x, y, z)):
                place[a, k] -= weight[a] * away * d
                place[b, k] += weight[b] * away * d
        for i in range(len(place)):
            if weight[i] == 0:
                continue
            high = 0.0
            for k in range(3):
                high += (place[i, k] - body[i, k]) * outward[i, k]
            if high < clearance[i]:
                for k in range(3):
                    # Cloth that lies on the body is held by it.
                    place[i, k] = 0.4 * place[i, k] + 0.6 * before[i, k]
                high = 0.0
                for k in range(3):
                    high += (place[i, k] - body[i, k]) * outward[i, k]
                for k in range(3):
                    place[i, k] += max(clearance[i] - high, 0.0) * outward[i, k]
        for i in range(len(place)):
            for k in range(3):
                speed[i, k] = (place[i, k] - before[i, k]) / step_s * (1 - drag * step_s)


def draped(
    piece: Piece,
    bodies: Sequence[Piece],
    held: npt.NDArray[np.bool_],
    along: Vector,
    limb: npt.NDArray[np.bool_],
    fabric: Fabric,
    clearance_m: Vector,
    seed: int,
) -> Vector:
    """Return where the vertices (v, 3) of a cloth come to rest.

    `held` (v,) stay where they are; `along` (v, 3) is the way its threads run down the trunk and
    down limbs, where `limb` (v,) is true; each vertex keeps `clearance_m` (v,) from all `bodies`.
    """
    rng = np.random.default_rng(seed)
    normals = vertex_normals(piece.vertices_m, piece.triangles)
    edges, across = _edges(piece.triangles)
    place = piece.vertices_m + 0.002 * rng.normal(size=(len(normals), 1)) * normals
    place[held] = piece.vertices_m[held]
    way = piece.vertices_m[edges[:, 0]] - piece.vertices_m[edges[:, 1]]
    length = np.linalg.norm(way, axis=1)
    share = np.sum(unit(way) * unit(along[edges].mean(axis=1)), axis=1) ** 2
    around = np.where(limb[edges].all(axis=1), _LIMB_SHARE, 1.0) * fabric.ease_around
    loose = share * fabric.ease_along + (1 - share) * around
    if held.any():
        # Where it is sewn it is as wide as cut: no ruffles at cuffs and necklines.
        away, _ = cKDTree(piece.vertices_m[held]).query(piece.vertices_m)
        free_m = np.asarray(away, dtype=np.float64)
        loose = loose * np.clip(free_m[edges].mean(axis=1) / _SEWN_M, 0, 1)
    eased = length * (1 + loose)
    apart = np.linalg.norm(piece.vertices_m[across[:, 0]] - piece.vertices_m[across[:, 1]], axis=1)
    weight = np.where(held, 0.0, 1.0)
    pairs = np.concatenate([edges, across])
    # Neighbours first by chance: no direction of the mesh is pulled before another.
    order = rng.permutation(len(pairs))
    rest = np.concatenate([eased, apart * (1 + fabric.ease_around / 2)])[order]
    soft = np.concatenate([np.full(len(edges), 2e-7), np.full(len(across), 1e-5 * fabric.bend)])
    speed = np.zeros_like(place)
    outside = [Outside(body.vertices_m, body.triangles) for body in bodies]
    for _ in range(_TOUCHES):
        near, outward = _nearest(outside, place)
        _settled(
            place,
            weight,
            pairs[order],
            rest,
            soft[order],
            near,
            outward,
            clearance_m,
            speed,
            _STEPS // _TOUCHES,
            _STEP_S,
            _GRAVITY_M_S2,
            _DRAG_PER_S,
        )
    return place


class Outside:
    """The surface of a body, to be asked for its plane near points."""

    def __init__(self, vertices_m: Vector, triangles: Indices) -> None:
        self._points = vertices_m
        self._normals = vertex_normals(vertices_m, triangles)
        self._tree = cKDTree(vertices_m)

    def planes(self, points: Vector) -> tuple[Vector, Vector]:
        """Return places on the surface and unit normals (n, 3) near points (n, 3)."""
        _, near = self._tree.query(points, k=4)
        return self._points[near].mean(axis=1), unit(self._normals[near].mean(axis=1))

    def held(self, points: Vector, most_m: float | Vector) -> Vector:
        """Return points (n, 3) moved towards the surface until they are off it by so much at
        most.
        """
        place, normal = self.planes(points)
        off_m = np.sum((points - place) * normal, axis=1)
        moved: Vector = points - np.maximum(off_m - most_m, 0)[:, None] * normal
        return moved


def _nearest(bodies: Sequence[Outside], points: Vector) -> tuple[Vector, Vector]:
    """Return of all bodies' planes those that points (v, 3) are least outside of."""
    place, outward = bodies[0].planes(points)
    for body in bodies[1:]:
        other, normal = body.planes(points)
        lower = np.sum((points - other) * normal, axis=1) < np.sum(
            (points - place) * outward, axis=1
        )
        # Far from that body its planes say nothing.
        lower &= np.linalg.norm(points - other, axis=1) < _NEAR_M
        place[lower], outward[lower] = other[lower], normal[lower]
    return place, outward


def _edges(triangles: Indices) -> tuple[Indices, Indices]:
    """Return all edges (e, 2), and the pairs of corners that face each other across one."""
    wide = int(triangles.max()) + 1
    corners = np.concatenate([triangles[:, [k, (k + 1) % 3, (k + 2) % 3]] for k in range(3)])
    keys = corners[:, :2].min(axis=1) * wide + corners[:, :2].max(axis=1)
    order = np.argsort(keys, kind="stable")
    keys, corners = keys[order], corners[order]
    unique = np.unique(keys)
    twice = np.flatnonzero(keys[:-1] == keys[1:])
    across = np.stack([corners[twice, 2], corners[twice + 1, 2]], axis=1)
    edges = np.stack([unique // wide, unique % wide], axis=1)
    return edges.astype(np.int64), across.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Mantle:
    """What a cloth hangs on, hollows bridged: how far it reaches from an upright axis, `reach_m`
    (n, `_AROUND`) by height from `high_m` down to `low_m` and by angle.
    """

    axis_m: Vector
    high_m: float
    low_m: float
    reach_m: Vector

    def around(self, points_m: Vector, moves_01: Vector) -> Vector:
        """Return points (v, 3) moved on to the mantle, as far as each moves (v,)."""
        d = points_m - self.axis_m
        radius = np.hypot(d[:, 0], d[:, 2])
        n = len(self.reach_m)
        down = (self.high_m - points_m[:, 1]) / max(self.high_m - self.low_m, 1e-9)
        row = np.clip(down * (n - 1), 0, n - 1.001)
        column = (np.arctan2(d[:, 0], d[:, 2]) + np.pi) / (2 * np.pi) * _AROUND % _AROUND
        i, j = row.astype(np.int64), column.astype(np.int64)
        s, t, k = row - i, column - j, (j + 1) % _AROUND
        r = self.reach_m
        upper, lower = ((1 - t) * r[at, j] + t * r[at, k] for at in (i, i + 1))
        wished = (1 - s) * upper + s * lower
        grow = moves_01 * (wished - radius) / np.maximum(radius, 1e-6)
        moved = points_m.copy()
        moved[:, [0, 2]] += grow[:, None] * d[:, [0, 2]]
        return moved


def mantle_over(
    points_m: Vector, axis_m: Vector, counted: npt.NDArray[np.bool_], inward: float, top_m: float
) -> Mantle:
    """Return what a cloth over points (v, 3) hangs on.

    Each level slice of those that are `counted` (v,) is its convex hull; below `top_m` cloth falls
    from what is above and turns inwards by at most `inward` metres a metre.
    """
    d = points_m - axis_m
    low, high = points_m[counted, 1].min(), points_m[counted, 1].max()
    n = max(int((high - low) / _SLICE_M), 2)
    heights = np.linspace(high, low, n)
    at = np.linspace(-np.pi, np.pi, _AROUND, endpoint=False)
    towards = np.stack([np.sin(at), np.cos(at)], axis=1)
    reach = np.zeros((n, _AROUND))
    for i, y in enumerate(heights):
        mine = counted & (np.abs(points_m[:, 1] - y) < _SLICE_M)
        flat = d[mine][:, [0, 2]]
        if len(flat) < _MIN_POINTS:
            reach[i] = reach[i - 1]
            continue
        sides = ConvexHull(flat).equations
        facing = towards @ sides[:, :2].T
        far = np.where(facing > 1e-6, -sides[:, 2] / np.maximum(facing, 1e-6), np.inf)
        reach[i] = np.clip(far.min(axis=1), 0.0, np.hypot(flat[:, 0], flat[:, 1]).max())
        if i and y < top_m:
            reach[i] = np.maximum(reach[i], reach[i - 1] - inward * (heights[i - 1] - y))
    for _ in range(2):
        reach = 0.5 * reach + 0.25 * (np.roll(reach, 1, axis=1) + np.roll(reach, -1, axis=1))
    return Mantle(axis_m, float(high), float(low), reach)
