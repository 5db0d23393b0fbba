"""Pictures of imported figures go on beyond the pieces of surface that read them."""

import numpy as np
import numpy.typing as npt
import pytest

from visavis.stimuli.characters.character import Maps, Material, SkinnedMesh
from visavis.stimuli.characters.gltf.islands import with_full_margins

SIDE_PX = 128
DARK, LIGHT, BESIDE = (30, 28, 40), (200, 160, 130), (250, 200, 170)
SMALLER = 16


def squares(*corners_px: tuple[int, int, int, int]) -> SkinnedMesh:
    """Return a mesh of one square of two triangles per material: left, top, right, bottom."""
    uv, triangles = [], []
    for k, (left, top, right, bottom) in enumerate(corners_px):
        uv += [(left, top), (right, top), (right, bottom), (left, bottom)]
        triangles += [(4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3)]
    n, t = len(uv), len(triangles)
    return SkinnedMesh(
        np.zeros((n, 3), np.float32),
        np.zeros((n, 3), np.float32),
        np.zeros((n, 3), np.uint8),
        (np.array(uv) / SIDE_PX).astype(np.float32),
        np.zeros((n, 4), np.uint8),
        np.zeros((n, 4), np.float32),
        np.array(triangles, np.int32),
        np.zeros(t, np.uint8),
        np.repeat(np.arange(t // 2), 2).astype(np.uint8),
        {},
    )


def atlas(
    *painted: tuple[tuple[int, int, int, int], tuple[int, int, int]],
) -> npt.NDArray[np.uint8]:
    """Return a bright picture with squares painted into it."""
    picture = np.full((SIDE_PX, SIDE_PX, 3), BESIDE, np.uint8)
    for (left, top, right, bottom), colour in painted:
        picture[top:bottom, left:right] = colour
    return picture


def small(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Return a picture as it is read from afar: each pixel the mean of those it stands for."""
    n = SIDE_PX // SMALLER
    found: npt.NDArray[np.float64] = picture.reshape(n, SMALLER, n, SMALLER, 3).mean(axis=(1, 3))
    return found


def test_a_dark_piece_stays_dark_to_its_edge_from_afar() -> None:
    place = (21, 37, 59, 90)
    picture = atlas((place, DARK))
    left, top, right, bottom = (k // SMALLER for k in place)
    seen = np.s_[top : bottom + 1, left : right + 1]
    assert max(DARK) < small(picture)[seen].max()

    (material,) = with_full_margins([Material("hair", "hair", 0.7, picture)], squares(place))

    assert material.texture_srgb is not None
    assert DARK == tuple(small(material.texture_srgb)[seen].max(axis=(0, 1)))


def test_what_painters_let_into_the_edge_of_a_piece_does_not_spread() -> None:
    place = (21, 37, 59, 90)
    picture = atlas((place, DARK))
    picture[37, 21:59] = BESIDE

    (material,) = with_full_margins([Material("hair", "hair", 0.7, picture)], squares(place))

    assert material.texture_srgb is not None
    assert DARK == tuple(material.texture_srgb.max(axis=(0, 1)))


def test_each_piece_goes_on_until_it_meets_the_next() -> None:
    dark, light = (10, 10, 40, 118), (80, 10, 118, 118)
    picture = atlas((dark, DARK), (light, LIGHT))
    worn = [Material("hair", "hair", 0.7, picture), Material("skin", "skin", 0.7, picture)]

    hair, skin = with_full_margins(worn, squares(dark, light))

    assert hair.texture_srgb is not None
    assert hair.texture_srgb is skin.texture_srgb
    assert DARK == tuple(hair.texture_srgb[:, :58].max(axis=(0, 1)))
    assert LIGHT == tuple(hair.texture_srgb[:, 62:].min(axis=(0, 1)))


def test_maps_go_on_as_their_picture_does() -> None:
    place = (21, 37, 59, 90)
    maps = Maps(surface=atlas((place, DARK)))
    worn = Material("coat", "cloth", 0.7, atlas((place, LIGHT)), maps=maps)

    (coat,) = with_full_margins([worn], squares(place))

    assert coat.maps is not None
    assert coat.maps.surface is not None
    assert coat.maps.normal is None
    assert DARK == tuple(coat.maps.surface.max(axis=(0, 1)))


def test_a_picture_of_one_colour_stays_the_same() -> None:
    white = np.full((1, 1, 3), 255, np.uint8)
    worn = Material("coat", "cloth", 0.7, white, maps=Maps(normal=atlas()))

    (coat,) = with_full_margins([worn], squares((21, 37, 59, 90)))

    assert coat.texture_srgb is white


@pytest.mark.parametrize("place", [(0, 0, 128, 128), (0, 0, 1024, 512)])
def test_pictures_that_are_read_everywhere_stay_the_same(place: tuple[int, int, int, int]) -> None:
    picture = atlas(((3, 3, 9, 9), DARK))

    (cloth,) = with_full_margins([Material("cloth", "cloth", 0.7, picture)], squares(place))

    assert cloth.texture_srgb is picture


def test_pieces_that_lie_over_the_edge_of_a_picture_are_read_on_both_sides() -> None:
    picture = atlas(((0, 0, 20, 128), DARK), ((108, 0, 128, 128), DARK))

    (cloth,) = with_full_margins(
        [Material("cloth", "cloth", 0.7, picture)], squares((108, 0, 148, 128))
    )

    assert cloth.texture_srgb is not None
    assert DARK == tuple(cloth.texture_srgb.max(axis=(0, 1)))
