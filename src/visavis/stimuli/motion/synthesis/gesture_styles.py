"""Two gestures in five styles each, as examples to blend: nothing in blending is about walks.

A round of `waves` is a raised right forearm that swings out and in again; one of `beats` a right
hand that strikes down before the body and rises. Arms are given by where upper arm and forearm
point in world (x to the right, y up, −z ahead); the rest of the body leans as far as the style
says, and the feet stand. Key moments are the two ends of the swing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply, unit
from visavis.stimuli.motion.clip import Clip, standing_on_floor
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import quat_about, quat_between
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton
from visavis.stimuli.motion.synthesis.examples import Examples, examples_of_clips
from visavis.stimuli.motion.synthesis.walk_styles import FRAME_S, joints_only

HANGING: Final = ((0.20, -0.97, 0.05), (0.12, -0.96, -0.24))
"""Upper arm and forearm of a right arm that hangs down."""
KNEE_DEG: Final = 6.0
"""How far knees are bent: who stands does not stretch them."""


@dataclass(frozen=True)
class GestureStyle:
    """How a gesture is made: a round takes `frames` (at 30 a second), its first half `first_01`.

    The upper arm is raised by `raise_deg` from hanging down, the forearm swings by `swing_deg` to
    either side of its middle; the trunk leans forwards by `lean_deg`.
    """

    frames: int
    first_01: float
    raise_deg: float
    swing_deg: float
    lean_deg: float


GESTURES: Final[Mapping[str, Mapping[str, GestureStyle]]] = {
    "waves": {
        "plain": GestureStyle(24, 0.5, 60.0, 25.0, 0.0),
        "large": GestureStyle(30, 0.5, 95.0, 45.0, -2.0),
        "shy": GestureStyle(22, 0.5, 25.0, 12.0, 6.0),
        "hasty": GestureStyle(12, 0.45, 75.0, 22.0, 2.0),
        "weary": GestureStyle(45, 0.6, 40.0, 20.0, 9.0),
    },
    "beats": {
        "plain": GestureStyle(24, 0.35, 25.0, 20.0, 0.0),
        "large": GestureStyle(30, 0.35, 50.0, 42.0, 3.0),
        "shy": GestureStyle(24, 0.45, 12.0, 8.0, 5.0),
        "hasty": GestureStyle(12, 0.40, 30.0, 18.0, 3.0),
        "weary": GestureStyle(45, 0.55, 15.0, 15.0, 9.0),
    },
}
"""The styles of each gesture by name."""


def gesture_examples(which: str, skeleton: Skeleton | None = None) -> Examples:
    """Return waves or beats as examples, on twenty joints or on those of a canonical skeleton.

    Raises:
        MotionError: there is no such gesture.
    """
    if which not in GESTURES:
        raise MotionError(f"no set of gestures {which!r}; there are {', '.join(GESTURES)}")
    body = joints_only(canonical_skeleton()) if skeleton is None else skeleton
    styles = GESTURES[which]
    clips = [_clip(which, style, body) for style in styles.values()]
    key_s = [
        np.array([0.0, round(s.first_01 * s.frames), s.frames]) * FRAME_S for s in styles.values()
    ]
    return examples_of_clips(tuple(styles), clips, np.array(key_s))


def _clip(which: str, style: GestureStyle, skeleton: Skeleton) -> Clip:
    n, first = style.frames, round(style.first_01 * style.frames)
    # From 0 at one end of the swing to π at the other and 2π at the first again.
    turn = np.interp(np.arange(n), [0, first, n], [0.0, np.pi, 2 * np.pi])
    swing = np.radians(style.swing_deg) * np.cos(turn)
    raised = np.full(n, np.radians(style.raise_deg))
    if which == "waves":
        upper = np.stack([np.sin(raised), -np.cos(raised), -0.25 * np.ones(n)], axis=-1)
        fore = np.stack([np.sin(swing), np.cos(swing), -0.2 * np.ones(n)], axis=-1)
    else:
        upper = np.stack([0.25 * np.ones(n), -np.cos(raised), -np.sin(raised)], axis=-1)
        fore = np.stack([-0.25 * np.ones(n), np.sin(swing), -np.cos(swing)], axis=-1)
    turns = np.zeros((n, len(skeleton.names), 4))
    turns[..., 0] = 1.0
    lean = quat_about("X", np.full(n, -np.radians(style.lean_deg)))
    turns[:, skeleton.index("spine")] = lean
    bends = {"upper_leg": KNEE_DEG / 2, "lower_leg": -KNEE_DEG, "foot": KNEE_DEG / 2}
    for bent, degrees in bends.items():
        for side in ("left", "right"):
            turns[:, skeleton.index(f"{side}_{bent}")] = quat_about(
                "X", np.radians(np.full(n, degrees))
            )
    left = [np.broadcast_to(np.array([-x, y, z]), (n, 3)) for x, y, z in HANGING]
    for side, directions in (("right", (upper, fore)), ("left", left)):
        above = lean
        for bone, end, along in zip(
            ("upper_arm", "lower_arm"), ("lower_arm", "hand"), directions, strict=True
        ):
            joint, tip = skeleton.index(f"{side}_{bone}"), skeleton.index(f"{side}_{end}")
            rest: Vector = unit(skeleton.rest_m[tip] - skeleton.rest_m[joint])
            world = quat_between(np.broadcast_to(rest, (n, 3)), unit(along))
            turns[:, joint] = quat_multiply(quat_conjugate(above), world)
            above = world
    root = np.broadcast_to(skeleton.rest_m[0], (n, 3)).copy()
    return standing_on_floor(Clip(skeleton, FRAME_S, root, turns, True))
