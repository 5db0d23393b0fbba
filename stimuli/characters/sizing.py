"""The same person taller or shorter."""

from dataclasses import replace

import numpy as np

from stimuli.characters.character import Character, Morph, SkinnedMesh
from stimuli.characters.errors import CharacterError
from stimuli.motion.skeleton import Skeleton

MIN_M, TALLEST_M = 0.5, 2.6


def sized(character: Character, stature_m: float) -> Character:
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
        levels=tuple(_scaled(mesh, k) for mesh in character.levels),
        measuring=tuple(_scaled(mesh, k) for mesh in character.measuring),
        capsules=tuple(
            replace(c, start_m=k * c.start_m, end_m=k * c.end_m, radius_m=k * c.radius_m)
            for c in character.capsules
        ),
        eyeball=replace(
            eye,
            radius_m=k * eye.radius_m,
            iris_radius_m=k * eye.iris_radius_m,
            pupil_radius_m=k * eye.pupil_radius_m,
        ),
        closed=None if character.closed is None else _scaled(character.closed, k),
    )


def _scaled(mesh: SkinnedMesh, k: float) -> SkinnedMesh:
    factor = np.float32(k)
    morphs = {n: Morph(m.vertices, factor * m.delta_m) for n, m in mesh.morphs.items()}
    return replace(mesh, vertices_m=factor * mesh.vertices_m, morphs=morphs)
