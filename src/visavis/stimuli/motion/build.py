"""A person's lengths that postures are computed from, taken from a skeleton or a character."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character, SkinnedMesh
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton
from visavis.stimuli.motion.telephoning import (
    BACK_M,
    PALM_M,
    at_ear_of_character,
    at_ear_of_head,
    grip_at_ear,
    hand_thickness_m,
)

CANONICAL_NAMES = canonical_skeleton().names


@dataclass(frozen=True, eq=False)
class Build:
    """A skeleton with canonical joints and the lengths (B_SIZE,) that follow from it.

    `hand` is whose hand closes round a telephone; None of a skeleton without flesh.
    """

    skeleton: Skeleton
    lengths_m: Vector
    hand: Character | None = None

    @cached_property
    def telephoning_m(self) -> Vector:
        """The lengths, with the grip (`posture.B_GRIP`) that only people with a telephone need."""
        b = self.lengths_m.copy()
        if self.hand is not None:
            b[p.B_GRIP : p.B_GRIP + p.GRIP_SIZE] = grip_at_ear(self.hand)
        return b

    @property
    def ankle_m(self) -> float:
        """Height of the ankle joints above the floor on flat feet."""
        return float(self.lengths_m[p.B_ANKLE])

    @property
    def stature_m(self) -> float:
        """Crown to sole."""
        return float(self.lengths_m[p.B_STATURE])


def build_of_skeleton(skeleton: Skeleton) -> Build:
    """Return the build of a bare skeleton; flesh is estimated from its stature.

    Raises:
        MotionError: the joints are not the canonical ones.
    """
    if skeleton.names != CANONICAL_NAMES:
        raise MotionError(
            "procedural motion needs the 55 canonical joints in their order; retarget the skeleton"
        )
    bone = np.linalg.norm(skeleton.offsets_m, axis=1)

    def both(name: str) -> float:
        return float(bone[skeleton.index(f"left_{name}")] + bone[skeleton.index(f"right_{name}")])

    def at(name: str) -> Vector:
        rest: Vector = skeleton.rest_m[skeleton.index(name)]
        return rest

    toes, tip = at("left_toes"), skeleton.tips_m[skeleton.index("left_toes")]
    sole_y = min(toes[1] + (tip[1] if np.isfinite(tip[1]) else 0.0), toes[1])
    head_tip = skeleton.tips_m[skeleton.index("head")]
    crown_y = at("head")[1] + (head_tip[1] if np.isfinite(head_tip[1]) else 0.2)
    stature = float(crown_y - sole_y)
    # Flesh is unknown here: breadths and thicknesses are those of a person of 1.75 m, scaled.
    size = stature / 1.75
    b = np.zeros(p.B_SIZE)
    b[p.B_THIGH], b[p.B_SHIN] = both("lower_leg") / 2, both("foot") / 2
    b[p.B_LEG] = b[p.B_THIGH] + b[p.B_SHIN]
    b[p.B_ANKLE] = at("left_foot")[1] - sole_y
    b[p.B_HIP_X] = (at("right_upper_leg")[0] - at("left_upper_leg")[0]) / 2
    b[p.B_HIP_Y] = -at("left_upper_leg")[1]
    b[p.B_STAND] = b[p.B_HIP_Y] + b[p.B_LEG] + b[p.B_ANKLE]
    b[p.B_UPPER_ARM], b[p.B_FOREARM] = both("lower_arm") / 2, both("hand") / 2
    b[p.B_HAND] = both("middle_proximal") / 2
    b[p.B_SHOULDER_X] = (at("right_upper_arm")[0] - at("left_upper_arm")[0]) / 2
    b[p.B_TRUNK] = at("upper_chest")[1]
    b[p.B_STATURE] = stature
    b[p.B_THIGH_RADIUS] = 0.075 * size
    b[p.B_SEAT_GAP] = b[p.B_HIP_Y] + 0.085 * size
    b[p.B_KNEE_GAP] = 0.060 * size
    b[p.B_BELLY] = 0.115 * size
    b[p.B_HEAD_HALF] = 0.078 * size
    b[p.B_FOOT] = float(np.hypot(toes[0] - at("left_foot")[0], toes[2] - at("left_foot")[2]))
    shoulder = at("left_upper_arm") - at("upper_chest")
    b[p.B_SHOULDER_Y], b[p.B_SHOULDER_Z] = shoulder[1], shoulder[2]
    b[p.B_EAR_Y] = at("left_eye")[1] - at("head")[1] - 0.008 * stature
    b[p.B_HEEL] = 0.028 * stature
    b[p.B_BALL_Y] = b[p.B_ANKLE] + toes[1] - at("left_foot")[1]
    b[p.B_AT_EAR : p.B_AT_EAR + 9] = at_ear_of_head(
        b[p.B_HEAD_HALF], b[p.B_EAR_Y], size, b[p.B_HAND]
    )
    b[p.B_HAND_THICK] = PALM_M + BACK_M
    b[p.B_ELBOW_BESIDE] = b[p.B_SHOULDER_X]
    return Build(skeleton, b)


def _of_part(mesh: SkinnedMesh, *parts: str) -> Vector:
    """Return the places (k, 3) of the vertices of some parts."""
    of_parts = np.isin(mesh.triangle_part, [PART_INDEX[name] for name in parts])
    rows = np.unique(mesh.triangles[of_parts])
    places: Vector = mesh.vertices_m[rows].astype(np.float64)
    return places


MAX_SAT_ON_M = 0.13
"""Largest depth of flesh behind a thigh; what is beyond is soft cloth, such as jacket tails."""


def _behind_thigh_m(thigh: Vector, hip: Vector, knee: Vector, first: float, last: float) -> float:
    """Return how far the flesh behind a thigh reaches, between two shares of its length."""
    share = (hip[1] - thigh[:, 1]) / (hip[1] - knee[1])
    bone_z = hip[2] + share * (knee[2] - hip[2])
    behind = (thigh[:, 2] - bone_z)[(share > first) & (share < last)]
    return float(np.quantile(behind, 0.99)) if len(behind) else 0.08


ARM_CLEAR_M = 0.018
"""Gap between a hanging arm and the clothes on the trunk, which leans and turns."""
MAX_ELBOW_BESIDE_M = 0.215
"""Wider elbows would reach beyond the seat to a neighbour."""
ALONG_ARM = np.linspace(0.8, 1.1, 4)
"""Shares of the upper arm; above them it belongs to the shoulder, trunk and sleeve are one."""


def _elbow_beside_m(trunk: Vector, arm: Vector, shoulder: Vector, elbow: Vector) -> float:
    """Return how far from the middle an elbow is whose arm hangs just clear of the trunk."""
    length_m = float(np.linalg.norm(elbow - shoulder))
    out_m = abs(float(shoulder[0]))
    share = (shoulder[0] - arm[:, 0]) / length_m
    off_m = np.hypot(arm[:, 1] - shoulder[1], arm[:, 2] - shoulder[2])
    elbow_m = out_m
    for along in ALONG_ARM:
        trunk_level = trunk[np.abs(shoulder[1] - trunk[:, 1] - 0.95 * along * length_m) < 0.025]
        around = off_m[np.abs(share - min(along, 0.95)) < 0.10]
        if len(trunk_level) and len(around):
            side_m = float(np.quantile(np.abs(trunk_level[:, 0]), 0.98))
            clear_m = side_m + float(np.quantile(around, 0.9)) + ARM_CLEAR_M
            elbow_m = max(elbow_m, out_m + (clear_m - out_m) / along)
    return min(elbow_m, MAX_ELBOW_BESIDE_M)


def build_of_character(character: Character) -> Build:
    """Return the build of a character, flesh and soles measured on its mesh at rest."""
    build = build_of_skeleton(character.skeleton)
    mesh, rest = character.levels[0], character.skeleton.rest_m
    b = build.lengths_m.copy()

    def at(name: str) -> Vector:
        place: Vector = rest[character.skeleton.index(name)]
        return place

    feet = _of_part(mesh, "left_foot", "right_foot")
    if len(feet):
        b[p.B_ANKLE] = at("left_foot")[1] - np.quantile(feet[:, 1], 0.02)
        b[p.B_STAND] = b[p.B_HIP_Y] + b[p.B_LEG] + b[p.B_ANKLE]
        b[p.B_BALL_Y] = b[p.B_ANKLE] + at("left_toes")[1] - at("left_foot")[1]
        b[p.B_HEEL] = max(0.02, np.quantile(feet[:, 2], 0.99) - at("left_foot")[2])
    b[p.B_STATURE] = character.stature_m
    thigh = _of_part(mesh, "left_thigh")
    hip, knee = at("left_upper_leg"), at("left_lower_leg")
    middle = thigh[np.abs(thigh[:, 1] - (0.5 * hip[1] + 0.5 * knee[1])) < 0.08]
    if len(middle):
        joint_z = 0.5 * (hip[2] + knee[2])
        b[p.B_THIGH_RADIUS] = joint_z - np.quantile(middle[:, 2], 0.02)
        b[p.B_SEAT_GAP] = b[p.B_HIP_Y] + float(
            np.clip(_behind_thigh_m(thigh, hip, knee, 0.10, 0.40), 0.05, MAX_SAT_ON_M)
        )
        b[p.B_KNEE_GAP] = 0.010 + max(0.03, _behind_thigh_m(thigh, hip, knee, 0.40, 0.62))
    trunk = _of_part(mesh, "torso")
    belly = trunk[np.abs(trunk[:, 1] - 0.35 * b[p.B_TRUNK]) < 0.08]
    if len(belly):
        b[p.B_BELLY] = -np.quantile(belly[:, 2], 0.02)
    b[p.B_ELBOW_BESIDE] = _elbow_beside_m(
        trunk, _of_part(mesh, "left_upper_arm"), at("left_upper_arm"), at("left_lower_arm")
    )
    b[p.B_HAND_THICK] = hand_thickness_m(character)
    b[p.B_AT_EAR : p.B_AT_EAR + 9] = at_ear_of_character(character)
    return replace(build, lengths_m=b, hand=character)
