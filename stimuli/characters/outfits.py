"""The same people in other clothes: colours of garments, shoes and hair, drawn by seed."""

import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stimuli.characters.character import Character, Material, SkinnedMesh

Colour = tuple[int, int, int]

TOPS: Final[tuple[Colour, ...]] = (
    (46, 84, 112), (122, 48, 60), (74, 96, 62), (206, 196, 174), (52, 52, 58), (176, 124, 52),
    (110, 74, 118), (60, 112, 108), (188, 96, 78), (138, 142, 148), (36, 46, 82), (214, 214, 210),
)  # fmt: skip
BOTTOMS: Final[tuple[Colour, ...]] = (
    (48, 60, 92), (52, 50, 52), (134, 112, 84), (84, 86, 92), (86, 66, 50), (32, 36, 46),
)  # fmt: skip
SHOES: Final[tuple[Colour, ...]] = ((52, 44, 40), (96, 66, 44), (216, 212, 204), (70, 74, 84))
HAIR_LIGHTER: Final = (0.72, 1.28, 0.86, 1.5)
"""Factors of the hair's colour; black hair stays black."""
UNLIKE: Final = 40.0
"""Colours nearer to each other than this (sRGB, as a distance) look alike."""


@cache
def in_other_clothes(character: Character, outfit: int) -> Character:
    """Return a person in their outfit number `outfit`: 0 as they came, the others seeded.

    Shapes, joints and measures are the same objects; equal calls return the same person.
    """
    if outfit == 0:
        return character
    order = np.random.default_rng(zlib.crc32(character.name.encode()))
    wear = {
        "top": _other(character, "top", TOPS, order, outfit),
        "bottom": _other(character, "bottom", BOTTOMS, order, outfit),
        "shoe": _other(character, "shoe", SHOES, order, outfit),
    }
    factors: dict[int, Vector] = {}
    known = {material.name for material in character.materials}
    materials = list(character.materials)
    for i, material in enumerate(materials):
        if material.name in wear:
            own = _mean_colour(character, i)
            factors[i] = np.asarray(wear[material.name]) / np.maximum(own, 12.0)
            materials[i] = _grey(material)
        elif material.kind == "cloth" and not known & set(wear):
            # Somebody imported: one cloth, whose picture may cover the skin, too.
            materials[i] = _all_grey(material)
            own = _worn_colour(character, materials[i], i)
            factors[i] = np.asarray(wear["top"]) / np.maximum(own, 12.0)
        elif material.kind == "hair":
            factors[i] = np.full(3, HAIR_LIGHTER[(outfit - 1) % len(HAIR_LIGHTER)])
    return replace(
        character,
        name=f"{character.name}_{outfit + 1}",
        levels=tuple(_recoloured(mesh, factors) for mesh in character.levels),
        materials=tuple(materials),
    )


def _other(
    character: Character,
    name: str,
    colours: Sequence[Colour],
    rng: np.random.Generator,
    outfit: int,
) -> Colour:
    """Return a colour unlike the one worn, another one for each outfit as long as there are."""
    order = rng.permutation(len(colours)).tolist()
    own = np.zeros(3)
    for i, material in enumerate(character.materials):
        if material.name == name:
            own = _mean_colour(character, i)
    unlike: list[Colour] = [
        colours[i] for i in order if np.linalg.norm(np.asarray(colours[i]) - own) > UNLIKE
    ]
    return unlike[(outfit - 1) % len(unlike)]


def _mean_colour(character: Character, material: int) -> Vector:
    mesh = character.levels[0]
    used = np.unique(mesh.triangles[mesh.triangle_material == material])
    mean: Vector = mesh.colour_srgb[used].mean(axis=0) if len(used) else np.full(3, 128.0)
    picture = character.materials[material].texture_srgb
    if picture is not None and np.ptp(picture[..., :3].reshape(-1, 3).mean(axis=0)) > 4:
        # The picture bears the colour: what is worn is both together.
        mean = mean * picture[..., :3].reshape(-1, 3).mean(axis=0) / 255
    return mean


def _grey(material: Material) -> Material:
    """Return a material whose picture bears light and dark alone; grey ones as they are."""
    picture = material.texture_srgb
    if picture is None or np.ptp(picture[..., :3].reshape(-1, 3).mean(axis=0)) <= 4:
        return material
    grey = np.repeat(picture[..., :3].mean(axis=2, keepdims=True), 3, axis=2)
    pixels: npt.NDArray[np.uint8] = np.round(grey).astype(np.uint8)
    return replace(material, texture_srgb=pixels)


@cache
def _all_grey(material: Material) -> Material:
    """Return a material without colour in its picture; the same one for every outfit."""
    return _grey(material)


def _worn_colour(character: Character, material: Material, number: int) -> Vector:
    """Return the mean sRGB (3,) of the triangles of a material, where they lie on its picture."""
    mesh = character.levels[0]
    used = np.unique(mesh.triangles[mesh.triangle_material == number])
    if not len(used):
        return np.full(3, 128.0)
    colour = mesh.colour_srgb[used].astype(np.float64)
    picture = material.texture_srgb
    if picture is not None and mesh.uv is not None:
        height, width = picture.shape[:2]
        u, v = (mesh.uv[used] % 1.0).T
        row = np.minimum((v * height).astype(np.int64), height - 1)
        column = np.minimum((u * width).astype(np.int64), width - 1)
        colour *= picture[row, column, :3] / 255
    mean: Vector = colour.mean(axis=0)
    return mean


def _recoloured(mesh: SkinnedMesh, factors: dict[int, Vector]) -> SkinnedMesh:
    colour = mesh.colour_srgb.astype(np.float64)
    for material, factor in factors.items():
        used = np.unique(mesh.triangles[mesh.triangle_material == material])
        colour[used] *= factor
    return replace(mesh, colour_srgb=np.round(np.clip(colour, 0, 255)).astype(np.uint8))
