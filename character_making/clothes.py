"""Clothes cut from the base mesh's tights: tops with sleeves, and trousers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from character_making.cloth_places import (
    Lines,
    limb_axis_distance,
    lines_of,
    on_side,
    wrapped_uv,
)
from character_making.cutting import border, clipped, hanging, hemmed, neighbours
from character_making.drape import Fabric, Outside, draped, mantle_over
from character_making.figure import Figure
from character_making.hems import LENGTH
from character_making.makehuman import MakeHuman
from character_making.pieces import (
    Piece,
    refined,
    triangulated,
    vertex_normals,
)
from character_making.recipes import Garment
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.tagging import parts_of_weights

KNIT = Fabric(ease_around=0.03)
LOOSE = Fabric(ease_around=0.045, ease_along=0.04, bend=3.0)
TROUSERS = Fabric(ease_around=0.06, ease_along=0.09)


@dataclass(frozen=True)
class Cut:
    """A pattern. `sleeve` ends at this place of the arm (0 shoulder, 1 elbow, 2 wrist); `hem` is
    the share of the way from hip (0) to crotch (1); `neck` how wide the neckline is, metres;
    `v_neck` how deep it dips; `clearance_m` from the skin; `rounds` of hanging; `open_m` half
    width of an open front; `flare_m` what sleeves are wider by; `inward` how much the cloth turns
    in below the chest, metres a metre; `collar` how large a folded collar is;
    `length` how far below the joints of the thighs it ends at most, in statures;
    `buttoned_m` how far down a front with buttons goes at most. Without a `placket` they are on the
    cloth itself: on plain cloth, which comes through it where thinned, the strip looks torn.
    """

    sleeve: float = 1.93
    hem: float = 0.55
    neck: float = 0.012
    v_neck: float = 0.0
    clearance_m: float = 0.007
    rounds: int = 12
    open_m: float = 0.0
    flare_m: float = 0.004
    thickness_m: float = 0.003
    inward: float = 0.06
    collar: float = 1.0
    length: float = LENGTH
    buttoned_m: float = 0.6
    placket: bool = True
    fabric: Fabric = KNIT


TOPS: Mapping[str, Cut] = {
    "tee": Cut(sleeve=0.62, hem=0.55, neck=0.010, flare_m=0.012, fabric=LOOSE),
    "polo": Cut(sleeve=0.66, hem=0.55, neck=0.004, flare_m=0.012, buttoned_m=0.13, fabric=LOOSE),
    "jumper": Cut(sleeve=1.95, hem=0.6, neck=0.007, clearance_m=0.011, rounds=22,
                  flare_m=0.010, thickness_m=0.005),
    "shirt": Cut(sleeve=1.93, hem=0.75, neck=0.002, clearance_m=0.007, rounds=18, flare_m=0.010,
                 fabric=LOOSE),
    "jacket": Cut(sleeve=1.90, hem=0.95, neck=0.02, v_neck=0.30, clearance_m=0.017, rounds=30,
                  open_m=0.0015, flare_m=0.014, thickness_m=0.005),
    "cardigan": Cut(sleeve=1.92, hem=0.8, neck=0.02, v_neck=0.24, clearance_m=0.014, rounds=24,
                    open_m=0.0015, flare_m=0.010, thickness_m=0.005),
}  # fmt: skip

_OVER_SHOES_M, _SHOES_TO_M = 0.009, 0.11
_NECKLINE_M, _SETTLES_M, _RIM_OFF_M = 0.14, 0.04, 0.003
"""How far from the neck's joint necklines are, and from where on and how close a shirt's comes to
the skin."""
_TRUNK_ENDS, _EVEN_ROUNDS, _FRONT_M, _SEAM_M = 0.4, 160, 0.012, 0.03


def cut_of(garment: Garment) -> Cut:
    """Return the pattern of a top with its own changes."""
    return replace(TOPS[garment.kind], **garment.cut)


@dataclass(frozen=True, eq=False)
class Stuff:
    """The refined helper meshes of one figure, uncut."""

    piece: Piece
    lines: Lines


class Tailor:
    """Holds what is the same for everybody: the refinement of the tights."""

    def __init__(self, source: MakeHuman) -> None:
        used, quads = np.unique(source.quads("helper-tights"), return_inverse=True)
        refinement = refined(quads.reshape(-1, 4), len(used))
        self._pattern = (used, refinement, refinement.matrix @ source.weights[used])

    def stuff(self, figure: Figure) -> Stuff:
        """Return the tights of a figure, refined, white."""
        used, refinement, weights = self._pattern
        vertices = refinement.matrix @ figure.vertices_m[used]
        triangles = triangulated(refinement.quads)
        parts = parts_of_weights(weights, triangles, figure.rig.skeleton.names)
        piece = Piece(vertices, triangles, weights, np.ones_like(vertices), parts, "top")
        return Stuff(piece, lines_of(figure))


def top_field(figure: Figure, lines: Lines, cut: Cut, points_m: Vector, weights: Vector) -> Vector:
    """Return metres outside a top (v,): negative where it covers."""
    sleeve = 0.26 * (figure.arm_s(points_m, weights) - cut.sleeve)
    hem_m = lines.hip + cut.hem * (lines.crotch - lines.hip)
    below = hem_m - points_m[:, 1]
    # The neckline is an oval round the neck, deeper in front; all above it is bare.
    neck = figure.at("neck")
    scale = figure.stature_m / 1.72
    across = points_m[:, 0] / (0.056 * scale + cut.neck)
    back = points_m[:, 2] - (neck[2] + 0.004)
    deep = np.where(back < 0, 0.052 * scale + 1.6 * cut.neck, 0.056 * scale + 0.6 * cut.neck)
    reach = np.hypot(across, back / deep)
    deepest = np.interp(back, [-0.03, 0.02], [0.13, 0.0])
    oval = np.minimum((1 - reach) * 0.07, points_m[:, 1] - neck[1] + deepest)
    slope = 0.82 * (points_m[:, 1] - neck[1] + 1.2 * cut.neck - 0.004) - 0.57 * back
    throat = np.minimum(slope, (1 - reach / 1.6) * 0.1)
    under_chin = np.minimum(points_m[:, 1] - (neck[1] - 0.04 * scale), -0.04 * scale - back)
    oval = np.maximum.reduce([oval, throat, np.where(np.abs(across) < 1.4, under_chin, -1.0)])
    above = np.maximum(oval, points_m[:, 1] - (neck[1] + 0.045 * scale))
    on_arm = sum(on_side(figure, weights, "arm").values())
    fields = [sleeve, np.where(on_arm > 0.5, -1.0, below), np.where(on_arm > 0.5, -1.0, above)]
    if cut.v_neck or cut.open_m:
        dip = neck[1] - cut.v_neck
        spread = 0.075 * np.clip((points_m[:, 1] - dip) / max(cut.v_neck, 0.01), 0, 1.4)
        gap = np.maximum(spread, cut.open_m) - np.abs(points_m[:, 0])
        # Behind the neck nothing is open.
        gap = gap - 5 * np.maximum(points_m[:, 2] - neck[2] - 0.01, 0)
        fields.append(np.where(np.abs(points_m[:, 0]) < 0.14, gap, -1.0))
    outside: Vector = np.maximum.reduce(fields)
    return outside


def trouser_field(lines: Lines, points_m: Vector, hem_m: float, top_m: float) -> Vector:
    """Return metres outside trousers (v,)."""
    return np.maximum(points_m[:, 1] - top_m, lines.ankle + hem_m - points_m[:, 1])


def top(figure: Figure, stuff: Stuff, garment: Garment, seed: int, over: Sequence[Piece]) -> Piece:
    """Return a top with sleeves that hangs over the body and over what is worn below it."""
    cut = cut_of(garment)
    lines, piece = stuff.lines, stuff.piece
    # Cut where the trunk is still one; below the crotch cloth hangs, and is not between the legs.
    short = replace(cut, hem=min(cut.hem, _TRUNK_ENDS))
    piece = clipped(piece, top_field(figure, lines, short, piece.vertices_m, piece.weights))
    hips = np.clip((lines.waist - piece.vertices_m[:, 1]) / 0.1, 0, 1)
    arms = np.sum([*on_side(figure, piece.weights, "arm").values()], axis=0)
    clearance = cut.clearance_m + 0.004 * hips * (arms < 0.5)
    piece = replace(piece, vertices_m=hanging(piece, cut.rounds, clearance))
    piece = replace(piece, vertices_m=_loose_sleeves(figure, piece, cut))
    axis_m = np.array([0.0, 0.0, figure.at("hips")[2]])
    height = piece.vertices_m[:, 1]
    moves = np.clip((lines.chest + 0.06 - height) / 0.08, 0, 1) * np.clip(1 - 2.5 * arms, 0, 1)
    bust_m = lines.chest - 0.02
    rim: npt.NDArray[np.bool_] = np.zeros(len(arms), dtype=bool)
    rim[np.unique(border(piece.triangles))] = True
    hem_m = lines.hip + cut.hem * (lines.crotch - lines.hip)
    cut_m = lines.hip + short.hem * (lines.crotch - lines.hip)
    hem = rim & (arms < 0.5) & (height < cut_m + 0.03)
    piece.vertices_m[hem, 1] = cut_m
    piece = _spanning(piece, axis_m, moves, cut.inward, bust_m, rim)
    longer = np.clip((lines.waist - piece.vertices_m[:, 1]) / (lines.waist - cut_m), 0, 1)
    piece.vertices_m[:, 1] -= (cut_m - hem_m) * longer * (arms < 0.5)
    held = rim & np.where(arms > 0.5, cut.sleeve > 1.5, ~hem)
    place = draped(
        piece,
        [stuff.piece, *over],
        held,
        _threads(figure, piece, "arm"),
        arms > 0.5,
        cut.fabric,
        0.7 * clearance,
        seed,
    )
    return replace(piece, vertices_m=place)


def shirt_below(figure: Figure, stuff: Stuff, garment: Garment, *, collared: bool) -> Piece:
    """Return a shirt that lies close, to be worn below a jacket; a neckline without a collar lies
    on the skin.
    """
    cut = cut_of(garment)
    piece = stuff.piece
    outside = shirt_field(
        figure, stuff, garment, piece.vertices_m, piece.weights, collared=collared
    )
    piece = replace(clipped(piece, outside), material="under")
    place = hanging(piece, cut.rounds, cut.clearance_m)
    if collared:
        return replace(piece, vertices_m=place)
    skin = Outside(figure.body_m, triangulated(figure.source.quads("body")))
    rim = place[np.unique(border(piece.triangles))]
    rim = rim[np.linalg.norm(rim - figure.at("neck"), axis=1) < _NECKLINE_M]
    away_m, _ = cKDTree(rim).query(place)
    free = np.clip(np.asarray(away_m) / _SETTLES_M, 0, 1)
    place = skin.held(place, np.where(free < 1, _RIM_OFF_M + 0.01 * free, np.inf))
    return replace(piece, vertices_m=place)


def shirt_field(
    figure: Figure,
    stuff: Stuff,
    garment: Garment,
    points_m: Vector,
    weights: Vector,
    *,
    collared: bool,
) -> Vector:
    """Return metres outside a shirt below a jacket (v,). Without a collar its neckline is round:
    where the parts of a top's neckline meet it has corners, over which no band lies.
    """
    cut, piece = cut_of(garment), stuff.piece
    outside = top_field(figure, stuff.lines, cut, points_m, weights)
    if collared:
        return outside
    whole = top_field(figure, stuff.lines, cut, piece.vertices_m, piece.weights)
    angular = clipped(piece, whole)
    neck = figure.at("neck")
    rim = angular.vertices_m[np.unique(border(angular.triangles))] - neck
    angle, away, height = _round_neck(rim[np.linalg.norm(rim, axis=1) < _NECKLINE_M])
    order = np.argsort(angle)
    even = np.linspace(-np.pi, np.pi, _ROUND_AT, endpoint=False)
    fading = np.exp(-((np.arange(_ROUND_AT // 2 + 1) / _ROUND_WAVES) ** 2))
    d = points_m - neck
    at, out, up = _round_neck(d)
    edge_out, edge_up = (
        np.interp(
            at,
            even,
            np.fft.irfft(
                fading * np.fft.rfft(np.interp(even, angle[order], line[order], period=2 * np.pi)),
                _ROUND_AT,
            ),
            period=2 * np.pi,
        )
        for line in (away, height)
    )
    within = 0.7 * (up - edge_up) + 0.7 * (edge_out - out)
    near = np.linalg.norm(d, axis=1) < _NECKLINE_M
    return np.where(near, within, outside)


def _round_neck(off_m: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the angles (n,) of points off the neck's joint from the front, in radians, how far
    from its axis they are, and how high.
    """
    x, y, z = off_m.T
    return np.arctan2(x, -z), np.hypot(x, z), y


_ROUND_AT, _ROUND_WAVES = 96, 3.2
"""At how many angles a round neckline is known, and how many waves of it are left round the neck.
"""


def _spanning(
    piece: Piece,
    axis_m: Vector,
    moves: Vector,
    inward: float,
    top_m: float,
    rim: npt.NDArray[np.bool_],
) -> Piece:
    """Return a cloth that spans hollows, its vertices spread evenly over what they span."""
    average = neighbours(piece.triangles, len(moves))
    along_rim = border(piece.triangles)
    # The edges of an open front stay side by side.
    front = rim & (np.abs(piece.vertices_m[:, 0]) < _FRONT_M)
    front &= piece.vertices_m[:, 2] < axis_m[2]
    hung = mantle_over(piece.vertices_m, axis_m, moves > 0.05, inward, top_m)
    place = hung.around(piece.vertices_m, moves)
    for _ in range(_EVEN_ROUNDS):
        even = average @ place
        both, count = np.zeros_like(place), np.zeros((len(place), 1))
        for a, b in ((0, 1), (1, 0)):
            np.add.at(both, along_rim[:, a], place[along_rim[:, b]])
            np.add.at(count, along_rim[:, a], 1.0)
        even[rim] = 0.5 * place[rim] + 0.5 * both[rim] / np.maximum(count[rim], 1.0)
        even[front, 0] = piece.vertices_m[front, 0]
        place = hung.around(place + 0.7 * moves[:, None] * (even - place), moves)
    return replace(piece, vertices_m=place)


def _threads(figure: Figure, piece: Piece, limb: str) -> Vector:
    """Return unit vectors (v, 3) down the trunk and along the limbs."""
    down = np.tile([0.0, -1.0, 0.0], (len(piece.vertices_m), 1))
    last = {"arm": ("upper_arm", "hand"), "leg": ("upper_leg", "foot")}[limb]
    for side, share in on_side(figure, piece.weights, limb).items():
        start, end = (figure.at(f"{side}_{joint}") for joint in last)
        down[share > 0.5] = unit(end - start)
    return down


def _loose_sleeves(figure: Figure, piece: Piece, cut: Cut) -> Vector:
    """Widen sleeves to a smooth tube that narrows to the wrist."""
    vertices = piece.vertices_m.copy()
    for side, share in on_side(figure, piece.weights, "arm").items():
        place, foot, distance = limb_axis_distance(figure, vertices, side, "arm")
        wide = np.interp(place, [0.2, 0.8, 1.0, 1.6, 2.0], [0.056, 0.052, 0.049, 0.043, 0.036])
        wide = wide * figure.stature_m / 1.72 + cut.flare_m
        grow = np.clip((share - 0.75) / 0.25, 0, 1) * np.clip((place - 0.15) / 0.4, 0, 1)
        target = np.maximum(distance, 0.35 * distance + 0.65 * wide)
        vertices += ((target - distance) * grow / np.maximum(distance, 1e-6))[:, None] * (
            vertices - foot
        )
    return vertices


def trousers(figure: Figure, stuff: Stuff, garment: Garment, top_m: float, seed: int) -> Piece:
    """Return trousers up to the height `top_m`."""
    piece = replace(stuff.piece, material="bottom")
    hem = garment.cut.get("hem_m", -0.015)
    piece = clipped(piece, trouser_field(stuff.lines, piece.vertices_m, hem, top_m))
    piece = replace(piece, vertices_m=hanging(piece, 10, 0.005 + _over_shoes(piece, stuff.lines)))
    vertices = piece.vertices_m.copy()
    for side, share in on_side(figure, piece.weights, "leg").items():
        place, foot, distance = limb_axis_distance(figure, vertices, side, "leg")
        wide = np.interp(place, [0.3, 1.0, 1.5, 2.0], [0.085, 0.073, 0.066, 0.064])
        wide = wide * figure.stature_m / 1.72 * garment.cut.get("width", 1.0)
        grow = np.clip((share - 0.8) / 0.2, 0, 1) * np.clip((place - 0.25) / 0.5, 0, 1)
        target = np.maximum(distance, 0.2 * distance + 0.8 * wide)
        vertices += ((target - distance) * grow / np.maximum(distance, 1e-6))[:, None] * (
            vertices - foot
        )
    piece = replace(piece, vertices_m=vertices)
    legs = np.sum([*on_side(figure, piece.weights, "leg").values()], axis=0)
    height = vertices[:, 1]
    axis_m = np.array([0.0, 0.0, figure.at("hips")[2]])
    # What faces down, between the legs, is sewn there and spans nothing.
    down = -vertex_normals(vertices, piece.triangles)[:, 1]
    moves = np.clip((height - stuff.lines.crotch - 0.01) / 0.06, 0, 1)
    moves *= np.clip(1.5 - 2.5 * down, 0, 1)
    held = (np.abs(vertices[:, 0]) < _SEAM_M) & (height < stuff.lines.crotch + 2 * _SEAM_M)
    held[np.unique(border(piece.triangles))] = True
    moves[held] = 0.0
    piece = _spanning(piece, axis_m, moves, 0.3, stuff.lines.hip, held)
    place = draped(
        piece,
        [stuff.piece],
        held,
        _threads(figure, piece, "leg"),
        legs > 0.5,
        TROUSERS,
        0.004 + _over_shoes(piece, stuff.lines),
        seed,
    )
    return replace(piece, vertices_m=place)


def _over_shoes(piece: Piece, lines: Lines) -> Vector:
    """Return how much farther off the leg (v,) trousers are where shoes are worn below them."""
    height_m: Vector = piece.vertices_m[:, 1] - lines.ankle
    return _OVER_SHOES_M * np.clip((_SHOES_TO_M - height_m) / 0.04, 0, 1)


def finished(figure: Figure, piece: Piece, colour: Vector, thickness_m: float) -> Piece:
    """Colour a cloth, shade its folds and armpits a little, hem it and lay its texture."""
    normals = vertex_normals(piece.vertices_m, piece.triangles)
    shade = 1.0 - 0.10 * np.clip(-normals[:, 1], 0, 1)
    piece = replace(piece, colour=shade[:, None] * colour)
    piece = hemmed(piece, thickness_m)
    return replace(piece, corner_uv=wrapped_uv(figure, piece))
