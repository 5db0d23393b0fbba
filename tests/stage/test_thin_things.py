"""What is thinner than a pixel is drawn as much as it covers, wherever pixels happen to lie."""

from collections.abc import Iterator

import numpy as np
import pytest

from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.picture import Camera, Picture, PosedPeople
from visavis.stimuli.rooms.office import WINDOWS_X_M, office
from visavis.stimuli.scenes import office as places

SIZE_PX = (240, 90)
FINER = 6
AWAY_M = 6.0
PX_PER_TANGENT = 480.0
"""That of a picture of 960 pixels, 90 degrees wide."""
MAX_CODES = 7.0
QUALITIES = {"card": Quality(samples=4), "processor": LIGHTEST}


@pytest.fixture(params=QUALITIES)
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    try:
        made = Renderer(quality=QUALITIES[request.param])
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


def blinds(renderer: Renderer, finer: int, shift_px: float = 0.0) -> Vector:
    """Return the codes (h, w) of a window's blinds, pixels averaged from `finer` squared."""
    middle = np.array([WINDOWS_X_M[1] + 0.5, 2.27, places.ROOM_LOW_M[1] + 0.05])
    pose = Pose(middle + np.array([0.0, -0.65, AWAY_M]), quat_from_yaw_pitch_deg(0.0))
    wide, high = (n / 2 / PX_PER_TANGENT for n in SIZE_PX)
    up = 0.65 / AWAY_M + shift_px / PX_PER_TANGENT
    camera = Camera(pose, -wide, wide, up - high, up + high)
    nobody = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
    size = SIZE_PX[0] * finer, SIZE_PX[1] * finer
    image = renderer.image(Picture(0, office(), (), nobody), camera, size).mean(axis=2)
    whole: Vector = image.reshape(SIZE_PX[1], finer, SIZE_PX[0], finer).mean(axis=(1, 3))
    return whole[34:56, 80:120]


def test_blinds_look_near_by_as_far_away(renderer: Renderer) -> None:
    fine = blinds(renderer, FINER)
    assert abs(blinds(renderer, 1) - fine).mean() < MAX_CODES


def test_blinds_do_not_flicker_when_a_head_moves(renderer: Renderer) -> None:
    shifts = [blinds(renderer, 1, shift) for shift in (0.0, 0.25, 0.5, 0.75)]
    fine = [blinds(renderer, FINER, shift) for shift in (0.0, 0.25, 0.5, 0.75)]
    rows = np.array([image.mean(axis=1) for image in shifts])
    true = np.array([image.mean(axis=1) for image in fine])
    assert abs(np.diff(rows, axis=0)).max() < abs(np.diff(true, axis=0)).max() + MAX_CODES
