"""A small glTF figure that tests write themselves: bones, boxes for limbs, leaning eyeballs."""

import io
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image

from visavis.stimuli.motion.skeleton import canonical_skeleton

_MIXAMO = {
    "hips": "Hips",
    "spine": "Spine",
    "chest": "Spine1",
    "upper_chest": "Spine2",
    "neck": "Neck",
    "head": "Head",
}
_LIMBS = {
    "eye": "Eye", "shoulder": "Shoulder", "upper_arm": "Arm", "lower_arm": "ForeArm",
    "hand": "Hand", "upper_leg": "UpLeg", "lower_leg": "Leg", "foot": "Foot", "toes": "ToeBase",
}  # fmt: skip


def bone_names() -> dict[str, str]:
    """Our joints with Mixamo's names; no jaw and no fingers, as in many files."""
    names = dict(_MIXAMO)
    for side in ("left", "right"):
        names |= {f"{side}_{ours}": side.title() + theirs for ours, theirs in _LIMBS.items()}
    return names


PLATE_HALF_M, PLATE_AHEAD_M = 0.1, 0.3


HEAD_HALF_M = 0.12
SKIN_SRGB, SUIT_SRGB, WHITE_SRGB = (205, 150, 120), (40, 60, 120), (235, 232, 228)
REDDISH_SRGB = (225, 130, 120)
_TEMPLES = {"bare": 0, "dark": 1, "reddish": 3}


@dataclass(frozen=True, eq=False)
class Plate:
    """A square before the chest, facing forward, that wears a material of a test.

    `pictures` (h, w, 3 or 4) are textures 0, 1 and so on; coordinates run from the top left, as
    seen, in set `uv_set`; other sets lie upside down. `colours` is one linear RGB.
    """

    material: dict[str, Any]
    pictures: tuple[np.ndarray, ...] = ()
    uv_set: int = 0
    colours: tuple[float, float, float] | None = None
    extensions: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Apart:
    """A surface with a material of its own, in one colour, beside what `worn_as` covers."""

    srgb: tuple[int, int, int]
    rims: bool
    """Rims of glasses before the face; else a bib before the chest."""


def write_glb(
    path: Path,
    *,
    leave_out: Sequence[str] = (),
    with_skin: bool = True,
    eye_yaw_deg: float = 4.0,
    eye_radius_m: float = 0.014,
    arms_down_deg: float = 40.0,
    plate: Plate | None = None,
    head_squares: int = 1,
    worn_as: str | None = None,
    temples: Literal["bare", "dark", "reddish"] = "bare",
    eyes_on_head: bool = False,
    eye_ahead_m: float = 0.0,
    apart: Apart | None = None,
    shapes: Sequence[str] = ("eyeBlinkLeft",),
) -> None:
    """Write a figure that faces +z with its arms half lowered, as most files have it.

    `head_squares` along each edge of the head's box; with `worn_as`, a material of this name whose
    one picture has skin on head and hands, white on eyes and a suit elsewhere covers everything.
    What lies before its ears may be as dark as the suit, as hair is, or redder than the face.
    With `eyes_on_head` the eyeballs are there and their bones are not; `eye_ahead_m` is how far
    they lie before these.
    """
    pattern = canonical_skeleton(1.70)
    if eyes_on_head:
        leave_out = (*leave_out, "left_eye", "right_eye")
    names = {o: t for o, t in bone_names().items() if o not in leave_out}
    at = {name: pattern.rest_m[j].copy() for j, name in enumerate(pattern.names)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        a = np.radians(sign * arms_down_deg)
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])
        for part in ("lower_arm", "hand"):
            pivot = at[f"{side}_upper_arm"]
            at[f"{side}_{part}"] = pivot + turn @ (at[f"{side}_{part}"] - pivot)
    about = np.array([-1.0, 1.0, -1.0])
    at = {name: about * p + [0, 1.0, 0] for name, p in at.items()}
    joints = [name for name in pattern.names if name in names]
    nodes: list[dict[str, object]] = []
    for name in joints:
        j = pattern.index(name)
        parent = pattern.names[pattern.parents[j]] if pattern.parents[j] >= 0 else None
        while parent is not None and parent not in joints:
            p = pattern.parents[pattern.index(parent)]
            parent = pattern.names[p] if p >= 0 else None
        origin = at[parent] if parent else np.zeros(3)
        nodes.append({"name": names[name], "translation": (at[name] - origin).tolist()})
        if parent:
            children = nodes[joints.index(parent)].setdefault("children", [])
            assert isinstance(children, list)
            children.append(len(nodes) - 1)
    drawn = [*joints, "left_eye", "right_eye"] if eyes_on_head else joints
    vertices, triangles, bones = _surface(at, drawn, eye_yaw_deg, eye_radius_m, head_squares)
    eyes = [k for k, name in enumerate(drawn) if name.endswith("_eye")]
    vertices[np.isin(bones, eyes)] += [0.0, 0.0, eye_ahead_m]
    bones = np.where(bones < len(joints), bones, joints.index("head"))
    inverse = np.tile(np.eye(4), (len(joints), 1, 1))
    inverse[:, :3, 3] = [-at[name] for name in joints]
    joint_rows = np.zeros((len(vertices), 4), dtype=np.uint8)
    joint_rows[:, 0] = bones
    weights = np.zeros((len(vertices), 4), dtype=np.float32)
    weights[:, 0] = 1
    blink = np.zeros_like(vertices)
    blink[bones == joints.index("head"), 1] = -0.005
    arrays: list[tuple[np.ndarray, str, int]] = [
        (vertices.astype(np.float32), "VEC3", 5126),
        (joint_rows, "VEC4", 5121),
        (weights, "VEC4", 5126),
        (triangles.astype(np.uint16).reshape(-1, 1), "SCALAR", 5123),
        (inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32), "MAT4", 5126),
        (blink.astype(np.float32), "VEC3", 5126),
    ]
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    primitives: list[dict[str, Any]] = [
        {"attributes": attributes, "indices": 3, "targets": [{"POSITION": 5} for _ in shapes]}
    ]
    pictures: tuple[np.ndarray, ...] = () if plate is None else plate.pictures
    if worn_as is not None:
        column = np.array([2 if n.endswith("_eye") else int(not _is_bare(n)) for n in joints])
        columns = column[bones]
        beside = np.abs(vertices[:, 0]) > HEAD_HALF_M - 1e-6
        level = np.abs(vertices[:, 1] - at["left_eye"][1]) < 0.06
        columns[beside & level & (bones == joints.index("head"))] = _TEMPLES[temples]
        uv = np.stack([(columns + 0.5) / 4, np.full(len(bones), 0.5)], axis=1)
        attributes["TEXCOORD_0"] = len(arrays)
        arrays.append((uv.astype(np.float32), "VEC2", 5126))
        primitives[0]["material"] = 0
        pictures = (np.array([[SKIN_SRGB, SUIT_SRGB, WHITE_SRGB, REDDISH_SRGB]], np.uint8),)
    if apart is not None:
        more, primitive = _apart(apart, at, joints, len(arrays))
        arrays += more
        primitives.append(primitive)
        pictures = (*pictures, np.array([[apart.srgb]], np.uint8))
    if plate is not None:
        more, primitive = _plate(plate, at, joints.index("upper_chest"), len(arrays))
        arrays += more
        primitives.append(primitive)
    binary, views, accessors = b"", [], []
    for i, (array, kind, component) in enumerate(arrays):
        data = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        accessors.append(
            {"bufferView": i, "componentType": component, "count": len(array), "type": kind}
        )
        binary += data + b"\0" * (-len(data) % 4)
    images = []
    for pixels in pictures:
        packed = io.BytesIO()
        Image.fromarray(pixels).save(packed, format="PNG")
        data = packed.getvalue()
        images.append({"bufferView": len(views), "mimeType": "image/png"})
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data + b"\0" * (-len(data) % 4)
    node: dict[str, object] = {"name": "Body_eye", "mesh": 0}
    if with_skin:
        node["skin"] = 0
    nodes.append(node)
    tree: dict[str, object] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": primitives, "extras": {"targetNames": [*shapes]}}],
        "nodes": nodes,
        "scenes": [{"nodes": [0, len(nodes) - 1]}],
    }
    if images:
        tree["images"] = images
        tree["textures"] = [{"source": i} for i in range(len(images))]
    if worn_as is not None:
        look = {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.5}
        tree["materials"] = [{"name": worn_as, "pbrMetallicRoughness": look}]
    if apart is not None:
        look = {"baseColorTexture": {"index": len(pictures) - 1}, "metallicFactor": 0}
        materials = tree["materials"]
        assert isinstance(materials, list)
        materials.append({"name": "Apart", "pbrMetallicRoughness": look})
    if plate is not None:
        tree["materials"] = [plate.material]
        tree["extensionsRequired"] = list(plate.extensions)
    if with_skin:
        tree["skins"] = [{"joints": list(range(len(joints))), "inverseBindMatrices": 4}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def _plate(
    plate: Plate, at: dict[str, np.ndarray], bone: int, first: int
) -> tuple[list[tuple[np.ndarray, str, int]], dict[str, Any]]:
    corners = np.array([[-1.0, 1, 0], [-1, -1, 0], [1, -1, 0], [1, 1, 0]])
    middle = at["upper_chest"] + [0.0, 0.0, PLATE_AHEAD_M]
    joints = np.zeros((4, 4), dtype=np.uint8)
    joints[:, 0] = bone
    uv = np.array([[0.0, 0], [0, 1], [1, 1], [1, 0]])
    columns: dict[str, tuple[np.ndarray, str, int]] = {
        "POSITION": ((PLATE_HALF_M * corners + middle).astype(np.float32), "VEC3", 5126),
        "NORMAL": (np.tile([0.0, 0, 1], (4, 1)).astype(np.float32), "VEC3", 5126),
        "JOINTS_0": (joints, "VEC4", 5121),
        "WEIGHTS_0": (np.tile([1.0, 0, 0, 0], (4, 1)).astype(np.float32), "VEC4", 5126),
    }
    for k in range(plate.uv_set + 1):
        lying = uv if k == plate.uv_set else 1.0 - uv
        columns[f"TEXCOORD_{k}"] = (lying.astype(np.float32), "VEC2", 5126)
    if plate.colours is not None:
        rows = np.tile(plate.colours, (4, 1)).astype(np.float32)
        columns["COLOR_0"] = (rows, "VEC3", 5126)
    order = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16).reshape(-1, 1)
    attributes = {name: first + k for k, name in enumerate(columns)}
    primitive = {"attributes": attributes, "indices": first + len(columns), "material": 0}
    return [*columns.values(), (order, "SCALAR", 5123)], primitive


def _apart(
    apart: Apart, at: dict[str, np.ndarray], joints: list[str], first: int
) -> tuple[list[tuple[np.ndarray, str, int]], dict[str, Any]]:
    around = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    inner, outer = (0.018, 0.020) if apart.rims else (0.001, 0.1)
    strip = np.concatenate([inner * ring, outer * ring])
    i = np.arange(48)
    j = (i + 1) % 48
    faces = np.concatenate([np.stack([i, i + 48, j + 48], 1), np.stack([i, j + 48, j], 1)])
    if apart.rims:
        before = np.array([0, -0.01, at["head"][2] + HEAD_HALF_M + 0.01])
        middles = [before + at[f"{side}_eye"] * [1, 1, 0] for side in ("left", "right")]
    else:
        middles = [at["upper_chest"] + [0, 0, PLATE_AHEAD_M]]
    points = np.concatenate([strip + middle for middle in middles])
    corners = np.concatenate([faces + 96 * k for k in range(len(middles))])
    held = np.zeros((len(points), 4), dtype=np.uint8)
    held[:, 0] = joints.index("head" if apart.rims else "upper_chest")
    columns: dict[str, tuple[np.ndarray, str, int]] = {
        "POSITION": (points.astype(np.float32), "VEC3", 5126),
        "JOINTS_0": (held, "VEC4", 5121),
        "WEIGHTS_0": (np.tile([1.0, 0, 0, 0], (len(points), 1)).astype(np.float32), "VEC4", 5126),
        "TEXCOORD_0": (np.full((len(points), 2), 0.5, np.float32), "VEC2", 5126),
    }
    attributes = {name: first + k for k, name in enumerate(columns)}
    primitive = {"attributes": attributes, "indices": first + len(columns), "material": 1}
    order = corners.astype(np.uint16).reshape(-1, 1)
    return [*columns.values(), (order, "SCALAR", 5123)], primitive


def _is_bare(joint: str) -> bool:
    return joint == "head" or joint.endswith("_hand")


def _surface(
    at: dict[str, np.ndarray],
    joints: list[str],
    eye_yaw_deg: float,
    eye_radius_m: float,
    head_squares: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vertices, triangles, bones = [], [], []
    count = 0
    for j, name in enumerate(joints):
        if name.endswith("_eye"):
            points, faces = _ball(eye_radius_m, eye_yaw_deg)
        else:
            head = name == "head"
            points, faces = _box(HEAD_HALF_M if head else 0.06, head_squares if head else 1)
        vertices.append(points + at[name])
        triangles.append(faces + count)
        bones.append(np.full(len(points), j))
        count += len(points)
    return np.concatenate(vertices), np.concatenate(triangles), np.concatenate(bones)


def _box(half_m: float, squares: int) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half_m
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    if squares == 1:
        return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    along = np.linspace(0.0, 1.0, squares + 1)
    v, u = np.meshgrid(along, along, indexing="ij")
    points, faces = [], []
    i = np.arange((squares + 1) ** 2).reshape(squares + 1, squares + 1)
    square = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    for side, (a, b, c, d) in enumerate(corners[quads]):
        weights = ((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v)
        grid = sum(w[..., None] * p for w, p in zip(weights, (a, b, c, d), strict=True))
        points.append(np.asarray(grid).reshape(-1, 3))
        faces.append(square + side * i.size)
    whole = np.concatenate(faces)
    return np.concatenate(points), np.concatenate([whole[:, [0, 1, 2]], whole[:, [0, 2, 3]]])


def _ball(radius_m: float, yaw_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """A lathed ball whose pole leans from +z by a yaw: what the eye looks along."""
    rings, sectors = 8, 16
    polar = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(sectors) / sectors
    p, a = np.meshgrid(polar, around, indexing="ij")
    shell = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    points = np.concatenate([[[0, 0, 1.0]], shell.reshape(-1, 3), [[0, 0, -1.0]]])
    ring = 1 + np.arange((rings - 1) * sectors).reshape(rings - 1, sectors)
    turn = np.roll(ring, -1, axis=1)
    last = len(points) - 1
    faces = [np.stack([np.zeros(sectors, int), ring[0], turn[0]], axis=1)]
    for k in range(rings - 2):
        faces.append(np.stack([ring[k], ring[k + 1], turn[k + 1]], axis=1))
        faces.append(np.stack([ring[k], turn[k + 1], turn[k]], axis=1))
    faces.append(np.stack([np.full(sectors, last), turn[-1], ring[-1]], axis=1))
    y = np.radians(yaw_deg)
    lean = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    return radius_m * points @ lean.T, np.concatenate(faces)
