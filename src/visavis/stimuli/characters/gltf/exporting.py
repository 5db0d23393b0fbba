"""Write characters, at rest or moving, as glTF 2.0 for Blender, Unity and live pages."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import (
    MORPHS,
    Character,
    Maps,
    Material,
    SkinnedMesh,
)
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.eye_picture import eye_picture, eye_uv
from visavis.stimuli.characters.gltf.looks import UNCUT_01, linear_of
from visavis.stimuli.characters.gltf.writing import INDICES, VERTICES, GlbContent
from visavis.stimuli.characters.skin_tone import skin_of_face_01
from visavis.stimuli.motion.clip import Clip, floor_of_rest_m

OWN: Final = "visavis"
"""Under this name `asset.extras` holds what glTF has no place for."""
FORMAT: Final = 1
GENERATOR: Final = "Visavis"
_STILL_RAD: Final = 1e-7
"""Joints that turn less than that keep one key."""


def glb_of_character(
    character: Character, motion: Clip | None = None, *, level: int = 0, name: str = "motion"
) -> bytes:
    """Return a .glb file of a character at one level of detail, with a motion where one is given.

    The figure stands on the floor and faces +z, as glTF has it: its node `NAME` turns our axes by
    180° about y, below it all is as in Visavis (metres, joints unturned in the T-pose, facing −z).
    Shapes of the face are targets with their names in `extras.targetNames`. A loop's first frame
    is also its last; what it travels is in `extras.travel_m` of the animation.

    Raises:
        CharacterError: the character has no such level, or the motion is of another skeleton.
    """
    if not 0 <= level < len(character.levels):
        raise CharacterError(
            f"{character.name} has levels 0 to {len(character.levels) - 1}, not {level}"
        )
    skeleton = character.skeleton
    if motion is not None and motion.skeleton.names != skeleton.names:
        raise CharacterError(
            f"the motion has other joints than {character.name}; retarget it to this character"
        )
    content = GlbContent()
    content.tree["asset"] = {
        "version": "2.0",
        "generator": GENERATOR,
        "copyright": character.licence,
        "extras": {OWN: _own_facts(character)},
    }
    # Joints come first, so that node k + 1 is joint k; the figure's own node turns them all.
    n = len(skeleton.names)
    turned_node = {"name": character.name, "rotation": [0.0, 1.0, 0.0, 0.0], "children": [1]}
    content.add("nodes", turned_node)
    stands_m = np.array([0.0, -floor_of_rest_m(skeleton), 0.0])
    for j, joint in enumerate(skeleton.names):
        children = (np.flatnonzero(skeleton.parents == j) + 1).tolist()
        place_m = skeleton.offsets_m[j] if j else stands_m
        node = {"name": joint, "translation": place_m.tolist()}
        content.add("nodes", {**node, "children": children} if children else node)
    inverse = np.tile(np.eye(4), (n, 1, 1))
    inverse[:, :3, 3] = -skeleton.rest_m
    columns = inverse.transpose(0, 2, 1).reshape(n, 16)
    skin = {"joints": list(range(1, n + 1)), "inverseBindMatrices": content.array(columns, "f4")}
    content.add("skins", {**skin, "skeleton": 1})
    roots = [0]
    mesh = character.levels[level]
    for k, material in enumerate(character.materials):
        triangles = np.flatnonzero(mesh.triangle_material == k)
        if len(triangles):
            number = _add_mesh(content, character, mesh, material, triangles)
            roots.append(content.add("nodes", {"name": material.name, "mesh": number, "skin": 0}))
    content.tree |= {"scenes": [{"nodes": roots}], "scene": 0}
    if motion is not None:
        _add_motion(content, motion, name)
    return content.packed()


def write_glb(path: Path, data: bytes) -> None:
    """Write a file that was put together.

    Raises:
        CharacterError: it cannot be written.
    """
    try:
        path.write_bytes(data)
    except OSError as e:
        raise CharacterError(f"{path}: cannot be written ({e.strerror}); check the folder") from e


def _own_facts(character: Character) -> dict[str, Any]:
    tips = [None if np.isnan(tip).any() else tip.tolist() for tip in character.skeleton.tips_m]
    return {
        "format": FORMAT,
        "name": character.name,
        "gender": character.gender,
        "stature_m": character.stature_m,
        "age_years": character.age_years,
        "tips_m": tips,
        "capsules": [
            [c.part, c.joint, c.start_m.tolist(), c.end_m.tolist(), c.radius_m]
            for c in character.capsules
        ],
        "eyeball": None if character.eyeball is None else asdict(character.eyeball),
        "source": character.source,
        "licence": character.licence,
    }


def _add_mesh(
    content: GlbContent,
    character: Character,
    mesh: SkinnedMesh,
    material: Material,
    triangles: npt.NDArray[np.int64],
) -> int:
    """Add the triangles of one material as a mesh of its own, and return its number."""
    # By part of the body, so that a few runs tell the part of every triangle.
    triangles = triangles[np.argsort(mesh.triangle_part[triangles], kind="stable")]
    corners = mesh.triangles[triangles]
    vertices, index = np.unique(corners, return_inverse=True)
    weights = mesh.weights[vertices]
    joints = np.where(weights > 0, mesh.joints[vertices], 0)
    ball = character.eyeball if material.kind == "eye" else None
    attributes = {
        "POSITION": content.array(
            mesh.vertices_m[vertices], "f4", target=VERTICES, with_bounds=True
        ),
        "NORMAL": content.array(_unit(mesh.normals[vertices]), "f4", target=VERTICES),
        "JOINTS_0": content.array(joints, "u1", target=VERTICES),
        "WEIGHTS_0": content.array(weights, "f4", target=VERTICES),
    }
    if ball is not None:
        on_eyeballs = _from_eye_centres(character, mesh, triangles, vertices) / ball.radius_m
        picture_uv = eye_uv(on_eyeballs)
        attributes["TEXCOORD_0"] = content.array(picture_uv, "f4", target=VERTICES)
    else:
        if mesh.uv is not None and material.texture_srgb is not None:
            attributes["TEXCOORD_0"] = content.array(mesh.uv[vertices], "f4", target=VERTICES)
        light = np.ones((len(vertices), 4))
        light[:, :3] = linear_of(mesh.colour_srgb[vertices] / 255.0)
        attributes["COLOR_0"] = content.array(
            np.round(65535 * light), "u2", target=VERTICES, normalized=True
        )
    indices = content.array(index.ravel(), "u2" if len(vertices) < 65535 else "u4", target=INDICES)
    parts, counts = np.unique(mesh.triangle_part[triangles], return_counts=True)
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": indices,
        "material": _add_material(content, character, material),
        "extras": {"parts": np.column_stack([parts, counts]).tolist()},
    }
    entry: dict[str, Any] = {"name": material.name, "primitives": [primitive]}
    targets = {}
    for shape in MORPHS:
        if shape not in mesh.morphs:
            continue
        morph = mesh.morphs[shape]
        moves = np.isin(morph.vertices, vertices)
        rows = np.searchsorted(vertices, morph.vertices[moves])
        if len(rows):
            targets[shape] = content.displacements(rows, morph.delta_m[moves], len(vertices))
    if targets:
        primitive["targets"] = [{"POSITION": number} for number in targets.values()]
        entry |= {"weights": [0.0] * len(targets), "extras": {"targetNames": list(targets)}}
    return content.add("meshes", entry)


def _unit(normals: npt.NDArray[np.float32]) -> Vector:
    """Return normals of length one; where a mesh has none, up."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Vector = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), [0.0, 1.0, 0.0])
    return unit


def _from_eye_centres(
    character: Character,
    mesh: SkinnedMesh,
    triangles: npt.NDArray[np.int64],
    vertices: npt.NDArray[np.int32],
) -> Vector:
    """Return where vertices (v, 3) lie from the centre of their eye, in metres."""
    skeleton = character.skeleton
    right = triangles[mesh.triangle_part[triangles] == PART_INDEX["right_eye"]]
    is_right = np.isin(vertices, mesh.triangles[right])
    left_m, right_m = (skeleton.rest_m[skeleton.index(f"{s}_eye")] for s in ("left", "right"))
    centre_m = np.where(is_right[:, None], right_m, left_m)
    from_centre_m: Vector = mesh.vertices_m[vertices] - centre_m
    return from_centre_m


def _add_material(content: GlbContent, character: Character, material: Material) -> int:
    maps = Maps() if material.maps is None else material.maps
    look: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": float(material.roughness_01)}
    entry: dict[str, Any] = {
        "name": material.name,
        "doubleSided": material.double_sided,
        "extras": {
            "kind": material.kind,
            "roughness_01": material.roughness_01,
            "has_picture": material.texture_srgb is not None,
        },
    }
    if material.kind == "eye" and character.eyeball is not None:
        picture = eye_picture(character.eyeball, skin_of_face_01(character))
        look["baseColorTexture"] = content.texture(picture)
    elif material.texture_srgb is not None:
        look["baseColorTexture"] = content.texture(material.texture_srgb)
        if material.texture_srgb.shape[2] == 4:
            entry |= {"alphaMode": "MASK", "alphaCutoff": UNCUT_01}
    if maps.normal is not None:
        entry["normalTexture"] = content.texture(maps.normal)
    if maps.surface is not None:
        look |= {"metallicFactor": 1.0, "roughnessFactor": 1.0}
        look["metallicRoughnessTexture"] = content.texture(maps.surface)
        entry["occlusionTexture"] = content.texture(maps.surface)
    if maps.glow_srgb is not None:
        entry |= {
            "emissiveTexture": content.texture(maps.glow_srgb),
            "emissiveFactor": [1.0, 1.0, 1.0],
        }
    if maps.sheen_srgb is not None:
        sheen = {
            "sheenColorFactor": [1.0] * 3,
            "sheenColorTexture": content.texture(maps.sheen_srgb),
        }
        entry["extensions"] = {"KHR_materials_sheen": sheen}
        content.tree["extensionsUsed"] = ["KHR_materials_sheen"]
    return content.add("materials", {**entry, "pbrMetallicRoughness": look})


def _add_motion(content: GlbContent, motion: Clip, name: str) -> None:
    """Add an animation: turns of all joints and places of the hips, key by key."""
    turns, roots_m = motion.orientation_wxyz, motion.root_m
    if motion.is_loop:
        turns = np.concatenate([turns, turns[:1]])
        roots_m = np.concatenate([roots_m, roots_m[:1] + np.array(motion.travel_m)])
    times = content.array(motion.frame_s * np.arange(len(turns)), "f4", with_bounds=True)
    start = content.array(np.zeros(1), "f4", with_bounds=True)
    samplers: list[dict[str, int]] = []
    channels: list[dict[str, Any]] = []
    for j in range(len(motion.skeleton.names)):
        xyzw = turns[:, j, [1, 2, 3, 0]]
        is_still = len(xyzw) == 1 or bool(np.abs(xyzw - xyzw[0]).max() < _STILL_RAD)
        rows = xyzw[:1] if is_still else xyzw
        keys = {"input": start if is_still else times, "output": content.array(rows, "f4")}
        channels.append({"sampler": len(samplers), "target": {"node": j + 1, "path": "rotation"}})
        samplers.append(keys)
    channels.append({"sampler": len(samplers), "target": {"node": 1, "path": "translation"}})
    samplers.append({"input": times, "output": content.array(roots_m, "f4")})
    entry: dict[str, Any] = {"name": name, "samplers": samplers, "channels": channels}
    if motion.is_loop:
        entry["extras"] = {"is_loop": True, "travel_m": list(motion.travel_m)}
    content.add("animations", entry)
