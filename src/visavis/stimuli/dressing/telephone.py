"""Give somebody a telephone to hold: a flat box that belongs to the hand."""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character, Material, SkinnedMesh
from visavis.stimuli.motion.telephoning import TELEPHONE_M, case_in_hand, hand_axes
from visavis.stimuli.picture import StaticMesh
from visavis.stimuli.rooms.solids import box

Use = Literal["listening", "typing"]
TYPING_FROM_FINGERS_DEG = 30.0
"""Between fingers and length, where a thumb types."""
TYPING_AT = (0.71, 0.026, 0.023)
"""Middle of it from the wrist then: shares of the hand along the fingers, metres out of the palm
and towards the thumb."""
BLACK = (30, 31, 34)
CASE = Material("telephone", "other", 0.35)


@cache
def holding_telephone(
    character: Character, side: Literal["left", "right"], use: Use = "listening"
) -> Character:
    """Return the character with a telephone across the palm of a hand, to listen or to type."""
    place, axes = _grip(character, side, use)
    solid = box((0, 0, 0), TELEPHONE_M, BLACK, chamfer_m=0.002)
    is_left_handed = np.linalg.det(axes) < 0
    telephone = StaticMesh(
        (place + solid.vertices_m @ axes).astype(np.float32),
        (solid.normals @ axes).astype(np.float32),
        solid.colour_srgb,
        solid.triangles[:, ::-1] if is_left_handed else solid.triangles,
    )
    joint = character.skeleton.index(f"{side}_hand")
    material = len(character.materials)
    levels = tuple(_with(mesh, telephone, joint, material) for mesh in character.levels)
    return replace(
        character,
        levels=levels,
        measuring=tuple(_with(mesh, telephone, joint, material) for mesh in character.measuring),
        materials=(*character.materials, CASE),
    )


def _grip(character: Character, side: str, use: Use) -> tuple[Vector, Vector]:
    """Return the middle (3,) of what a hand holds at rest, and its axes as rows: its length, askew
    between fingers and thumb, its width, out of the palm.
    """
    wrist, fingers, thumb, out = hand_axes(character.skeleton, side)
    if use == "listening":
        case = case_in_hand(character, side)
        return wrist + case.middle_m, case.axes
    angle = np.radians(TYPING_FROM_FINGERS_DEG)
    c, s = np.cos(angle), np.sin(angle)
    axes = np.stack([c * fingers + s * thumb, s * fingers - c * thumb, out])
    knuckle = character.skeleton.rest_m[character.skeleton.index(f"{side}_middle_proximal")]
    hand_m = float(np.linalg.norm(knuckle - wrist))
    along, off_m, to_thumb_m = TYPING_AT
    return wrist + along * hand_m * fingers + off_m * out + to_thumb_m * thumb, axes


def _with(mesh: SkinnedMesh, telephone: StaticMesh, joint: int, material: int) -> SkinnedMesh:
    """Return a mesh with a rigid piece more."""
    n, t = len(telephone.vertices_m), len(telephone.triangles)
    joints, weights = np.zeros((n, 4), np.uint8), np.zeros((n, 4), np.float32)
    joints[:, 0], weights[:, 0] = joint, 1.0
    uv = None if mesh.uv is None else np.concatenate([mesh.uv, np.zeros((n, 2), np.float32)])
    return replace(
        mesh,
        vertices_m=np.concatenate([mesh.vertices_m, telephone.vertices_m]),
        normals=np.concatenate([mesh.normals, telephone.normals]),
        colour_srgb=np.concatenate([mesh.colour_srgb, telephone.colour_srgb]),
        uv=uv,
        joints=np.concatenate([mesh.joints, joints]),
        weights=np.concatenate([mesh.weights, weights]),
        triangles=np.concatenate([mesh.triangles, telephone.triangles + len(mesh.vertices_m)]),
        triangle_part=np.concatenate(
            [mesh.triangle_part, np.full(t, PART_INDEX["held_object"], np.uint8)]
        ),
        triangle_material=np.concatenate([mesh.triangle_material, np.full(t, material, np.uint8)]),
    )
