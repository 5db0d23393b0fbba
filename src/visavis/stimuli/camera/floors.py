"""Where people can walk in a room: level floor with headroom, a body's width off obstacles."""

from dataclasses import dataclass

import numpy as np
import shapely

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.obstacles import triangles_of
from visavis.stimuli.picture import Room

LEVEL_FROM = 0.95
"""Upward part of the normal from which a surface is level."""
SEAM_M = 0.01
"""Gaps between the pieces of a floor up to twice this wide are closed."""
COARSER_M = 0.03


@dataclass(frozen=True)
class Walkers:
    """Who walks: `radius_m` is kept from everything higher than `step_m` and lower than
    `height_m`. A floor smaller than `min_area_m2` does not count; one more than `climb_m` higher or
    lower than its neighbour cannot be reached.
    """

    radius_m: float = 0.2
    height_m: float = 1.8
    step_m: float = 0.12
    climb_m: float = 0.25
    min_area_m2: float = 4.0


@dataclass(frozen=True, eq=False)
class Floor:
    """One level: its height, and where its middle line can be walked, x and z in world."""

    height_m: float
    area: shapely.MultiPolygon


def walkable_floors(room: Room, walkers: Walkers | None = None) -> tuple[Floor, ...]:
    """Return the levels of a room that can be reached from its largest, that first.

    Raises:
        DesignError: nobody can walk anywhere.
    """
    walkers = walkers or Walkers()
    triangles = triangles_of(room)
    heights = _heights(triangles, walkers)
    floors = [f for f in (_level(triangles, h, walkers) for h in heights) if f]
    floors.sort(key=lambda f: -f.area.area)
    if not floors:
        raise DesignError(
            f"room {room.name!r} has no level floor of {walkers.min_area_m2} m² on which a person "
            f"{walkers.height_m} m high can stand; there is no place for a camera"
        )
    reachable, left = [floors[0]], floors[1:]
    while near := [f for f in left if any(_adjoin(f, g, walkers) for g in reachable)]:
        reachable += near
        left = [f for f in left if f not in near]
    return tuple(reachable)


def _adjoin(a: Floor, b: Floor, walkers: Walkers) -> bool:
    is_step = abs(a.height_m - b.height_m) <= walkers.climb_m
    return is_step and bool(a.area.distance(b.area) <= 4 * walkers.radius_m)


def _heights(triangles: Vector, walkers: Walkers) -> list[float]:
    """Return the heights of level surfaces that steps join to the lowest of the large ones.

    A roof or a slab of ceiling may be as large as the floor below it.
    """
    flat, area = _level_ones(triangles)
    height = triangles[flat].mean(axis=1)[:, 1]
    heights: list[float] = []
    levels, which = np.unique(height.round(3), return_inverse=True)
    sizes = np.bincount(which, area[flat])
    for i in np.argsort(-sizes, kind="stable"):
        if sizes[i] < walkers.min_area_m2 / 2:
            break
        if all(abs(levels[i] - h) > walkers.step_m for h in heights):
            heights.append(float(levels[i]))
    if not heights:
        return []
    large = [h for h, size in zip(levels, sizes, strict=True) if size >= sizes.max() / 2]
    low = high = float(min(large))
    reachable: list[float] = []
    while near := [
        h
        for h in heights
        if h not in reachable and low - walkers.climb_m <= h <= high + walkers.climb_m
    ]:
        reachable += near
        low, high = min(reachable), max(reachable)
    return reachable


def _level_ones(triangles: Vector) -> tuple[Vector, Vector]:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    area = np.linalg.norm(normal, axis=1)
    return normal[:, 1] > LEVEL_FROM * np.maximum(area, 1e-12), area


def _level(triangles: Vector, height_m: float, walkers: Walkers) -> Floor | None:
    flat, _ = _level_ones(triangles)
    here = np.abs(triangles[:, :, 1] - height_m).max(axis=1) <= walkers.step_m / 2
    ground = shapely.union_all(shapely.polygons(triangles[flat & here][:, :, [0, 2]]))
    ground = ground.buffer(SEAM_M, join_style="mitre").buffer(
        -SEAM_M - walkers.radius_m, join_style="mitre"
    )
    obstacle_area = _standing(triangles, height_m + walkers.step_m, height_m + walkers.height_m)
    if walkers.radius_m > 0:
        obstacle_area = obstacle_area.buffer(
            walkers.radius_m, cap_style="square", join_style="mitre"
        )
    free = ground.difference(obstacle_area)
    if walkers.radius_m > 0:
        free = free.simplify(COARSER_M)
    parts = [p for p in shapely.get_parts(free) if p.area >= walkers.min_area_m2]
    parts = [p for p in parts if isinstance(p, shapely.Polygon)]
    return Floor(height_m, shapely.MultiPolygon(parts)) if parts else None


def _standing(triangles: Vector, low_m: float, high_m: float) -> shapely.Geometry:
    """Return the outline on the floor of everything between two heights."""
    y = triangles[:, :, 1]
    some = triangles[(y.max(axis=1) > low_m) & (y.min(axis=1) < high_m)]
    points, owner = [], []
    rows = np.arange(len(some))
    for k in range(3):
        a, b = some[:, k], some[:, (k + 1) % 3]
        inside = (a[:, 1] >= low_m) & (a[:, 1] <= high_m)
        points.append(a[inside][:, [0, 2]])
        owner.append(rows[inside])
        for cut in (low_m, high_m):
            crosses = (a[:, 1] - cut) * (b[:, 1] - cut) < 0
            p, q = a[crosses], b[crosses]
            share = ((cut - p[:, 1]) / (q[:, 1] - p[:, 1]))[:, None]
            points.append((p + share * (q - p))[:, [0, 2]])
            owner.append(rows[crosses])
    order = np.argsort(np.concatenate(owner), kind="stable")
    at, of = np.concatenate(points)[order], np.concatenate(owner)[order]
    _, own = np.unique(of, return_inverse=True)
    hulls = shapely.convex_hull(shapely.multipoints(shapely.points(at), indices=own))
    return shapely.union_all(hulls)
