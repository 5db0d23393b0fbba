"""Hair: a close shell over the scalp."""

from dataclasses import replace

import numpy as np

from lab.geometry import Vector
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.making.cutting import clipped
from stimuli.characters.making.figure import Figure
from stimuli.characters.making.pieces import Piece, vertex_normals


def hairline_field(figure: Figure, points_m: Vector, receding: float = 0.0) -> Vector:
    """Return metres outside the haired scalp (v,): forehead, temples, ears and nape are out."""
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    scale = figure.stature_m / 1.72
    x = np.abs(points_m[:, 0]) / scale
    y, z = (points_m[:, 1] - eye[1]) / scale, (points_m[:, 2] - eye[2]) / scale
    # z grows backwards. From the forehead over the temple down before the ear, then the nape.
    front = (
        0.082
        - 0.35 * np.maximum(x - 0.035, 0)
        + receding * (0.02 + 1.2 * np.exp(-(((x - 0.04) / 0.022) ** 2)) * 0.03)
    )
    temple = np.interp(
        z, [0.035, 0.055, 0.075, 0.085, 0.11, 0.15], [0.055, 0.03, 0.00, 0.02, 0.0, -0.075]
    )
    line = np.where(z < 0.04, front, np.minimum(temple, front))
    field: Vector = (line - y) * scale
    return field


def shell(figure: Figure, body: Piece, colour: Vector, receding: float, lift_m: float) -> Piece:
    """Return the haired scalp, lifted off the head."""
    outside = hairline_field(figure, body.vertices_m, receding)
    normals = vertex_normals(body.vertices_m, body.triangles)
    on_head = body.weights[:, figure.rig.skeleton.index("head")] > 0.5
    outside = np.where(on_head, outside, 0.2)
    lift = lift_m * np.clip(-outside / 0.03, 0.05, 1)
    piece = replace(
        body,
        vertices_m=body.vertices_m + lift[:, None] * normals,
        colour=np.tile(colour, (len(body.vertices_m), 1)),
        material="hair",
        morphs={},
        corner_uv=None,
    )
    piece = clipped(piece, outside)
    return replace(piece, part=np.full(len(piece.triangles), PART_INDEX["scalp"]))
