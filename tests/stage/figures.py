"""People made of capsules and a plain room, so that drawing is tested without a cast."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import (
    MORPHS,
    Character,
    Eyeball,
    Material,
    Morph,
    SkinnedMesh,
)
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton
from visavis.stimuli.picture import Camera, Light, Picture, PosedPeople, Prop, Room, StaticMesh

LIMBS = (
    ("hips", "spine", 0.15, "pelvis", "cloth", (60, 70, 110)),
    ("spine", "upper_chest", 0.16, "torso", "cloth", (60, 110, 90)),
    ("upper_chest", "neck", 0.14, "torso", "cloth", (60, 110, 90)),
    ("neck", "head", 0.06, "neck", "skin", (222, 178, 152)),
    ("left_upper_arm", "left_lower_arm", 0.05, "left_upper_arm", "cloth", (60, 110, 90)),
    ("left_lower_arm", "left_hand", 0.04, "left_forearm", "skin", (222, 178, 152)),
    ("left_hand", "left_middle_distal", 0.035, "left_hand", "skin", (222, 178, 152)),
    ("right_upper_arm", "right_lower_arm", 0.05, "right_upper_arm", "cloth", (60, 110, 90)),
    ("right_lower_arm", "right_hand", 0.04, "right_forearm", "skin", (222, 178, 152)),
    ("right_hand", "right_middle_distal", 0.035, "right_hand", "skin", (222, 178, 152)),
    ("left_upper_leg", "left_lower_leg", 0.08, "left_thigh", "cloth", (60, 70, 110)),
    ("left_lower_leg", "left_foot", 0.06, "left_shin", "cloth", (60, 70, 110)),
    ("left_foot", "left_toes", 0.045, "left_foot", "leather", (50, 40, 36)),
    ("right_upper_leg", "right_lower_leg", 0.08, "right_thigh", "cloth", (60, 70, 110)),
    ("right_lower_leg", "right_foot", 0.06, "right_shin", "cloth", (60, 70, 110)),
    ("right_foot", "right_toes", 0.045, "right_foot", "leather", (50, 40, 36)),
)
MATERIALS = tuple(Material(k, k, 0.6) for k in ("skin", "eye", "hair", "cloth", "leather"))  # type: ignore[arg-type]
EYE_RADIUS_M = 0.016


def sphere(radius_m: float, rings: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """Return vertices and triangles of a ball about the origin, outside counter-clockwise."""
    u = np.linspace(0, np.pi, rings + 1)
    v = np.linspace(0, 2 * np.pi, 2 * rings + 1)
    theta, phi = np.meshgrid(u, v, indexing="ij")
    points = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    row = 2 * rings + 1
    a = (np.arange(rings)[:, None] * row + np.arange(2 * rings)[None]).ravel()
    triangles = np.concatenate(
        [np.stack([a, a + row, a + row + 1], 1), np.stack([a, a + row + 1, a + 1], 1)]
    )
    return radius_m * points.reshape(-1, 3), triangles.astype(np.int32)


def _figure_mesh(skeleton: Skeleton, rings: int) -> SkinnedMesh:
    rest, index = skeleton.rest_m, skeleton.index
    blobs = [
        (rest[index(a)], rest[index(b)], r, part, kind, colour, index(a), index(b))
        for a, b, r, part, kind, colour in LIMBS
    ]
    head = rest[index("head")]
    skin, at = (222, 178, 152), index("head")
    low, high = head + np.array([0, 0.04, 0]), head + np.array([0, 0.10, 0])
    blobs.append((low, high, 0.075, "face", "skin", skin, at, at))
    low, high = head + np.array([0, 0.09, 0.02]), head + np.array([0, 0.12, 0.02])
    blobs.append((low, high, 0.078, "scalp", "hair", (70, 46, 30), at, at))
    for side in ("left", "right"):
        at = index(f"{side}_eye")
        blobs.append(
            (rest[at], rest[at], EYE_RADIUS_M, f"{side}_eye", "eye", (90, 120, 150), at, at)
        )
    vertices, normals, colours, joints, triangles, tags, materials = [], [], [], [], [], [], []
    shared = []
    base = 0
    kinds = [m.kind for m in MATERIALS]
    for start, end, radius, part, kind, colour, joint, next_joint in blobs:
        ball, faces = sphere(1.0, rings)
        along = end - start
        length = np.linalg.norm(along)
        axis = along / length if length > 0 else np.array([0.0, 1.0, 0.0])
        far = (ball @ axis) > 0
        vertices.append(radius * ball + np.where(far[:, None], end, start))
        normals.append(ball)
        colours.append(np.tile(np.array(colour, np.uint8), (len(ball), 1)))
        row = np.zeros((len(ball), 4), np.uint8)
        row[:, 0], row[:, 1] = joint, next_joint
        joints.append(row)
        shared.append(far & (joint != next_joint))
        triangles.append(faces + base)
        tags.append(np.full(len(faces), PART_INDEX[part]))
        materials.append(np.full(len(faces), kinds.index(kind)))
        base += len(ball)
    n = base
    weights = np.zeros((n, 4), np.float32)
    half = np.concatenate(shared)
    weights[:, 0], weights[:, 1] = np.where(half, 0.5, 1.0), np.where(half, 0.5, 0.0)
    joint_rows = np.concatenate(joints)
    face = np.flatnonzero(joint_rows[:, 0] == index("head")).astype(np.int32)
    smile = Morph(face, np.tile(np.array([0, 0.02, 0], np.float32), (len(face), 1)))
    return SkinnedMesh(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(colours),
        None,
        joint_rows,
        weights,
        np.concatenate(triangles),
        np.concatenate(tags).astype(np.uint8),
        np.concatenate(materials).astype(np.uint8),
        {"smile": smile},
    )


@lru_cache(maxsize=16)
def figure(height_m: float = 1.75) -> Character:
    """Return a person of capsules with three levels of detail."""
    skeleton = canonical_skeleton(height_m)
    return Character(
        name=f"figure_{height_m}",
        gender="female",
        stature_m=height_m,
        age_years=None,
        skeleton=skeleton,
        levels=tuple(_figure_mesh(skeleton, rings) for rings in (16, 10, 6)),
        measuring=tuple(_figure_mesh(skeleton, rings) for rings in (10, 6)),
        materials=MATERIALS,
        capsules=(),
        eyeball=Eyeball(EYE_RADIUS_M, 0.0075, 0.003, (90, 120, 150)),
        source="drawn for the tests",
        licence="MIT",
    )


def standing(cast: tuple[Character, ...], places_m: npt.ArrayLike) -> PosedPeople:
    """Return everyone upright at these places (n, 3) on the floor, arms down, facing +z."""
    n = len(cast)
    turns = np.zeros((n, 55, 4))
    turns[..., 0] = 1
    half = np.radians(75) / 2
    roots = np.array(places_m, np.float64).reshape(n, 3).copy()
    for i, character in enumerate(cast):
        turns[i, 0] = quat_from_yaw_pitch_deg(180.0)
        index = character.skeleton.index
        turns[i, index("left_upper_arm")] = (np.cos(half), 0, 0, np.sin(half))
        turns[i, index("right_upper_arm")] = (np.cos(half), 0, 0, -np.sin(half))
        roots[i, 1] += character.skeleton.leg_m + 0.039 * character.stature_m + 0.02
    return PosedPeople(roots, turns, np.zeros((n, len(MORPHS))))


def plane(
    name: str,
    corner: npt.ArrayLike,
    u: npt.ArrayLike,
    v: npt.ArrayLike,
    colour: tuple[int, int, int],
) -> Prop:
    """Return a rectangle spanned by u and v; it faces along u x v."""
    c, a, b = (np.asarray(x, np.float32) for x in (corner, u, v))
    vertices = np.stack([c, c + a, c + a + b, c + b])
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    mesh = StaticMesh(
        vertices,
        np.tile(normal, (4, 1)).astype(np.float32),
        np.tile(np.array(colour, np.uint8), (4, 1)),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    return Prop(name, mesh, Material(name, "other", 0.9), casts_shadow=False)


@lru_cache(maxsize=1)
def plain_room() -> Room:
    """Return a floor and two walls under one shadow-casting spot and a soft fill."""
    return Room(
        "plain",
        (
            plane("floor", (-4, 0, -6), (0, 0, 8), (8, 0, 0), (150, 146, 140)),
            plane("back", (-4, 0, -6), (8, 0, 0), (0, 3, 0), (196, 194, 188)),
            plane("side", (-4, 0, 2), (0, 0, -8), (0, 3, 0), (176, 184, 188)),
        ),
        (
            Light("spot", np.array([6.0, 5.8, 5.4]), np.array([1.2, 3.4, 1.5]),
                  np.array([-0.3, -0.75, -1.0]), 55.0, casts_shadow=True),
            Light("point", np.array([0.8, 0.85, 1.0]), np.array([-2.0, 2.4, 1.0])),
        ),
        np.array([0.34, 0.35, 0.37]),
        np.array([0.18, 0.16, 0.14]),
        (20, 20, 22),
    )  # fmt: skip


def camera(
    place_m: npt.ArrayLike = (0.0, 1.5, 1.0),
    yaw_deg: float = 0.0,
    pitch_deg: float = 0.0,
    half_deg: float = 35.0,
    aspect: float = 4 / 3,
) -> Camera:
    """Return a symmetric camera; `half_deg` is from the middle to the upper edge."""
    top = float(np.tan(np.radians(half_deg)))
    pose = Pose(np.asarray(place_m, np.float64), quat_from_yaw_pitch_deg(yaw_deg, pitch_deg))
    return Camera(pose, -top * aspect, top * aspect, -top, top)


def rays(camera: Camera, size_px: tuple[int, int]) -> tuple[Vector, Vector]:
    """Return where the rays (n, 3) of a camera's pixels begin and where they go, top row first."""
    width, height = size_px
    x = camera.left + (np.arange(width) + 0.5) / width * (camera.right - camera.left)
    y = camera.top - (np.arange(height) + 0.5) / height * (camera.top - camera.bottom)
    own = np.stack([*np.meshgrid(x, y), -np.ones((height, width))], axis=-1).reshape(-1, 3)
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    world = rotate(camera.pose.orientation_wxyz, own)
    return np.repeat(camera.pose.position_m[None], len(world), axis=0), world


def picture(n: int = 3) -> Picture:
    """Return n people in a row in the plain room."""
    cast = tuple(figure(1.6 + 0.05 * (i % 5)) for i in range(n))
    places = [(0.8 * (i % 8) - 0.4 * (min(n, 8) - 1), 0.0, -1.5 - 0.9 * (i // 8)) for i in range(n)]
    return Picture(0, plain_room(), cast, standing(cast, places))
