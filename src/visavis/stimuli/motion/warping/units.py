"""Warping units: handles on a body, each turning one or several joints about an axis.

Table 2.1 of the source: spine 3, neck and head 3, and per arm shoulder 3, elbow 2, wrist 3. The
axes, the share each joint takes and the range are ours; turns are about axes of the joint itself.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_limits import BONE_AXIS, IS_RIGHT, LOWER_DEG, UPPER_DEG
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton
from visavis.stimuli.motion.warping.turning_kernels import turn_joints

Index = npt.NDArray[np.int64]

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_TRUNK: Final = (("spine", 0.33), ("chest", 0.33), ("upper_chest", 0.34))
_HEAD: Final = (("neck", 0.4), ("head", 0.6))


@dataclass(frozen=True)
class WarpingUnit:
    """A handle: `shares` of its angle go to joints, about `axis`; `range_deg` on either side."""

    name: str
    shares: tuple[tuple[str, float], ...]
    axis: tuple[float, float, float]
    range_deg: float


def _arm(side: str) -> tuple[WarpingUnit, ...]:
    # In the T-pose the arm lies along x: flexion of shoulder and elbow sweep it forward (about
    # y), raising and lowering are about z, twists about x.
    joints = {p: ((f"{side}_{p}", 1.0),) for p in ("upper_arm", "lower_arm", "hand")}
    return (
        WarpingUnit(f"{side}_shoulder_swing", joints["upper_arm"], _Y, 60.0),
        WarpingUnit(f"{side}_shoulder_raise", joints["upper_arm"], _Z, 60.0),
        WarpingUnit(f"{side}_shoulder_twist", joints["upper_arm"], _X, 60.0),
        WarpingUnit(f"{side}_elbow_flex", joints["lower_arm"], _Y, 60.0),
        WarpingUnit(f"{side}_forearm_twist", joints["lower_arm"], _X, 70.0),
        WarpingUnit(f"{side}_wrist_flex", joints["hand"], _Z, 40.0),
        WarpingUnit(f"{side}_wrist_deviate", joints["hand"], _Y, 20.0),
        WarpingUnit(f"{side}_wrist_twist", joints["hand"], _X, 20.0),
    )


UNITS: Final[dict[str, WarpingUnit]] = {
    unit.name: unit
    for unit in (
        WarpingUnit("spine_bend", _TRUNK, _X, 35.0),
        WarpingUnit("spine_turn", _TRUNK, _Y, 40.0),
        WarpingUnit("spine_lean", _TRUNK, _Z, 30.0),
        WarpingUnit("head_nod", _HEAD, _X, 35.0),
        WarpingUnit("head_turn", _HEAD, _Y, 60.0),
        WarpingUnit("head_tilt", _HEAD, _Z, 30.0),
        *_arm("left"),
        *_arm("right"),
    )
}
"""All 22, by name."""

UNIT_GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "spine": tuple(n for n in UNITS if n.startswith("spine")),
    "neck_head": tuple(n for n in UNITS if n.startswith("head")),
    "left_arm": tuple(n for n in UNITS if n.startswith("left")),
    "right_arm": tuple(n for n in UNITS if n.startswith("right")),
    "arms": tuple(n for n in UNITS if n.startswith(("left", "right"))),
    "all": tuple(UNITS),
}


def units_named(names: tuple[str, ...]) -> tuple[WarpingUnit, ...]:
    """Return units by name or by group, each once, in the table's order.

    Raises:
        MotionError: none was named, or one is unknown.
    """
    unit_names: set[str] = set()
    for name in names:
        if name not in UNITS and name not in UNIT_GROUPS:
            choices = ", ".join((*UNIT_GROUPS, *UNITS))
            raise MotionError(f"there is no warping unit {name!r}; choose from {choices}")
        unit_names.update(UNIT_GROUPS.get(name, (name,)))
    if not unit_names:
        raise MotionError("no warping unit is allowed to move; name at least one")
    return tuple(unit for name, unit in UNITS.items() if name in unit_names)


@lru_cache(maxsize=64)
def _handles(
    skeleton_names: tuple[str, ...], units: tuple[WarpingUnit, ...]
) -> tuple[Index, Vector, Vector, Vector, Index, npt.NDArray[np.bool_]]:
    """Return what the kernel needs to turn these units.

    Joints (m,) they turn, the rotation vector (w, m, 3) each takes per radian of a unit, least
    and largest angle (m, 3) in degrees, the axis (m,) of the bone, and which are on the right.
    """
    turning = np.zeros((len(units), len(skeleton_names), 3))
    for k, unit in enumerate(units):
        for joint, share in unit.shares:
            if joint not in skeleton_names:
                raise MotionError(
                    f"warping unit {unit.name!r} turns {joint!r}, which the skeleton lacks; leave "
                    "the unit out or use a canonical skeleton"
                )
            turning[k, skeleton_names.index(joint)] += share * np.array(unit.axis)
    joints = np.flatnonzero(turning.any(axis=(0, 2)))
    canonical = canonical_skeleton().names
    joint_numbers = np.array([canonical.index(skeleton_names[j]) for j in joints], dtype=np.int64)
    return (
        joints,
        np.ascontiguousarray(turning[:, joints]),
        LOWER_DEG[joint_numbers],
        UPPER_DEG[joint_numbers],
        BONE_AXIS[joint_numbers],
        IS_RIGHT[joint_numbers],
    )


def turned_by(
    skeleton: Skeleton,
    units: tuple[WarpingUnit, ...],
    local_wxyz: Vector,
    omega_rad: Vector,
    *,
    is_limited: bool = False,
) -> Vector:
    """Add offsets (n, w) or (w,) in radians to turns (55, 4); offsets of 0 change no bit.

    Several units on one joint add as rotation vectors, so their order does not matter. `is_limited`
    keeps the joints that were moved within their limits.
    """
    joints, turning, low, high, bone, right = _handles(skeleton.names, units)
    offsets = np.ascontiguousarray(omega_rad, dtype=np.float64).reshape(-1, len(units))
    turns = np.empty((len(offsets), *local_wxyz.shape))
    turns[:] = local_wxyz
    turn_joints(
        np.ascontiguousarray(local_wxyz),
        offsets,
        joints,
        turning,
        low,
        high,
        bone,
        right,
        is_limited,
        turns,
    )
    return turns.reshape(*omega_rad.shape[:-1], *local_wxyz.shape)
