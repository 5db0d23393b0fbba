"""Choose a way through a crowd: gaps in a row, then a band that keeps off the bodies."""

import heapq
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.scenes.station_crowd import Crowd, body_radius_m

ENTRY_M: Final = 2.4
"""Farthest outer gap through which the way enters the crowd from either end."""
MIN_GAP_M: Final = 0.36
"""Nobody goes through less, however far they turn: a body is 0.26 m deep."""
STEP_M: Final = 0.02
HALF_WIDTH_M: Final = 0.25
HALF_DEPTH_M: Final = 0.14
_BAND_M = 0.10
_FAR_M = 2.0


@dataclass(frozen=True, eq=False)
class GapGraph:
    """The gaps of a crowd: `middle_m` (k, 2), `free_m` (k,), `is_outer` (k,), `beside[k]` the
    gaps that share a triangle with k, each with its distance in metres.
    """

    middle_m: Vector
    free_m: Vector
    is_outer: npt.NDArray[np.bool_]
    beside: tuple[tuple[tuple[int, float], ...], ...]


@lru_cache(maxsize=32)
def gap_graph(crowd: Crowd) -> GapGraph:
    """Return the dual of the crowd's triangulation."""
    triangles = Delaunay(crowd.position_m).simplices
    edges: dict[tuple[int, int], list[int]] = {}
    for t, (a, b, c) in enumerate(triangles.tolist()):
        for p, q in ((a, b), (b, c), (c, a)):
            edges.setdefault((min(p, q), max(p, q)), []).append(t)
    pairs = np.array(list(edges))
    a, b = pairs.T
    way = crowd.position_m[b] - crowd.position_m[a]
    distance = np.linalg.norm(way, axis=1)
    direction = way / distance[:, None]
    reach_a, reach_b = body_radius_m(crowd, a, direction), body_radius_m(crowd, b, direction)
    middle = crowd.position_m[a] + direction * ((reach_a + distance - reach_b) / 2)[:, None]
    number = {edge: k for k, edge in enumerate(edges)}
    beside: list[set[int]] = [set() for _ in edges]
    for p, q, r in triangles.tolist():
        own = [number[min(u, v), max(u, v)] for u, v in ((p, q), (q, r), (r, p))]
        for k in own:
            beside[k].update(j for j in own if j != k)
    return GapGraph(
        middle_m=middle,
        free_m=distance - reach_a - reach_b,
        is_outer=np.array([len(neighbours) == 1 for neighbours in edges.values()]),
        beside=tuple(
            tuple((j, float(np.hypot(*(middle[j] - middle[k])))) for j in sorted(neighbours))
            for k, neighbours in enumerate(beside)
        ),
    )


def choose_gaps(
    graph: GapGraph,
    start_m: Vector,
    goal_m: Vector,
    taste: Vector,
    *,
    squeeze: float,
    easy_gap_m: float,
) -> list[int]:
    """Return the cheapest row of gaps; `taste` (k,) multiplies what each gap costs.

    A step costs its length plus `squeeze` times the square of what the gap lacks of
    `easy_gap_m`.
    """
    lacking = np.maximum(easy_gap_m - graph.free_m, 0.0)
    toll = squeeze * lacking**2
    passable = graph.free_m > MIN_GAP_M
    middle = graph.middle_m
    from_start = np.linalg.norm(middle - start_m, axis=1)
    to_goal = np.linalg.norm(middle - goal_m, axis=1)
    entries = _entries(graph.is_outer & passable, from_start)
    exits = set(_entries(graph.is_outer & passable, to_goal))
    near_start, near_goal = from_start.tolist(), to_goal.tolist()
    tolls, tastes, open_to = toll.tolist(), taste.tolist(), passable.tolist()
    best = [math.inf] * len(middle)
    before = [-1] * len(middle)
    queue: list[tuple[float, int]] = []
    for k in entries:
        best[k] = (near_start[k] + tolls[k]) * tastes[k]
        heapq.heappush(queue, (best[k], k))
    end, end_cost = -1, math.inf
    while queue:
        cost, k = heapq.heappop(queue)
        if cost > best[k]:
            continue
        if cost >= end_cost:
            break
        if k in exits and cost + near_goal[k] < end_cost:
            end, end_cost = k, cost + near_goal[k]
        for j, step in graph.beside[k]:
            if not open_to[j]:
                continue
            onward = cost + (step + tolls[j]) * tastes[j]
            if onward < best[j]:
                best[j], before[j] = onward, k
                heapq.heappush(queue, (onward, j))
    row = []
    while end >= 0:
        row.append(end)
        end = before[end]
    return row[::-1]


def _entries(may_enter: npt.NDArray[np.bool_], distance: Vector) -> list[int]:
    near = np.flatnonzero(may_enter & (distance <= ENTRY_M))
    if near.size == 0:
        near = np.flatnonzero(may_enter)[np.argsort(distance[may_enter])[:1]]
    return [int(k) for k in near]


@dataclass(frozen=True, eq=False)
class Way:
    """A way to walk, sampled every 2 cm: `point_m` (n, 2), `heading_rad` (n,) as a turn about
    +y from −z, `free_m` (n,) what is free across the way there.
    """

    point_m: Vector
    heading_rad: Vector
    free_m: Vector


def way_through(crowd: Crowd, gaps: list[int], start_m: Vector, goal_m: Vector) -> Way:
    """Relax a band through a row of gaps off the bodies and sample it."""
    corners = np.concatenate([[start_m], gap_graph(crowd).middle_m[gaps], [goal_m]])
    band = _resample(corners, _BAND_M)
    bodies = np.column_stack([crowd.position_m, np.cos(crowd.yaw_rad), np.sin(crowd.yaw_rad)])
    _relax(band, np.ascontiguousarray(bodies), 120)
    point = _resample(_smooth(band), STEP_M)
    ahead = np.gradient(point, axis=0)
    heading = np.unwrap(np.arctan2(-ahead[:, 0], -ahead[:, 1]))
    free = np.empty(len(point))
    _free_across(point, ahead / np.linalg.norm(ahead, axis=1)[:, None], bodies, free)
    return Way(point, heading, free)


def _resample(points: Vector, step_m: float) -> Vector:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    n = max(int(np.ceil(length[-1] / step_m)), 2)
    at = np.linspace(0, length[-1], n + 1)
    return np.stack([np.interp(at, length, points[:, k]) for k in range(2)], axis=1)


def _smooth(points: Vector) -> Vector:
    with_ends = np.concatenate([points[:1], points[:1], points, points[-1:], points[-1:]])
    weights = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16
    inner = sum(w * with_ends[k : k + len(points)] for k, w in enumerate(weights))
    smooth: Vector = np.asarray(inner)
    smooth[0], smooth[-1] = points[0], points[-1]
    return smooth


@compiled
def reach_of(along: float, across: float) -> float:
    """Return how far a body reaches in a direction given in its own axes (aside, ahead)."""
    size = np.hypot(along, across)
    if size == 0.0:
        return HALF_WIDTH_M
    reach: float = 1.0 / np.hypot(along / size / HALF_WIDTH_M, across / size / HALF_DEPTH_M)
    return reach


@compiled
def _relax(band: Vector, bodies: Vector, rounds: int) -> None:
    """Pull a band straight and push it off bodies (m, 4: x, z, cos yaw, sin yaw), in place."""
    keep_m, reach_m, every = 0.42, 0.7, 10
    n = band.shape[0]
    near = np.empty((n, bodies.shape[0]), np.int64)
    many = np.zeros(n, np.int64)
    for turn in range(rounds):
        if turn % every == 0:
            # no point moves more than 3 cm in a round
            widest = (reach_m + 0.03 * every) ** 2
            for i in range(1, n - 1):
                many[i] = 0
                for k in range(bodies.shape[0]):
                    dx, dz = band[i, 0] - bodies[k, 0], band[i, 1] - bodies[k, 1]
                    if dx * dx + dz * dz <= widest:
                        near[i, many[i]] = k
                        many[i] += 1
        for i in range(1, n - 1):
            # Pull towards the middle of the neighbours shortens and straightens the band,
            fx = 0.5 * (band[i - 1, 0] + band[i + 1, 0]) - band[i, 0]
            fz = 0.5 * (band[i - 1, 1] + band[i + 1, 1]) - band[i, 1]
            fx *= 0.7
            fz *= 0.7
            for j in range(many[i]):
                k = near[i, j]
                dx, dz = band[i, 0] - bodies[k, 0], band[i, 1] - bodies[k, 1]
                square = dx * dx + dz * dz
                if square > reach_m * reach_m or square == 0.0:
                    continue
                aside = dx * bodies[k, 2] - dz * bodies[k, 3]
                ahead = dx * bodies[k, 3] + dz * bodies[k, 2]
                distance = np.sqrt(square)
                # bodies push it off where less than `keep_m` is free between band and surface.
                lacking = keep_m - (distance - reach_of(aside, ahead))
                if lacking > 0.0:
                    push = 0.12 * lacking / distance
                    fx += push * dx
                    fz += push * dz
            size = np.hypot(fx, fz)
            if size > 0.03:
                fx, fz = fx * 0.03 / size, fz * 0.03 / size
            band[i, 0] += fx
            band[i, 1] += fz


@compiled
def _free_across(point: Vector, ahead: Vector, bodies: Vector, free: Vector) -> None:
    """Write what is free across the way at every point, at most 2 m, from body to body."""
    for i in range(point.shape[0]):
        left = right = _FAR_M / 2
        for k in range(bodies.shape[0]):
            dx, dz = bodies[k, 0] - point[i, 0], bodies[k, 1] - point[i, 1]
            along = dx * ahead[i, 0] + dz * ahead[i, 1]
            across = dx * ahead[i, 1] - dz * ahead[i, 0]
            if abs(along) > 0.35 or abs(across) > 1.3:
                continue
            # The way in the body's own axes: a body reaches further aside than ahead.
            aside = dx * bodies[k, 2] - dz * bodies[k, 3]
            before = dx * bodies[k, 3] + dz * bodies[k, 2]
            clear = np.hypot(dx, dz) - reach_of(aside, before)
            room = max(clear, 0.0)
            if across > 0:
                right = min(right, room)
            else:
                left = min(left, room)
        free[i] = left + right
