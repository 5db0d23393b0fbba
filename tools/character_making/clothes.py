"""Clothes cut from the base mesh's tights: tops with sleeves, and trousers."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lab.geometry import Vector, unit
from stimuli.characters.tagging import parts_of_weights
from tools.character_making.cloth_places import (
    Lines,
    limb_axis_distance,
    lines_of,
    on_side,
    wrapped_uv,
)
from tools.character_making.cutting import clipped, hanging, hemmed
from tools.character_making.figure import Figure
from tools.character_making.makehuman import MakeHuman
from tools.character_making.pieces import (
    Piece,
    refined,
    triangulated,
    vertex_normals,
)
from tools.character_making.recipes import Garment


@dataclass(frozen=True)
class Cut:
    """A pattern. `sleeve` ends at this place of the arm (0 shoulder, 1 elbow, 2 wrist); `hem` is
    the share of the way from hip (0) to crotch (1); `neck` how wide the neckline is, metres;
    `v_neck` how deep it dips; `clearance_m` from the skin; `rounds` of hanging; `open_m` half
    width of an open front; `flare_m` what sleeves are wider by.
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


TOPS: Mapping[str, Cut] = {
    "tee": Cut(sleeve=0.62, hem=0.55, neck=0.016, flare_m=0.012),
    "polo": Cut(sleeve=0.66, hem=0.55, neck=0.004, flare_m=0.012),
    "jumper": Cut(sleeve=1.95, hem=0.6, neck=0.014, clearance_m=0.011, rounds=22,
                  flare_m=0.010, thickness_m=0.005),
    "shirt": Cut(sleeve=1.93, hem=0.75, neck=0.002, clearance_m=0.007, rounds=18, flare_m=0.010),
    "jacket": Cut(sleeve=1.90, hem=0.95, neck=0.02, v_neck=0.30, clearance_m=0.017, rounds=30,
                  open_m=0.0015, flare_m=0.014, thickness_m=0.005),
    "cardigan": Cut(sleeve=1.92, hem=0.8, neck=0.02, v_neck=0.24, clearance_m=0.014, rounds=24,
                    open_m=0.0015, flare_m=0.010, thickness_m=0.005),
}  # fmt: skip


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
        gap = gap - 2 * np.maximum(points_m[:, 2] - neck[2] - 0.01, 0)
        fields.append(np.where(np.abs(points_m[:, 0]) < 0.14, gap, -1.0))
    outside: Vector = np.maximum.reduce(fields)
    return outside


def trouser_field(lines: Lines, points_m: Vector, hem_m: float, top_m: float) -> Vector:
    """Return metres outside trousers (v,)."""
    return np.maximum(points_m[:, 1] - top_m, lines.ankle + hem_m - points_m[:, 1])


def top(figure: Figure, stuff: Stuff, garment: Garment, seed: int) -> Piece:
    """Return a top with sleeves, hung and hemmed."""
    cut = cut_of(garment)
    piece = stuff.piece
    outside = top_field(figure, stuff.lines, cut, piece.vertices_m, piece.weights)
    piece = clipped(piece, outside)
    hips = np.clip((stuff.lines.waist - piece.vertices_m[:, 1]) / 0.1, 0, 1)
    arms = sum(on_side(figure, piece.weights, "arm").values())
    clearance = cut.clearance_m + 0.006 * hips * (arms < 0.5)
    vertices = hanging(piece, cut.rounds, clearance)
    piece = replace(piece, vertices_m=vertices)
    piece = replace(piece, vertices_m=_loose_sleeves(figure, piece, cut))
    piece = replace(piece, vertices_m=_folded(figure, piece, seed, 0.0035))
    return piece


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


def _folded(figure: Figure, piece: Piece, seed: int, depth_m: float) -> Vector:
    """Press folds into cloth: slanting across the trunk, rings at elbow and knee."""
    rng = np.random.default_rng(seed)
    normals = vertex_normals(piece.vertices_m, piece.triangles)
    p = piece.vertices_m
    depth = np.zeros(len(p))
    for _ in range(7):
        direction = unit(rng.normal(size=3) * np.array([1.0, 0.7, 0.6]))
        wave, phase = rng.uniform(60, 130), rng.uniform(0, 2 * np.pi)
        bend = 0.02 * np.sin(p @ unit(rng.normal(size=3)) * 25 + phase)
        depth += np.sin((p @ direction + bend) * wave + phase) / 7
    strength = np.full(len(p), 0.5)
    for limb in ("arm", "leg"):
        for side, share in on_side(figure, piece.weights, limb).items():
            place, _, _ = limb_axis_distance(figure, p, side, limb)
            near = np.exp(-(((place - 1.0) / 0.28) ** 2)) + 0.7 * np.exp(
                -(((place - 1.85) / 0.15) ** 2)
            )
            ring = np.sin(place * 52 + 3 * np.sin(p @ np.array([31.0, 9.0, 23.0])))
            on = np.clip((share - 0.6) / 0.4, 0, 1)
            depth += on * near * ring * 0.9
            strength = np.where(share > 0.5, 0.8, strength)
    moved: Vector = p + (depth_m * strength * np.clip(depth, -1, 1))[:, None] * normals
    return moved


def trousers(figure: Figure, stuff: Stuff, garment: Garment, top_m: float, seed: int) -> Piece:
    """Return trousers up to the height `top_m`."""
    piece = replace(stuff.piece, material="bottom")
    hem = garment.cut.get("hem_m", -0.015)
    piece = clipped(piece, trouser_field(stuff.lines, piece.vertices_m, hem, top_m))
    piece = replace(piece, vertices_m=hanging(piece, 10, 0.005))
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
    return replace(piece, vertices_m=_folded(figure, piece, seed, 0.004))


def finished(figure: Figure, piece: Piece, colour: Vector, thickness_m: float) -> Piece:
    """Colour a cloth, shade its folds and armpits a little, hem it and lay its texture."""
    normals = vertex_normals(piece.vertices_m, piece.triangles)
    shade = 1.0 - 0.10 * np.clip(-normals[:, 1], 0, 1)
    piece = replace(piece, colour=shade[:, None] * colour)
    piece = hemmed(piece, thickness_m)
    return replace(piece, corner_uv=wrapped_uv(figure, piece))
