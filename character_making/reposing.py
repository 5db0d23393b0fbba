"""Where the joints of a sculpted base mesh are."""

import numpy as np

from character_making.makehuman import BODY_VERTICES, MakeHuman
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.rest_pose import FINGERS, PHALANGES, Rig, rig_of_marks


def _marks(source: MakeHuman, vertices_m: Vector) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Return where joints are as sculpted, and the ends of limbs."""

    def cube(name: str) -> Vector:
        centre: Vector = vertices_m[source.joint_vertices[name]].mean(axis=0)
        return centre

    at, tips = {}, {}
    for side, letter in (("left", "l"), ("right", "r")):
        limbs = {"shoulder": "clavicle", "upper_arm": "shoulder", "lower_arm": "elbow",
                 "hand": "hand", "upper_leg": "upper-leg", "lower_leg": "knee", "foot": "ankle",
                 "eye": "eye"}  # fmt: skip
        for ours, theirs in limbs.items():
            at[f"{side}_{ours}"] = cube(f"{letter}-{theirs}")
        for k, finger in enumerate(FINGERS, start=1):
            for j, phalanx in enumerate(PHALANGES, start=1):
                at[f"{side}_{finger}_{phalanx}"] = cube(f"{letter}-finger-{k}-{j}")
            tips[f"{side}_{finger}_distal"] = cube(f"{letter}-finger-{k}-4")
        at[f"{side}_toes"] = np.mean([cube(f"{letter}-toe-{k}-1") for k in (1, 2, 3)], axis=0)
        tips[f"{side}_toes"] = cube(f"{letter}-toe-2-4")
    middle = (at["left_upper_leg"] + at["right_upper_leg"]) / 2
    crown = vertices_m[:BODY_VERTICES][vertices_m[:BODY_VERTICES, 1].argmax()]
    stature = crown[1] - vertices_m[:BODY_VERTICES, 1].min()
    at["hips"] = middle + np.array([0.0, 0.015 * stature, 0.0])
    at["spine"], at["chest"] = cube("spine-4"), cube("spine-3")
    at["upper_chest"], at["neck"] = cube("spine-2"), cube("neck")
    at["head"], at["jaw"] = cube("head"), cube("jaw")
    for name in ("hips", "spine", "chest", "upper_chest", "neck", "head", "jaw"):
        at[name][0] = 0.0
    tips["head"] = np.array([0.0, crown[1], at["head"][2]])
    tips["jaw"] = cube("mouth")
    for side in ("left", "right"):
        tips[f"{side}_eye"] = at[f"{side}_eye"] + np.array([0.0, 0.0, -0.0125])
    return at, tips


def rig_of(source: MakeHuman, vertices_m: Vector, sole_m: float) -> Rig:
    """Find a person's joints and rest; `sole_m` is the lowest point of what is worn."""
    at, tips = _marks(source, vertices_m)
    return rig_of_marks(at, tips, sole_m)
