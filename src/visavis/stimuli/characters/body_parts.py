"""Names of body parts, and groups of them that measures use."""

from typing import Final

PARTS: Final[tuple[str, ...]] = (
    "none",
    "face",
    "left_eye",
    "right_eye",
    "scalp",
    "neck",
    "torso",
    "pelvis",
    "left_upper_arm",
    "left_forearm",
    "left_hand",
    "right_upper_arm",
    "right_forearm",
    "right_hand",
    "left_thigh",
    "left_shin",
    "left_foot",
    "right_thigh",
    "right_shin",
    "right_foot",
    "held_object",
)
"""Part of a triangle by index; 0 is what belongs to nobody. Clothes and hair bear the part they
cover: a sleeve is an arm, hair is scalp."""

PART_INDEX: Final[dict[str, int]] = {name: i for i, name in enumerate(PARTS)}

_ARM = ("upper_arm", "forearm", "hand")
_LEG = ("thigh", "shin", "foot")

GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "eyes": ("left_eye", "right_eye"),
    "head": ("face", "left_eye", "right_eye", "scalp"),
    "trunk": ("torso", "pelvis"),
    "left_arm": tuple(f"left_{p}" for p in _ARM),
    "right_arm": tuple(f"right_{p}" for p in _ARM),
    "hands": ("left_hand", "right_hand"),
    "arms": tuple(f"{s}_{p}" for s in ("left", "right") for p in _ARM),
    "legs": tuple(f"{s}_{p}" for s in ("left", "right") for p in _LEG),
}
"""Names that stand for several parts."""
