"""What the lens hides is left out of every picture, and nothing else is."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest

from tests.stage import figures
from visavis.lab.frame import EyeView
from visavis.stage.card.targets import EyeTarget, hidden_corners
from visavis.stage.errors import StageError
from visavis.stage.renderer import ON_PROCESSOR, Quality, Renderer
from visavis.stimuli.picture import Camera

SIZE = (90, 70)
LEFT_BELOW = ((-1.0, -0.8), (0.2, -0.8), (-1.0, 0.4))
RIGHT_ABOVE = ((1.2, 1.0), (1.2, 0.1), (0.1, 1.0))


def view(hidden: tuple[tuple[float, float], ...]) -> EyeView:
    return EyeView((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), -1.0, 1.2, -0.8, 1.0, hidden=hidden)


@pytest.fixture(scope="module", params=[Quality(), Quality(samples=0), ON_PROCESSOR])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    try:
        made = Renderer(quality=request.param)
    except StageError as problem:
        pytest.skip(str(problem))
    yield made
    made.close()


def drawn(renderer: Renderer, eye: EyeView | None) -> npt.NDArray[np.uint8]:
    picture, pose = figures.picture(3), figures.camera().pose
    camera = Camera(pose, -1.0, 1.2, -0.8, 1.0)
    target = EyeTarget(renderer.context, SIZE, renderer.quality.samples, eye)
    renderer.draw(picture, [camera], [target])
    image = target.read()
    target.release()
    return image


def inside(eye: EyeView, away_px: float) -> npt.NDArray[np.bool_]:
    """Return which pixels' middles lie in the hidden triangles by so many pixels, less outside."""
    width, height = SIZE
    x = (np.arange(width) + 0.5)[None, :]
    y = (height - 0.5 - np.arange(height))[:, None]
    found = np.zeros((height, width), bool)
    for a, b, c in (hidden_corners(eye) * 0.5 + 0.5).reshape(-1, 3, 2) * SIZE:
        sides = []
        for p, q in ((a, b), (b, c), (c, a)):
            (across, up), length = q - p, np.linalg.norm(q - p)
            sides.append(((x - p[0]) * up - (y - p[1]) * across) / length)
        turn = np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        found |= (-turn * np.array(np.broadcast_arrays(*sides))).min(axis=0) > away_px
    return found


@pytest.mark.parametrize("turned", [False, True], ids=["one way", "the other way round"])
def test_hidden_pixels_keep_the_background_and_the_others_their_colours(
    renderer: Renderer, turned: bool
) -> None:
    corners = (*LEFT_BELOW, *RIGHT_ABOVE)
    eye = view(corners[::-1] if turned else corners)
    whole, cut = drawn(renderer, view(())), drawn(renderer, eye)
    background = np.array(figures.picture(3).room.background_srgb)
    assert (drawn(renderer, None) == whole).all()
    hidden, seen = inside(eye, 1.5), ~inside(eye, -1.5)
    assert hidden.mean() > 0.15
    assert seen.mean() > 0.5
    assert np.abs(cut[hidden] - background).max() <= 1
    assert np.abs(whole[hidden] - background).max() > 20
    assert (cut[seen] == whole[seen]).all()


def test_the_next_picture_without_hidden_pixels_is_whole(renderer: Renderer) -> None:
    whole = drawn(renderer, None)
    drawn(renderer, view(LEFT_BELOW))
    assert (drawn(renderer, None) == whole).all()
    assert renderer.context.error == "GL_NO_ERROR"
