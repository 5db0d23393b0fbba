"""From BVH files to clips and back: units, channel orders, bones of fixed length."""

from typing import Literal

import numpy as np

from visavis.lab.geometry import Vector, quat_multiply
from visavis.stimuli.motion.bvh import Bvh, BvhJoint, channel_columns
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import IDENTITY, check_order, euler_from_quat, quat_about
from visavis.stimuli.motion.skeleton import Skeleton

CMU_UNIT_M = 0.05644
"""Metres per unit in BVH files made from the CMU database (inches over 0.45)."""
MAX_STRETCH_M = 0.01


def clip_of_bvh(
    bvh: Bvh,
    *,
    unit_m: float,
    positions: Literal["replace", "add"] = "replace",
    max_stretch_m: float = MAX_STRETCH_M,
) -> Clip:
    """Return a BVH motion on the file's own skeleton, in metres and quaternions.

    `unit_m` is the file's unit in metres (0.01 for centimetres; files do not say). Rotation
    channels compose left to right. Position channels stand in place of the joint's OFFSET, as
    most exporters write them, or are added to it. Axes stay those of the file.

    Raises:
        MotionError: bones change length by more than `max_stretch_m`, or the unit is impossible.
    """
    if not 0 < unit_m < np.inf:
        raise MotionError(f"unit of {unit_m} m; give metres per unit of the file, such as 0.01")
    frames, n = len(bvh.values), len(bvh.joints)
    turns = np.tile(IDENTITY, (frames, n, 1))
    offsets = unit_m * np.array([j.offset for j in bvh.joints])
    root = np.zeros((frames, 3)) + offsets[0]
    for i, (joint, columns) in enumerate(zip(bvh.joints, channel_columns(bvh), strict=True)):
        place = np.zeros((frames, 3)) + offsets[i]
        for channel, column in zip(joint.channels, columns, strict=True):
            values = bvh.values[:, column]
            axis = channel[0]
            if channel.endswith("rotation"):
                turns[:, i] = quat_multiply(turns[:, i], quat_about(axis, np.radians(values)))
            else:
                k = "XYZ".index(axis)
                place[:, k] = unit_m * values + (offsets[i, k] if positions == "add" else 0.0)
        if i == 0:
            root = place
            continue
        mean = place.mean(axis=0)
        stretch = float(np.linalg.norm(place - mean, axis=1).max())
        if stretch > max_stretch_m:
            raise MotionError(
                f"joint {joint.name!r} moves {stretch:.3f} m against its parent; bones are rigid "
                "here: export the motion without stretch, or allow more with max_stretch_m"
            )
        offsets[i] = mean
    offsets[0] = 0.0
    tips = unit_m * np.array([j.end if j.end is not None else [np.nan] * 3 for j in bvh.joints])
    parents = np.array([j.parent for j in bvh.joints], dtype=np.int64)
    skeleton = Skeleton(tuple(j.name for j in bvh.joints), parents, offsets, tips)
    return Clip(skeleton, bvh.frame_time_s, root, turns)


def bvh_of_clip(clip: Clip, *, unit_m: float = 0.01, order: str = "ZXY") -> Bvh:
    """Return a clip as a BVH file: root with six channels, the others with three rotations.

    Angles run on beyond 180° where the motion does, so no program interpolates through a jump.
    """
    axes = check_order(order)
    skeleton = clip.skeleton
    rotations = tuple(f"{axis}rotation" for axis in axes)
    joints = []
    columns = [clip.root_m / unit_m]
    for i in _depth_first(skeleton):
        channels = rotations if i else ("Xposition", "Yposition", "Zposition", *rotations)
        joints.append((i, channels))
        angles = euler_from_quat(clip.orientation_wxyz[:, i], axes)
        columns.append(np.degrees(np.unwrap(angles, axis=0)))
    place = {old: new for new, (old, _) in enumerate(joints)}
    bvh_joints = tuple(
        BvhJoint(
            skeleton.names[i],
            place.get(int(skeleton.parents[i]), -1),
            _triple(skeleton.offsets_m[i] / unit_m),
            channels,
            None if np.isnan(skeleton.tips_m[i]).any() else _triple(skeleton.tips_m[i] / unit_m),
        )
        for i, channels in joints
    )
    return Bvh(bvh_joints, clip.frame_s, np.concatenate(columns, axis=1))


def _triple(v: Vector) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])


def _depth_first(skeleton: Skeleton) -> list[int]:
    """Return joints in the order a BVH file nests them."""
    children: dict[int, list[int]] = {}
    for j, parent in enumerate(skeleton.parents.tolist()):
        children.setdefault(parent, []).append(j)
    order, stack = [], [0]
    while stack:
        j = stack.pop()
        order.append(j)
        stack += reversed(children.get(j, []))
    return order
