"""Tracks joined into a graph of places, what each place sees of the floor, and ways between them.

`track_graph` joins tracks; `roadmap` scatters places at random and joins all that see each other
(a probabilistic roadmap), for comparison. Both are `CameraGraph`s, filmed by the same code.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.floors import Floor
from visavis.stimuli.camera.obstacles import NOBODY, STACK, Obstacles, sees_between

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class GraphRules:
    """How tracks are joined: those that pass nearer than `meet_m` cross; edges are split to at
    most `max_edge_m`; unconnected places nearer than `link_m` that see each other are linked.
    """

    meet_m: float = 0.3
    max_edge_m: float = 3.0
    link_m: float = 3.0
    clear_m: float = 0.12


class Network(NamedTuple):
    """Places `nodes` (n, 3), ways `edges` (m, 2) between them and the connected part of each place
    (n,), as compiled code takes them.
    """

    nodes: Vector
    edges: Ints
    component: Ints


@dataclass(frozen=True, eq=False)
class CameraGraph:
    """Places `nodes_m` (n, 3) and the ways `edges` (m, 2) along which a camera may move."""

    nodes_m: Vector
    edges: Ints

    @cached_property
    def component(self) -> Ints:
        """Which connected part each node (n,) belongs to."""
        return connected_components(self._lengths, directed=False)[1].astype(np.int64)

    @cached_property
    def distance_m(self) -> npt.NDArray[np.float32]:
        """Length of the shortest way between nodes (n, n); inf where there is none."""
        return dijkstra(self._lengths, directed=False).astype(np.float32)

    @cached_property
    def network(self) -> Network:
        """The graph as compiled code takes it."""
        return Network(self.nodes_m, self.edges, self.component)

    @property
    def _lengths(self) -> "csr_array[np.float64]":
        a, b = self.nodes_m[self.edges].transpose(1, 0, 2)
        n = len(self.nodes_m)
        lengths = np.maximum(np.linalg.norm(b - a, axis=1), 1e-9)
        return coo_array((lengths, self.edges.T), shape=(n, n)).tocsr()


def track_graph(
    tracks_m: Vector, obstacles: Obstacles, rules: GraphRules | None = None
) -> CameraGraph:
    """Join tracks (n, 2 ends, 3) into a graph.

    Raises:
        DesignError: there is no track.
    """
    if not len(tracks_m):
        raise DesignError("no camera track was found in this place; ease the rules of its tracks")
    rules = rules or GraphRules()
    stops, crossings = _crossings(tracks_m, rules, obstacles)
    nodes: list[Vector] = []
    edges: list[tuple[int, int]] = []
    node_at: dict[tuple[int, float], int] = {}
    for k, (start, end) in enumerate(tracks_m):
        length = float(np.linalg.norm(end - start))
        marks = sorted({0.0, 1.0, *stops[k]})
        every: list[float] = []
        for a, b in pairwise(marks):
            n = max(1, int(np.ceil((b - a) * length / rules.max_edge_m)))
            every += [a + (b - a) * i / n for i in range(n)]
        for share in (*every, 1.0):
            node_at[k, share] = len(nodes)
            nodes.append(start + share * (end - start))
            if share > 0.0:
                edges.append((len(nodes) - 2, len(nodes) - 1))
    edges += [(node_at[a], node_at[b]) for a, b in crossings]
    graph = CameraGraph(np.array(nodes), np.array(edges, np.int64).reshape(-1, 2))
    return CameraGraph(
        graph.nodes_m, np.concatenate([graph.edges, _links(graph, obstacles, rules)])
    )


def _crossings(
    tracks: Vector, rules: GraphRules, obstacles: Obstacles
) -> tuple[list[set[float]], list[tuple[tuple[int, float], tuple[int, float]]]]:
    """Return where along each track (shares) others pass, and which such stops belong together."""
    stops: list[set[float]] = [set() for _ in tracks]
    pairs = []
    low, high = tracks.min(axis=1) - rules.meet_m, tracks.max(axis=1) + rules.meet_m
    for a in range(len(tracks)):
        near = (low[a] <= high[a + 1 :]) & (high[a] >= low[a + 1 :])
        for b in (np.flatnonzero(near.all(axis=1)) + a + 1).tolist():
            s, t, distance_m = _nearest(tracks[a], tracks[b])
            if distance_m > rules.meet_m:
                continue
            here = tracks[a, 0] + s * (tracks[a, 1] - tracks[a, 0])
            there = tracks[b, 0] + t * (tracks[b, 1] - tracks[b, 0])
            if obstacles.sees(here, there):
                stops[a].add(s)
                stops[b].add(t)
                pairs.append(((a, s), (b, t)))
    return stops, pairs


def _nearest(p: Vector, q: Vector) -> tuple[float, float, float]:
    """Return where along two segments (2 ends, 3) they come nearest (shares), and how near."""
    u, v, w = p[1] - p[0], q[1] - q[0], p[0] - q[0]
    a, b, c, d, e = u @ u, u @ v, v @ v, u @ w, v @ w
    det = a * c - b * b
    s = float(np.clip((b * e - c * d) / det, 0, 1)) if det > 1e-9 * a * c else 0.0
    t = float(np.clip((b * s + e) / c, 0, 1))
    s = float(np.clip((b * t - d) / a, 0, 1))
    return s, t, float(np.linalg.norm(p[0] + s * u - q[0] - t * v))


def _links(graph: CameraGraph, obstacles: Obstacles, rules: GraphRules) -> Ints:
    """Return edges from places to the nearest place of every other part within reach and sight."""
    nodes, part = graph.nodes_m, graph.component
    pairs = cKDTree(nodes).query_pairs(rules.link_m, output_type="ndarray")
    pairs = pairs[part[pairs[:, 0]] != part[pairs[:, 1]]]
    length = np.linalg.norm(nodes[pairs[:, 1]] - nodes[pairs[:, 0]], axis=1)
    linked_keys: set[tuple[int, int]] = set()
    edges = []
    for i in np.argsort(length, kind="stable"):
        a, b = (int(x) for x in pairs[i])
        keys = (a, int(part[b])), (b, int(part[a]))
        if keys[0] in linked_keys or keys[1] in linked_keys:
            continue
        if is_clear_way(obstacles, nodes[a], nodes[b], rules.clear_m):
            edges.append((a, b))
            linked_keys.update(keys)
    return np.array(edges, np.int64).reshape(-1, 2)


def is_clear_way(obstacles: Obstacles, a_m: Vector, b_m: Vector, clear_m: float) -> bool:
    """Tell whether a camera can go straight from a to b and keep clear of everything."""
    if not obstacles.sees(a_m, b_m):
        return False
    n = max(1, int(np.ceil(np.linalg.norm(b_m - a_m) / clear_m)))
    return not any(obstacles.is_near(a_m + (b_m - a_m) * i / n, clear_m) for i in range(n + 1))


def roadmap(
    floor: Floor,
    obstacles: Obstacles,
    seed: int,
    *,
    per_m2: float = 1.5,
    link_m: float = 5.0,
    heights_m: tuple[float, float] = (0.8, 4.0),
    clear_m: float = 0.12,
) -> CameraGraph:
    """Scatter places over a floor and join all pairs within reach that see each other."""
    rng = np.random.default_rng(seed)
    west, south, east, north = floor.area.bounds
    n_nodes = round(per_m2 * floor.area.area)
    nodes: list[Vector] = []
    while len(nodes) < n_nodes:
        x, z = rng.uniform(west, east), rng.uniform(south, north)
        place = np.array([x, floor.height_m + rng.uniform(*heights_m), z])
        if shapely.contains_xy(floor.area, x, z) and not obstacles.is_near(place, clear_m):
            nodes.append(place)
    places = np.array(nodes)
    pairs = cKDTree(places).query_pairs(link_m, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    clear = [obstacles.sees(places[a], places[b]) for a, b in pairs]
    return CameraGraph(places, pairs[np.array(clear, bool)].astype(np.int64))


@compiled
def _nearest_middle(middles: Vector, x: float, z: float) -> int:
    nearest, best2 = 0, np.inf
    for t in range(middles.shape[0]):
        dx, dz = middles[t, 0] - x, middles[t, 2] - z
        if dx * dx + dz * dz < best2:
            nearest, best2 = t, dx * dx + dz * dz
    return nearest


@dataclass(frozen=True, eq=False)
class FloorTable:
    """What places see of a floor: `triangle_m` (t, 3 corners, 3) and `share_01` (n, t), the share
    of each triangle from each node at which a person standing there is visible.
    """

    triangle_m: Vector
    share_01: npt.NDArray[np.float32]

    @cached_property
    def centre_m(self) -> Vector:
        """Middles (t, 3) of the triangles."""
        middle: Vector = self.triangle_m.mean(axis=1)
        return middle

    def at(self, place_m: Vector) -> int:
        """Return the triangle whose middle is nearest to a place (3,), by x and z."""
        return int(_nearest_middle(self.centre_m, place_m[0], place_m[2]))

    def around_01(self, within_m: float) -> npt.NDArray[np.float32]:
        """Return the visible share (t, n), from each node, of the area around each triangle."""
        tree = cKDTree(self.centre_m[:, [0, 2]])
        first, second = tree.query_pairs(within_m, output_type="ndarray").T
        n = len(self.triangle_m)
        own = np.arange(n)
        a, b = np.concatenate([first, second, own]), np.concatenate([second, first, own])
        weights = coo_array((np.ones(len(a), np.float32), (a, b)), shape=(n, n)).tocsr()
        near = np.asarray(weights.sum(axis=1)).reshape(-1, 1)
        return np.ascontiguousarray((weights @ self.share_01.T) / near, np.float32)


def small_triangles(floor: Floor, max_area_m2: float = 1.5) -> Vector:
    """Return triangles (t, 3 corners, 3) that cover a floor, none larger than an area."""
    parts = [
        np.array(t.exterior.coords)[:3]
        for p in shapely.get_parts(floor.area)
        for t in shapely.constrained_delaunay_triangles(p).geoms
    ]
    todo, small = np.array(parts), []
    while len(todo):
        a, b, c = todo.transpose(1, 0, 2)
        area = np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])
                      - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2  # fmt: skip
        small.append(todo[area <= max_area_m2])
        todo = todo[area > max_area_m2]
        sides = np.linalg.norm(todo - np.roll(todo, -1, axis=1), axis=2)
        turn = (np.arange(3) + np.argmax(sides, axis=1)[:, None]) % 3
        a, b, c = np.take_along_axis(todo, turn[:, :, None], axis=1).transpose(1, 0, 2)
        middle = (a + b) / 2
        todo = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    flat = np.concatenate(small)
    return np.insert(flat, 1, floor.height_m, axis=2)


@compiled
def _seen_shares(
    nodes: Vector,
    points: Vector,
    reach_m: float,
    share: npt.NDArray[np.float32],
    nobody: Vector,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> None:
    """Fill `share` (n, t) with the part of each triangle's `points` (t, rays, 3) a node sees."""
    rays = points.shape[1]
    stack = np.empty(STACK, np.int64)
    for i in range(nodes.shape[0]):
        node = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        for t in range(points.shape[0]):
            x, y = node[0] - points[t, 0, 0], node[1] - points[t, 0, 1]
            z = node[2] - points[t, 0, 2]
            # Beyond `reach_m` nobody is filmed, so that no ray is spent.
            count = 0
            if x * x + y * y + z * z <= reach_m * reach_m:
                for r in range(rays):
                    point = points[t, r, 0], points[t, r, 1], points[t, r, 2]
                    if sees_between(point, node, nobody, stack, boxes, links, corners):
                        count += 1
            share[i, t] = count / rays


def floor_table(
    graph: CameraGraph,
    triangles_m: Vector,
    obstacles: Obstacles,
    seed: int,
    *,
    rays: int = 4,
    reach_m: float = 25.0,
    body_m: tuple[float, float] = (0.6, 1.7),
) -> FloorTable:
    """Look from each place at random points of bodies that stand on each triangle."""
    rng = np.random.default_rng(seed)
    n = len(triangles_m)
    u, v = rng.random((2, n, rays, 1))
    inside = u + v > 1
    u, v = np.where(inside, 1 - u, u), np.where(inside, 1 - v, v)
    a, b, c = (triangles_m[:, None, k] for k in range(3))
    points = a + u * (b - a) + v * (c - a)
    points[:, :, 1] += rng.uniform(*body_m, (n, rays))
    share = np.empty((len(graph.nodes_m), n), np.float32)
    _seen_shares(graph.nodes_m, points, reach_m, share, NOBODY, *obstacles.arrays)
    return FloorTable(triangles_m, share)
