"""What stands in a camera's way: the triangles of a place in a tree of boxes, people as capsules.

Surfaces stop rays from both sides.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from lab.compiled import compiled
from lab.errors import DesignError
from lab.geometry import Vector
from stimuli.picture import Room
from stimuli.visibility import capsule_entry_m

LEAF_TRIANGLES: Final = 4
STACK: Final = 96
SHORTENED: Final = 1e-6
"""Share by which a sight line stops short of its end, so that what is looked at hides nothing."""
NOBODY: Final = np.empty((0, 7))
"""The capsules (c, 7) of nobody."""

Ints = npt.NDArray[np.int64]


@compiled
def _divide(low: Vector, high: Vector, order: Ints, boxes: Vector, links: Ints, leaf: int) -> int:
    """Fill a tree over boxes by halving along the longest axis; return the number of its nodes.

    `links` (n, 2): the two children, or −1 − first and count of a leaf's places in `order`.
    """
    centre = (low + high) / 2
    todo = np.empty((128, 3), np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, 0, order.shape[0]
    waiting, made = 1, 1
    while waiting > 0:
        waiting -= 1
        node, first, last = todo[waiting, 0], todo[waiting, 1], todo[waiting, 2]
        c_low, c_high = np.full(3, np.inf), np.full(3, -np.inf)
        for k in range(3):
            boxes[node, k], boxes[node, k + 3] = np.inf, -np.inf
        for i in range(first, last):
            for k in range(3):
                boxes[node, k] = min(boxes[node, k], low[order[i], k])
                boxes[node, k + 3] = max(boxes[node, k + 3], high[order[i], k])
                c_low[k] = min(c_low[k], centre[order[i], k])
                c_high[k] = max(c_high[k], centre[order[i], k])
        if last - first <= leaf:
            links[node, 0], links[node, 1] = -1 - first, last - first
            continue
        axis = np.argmax(c_high - c_low)
        some = order[first:last].copy()
        order[first:last] = some[np.argsort(centre[some, axis], kind="mergesort")]
        middle = (first + last) // 2
        links[node, 0], links[node, 1] = made, made + 1
        todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = made, first, middle
        todo[waiting + 1, 0], todo[waiting + 1, 1], todo[waiting + 1, 2] = made + 1, middle, last
        waiting += 2
        made += 2
    return made


@compiled
def ray_hit_m(
    start: Vector,
    ray: Vector,
    reach_m: float,
    first_will_do: bool,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> float:
    """Return how far along a unit ray the nearest surface is, or any when that will do; inf: none.

    `corners` (t, 9): a corner and two edges of every triangle in the order of the leaves.
    """  # fmt: skip
    ox, oy, oz = start[0], start[1], start[2]
    dx, dy, dz = ray[0], ray[1], ray[2]
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    nearest = reach_m
    found = False
    stack = np.empty(STACK, np.int64)
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        t0, t1 = 0.0, nearest
        if dx != 0.0:
            a, b = (boxes[node, 0] - ox) * ix, (boxes[node, 3] - ox) * ix
            t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
        elif ox < boxes[node, 0] or ox > boxes[node, 3]:
            continue
        if dy != 0.0:
            a, b = (boxes[node, 1] - oy) * iy, (boxes[node, 4] - oy) * iy
            t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
        elif oy < boxes[node, 1] or oy > boxes[node, 4]:
            continue
        if dz != 0.0:
            a, b = (boxes[node, 2] - oz) * iz, (boxes[node, 5] - oz) * iz
            t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
        elif oz < boxes[node, 2] or oz > boxes[node, 5]:
            continue
        if t0 > t1 + 1e-9:
            continue
        if links[node, 0] >= 0:
            stack[depth], stack[depth + 1] = links[node, 0], links[node, 1]
            depth += 2
            continue
        first = -1 - links[node, 0]
        for i in range(first, first + links[node, 1]):
            e1x, e1y, e1z = corners[i, 3], corners[i, 4], corners[i, 5]
            e2x, e2y, e2z = corners[i, 6], corners[i, 7], corners[i, 8]
            px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
            det = e1x * px + e1y * py + e1z * pz
            if abs(det) < 1e-14:
                continue
            sx, sy, sz = ox - corners[i, 0], oy - corners[i, 1], oz - corners[i, 2]
            u = (sx * px + sy * py + sz * pz) / det
            if u < 0.0 or u > 1.0:
                continue
            qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
            v = (dx * qx + dy * qy + dz * qz) / det
            if v < 0.0 or u + v > 1.0:
                continue
            t = (e2x * qx + e2y * qy + e2z * qz) / det
            if 0.0 <= t <= nearest:
                nearest = t
                found = True
                if first_will_do:
                    return float(nearest)
    return float(nearest) if found else np.inf


@compiled
def sees(a: Vector, b: Vector, people: Vector, boxes: Vector, links: Ints, corners: Vector) -> bool:
    """Tell whether nothing stands between two points (3,), neither the place nor people (c, 7)."""
    ray = b - a
    length = np.sqrt((ray * ray).sum())
    if length == 0.0:
        return True
    ray = ray / length
    reach = length * (1.0 - SHORTENED)
    for j in range(people.shape[0]):
        if capsule_entry_m(a[0], a[1], a[2], ray[0], ray[1], ray[2], people[j]) < reach:
            return False
    return bool(ray_hit_m(a, ray, reach, True, boxes, links, corners) == np.inf)


@compiled
def _triangle_distance2(p: Vector, t: Vector) -> float:
    """Return the squared distance of a point to a triangle (corner and two edges, 9)."""
    best = np.inf
    e1, e2, s = t[3:6], t[6:9], p - t[0:3]
    a, b, c = (e1 * e1).sum(), (e1 * e2).sum(), (e2 * e2).sum()
    d, e = (e1 * s).sum(), (e2 * s).sum()
    det = a * c - b * b
    if det > 0.0:
        u, v = (c * d - b * e) / det, (a * e - b * d) / det
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
            off = s - u * e1 - v * e2
            return float((off * off).sum())
    for side in range(3):
        start = e1 if side == 2 else np.zeros(3)
        along = e1 if side == 0 else (e2 if side == 1 else e2 - e1)
        length2 = (along * along).sum()
        share = 0.0
        if length2 > 0.0:
            share = min(1.0, max(0.0, ((s - start) * along).sum() / length2))
        off = s - start - share * along
        best = min(best, (off * off).sum())
    return float(best)


@compiled
def is_near(point: Vector, margin_m: float, boxes: Vector, links: Ints, corners: Vector) -> bool:
    """Tell whether a surface comes nearer to a point (3,) than a margin."""
    limit2 = margin_m * margin_m
    stack = np.empty(STACK, np.int64)
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        away2 = 0.0
        for k in range(3):
            off = max(boxes[node, k] - point[k], point[k] - boxes[node, k + 3], 0.0)
            away2 += off * off
        if away2 >= limit2:
            continue
        if links[node, 0] >= 0:
            stack[depth], stack[depth + 1] = links[node, 0], links[node, 1]
            depth += 2
            continue
        first = -1 - links[node, 0]
        for i in range(first, first + links[node, 1]):
            if _triangle_distance2(point, corners[i]) < limit2:
                return True
    return False


@dataclass(frozen=True, eq=False)
class Obstacles:
    """The surfaces of a place, packed: `boxes` (n, 6), `links` (n, 2), `corners` (t, 9)."""

    boxes: Vector
    links: Ints
    corners: Vector

    @classmethod
    def of_room(cls, room: Room) -> Self:
        """Pack everything that stands in a room."""
        return cls.of_triangles(triangles_of(room))

    @classmethod
    def of_triangles(cls, triangles_m: Vector) -> Self:
        """Pack triangles (t, 3 corners, 3).

        Raises:
            DesignError: there is none, or a corner is nowhere.
        """
        if not (len(triangles_m) and np.isfinite(triangles_m).all()):
            raise DesignError(
                f"a place of {len(triangles_m)} triangles, or with corners that are no numbers, "
                f"has nothing a camera could keep clear of; give a room with props"
            )
        order = np.arange(len(triangles_m))
        boxes = np.empty((2 * len(order) + 1, 6))
        links = np.empty((2 * len(order) + 1, 2), np.int64)
        n = _divide(
            triangles_m.min(axis=1), triangles_m.max(axis=1), order, boxes, links, LEAF_TRIANGLES
        )
        a, b, c = triangles_m[order].transpose(1, 0, 2)
        corners = np.concatenate([a, b - a, c - a], axis=1)
        return cls(boxes[:n].copy(), links[:n].copy(), np.ascontiguousarray(corners))

    @property
    def packed(self) -> tuple[Vector, Ints, Vector]:
        """What compiled code takes."""
        return self.boxes, self.links, self.corners

    def hit_m(self, start_m: Vector, direction: Vector, reach_m: float = np.inf) -> float:
        """Return how far along a unit direction (3,) the first surface is; inf when none is."""
        return float(ray_hit_m(start_m, direction, reach_m, False, *self.packed))

    def sees(self, a_m: Vector, b_m: Vector, people: Vector = NOBODY) -> bool:
        """Tell whether nothing stands between two points (3,)."""
        return bool(sees(a_m, b_m, people, *self.packed))

    def is_near(self, point_m: Vector, margin_m: float) -> bool:
        """Tell whether a surface comes nearer to a point (3,) than a margin."""
        return bool(is_near(point_m, margin_m, *self.packed))


def triangles_of(room: Room) -> Vector:
    """Return all triangles (t, 3 corners, 3) of a room in world."""
    parts = [p.mesh.vertices_m.astype(np.float64)[p.mesh.triangles] for p in room.props]
    return np.concatenate(parts) if parts else np.empty((0, 3, 3))
