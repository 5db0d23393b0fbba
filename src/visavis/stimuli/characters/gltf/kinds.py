"""Classify each surface of an imported figure: skin, eye, hair, cloth and so on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import MaterialKind
from visavis.stimuli.characters.gltf.figure import Figure, Surface
from visavis.stimuli.characters.gltf.file import GltfFile
from visavis.stimuli.characters.gltf.looks import Looks
from visavis.stimuli.characters.gltf.skin import (
    MIN_FACE_TRIANGLES,
    darker_than_the_face,
    like_the_face,
    look_of_face,
)
from visavis.stimuli.characters.rest_pose import Rig
from visavis.stimuli.characters.tagging import parts_of_weights

MIN_FACE_AREA = 0.8
"""Least area of cheeks and nose, in squared distances between the eyes; glasses have less."""
MIN_BARE_SHARE = 0.05
"""For a surface without a face: share from which parts that look like the face count as skin."""


def _on_eyes(figure: Figure, surface: Surface) -> Vector:
    """Return how much of each vertex (v,) hangs on an eye bone; a figure without gaze has none."""
    eyes = [figure.bone_of.get(f"{side}_eye", -1) for side in ("left", "right")]
    share: Vector = (surface.weights * np.isin(surface.joints, eyes)).sum(axis=1)
    return share


def eyes_apart(figure: Figure, surface: Surface) -> list[Surface]:
    """Part a surface into what turns with the eyes and the rest."""
    on_eyes = (_on_eyes(figure, surface) > 0.9)[surface.triangles].all(axis=1)
    if on_eyes.all() or not on_eyes.any():
        return [surface]
    return [replace(surface, triangles=surface.triangles[some]) for some in (on_eyes, ~on_eyes)]


_KINDS_BY_WORD: tuple[tuple[str, MaterialKind], ...] = (
    ("lash", "lash"), ("brow", "lash"), ("wig", "hair"), ("hair", "hair"), ("beard", "hair"),
    ("teeth", "teeth"), ("tongue", "teeth"), ("gland", "skin"), ("shoe", "leather"),
    ("boot", "leather"), ("footwear", "leather"), ("leather", "leather"), ("cloth", "cloth"),
    ("shirt", "cloth"), ("outfit", "cloth"), ("jacket", "cloth"), ("suit", "cloth"),
    ("pants", "cloth"), ("trouser", "cloth"), ("jeans", "cloth"), ("dress", "cloth"),
    ("skirt", "cloth"), ("skin", "skin"), ("head", "skin"), ("face", "skin"),
)  # fmt: skip
"""Kinds by words in names of nodes and materials, the first that fits. "Body" says nothing: some
files mean the skin by it, others everything that is worn.
"""


def _kind(file: GltfFile, figure: Figure, surface: Surface) -> MaterialKind | None:
    """Return the kind of a surface by what its material says or by names; None when neither does.

    Materials that Visavis exported say their kind, and Blender passes that on.
    """
    label = surface.name.lower()
    if surface.material is not None:
        extras = file.items("materials")[surface.material].get("extras") or {}
        if extras.get("kind") in get_args(MaterialKind) and (
            extras["kind"] != "eye" or "left_eye" in figure.bone_of
        ):
            kind: MaterialKind = extras["kind"]
            return kind
        label += " " + str(file.items("materials")[surface.material].get("name", "")).lower()
    corners = np.unique(surface.triangles)
    is_accessory = any(word in label for word in ("lash", "brow", "gland"))
    if not is_accessory and _on_eyes(figure, surface)[corners].mean() > 0.5:
        return "eye"
    return next((kind for word, kind in _KINDS_BY_WORD if word in label), None)


@dataclass(frozen=True, eq=False)
class _Lying:
    """Where a surface's triangles (t,) lie: from between the eyes, in distances between these."""

    middle: Vector
    head: npt.NDArray[np.bool_]
    front: npt.NDArray[np.bool_]
    """Cheeks and nose: no brows, no hair, no lips."""
    front_area: float


def _lying(figure: Figure, rig: Rig, surface: Surface) -> _Lying:
    weights = canonical_weights(figure, rig, surface)
    tags = parts_of_weights(weights, surface.triangles, rig.skeleton.names)
    head = np.isin(tags, [PART_INDEX["scalp"], PART_INDEX["face"]])
    eyes = [
        figure.at_m[figure.bone_of[eye]]
        if eye in figure.bone_of
        else rig.at_m[rig.skeleton.index(eye)]
        for eye in ("left_eye", "right_eye")
    ]
    corners = (surface.vertices_m[surface.triangles] - np.mean(eyes, axis=0)) / np.linalg.norm(
        eyes[0] - eyes[1]
    )
    middle = corners.mean(axis=1)
    front = (
        head
        & (np.abs(middle[:, 0]) < 1.1)
        & (middle[:, 1] < -0.25)
        & (middle[:, 1] > -0.8)
        & (middle[:, 2] < 0.6)
    )
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across[front], axis=1).sum() / 2
    return _Lying(middle, head, front, float(area))


def _has_face(lying: _Lying) -> bool:
    return lying.front.sum() >= MIN_FACE_TRIANGLES and lying.front_area > MIN_FACE_AREA


def face_look(
    file: GltfFile, figure: Figure, rig: Rig, surfaces: Sequence[Surface], looks: Looks
) -> Vector | None:
    """Return how the face of a figure looks (`skin.look_of_face`); None without a picture."""
    for surface in surfaces:
        base = _base_texture(file, surface)
        if base is None or surface.uv is None or _kind(file, figure, surface) not in (None, "skin"):
            continue
        lying = _lying(figure, rig, surface)
        if _has_face(lying):
            return look_of_face(looks.pixels(base), surface.uv, surface.triangles, lying.front)
    return None


def _base_texture(file: GltfFile, surface: Surface) -> int | None:
    if surface.material is None:
        return None
    look = file.items("materials")[surface.material].get("pbrMetallicRoughness", {})
    texture = look.get("baseColorTexture")
    return None if texture is None else int(texture["index"])


def pieces_by_kind(
    file: GltfFile,
    figure: Figure,
    rig: Rig,
    surface: Surface,
    looks: Looks,
    face: Vector | None,
) -> list[tuple[Surface, MaterialKind, bool]]:
    """Split a surface by kind; return also whether its one material covers more than one kind.

    `face` is how the figure's face looks.
    """
    kind = _kind(file, figure, surface)
    if kind is not None:
        return [(surface, kind, False)]
    base = _base_texture(file, surface)
    if base is None or surface.uv is None or face is None:
        return [(surface, "other", False)]
    pixels = looks.pixels(base)
    like_face = like_the_face(pixels, surface.uv, surface.triangles, face)
    lying = _lying(figure, rig, surface)
    none = np.zeros(len(like_face), dtype=bool)
    if _has_face(lying):
        # Short hair is part of the head in many files; what else is unlike the face there are lips.
        over = (lying.middle[:, 1] > 0.5) | (lying.middle[:, 2] > 1.2)
        temples = (np.abs(lying.middle[:, 0]) > 0.95) & (lying.middle[:, 1] > -0.3)
        temples &= darker_than_the_face(pixels, surface.uv, surface.triangles, face)
        hair = lying.head & ~like_face & (over | temples)
        skin = (like_face | lying.head) & ~hair
    elif like_face.mean() > MIN_BARE_SHARE:
        hair, skin = none, like_face
    else:
        return [(surface, "other", False)]
    kinds: tuple[tuple[npt.NDArray[np.bool_], MaterialKind], ...] = (
        (skin, "skin"),
        (hair, "hair"),
        (~skin & ~hair, "cloth"),
    )
    is_shared = not skin.all()
    return [
        (replace(surface, triangles=surface.triangles[some]), kind, is_shared)
        for some, kind in kinds
        if some.any()
    ]


def canonical_weights(figure: Figure, rig: Rig, surface: Surface) -> Vector:
    """Return weights (v, 55): bones without a name of ours count for the next one above."""
    ours = {node: rig.skeleton.index(name) for name, node in figure.bone_of.items()}
    column = np.zeros(len(figure.names), dtype=np.int64)
    for node in range(len(figure.names)):
        at = node
        while at >= 0 and at not in ours:
            at = int(figure.parents[at])
        column[node] = ours.get(at, 0)
    weights = np.zeros((len(surface.vertices_m), len(rig.skeleton.names)))
    rows = np.arange(len(weights))
    for k in range(surface.joints.shape[1]):
        np.add.at(weights, (rows, column[surface.joints[:, k]]), surface.weights[:, k])
    return weights
