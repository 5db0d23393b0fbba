"""Tag triangles with the body part they belong to."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX

Indices = npt.NDArray[np.int64]

_PART_OF = {
    "hips": "pelvis", "spine": "torso", "chest": "torso", "upper_chest": "torso",
    "shoulder": "torso", "neck": "neck", "head": "scalp", "jaw": "face", "eye": "face",
    "upper_arm": "upper_arm", "lower_arm": "forearm", "upper_leg": "thigh",
    "lower_leg": "shin", "foot": "foot", "toes": "foot",
}  # fmt: skip


def part_of_joint(name: str) -> int:
    """Return the part that a joint of the skeleton moves; the head's is the scalp."""
    side = next((s for s in ("left_", "right_") if name.startswith(s)), "")
    part = _PART_OF.get(name.removeprefix(side), "hand")
    has_side = part in ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")
    return PART_INDEX[side + part if has_side else part]


def parts_of_weights(weights: Vector, triangles: Indices, names: Sequence[str]) -> Indices:
    """Tag triangles by the joint that moves most of them."""
    parts = np.array([part_of_joint(name) for name in names])
    share = np.zeros((len(weights), len(PART_INDEX)))
    for j, part in enumerate(parts):
        share[:, part] += weights[:, j]
    tags: Indices = share[triangles].sum(axis=1).argmax(axis=1)
    return tags


def face_of_head(parts: Indices, centres_m: Vector, eyes_m: Vector, scale: float) -> Indices:
    """Split what is tagged head into face and scalp: before the ears, below the hair.

    `eyes_m` is the point between the eyes, `scale` 1 for a person of 1.72 m.
    """
    on_head = (parts == PART_INDEX["scalp"]) | (parts == PART_INDEX["face"])
    before = centres_m[:, 2] < eyes_m[2] + 0.075 * scale
    below = centres_m[:, 1] < eyes_m[1] + 0.075 * scale
    split = np.where(before & below, PART_INDEX["face"], PART_INDEX["scalp"])
    tags: Indices = np.where(on_head, split, parts)
    return tags
