"""Where cloth lies on a body: trunk, sleeves and legs, and the texture places along each."""

from dataclasses import dataclass

import numpy as np

from character_making.figure import SIDES, Figure
from character_making.pieces import Piece
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX

TILE_M = 0.08
"""Side of one repeat of a cloth's texture."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Heights on the clothed body in metres, as sculpted."""

    floor: float
    ankle: float
    knee: float
    crotch: float
    hip: float
    waist: float
    chest: float


def lines_of(figure: Figure) -> Lines:
    """Return the heights that garments are cut by."""
    crotch = figure.at("left_upper_leg")[1] - 0.055 * figure.stature_m
    waist = figure.at("chest")[1] + 0.3 * (figure.at("upper_chest")[1] - figure.at("chest")[1])
    return Lines(
        floor=figure.floor_m,
        ankle=float(figure.at("left_foot")[1]),
        knee=float(figure.at("left_lower_leg")[1]),
        crotch=float(crotch),
        hip=float(figure.at("hips")[1]),
        waist=float(waist),
        chest=float(figure.at("upper_chest")[1] + 0.05 * figure.stature_m),
    )


_REGIONS = {
    "trunk": ("torso", "pelvis", "neck", "face", "scalp"),
    **{
        f"{side} {first} {last}": tuple(f"{side}_{part}" for part in parts)
        for side in ("left", "right")
        for first, last, parts in (
            ("upper_arm", "lower_arm", ("upper_arm",)),
            ("lower_arm", "hand", ("forearm", "hand")),
            ("upper_leg", "lower_leg", ("thigh",)),
            ("lower_leg", "foot", ("shin", "foot")),
        )
    },
}


def _axis(figure: Figure, region: str) -> tuple[Vector, Vector]:
    """Return start and direction of the line a region's cloth is wrapped round."""
    if region == "trunk":
        low, high = figure.at("hips"), figure.at("neck")
    else:
        side, first, last = region.split()
        low, high = figure.at(f"{side}_{last}"), figure.at(f"{side}_{first}")
    return low, unit(high - low)


def wrapped_uv(figure: Figure, piece: Piece, *, whole_trunk: bool = False) -> Vector:
    """Return texture places (t, 3, 2): round each region's axis and along it.

    Rounds hold a whole number of repeats, so the cloth meets itself at the back.
    """
    corners = piece.vertices_m[piece.triangles]
    uv = np.zeros((len(piece.triangles), 3, 2))
    for region, parts in _REGIONS.items():
        if whole_trunk and region != "trunk":
            continue
        if region == "trunk" and piece.material != "bottom":
            # What hangs before the thighs is of one piece with the trunk's cloth.
            parts = (*parts, "left_thigh", "right_thigh")
        elif region.endswith("upper_leg lower_leg") and piece.material != "bottom":
            continue
        tags = [PART_INDEX[p] for p in parts]
        chosen = np.isin(piece.part, tags) if not whole_trunk else np.ones(len(uv), dtype=bool)
        if not chosen.any():
            continue
        start, up = _axis(figure, region)
        # The join is at the back of the trunk and on the inner side of the limbs.
        side = np.array([0.0, 0.0, -1.0])
        front = unit(side - up * (side @ up))
        left = np.cross(up, front)
        d = corners[chosen] - start
        x, y, along = d @ front, d @ left, d @ up
        angle = np.arctan2(y, x)
        first = angle[:, :1]
        angle = first + (angle - first + np.pi) % (2 * np.pi) - np.pi
        radius = float(np.median(np.hypot(x, y)))
        repeats = max(round(2 * np.pi * radius / TILE_M), 1)
        uv[chosen] = np.stack([angle / (2 * np.pi) * repeats, -along / TILE_M], axis=-1)
    return uv


def limb_axis_distance(
    figure: Figure, points_m: Vector, side: str, limb: str
) -> tuple[Vector, Vector, Vector]:
    """Return place along a limb (v,) from 0 to 2, foot of the perpendicular (v, 3), distance."""
    names = (
        ("upper_arm", "lower_arm", "hand") if limb == "arm" else ("upper_leg", "lower_leg", "foot")
    )
    chain = [figure.at(f"{side}_{name}") for name in names]
    best = np.full(len(points_m), np.inf)
    place, foot = np.zeros(len(points_m)), np.zeros_like(points_m)
    for k in range(2):
        along = chain[k + 1] - chain[k]
        t = np.clip((points_m - chain[k]) @ along / (along @ along), 0, 1)
        at = chain[k] + t[:, None] * along
        distance = np.linalg.norm(points_m - at, axis=1)
        nearer = distance < best
        best = np.where(nearer, distance, best)
        place = np.where(nearer, k + t, place)
        foot = np.where(nearer[:, None], at, foot)
    return place, foot, best


def on_side(figure: Figure, weights: Vector, limb: str) -> dict[str, Vector]:
    """Return how much of each vertex belongs to the left and right limb."""
    stems = {
        "arm": ("upper_arm", "lower_arm", "hand", "proximal", "middle", "distal"),
        "leg": ("upper_leg", "lower_leg", "foot", "toes"),
    }[limb]
    return {
        side: weights[:, figure.joint_columns(*stems, side=side)].sum(axis=1) for side, _ in SIDES
    }
