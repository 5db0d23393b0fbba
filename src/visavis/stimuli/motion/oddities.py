"""Tell what is odd about a recorded motion: mirrored axes, frames of zeros, impossible speeds."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, rotate, unit
from visavis.stimuli.motion.bvh import Bvh
from visavis.stimuli.motion.clip import Clip, placed_joints
from visavis.stimuli.motion.skeleton import Skeleton, forward

MAX_HIPS_M_S = 13.0
"""Faster than anybody ran (12.4 m/s over 20 m)."""
MAX_JOINT_M_S = 40.0
"""Faster than hands throw and feet kick."""
MIN_SIDE_01 = 0.35
"""Feet count as pointing somewhere when so much of their length lies there."""


def oddities_of(bvh: Bvh, source: Clip, joints: Mapping[str, str], result: Clip) -> tuple[str, ...]:
    """Return sentences on what is odd about a file, its clip and what was retargeted from it.

    `joints` are the source's names for ours. Nothing is changed: a reader decides.
    """
    return tuple(
        text for text in (_zeros(bvh), _mirrored(source, joints), _too_fast(result)) if text
    )


def _zeros(bvh: Bvh) -> str:
    """Frames of zeros alone stand for lost tracking; a first one is often the pose at rest."""
    is_zero = (bvh.values == 0).all(axis=1)
    rows = np.flatnonzero(is_zero[1:]) + 1
    if not rows.size or is_zero.all():
        return ""
    return (
        f"{rows.size} frames hold zeros alone, the first is frame {rows[0] + 1}: tracking was lost "
        "there; cut them off, or fill them in the program that recorded"
    )


def _mirrored(source: Clip, joints: Mapping[str, str]) -> str:
    """Feet that point backwards mean that left and right, or an axis, are exchanged."""
    skeleton = source.skeleton
    at = forward(skeleton, source.root_m, source.orientation_wxyz)
    place = {ours: at.position_m[:, skeleton.index(name)] for ours, name in joints.items()}
    up = unit(place["head"] - (place["left_upper_leg"] + place["right_upper_leg"]) / 2)
    right = place["right_upper_leg"] - place["left_upper_leg"]
    ahead = unit(np.cross(up, right))
    points: list[Vector] = []
    for side in ("left", "right"):
        toes = _toes(skeleton, at.position_m, at.orientation_wxyz, joints, side)
        if toes is not None:
            points.append(unit(toes - place[f"{side}_foot"]))
    if not points:
        return ""
    toward = float(np.nanmedian([np.sum(p * ahead, axis=1) for p in points]))
    if toward > -MIN_SIDE_01:
        return ""
    return (
        "the feet point backwards: the file is of left-handed axes, mirrored, or its left and "
        "right are exchanged; export it with right-handed axes"
    )


def _toes(
    skeleton: Skeleton,
    position_m: Vector,
    orientation_wxyz: npt.NDArray[np.float64],
    joints: Mapping[str, str],
    side: str,
) -> Vector | None:
    """Return where a foot ends (frames, 3): its toes, or the tip of its bone; None if unknown."""
    if f"{side}_toes" in joints:
        return position_m[:, skeleton.index(joints[f"{side}_toes"])]
    foot = skeleton.index(joints[f"{side}_foot"])
    tip = skeleton.tips_m[foot]
    if not np.isfinite(tip).all() or np.linalg.norm(tip) < 1e-6:
        return None
    ends: Vector = position_m[:, foot] + rotate(
        orientation_wxyz[:, foot], np.broadcast_to(tip, position_m[:, foot].shape)
    )
    return ends


def _too_fast(clip: Clip) -> str:
    if len(clip.root_m) < 2:
        return ""
    places = placed_joints(clip, clip.frame_times_s).position_m
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=2) / clip.frame_s
    hips = speeds[:, 0]
    if float(hips.max()) > MAX_HIPS_M_S:
        frame, speed, what = int(hips.argmax()) + 2, float(hips.max()), "the hips"
    elif float(speeds.max()) > MAX_JOINT_M_S:
        row, joint = np.unravel_index(int(speeds.argmax()), speeds.shape)
        frame, speed = int(row) + 2, float(speeds.max())
        what = clip.skeleton.names[int(joint)]
    else:
        return ""
    return (
        f"{what} move at {speed:.0f} m/s before frame {frame}, faster than a person: frames are "
        "missing there, or the frame time is wrong"
    )
