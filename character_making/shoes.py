"""Shoes over the tights' feet: an upper, and a sole that closes it below."""

from dataclasses import replace

import numpy as np

from character_making.clothes import Stuff
from character_making.cutting import border, clipped, hanging, hemmed, neighbours
from character_making.figure import SIDES, Figure
from character_making.pieces import Indices, Piece, vertex_normals
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX

SOLE_M = {"sneaker": 0.024, "loafer": 0.016, "boot": 0.026}
_COLLAR_M = {"sneaker": 0.012, "loafer": 0.010, "boot": 0.07}
UPPER_M = 0.005
"""How far off the foot an upper is."""
_ON_SOLE_M, _ARCH_M = 0.012, 0.06
"""Heights above the bare sole where an upper is sewn on its sole, and below which a foot's
underside is made level."""
_WELT = ((-0.001, 0.003), (-0.004, 0.004))
"""A sole's upper edge: metres up from the seam, and out of it."""
_LEANS = (0.5, 0.5, 0.0, 0.0, -0.6)
"""How much the normals of a sole's rows lean up."""
_OUTLINE_ROUNDS = 20
"""How often a sole's outline is smoothed."""
_WEIGHT_ROUNDS = 7
"""How often the weights along a seam are smoothed: unlike neighbours would fold where toes bend."""
_SOLE_ROUNDS = {"sneaker": 0, "loafer": 0, "boot": 20}
"""How often those of a sole below it are smoothed besides: stiff soles bend evenly."""


def shoes(figure: Figure, stuff: Stuff, kind: str, colour: Vector, hem_m: float) -> list[Piece]:
    """Return both shoes; their collars are turned in by `hem_m`."""
    pieces = []
    for side, _ in SIDES:
        pieces += _shoe(figure, stuff, kind, colour, side, hem_m)
    return pieces


def shoe_field(figure: Figure, kind: str, points_m: Vector) -> Vector:
    """Return metres above a shoe's collar (v,)."""
    ankle = figure.at("left_foot")
    field: Vector = points_m[:, 1] - (ankle[1] + _COLLAR_M[kind])
    return field


def _shoe(
    figure: Figure, stuff: Stuff, kind: str, colour: Vector, side: str, hem_m: float
) -> list[Piece]:
    """Return an upper and the sole it is sewn on, without a gap: they share the seam's vertices."""
    x = figure.at(f"{side}_foot")[0]
    whole = stuff.piece
    mine = np.sign(whole.vertices_m[:, 0]) == np.sign(x)
    outside = np.where(mine, shoe_field(figure, kind, whole.vertices_m), 0.5)
    upper = replace(clipped(whole, outside), material="shoe")
    upper = replace(upper, vertices_m=hanging(upper, 16, UPPER_M))
    upper = replace(upper, vertices_m=_level_below(upper, figure.floor_m))
    if hem_m:
        upper = hemmed(upper, hem_m)
    seam_m = figure.floor_m + _ON_SOLE_M
    upper = clipped(upper, seam_m - upper.vertices_m[:, 1])
    upper = replace(
        upper,
        colour=np.tile(colour, (len(upper.vertices_m), 1)),
        part=np.full(len(upper.triangles), PART_INDEX[f"{side}_foot"]),
    )
    seam = _seam(upper, seam_m)
    weights = upper.weights.copy()
    weights[seam] = _smooth(weights[seam], _WEIGHT_ROUNDS)
    upper = replace(upper, weights=weights)
    return [upper, _sole(figure, upper, seam, kind, colour)]


def _level_below(upper: Piece, floor_m: float) -> Vector:
    """Return the vertices of an upper with an underside as level as a sole: no arch."""
    place = upper.vertices_m.copy()
    facing_down = -vertex_normals(place, upper.triangles)[:, 1]
    share = np.clip((facing_down - 0.1) / 0.4, 0, 1) * (place[:, 1] < floor_m + _ARCH_M)
    average = neighbours(upper.triangles, len(place))
    for _ in range(2):
        share = np.maximum(share, average @ share)
    low_m = floor_m + 0.004
    place[:, 1] = np.maximum(place[:, 1] - share * np.maximum(place[:, 1] - low_m, 0), low_m)
    return place


def _sole(figure: Figure, upper: Piece, seam: Indices, kind: str, colour: Vector) -> Piece:
    """Return a slab from the seam of an upper down, with a welt and a level underside."""
    ring = upper.vertices_m[seam]
    n = len(ring)
    out = _outwards(ring)
    floor, thick = figure.floor_m, SOLE_M[kind]
    outline = _smooth(ring, _OUTLINE_ROUNDS)
    rows = [ring]
    for grow_m, y in (
        *((grow_m, ring[:, 1] + up_m) for up_m, grow_m in _WELT),
        (0.005, np.full(n, floor - thick + 0.003)),
        (0.002, np.full(n, floor - thick)),
    ):
        edge = outline + grow_m * out
        edge[:, 1] = y
        rows.append(edge)
    index = np.arange(len(rows) * n).reshape(len(rows), n)
    turn = np.roll(index, -1, axis=1)
    sides = [
        np.stack([index[:-1], turn[:-1], turn[1:]], axis=-1).reshape(-1, 3),
        np.stack([index[:-1], turn[1:], index[1:]], axis=-1).reshape(-1, 3),
    ]
    # The underside goes across, from edge to edge, so that it bends where toes do.
    tip = int(ring[:, 2].argmin())
    order = np.roll(index[-1], -tip)
    half = (n - 1) // 2
    k = np.arange(half)
    one, other = order[k], order[-k % n]
    next_one, next_other = order[k + 1], order[-(k + 1) % n]
    below = np.concatenate(
        [
            np.stack([one, next_one, next_other], axis=1),
            np.stack([one, next_other, other], axis=1)[1:],
        ]
    )
    if n % 2 == 0:
        below = np.concatenate([below, [[order[half], order[half + 1], order[half + 2]]]])
    vertices = np.concatenate(rows)
    weights = upper.weights[seam]
    shade = np.array([0.85, 0.84, 0.80]) if kind == "sneaker" else colour * 0.45
    faces = np.concatenate([*sides, below])
    # Those of the surface would lean to the underside, and thinned sides be dark.
    up = np.array([0.0, 1.0, 0.0])
    normals = [unit(out + lean * up) for lean in _LEANS]
    return Piece(
        vertices_m=vertices,
        triangles=faces,
        weights=np.concatenate(
            [weights, np.tile(_smooth(weights, _SOLE_ROUNDS[kind]), (len(rows) - 1, 1))]
        ),
        colour=np.tile(shade, (len(vertices), 1)),
        part=np.full(len(faces), upper.part[0]),
        material="shoe",
        normals=np.concatenate(normals),
    )


def _seam(upper: Piece, seam_m: float) -> Indices:
    """Return the vertices of an upper's lower edge in order, clockwise as seen from above."""
    edges = border(upper.triangles)
    edges = edges[(np.abs(upper.vertices_m[edges, 1] - seam_m) < 1e-3).all(axis=1)]
    following = {int(a): int(b) for b, a in edges}
    loops: list[list[int]] = []
    while following:
        at = next(iter(following))
        loop = []
        while at in following:
            loop.append(at)
            at = following.pop(at)
        loops.append(loop)
    seam: Indices = np.array(max(loops, key=len), dtype=np.int64)
    return seam


def _outwards(ring: Vector) -> Vector:
    """Return level unit vectors (n, 3) out of a closed outline, smooth along it."""
    along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    out = unit(np.cross(along, np.array([0.0, 1.0, 0.0])))
    if np.sum(out * (ring - ring.mean(axis=0))) < 0:
        out = -out
    return unit(_smooth(out, _OUTLINE_ROUNDS))


def _smooth(ring: Vector, rounds: int) -> Vector:
    for _ in range(rounds):
        ring = 0.5 * ring + 0.25 * (np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0))
    return ring
