"""The middle lines of a floor: its medial axis, from the Voronoi cells of its boundary.

Corridors become lines, crossings nodes, and a way round every hole a loop.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Voronoi

from visavis.lab.geometry import Vector

PRUNED_BELOW = 1.5
"""A dead end goes when it and the free circle at its end reach less far than this times the
circle where it branches off: the diagonals into square corners reach √2.
"""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Middle lines: `points_m` (n, 2) x and z, `edges` (m, 2) between them, `clearance_m` (n,)
    from each point to the nearest boundary.
    """

    points_m: Vector
    edges: npt.NDArray[np.int64]
    clearance_m: Vector

    @property
    def components(self) -> int:
        """The number of pieces that no line joins."""
        n = len(self.points_m)
        graph = coo_array((np.ones(len(self.edges)), self.edges.T), shape=(n, n))
        return int(connected_components(graph, directed=False)[0])

    @property
    def cycles(self) -> int:
        """The number of independent ways round."""
        return len(self.edges) - len(self.points_m) + self.components

    @property
    def length_m(self) -> float:
        """The length of all lines."""
        a, b = self.points_m[self.edges].transpose(1, 0, 2)
        return float(np.linalg.norm(b - a, axis=1).sum())

    def branches(self) -> tuple[npt.NDArray[np.int64], ...]:
        """Return chains of points between crossings and ends; a loop by itself begins anywhere."""
        around = _neighbours(self.edges, len(self.points_m))
        stops = [i for i, near in enumerate(around) if len(near) != 2]
        visited_edges: set[tuple[int, int]] = set()
        chains = []
        for start in (*stops, *range(len(around))):
            for step in around[start]:
                if (start, step) in visited_edges:
                    continue
                chain = _chain(around, start, step)
                visited_edges |= {(a, b) for p in (chain, chain[::-1]) for a, b in pairwise(p)}
                chains.append(np.array(chain))
        return tuple(chains)


def medial_axis(area: shapely.MultiPolygon | shapely.Polygon, spacing_m: float = 0.2) -> Skeleton:
    """Return the middle lines of a floor from boundary points at most `spacing_m` apart."""
    dense = shapely.segmentize(area, spacing_m)
    rings = [r for p in shapely.get_parts(dense) for r in (p.exterior, *p.interiors)]
    samples = np.concatenate([np.array(r.coords)[:-1] for r in rings])
    cells = Voronoi(samples)
    ridges = np.array(cells.ridge_vertices)
    ridges = ridges[(ridges >= 0).all(axis=1)]
    shapely.prepare(area)
    inside = shapely.contains_xy(area, cells.vertices[:, 0], cells.vertices[:, 1])
    ridges = ridges[inside[ridges].all(axis=1)]
    ridges = ridges[shapely.covers(area, shapely.linestrings(cells.vertices[ridges]))]
    corners, edges = np.unique(ridges, return_inverse=True)
    points = cells.vertices[corners]
    clearance = shapely.distance(area.boundary, shapely.points(points))
    return _prune(Skeleton(points, edges.reshape(-1, 2).astype(np.int64), clearance))


def _neighbours(edges: npt.NDArray[np.int64], n: int) -> list[list[int]]:
    around: list[list[int]] = [[] for _ in range(n)]
    for a, b in edges.tolist():
        around[a].append(b)
        around[b].append(a)
    return around


def _chain(around: list[list[int]], start: int, step: int) -> list[int]:
    chain = [start, step]
    while len(around[chain[-1]]) == 2 and chain[-1] != start:
        a, b = around[chain[-1]]
        chain.append(b if a == chain[-2] else a)
    return chain


def _prune(skeleton: Skeleton) -> Skeleton:
    """Take away dead ends that only lead into corners, until none is left."""
    around = _neighbours(skeleton.edges, len(skeleton.points_m))
    points, clearance = skeleton.points_m, skeleton.clearance_m
    while True:
        dead_ends: dict[int, list[tuple[float, list[int]]]] = {}
        for leaf in (i for i, near in enumerate(around) if len(near) == 1):
            chain = _chain(around, leaf, around[leaf][0])
            if len(around[chain[-1]]) < 3:
                continue
            way = points[chain]
            reach = np.linalg.norm(np.diff(way, axis=0), axis=1).sum() + clearance[leaf]
            if reach < PRUNED_BELOW * clearance[chain[-1]]:
                dead_ends.setdefault(chain[-1], []).append((float(reach), chain))
        for fork, chains in dead_ends.items():
            chains.sort(key=lambda rc: (-rc[0], rc[1]))
            n_spared = 2 if len(chains) == len(around[fork]) else 0
            for _, chain in chains[n_spared:]:
                for a, b in pairwise(chain):
                    around[a].remove(b)
                    around[b].remove(a)
        if not dead_ends:
            break
    edges = np.array([(a, b) for a, near in enumerate(around) for b in near if a < b])
    corners, compact = np.unique(edges, return_inverse=True)
    return Skeleton(points[corners], compact.reshape(-1, 2), clearance[corners])
