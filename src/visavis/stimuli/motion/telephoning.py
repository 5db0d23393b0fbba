"""The pose of a telephone at the ear, and of the hand that holds it.

The telephone leans against ear and cheek, its length along the line from the ear to the corner of
the mouth; the hollow palm is at its back, thumb at the edge behind, fingers round the edge before,
as `gripping` bends them.
"""

from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.grip_kernels import Case
from visavis.stimuli.motion.gripping import FINGERS, grip_of_character, skin_of_hand
from visavis.stimuli.motion.posture_kernels import DOWN, LEFT_X
from visavis.stimuli.motion.skeleton import Skeleton

TELEPHONE_M: Final = (0.145, 0.071, 0.009)
"""Length, width and thickness."""
EARPIECE_M: Final = 0.060
"""From the middle of a telephone to what lies at the ear."""
FROM_FINGERS_DEG: Final = 36.0
"""Between fingers and length: fingers then reach over an edge, the forearm hangs down, and elbows
bend no farther than they can."""
BEYOND_JOINT: Final = 0.4
"""Share of the middle finger's middle phalanx at which that edge is."""
HOLLOW_M: Final = 0.0125
"""Between it and the palm: fingers and thumb hold it by its edges."""
ALONG: Final = 1.05
"""Middle of the telephone from the wrist, as a share of the hand to its knuckles, where there is
no flesh."""
PALM_M: Final = 0.017
"""Palm off the axis of a hand, where nothing is measured."""
BACK_M: Final = 0.012
"""Its back, likewise."""
PALM_RANGE_M: Final = (0.008, 0.030)
PALM_JOINTS: Final = ("hand", *(f"{name}_proximal" for name in FINGERS))
TRAGUS_M: Final = (-0.008, -0.019)
"""Where the ear opens: above and behind where the ear stands out most."""
MOUTH_M: Final = (0.026, -0.070)
"""Corner of the mouth from the middle of the eyes: to its side and above, at 1.75 m."""
BELOW_MOUTH_DEG: Final = 12.0
"""Seen from the side a telephone points past the mouth, below it."""
LEAN_IN: Final = np.linspace(0.0, 0.30, 13)
LEAN_DOWN: Final = np.linspace(-0.30, 0.30, 25)
"""How steeply the end at the mouth, and the lower edge, may come nearer to the face."""
HAIR_GIVES_M: Final = 0.010
MAX_OFF_EAR_M: Final = 0.027
"""Hair below a telephone is pressed down by so much, and no telephone is farther from the ear."""
MIN_POINTS: Final = 20
CLEAR_M: Final = 0.004
"""Between skin and what lies at it."""
SQUARE: Final = np.array([LEFT_X, (0.0, 0.0, -1.0), DOWN])
"""Ways of the fingers, to the thumb and out of the palm of a left hand with square knuckles."""
ROOM_ALONG_M: Final = np.linspace(-TELEPHONE_M[0] / 2, TELEPHONE_M[0] / 2, 9)
"""Where it is measured how far the cheek is from the telephone's face, at the edge before."""
MAX_ROOM_M: Final = 0.025
FINGER_CLEAR_M: Final = 0.0015
"""Between finger and cheek."""


def head_skin_m(character: Character) -> tuple[Vector, Vector]:
    """Return points (k, 3) of a head's skin at rest and (m, 3) of what it wears, from the head's
    joint, both halves put onto the left one.
    """
    mesh, skeleton = character.levels[1], character.skeleton
    skin = [i for i, material in enumerate(character.materials) if material.kind == "skin"]
    own = np.isin(mesh.triangle_part, [PART_INDEX["face"], PART_INDEX["scalp"]])
    bare = own & np.isin(mesh.triangle_material, skin)
    if not bare.any():
        bare = own
    points = mesh.vertices_m - skeleton.rest_m[skeleton.index("head")]
    points[:, 0] = -np.abs(points[:, 0])
    return points[np.unique(mesh.triangles[bare])], points[np.unique(mesh.triangles[own & ~bare])]


def tragus_m(skin: Vector, eye: Vector) -> Vector | None:
    """Return the point (3,) before the opening of the left ear, or None of a head without skin
    there; `eye` (3,) is the left eye's joint, from the head's like `skin` (k, 3).
    """
    ear_level = skin[np.abs(skin[:, 1] - eye[1] + 0.02) < 0.035]
    if len(ear_level) < MIN_POINTS:
        return None
    outward = -ear_level[:, 0]
    outermost = ear_level[outward > np.quantile(outward, 0.985)]
    if not len(outermost):  # a flat side, as of a box
        return None
    y, z = outermost.mean(axis=0)[1:] + TRAGUS_M
    near = skin[np.hypot(skin[:, 1] - y, skin[:, 2] - z) < 0.010]
    x = np.quantile(near[:, 0], 0.3) if len(near) else np.quantile(ear_level[:, 0], 0.05)
    return np.array([x, y, z])


def mouth_corner_m(skin: Vector, eye: Vector, stature_m: float) -> Vector:
    """Return the left corner of the mouth (3,), as `tragus_m` returns the ear."""
    size = stature_m / 1.75
    x, y = -MOUTH_M[0] * size, eye[1] + MOUTH_M[1] * size
    near = skin[np.hypot(skin[:, 0] - x, skin[:, 1] - y) < 0.012]
    z = np.quantile(near[:, 2], 0.1) if len(near) else eye[2]
    return np.array([x, y, z])


def leaning(
    skin: Vector, hair: Vector, ear: Vector, mouth: Vector
) -> tuple[Vector, Vector, Vector]:
    """Return the point (3,) of a telephone's face at the left ear, its length towards that end and
    the way (3,) its face looks, all in the head's axes: it lies on ear and cheek, as near to them
    as it gets without going in, and its other end is before the cheek's side, not its front. Hair
    gives way.
    """
    to_mouth = unit((mouth - ear) * np.array([0.0, 1.0, 1.0]))
    c, s = np.cos(np.radians(BELOW_MOUTH_DEG)), np.sin(np.radians(BELOW_MOUTH_DEG))
    down = np.array([0.0, c * to_mouth[1] + s * to_mouth[2], c * to_mouth[2] - s * to_mouth[1]])
    across = np.array([0.0, -down[2], down[1]])
    along, aside = (skin - ear) @ down - EARPIECE_M, (skin - ear) @ across
    length, width, _ = TELEPHONE_M
    below = (np.abs(along) < length / 2 + 0.004) & (np.abs(aside) < width / 2 + 0.004)
    # The plane that lies on the skin, of all those that lean no more the lowest at the middle.
    out = -np.append(skin[below, 0], ear[0])[:, None, None]
    along, aside = np.append(along[below], -EARPIECE_M), np.append(aside[below], 0.0)
    slopes = LEAN_IN[:, None] * along[:, None, None] + LEAN_DOWN * aside[:, None, None]
    heights = (out + slopes).max(axis=0)
    i, j = np.unravel_index(heights.argmin(), heights.shape)
    inward = unit(np.array([1.0, 0.0, 0.0]) - LEAN_IN[i] * down - LEAN_DOWN[j] * across)
    at_ear = ear.copy()
    hair_m = 0.0
    if len(hair):
        near = np.hypot((hair - ear) @ down, (hair - ear) @ across) < width / 2
        hair_m = max(0.0, float((ear - hair)[near, 0].max(initial=0.0)) - HAIR_GIVES_M)
    off_m = heights[i, j] + LEAN_IN[i] * EARPIECE_M + CLEAR_M + ear[0]
    at_ear[0] -= min(max(off_m, hair_m), MAX_OFF_EAR_M)
    return at_ear, -unit(down - (down @ inward) * inward), inward


def case_in_hand(character: Character, side: str) -> Case:
    """Return the telephone that a hand holds at the ear: its edge lies across the fingers, its
    back on the palm. The right hand holds it as the left one does.
    """
    middle, askew = _case_of_left(character)
    _, fingers, thumb, out = hand_axes(character.skeleton, side)
    axes = np.stack([fingers, thumb, out])
    return Case(middle @ axes, askew @ axes, np.array(TELEPHONE_M) / 2)


def _case_of_left(character: Character) -> tuple[Vector, Vector]:
    """Return middle (3,) and axes (3, 3) of a telephone in the left hand, along `hand_axes`."""
    skeleton, skin = character.skeleton, skin_of_hand(character)
    wrist, *ways = hand_axes(skeleton, "left")
    axes = np.stack(ways)
    joint, end = (
        axes @ (skeleton.rest_m[skeleton.index(f"left_middle_{name}")] - wrist)
        for name in ("middle", "distal")
    )
    angle = np.radians(FROM_FINGERS_DEG)
    c, s = np.cos(angle), np.sin(angle)
    askew = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, 1.0]])
    length, width, thickness = TELEPHONE_M
    middle = joint + BEYOND_JOINT * (end - joint) - np.array([0.5 * width / s, 0.0, 0.0])
    fleshy = [skeleton.index(f"left_{name}") for name in PALM_JOINTS]
    palm = skin.points_m[skin.weights[:, fleshy].sum(axis=1) > 0.8] @ axes.T
    along, across = (palm - middle) @ askew[0], (palm - middle) @ askew[1]
    under = (np.abs(along) < length / 2) & (np.abs(across) < width / 2)
    back_m = palm[under, 2].max() if under.any() else PALM_M
    middle[2] = np.clip(back_m, *PALM_RANGE_M) + HOLLOW_M + thickness / 2
    return middle, askew


def hand_thickness_m(character: Character) -> float:
    """Return how thick the left hand is about its knuckles, palm to back."""
    mesh, skeleton = character.levels[1], character.skeleton
    wrist, fingers, thumb, out = hand_axes(skeleton, "left")
    hand_m = float(np.linalg.norm(skeleton.rest_m[skeleton.index("left_middle_proximal")] - wrist))
    heaviest = np.take_along_axis(mesh.joints, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    fleshy = [skeleton.index(f"left_{name}") for name in PALM_JOINTS]
    points = mesh.vertices_m[np.isin(heaviest, fleshy)] - wrist
    along, aside = points @ fingers, points @ thumb
    at_knuckles = (along > 0.45 * hand_m) & (along < 1.25 * hand_m) & (np.abs(aside) < 0.03)
    if not at_knuckles.any():
        return PALM_M + BACK_M
    off = (points @ out)[at_knuckles]
    palm, back = np.quantile(off, 0.9), -np.quantile(off, 0.02)
    return float(np.clip(palm, *PALM_RANGE_M) + np.clip(back, 0.004, 0.025))


def hand_axes(skeleton: Skeleton, side: str) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the wrist (3,) at rest and the ways (3,) of the fingers, to the thumb and out of the
    palm.
    """
    at, index = skeleton.rest_m, skeleton.index
    hand, middle = at[index(f"{side}_hand")], at[index(f"{side}_middle_proximal")]
    thumb_side = at[index(f"{side}_index_proximal")] - at[index(f"{side}_little_proximal")]
    fingers = unit(middle - hand)
    towards_thumb = unit(thumb_side - (thumb_side @ fingers) * fingers)
    out = np.cross(fingers, towards_thumb)
    out *= -np.sign(out[1])  # palms face the floor at rest
    return hand, fingers, towards_thumb, out


def at_ear_of_head(head_half_m: float, ear_y_m: float, size: float, hand_m: float) -> Vector:
    """Return what `at_ear_of_character` does (9,), of somebody without flesh."""
    middle = np.array([ALONG * hand_m, 0.0, PALM_M + HOLLOW_M + TELEPHONE_M[2] / 2])
    return _hand_at(*_lies_at_head(head_half_m, ear_y_m, size), middle)


def _lies_at_head(head_half_m: float, ear_y_m: float, size: float) -> tuple[Vector, Vector, Vector]:
    """Return what `leaning` does, of a head whose skin is not known."""
    at = np.array([-1.1 * head_half_m, ear_y_m, -0.010 * size])
    length = unit(np.array([-0.28, 0.67, 0.68]))
    inward = np.array([1.0, 0.1, 0.0])
    return at, length, unit(inward - (inward @ length) * length)


def at_ear_of_character(character: Character) -> Vector:
    """Return where a left hand is that holds a telephone at the ear (9,): its wrist and the ways
    of its fingers and palm, in the head's axes.
    """
    skin, hair = head_skin_m(character)
    axes = np.stack(hand_axes(character.skeleton, "left")[1:])
    return _hand_at(*_lies_at_ear(character, skin, hair), _case_of_left(character)[0], axes)


def _lies_at_ear(character: Character, skin: Vector, hair: Vector) -> tuple[Vector, Vector, Vector]:
    """Return what `leaning` does, also of a head without skin at the ear."""
    rest, index = character.skeleton.rest_m, character.skeleton.index
    eye = rest[index("left_eye")] - rest[index("head")]
    ear = tragus_m(skin, eye)
    if ear is None:
        size = character.stature_m / 1.75
        return _lies_at_head(0.078 * size, eye[1] - 0.014 * size, size)
    return leaning(skin, hair, ear, mouth_corner_m(skin, eye, character.stature_m))


def grip_at_ear(character: Character) -> Vector:
    """Return how the fingers of the left hand lie about the telephone at the ear (GRIP_SIZE,), see
    `gripping.grip_of_character`.
    """
    skin, hair = head_skin_m(character)
    room_m = _room_m(skin, *_lies_at_ear(character, skin, hair))
    return grip_of_character(character, case_in_hand(character, "left"), room_m)


def _room_m(skin: Vector, at: Vector, length: Vector, inward: Vector) -> Vector:
    """Return how far fingers may reach beyond the face of a telephone at the left ear, along the
    edge that is before; see `ROOM_ALONG_M`.
    """
    off = skin - at
    along, above = off @ length + EARPIECE_M, off @ inward
    before = -off @ np.cross(inward, length) - TELEPHONE_M[1] / 2
    near = (before > -0.005) & (before < 0.015) & (np.abs(above) < 0.06)
    room_m = np.full(len(ROOM_ALONG_M), MAX_ROOM_M)
    for k, place in enumerate(ROOM_ALONG_M):
        heights = above[near & (np.abs(along - place) < 0.016)]
        if len(heights):
            room_m[k] = np.clip(heights.min() - FINGER_CLEAR_M, 0.0, MAX_ROOM_M)
    return room_m


def _hand_at(
    at: Vector, length: Vector, inward: Vector, middle: Vector, axes: Vector = SQUARE
) -> Vector:
    """Return wrist and ways (9,) of a hand; `middle` is the telephone's along the rows of `axes`,
    which `hand_axes` returns.
    """
    c, s = np.cos(np.radians(FROM_FINGERS_DEG)), np.sin(np.radians(FROM_FINGERS_DEG))
    before = -np.cross(inward, length)
    hand_axes = np.stack([c * length + s * before, s * length - c * before, inward])
    there = at - TELEPHONE_M[2] / 2 * inward - EARPIECE_M * length
    # Hands are turned by their own axes, which knuckles are a little askew to.
    ways = [hand_axes.T @ (axes @ way) for way in (LEFT_X, DOWN)]
    return np.concatenate([there - hand_axes.T @ middle, *ways])
