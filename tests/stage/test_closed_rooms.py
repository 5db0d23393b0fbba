"""Rooms are closed: wherever one looks in the places of the studies, something is there."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.picture import Camera, Picture, PosedPeople, Room
from visavis.stimuli.rooms.audience_room import audience_room
from visavis.stimuli.rooms.office import office
from visavis.stimuli.rooms.station import station

NOTHING = (255, 0, 255)
STANDING = ((0.0, 1.65, 0.0), (-1.2, 1.65, -2.0), (2.4, 1.65, 1.2))
ROOMS = {"audience": audience_room(), "office": office(), "station": station()}


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        made = Renderer(quality=Quality(samples=0, shadows="none"))
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
def test_no_look_goes_past_the_walls(renderer: Renderer, room: Room) -> None:
    nobody = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
    given = Picture(0, replace(room, background_srgb=NOTHING), (), nobody)
    for place in STANDING:
        for yaw, pitch in [(90.0 * k, 0.0) for k in range(4)] + [(0.0, 90.0), (0.0, -90.0)]:
            pose = Pose(np.array(place), quat_from_yaw_pitch_deg(yaw, pitch))
            image = renderer.image(given, Camera(pose, -1.0, 1.0, -1.0, 1.0), (160, 160))
            past = (abs(image.astype(int) - NOTHING) < 3).all(axis=2).mean()
            assert past < 1e-3, (place, yaw, pitch)
