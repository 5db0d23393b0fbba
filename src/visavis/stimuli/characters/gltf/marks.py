"""All joints of our skeleton for an imported figure; missing ones are estimated."""

from collections.abc import Mapping

import numpy as np

from visavis.lab.geometry import Vector, rotate, unit
from visavis.stimuli.characters.gltf.figure import Figure
from visavis.stimuli.characters.rest_pose import FINGERS, PHALANGES
from visavis.stimuli.motion.rotations import quat_between
from visavis.stimuli.motion.skeleton import canonical_skeleton


def marks_of(
    figure: Figure, points_m: Vector, eyes_m: Mapping[str, Vector]
) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Return joints and tips as `rest_pose.rig_of_marks` needs them.

    Joints without a bone stand where a body of the same height has them; eyes are the fitted
    centres. `points_m` are all vertices.
    """
    stature = float(np.ptp(points_m[:, 1]))
    pattern = canonical_skeleton(float(np.clip(stature, 0.5, 2.9)))
    at = {name: figure.at_m[node].copy() for name, node in figure.bone_of.items()}
    for side, centre in eyes_m.items():
        at[f"{side}_eye"] = np.array(centre)
    for j, name in enumerate(pattern.names):
        if name in at:
            continue
        parent = pattern.names[pattern.parents[j]]
        offset = pattern.offsets_m[j]
        if parent.endswith("hand") or "proximal" in parent or "_middle" in parent:
            offset = rotate(_arm_turn(at, name), offset)
        at[name] = at[parent] + offset
    tips: dict[str, Vector] = {}
    for side in ("left", "right"):
        for finger in FINGERS:
            last, before = (at[f"{side}_{finger}_{p}"] for p in (PHALANGES[2], PHALANGES[1]))
            tips[f"{side}_{finger}_distal"] = last + 0.8 * (last - before)
        toes, foot = at[f"{side}_toes"], at[f"{side}_foot"]
        near = points_m[np.linalg.norm((points_m - toes)[:, [0, 2]], axis=1) < 0.12]
        front = near[:, 2].min() if len(near) else toes[2] - 0.05
        ahead = unit((toes - foot) * np.array([1.0, 0.0, 1.0]))
        tips[f"{side}_toes"] = toes + ahead * max(toes[2] - front, 0.02)
        tips[f"{side}_eye"] = at[f"{side}_eye"] + np.array([0.0, 0.0, -0.0125])
    crown = float(points_m[np.abs(points_m[:, 0]) < 0.1][:, 1].max())
    tips["head"] = np.array([at["head"][0], crown, at["head"][2]])
    tips["jaw"] = at["jaw"] + pattern.tips_m[pattern.index("jaw")]
    return at, tips


def _arm_turn(at: Mapping[str, Vector], name: str) -> Vector:
    """Return how the forearm is turned against the T-pose."""
    side = "left" if name.startswith("left") else "right"
    rest = np.array([-1.0 if side == "left" else 1.0, 0.0, 0.0])
    return quat_between(rest, unit(at[f"{side}_hand"] - at[f"{side}_lower_arm"]))
