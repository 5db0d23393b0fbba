"""Obstacles for a camera: the triangles of a place in a tree of boxes, people as capsules.

Surfaces stop rays from both sides.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import Triple
from visavis.stimuli.picture import Room
from visavis.stimuli.visibility import capsule_entry_m

LEAF_TRIANGLES: Final = 4
STACK: Final = 96
SHORTENED: Final = 1e-6
"""Share by which a sight line stops before its end, so that its target does not block it."""
NOBODY: Final = np.empty((0, 7))
"""The capsules (c, 7) of nobody."""

Ints = npt.NDArray[np.int64]


@compiled
def _divide(low: Vector, high: Vector, order: Ints, boxes: Vector, links: Ints, leaf: int) -> int:
    """Fill a tree over boxes by halving along the longest axis; return the number of its nodes.

    `links` (n, 2): the two children, or −1 − first and count of a leaf's places in `order`.
    """
    todo = np.empty((STACK, 3), np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, 0, order.shape[0]
    waiting, n_nodes = 1, 1
    while waiting > 0:
        waiting -= 1
        node, first, last = todo[waiting, 0], todo[waiting, 1], todo[waiting, 2]
        axis, widest, middle = 0, -1.0, 0.0
        for k in range(3):
            # Split where centres spread most: boxes may overlap, centres need not.
            a, b, c_low, c_high = np.inf, -np.inf, np.inf, -np.inf
            for i in range(first, last):
                a, b = min(a, low[order[i], k]), max(b, high[order[i], k])
                centre = low[order[i], k] + high[order[i], k]
                c_low, c_high = min(c_low, centre), max(c_high, centre)
            boxes[node, k], boxes[node, k + 3] = a, b
            if c_high - c_low > widest:
                axis, widest, middle = k, c_high - c_low, (c_low + c_high) / 2
        if last - first <= leaf:
            links[node, 0], links[node, 1] = -1 - first, last - first
            continue
        at = first
        for i in range(first, last):
            if low[order[i], axis] + high[order[i], axis] < middle:
                order[at], order[i] = order[i], order[at]
                at += 1
        # All in one place, or so uneven that the tree would grow deep: halve by count.
        if min(at - first, last - at) * 16 < last - first:
            at = (first + last) // 2
        links[node, 0], links[node, 1] = n_nodes, n_nodes + 1
        todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = n_nodes, first, at
        todo[waiting + 1, 0], todo[waiting + 1, 1], todo[waiting + 1, 2] = n_nodes + 1, at, last
        waiting += 2
        n_nodes += 2
    return n_nodes


@compiled
def ray_hit_m(
    origin: Triple,
    direction: Triple,
    reach_m: float,
    first_will_do: bool,
    stack: Ints,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> float:
    """Return how far along a unit ray the nearest surface is, or any when that will do; inf: none.

    `corners` (t, 9): a corner and two edges of every triangle in the order of the leaves;
    `stack` (STACK,) is room to work in.
    """
    ox, oy, oz = origin
    dx, dy, dz = direction
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    nearest = reach_m
    has_hit = False
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        # Slab test: the ray is inside the box between t0 and t1 on all three axes, if at all.
        # `nearest` shrinks with every hit, so that boxes beyond it are skipped, too.
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
            # Möller & Trumbore (1997): solve o + t d = corner + u e1 + v e2 by Cramer's rule.
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
                has_hit = True
                if first_will_do:
                    return float(nearest)
    return float(nearest) if has_hit else np.inf


@compiled
def sees_between(
    a: Triple,
    b: Triple,
    people: Vector,
    stack: Ints,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> bool:
    """Tell whether nothing stands between two points; `stack` (STACK,) is room to work in."""
    ax, ay, az = a
    dx, dy, dz = b[0] - ax, b[1] - ay, b[2] - az
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length == 0.0:
        return True
    dx, dy, dz = dx / length, dy / length, dz / length
    reach = length * (1.0 - SHORTENED)
    # People are few and cheap to test; surfaces come last.
    for j in range(people.shape[0]):
        if capsule_entry_m(ax, ay, az, dx, dy, dz, people[j]) < reach:
            return False
    return bool(ray_hit_m(a, (dx, dy, dz), reach, True, stack, boxes, links, corners) == np.inf)


@compiled
def sees(a: Vector, b: Vector, people: Vector, boxes: Vector, links: Ints, corners: Vector) -> bool:
    """Tell whether nothing stands between two points (3,), neither the place nor people (c, 7)."""
    stack = np.empty(STACK, np.int64)
    here, there = (a[0], a[1], a[2]), (b[0], b[1], b[2])
    return sees_between(here, there, people, stack, boxes, links, corners)


@compiled
def _segment_distance2(
    x: float, y: float, z: float, ax: float, ay: float, az: float
) -> float:  # of a point to the segment from the origin to a
    length2 = ax * ax + ay * ay + az * az
    share = 0.0
    if length2 > 0.0:
        share = min(1.0, max(0.0, (x * ax + y * ay + z * az) / length2))
    x, y, z = x - share * ax, y - share * ay, z - share * az
    return x * x + y * y + z * z


@compiled
def _triangle_distance2(p: Vector, t: Vector) -> float:
    """Return the squared distance of a point to a triangle (corner and two edges, 9)."""
    x, y, z = p[0] - t[0], p[1] - t[1], p[2] - t[2]
    ux, uy, uz, vx, vy, vz = t[3], t[4], t[5], t[6], t[7], t[8]
    a, b, c = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    d, e = ux * x + uy * y + uz * z, vx * x + vy * y + vz * z
    # Foot of the perpendicular in the triangle's own coordinates; outside, the nearest edge counts.
    det = a * c - b * b
    if det > 0.0:
        u, v = (c * d - b * e) / det, (a * e - b * d) / det
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
            x, y, z = x - u * ux - v * vx, y - u * uy - v * vy, z - u * uz - v * vz
            return float(x * x + y * y + z * z)
    return min(
        _segment_distance2(x, y, z, ux, uy, uz),
        _segment_distance2(x, y, z, vx, vy, vz),
        _segment_distance2(x - ux, y - uy, z - uz, vx - ux, vy - uy, vz - uz),
    )


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
        # Squared distance from the point to the node's box; a box beyond the limit is skipped.
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
        """Pack all surfaces of a room."""
        return cls.of_triangles(triangles_of(room))

    @classmethod
    def of_triangles(cls, triangles_m: Vector) -> Self:
        """Pack triangles (t, 3 corners, 3).

        Raises:
            DesignError: there is none, or a corner is nowhere.
        """
        if not (len(triangles_m) and np.isfinite(triangles_m).all()):
            raise DesignError(
                f"a place of {len(triangles_m)} triangles, or with corners that are not numbers, "
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
    def arrays(self) -> tuple[Vector, Ints, Vector]:
        """The arrays that compiled code takes."""
        return self.boxes, self.links, self.corners

    def hit_m(self, start_m: Vector, direction: Vector, reach_m: float = np.inf) -> float:
        """Return how far along a unit direction (3,) the first surface is; inf when none is."""
        (x, y, z), (dx, dy, dz) = start_m, direction
        stack = np.empty(STACK, np.int64)
        return float(ray_hit_m((x, y, z), (dx, dy, dz), reach_m, False, stack, *self.arrays))

    def sees(self, a_m: Vector, b_m: Vector, people: Vector = NOBODY) -> bool:
        """Tell whether nothing stands between two points (3,)."""
        return bool(sees(a_m, b_m, people, *self.arrays))

    def is_near(self, point_m: Vector, margin_m: float) -> bool:
        """Tell whether a surface comes nearer to a point (3,) than a margin."""
        return bool(is_near(point_m, margin_m, *self.arrays))


def triangles_of(room: Room) -> Vector:
    """Return all triangles (t, 3 corners, 3) of a room in world."""
    parts = [p.mesh.vertices_m.astype(np.float64)[p.mesh.triangles] for p in room.props]
    return np.concatenate(parts) if parts else np.empty((0, 3, 3))
