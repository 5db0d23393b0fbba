"""How fingers and thumb lie about a telephone: bent until their skin touches its case.

Found once for a person, on the skin of the left hand; the right one is its mirror image.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.grip_kernels import FINGER, THUMB, Case, Digit, Search, best_bend
from visavis.stimuli.motion.posture_kernels import spread_of
from visavis.stimuli.motion.skeleton import Skeleton

FINGERS: Final = ("index", "middle", "ring", "little")
PHALANGES: Final = ("proximal", "middle", "distal")
MIN_POINTS: Final = 4
"""Least number of skin points of a phalanx; below it the figure has no finger bones."""
MIN_WEIGHT: Final = 0.02
"""Least weight of a point that belongs to a finger."""
SPREAD_RAD: Final = -0.10
"""Fingers that hold something lie closer together than at rest."""
ROOM_FOR_THUMB_M: Final = 0.006
"""Behind the edge before the neck: the pad of a thumb is thicker than the edge."""
MIN_CURLS: Final = (0.04, 0.26, 0.26, 0.26)
"""Index fingers may lie along a case; a straight finger beside bent ones looks broken."""
MAX_CURL: Final = 0.90
KNUCKLES_RAD: Final = (-0.15, 0.95)
"""Bends of a knuckle in all."""
THUMB_IN_RAD: Final = (-0.3, 0.7)
OPPOSED_RAD: Final = (-0.3, 0.7)
THUMB_BENDS: Final = (0.0, 0.5)


@dataclass(frozen=True, eq=False)
class Skin:
    """Points (k, 3) of the left hand at rest, in metres from its wrist, at vertices and in the
    middle of triangles, with their weights (k, 55).
    """

    points_m: Vector
    weights: Vector


def skin_of_hand(character: Character) -> Skin:
    """Return the skin of a character's left hand, without what it holds."""
    mesh, skeleton = character.levels[0], character.skeleton
    triangles = mesh.triangles[mesh.triangle_part == PART_INDEX["left_hand"]]
    is_own = np.zeros(len(mesh.vertices_m), np.bool_)
    is_own[triangles] = True
    own = mesh.vertices_m[is_own] - skeleton.rest_m[skeleton.index("left_hand")]
    weights = np.zeros((len(own), len(skeleton.names)))
    rows = np.arange(len(own))
    for joint, weight in zip(mesh.joints[is_own].T, mesh.weights[is_own].T, strict=True):
        weights[rows, joint] += weight
    corners = (np.cumsum(is_own) - 1)[triangles]
    return Skin(
        np.concatenate([own, own[corners].mean(axis=1)]),
        np.concatenate([weights, weights[corners].mean(axis=1)]),
    )


def _digit(skin: Skin, skeleton: Skeleton, name: str) -> Digit | None:
    """Return a left finger, or None where the figure has no bones for it."""
    joints = [skeleton.index(f"left_{name}_{phalanx}") for phalanx in PHALANGES]
    weights = skin.weights[:, joints]
    rows = weights.sum(axis=1) > MIN_WEIGHT
    weights = weights[rows]
    phalanx = weights.argmax(axis=1)
    if (np.bincount(phalanx, minlength=3) < MIN_POINTS).any():
        return None
    return Digit(
        skin.points_m[rows],
        np.column_stack([1.0 - weights.sum(axis=1), weights]),
        phalanx,
        skeleton.rest_m[joints] - skeleton.rest_m[skeleton.index("left_hand")],
    )


def _best(
    digit: Digit,
    case: Case,
    room_m: Vector,
    which: int,
    spread_rad: float,
    *ranges: tuple[float, float],
) -> Vector:
    least, most = np.array(ranges).T
    search = Search(
        np.ascontiguousarray(least),
        np.ascontiguousarray(most),
        np.array([9, 9, 1] if which == FINGER else [7, 7, 2]),
        4,
    )
    return best_bend(digit, case, room_m, which, spread_rad, search)


def grip_of_character(character: Character, case: Case, room_m: Vector) -> Vector:
    """Return how the left hand lies about a case, (GRIP_SIZE,) in the order of `posture.B_GRIP`.

    `room_m` is how far fingers may reach beyond the case's face, evenly spaced along it. A finger
    or thumb that has no bones is left straight.
    """
    skeleton = character.skeleton
    skin = skin_of_hand(character)
    grip = np.zeros(p.GRIP_SIZE)
    for k, name in enumerate(FINGERS):
        digit = _digit(skin, skeleton, name)
        if digit is not None:
            spread_rad = spread_of(SPREAD_RAD, k)
            curl, knuckle, _ = _best(
                digit,
                case,
                room_m,
                FINGER,
                spread_rad,
                (MIN_CURLS[k], MAX_CURL),
                KNUCKLES_RAD,
                (0.0, 0.0),
            )
            grip[k], grip[4 + k], grip[8] = curl, knuckle - 1.25 * curl, SPREAD_RAD
    digit = _digit(skin, skeleton, "thumb")
    if digit is not None:
        room_m = np.full(2, ROOM_FOR_THUMB_M)
        inward, opposition, bend = _best(
            digit, case, room_m, THUMB, 0.0, THUMB_IN_RAD, OPPOSED_RAD, THUMB_BENDS
        )
        grip[9:] = bend, opposition, inward
    return grip
