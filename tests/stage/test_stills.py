"""Single pictures: of the size asked for, the same as any drawing, smooth at edges."""

import sys

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import gaussian_filter

from tests.stage import figures
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.renderer import Quality, Renderer
from visavis.stage.stills import Stills, shrink
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.rooms.portrait import portrait_studio

SIZE_PX = (160, 120)
FINER = 8
PIXEL_PX, STRIPES_PX = 0.5, 2.0
"""Standard deviations of what a pixel gathers of stripes, and of what leaves nothing of them."""
MAX_CONTRAST = 1.35
"""Of stripes, as a multiple of what pixels should show; it was 1.45 at 3.5 m and 1.7 at 5 m."""


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
    small = shrink(large, (3, 2))
    assert small.shape == (2, 3, 3)
    assert np.unique(small).tolist() == [188]  # half the light of 255; half its code is 128


def test_what_is_even_keeps_its_codes_when_made_small() -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    large = np.repeat(np.repeat(codes, 3, axis=0), 3, axis=1)[..., None].repeat(3, axis=2)
    assert np.array_equal(codes, shrink(large, (16, 16))[..., 0])


def test_stripes_finer_than_pixels_fade_instead_of_beating() -> None:
    """A striped shirt from 3.5 and 5 m, at 12 pixels a degree, where pixels lie in four places."""
    elif_ = load_character("elif")
    motion = PeopleMotion((Person(build_of(elif_), Idle(lively=0.0), 1, heading_deg=180.0),))
    people = motion.at(1.0, Aimed(np.array([[0.0, 0.0, 1.0]]), np.ones(1)))
    picture = Picture(0, portrait_studio(), (elif_,), people)
    views = [
        (away_m, *chest_camera(elif_.stature_m, away_m, *place))
        for away_m in (3.5, 5.0)
        for place in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
    ]
    try:
        with Stills() as stills:
            small = [stills.image(picture, camera, (n, n)) for _, camera, n in views]
    except StageError as problem:
        pytest.skip(str(problem))
    with Renderer(quality=Quality(samples=0)) as renderer:
        large = [renderer.image(picture, camera, (FINER * n,) * 2) for _, camera, n in views]
    contrast: dict[float, list[tuple[float, float]]] = {3.5: [], 5.0: []}
    for (away_m, _, _), still, fine in zip(views, map(light_of, small), large, strict=True):
        plain = gathered(light_of(fine), STRIPES_PX)
        true = gathered(light_of(fine), PIXEL_PX)
        inner = np.s_[4:-4, 4:-4]
        contrast[away_m].append(
            (float((still - plain)[inner].std()), float((true - plain)[inner].std()))
        )
    found = {away_m: shown / true for away_m, (shown, true) in mean_of(contrast).items()}
    assert {} == {away_m: over for away_m, over in found.items() if over > MAX_CONTRAST}


def test_cards_draw_stills_as_processors_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Filters of cards differ: with their samples stripes beat at 5 m."""
    everywhere = (module for name, module in sys.modules.items() if name.startswith("visavis."))
    for module in [m for m in everywhere if hasattr(m, "draws_on_processor")]:
        monkeypatch.setattr(module, "draws_on_processor", lambda _: False)
    try:
        with Stills() as stills:
            quality = stills.renderer.quality
    except StageError as problem:
        pytest.skip(str(problem))
    assert Quality(samples=0, shrink_factor=2) == quality


def mean_of(pairs: dict[float, list[tuple[float, float]]]) -> dict[float, Vector]:
    """Return the mean of each distance's pairs."""
    return {away_m: np.mean(found, axis=0) for away_m, found in pairs.items()}


def chest_camera(
    stature_m: float, away_m: float, right_px: float, up_px: float
) -> tuple[Camera, int]:
    """Return a camera before somebody's chest, shifted by parts of a pixel of 12 a degree, and
    how many pixels its picture has a side.
    """
    px = np.radians(1 / 12)
    half = round(0.17 / away_m / px)
    at = np.array([0.0, 0.76 * stature_m, away_m])
    camera = Camera(
        Pose(at, quat_from_yaw_pitch_deg(0.0)),
        (right_px - half) * px,
        (right_px + half) * px,
        (up_px - half) * px,
        (up_px + half) * px,
    )
    return camera, 2 * half


def light_of(image: npt.NDArray[np.uint8]) -> Vector:
    """Return about how much light (h, w) a picture's pixels give."""
    light: Vector = (image / 255.0) ** 2.2 @ [0.2126, 0.7152, 0.0722]
    return light


def gathered(fine: Vector, deviation_px: float) -> Vector:
    """Return what pixels that are FINER times larger gather, by a bell of so many of them."""
    smooth = gaussian_filter(fine, FINER * deviation_px)
    high, wide = fine.shape[0] // FINER, fine.shape[1] // FINER
    middle = slice(FINER // 2 - 1, FINER // 2 + 1)
    pixels: Vector = smooth.reshape(high, FINER, wide, FINER)[:, middle][..., middle].mean((1, 3))
    return pixels
