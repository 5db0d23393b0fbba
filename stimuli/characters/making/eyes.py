"""Eyeballs as true spheres round the joint, and lashes as single hairs."""

import numpy as np

from lab.geometry import Vector
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.making.figure import SIDES, Figure
from stimuli.characters.making.pieces import Piece

_RINGS, _SECTORS = 18, 28


def eyeball(figure: Figure, side: str) -> Piece:
    """Return one eyeball; its pole lies on the visual axis, straight ahead of the joint."""
    centre, radius = figure.at(f"{side}_eye"), figure.eye_radius_m
    # Rings are dense at the front, where lids and iris need a round outline.
    polar = np.pi * (np.linspace(0, 1, _RINGS + 1) ** 1.35)[1:-1]
    around = 2 * np.pi * np.arange(_SECTORS) / _SECTORS
    p, a = np.meshgrid(polar, around, indexing="ij")
    ball = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), -np.cos(p)], axis=-1)
    ball = np.concatenate([[[0.0, 0.0, -1.0]], ball.reshape(-1, 3), [[0.0, 0.0, 1.0]]])
    ring = 1 + np.arange(len(polar) * _SECTORS).reshape(len(polar), _SECTORS)
    turn = np.roll(ring, -1, axis=1)
    last = len(ball) - 1
    triangles = np.concatenate(
        [
            np.stack([np.zeros(_SECTORS, dtype=np.int64), turn[0], ring[0]], axis=1),
            np.stack([ring[:-1], turn[:-1], turn[1:]], axis=-1).reshape(-1, 3),
            np.stack([ring[:-1], turn[1:], ring[1:]], axis=-1).reshape(-1, 3),
            np.stack([np.full(_SECTORS, last), ring[-1], turn[-1]], axis=1),
        ]
    )
    weights = np.zeros((len(ball), len(figure.rig.skeleton.names)))
    weights[:, figure.rig.skeleton.index(f"{side}_eye")] = 1.0
    # The white is duller and redder towards the corners.
    corner = np.clip((1 + ball[:, 2]) * 1.2, 0, 1)[:, None]
    colour = (1 - corner) * np.array([0.93, 0.915, 0.90]) + corner * np.array([0.80, 0.66, 0.63])
    return Piece(
        vertices_m=centre + radius * ball,
        triangles=triangles,
        weights=weights,
        colour=colour,
        part=np.full(len(triangles), PART_INDEX[f"{side}_eye"]),
        material="eye",
        normals=ball,
    )


def eyeballs(figure: Figure) -> list[Piece]:
    """Return both eyeballs."""
    return [eyeball(figure, side) for side, _ in SIDES]


def lids_delta(figure: Figure, name: str, source_m: Vector) -> Vector:
    """Return the displacement (v, 3) of a unit of the face, scaled to the figure."""
    target = figure.source.target(name)
    delta = np.zeros_like(source_m)
    delta[target.vertices] = target.delta_m
    return delta
