"""Checks of an imported figure for oddities that participants would notice."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX, PARTS
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.closing import collision_mesh, is_closed, volume_m3
from visavis.stimuli.characters.rest_pose import FINGERS, PHALANGES
from visavis.stimuli.motion.faces import EXPRESSIONS, shape_lacking

STATURE_M: Final = (1.40, 2.15)
"""Range of nearly all adults, with shoes and hair."""
EYES_APART_M: Final = (0.050, 0.080)
EYEBALL_M: Final = (0.009, 0.018)
"""Radius; drawn eyes are often larger than the 12 mm of people's."""
VOLUME_L: Final = (30.0, 220.0)
LID_M: Final = 0.004
"""Least distance by which a closing lid moves down."""
NEAR_EYE_M: Final = 0.03
WORN: Final = ("none", "held_object")
"""Part names that no surface of the bare body bears."""
FIRM: Final = 0.3
"""A joint whose largest weight is not above this moves no skin."""
SIDES: Final = ("left", "right")
LIMBS: Final = {
    "upper arm": ("upper_arm", "lower_arm"),
    "forearm": ("lower_arm", "hand"),
    "thigh": ("upper_leg", "lower_leg"),
    "shank": ("lower_leg", "foot"),
}
MAX_LIMB_RATIO: Final = 1.15
"""Ratio of the two sides' lengths; people's differ by a few per cent."""


def findings(character: Character) -> tuple[str, ...]:
    """Return what participants would notice or measures suffer from, one sentence each."""
    return tuple(_findings(character))


def _findings(character: Character) -> Iterator[str]:
    low, high = STATURE_M
    if not low <= character.stature_m <= high:
        yield (
            f"is {character.stature_m:.2f} m tall: is the file in metres or centimetres? Scale it "
            "with --stature"
        )
    yield from _limbs(character)
    if character.eyeball is not None:
        yield from _eyes(character, character.eyeball.radius_m)
        yield from _lids(character)
    yield from _faces(character)
    yield from _fingers(character)
    yield from _body(character)


def _limbs(character: Character) -> Iterator[str]:
    skeleton = character.skeleton
    for name, (above, below) in LIMBS.items():
        ends = [[skeleton.index(f"{side}_{joint}") for joint in (above, below)] for side in SIDES]
        left_m, right_m = (
            float(np.linalg.norm(skeleton.rest_m[a] - skeleton.rest_m[b])) for a, b in ends
        )
        if max(left_m, right_m) > MAX_LIMB_RATIO * min(left_m, right_m):
            yield (
                f"its left {name} is {100 * left_m:.0f} cm long and its right {100 * right_m:.0f}: "
                "is the joint map right?"
            )


def _eyes(character: Character, radius_m: float) -> Iterator[str]:
    at = _eyes_at(character)
    apart_m = float(np.linalg.norm(at["left"] - at["right"]))
    low, high = EYES_APART_M
    if not low <= apart_m <= high:
        yield f"its eyes are {1000 * apart_m:.0f} mm apart; people's are 55 to 75"
    low, high = EYEBALL_M
    if not low <= radius_m <= high:
        yield f"its eyeballs have a radius of {1000 * radius_m:.0f} mm; people's have 12"


def _lids(character: Character) -> Iterator[str]:
    mesh, at = character.levels[0], _eyes_at(character)
    for side in SIDES:
        morph = mesh.morphs.get(f"{side}_blink")
        down_m = 0.0
        if morph is not None:
            near = np.linalg.norm(mesh.vertices_m[morph.vertices] - at[side], axis=1) < NEAR_EYE_M
            down_m = float(-morph.delta_m[near, 1].min(initial=0.0))
        if down_m < LID_M:
            yield f"its {side} lids do not close: give the file a shape such as eyeBlink" + (
                side.title()
            )
    if not {"lids_up", "lids_down"} & set(mesh.morphs):
        yield "its lids do not follow its eyes: give the file shapes such as eyeLookDownLeft"


def _faces(character: Character) -> Iterator[str]:
    faces_by_shape: dict[str, list[str]] = {}
    for expression in EXPRESSIONS:
        if lacking := shape_lacking(character, expression):
            faces_by_shape.setdefault(lacking, []).append(expression)
    for lacking, expressions in faces_by_shape.items():
        yield f"it cannot make the faces {', '.join(expressions)}: give the file {lacking}"


def _fingers(character: Character) -> Iterator[str]:
    mesh = character.levels[0]
    moves = {character.skeleton.names[j] for j in np.unique(mesh.joints[mesh.weights > FIRM])}
    if not all(f"{side}_{f}_{k}" in moves for side in SIDES for f in FINGERS for k in PHALANGES):
        yield (
            "its fingers have no bones, or not three each: hands stay flat, and do not close round "
            "a telephone"
        )


def _body(character: Character) -> Iterator[str]:
    mesh = collision_mesh(character)
    if not is_closed(mesh):
        yield "its surface for collisions is not closed: volumes in common would be wrong"
    litres = 1000 * volume_m3(mesh.vertices_m, mesh.triangles)
    low, high = VOLUME_L
    if not low <= litres <= high:
        yield f"its body holds {litres:.0f} litres; people's hold 45 to 150"
    parts_present = set(np.unique(character.levels[0].triangle_part).tolist())
    parts_to_wear = WORN if character.has_gaze else (*WORN, "left_eye", "right_eye")
    missing = [
        part.replace("_", " ")
        for part in PARTS
        if part not in parts_to_wear and PART_INDEX[part] not in parts_present
    ]
    if missing:
        yield f"it has no {', '.join(missing)} that could be looked at or measured"


def _eyes_at(character: Character) -> dict[str, Vector]:
    skeleton = character.skeleton
    return {side: skeleton.rest_m[skeleton.index(f"{side}_eye")] for side in SIDES}
