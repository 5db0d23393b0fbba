"""The same person taller or shorter, with longer or shorter arms and legs."""

from dataclasses import replace

import numpy as np

from visavis.stimuli.characters.character import Character, Morph, SkinnedMesh
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.motion.skeleton import Skeleton

MIN_M, TALLEST_M = 0.5, 2.6


def scale_to_stature(character: Character, stature_m: float) -> Character:
    """Return a character scaled to a stature with shoes; everything grows in proportion.

    Raises:
        CharacterError: nobody is that tall.
    """
    if not MIN_M <= stature_m <= TALLEST_M:
        raise CharacterError(
            f"{character.name} cannot be {stature_m} m tall; give metres between {MIN_M} "
            f"and {TALLEST_M}"
        )
    k = stature_m / character.stature_m
    skeleton = Skeleton(
        character.skeleton.names,
        character.skeleton.parents,
        k * character.skeleton.offsets_m,
        k * character.skeleton.tips_m,
    )
    eye = character.eyeball
    return replace(
        character,
        stature_m=stature_m,
        skeleton=skeleton,
        levels=tuple(_scale_mesh(mesh, k) for mesh in character.levels),
        measuring=tuple(_scale_mesh(mesh, k) for mesh in character.measuring),
        capsules=tuple(
            replace(c, start_m=k * c.start_m, end_m=k * c.end_m, radius_m=k * c.radius_m)
            for c in character.capsules
        ),
        eyeball=eye
        and replace(
            eye,
            radius_m=k * eye.radius_m,
            iris_radius_m=k * eye.iris_radius_m,
            pupil_radius_m=k * eye.pupil_radius_m,
        ),
        closed=None if character.closed is None else _scale_mesh(character.closed, k),
    )


ARM_BONES = ("lower_arm", "hand")
LEG_BONES = ("lower_leg", "foot")
MAX_STRETCH_01 = 0.15
"""Largest change of a limb's length, as a share of it."""


def with_limbs(character: Character, arms: float, legs: float) -> Character:
    """Return a character whose arms and legs are so many times as long, and no thicker.

    Upper arms, forearms, thighs and shanks stretch along themselves, in equal parts; hands and
    feet keep their size. Factors are kept within 1 ± `MAX_STRETCH_01`. Soles sink or rise with the
    legs: hips stay the origin.
    """
    factors = {
        f"{side}_{name}": float(np.clip(k, 1 - MAX_STRETCH_01, 1 + MAX_STRETCH_01))
        for side in ("left", "right")
        for names, k in ((ARM_BONES, arms), (LEG_BONES, legs))
        for name in names
    }
    skeleton = character.skeleton
    offsets_m = skeleton.offsets_m.copy()
    for name, k in factors.items():
        joint = skeleton.index_of[name]
        offsets_m[joint] *= k
    new_skeleton = replace(skeleton, offsets_m=offsets_m)
    bones = {skeleton.parents[skeleton.index_of[name]]: skeleton.index_of[name] for name in factors}

    def stretch_mesh(mesh: SkinnedMesh) -> SkinnedMesh:
        points = mesh.vertices_m.astype(np.float64)
        way = np.zeros_like(points)
        for corner in range(mesh.joints.shape[1]):
            joint = mesh.joints[:, corner].astype(np.int64)
            weight = mesh.weights[:, corner, None].astype(np.float64)
            shift = (new_skeleton.rest_m - skeleton.rest_m)[joint]
            for parent, child in bones.items():
                mine = joint == parent
                bone = skeleton.offsets_m[child]
                share = np.clip(
                    (points[mine] - skeleton.rest_m[parent]) @ bone / (bone @ bone), 0.0, 1.0
                )
                shift[mine] += share[:, None] * (offsets_m[child] - bone)
            way += weight * shift
        return replace(mesh, vertices_m=(points + way).astype(np.float32))

    return replace(
        character,
        skeleton=new_skeleton,
        levels=tuple(stretch_mesh(mesh) for mesh in character.levels),
        measuring=tuple(stretch_mesh(mesh) for mesh in character.measuring),
        closed=None if character.closed is None else stretch_mesh(character.closed),
    )


def _scale_mesh(mesh: SkinnedMesh, k: float) -> SkinnedMesh:
    factor = np.float32(k)
    morphs = {n: Morph(m.vertices, factor * m.delta_m) for n, m in mesh.morphs.items()}
    return replace(mesh, vertices_m=factor * mesh.vertices_m, morphs=morphs)
