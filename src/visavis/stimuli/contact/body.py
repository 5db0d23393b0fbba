"""A body as nineteen capsules on the canonical skeleton, and the same as a closed mesh's parts."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.skeleton import canonical_skeleton

REFERENCE_STATURE_M: Final = 1.75

_FRACTIONS: Final[dict[str, tuple[tuple[float, ...], tuple[float, ...], float]]] = {
    "hips": ((-0.050, -0.010, 0.0), (0.050, -0.010, 0.0), 0.066),
    "spine": ((-0.034, 0.040, 0.0), (0.034, 0.040, 0.0), 0.060),
    "upper_chest": ((-0.058, 0.045, 0.0), (0.058, 0.045, 0.0), 0.064),
    "neck": ((0.0, 0.0, 0.0), (0.0, 0.050, 0.0), 0.032),
    "head": ((0.0, 0.028, -0.010), (0.0, 0.075, -0.012), 0.054),
    "left_shoulder": ((0.0, 0.0, 0.0), (-0.090, 0.0, 0.0), 0.036),
    "left_upper_arm": ((0.0, 0.0, 0.0), (-0.186, 0.0, 0.0), 0.026),
    "left_lower_arm": ((0.0, 0.0, 0.0), (-0.146, 0.0, 0.0), 0.022),
    "left_hand": ((-0.020, 0.0, 0.0), (-0.085, 0.0, 0.0), 0.020),
    "left_upper_leg": ((0.0, 0.0, 0.0), (0.0, -0.245, 0.0), 0.044),
    "left_lower_leg": ((0.0, 0.0, 0.0), (0.0, -0.246, 0.0), 0.030),
    "left_foot": ((0.0, -0.018, 0.012), (0.0, -0.022, -0.080), 0.017),
}
"""Capsules in fractions of stature, in the joint's frame at rest: start, end, radius.

Trunk capsules lie across, so that it is wider than deep (0.43 × 0.24 m at 1.75 m). Lengths are
the skeleton's (Winter 2009); radii are ours, after anthropometric breadths and circumferences.
"""

CAPSULE_JOINTS: Final[tuple[str, ...]] = (
    *_FRACTIONS,
    *(n.replace("left_", "right_") for n in _FRACTIONS if n.startswith("left_")),
)
"""The joint that each of the nineteen capsules hangs on, in their order."""

ARM_JOINTS: Final[tuple[str, ...]] = (
    "left_upper_arm",
    "left_lower_arm",
    "left_hand",
    "right_upper_arm",
    "right_lower_arm",
    "right_hand",
)
"""The six segments that are watched for contact."""


@dataclass(frozen=True, eq=False)
class CapsuleBody:
    """m capsules of one person: `joint` (m,) names; `start_m`, `end_m` (m, 3) in the joint's
    frame at rest (axes of the world in a T-pose to −z); `radius_m` (m,).
    """

    joint: tuple[str, ...]
    start_m: Vector
    end_m: Vector
    radius_m: Vector

    @cached_property
    def columns(self) -> npt.NDArray[np.int64]:
        """Index of each capsule's joint in `BODY_JOINTS`."""
        return np.array([BODY_JOINTS.index(name) for name in self.joint])

    def posed(self, position_m: Vector, orientation_wxyz: Vector) -> tuple[Vector, Vector]:
        """Return starts and ends (..., m, 3) in world.

        `position_m` (..., 22, 3) and `orientation_wxyz` (..., 22, 4) of `BODY_JOINTS`.
        """
        at, turn = position_m[..., self.columns, :], orientation_wxyz[..., self.columns, :]
        return at + rotate(turn, self.start_m), at + rotate(turn, self.end_m)


@cache
def capsule_body(
    stature_m: float = REFERENCE_STATURE_M, joints: tuple[str, ...] = CAPSULE_JOINTS
) -> CapsuleBody:
    """Return the capsules of a person of this stature, all or those of some joints."""
    starts, ends, radii = [], [], []
    for name in joints:
        is_right = name.startswith("right_")
        start, end, radius = _FRACTIONS[name.replace("right_", "left_")]
        sign = np.array([-1.0 if is_right else 1.0, 1.0, 1.0])
        starts.append(sign * start)
        ends.append(sign * end)
        radii.append(radius)
    return CapsuleBody(
        joints,
        stature_m * np.array(starts),
        stature_m * np.array(ends),
        stature_m * np.array(radii),
    )


@dataclass(frozen=True, eq=False)
class Bones:
    """The joints of a body: `parents` (22,), `offsets_m` (22, 3) at the reference stature."""

    parents: npt.NDArray[np.int64]
    offsets_m: Vector
    hip_height_m: float


@cache
def bones() -> Bones:
    """Return the part of the canonical skeleton that `BODY_JOINTS` name."""
    skeleton = canonical_skeleton(REFERENCE_STATURE_M)
    index = [skeleton.index(name) for name in BODY_JOINTS]
    parents = [-1] + [
        BODY_JOINTS.index(skeleton.names[skeleton.parents[joint]]) for joint in index[1:]
    ]
    sole_m = 0.039 * REFERENCE_STATURE_M
    ankle = skeleton.rest_m[skeleton.index("left_foot"), 1]
    return Bones(np.array(parents), skeleton.offsets_m[index].copy(), float(sole_m - ankle))
