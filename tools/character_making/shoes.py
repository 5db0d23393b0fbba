"""Shoes over the tights' feet: an upper, a sole with an edge."""

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from lab.geometry import Vector
from stimuli.characters.body_parts import PART_INDEX
from tools.character_making.clothes import Stuff
from tools.character_making.cutting import clipped, hanging, hemmed
from tools.character_making.figure import SIDES, Figure
from tools.character_making.pieces import Piece

SOLE_M = {"sneaker": 0.024, "loafer": 0.016, "boot": 0.026}
_COLLAR_M = {"sneaker": 0.012, "loafer": -0.016, "boot": 0.07}


def shoes(figure: Figure, stuff: Stuff, kind: str, colour: Vector) -> list[Piece]:
    """Return both shoes."""
    pieces = []
    for side, _ in SIDES:
        pieces += _shoe(figure, stuff, kind, colour, side)
    return pieces


def shoe_field(figure: Figure, stuff: Stuff, kind: str, points_m: Vector) -> Vector:
    """Return metres above a shoe's collar (v,)."""
    ankle = figure.at("left_foot")
    collar = ankle[1] + _COLLAR_M[kind]
    field: Vector = points_m[:, 1] - collar
    if kind == "loafer":
        field = field - 0.10 * np.clip((points_m[:, 2] - ankle[2]), 0, 0.1) + 0.0
    return field


def _shoe(figure: Figure, stuff: Stuff, kind: str, colour: Vector, side: str) -> list[Piece]:
    x = figure.at(f"{side}_foot")[0]
    whole = stuff.piece
    mine = np.sign(whole.vertices_m[:, 0]) == np.sign(x)
    outside = np.where(mine, shoe_field(figure, stuff, kind, whole.vertices_m), 0.5)
    upper = replace(clipped(whole, outside), material="shoe")
    vertices = hanging(upper, 16, 0.005)
    floor = figure.floor_m
    low = floor + 0.004
    # Toes get room: what is in front of the ball is at least as high as a toe box.
    vertices[:, 1] = np.maximum(vertices[:, 1], low)
    part = PART_INDEX[f"{side}_foot"]
    upper = replace(
        upper,
        vertices_m=vertices,
        colour=np.tile(colour, (len(vertices), 1)),
        part=np.full(len(upper.triangles), part),
    )
    sole = _sole(figure, upper, kind, side, colour)
    return [hemmed(upper, 0.004), sole]


def _sole(figure: Figure, upper: Piece, kind: str, side: str, colour: Vector) -> Piece:
    """Return a slab under the outline of the upper with a level underside."""
    floor, thick = figure.floor_m, SOLE_M[kind]
    points = upper.vertices_m[upper.vertices_m[:, 1] < floor + 0.05][:, [0, 2]]
    hull = ConvexHull(points)
    ring = points[hull.vertices]
    ring = _even(ring, 40)
    centre = ring.mean(axis=0)
    out = ring - centre
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    rows = [(floor + 0.011, 0.0005), (floor + 0.010, 0.004), (floor - thick + 0.003, 0.005),
            (floor - thick, 0.002)]  # fmt: skip
    vertices = []
    for y, grow in rows:
        edge = ring + grow * out
        vertices.append(np.stack([edge[:, 0], np.full(len(edge), y), edge[:, 1]], axis=1))
    n = len(ring)
    flat = np.concatenate([*vertices, [[centre[0], floor - thick, centre[1]]]])
    index = np.arange(4 * n).reshape(4, n)
    turn = np.roll(index, -1, axis=1)
    triangles = [
        np.stack([index[:-1], turn[:-1], turn[1:]], axis=-1).reshape(-1, 3),
        np.stack([index[:-1], turn[1:], index[1:]], axis=-1).reshape(-1, 3),
        np.stack([index[3], turn[3], np.full(n, 4 * n)], axis=1),
    ]
    faces = np.concatenate(triangles)
    a, b, c = (flat[faces[:, k]] for k in range(3))
    if np.mean(np.sum(np.cross(b - a, c - a) * ((a + b + c) / 3 - flat.mean(axis=0)), axis=1)) < 0:
        faces = faces[:, ::-1]
    weights = np.zeros((len(flat), len(figure.rig.skeleton.names)))
    toes = np.clip((figure.at(f"{side}_toes")[2] - flat[:, 2]) / 0.03 + 0.5, 0, 1)
    weights[:, figure.rig.skeleton.index(f"{side}_toes")] = toes
    weights[:, figure.rig.skeleton.index(f"{side}_foot")] = 1 - toes
    shade = np.array([0.85, 0.84, 0.80]) if kind == "sneaker" else colour * 0.45
    return Piece(
        vertices_m=flat,
        triangles=faces,
        weights=weights,
        colour=np.tile(shade, (len(flat), 1)),
        part=np.full(len(faces), PART_INDEX[f"{side}_foot"]),
        material="shoe",
    )


def _even(ring: Vector, n: int) -> Vector:
    """Return n points at even steps along a closed outline."""
    closed = np.concatenate([ring, ring[:1]])
    steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    place = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0, place[-1], n, endpoint=False)
    return np.stack([np.interp(at, place, closed[:, k]) for k in range(2)], axis=1)
