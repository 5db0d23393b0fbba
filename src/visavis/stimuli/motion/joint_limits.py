"""Joint ranges of adults, and turns limited to them.

A turn is read as a twist about the bone, then a swing square to it: three angles in degrees about
the canonical axes, written as for the left side (the right one is reflected). Ranges of trunk,
limbs, hands and feet are those of healthy adults (Boone & Azen 1979, J Bone Joint Surg 61-A:756;
American Academy of Orthopaedic Surgeons 1965; neck: Youdas et al. 1992, Phys Ther 72:770), shared
among the joints that stand for several real ones, plus a few degrees for soft tissue; thumbs and
toes are ours. Eyes keep to 30° (`visavis.stimuli.gaze.behaviour`).
"""

from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, quat_multiply
from visavis.stimuli.motion.rotations import mirrored_quat, quat_exp, quat_log, same_hemisphere
from visavis.stimuli.motion.skeleton import canonical_skeleton

_NAMES = canonical_skeleton().names
Range = tuple[float, float]
# Per joint: range about x, about y, about z; the bone runs along x (arms) or y (everything else).
_FINGER_BASE = ((-12.0, 12.0), (-25.0, 25.0), (-30.0, 95.0))
_FINGER_MIDDLE = ((-5.0, 5.0), (-5.0, 5.0), (-5.0, 115.0))
_FINGER_END = ((-5.0, 5.0), (-5.0, 5.0), (-10.0, 85.0))
_THUMB = ((-60.0, 60.0), (-60.0, 60.0), (-60.0, 60.0))
_EYE = ((-30.0, 30.0), (-30.0, 30.0), (-12.0, 12.0))
_RANGES: Final[dict[str, tuple[Range, Range, Range]]] = {
    "spine": ((-35.0, 15.0), (-16.0, 16.0), (-14.0, 14.0)),
    "chest": ((-35.0, 15.0), (-18.0, 18.0), (-14.0, 14.0)),
    "upper_chest": ((-35.0, 15.0), (-18.0, 18.0), (-14.0, 14.0)),
    "neck": ((-30.0, 32.0), (-42.0, 42.0), (-24.0, 24.0)),
    "head": ((-32.0, 38.0), (-48.0, 48.0), (-26.0, 26.0)),
    "jaw": ((-30.0, 3.0), (-8.0, 8.0), (-5.0, 5.0)),
    "eye": _EYE,
    "shoulder": ((-12.0, 12.0), (-32.0, 25.0), (-45.0, 12.0)),
    "upper_arm": ((-100.0, 125.0), (-140.0, 75.0), (-95.0, 125.0)),
    "lower_arm": ((-85.0, 85.0), (-150.0, 5.0), (-6.0, 6.0)),
    "hand": ((-60.0, 60.0), (-40.0, 45.0), (-75.0, 85.0)),
    "thumb_proximal": _THUMB,
    "thumb_middle": _THUMB,
    "thumb_distal": ((-80.0, 80.0),) * 3,
    "proximal": _FINGER_BASE,
    "middle": _FINGER_MIDDLE,
    "distal": _FINGER_END,
    "upper_leg": ((-30.0, 130.0), (-55.0, 55.0), (-60.0, 40.0)),
    "lower_leg": ((-152.0, 8.0), (-8.0, 8.0), (-8.0, 8.0)),
    "foot": ((-60.0, 42.0), (-40.0, 40.0), (-38.0, 38.0)),
    "toes": ((-45.0, 80.0), (-5.0, 5.0), (-5.0, 5.0)),
}


def _range_of(name: str) -> tuple[Range, Range, Range]:
    bare = name.removeprefix("left_").removeprefix("right_")
    if bare in _RANGES:
        return _RANGES[bare]
    return _RANGES.get(bare.rsplit("_", 1)[-1], ((-180.0, 180.0),) * 3)


_ALL = np.array([_range_of(name) for name in _NAMES])
LOWER_DEG: Final[Vector] = _ALL[..., 0]
"""Least angles (55, 3) about x, y, z; the hips are free."""
UPPER_DEG: Final[Vector] = _ALL[..., 1]
IS_RIGHT: Final = np.array([name.startswith("right_") for name in _NAMES])
_ALONG_X = np.array(
    [
        any(part in name for part in ("shoulder", "_arm", "hand", "proximal", "middle_", "distal"))
        or name.endswith("_middle")
        for name in _NAMES
    ]
)
BONE_AXIS: Final = np.where(_ALONG_X, 0, 1)
"""Which axis (55,) the bone of each joint runs along."""
for _table in (LOWER_DEG, UPPER_DEG):
    _table.setflags(write=False)


def _as_left(turns_wxyz: Vector) -> Vector:
    """Reflect the joints of the right side."""
    return np.where(IS_RIGHT[:, None], mirrored_quat(turns_wxyz), turns_wxyz)


def joint_angles_deg(turns_wxyz: Vector) -> Vector:
    """Return the angles (..., 55, 3) about x, y, z of turns (..., 55, 4), as for the left side."""
    q = _as_left(turns_wxyz)
    along = np.take_along_axis(
        q[..., 1:], np.broadcast_to(BONE_AXIS[:, None], (*q.shape[:-1], 1)), -1
    )
    half = np.arctan2(along, q[..., :1])
    # A twist beyond half a turn is the other way round.
    half = (half + np.pi / 2) % np.pi - np.pi / 2
    axis = np.eye(3)[BONE_AXIS]
    twist = np.concatenate([np.cos(half), np.sin(half) * axis], axis=-1)
    swing = quat_multiply(q, twist * np.array([1.0, -1.0, -1.0, -1.0]))
    swing = same_hemisphere(swing, np.array([1.0, 0.0, 0.0, 0.0]))
    angles: Vector = np.degrees(2.0 * (quat_log(swing) + half * axis))
    return angles


def turns_of_angles(angles_deg: Vector) -> Vector:
    """Return turns (..., 55, 4) of angles (..., 55, 3); the inverse of `joint_angles_deg`."""
    half = np.radians(angles_deg) / 2.0
    axis = np.eye(3)[BONE_AXIS]
    twist = half * axis
    return _as_left(quat_multiply(quat_exp(half - twist), quat_exp(twist)))


def beyond_deg(turns_wxyz: Vector) -> Vector:
    """Return by how much each angle (..., 55, 3) leaves its range; 0 within."""
    angles = joint_angles_deg(turns_wxyz)
    out: Vector = np.maximum(np.maximum(LOWER_DEG - angles, angles - UPPER_DEG), 0.0)
    return out


def clamp_turns(turns_wxyz: Vector) -> Vector:
    """Return turns (..., 55, 4) held within the ranges; those within are returned as they are."""
    angles = joint_angles_deg(turns_wxyz)
    turns_within = turns_of_angles(np.clip(angles, LOWER_DEG, UPPER_DEG))
    inside = (beyond_deg(turns_wxyz) == 0.0).all(axis=-1, keepdims=True)
    return np.where(inside, turns_wxyz, turns_within)
