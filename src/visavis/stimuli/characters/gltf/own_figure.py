"""Read figures that Visavis itself wrote as glTF: nothing is fitted, pictures lose a little."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import (
    BodyCapsule,
    Eyeball,
    Maps,
    Material,
    Morph,
    SkinnedMesh,
)
from visavis.stimuli.characters.gltf.exporting import FORMAT, GENERATOR, OWN
from visavis.stimuli.characters.gltf.file import GltfFile
from visavis.stimuli.characters.gltf.looks import Pixels, srgb_of
from visavis.stimuli.characters.levels import join_skinned_meshes
from visavis.stimuli.motion.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class OwnFigure:
    """What a file of ours holds: the finest level, its materials, and facts by name."""

    facts: dict[str, Any]
    skeleton: Skeleton
    mesh: SkinnedMesh
    materials: tuple[Material, ...]
    capsules: tuple[BodyCapsule, ...]
    eyeball: Eyeball | None


def read_own_figure(file: GltfFile) -> OwnFigure | None:
    """Return the figure of a file of ours as it was exported; None for anybody else's file.

    What another program wrote again is anybody's, because it may have changed everything.
    """
    asset = file.tree.get("asset", {})
    facts = (asset.get("extras") or {}).get(OWN, {})
    if asset.get("generator") != GENERATOR or facts.get("format") != FORMAT:
        return None
    skin = file.items("skins")[0]
    skeleton = _skeleton(file, skin["joints"], facts["tips_m"])
    pictures: dict[int, Pixels] = {}
    materials = [_material(file, entry, pictures) for entry in file.items("materials")]
    parts = [_mesh(file, number, materials) for number in range(len(file.items("meshes")))]
    ball = facts["eyeball"]
    return OwnFigure(
        facts,
        skeleton,
        join_skinned_meshes(parts),
        tuple(materials),
        tuple(
            BodyCapsule(part, joint, np.array(start), np.array(end), radius)
            for part, joint, start, end, radius in facts["capsules"]
        ),
        None
        if ball is None
        else Eyeball(
            ball["radius_m"],
            ball["iris_radius_m"],
            ball["pupil_radius_m"],
            (ball["iris_srgb"][0], ball["iris_srgb"][1], ball["iris_srgb"][2]),
        ),
    )


def _skeleton(file: GltfFile, joints: list[int], tips_m: list[list[float] | None]) -> Skeleton:
    nodes = file.items("nodes")
    number = {node: j for j, node in enumerate(joints)}
    parents = np.full(len(joints), -1, dtype=np.int64)
    for node, j in number.items():
        for child in nodes[node].get("children", ()):
            parents[number[child]] = j
    offsets = np.array([nodes[node]["translation"] for node in joints], dtype=np.float64)
    offsets[0] = 0.0  # the root's node says how high the hips are above the floor
    tips = np.array([[np.nan] * 3 if tip is None else tip for tip in tips_m], dtype=np.float64)
    return Skeleton(tuple(nodes[node]["name"] for node in joints), parents, offsets, tips)


def _material(file: GltfFile, entry: dict[str, Any], pictures: dict[int, Pixels]) -> Material:
    def picture(slot: dict[str, Any] | None) -> Pixels | None:
        if slot is None:
            return None
        number = int(slot["index"])
        if number not in pictures:
            pictures[number] = file.image(number)
        return pictures[number]

    look, extras = entry["pbrMetallicRoughness"], entry["extras"]
    sheen = entry.get("extensions", {}).get("KHR_materials_sheen", {})
    maps = Maps(
        picture(entry.get("normalTexture")),
        picture(look.get("metallicRoughnessTexture")),
        picture(entry.get("emissiveTexture")),
        picture(sheen.get("sheenColorTexture")),
    )
    has_maps = any(
        p is not None for p in (maps.normal, maps.surface, maps.glow_srgb, maps.sheen_srgb)
    )
    return Material(
        entry["name"],
        extras["kind"],
        extras["roughness_01"],
        picture(look["baseColorTexture"]) if extras["has_picture"] else None,
        entry["doubleSided"],
        maps if has_maps else None,
    )


def _mesh(file: GltfFile, number: int, materials: list[Material]) -> SkinnedMesh:
    mesh = file.items("meshes")[number]
    primitive = mesh["primitives"][0]

    def values(name: str) -> Vector:
        return file.accessor(primitive["attributes"][name])

    vertices = values("POSITION")
    n = len(vertices)
    colour = np.tile([0.875, 0.86, 0.845], (n, 1))
    if "COLOR_0" in primitive["attributes"]:
        colour = srgb_of(values("COLOR_0")[:, :3].astype(np.float64))
    has_uv = "TEXCOORD_0" in primitive["attributes"]
    triangles = file.accessor(primitive["indices"]).astype(np.int32).reshape(-1, 3)
    parts = np.concatenate([np.full(k, part, np.uint8) for part, k in primitive["extras"]["parts"]])
    morphs = {}
    names = (mesh.get("extras") or {}).get("targetNames", [])
    for name, target in zip(names, primitive.get("targets", []), strict=True):
        delta = file.accessor(target["POSITION"])
        moves = np.flatnonzero((delta != 0).any(axis=1))
        morphs[name] = Morph(moves.astype(np.int32), delta[moves].astype(np.float32))
    return SkinnedMesh(
        vertices_m=vertices.astype(np.float32),
        normals=values("NORMAL").astype(np.float32),
        colour_srgb=np.round(255 * colour).astype(np.uint8),
        uv=(values("TEXCOORD_0") if has_uv else np.zeros((n, 2))).astype(np.float32),
        joints=values("JOINTS_0").astype(np.uint8),
        weights=values("WEIGHTS_0").astype(np.float32),
        triangles=triangles,
        triangle_part=parts,
        triangle_material=np.full(len(triangles), primitive["material"], dtype=np.uint8),
        morphs=morphs,
    )
