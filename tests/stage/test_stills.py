"""Single pictures: of the size asked for, the same as any drawing, smooth at edges."""

import numpy as np
import pytest

from stage.errors import StageError
from stage.renderer import Quality, Renderer
from stage.stills import Stills, made_small
from tests.stage import figures

SIZE_PX = (160, 120)


def test_still_is_the_smoothed_picture() -> None:
    picture, camera = figures.picture(3), figures.camera()
    try:
        with Stills() as stills:
            still = stills.image(picture, camera, SIZE_PX)
    except StageError as problem:
        pytest.skip(str(problem))
    with Renderer(quality=Quality(samples=0)) as renderer:
        rough = renderer.image(picture, camera, SIZE_PX)
    assert still.shape == (120, 160, 3)
    apart = np.abs(still.astype(int) - rough.astype(int)).max(axis=2)
    assert apart.mean() < 6
    shades = [len(np.unique(image.reshape(-1, 3), axis=0)) for image in (still, rough)]
    assert shades[0] > shades[1]


def test_a_small_pixel_shows_the_light_of_those_it_stands_for() -> None:
    large = np.zeros((4, 6, 3), np.uint8)
    large[:, ::2] = 255
    small = made_small(large, (3, 2))
    assert small.shape == (2, 3, 3)
    assert np.unique(small).tolist() == [188]  # half the light of 255; half its code is 128


def test_what_is_even_keeps_its_codes_when_made_small() -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    large = np.repeat(np.repeat(codes, 3, axis=0), 3, axis=1)[..., None].repeat(3, axis=2)
    assert np.array_equal(codes, made_small(large, (16, 16))[..., 0])
