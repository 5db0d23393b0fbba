"""The skinned figure in a glTF file: bones in world, bound surfaces, shapes of the face."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, rotate, unit
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.file import GltfFile
from visavis.stimuli.characters.gltf.looks import coordinates_of
from visavis.stimuli.characters.gltf.vrm_presets import PRESET, preset_amounts
from visavis.stimuli.motion.errors import MotionError, UnknownJointsError
from visavis.stimuli.motion.joint_names import CANONICAL_NAMES, match_joints
from visavis.stimuli.motion.rotations import matrix_of_quat, quat_from_axes
from visavis.stimuli.motion.skeleton import Skeleton

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """A primitive as bound: vertices in world, `joints` (v, k) nodes with `weights` (v, k).

    `uv` is what its material reads; `colour` (v, 3) is linear; `node` is whose mesh it is of.
    """

    name: str
    vertices_m: Vector
    normals: Vector
    uv: Vector | None
    triangles: Indices
    joints: Indices
    weights: Vector
    material: int | None
    shapes: dict[str, Vector]
    colour: Vector | None = None
    node: int = 0


@dataclass(frozen=True, eq=False)
class Figure:
    """Bones by node: names, parents, places in world as bound, and all surfaces.

    Turned so that it stands upright and faces −z. `bone_of` gives the node of each canonical
    joint that the file has.
    """

    names: tuple[str, ...]
    parents: Indices
    at_m: Vector
    bone_of: dict[str, int]
    surfaces: tuple[Surface, ...]


def read_figure(file: GltfFile, joint_map: Mapping[str, str] | None = None) -> Figure:
    """Return the figure of a file; `joint_map` gives its bones for joints of ours, where their
    names do not tell.

    Raises:
        CharacterError: no skin, or a needed bone is missing.
    """
    nodes = file.items("nodes")
    skins = file.items("skins")
    n = len(nodes)
    if not skins:
        raise CharacterError(
            f"{file.path}: has no skin, so its limbs cannot move; export mesh and armature together"
        )
    parents, place = places_of_nodes(file)
    bound = _bone_places(file, place)
    surfaces = []
    for i, node in enumerate(nodes):
        if "mesh" not in node:
            continue
        if "skin" in node:
            joints, moves = _skin(file, skins[node["skin"]], bound)
        else:
            # A hat, glasses, an eyeball that hangs on one bone as it is.
            above = int(parents[i])
            while above >= 0 and above not in bound:
                above = int(parents[above])
            if above < 0:
                continue
            joints = np.array([above])
            moves = (bound[above] @ np.linalg.inv(place(above)) @ place(i))[None]
        surfaces += surfaces_of(file, node, joints, moves, i)
    if not surfaces:
        raise CharacterError(
            f"{file.path}: has bones, but no mesh hangs on them, as where motion was saved alone; "
            "export mesh and armature together"
        )
    if not all(np.isfinite(surface.vertices_m).all() for surface in surfaces):
        raise CharacterError(f"{file.path}: some of its points are not numbers; export it again")
    bones = sorted(bound)
    at = np.full((n, 3), np.nan)
    for i in bones:
        at[i] = bound[i][:3, 3]
    names = tuple(str(node.get("name", f"node{i}")) for i, node in enumerate(nodes))
    joint_names = _vrm_joints(file, names) | dict(joint_map or {})
    bone_of = _match_nodes(file, names, parents, bones, joint_names)
    return _upright(Figure(names, parents, at, bone_of, tuple(surfaces)))


def places_of_nodes(file: GltfFile) -> tuple[Indices, Callable[[int], Vector]]:
    """Return the parents (n,) of nodes, -1 for none, and what places (4, 4) a node in world."""
    nodes = file.items("nodes")
    parents = np.full(len(nodes), -1, dtype=np.int64)
    for i, node in enumerate(nodes):
        parents[node.get("children", [])] = i
    world: dict[int, Vector] = {}

    def place(i: int) -> Vector:
        if i not in world:
            above = place(int(parents[i])) if parents[i] >= 0 else np.eye(4)
            world[i] = above @ _local(nodes[i])
        return world[i]

    return parents, place


def _local(node: Mapping[str, Any]) -> Vector:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    matrix[:3, :3] = matrix_of_quat(unit(np.array([w, x, y, z])))
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    return matrix


def _bone_places(file: GltfFile, place: Callable[[int], Vector]) -> dict[int, Vector]:
    """Return the places (4, 4) of bones as the meshes were bound to them."""
    bound: dict[int, Vector] = {}
    for skin in file.items("skins"):
        joints = skin["joints"]
        if "inverseBindMatrices" in skin:
            raw = file.accessor(skin["inverseBindMatrices"]).astype(np.float64)
            inverse = raw.reshape(-1, 4, 4).transpose(0, 2, 1)
        else:
            inverse = np.stack([np.linalg.inv(place(j)) for j in joints])
        # Meshes may be bound in a space of their own (centimetres, another up); one joint's world
        # place against its bind place tells how that space lies in the world.
        space = place(joints[0]) @ inverse[0]
        for j, matrix in zip(joints, inverse, strict=True):
            bound.setdefault(j, space @ np.linalg.inv(matrix))
    return bound


def _skin(
    file: GltfFile, skin: Mapping[str, Any], bound: dict[int, Vector]
) -> tuple[Indices, Vector]:
    """Return the bones (n,) of a skin and what brings its mesh to where each holds it (n, 4, 4)."""
    joints = skin["joints"]
    if "inverseBindMatrices" in skin:
        raw = file.accessor(skin["inverseBindMatrices"]).astype(np.float64)
        inverse = raw.reshape(-1, 4, 4).transpose(0, 2, 1)
    else:
        inverse = np.stack([np.linalg.inv(bound[j]) for j in joints])
    moves = [bound[j] @ matrix for j, matrix in zip(joints, inverse, strict=True)]
    return np.array(joints), np.stack(moves)


def _weights(file: GltfFile, attributes: Mapping[str, int], count: int) -> tuple[Indices, Vector]:
    """Return bones of a skin and their weights (v, k) of every set; all on the first without."""
    sets = [k for k in range(len(attributes)) if f"JOINTS_{k}" in attributes]
    if not sets:
        return np.zeros((count, 1), np.int64), np.ones((count, 1))
    joints = np.hstack([file.accessor(attributes[f"JOINTS_{k}"]) for k in sets]).astype(np.int64)
    weights = np.hstack([file.accessor(attributes[f"WEIGHTS_{k}"]) for k in sets])
    weights = weights.astype(np.float64)
    total = weights.sum(axis=1, keepdims=True)
    weights = weights / np.where(total == 0, 1, total)
    weights[total[:, 0] == 0, 0] = 1.0
    return joints, weights


def surfaces_of(
    file: GltfFile, node: Mapping[str, Any], joints_of: Indices, moves: Vector, index: int
) -> list[Surface]:
    """Return the triangles of the mesh of a node, of number `index`, as `moves` (k, 4, 4) of its
    joints bring them to world.
    """
    mesh = file.tree["meshes"][node["mesh"]]
    shape_names = (mesh.get("extras") or {}).get("targetNames", [])
    morph_weights = node.get(
        "weights", mesh.get("weights", [])
    )  # how far each shape is moved at rest
    presets = preset_amounts(file, index)
    surfaces = []
    for primitive in mesh["primitives"]:
        attributes = primitive["attributes"]
        if primitive.get("mode", 4) != 4 or ("skin" in node and "JOINTS_0" not in attributes):
            continue
        position = file.accessor(attributes["POSITION"]).astype(np.float64)
        joints, weights = _weights(file, attributes, len(position))
        move = np.einsum("vk,vkab->vab", weights, moves[joints])
        turn = move[:, :3, :3]
        targets = primitive.get("targets", [])
        for target, amount in zip(targets, morph_weights, strict=False):
            if amount and "POSITION" in target:
                position += float(amount) * file.accessor(target["POSITION"])
        vertices = np.einsum("vab,vb->va", turn, position) + move[:, :3, 3]
        if "indices" in primitive:
            triangles = file.accessor(primitive["indices"]).astype(np.int64).reshape(-1, 3)
        else:
            triangles = np.arange(len(position)).reshape(-1, 3)
        if "NORMAL" in attributes:
            normals = file.accessor(attributes["NORMAL"]).astype(np.float64)
            normals = np.nan_to_num(unit(np.einsum("vab,vb->va", turn, normals)))
        else:
            normals = _normals(vertices, triangles)
        coordinates, moved_uv = coordinates_of(file, primitive.get("material"))
        uv = None
        if f"TEXCOORD_{coordinates}" in attributes:
            uv = file.accessor(attributes[f"TEXCOORD_{coordinates}"]).astype(np.float64)
            uv = uv @ moved_uv[:2, :2].T + moved_uv[:2, 2]
        colour = None
        if "COLOR_0" in attributes:
            colour = file.accessor(attributes["COLOR_0"])[:, :3].astype(np.float64)
        shapes, of_target = {}, {}
        for k, target in enumerate(targets):
            if "POSITION" in target:
                delta = file.accessor(target["POSITION"]).astype(np.float64)
                name = str(shape_names[k]) if k < len(shape_names) else f"shape{k}"
                shapes[name] = of_target[k] = np.einsum("vab,vb->va", turn, delta)
        for ours, amounts in presets.items():
            there = [amount * of_target[k] for k, amount in amounts.items() if k in of_target]
            if there:
                shapes[PRESET + ours] = np.sum(there, axis=0)
        name = str(node.get("name") or mesh.get("name") or f"mesh{index}")
        surfaces.append(
            Surface(
                name,
                vertices,
                normals,
                uv,
                triangles,
                joints_of[joints],
                weights,
                primitive.get("material"),
                shapes,
                colour,
                index,
            )
        )
    return surfaces


def _normals(vertices_m: Vector, triangles: Indices) -> Vector:
    """Return the mean normals (v, 3) of the triangles round each vertex."""
    a, b, c = (vertices_m[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices_m)
    for k in range(3):
        np.add.at(normals, triangles[:, k], across)
    means: Vector = np.nan_to_num(unit(normals))
    return means


def _vrm_joints(file: GltfFile, names: tuple[str, ...]) -> dict[str, str]:
    """Return the joint names that a VRM file (0.x or 1.0) assigns to its bones."""
    extensions = file.tree.get("extensions", {})
    bones = extensions.get("VRMC_vrm", {}).get("humanoid", {}).get("humanBones", {})
    bone_entries = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
    node_of_bone = {name: entry["node"] for name, entry in dict(bones).items()}
    node_of_bone |= {entry["bone"]: entry["node"] for entry in bone_entries}
    joint_names = {}
    for theirs, node in node_of_bone.items():
        ours = re.sub(r"(?<!^)([A-Z])", r"_\1", theirs).lower()
        ours = ours.replace("_intermediate", "_middle")
        if "_thumb_" in ours and "leftThumbMetacarpal" in node_of_bone:  # 1.0 begins a bone earlier
            ours = ours.replace("_proximal", "_middle").replace("_metacarpal", "_proximal")
        if ours in CANONICAL_NAMES:
            joint_names[ours] = names[node]
    return joint_names


def _match_nodes(
    file: GltfFile,
    names: tuple[str, ...],
    parents: Indices,
    bones: list[int],
    joint_names: Mapping[str, str],
) -> dict[str, int]:
    """Return the node of each canonical joint that is there.

    Raises:
        CharacterError: a needed bone is missing.
    """
    order = _parents_first(parents, set(bones))
    if len({names[i] for i in order}) != len(order):
        raise CharacterError(f"{file.path}: two bones have the same name; rename one")
    index = {node: k for k, node in enumerate(order)}
    tree = Skeleton(
        tuple(names[i] for i in order),
        np.array([index.get(int(parents[i]), 0) if k else -1 for k, i in enumerate(order)]),
        np.zeros((len(order), 3)),
        np.full((len(order), 3), np.nan),
    )
    try:
        names_by_joint = match_joints(tree, joint_names)
    except UnknownJointsError as e:
        raise CharacterError(
            f"{file.path}: no bone known for {', '.join(e.missing)}; say which they are with "
            f"--joint-map FILE, or add those missing. Its bones are {', '.join(e.names)}"
        ) from e
    except MotionError as e:
        raise CharacterError(f"{file.path}: {e}; mend --joint-map FILE or the file") from e
    by_name = {names[i]: i for i in order}
    node_of_joint = {ours: by_name[theirs] for ours, theirs in names_by_joint.items()}
    return node_of_joint


def _parents_first(parents: Indices, bones: set[int]) -> list[int]:
    depth: dict[int, int] = {}

    def of(i: int) -> int:
        if i not in depth:
            depth[i] = 0 if parents[i] < 0 else 1 + of(int(parents[i]))
        return depth[i]

    return sorted(bones, key=lambda i: (of(i), i))


def _upright(figure: Figure) -> Figure:
    """Turn a figure so that it faces −z with y up, hips over the origin."""
    at = {ours: figure.at_m[node] for ours, node in figure.bone_of.items()}
    hips = (at["left_upper_leg"] + at["right_upper_leg"]) / 2
    up = unit(at["head"] - hips)
    axis = np.zeros(3)
    axis[np.abs(up).argmax()] = np.sign(up[np.abs(up).argmax()])
    across = at["right_upper_leg"] - at["left_upper_leg"]
    right = unit(across - axis * (across @ axis))
    turn = quat_from_axes(right, axis, np.cross(right, axis))
    back = quat_conjugate(turn)

    def rotate_back(points: Vector) -> Vector:
        return rotate(back, points - hips)

    surfaces = tuple(
        replace(
            s,
            vertices_m=rotate_back(s.vertices_m),
            normals=rotate(back, s.normals),
            shapes={name: rotate(back, delta) for name, delta in s.shapes.items()},
        )
        for s in figure.surfaces
    )
    return Figure(figure.names, figure.parents, rotate_back(figure.at_m), figure.bone_of, surfaces)
