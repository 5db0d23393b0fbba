"""Single pictures: of the size asked for, the same as any drawing, smooth at edges."""

import numpy as np
import pytest

from stage.errors import StageError
from stage.renderer import Quality, Renderer
from stage.stills import Stills
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
