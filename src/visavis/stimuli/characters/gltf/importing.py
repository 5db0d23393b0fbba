"""Import characters from glTF files: their own skeleton, looks and shapes, our names and rest."""

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, rotate, unit
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.capsules import fit_capsules
from visavis.stimuli.characters.character import (
    Character,
    Eyeball,
    Material,
    Morph,
    SkinnedMesh,
)
from visavis.stimuli.characters.closing import closed_surface
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.eyeballs import with_eyeballs
from visavis.stimuli.characters.gltf.eyes import EyeFit, fit_eye
from visavis.stimuli.characters.gltf.figure import Figure, Surface, read_figure
from visavis.stimuli.characters.gltf.file import GltfFile, read_glb
from visavis.stimuli.characters.gltf.islands import with_full_margins
from visavis.stimuli.characters.gltf.kinds import (
    canonical_weights,
    eyes_apart,
    face_look,
    pieces_by_kind,
)
from visavis.stimuli.characters.gltf.looks import Looks, colour_factor, shine_as_roughness, srgb_of
from visavis.stimuli.characters.gltf.own_figure import OwnFigure, read_own_figure
from visavis.stimuli.characters.gltf.vrm_presets import PRESET
from visavis.stimuli.characters.levels import LEVELS, join_skinned_meshes, lighter, thin_mesh
from visavis.stimuli.characters.measuring import MEASURING_TRIANGLES, match_areas
from visavis.stimuli.characters.rest_pose import (
    FINGERS,
    PHALANGES,
    Rig,
    heaviest,
    rig_of_marks,
    to_rest,
)
from visavis.stimuli.characters.tagging import face_of_head, parts_of_weights
from visavis.stimuli.motion.rotations import quat_between
from visavis.stimuli.motion.skeleton import canonical_skeleton

Gender = Literal["female", "male"]
Indices = npt.NDArray[np.int64]
SIDES: Final = ("left", "right")
EYES: Final = ("left_eye", "right_eye")
MIN_MOVE_M: Final = 2e-5
"""Smaller displacements of shapes are rounding, and would only cost memory."""

_FROWNING, _BROWS_DOWN = r"mouth_?frown", r"brow_?down_?(l|r|left|right)?$"
"""Brows alone make no frown: without shapes of the mouth, the smile the other way round does."""
_BOTH_CLOSE = r"^blink$|fcl_eye_close$|(?<![a-z])(?<![lrt]_)eyes?_?(blink|closed?)$"
"""A shape of both lids in one, half of it on either side: both blink together."""
_SHAPES: Final[Mapping[str, tuple[tuple[str, float], ...]]] = {
    "left_blink": (
        (
            r"(?<![a-z])l_?eye_?close|eyeblink_?l(eft)?$|blink_?l(eft)?$|left.?(eye.?)?blink",
            1.0,
        ),
        (r"eye_close_l$|left.?eye.?close", 1.0),
    ),
    "right_blink": (
        (
            r"(?<![a-z])r_?eye_?close|eyeblink_?r(ight)?$|blink_?r(ight)?$|right.?(eye.?)?blink",
            1.0,
        ),
        (r"eye_close_r$|right.?eye.?close", 1.0),
    ),
    "lids_up": ((r"^lids_up$", 1.0), (r"eyelookup", 1.0), (r"[lr]_?eye_?open", 0.5)),
    "lids_down": (
        (r"^lids_down$", 1.0),
        (r"eyelookdown", 1.0),
        (r"(?<![a-z])[lr]_?eye_?close|eyeblink|blink_?[lr]", 0.45),
        (r"eye_close_[lr]$", 0.45),
    ),
    "jaw_open": (
        (r"jaw_?open", 1.0),
        (r"mouth_?open", 1.0),
        (r"mth_a$", 1.0),
        (r"viseme_?aa$|^aa$", 1.0),
    ),
    "smile": (
        (r"mouth_?smile_?(l|r|left|right)$", 0.8),
        (r"mouth_?smile", 0.8),
        (r"smile_?close", 0.8),
        (r"smile", 0.8),
        (r"mth_fun$", 0.8),
        (r"^happy$", 0.8),
    ),
    "frown": (
        (r"^frown$", 1.0),
        (rf"{_FROWNING}|{_BROWS_DOWN}", 0.8),
    ),
}
"""How shapes are called in files, in small letters; the first pattern is taken that any shape fits
that moves something.
"""


def marks_of(
    figure: Figure, points_m: Vector, eyes_m: Mapping[str, Vector]
) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Return joints and tips as `rest_pose.rig_of_marks` needs them.

    Joints without a bone stand where a body of the same height has them; eyes are the fitted
    centres, where there are any. `points_m` are all vertices.
    """
    stature = float(np.ptp(points_m[:, 1]))
    pattern = canonical_skeleton(float(np.clip(stature, 0.5, 2.9)))
    at = {name: figure.at_m[node].copy() for name, node in figure.bone_of.items()}
    for side, centre in eyes_m.items():
        at[f"{side}_eye"] = np.array(centre)
    for j, name in enumerate(pattern.names):
        if name in at:
            continue
        parent = pattern.names[pattern.parents[j]]
        offset = pattern.offsets_m[j]
        if parent.endswith("hand") or "proximal" in parent or "_middle" in parent:
            offset = rotate(_arm_turn(at, name), offset)
        at[name] = at[parent] + offset
    tips: dict[str, Vector] = {}
    for side in ("left", "right"):
        for finger in FINGERS:
            last, before = (at[f"{side}_{finger}_{p}"] for p in (PHALANGES[2], PHALANGES[1]))
            tips[f"{side}_{finger}_distal"] = last + 0.8 * (last - before)
        toes, foot = at[f"{side}_toes"], at[f"{side}_foot"]
        near = points_m[np.linalg.norm((points_m - toes)[:, [0, 2]], axis=1) < 0.12]
        front = near[:, 2].min() if len(near) else toes[2] - 0.05
        ahead = unit((toes - foot) * np.array([1.0, 0.0, 1.0]))
        tips[f"{side}_toes"] = toes + ahead * max(toes[2] - front, 0.02)
        tips[f"{side}_eye"] = at[f"{side}_eye"] + np.array([0.0, 0.0, -0.0125])
    crown = float(points_m[np.abs(points_m[:, 0]) < 0.1][:, 1].max())
    tips["head"] = np.array([at["head"][0], crown, at["head"][2]])
    tips["jaw"] = at["jaw"] + pattern.tips_m[pattern.index("jaw")]
    return at, tips


def _arm_turn(at: Mapping[str, Vector], name: str) -> Vector:
    """Return how the forearm is turned against the T-pose."""
    side = "left" if name.startswith("left") else "right"
    rest = np.array([-1.0 if side == "left" else 1.0, 0.0, 0.0])
    return quat_between(rest, unit(at[f"{side}_hand"] - at[f"{side}_lower_arm"]))


def import_gltf(
    path: Path,
    *,
    name: str | None = None,
    gender: Gender | None = None,
    joint_map: Mapping[str, str] | None = None,
    gaze: bool = True,
) -> Character:
    """Return the character in a .glb file, in the T-pose, with levels, parts and capsules.

    What `visavis export character` wrote comes back as it was, under the name in the file; all
    else is fitted. `gender` is read from a name such as Asian_F_2 when None; `joint_map` gives the
    file's bones for joints of ours that their names do not tell. Without `gaze` eyes are part of
    the head, as painted or modelled; such a figure needs no gender.

    Raises:
        CharacterError: the file is broken, or lacks a skin, a needed bone, or, with `gaze`, eyes.
    """
    file = read_glb(path)
    try:
        own = read_own_figure(file)
        if own is not None and (gaze or own.eyeball is None):
            return _own_character(own, name, gender)
        gender = gender or _gender(path, is_needed=gaze)
        return _import_figure(file, name or path.stem, gender, joint_map, gaze=gaze)
    except (KeyError, IndexError, TypeError) as e:
        raise CharacterError(
            f"{path}: refers to something that is not in it ({e!r}); export it again"
        ) from e
    except (ValueError, ArithmeticError, AttributeError, RecursionError, MemoryError) as e:
        raise CharacterError(
            f"{path}: its numbers contradict each other ({e or type(e).__name__}); export it again"
        ) from e


def _own_character(own: OwnFigure, name: str | None, gender: Gender | None) -> Character:
    facts = own.facts
    levels, measuring = _lighter_copies(own.mesh)
    return Character(
        name=name or facts["name"],
        gender=gender or facts["gender"],
        stature_m=facts["stature_m"],
        age_years=facts["age_years"],
        skeleton=own.skeleton,
        levels=levels,
        measuring=measuring,
        materials=own.materials,
        capsules=own.capsules,
        eyeball=own.eyeball,
        source=facts["source"],
        licence=facts["licence"],
        closed=closed_surface(own.mesh, own.skeleton),
    )


def _lighter_copies(
    mesh: SkinnedMesh,
) -> tuple[tuple[SkinnedMesh, ...], tuple[SkinnedMesh, ...]]:
    """Return the levels of detail of a mesh, and the copies that body parts are measured on."""
    first = lighter(mesh, LEVELS[0])
    # Copies for measuring are fitted to the finest level, because that is what people see.
    levels = (first, *(lighter(mesh, budget) for budget in LEVELS[1:]))
    return levels, tuple(match_areas(thin_mesh(mesh, n), first) for n in MEASURING_TRIANGLES)


def _gender(path: Path, *, is_needed: bool) -> Gender | None:
    words = re.split(r"[^a-z]+", path.stem.lower())
    female, male = {"f", "female", "woman", "girl"}, {"m", "male", "man", "boy"}
    if female & set(words):
        return "female"
    if male & set(words):
        return "male"
    if not is_needed:
        return None
    raise CharacterError(
        f"{path}: its name does not say whether it is a woman or a man; pass --gender"
    )


def _import_figure(
    file: GltfFile,
    name: str,
    gender: Gender | None,
    joint_map: Mapping[str, str] | None,
    *,
    gaze: bool,
) -> Character:
    shine_as_roughness(file)
    figure = read_figure(file, joint_map)
    eyes: dict[str, EyeFit] = {}
    if gaze:
        figure = with_eyeballs(file, figure)
        eyes = {side: fit_eye(file, figure, side) for side in SIDES}
    else:
        bones = {ours: node for ours, node in figure.bone_of.items() if ours not in EYES}
        figure = replace(figure, bone_of=bones)
    points = np.concatenate([s.vertices_m for s in figure.surfaces])
    at, tips = marks_of(figure, points, {side: eye.centre_m for side, eye in eyes.items()})
    rig = rig_of_marks(at, tips, float(points[:, 1].min()))
    materials: list[Material] = []
    keys: dict[tuple[int | None, str], int] = {}
    parts = []
    looks = Looks(file)
    # One surface of a file may hold eyes, skin, hair and clothes; each piece gets its own material.
    split_surfaces = [part for whole in figure.surfaces for part in eyes_apart(figure, whole)]
    moving = _moving_shapes(split_surfaces)
    face = face_look(file, figure, rig, split_surfaces, looks)
    for surface, kind, is_shared in [
        piece
        for part in split_surfaces
        for piece in pieces_by_kind(file, figure, rig, part, looks, face)
    ]:
        key = (surface.material, kind)
        if key not in keys:
            keys[key] = len(materials)
            materials.append(looks.material(surface.material, kind, is_shared=is_shared))
        parts.append(_at_rest(file, figure, rig, surface, kind, keys[key], eyes, moving))
    mesh = join_skinned_meshes(parts)
    levels, measuring = _lighter_copies(mesh)
    stature = float(np.ptp(points[:, 1]))
    body = closed_surface(mesh, rig.skeleton)
    licence = file.tree.get("asset", {}).get("copyright", "")
    return Character(
        name=name,
        gender=gender,
        stature_m=round(stature, 4),
        age_years=None,
        skeleton=rig.skeleton,
        levels=levels,
        measuring=measuring,
        materials=with_full_margins(materials, mesh),
        capsules=fit_capsules(rig.skeleton, body),
        eyeball=_eyeball(tuple(eyes.values())) if eyes else None,
        source=f"imported from {file.path.name}",
        licence=licence or "see the source of the file",
        closed=body,
    )


def _eyeball(eyes: Sequence[EyeFit]) -> Eyeball:
    """Return the ball of both eyes, which is that of neither where they differ."""
    radius = float(np.mean([eye.radius_m for eye in eyes]))
    iris = np.mean([eye.iris_srgb for eye in eyes], axis=0)
    return Eyeball(
        radius,
        round(0.38 * radius, 5),
        round(0.14 * radius, 5),
        (int(iris[0]), int(iris[1]), int(iris[2])),
    )


def _at_rest(
    file: GltfFile,
    figure: Figure,
    rig: Rig,
    surface: Surface,
    kind: str,
    material: int,
    eyes: dict[str, EyeFit],
    moving: Set[str],
) -> SkinnedMesh:
    weights = canonical_weights(figure, rig, surface)
    vertices, normals = surface.vertices_m, surface.normals
    # Eyes look straight ahead at rest, wherever the file had them look.
    if kind == "eye":
        vertices, normals = vertices.copy(), normals.copy()
        for side, eye in eyes.items():
            mine = weights[:, rig.skeleton.index(f"{side}_eye")] > 0.5
            turn = quat_between(eye.axis, np.array([0.0, 0.0, -1.0]))
            vertices[mine] = eye.centre_m + rotate(turn, vertices[mine] - eye.centre_m)
            normals[mine] = rotate(turn, normals[mine])
    joints, heavy = heaviest(weights)
    rest, blend = to_rest(rig, vertices, joints, heavy)
    # Directions go to rest by the inverse of the blended bone matrices, as points do.
    rest_normals = np.linalg.solve(blend, normals[..., None])[..., 0].astype(np.float64)
    rest_normals = np.nan_to_num(unit(rest_normals))
    tags = parts_of_weights(weights, surface.triangles, rig.skeleton.names)
    eye_m = rig.at_m[[rig.skeleton.index(eye) for eye in EYES]].mean(axis=0)
    centres = vertices[surface.triangles].mean(axis=1)
    scale = float(np.ptp(figure.at_m[np.isfinite(figure.at_m).all(axis=1), 1])) / 1.65
    tags = face_of_head(tags, centres, eye_m, scale)
    if kind == "hair":
        tags = np.full(len(tags), PART_INDEX["scalp"])
    if kind == "eye":
        left = surface.vertices_m[surface.triangles].mean(axis=1)[:, 0] < 0
        tags = np.where(left, PART_INDEX["left_eye"], PART_INDEX["right_eye"])
    n = len(rest)
    colour = np.tile([0.875, 0.86, 0.845], (n, 1))
    if kind != "eye":
        light = np.ones((n, 3)) if surface.colour is None else surface.colour
        colour = srgb_of(light * colour_factor(file, surface.material))
    morphs = {}
    for name, delta in _morphs(surface, moving).items():
        rest_delta_m = np.linalg.solve(blend, delta[..., None])[..., 0]
        moves = np.flatnonzero(np.abs(rest_delta_m).max(axis=1) > MIN_MOVE_M)
        if len(moves):
            morphs[name] = Morph(moves.astype(np.int32), rest_delta_m[moves].astype(np.float32))
    return SkinnedMesh(
        vertices_m=rest.astype(np.float32),
        normals=rest_normals.astype(np.float32),
        colour_srgb=np.round(255 * colour).astype(np.uint8),
        uv=(np.zeros((n, 2)) if surface.uv is None else surface.uv).astype(np.float32),
        joints=joints.astype(np.uint8),
        weights=heavy.astype(np.float32),
        triangles=surface.triangles.astype(np.int32),
        triangle_part=tags.astype(np.uint8),
        triangle_material=np.full(len(surface.triangles), material, dtype=np.uint8),
        morphs=morphs,
    )


def _moving_shapes(surfaces: Sequence[Surface]) -> frozenset[str]:
    """Return which shapes move anything: many files have all of ARKit's names, some empty."""
    moving = frozenset(
        name
        for surface in surfaces
        for name, delta in surface.shapes.items()
        if np.abs(delta).max(initial=0.0) > MIN_MOVE_M
    )
    if not any(re.search(_FROWNING, name.lower()) for name in moving):
        return frozenset(name for name in moving if not re.search(_BROWS_DOWN, name.lower()))
    return moving


def _morphs(surface: Surface, moving: Set[str]) -> dict[str, Vector]:
    """Return our shapes of the face as sums of the file's that are `moving`: by their names, and
    where these do not tell by the file's presets.
    """
    presets = {name: name.removeprefix(PRESET) for name in moving if name.startswith(PRESET)}
    others = moving - presets.keys()

    def fits(pattern: str) -> list[Vector]:
        return [
            delta
            for name, delta in surface.shapes.items()
            if name in others and re.search(pattern, name.rsplit(".", 1)[-1].lower())
        ]

    sums: dict[str, Vector] = {}
    for ours, patterns in _SHAPES.items():
        for pattern, amount in patterns:
            if deltas := fits(pattern):
                sums[ours] = amount * np.sum(deltas, axis=0)
                break
    blinks = [f"{side}_blink" for side in SIDES]
    if not sums.keys() & set(blinks) and (deltas := fits(_BOTH_CLOSE)):
        sums |= dict.fromkeys(blinks, 0.5 * np.sum(deltas, axis=0))
    of_presets = {ours: surface.shapes[n] for n, ours in presets.items() if n in surface.shapes}
    both = of_presets.pop("both_blink", None)
    if both is not None and not (sums.keys() | of_presets.keys()) & set(blinks):
        of_presets |= dict.fromkeys(blinks, 0.5 * both)
    return of_presets | sums
