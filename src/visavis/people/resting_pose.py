"""A sitting or standing body that fits a given head pose and right-hand target."""

from dataclasses import dataclass
from functools import cache
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.eye_height import MAX_SEATED_EYE_M
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import REFERENCE_STATURE_M
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.kinds import Idle, Sit
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.posture_kernels import look_from, pose_rows
from visavis.stimuli.motion.quaternion_kernels import (
    Triple,
    inverse,
    minus,
    plus,
    quat_of,
    rotate_vector,
    scale_vector,
    triple_of,
)
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton
from visavis.stimuli.motion.slerp_kernels import forward_rows

Index: TypeAlias = npt.NDArray[np.int64]
MIN_SEAT_M: Final = 0.25
STANDING: Final = Idle(arms="hanging", lively=0.0)
J_RIGHT_HAND: Final = p.J_SIDE + p.SIDE_SIZE + p.S_HAND
FINGERS: Triple = (1.0, 0.0, 0.0)
PALM: Triple = (0.0, -1.0, 0.0)
AHEAD: Triple = (0.0, 0.0, -1.0)
ELBOW_TOWARDS: Triple = (-0.6, -1.0, 0.5)
"""Direction in which the elbow of the pointing arm hangs; for a left arm, in axes of the chest."""
_ONE: Final[Index] = np.zeros(1, np.int64)
_ALL_VALID: Final = np.ones(1, np.bool_)


@dataclass(frozen=True, eq=False)
class RestingPose:
    """A resting pose: a skeleton, one row (1, SIZE) of posture and the place of the feet."""

    skeleton: Skeleton
    controls: Vector


@cache
def resting_pose(x_m: float, eye_height_m: float, z_m: float) -> RestingPose:
    """Return a resting pose with the eyes at a point.

    Low eyes make the person sit. The height of the seat, or the stature, is chosen to fit.
    """
    seat_m, stature_m = Sit().seat_m, REFERENCE_STATURE_M
    kind: Sit | Idle = STANDING
    if eye_height_m <= MAX_SEATED_EYE_M:
        seat_m += eye_height_m - _eyes_of(stature_m, _sitting(seat_m))[1]
        kind = _sitting(max(seat_m, MIN_SEAT_M))
    else:
        stature_m *= eye_height_m / _eyes_of(stature_m, kind)[1]
    ahead = _eyes_of(stature_m, kind)
    motion = _motion(stature_m, kind, (x_m - float(ahead[0]), 0.0, z_m - float(ahead[2])))
    return RestingPose(motion.people[0].build.skeleton, motion.posture(0.0))


def pose_joints(
    pose: RestingPose, eyes_m: Vector, head_wxyz: Vector, hand_m: Vector, hand_wxyz: Vector
) -> tuple[Vector, Vector]:
    """Return all joints, positions (t, joints, 3) and turns (t, joints, 4) in world.

    `eyes_m` (t, 3) is the middle between the eyes, `head_wxyz` (t, 4) the turn of the head,
    `hand_m` and `hand_wxyz` the pose of the right hand. Trunk and limbs follow; the feet stay.
    """
    n = len(eyes_m)
    positions, turns = np.empty((n, p.JOINTS, 3)), np.empty((n, p.JOINTS, 4))
    _body_rows(
        pose.controls,
        pose.skeleton.parents,
        pose.skeleton.offsets_m[None],
        eyes_m,
        head_wxyz,
        np.ascontiguousarray(hand_m),
        hand_wxyz,
        positions,
        turns,
    )
    return positions, turns


def _sitting(seat_m: float) -> Sit:
    return Sit(seat_m=seat_m, hands="thighs", lively=0.0, nods=0.0)


def _motion(
    stature_m: float, kind: Sit | Idle, at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> PeopleMotion:
    build = build_of_skeleton(canonical_skeleton(stature_m))
    return PeopleMotion((Person(build, kind, seed=1, place_m=at_m),))


def _eyes_of(stature_m: float, kind: Sit | Idle) -> Vector:
    motion = _motion(stature_m, kind)
    eyes, head, chest = np.empty((1, 3)), np.empty((1, 4)), np.empty((1, 4))
    offsets = motion.people[0].build.skeleton.offsets_m[None]
    look_from(motion.posture(0.0), offsets, _ONE, eyes, head, chest)
    eyes_m: Vector = eyes[0]
    return eyes_m


@compiled
def _set_mirrored(row: Vector, start: int, v: Triple) -> None:
    """Mirror a vector of the right side for the solver, which knows left arms only."""
    row[start], row[start + 1], row[start + 2] = -v[0], v[1], v[2]


@compiled
def _body_rows(
    rest: Vector,
    parents: Index,
    offsets: Vector,
    eyes_m: Vector,
    head_wxyz: Vector,
    hand_m: Vector,
    hand_wxyz: Vector,
    positions: Vector,
    turns: Vector,
) -> None:
    facing, root = np.empty((1, 3)), np.empty((1, 3))
    local = np.empty((1, p.JOINTS, 4))
    own = offsets[0]
    between_eyes = scale_vector(
        plus(triple_of(own[p.J_LEFT_EYE]), triple_of(own[p.J_RIGHT_EYE])), 0.5
    )
    for t in range(eyes_m.shape[0]):
        head, hand = quat_of(head_wxyz[t]), quat_of(hand_wxyz[t])
        ahead = rotate_vector(head, AHEAD)
        facing[0, 0], facing[0, 1], facing[0, 2] = ahead
        eyes, at, turn = eyes_m[t : t + 1], positions[t : t + 1], turns[t : t + 1]
        # First solve without the hand: the arm is solved in the axes of the chest.
        pose_rows(rest.copy(), offsets, _ONE, _ALL_VALID, eyes, facing, root, local)
        forward_rows(parents, own, root, local, at, turn)
        back = inverse(quat_of(turn[0, p.J_UPPER_CHEST]))
        reach = minus(triple_of(hand_m[t]), triple_of(at[0, p.J_UPPER_CHEST]))
        controls = rest.copy()
        arm = controls[0, p.ARM + p.ARM_SIZE :]
        arm[p.HOLD : p.HOLD + p.HOLDS * p.HOLD_SIZE] = 0.0
        hold = p.HOLD + p.CHEST * p.HOLD_SIZE
        arm[hold] = 1.0
        _set_mirrored(arm, hold + 1, rotate_vector(back, reach))
        _set_mirrored(arm, hold + 4, rotate_vector(back, rotate_vector(hand, FINGERS)))
        _set_mirrored(arm, hold + 7, rotate_vector(back, rotate_vector(hand, PALM)))
        arm[p.POLE], arm[p.POLE + 1], arm[p.POLE + 2] = ELBOW_TOWARDS
        pose_rows(controls, offsets, _ONE, _ALL_VALID, eyes, facing, root, local)
        forward_rows(parents, own, root, local, at, turn)
        # Set the given poses exactly: the solver limits the wrist and knows no roll of the head.
        at[0, J_RIGHT_HAND], turn[0, J_RIGHT_HAND] = hand_m[t], hand_wxyz[t]
        joint = minus(triple_of(eyes_m[t]), rotate_vector(head, between_eyes))
        at[0, p.J_HEAD, 0], at[0, p.J_HEAD, 1], at[0, p.J_HEAD, 2] = joint
        turn[0, p.J_HEAD] = head_wxyz[t]
