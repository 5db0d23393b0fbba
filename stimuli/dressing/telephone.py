"""Give somebody a telephone to hold: a flat box that belongs to the hand."""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np

from lab.geometry import Vector, unit
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.character import Character, Material, SkinnedMesh
from stimuli.motion.gesture_kernels import EARPIECE_M, HELD_AT
from stimuli.picture import StaticMesh
from stimuli.rooms.solids import box

SIZE_M = (0.145, 0.071, 0.009)
"""Length, width and thickness."""
FROM_FINGERS_DEG = 30.0
"""Between fingers and length: at the ear it then lies along the cheek, an end before the mouth."""
BLACK = (30, 31, 34)
CASE = Material("telephone", "other", 0.35)


@cache
def holding_telephone(character: Character, side: Literal["left", "right"]) -> Character:
    """Return the character with a telephone across the palm of a hand."""
    place, axes = _grip(character, side)
    solid = box((0, 0, 0), SIZE_M, BLACK, chamfer_m=0.002)
    turned = np.linalg.det(axes) < 0
    held = StaticMesh(
        (place + solid.vertices_m @ axes).astype(np.float32),
        (solid.normals @ axes).astype(np.float32),
        solid.colour_srgb,
        solid.triangles[:, ::-1] if turned else solid.triangles,
    )
    joint = character.skeleton.index(f"{side}_hand")
    material = len(character.materials)
    levels = tuple(_with(mesh, held, joint, material) for mesh in character.levels)
    return replace(
        character,
        levels=levels,
        measuring=tuple(_with(mesh, held, joint, material) for mesh in character.measuring),
        materials=(*character.materials, CASE),
    )


def _grip(character: Character, side: str) -> tuple[Vector, Vector]:
    """Return the middle (3,) of what a hand holds at rest, and its axes as rows: its length, askew
    between fingers and thumb, its width, out of the palm.
    """
    at = character.skeleton.rest_m
    index = character.skeleton.index
    hand, middle = at[index(f"{side}_hand")], at[index(f"{side}_middle_proximal")]
    thumb_side = at[index(f"{side}_index_proximal")] - at[index(f"{side}_little_proximal")]
    fingers = unit(middle - hand)
    towards_thumb = unit(thumb_side - (thumb_side @ fingers) * fingers)
    out = np.cross(fingers, towards_thumb)
    out *= -np.sign(out[1])  # palms face the floor at rest
    along, off_palm_m, to_thumb_m = HELD_AT
    c, s = np.cos(np.radians(FROM_FINGERS_DEG)), np.sin(np.radians(FROM_FINGERS_DEG))
    length, width = c * fingers + s * towards_thumb, s * fingers - c * towards_thumb
    place = hand + along * (middle - hand) + off_palm_m * out + to_thumb_m * towards_thumb
    # Arms bring to the ear what lies halfway between fingers and thumb.
    earpiece = place + EARPIECE_M * unit(fingers + towards_thumb)
    return earpiece - EARPIECE_M * length, np.stack([length, width, out])


def _with(mesh: SkinnedMesh, held: StaticMesh, joint: int, material: int) -> SkinnedMesh:
    """Return a mesh with a rigid piece more."""
    n, t = len(held.vertices_m), len(held.triangles)
    joints, weights = np.zeros((n, 4), np.uint8), np.zeros((n, 4), np.float32)
    joints[:, 0], weights[:, 0] = joint, 1.0
    uv = None if mesh.uv is None else np.concatenate([mesh.uv, np.zeros((n, 2), np.float32)])
    return replace(
        mesh,
        vertices_m=np.concatenate([mesh.vertices_m, held.vertices_m]),
        normals=np.concatenate([mesh.normals, held.normals]),
        colour_srgb=np.concatenate([mesh.colour_srgb, held.colour_srgb]),
        uv=uv,
        joints=np.concatenate([mesh.joints, joints]),
        weights=np.concatenate([mesh.weights, weights]),
        triangles=np.concatenate([mesh.triangles, held.triangles + len(mesh.vertices_m)]),
        triangle_part=np.concatenate(
            [mesh.triangle_part, np.full(t, PART_INDEX["held_object"], np.uint8)]
        ),
        triangle_material=np.concatenate([mesh.triangle_material, np.full(t, material, np.uint8)]),
    )
