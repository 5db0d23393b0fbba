"""The same people in other clothes: colours of garments, shoes and hair, drawn by seed."""

import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character, Material, SkinnedMesh
from visavis.stimuli.characters.garments import (
    Colour,
    GarmentKind,
    looks_bare,
    paint_wardrobe,
    wardrobe_of,
)

OURS: Final = {"top", "bottom", "shoe"}
"""Names of the garments of the people who come with Visavis."""

TOPS: Final[tuple[Colour, ...]] = (
    (46, 84, 112), (122, 48, 60), (74, 96, 62), (206, 196, 174), (52, 52, 58), (176, 124, 52),
    (110, 74, 118), (60, 112, 108), (188, 96, 78), (138, 142, 148), (36, 46, 82), (214, 214, 210),
)  # fmt: skip
BOTTOMS: Final[tuple[Colour, ...]] = (
    (48, 60, 92), (52, 50, 52), (134, 112, 84), (84, 86, 92), (86, 66, 50), (32, 36, 46),
)  # fmt: skip
SHOES: Final[tuple[Colour, ...]] = ((52, 44, 40), (96, 66, 44), (216, 212, 204), (70, 74, 84))
HAIR_LIGHTER: Final = (0.72, 1.28, 0.86, 1.5)
"""Factors of the hair's colour; black hair stays black. People imported keep theirs."""
TROUSERS_AND_SUITS: Final[tuple[Colour, ...]] = (
    (48, 60, 92),
    (84, 86, 92),
    (134, 112, 84),
    (86, 66, 50),
    (112, 120, 130),
    (92, 44, 56),
    (100, 96, 84),
    (158, 150, 138),
)
"""Garments of imported people on the legs, or from top to bottom."""
UNLIKE: Final = 40.0
"""Colours nearer to each other than this (sRGB, as a distance) look alike."""


@cache
def in_other_clothes(character: Character, outfit: int) -> Character:
    """Return a person in their outfit number `outfit`: 0 as they came, the others seeded.

    Of somebody imported only garments change that can be told from skin (`wardrobe_of`); without
    any the very same person is returned. Shapes, joints and measures are the same objects; equal
    calls return the same person.
    """
    if outfit == 0:
        return character
    order = np.random.default_rng(zlib.crc32(character.name.encode()))
    if not OURS & {material.name for material in character.materials}:
        return _imported_in_other_clothes(character, outfit, order)
    wear = {
        "top": _other(character, "top", TOPS, order, outfit),
        "bottom": _other(character, "bottom", BOTTOMS, order, outfit),
        "shoe": _other(character, "shoe", SHOES, order, outfit),
    }
    factors: dict[int, Vector] = {}
    materials = list(character.materials)
    for i, material in enumerate(materials):
        if material.name in wear:
            grey = _grey(material)
            own = _mean_colour(character, i)
            if grey is not material:
                own = _mean_tint(character, i) * _mean_of_picture(grey)
            factor = np.asarray(wear[material.name]) / np.maximum(own, 12.0)
            lightest = max(_lightest(mesh, i, factor) for mesh in character.levels)
            materials[i] = _lighten(grey, lightest / 255)
            factors[i] = factor * min(1.0, 255 / lightest)
        elif material.kind == "hair":
            factors[i] = np.full(3, HAIR_LIGHTER[(outfit - 1) % len(HAIR_LIGHTER)])
    return replace(
        character,
        name=f"{character.name}_{outfit + 1}",
        levels=tuple(_recolour(mesh, factors) for mesh in character.levels),
        materials=tuple(materials),
    )


def _imported_in_other_clothes(
    character: Character, outfit: int, rng: np.random.Generator
) -> Character:
    wardrobes = wardrobe_of(character)
    if not wardrobes:
        return character
    lower = [TROUSERS_AND_SUITS[i] for i in rng.permutation(len(TROUSERS_AND_SUITS)).tolist()]
    orders: dict[GarmentKind, list[Colour]] = {
        "top": [TOPS[i] for i in rng.permutation(len(TOPS)).tolist()],
        "bottom": lower,
        "whole": lower,
    }
    materials = list(character.materials)
    white: list[int] = []
    for wardrobe in wardrobes:
        wear = {}
        for garment in wardrobe.garments:
            unlike = [
                colour
                for colour in orders[garment.kind]
                if np.linalg.norm(colour - garment.ground_srgb) > UNLIKE
                and not looks_bare(wardrobe, colour)
            ]
            wear[garment.kind] = unlike[(outfit - 1) % len(unlike)]
        picture = paint_wardrobe(wardrobe, wear)
        for i in wardrobe.materials:
            materials[i] = replace(materials[i], texture_srgb=picture)
        if wardrobe.has_tint:
            white += wardrobe.materials
    levels = tuple(_whiten(mesh, white) for mesh in character.levels)
    name = f"{character.name}_{outfit + 1}"
    return replace(character, name=name, materials=tuple(materials), levels=levels)


def _whiten(mesh: SkinnedMesh, materials: Sequence[int]) -> SkinnedMesh:
    """Return a mesh whose pictures bear all colour of these materials."""
    if not materials:
        return mesh
    colour = mesh.colour_srgb.copy()
    colour[mesh.triangles[np.isin(mesh.triangle_material, materials)]] = 255
    return replace(mesh, colour_srgb=colour)


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
    mean = _mean_tint(character, material)
    of_picture = _mean_of_picture(character.materials[material])
    # Where the picture bears the colour, what is worn is both together.
    return mean * of_picture if np.ptp(of_picture) > 4 / 255 else mean


def _mean_tint(character: Character, material: int) -> Vector:
    mesh = character.levels[0]
    corners = np.unique(mesh.triangles[mesh.triangle_material == material])
    mean: Vector = mesh.colour_srgb[corners].mean(axis=0) if len(corners) else np.full(3, 128.0)
    return mean


def _mean_of_picture(material: Material) -> Vector:
    """Return the mean of a material's picture, 1 for white; 1 without a picture."""
    if material.texture_srgb is None:
        return np.ones(3)
    mean: Vector = material.texture_srgb[..., :3].reshape(-1, 3).mean(axis=0) / 255
    return mean


def _grey(material: Material) -> Material:
    """Return a material whose picture bears light and dark alone; grey ones as they are."""
    picture = material.texture_srgb
    if picture is None or np.ptp(_mean_of_picture(material)) <= 4 / 255:
        return material
    grey = np.repeat(picture[..., :3].mean(axis=2, keepdims=True), 3, axis=2)
    pixels: npt.NDArray[np.uint8] = np.round(grey).astype(np.uint8)
    return replace(material, texture_srgb=pixels)


def _lighten(material: Material, factor: float) -> Material:
    """Return a material with a lighter picture where vertices cannot bear all of a light colour.

    Their shade would lose its hue where 255 cuts off lit places alone. The grain stays, too: the
    picture's lightest hundredth is white at most.
    """
    picture = material.texture_srgb
    if picture is None or factor <= 1:
        return material
    grain = picture.astype(np.float64)
    grain[..., :3] *= min(factor, max(1.0, 255 / np.percentile(picture[..., :3], 99)))
    pixels: npt.NDArray[np.uint8] = np.round(np.clip(grain, 0, 255)).astype(np.uint8)
    return replace(material, texture_srgb=pixels)


def _lightest(mesh: SkinnedMesh, material: int, factor: Vector) -> float:
    """Return the greatest channel of a material's vertices in another colour, 1 at least."""
    corners = mesh.triangles[mesh.triangle_material == material]
    return max(1.0, float((mesh.colour_srgb[corners].reshape(-1, 3) * factor).max(initial=1.0)))


def _recolour(mesh: SkinnedMesh, factors: dict[int, Vector]) -> SkinnedMesh:
    colour = mesh.colour_srgb.astype(np.float64)
    for material, factor in factors.items():
        corners = np.unique(mesh.triangles[mesh.triangle_material == material])
        colour[corners] *= factor
    return replace(mesh, colour_srgb=np.round(np.clip(colour, 0, 255)).astype(np.uint8))
