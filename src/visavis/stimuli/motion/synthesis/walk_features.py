"""Fifty-one features of a walk, as a study of walking styles lists them, and their four groups.

Angles of body parts are taken in world, over one cycle: μ is the mean, σ the standard deviation, v
a single value. Front–back angles are positive forwards (a foot's: toes up), left–right angles of
trunk and head positive to the right, those of limbs positive outwards.

The source prints two rows twice. Ours: the second σ of the left foot left–right is the one
front–back, whose partner on the right stands in the list; the step's length front–back counts once,
among the step's; the fifty-first is the mean place of the centre of mass left–right. "div head" is
taken as the head against the trunk.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.skeleton import Placement, forward
from visavis.stimuli.motion.synthesis.examples import Examples

GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "lateral_swing": (
        "sd_torso_lr", "sd_head_lr", "sd_com_lr", "sd_torso_fb", "sd_head_on_torso_fb",
    ),
    "limb_swing": (
        "sd_left_upper_arm_fb", "sd_left_forearm_fb", "sd_right_upper_arm_fb",
        "sd_right_forearm_fb", "sd_left_thigh_fb", "sd_right_thigh_fb", "sd_com_up",
        "sd_com_speed_up", "sd_left_thigh_lr", "sd_right_thigh_lr", "sd_left_upper_arm_lr",
        "sd_right_upper_arm_lr",
    ),
    "upper_bend": (
        "mean_torso_fb", "mean_head_fb", "mean_left_upper_arm_fb", "mean_right_upper_arm_fb",
        "mean_left_forearm_fb", "mean_right_forearm_fb", "mean_left_thigh_fb",
        "mean_right_thigh_fb", "mean_torso_lr", "mean_head_lr", "mean_left_upper_arm_lr",
        "mean_right_upper_arm_lr", "mean_left_thigh_lr", "mean_right_foot_lr",
        "mean_com_speed_lr", "step_length_lr", "mean_com_lr",
    ),
    "step_length": (
        "step_length_fb", "mean_com_speed_fb", "sd_com_speed_fb", "mean_com_up", "duration",
        "mean_right_thigh_lr", "mean_left_shin_fb", "mean_right_shin_fb", "mean_left_foot_fb",
        "mean_right_foot_fb", "mean_left_foot_lr", "sd_left_shin_fb", "sd_right_shin_fb",
        "sd_right_foot_fb", "sd_left_foot_lr", "sd_right_foot_lr", "sd_left_foot_fb",
    ),
}  # fmt: skip
"""The features by the groups in which the source prints them for its 27 walks."""
FEATURES: Final = tuple(name for group in GROUPS.values() for name in group)
GRAINS: Final = {"deg": 0.1, "m": 0.001, "m/s": 0.005, "s": 0.001}
"""A feature whose values lie within so much of each other does not tell motions apart."""
_BONES: Final = {
    "upper_arm": ("upper_arm", "lower_arm"),
    "forearm": ("lower_arm", "hand"),
    "thigh": ("upper_leg", "lower_leg"),
    "shin": ("lower_leg", "foot"),
    "foot": ("foot", "toes"),
}
_MASSES: Final = {
    "upper_arm": (0.028, 0.436), "forearm": (0.022, 0.6), "thigh": (0.100, 0.433),
    "shin": (0.0465, 0.433), "foot": (0.0145, 0.5),
}  # fmt: skip
"""Share of the body's mass, and its place from joint to joint (Winter 2009, table 4.1)."""
_TRUNK_MASS, _HEAD_MASS = 0.497, 0.081


def unit_of(feature: str) -> str:
    """Return the unit of a feature."""
    if feature == "duration":
        return "s"
    if "speed" in feature:
        return "m/s"
    return "m" if "com" in feature or "step" in feature else "deg"


def _angles(clip: Clip, body: Placement) -> dict[str, Vector]:
    """Return angles over time in degrees: PART_fb and PART_lr of every part."""
    index, place = clip.skeleton.index, body.position_m
    head = index("head")
    tip = np.nan_to_num(clip.skeleton.tips_m[head], nan=0.2)
    crown = place[:, head] + rotate(
        body.orientation_wxyz[:, head], np.broadcast_to(tip, place[:, head].shape)
    )
    angles: dict[str, Vector] = {}
    for part, along in (
        ("torso", place[:, index("neck")] - place[:, index("spine")]),
        ("head", crown - place[:, head]),
    ):
        angles[f"{part}_fb"] = np.degrees(np.arctan2(-along[:, 2], along[:, 1]))
        angles[f"{part}_lr"] = np.degrees(np.arctan2(along[:, 0], along[:, 1]))
    angles["head_on_torso_fb"] = angles["head_fb"] - angles["torso_fb"]
    for side, outward in (("left", -1.0), ("right", 1.0)):
        for part, (a, b) in _BONES.items():
            along = place[:, index(f"{side}_{b}")] - place[:, index(f"{side}_{a}")]
            x, y, z = outward * along[:, 0], along[:, 1], along[:, 2]
            if part == "foot":
                angles[f"{side}_{part}_fb"] = np.degrees(np.arctan2(y, -z))
                angles[f"{side}_{part}_lr"] = np.degrees(np.arctan2(x, -z))
            else:
                angles[f"{side}_{part}_fb"] = np.degrees(np.arctan2(-z, -y))
                angles[f"{side}_{part}_lr"] = np.degrees(np.arctan2(x, -y))
    return angles


def centre_of_mass(clip: Clip, body: Placement) -> Vector:
    """Return the centre of mass (frames, 3) of a body with canonical joint names."""
    index, place = clip.skeleton.index, body.position_m
    hips = (place[:, index("left_upper_leg")] + place[:, index("right_upper_leg")]) / 2
    total = (
        _TRUNK_MASS * (hips + place[:, index("neck")]) / 2 + _HEAD_MASS * place[:, index("head")]
    )
    mass = _TRUNK_MASS + _HEAD_MASS
    for side in ("left", "right"):
        for part, (share, at) in _MASSES.items():
            a, b = (place[:, index(f"{side}_{joint}")] for joint in _BONES[part])
            total = total + share * ((1.0 - at) * a + at * b)
            mass += share
    centre: Vector = total / mass
    return centre


def features_of(clip: Clip) -> dict[str, float]:
    """Return the features of one cycle of a walk to −z, a looping clip, by their names."""
    body = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz)
    angles = _angles(clip, body)
    com = centre_of_mass(clip, body)
    after = np.concatenate([com[1:], com[:1] + clip.travel_m])
    speed = (after - com) / clip.frame_s
    series = {
        **angles,
        "com_lr": com[:, 0],
        "com_up": com[:, 1],
        "com_speed_lr": speed[:, 0],
        "com_speed_up": speed[:, 1],
        "com_speed_fb": -speed[:, 2],
    }
    feet = [body.position_m[:, clip.skeleton.index(f"{side}_foot")] for side in ("left", "right")]
    values = {
        "duration": clip.duration_s,
        "step_length_fb": -clip.travel_m[2] / 2.0,
        "step_length_lr": float(np.median(feet[1][:, 0]) - np.median(feet[0][:, 0])),
    }
    for name in FEATURES:
        kind, _, of = name.partition("_")
        if kind in ("mean", "sd"):
            values[name] = float(series[of].mean() if kind == "mean" else series[of].std())
    return {name: values[name] for name in FEATURES}


@dataclass(frozen=True, eq=False)
class FeatureTable:
    """Features of n examples: `values` (n, 51) in their units, and how they become 0 to 1.

    Each is z-scored over the examples, then the least becomes 0 and the greatest 1, which is one
    straight line; a feature that does not tell them apart is ½ in all of them.
    """

    names: tuple[str, ...]
    values: Vector

    @cached_property
    def least(self) -> Vector:
        """The least value of every feature."""
        low: Vector = self.values.min(axis=0)
        return low

    @cached_property
    def span(self) -> Vector:
        """Greatest less least; infinite where that is within the feature's grain."""
        span = self.values.max(axis=0) - self.least
        grain = np.array([GRAINS[unit_of(name)] for name in FEATURES])
        return np.where(span > grain, span, np.inf)

    def scaled(self, values: Vector) -> Vector:
        """Return features (..., 51) on the examples' scale from 0 to 1, beyond it outside."""
        share = (values - self.least) / self.span
        result: Vector = np.where(np.isfinite(self.span), share, 0.5)
        return result

    @cached_property
    def scaled_01(self) -> Vector:
        """The examples' features (n, 51) from 0 to 1."""
        return self.scaled(self.values)

    @cached_property
    def group_of(self) -> tuple[str, ...]:
        """The group of every feature here: Ward's four clusters over these examples, each called
        as the source's group with which it shares most (all four names in use).
        """
        from scipy.cluster.hierarchy import cut_tree, linkage  # late: walks need not pay for it

        labels = cut_tree(linkage(self.scaled_01.T, "ward"), [len(GROUPS)])[:, 0]
        clusters = [np.flatnonzero(labels == c) for c in range(len(GROUPS))]
        overlap = np.array(
            [
                [sum(FEATURES[i] in g for i in members) for g in GROUPS.values()]
                for members in clusters
            ]
        )
        _, columns = linear_sum_assignment(-overlap)
        return tuple(tuple(GROUPS)[columns[label]] for label in labels)

    @cached_property
    def primary(self) -> Vector:
        """The four primary parameters of the examples (n, 4): means of the features of a group, in
        the order of `GROUPS`.
        """
        return self.primary_of(self.scaled_01)

    def primary_of(self, scaled: Vector) -> Vector:
        """Return the primary parameters (..., 4) of scaled features (..., 51)."""
        member = np.array([[g == name for g in self.group_of] for name in GROUPS], dtype=np.float64)
        means: Vector = scaled @ (member / member.sum(axis=1, keepdims=True)).T
        return means


def feature_table(examples: Examples) -> FeatureTable:
    """Return the features of all examples.

    Raises:
        DataError: the examples' skeleton lacks a body part.
    """
    missing = [j for j in NEEDED if j not in examples.skeleton.index_of]
    if missing:
        raise DataError(f"features of walks need joints {', '.join(missing)}; retarget the motions")
    rows = [list(features_of(examples.clip(i)).values()) for i in range(len(examples))]
    return FeatureTable(examples.names, np.array(rows))


NEEDED: Final[Sequence[str]] = (
    "spine",
    "neck",
    "head",
    *(f"{s}_{j}" for s in ("left", "right") for j in dict.fromkeys(sum(_BONES.values(), ()))),
)
"""Joints that features are taken from."""
