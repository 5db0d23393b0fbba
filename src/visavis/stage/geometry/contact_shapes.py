"""Simple shapes of what touches a floor: soles of shoes, blocks of furniture."""

from functools import cache

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character
from visavis.stimuli.picture import Block, Room

SOLE_JOINTS = ("left_foot", "left_toes", "right_foot", "right_toes")
"""Heel and ball of each sole, by the joint that moves it."""
SOLE_HIGH_M = 0.02
END_SHARE_01 = 0.3
"""Share of a sole's length in which its heel, and its ball, are as wide as they get."""
MIN_SHARE_OF_FOOT = 0.5
REACH_IN_WIDTHS, REACH_IN_HEIGHTS = 5.0, 2.0
"""Distance, in widths or heights, at which a narrow or low block hides a thirtieth of the sky."""
MAX_REACH_M = 1.2
"""Farther away, walls and floors reflect as much light as the block hides."""


@cache
def soles_of(character: Character) -> Vector:
    """Return the discs (4, 4) at the ends of both soles at rest: centre and radius, metres.

    A sole covers what lies between its two discs. The radius is 0 where a body has no foot.
    """
    out = np.zeros((len(SOLE_JOINTS), 4))
    skeleton, mesh = character.skeleton, character.levels[0]
    for k in range(0, len(SOLE_JOINTS), 2):
        foot, toes = (skeleton.index(name) for name in SOLE_JOINTS[k : k + 2])
        on_foot = np.isin(mesh.joints, (foot, toes))
        own = np.where(on_foot, mesh.weights, 0.0).sum(axis=1) > MIN_SHARE_OF_FOOT
        along = (skeleton.rest_m[toes] - skeleton.rest_m[foot])[[0, 2]]
        length = float(np.linalg.norm(along))
        if not own.any() or length == 0.0:
            continue
        along /= length
        vertices = mesh.vertices_m[own].astype(np.float64)
        low = float(vertices[:, 1].min())
        sole = vertices[vertices[:, 1] <= low + SOLE_HIGH_M]
        ahead, aside = sole[:, [0, 2]] @ along, sole[:, [0, 2]] @ [-along[1], along[0]]
        back, front = float(ahead.min()), float(ahead.max())
        for end, tip, inwards in ((k, back, 1.0), (k + 1, front, -1.0)):
            near = abs(ahead - tip) <= END_SHARE_01 * (front - back)
            left, right = float(aside[near].min()), float(aside[near].max())
            radius = min((right - left) / 2, (front - back) / 2)
            x, z = (tip + inwards * radius) * along + (left + right) / 2 * np.array(
                [-along[1], along[0]]
            )
            out[end] = x, low, z, radius
    return out


def block_rows(room: Room) -> npt.NDArray[np.float32]:
    """Return a room's blocks (n, 3, 4): x, z, lowest and highest above the floor; half sizes,
    cosine and sine of the turn; floor, how far the shade reaches, 1 where round, 0. Metres.
    """
    blocks = [block for prop in room.props for block in prop.blocks]
    return np.array([_block_row(b) for b in blocks], np.float32).reshape(-1, 3, 4)


def _block_row(block: Block) -> Vector:
    x, y, z = block.at_m
    low, turn = y - block.floor_m, np.radians(block.yaw_deg)
    widest = 2 * max(block.half_x_m, block.half_z_m)
    reach = min(REACH_IN_WIDTHS * widest, REACH_IN_HEIGHTS * (low + block.high_m), MAX_REACH_M)
    return np.array(
        [
            [x, z, low, low + block.high_m],
            [block.half_x_m, block.half_z_m, np.cos(turn), np.sin(turn)],
            [block.floor_m, reach, block.round, 0.0],
        ]
    )
