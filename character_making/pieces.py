"""Pieces a person is put together from: body, eyes, hair and clothes, all as sculpted."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from visavis.lab.geometry import Vector

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Piece:
    """A surface: `triangles` (t, 3) of `vertices_m` (v, 3), `weights` (v, 55), `colour` (v, 3)
    sRGB 0…1, `corner_uv` (t, 3, 2) or None, `part` (t,), `material` by name, `morphs` as
    displacements (v, 3). `normals` (v, 3) replace those of the surface. Small folds that are
    looked at, `is_trim`, are thinned by themselves.
    """

    vertices_m: Vector
    triangles: Indices
    weights: Vector
    colour: Vector
    part: Indices
    material: str
    corner_uv: Vector | None = None
    morphs: Mapping[str, Vector] = field(default_factory=dict)
    normals: Vector | None = None
    is_trim: bool = False


def triangulated(quads: Indices) -> Indices:
    """Cut every quad in two."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def vertex_normals(vertices_m: Vector, triangles: Indices) -> Vector:
    """Return unit normals (v, 3), weighted by area; zero where no triangle is."""
    a, b, c = (vertices_m[triangles[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices_m)
    for k in range(3):
        np.add.at(normals, triangles[:, k], flat)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Vector = normals / np.where(length == 0, 1.0, length)
    return unit


def kept(piece: Piece, keep: npt.NDArray[np.bool_]) -> Piece:
    """Return the piece with the triangles `keep` (t,) and the vertices they need."""
    triangles = piece.triangles[keep]
    used, inverse = np.unique(triangles, return_inverse=True)
    return replace(
        piece,
        vertices_m=piece.vertices_m[used],
        triangles=inverse.reshape(triangles.shape),
        weights=piece.weights[used],
        colour=piece.colour[used],
        part=piece.part[keep],
        corner_uv=None if piece.corner_uv is None else piece.corner_uv[keep],
        morphs={name: delta[used] for name, delta in piece.morphs.items()},
        normals=None if piece.normals is None else piece.normals[used],
    )


@dataclass(frozen=True, eq=False)
class Refinement:
    """Catmull–Clark refinement of quads: `matrix` (finer, v) gives the new vertices."""

    matrix: csr_array
    quads: Indices
    parent: Indices


def refined(quads: Indices, n_vertices: int) -> Refinement:
    """Cut every quad in four and smooth; borders follow the cubic of their edge."""
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, edge_of = np.unique(edges, axis=0, return_inverse=True)
    edge_of = edge_of.reshape(quads.shape)
    n_e, n_f = len(unique), len(quads)
    use = np.bincount(edge_of.ravel(), minlength=n_e)
    rows, cols, values = [], [], []

    def put(r: Indices, c: Indices, w: npt.ArrayLike) -> None:
        r, c, w = np.broadcast_arrays(r, c, np.asarray(w, dtype=float))
        rows.append(r.ravel())
        cols.append(c.ravel())
        values.append(w.ravel())

    face_row = n_vertices + n_e + np.arange(n_f)
    put(face_row[:, None], quads, 0.25)
    inner = use == 2
    edge_row = n_vertices + np.arange(n_e)
    put(edge_row[:, None], unique, np.where(inner, 0.25, 0.5)[:, None])
    corner_edges = edge_of.ravel()
    faces = np.repeat(np.arange(n_f), 4)
    sel = inner[corner_edges]
    put(edge_row[corner_edges[sel]][:, None], quads[faces[sel]], 0.0625)
    on_border = np.zeros(n_vertices, dtype=bool)
    on_border[unique[~inner].ravel()] = True
    valence = np.maximum(np.bincount(unique.ravel(), minlength=n_vertices), 1).astype(float)
    every = np.arange(n_vertices)
    put(every, every, np.where(on_border, 0.75, (valence - 3) / valence))
    for a, b in ((0, 1), (1, 0)):
        border = ~inner
        put(unique[border, a], unique[border, b], 0.125)
        put(
            unique[:, a][inner],
            unique[:, a][inner],
            np.where(on_border[unique[inner, a]], 0, 1 / valence[unique[inner, a]] ** 2),
        )
        put(
            unique[:, a][inner],
            unique[:, b][inner],
            np.where(on_border[unique[inner, a]], 0, 1 / valence[unique[inner, a]] ** 2),
        )
    flat = quads.ravel()
    w = np.where(on_border[flat], 0, 0.25 / valence[flat] ** 2)
    put(flat[:, None], np.repeat(quads, 4, axis=0), w[:, None])
    total = n_vertices + n_e + n_f
    matrix = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))),
        shape=(total, n_vertices),
    ).tocsr()
    e = n_vertices + edge_of
    f = face_row
    finer = np.concatenate(
        [np.stack([quads[:, k], e[:, k], f, e[:, k - 1]], axis=1) for k in range(4)]
    )
    return Refinement(matrix, finer, np.tile(np.arange(n_f), 4))
