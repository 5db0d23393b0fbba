"""Turn the eyes in the head, exactly, and let the lids follow."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.gaze.behaviour import MAXIMUM_TURN_DEG
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.quaternion_kernels import (
    Quat,
    Triple,
    between,
    inverse,
    minus,
    plus,
    quat_of,
    rotate_vector,
    scale_vector,
    times,
    triple_of,
    unit_of,
)

MAX_RAD = np.radians(MAXIMUM_TURN_DEG)
LID_FULL_RAD = np.radians(30.0)
"""Eyes turned up or down this far have `lids_up` or `lids_down` at 1."""
LEFT_BLINK, RIGHT_BLINK = MORPHS.index("left_blink"), MORPHS.index("right_blink")
LIDS_UP, LIDS_DOWN = MORPHS.index("lids_up"), MORPHS.index("lids_down")
AHEAD: Triple = (0.0, 0.0, -1.0)


@compiled
def _within(direction: Triple, most_rad: float) -> Triple:
    """Keep a direction of the head's axes within a cone about straight ahead."""
    aside = np.hypot(direction[0], direction[1])
    angle = np.arctan2(aside, -direction[2])
    if angle <= most_rad:
        return direction
    if aside < 1e-9:
        return AHEAD
    s = np.sin(most_rad) / aside
    return s * direction[0], s * direction[1], -np.cos(most_rad)


@compiled
def head_of(root: Vector, turns: Vector, offsets: Vector) -> tuple[Triple, Quat]:
    """Return where the head joint is and how it is turned in world."""
    at = root[0], root[1], root[2]
    world = quat_of(turns[p.J_HIPS])
    for joint in range(p.J_SPINE, p.J_HEAD + 1):
        at = plus(at, rotate_vector(world, triple_of(offsets[joint])))
        world = times(world, quat_of(turns[joint]))
    return at, world


@compiled
def look_rows(
    root_m: Vector,
    turns: Vector,
    offsets: Vector,
    skeleton_of: npt.NDArray[np.int64],
    eyes_m: Vector,
    head_wxyz: Vector,
) -> None:
    """Write the middle of the eyes (n, 3) and the turn of the head (n, 4) in world."""
    for r in range(root_m.shape[0]):
        own = offsets[skeleton_of[r]]
        at, world = head_of(root_m[r], turns[r], own)
        half = scale_vector(plus(triple_of(own[p.J_LEFT_EYE]), triple_of(own[p.J_RIGHT_EYE])), 0.5)
        middle = plus(at, rotate_vector(world, half))
        for k in range(3):
            eyes_m[r, k] = middle[k]
        for k in range(4):
            head_wxyz[r, k] = world[k]


@compiled
def aim_rows(
    root_m: Vector,
    offsets: Vector,
    skeleton_of: npt.NDArray[np.int64],
    direction: Vector,
    distance_m: Vector,
    openness_01: Vector,
    turns: Vector,
    morphs: Vector,
) -> None:
    """Point both eyes of n people along `direction` (n, 3) in world and set lids and blinks.

    An eye that would leave the cone of `MAXIMUM_TURN_DEG` about the head's front stays on its rim.
    """
    for r in range(root_m.shape[0]):
        own = offsets[skeleton_of[r]]
        _, world = head_of(root_m[r], turns[r], own)
        to_head = inverse(world)
        left, right = triple_of(own[p.J_LEFT_EYE]), triple_of(own[p.J_RIGHT_EYE])
        middle = scale_vector(plus(left, right), 0.5)
        gaze = AHEAD
        if np.isfinite(direction[r, 0]):
            gaze = unit_of(rotate_vector(to_head, triple_of(direction[r])), AHEAD)
        pitch = 0.0
        for side in range(2):
            eye = left if side == 0 else right
            axis = gaze
            # Each eye points at the same near point: the eyes converge.
            if np.isfinite(distance_m[r]):
                goal = plus(middle, scale_vector(gaze, distance_m[r]))
                axis = unit_of(minus(goal, eye), AHEAD)
            axis = _within(axis, MAX_RAD)
            q = between(AHEAD, axis)
            for k in range(4):
                turns[r, p.J_LEFT_EYE + side, k] = q[k]
            pitch += 0.5 * np.arcsin(axis[1])
        # Upper lids go with the pitch of the eyes.
        morphs[r, LIDS_UP] = min(1.0, max(0.0, pitch / LID_FULL_RAD))
        morphs[r, LIDS_DOWN] = min(1.0, max(0.0, -pitch / LID_FULL_RAD))
        blink = 0.0
        if not np.isnan(openness_01[r]):
            blink = min(1.0, max(0.0, 1.0 - openness_01[r]))
        morphs[r, LEFT_BLINK] = blink
        morphs[r, RIGHT_BLINK] = blink
