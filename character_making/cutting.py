"""Cut surfaces along smooth lines, give cloth a hem, let it hang."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from character_making.pieces import Indices, Piece, kept, vertex_normals
from visavis.lab.geometry import Vector


def clipped(piece: Piece, outside: Vector) -> Piece:
    """Return what lies where `outside` (v,) is negative, cut exactly along zero."""
    # Corners that nearly touch the line are put on it, so no slivers come of the cut.
    outside = np.where(np.abs(outside) < 1e-4, -1e-4, outside)
    inside = outside < 0
    n_in = inside[piece.triangles].sum(axis=1)
    whole, one, two = (piece.triangles[n_in == k] for k in (3, 1, 2))
    tags = [piece.part[n_in == k] for k in (3, 1, 2)]
    one = _lone_first(one, inside[one])
    two = _lone_first(two, ~inside[two])
    a = np.concatenate([one[:, 0], one[:, 0], two[:, 0], two[:, 0]])
    b = np.concatenate([one[:, 1], one[:, 2], two[:, 1], two[:, 2]])
    low, high = np.minimum(a, b), np.maximum(a, b)
    wide = len(piece.vertices_m)
    codes, new = np.unique(low * wide + high, return_inverse=True)
    edges = np.stack([codes // wide, codes % wide], axis=1)
    new = new.ravel() + len(piece.vertices_m)
    t = outside[edges[:, 0]] / (outside[edges[:, 0]] - outside[edges[:, 1]])

    def mixed(values: Vector) -> Vector:
        extra = values[edges[:, 0]] * (1 - t)[:, None] + values[edges[:, 1]] * t[:, None]
        both: Vector = np.concatenate([values, extra])
        return both

    k, m = len(one), len(two)
    cut = [
        np.stack([one[:, 0], new[:k], new[k : 2 * k]], axis=1),
        np.stack([new[2 * k : 2 * k + m], two[:, 1], two[:, 2]], axis=1),
        np.stack([new[2 * k : 2 * k + m], two[:, 2], new[2 * k + m :]], axis=1),
    ]
    grown = replace(
        piece,
        vertices_m=mixed(piece.vertices_m),
        triangles=np.concatenate([whole, *cut]),
        weights=mixed(piece.weights),
        colour=mixed(piece.colour),
        part=np.concatenate([tags[0], tags[1], tags[2], tags[2]]),
        morphs={name: mixed(delta) for name, delta in piece.morphs.items()},
        normals=None if piece.normals is None else mixed(piece.normals),
        corner_uv=None,
    )
    return kept(grown, np.ones(len(grown.triangles), dtype=bool))


def _lone_first(triangles: Indices, lone: npt.NDArray[np.bool_]) -> Indices:
    """Turn triangles round until their lone corner comes first."""
    turn = lone.argmax(axis=1)[:, None]
    first: Indices = np.take_along_axis(triangles, (turn + np.arange(3)) % 3, axis=1)
    return first


def border(triangles: Indices) -> Indices:
    """Return the directed edges (e, 2) that belong to one triangle only."""
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    wide = int(triangles.max()) + 1
    keys = edges.min(axis=1) * wide + edges.max(axis=1)
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    lone: Indices = edges[first[count == 1]]
    return lone


def hemmed(piece: Piece, thickness_m: float, shade: float = 0.75) -> Piece:
    """Turn the border of a cloth inwards, so that its edge shows how thick it is."""
    edges = border(piece.triangles)
    rim, index = np.unique(edges, return_inverse=True)
    index = index.reshape(edges.shape) + len(piece.vertices_m)
    normals = vertex_normals(piece.vertices_m, piece.triangles)[rim]
    inner = piece.vertices_m[rim] - thickness_m * normals
    outer_copy = index + len(rim)
    a, b = index[:, 0], index[:, 1]
    c, d = outer_copy[:, 0], outer_copy[:, 1]
    # The rim has its own copy of the outer edge: cloth is bent sharply there.
    strip = np.concatenate([np.stack([d, c, a], axis=1), np.stack([d, a, b], axis=1)])
    owner = np.concatenate([_edge_parts(piece, edges)] * 2)
    add = np.concatenate([rim, rim])
    colour = np.concatenate([piece.colour, piece.colour[rim] * shade, piece.colour[rim]])
    return replace(
        piece,
        vertices_m=np.concatenate([piece.vertices_m, inner, piece.vertices_m[rim]]),
        triangles=np.concatenate([piece.triangles, strip]),
        weights=np.concatenate([piece.weights, piece.weights[add]]),
        colour=colour,
        part=np.concatenate([piece.part, owner]),
        morphs={},
        normals=None,
        corner_uv=None,
    )


def _edge_parts(piece: Piece, edges: Indices) -> Indices:
    """Return the part of the triangle at each border edge."""
    of_vertex = np.zeros(len(piece.vertices_m), dtype=np.int64)
    for k in range(3):
        of_vertex[piece.triangles[:, k]] = piece.part
    parts: Indices = of_vertex[edges[:, 0]]
    return parts


def neighbours(triangles: Indices, n_vertices: int) -> csr_array:
    """Return the averaging matrix (v, v) over neighbours along edges."""
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    codes = np.concatenate(
        [edges[:, 0] * n_vertices + edges[:, 1], edges[:, 1] * n_vertices + edges[:, 0]]
    )
    codes = np.unique(codes)
    edges = np.stack([codes // n_vertices, codes % n_vertices], axis=1)
    degree = np.maximum(np.bincount(edges[:, 0], minlength=n_vertices), 1)
    values = 1 / degree[edges[:, 0]]
    matrix = coo_array((values, (edges[:, 0], edges[:, 1])), shape=(n_vertices, n_vertices))
    return matrix.tocsr()


def hanging(piece: Piece, rounds: int, clearance_m: float | Vector) -> Vector:
    """Return the vertices of cloth that spans hollows but stays outside where it lay.

    Each round smooths the cloth, then pushes it out to at least `clearance_m` before its place
    on the body.
    """
    normals = vertex_normals(piece.vertices_m, piece.triangles)
    average = neighbours(piece.triangles, len(piece.vertices_m))
    least = np.broadcast_to(np.asarray(clearance_m, dtype=np.float64), (len(normals),))
    place = piece.vertices_m + least[:, None] * normals
    rim = np.unique(border(piece.triangles))
    for _ in range(rounds):
        smooth = average @ place
        smooth[rim] = place[rim]
        place = 0.4 * place + 0.6 * smooth
        depth = np.sum((place - piece.vertices_m) * normals, axis=1)
        place += (np.maximum(least - depth, 0.0))[:, None] * normals
    cloth: Vector = place
    return cloth
