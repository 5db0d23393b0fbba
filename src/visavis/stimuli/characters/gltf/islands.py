"""Pictures of imported figures between the pieces of surface that read them."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw
from scipy.ndimage import binary_erosion, distance_transform_edt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Maps, Material, SkinnedMesh

Pixels = npt.NDArray[np.uint8]
EDGE_PX: Final = 2
"""How far inside a piece's edge painters let in what lies beside it."""


def with_full_margins(materials: Sequence[Material], mesh: SkinnedMesh) -> tuple[Material, ...]:
    """Return materials whose pictures go on, outside what the mesh's triangles read, as they are
    at the nearest place inside.

    From afar a reading takes in what lies beside a piece of surface. Many painters leave skin or
    white there, which then lines hair and seams of clothes. Pictures that are laid side by side
    over a surface stay as they are.
    """
    if mesh.uv is None:
        return tuple(materials)
    uv = mesh.uv.astype(np.float64)
    read: dict[int, list[Vector]] = {}
    for k, material in enumerate(materials):
        corners = uv[mesh.triangles[mesh.triangle_material == k]]
        for pixels in _pictures(material):
            read.setdefault(id(pixels), []).append(corners)
    full_pictures: dict[int, Pixels] = {}
    # Maps lie as their picture does: what has one shape and one set of triangles is sought once.
    sources: dict[tuple[object, ...], tuple[Vector, ...] | None] = {}
    for material in materials:
        for pixels in _pictures(material):
            if id(pixels) in full_pictures:
                continue
            key = (pixels.shape[:2], *(id(corners) for corners in read[id(pixels)]))
            if key not in sources:
                sources[key] = _nearest_inside(np.concatenate(read[id(pixels)]), pixels.shape[:2])
            source = sources[key]
            full_pictures[id(pixels)] = pixels if source is None else pixels[source]

    def of(pixels: Pixels | None) -> Pixels | None:
        return None if pixels is None else full_pictures.get(id(pixels), pixels)

    def of_maps(maps: Maps | None) -> Maps | None:
        if maps is None:
            return None
        return replace(maps, **{f.name: of(getattr(maps, f.name)) for f in fields(maps)})

    return tuple(
        replace(m, texture_srgb=of(m.texture_srgb), maps=of_maps(m.maps)) for m in materials
    )


def _pictures(material: Material) -> list[Pixels]:
    pictures = [material.texture_srgb]
    if material.maps is not None:
        pictures += [getattr(material.maps, f.name) for f in fields(material.maps)]
    return [pixels for pixels in pictures if pixels is not None and min(pixels.shape[:2]) > 1]


def _nearest_inside(corners: Vector, shape: tuple[int, ...]) -> tuple[Vector, ...] | None:
    """Return, for each pixel, row and column (h, w) of the nearest one that triangles (t, 3, 2)
    read; None where nothing or everything is read.
    """
    height, width = shape[0], shape[1]
    low = np.floor(corners.min(axis=1, initial=np.inf)) if len(corners) else np.zeros((0, 2))
    corners = corners - low[:, None]
    if not len(corners) or corners.max() > 2.0:
        return None
    mask = Image.new("L", (width, height))
    draw = ImageDraw.Draw(mask)
    places = corners * (width, height) - 0.5
    for triangle in places:
        beyond = triangle.max(axis=0) > (width, height)
        for right in range(1 + int(beyond[0])):
            for down in range(1 + int(beyond[1])):
                shifted_triangle = triangle - (right * width, down * height)
                draw.polygon([(float(x), float(y)) for x, y in shifted_triangle], fill=255)
    is_covered = np.asarray(mask) > 0
    inside = binary_erosion(is_covered, iterations=EDGE_PX, border_value=1)
    if inside.all() or not is_covered.any():
        return None
    # Pieces too narrow to have an inside are their own.
    if inside.any():
        away = distance_transform_edt(~inside)
        inside |= is_covered & (away > 2 * EDGE_PX)
    else:
        inside = is_covered
    rows, columns = distance_transform_edt(~inside, return_distances=False, return_indices=True)
    return rows, columns
