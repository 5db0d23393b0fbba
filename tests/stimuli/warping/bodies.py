"""A cheap body for tests: a box along every bone of the canonical skeleton, tagged by part."""

from functools import cache

import numpy as np

from visavis.lab.geometry import quat_from_yaw_pitch_deg, quat_multiply
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.motion.clip import Clip, standing
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.warping.perceived import SeenBody
from visavis.stimuli.rooms.solids import box

PART_OF_JOINT = {
    "head": "face", "neck": "neck", "upper_chest": "torso", "chest": "torso", "spine": "torso",
    "hips": "pelvis",
    **{f"{s}_{j}": f"{s}_{p}" for s in ("left", "right") for j, p in (
        ("upper_arm", "upper_arm"), ("lower_arm", "forearm"), ("hand", "hand"),
        ("upper_leg", "thigh"), ("lower_leg", "shin"), ("foot", "foot"))},
}  # fmt: skip


@cache
def box_person(height_m: float = 1.75) -> SeenBody:
    skeleton = canonical_skeleton(height_m)
    rest, joints, triangles, labels, start = [], [], [], [], 0
    for joint, part in PART_OF_JOINT.items():
        j = skeleton.index(joint)
        children = [c for c, p in enumerate(skeleton.parents) if p == j]
        ends = [skeleton.offsets_m[c] for c in children]
        if np.isfinite(skeleton.tips_m[j]).all():
            ends.append(skeleton.tips_m[j])
        reach = np.array([np.zeros(3), *ends])
        low, high = reach.min(axis=0) - 0.035, reach.max(axis=0) + 0.035
        if joint == "head":
            low, high = np.array([-0.08, 0.0, -0.11]), np.array([0.08, 0.24, 0.08])
        mesh = box(skeleton.rest_m[j] + (low + high) / 2, high - low, (200, 200, 200))
        rest.append(mesh.vertices_m.astype(float))
        joints += [j] * len(mesh.vertices_m)
        triangles.append(mesh.triangles + start)
        labels += [PART_INDEX[part]] * len(mesh.triangles)
        start += len(mesh.vertices_m)
    n = len(joints)
    joint_rows = np.zeros((n, 4), dtype=np.uint8)
    joint_rows[:, 0] = joints
    weights = np.zeros((n, 4))
    weights[:, 0] = 1.0
    return SeenBody(
        skeleton,
        np.concatenate(rest),
        joint_rows,
        weights,
        np.concatenate(triangles).astype(np.int32),
        np.array(labels, dtype=np.uint8),
    )


def arm_raised(height_m: float = 1.75):
    """Return root and turns of somebody whose right hand is up beside the head."""
    skeleton = box_person(height_m).skeleton
    pose = standing(skeleton)
    turns = pose.orientation_wxyz.copy()
    about_z = lambda deg: np.array(  # noqa: E731  (reads as the formula it is)
        [np.cos(np.radians(deg) / 2), 0, 0, np.sin(np.radians(deg) / 2)]
    )
    turns[skeleton.index("left_upper_arm")] = about_z(75)
    turns[skeleton.index("right_upper_arm")] = about_z(-40)
    turns[skeleton.index("right_lower_arm")] = quat_multiply(
        about_z(120), quat_from_yaw_pitch_deg(10.0)
    )
    return pose.root_m, turns


def waving_clip(seconds: float = 1.0, frames: int = 31) -> Clip:
    """Return a hand that swings beside the head, a whole swing a second."""
    body = box_person()
    root, turns = arm_raised()
    rows = np.repeat(turns[None], frames, axis=0)
    t = np.linspace(0, seconds, frames)
    j = body.skeleton.index("right_lower_arm")
    for k, angle in enumerate(np.radians(20 * np.sin(2 * np.pi * t))):
        rows[k, j] = quat_multiply(turns[j], np.array([np.cos(angle / 2), 0, 0, np.sin(angle / 2)]))
    return Clip(body.skeleton, seconds / (frames - 1), np.repeat(root[None], frames, 0), rows)
