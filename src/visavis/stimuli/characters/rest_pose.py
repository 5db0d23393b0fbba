"""Turn any pose a figure was made in into the T-pose rest of our skeleton.

The rest mesh is what the skinning of the rest mesh would turn back into the pose as made, not the
skinning of that pose: so a body with its arms as sculpted is the sculpted body exactly, and what
blending loses shows only near the T-pose, which nobody holds.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply, rotate, unit
from visavis.stimuli.motion.rotations import IDENTITY, quat_between, quat_from_axes
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton


@dataclass(frozen=True, eq=False)
class Rig:
    """A person's joints as sculpted: `at_m` (55, 3), `turn_wxyz` (55, 4) from the axes of the
    rest to those of the sculpted pose in world; `skeleton` is the rest.
    """

    skeleton: Skeleton
    at_m: Vector
    turn_wxyz: Vector


GIRDLE_PER_ARM = 0.25
"""How much collar bones rise with an arm: Inman (1944) has 0.4, Ludewig et al. (2009) 0.1."""
RELAXED_DEG = -35.0
"""Arms this far below the horizontal do not lift their collar bones."""
FINGERS = ("thumb", "index", "middle", "ring", "little")
PHALANGES = ("proximal", "middle", "distal")


def rig_of_marks(at: Mapping[str, Vector], tips: Mapping[str, Vector], sole_m: float) -> Rig:
    """Lay our skeleton's rest along a figure's joints as made.

    `at` has all 55 joints and `tips` the ends of head, jaw, eyes, fingers and toes, in metres,
    upright and facing −z; `sole_m` is the height of what the figure stands on.
    """
    pattern = canonical_skeleton()
    n = len(pattern.names)
    turn = np.tile(IDENTITY, (n, 1))
    for side in ("left", "right"):
        x = -1.0 if side == "left" else 1.0
        turn[pattern.index(f"{side}_shoulder")] = _girdle_turn(at, side)
        chain = [
            ("upper_arm", "lower_arm", (x, 0.0, 0.0)),
            ("lower_arm", "hand", (x, 0.0, 0.0)),
            ("upper_leg", "lower_leg", (0.0, -1.0, 0.0)),
            ("lower_leg", "foot", (0.0, -1.0, 0.0)),
        ]
        for joint, child, rest in chain:
            j = pattern.index(f"{side}_{joint}")
            along = at[f"{side}_{child}"] - at[f"{side}_{joint}"]
            above = turn[pattern.parents[j]]
            _follow(turn, j, above, np.array(rest), along)
        hand = pattern.index(f"{side}_hand")
        turn[hand] = _hand_turn(at, side)
        # The forearm takes half of the hand's twist, as the radius does.
        forearm = pattern.index(f"{side}_lower_arm")
        twist = quat_multiply(quat_conjugate(turn[forearm]), turn[hand])
        half = unit(np.array([twist[0], twist[1], 0.0, 0.0]) + IDENTITY)
        turn[forearm] = quat_multiply(turn[forearm], half)
        for finger in FINGERS:
            for k, phalanx in enumerate(PHALANGES):
                name = f"{side}_{finger}_{phalanx}"
                j = pattern.index(name)
                end = tips[name] if k == 2 else at[f"{side}_{finger}_{PHALANGES[k + 1]}"]
                straight = np.array([x, 0.0, 0.0])
                if finger == "thumb":
                    straight = unit(np.array([x * 0.70, -0.15, -0.70]))
                _follow(turn, j, turn[pattern.parents[j]], straight, end - at[name])
        foot, toes = pattern.index(f"{side}_foot"), pattern.index(f"{side}_toes")
        along = (tips[f"{side}_toes"] - at[f"{side}_foot"]) * np.array([1.0, 0.0, 1.0])
        turn[foot] = turn[toes] = quat_between(np.array([0.0, 0.0, -1.0]), unit(along))
    place = np.array([at[name] for name in pattern.names])
    offsets, ends = np.zeros((n, 3)), np.full((n, 3), np.nan)
    for j, name in enumerate(pattern.names):
        parent = pattern.parents[j]
        if parent >= 0:
            offsets[j] = rotate(quat_conjugate(turn[parent]), place[j] - place[parent])
        if name in tips:
            ends[j] = rotate(quat_conjugate(turn[j]), tips[name] - place[j])
        if name.endswith("_toes"):
            ends[j, 1] = sole_m - place[j, 1]
    return Rig(Skeleton(pattern.names, pattern.parents, offsets, ends), place, turn)


def _girdle_turn(at: Mapping[str, Vector], side: str) -> Vector:
    """Return how far a collar bone is lifted in a figure made with its arms spread.

    Motions let arms hang from collar bones that rest: without this, shoulders stay at the neck.
    """
    along = unit(at[f"{side}_lower_arm"] - at[f"{side}_upper_arm"])
    raised_deg = float(np.degrees(np.arcsin(np.clip(along[1], -1.0, 1.0))))
    lift = np.radians(GIRDLE_PER_ARM * max(raised_deg - RELAXED_DEG, 0.0))
    half = 0.5 * (-lift if side == "left" else lift)
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])


def _follow(turn: Vector, joint: int, above: Vector, rest: Vector, along: Vector) -> None:
    """Lay a rest direction along a sculpted one by the smallest turn from the joint above."""
    own_direction = rotate(quat_conjugate(above), unit(along))
    turn[joint] = quat_multiply(above, quat_between(rest, own_direction))


def _hand_turn(at: Mapping[str, Vector], side: str) -> Vector:
    """Return the turn of a hand from its knuckles: fingers out, thumb forward, palm down."""
    knuckles = [at[f"{side}_{finger}_proximal"] for finger in FINGERS[1:]]
    out = unit(np.mean(knuckles, axis=0) - at[f"{side}_hand"])
    forward = knuckles[0] - knuckles[3]
    forward = unit(forward - out * (forward @ out))
    x = -out if side == "left" else out
    z = -forward
    return quat_from_axes(x, np.cross(z, x), z)


def to_rest(
    rig: Rig, vertices_m: Vector, joints: npt.NDArray[np.int64], weights: Vector
) -> tuple[Vector, Vector]:
    """Take sculpted points to rest: vertices (v, 3) from the hips, and the blends (v, 3, 3).

    Directions and displacements go to rest by the inverse of the blend.
    """
    matrices = np.stack([rotate(rig.turn_wxyz, axis) for axis in np.eye(3)], axis=-1)
    rest = rig.skeleton.rest_m
    shift = rig.at_m - np.einsum("jab,jb->ja", matrices, rest)
    blend = np.einsum("vk,vkab->vab", weights, matrices[joints])
    shift_m = np.einsum("vk,vka->va", weights, shift[joints])
    return np.linalg.solve(blend, (vertices_m - shift_m)[..., None])[..., 0], blend


def heaviest(weights: Vector) -> tuple[npt.NDArray[np.int64], Vector]:
    """Return the four heaviest joints (v, 4) and their weights in steps of 1/255 that sum to 1."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    share = np.take_along_axis(weights, joints, axis=1)
    share = np.round(255 * share / share.sum(axis=1, keepdims=True))
    share[:, 0] += 255 - share.sum(axis=1)
    joints = np.where(share > 0, joints, 0)
    return joints, share / 255
