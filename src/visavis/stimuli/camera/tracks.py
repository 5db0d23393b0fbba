"""Tracks along which a camera can film a place: rays from its middle, lines through their ends.

Cameras stand where rays end that leave the middle lines at right angles: before walls, or in
mid-air. Sequential RANSAC finds the lines on which many of them stand; filters cut away what
passes through something.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.floors import Floor
from visavis.stimuli.camera.obstacles import Obstacles
from visavis.stimuli.camera.skeleton import Skeleton

Ints = npt.NDArray[np.int64]
WALL_HEIGHTS = np.array([1.0, 1.4])
"""Heights of tracks along walls, as shares of that of the rays."""

MIN_RISE = 0.2
"""Upward part of a ray from which it leads over people's heads."""
MIN_APART_M = 1.0
"""Near places closer than this to the end of their ray are useless."""


@dataclass(frozen=True)
class RayRules:
    """Origins and directions of the rays that search for camera places.

    Every `every_m` of a middle line, `from_height_m` over the floor, to both sides at
    `elevations_deg` and straight up; `back_off_m` before what is hit, or at `reach_m`. Rays that
    rise give a place `near_m` along them, too, where that is given; the source has none.
    """

    every_m: float = 0.5
    from_height_m: float = 1.6
    elevations_deg: tuple[float, ...] = (-10.0, 0.0, 25.0, 50.0)
    straight_up: bool = True
    back_off_m: float = 0.2
    reach_m: float = 8.0
    near_m: float = 0.0


FOR_ROOMS: Final = RayRules(near_m=2.6)
"""With places over people's heads, near enough for a medium shot where walls are far."""


@dataclass(frozen=True)
class TrackRules:
    """How tracks are made of places.

    A place belongs to a line nearer than `within_m`. Each line is the best of `hypotheses` through
    two places at most `second_within_m` apart; lines end when none has `min_places`, or after
    `max_lines`. They are cut where places are further apart than `max_gap_m`; pieces shorter than
    `min_length_m` or with fewer than `min_piece_places` go. Tracks keep `clear_m` from
    everything.
    """

    within_m: float = 0.15
    hypotheses: int = 200
    second_within_m: float = 15.0
    min_places: int = 12
    max_lines: int = 400
    max_gap_m: float = 2.0
    min_length_m: float = 1.0
    min_piece_places: int = 6
    clear_m: float = 0.12
    drops_unseeing: bool = True
    refits: bool = True

    def __post_init__(self) -> None:
        if not (self.within_m > 0 and self.hypotheses >= 1 and self.min_piece_places >= 2):
            raise DesignError(f"no tracks can be made by {self}; a line needs two places")


@dataclass(frozen=True, eq=False)
class Places:
    """Where cameras could stand: `place_m` (n, 3), seen from `origin_m` (n, 3)."""

    place_m: Vector
    origin_m: Vector


def middle_points(skeleton: Skeleton, every_m: float) -> tuple[Vector, Vector]:
    """Return points (n, 2) along the middle lines and their directions (n, 2), x and z."""
    points, directions = [], []
    for branch in skeleton.branches():
        way = skeleton.points_m[branch]
        distance_m = np.concatenate([[0.0], np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum()])
        if distance_m[-1] <= 0:
            continue
        n = max(1, round(distance_m[-1] / every_m))
        at = (np.arange(n) + 0.5) * distance_m[-1] / n
        ahead, behind = (
            np.stack([np.interp(at + s * every_m, distance_m, way[:, k]) for k in (0, 1)], 1)
            for s in (1, -1)
        )
        length = np.linalg.norm(ahead - behind, axis=1)
        there = length > 1e-9
        points.append(np.stack([np.interp(at, distance_m, way[:, k]) for k in (0, 1)], 1)[there])
        directions.append((ahead - behind)[there] / length[there, None])
    if not points:
        return np.empty((0, 2)), np.empty((0, 2))
    return np.concatenate(points), np.concatenate(directions)


def camera_places(
    floor: Floor, skeleton: Skeleton, obstacles: Obstacles, rules: RayRules | None = None
) -> Places:
    """Cast rays from the middle lines of a floor; those blocked at once give no place."""
    rules = rules or RayRules()
    points, along = middle_points(skeleton, rules.every_m)
    places, origins = [], []
    for (x, z), (ax, az) in zip(points, along, strict=True):
        start = np.array([x, floor.height_m + rules.from_height_m, z])
        rays = [
            np.array([-side * az * np.cos(e), np.sin(e), side * ax * np.cos(e)])
            for e in np.radians(rules.elevations_deg)
            for side in (1.0, -1.0)
        ]
        rays += [np.array([0.0, 1.0, 0.0])] if rules.straight_up else []
        for ray in rays:
            hit_m = obstacles.hit_m(start, ray, rules.reach_m)
            far_m = min(hit_m - rules.back_off_m, rules.reach_m)
            ends = [far_m] if far_m > rules.back_off_m else []
            if 0.0 < rules.near_m < far_m - MIN_APART_M and ray[1] > MIN_RISE:
                ends.append(rules.near_m)
            places += [start + end * ray for end in ends]
            origins += [start] * len(ends)
    return Places(np.array(places).reshape(-1, 3), np.array(origins).reshape(-1, 3))


@compiled
def _best_line(
    places: Vector, draws: Vector, within_m: float, second_within_m: float
) -> tuple[int, int, int]:
    """Return two places whose line has most others near it, and how many; `draws` (h, 2) in 0–1."""
    n = places.shape[0]
    best, best_i, best_j = 0, 0, 0
    for h in range(draws.shape[0]):
        i = int(draws[h, 0] * n)
        j = int(draws[h, 1] * n)
        # Step on from the drawn second place to one near enough to share a line.
        for _ in range(32):
            ex, ey = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1]
            ez = places[j, 2] - places[i, 2]
            length2 = ex * ex + ey * ey + ez * ez
            if 0.25 <= length2 <= second_within_m * second_within_m:
                break
            j = (j * 7 + 13) % n
        else:
            continue
        count = 0
        for k in range(n):
            sx, sy = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1]
            sz = places[k, 2] - places[i, 2]
            along = (sx * ex + sy * ey + sz * ez) / length2
            ox, oy, oz = sx - along * ex, sy - along * ey, sz - along * ez
            if ox * ox + oy * oy + oz * oz < within_m * within_m:
                count += 1
        if count > best:
            best, best_i, best_j = count, i, j
    return best_i, best_j, best


def _fit_line(places: Vector) -> tuple[Vector, Vector]:
    """Return a point on the line of least squares through places (n, 3) and its direction."""
    middle = places.mean(axis=0)
    direction = np.linalg.svd(places - middle, full_matrices=False)[2][0]
    # The sign of a singular vector depends on the library; tracks must not.
    return middle, direction * np.sign(direction[np.argmax(np.abs(direction))])


def tracks_through(
    places: Places, obstacles: Obstacles, seed: int, rules: TrackRules | None = None
) -> Vector:
    """Return tracks (n, 2 ends, 3) on which camera places stand; the same for the same seed."""
    rules = rules or TrackRules()
    rng = np.random.default_rng(seed)
    left = np.arange(len(places.place_m))
    tracks: list[tuple[Vector, Vector]] = []
    for _ in range(rules.max_lines):
        if len(left) < rules.min_places:
            break
        here = np.ascontiguousarray(places.place_m[left])
        draws = rng.random((rules.hypotheses, 2))
        i, j, count = _best_line(here, draws, rules.within_m, rules.second_within_m)
        if count < rules.min_places:
            break
        on = here[i], (here[j] - here[i]) / np.linalg.norm(here[j] - here[i])
        near = np.flatnonzero(_off_line(here, *on) < rules.within_m)
        pieces: list[Ints] = []
        for piece in _pieces(here, near, on[1], rules):
            pieces.append(piece)
            tracks += _clear_lines(here[piece], places.origin_m[left[piece]], obstacles, rules)
        left = np.delete(left, np.concatenate(pieces) if pieces else near)
    return np.array(tracks).reshape(-1, 2, 3)


def wall_tracks(
    floor: Floor,
    obstacles: Obstacles,
    rays: RayRules | None = None,
    rules: TrackRules | None = None,
) -> Vector:
    """Return tracks (n, 2 ends, 3) along the rim of a floor, at two heights.

    For rooms so compact that their middle line is next to none: from a room's middle, every ray
    ends before a wall.
    """
    rays, rules = rays or RayRules(), rules or TrackRules()
    tracks: list[tuple[Vector, Vector]] = []
    for polygon in shapely.get_parts(floor.area.simplify(rules.within_m)):
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.array(ring.coords)
            for (ax, az), (bx, bz) in pairwise(corners.tolist()):
                n = max(2, int(np.hypot(bx - ax, bz - az) / rules.within_m))
                for height_m in WALL_HEIGHTS * rays.from_height_m:
                    places = np.linspace(
                        [ax, floor.height_m + height_m, az],
                        [bx, floor.height_m + height_m, bz],
                        n,
                    )
                    tracks += [
                        (p + low * d, p + high * d)
                        for low, high, (p, d) in _clear_parts(places, obstacles, rules)
                        if high - low >= rules.min_length_m
                    ]
    return np.array(tracks).reshape(-1, 2, 3)


def _off_line(places: Vector, point: Vector, direction: Vector) -> Vector:
    away = places - point
    off: Vector = np.linalg.norm(away - (away @ direction)[:, None] * direction, axis=1)
    return off


def _pieces(here: Vector, near: Ints, direction: Vector, rules: TrackRules) -> list[Ints]:
    """Return the runs of places along a line that are dense and long enough."""
    along = here[near] @ direction
    order = np.argsort(along, kind="stable")
    breaks = np.flatnonzero(np.diff(along[order]) > rules.max_gap_m) + 1
    runs = np.split(order, breaks)
    return [
        near[run]
        for run in runs
        if len(run) >= rules.min_piece_places
        and along[run[-1]] - along[run[0]] >= rules.min_length_m
    ]


def _clear_lines(
    places: Vector, origins: Vector, obstacles: Obstacles, rules: TrackRules
) -> list[tuple[Vector, Vector]]:
    """Cut a line where it collides, drop places that do not see it, fit it again, cut again."""
    tracks = []
    for low, high, (point, direction) in _clear_parts(places, obstacles, rules):
        along = (places - point) @ direction
        mine = (along >= low) & (along <= high)
        if rules.drops_unseeing:
            foot = point + along[:, None] * direction
            mine &= np.array(
                [m and obstacles.sees(p, f) for m, p, f in zip(mine, places, foot, strict=True)]
            )
        if mine.sum() < rules.min_piece_places:
            continue
        if rules.refits:
            parts = _clear_parts(places[mine], obstacles, rules)
        else:
            parts = [(low, high, (point, direction))]
        tracks += [(p + a * d, p + b * d) for a, b, (p, d) in parts if b - a >= rules.min_length_m]
    return tracks


def _clear_parts(
    places: Vector, obstacles: Obstacles, rules: TrackRules
) -> list[tuple[float, float, tuple[Vector, Vector]]]:
    """Return the parts, from and to, of the line through places that keep clear of everything."""
    point, direction = _fit_line(places)
    along = (places - point) @ direction
    step = rules.clear_m
    at = np.linspace(along.min(), along.max(), max(2, int(np.ceil(np.ptp(along) / step)) + 1))
    clear = np.array([not obstacles.is_near(point + a * direction, rules.clear_m) for a in at])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], clear, [False]]).astype(np.int8)))
    parts = []
    for first, last in edges.reshape(-1, 2):
        low, high = at[first], at[last - 1]
        if high > low and obstacles.sees(point + low * direction, point + high * direction):
            parts.append((float(low), float(high), (point, direction)))
    return parts
