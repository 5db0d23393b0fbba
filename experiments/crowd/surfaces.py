"""The bodies that collisions are measured on: those of the characters, or built round capsules."""

from functools import cache
from typing import Final, Literal, TypeAlias

import numpy as np

from visavis.analysis.collisions import (
    ClosedMesh,
    MalformedMesh,
    capsule,
    closed_mesh,
    enclosed_volume_m3,
    union,
)
from visavis.analysis.collisions.skinned import Bodies, SkinnedBody, pack
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character, SkinnedMesh
from visavis.stimuli.characters.closing import collision_mesh
from visavis.stimuli.contact.body import capsule_body
from visavis.stimuli.contact.figures import crowd_figures
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.scenes.station_crowd import CHARACTERS

Surface: TypeAlias = Literal["characters", "fine", "light", "capsules"]
MeshSurface: TypeAlias = Literal["characters", "fine", "light"]

AVATARS: Final = {"woman": "female_01", "man": "male_01"}
"""Avatars of participants; people of neither or unknown sex get the one nearer in stature."""
ROUNDNESS: Final[dict[str, tuple[int, int]]] = {"fine": (28, 7), "light": (14, 3)}
"""Segments round and rings per half: about 15,000 triangles, or 3,000 for quick looks."""
_MIN_M3: Final = 1e-3


@cache
def crowd_surfaces(surface: MeshSurface) -> Bodies:
    """Return the surfaces of those who play `CHARACTERS`, in that order."""
    return pack([person_surface(k, surface) for k in range(len(CHARACTERS))])


@cache
def person_surface(figure: int, surface: MeshSurface) -> SkinnedBody:
    """Return the surface of one of `CHARACTERS` in that person's own size."""
    if surface == "characters":
        return character_surface(default_casting(CHARACTERS[figure]))
    return _round_capsules(figure, surface)


@cache
def own_surface(surface: MeshSurface, avatar: str) -> tuple[SkinnedBody, float]:
    """Return the participant's surface and the stature it has at scale 1."""
    if surface == "characters":
        character = default_casting(avatar)
        return character_surface(character), character.stature_m
    return _round_capsules(None, surface), 1.0


@cache
def own_surfaces(surface: MeshSurface, avatar: str) -> Bodies:
    """Return the participant's surface as a table of one."""
    return pack([own_surface(surface, avatar)[0]])


def avatar_of(sex: str | None, stature_m: float) -> str:
    """Return the part whose body a participant has: by sex, else by stature."""
    if sex in AVATARS:
        return AVATARS[sex]
    return min(AVATARS.values(), key=lambda part: abs(default_casting(part).stature_m - stature_m))


@cache
def character_surface(character: Character) -> SkinnedBody:
    """Return a character's closed surface, moved by the joints of the body alone.

    Fingers go with the hand, the face with the head. The surface is checked as it is loaded and
    repaired where that is safe.

    Raises:
        CollisionError: it is open, has no inside, or holds no volume, with the character's name.
    """
    mesh, skeleton = collision_mesh(character), character.skeleton
    surface = checked_surface(mesh, character.name)
    column = {skeleton.index(name): i for i, name in enumerate(BODY_JOINTS)}
    to_body = np.empty(len(skeleton.names), np.int16)
    for joint in range(len(to_body)):
        at = joint
        while at not in column:
            at = int(skeleton.parents[at])
        to_body[joint] = column[at]
    weights = mesh.weights.astype(np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    joints_m: Vector = np.array([skeleton.rest_m[skeleton.index(name)] for name in BODY_JOINTS])
    return SkinnedBody(surface.vertices_m, surface.faces, to_body[mesh.joints], weights, joints_m)


def checked_surface(mesh: SkinnedMesh, name: str) -> ClosedMesh:
    """Return a surface that encloses a body, mended where that is safe.

    Raises:
        CollisionError: it cannot be mended; the message names the character and the place.
    """
    raw_surface = ClosedMesh(
        np.ascontiguousarray(mesh.vertices_m, np.float64),
        np.ascontiguousarray(mesh.triangles, np.int32),
    )
    surface = closed_mesh(
        raw_surface.vertices_m, raw_surface.faces, name=f"collision mesh of {name}"
    )
    if enclosed_volume_m3(surface) < _MIN_M3:
        raise MalformedMesh(
            f"collision mesh of {name}: it encloses less than a litre: this is not a person; check "
            "that it is in metres"
        )
    return surface


def _round_capsules(figure: int | None, surface: MeshSurface) -> SkinnedBody:
    """Return a surface round the capsules of contact, each rigid with its joint.

    Without `figure` it is the participant's at a stature of 1 m; `figure` is a row of
    `crowd_figures`, in that person's own size. Overlapping parts count once, as a surface winds.
    """
    if figure is None:
        body = capsule_body(1.0)
        columns, starts, ends, radii = body.columns, body.start_m, body.end_m, body.radius_m
    else:
        own = crowd_figures()
        columns, starts, ends, radii = (
            own.columns,
            own.start_m[figure],
            own.end_m[figure],
            own.radius_m[figure],
        )
    segments, rings = ROUNDNESS[surface]
    parts = [
        capsule(start, end, radius, segments=segments, rings=rings)
        for start, end, radius in zip(starts, ends, radii, strict=True)
    ]
    whole = union(parts)
    bones, weights = np.zeros((len(whole.vertices_m), 4), np.int16), np.eye(1, 4)
    bones[:, 0] = np.repeat(columns, [len(p.vertices_m) for p in parts])
    # vertices are given from their joint, so joints at rest stand at the origin
    return SkinnedBody(
        np.ascontiguousarray(whole.vertices_m),
        whole.faces,
        bones,
        np.repeat(weights, len(bones), axis=0),
        np.zeros((len(BODY_JOINTS), 3)),
    )
