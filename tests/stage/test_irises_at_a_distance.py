"""Where the cast looks can be told from the pixels of a headset."""

from collections.abc import Iterator

import numpy as np
import pytest

from lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate
from stage.errors import StageError
from stage.renderer import Quality, Renderer
from stimuli.characters.cast import load_cast, load_character
from stimuli.characters.character import Character
from stimuli.dressing.casting import build_of
from stimuli.gaze.turning import Aimed
from stimuli.motion.kinds import Idle
from stimuli.motion.people import PeopleMotion, Person
from stimuli.motion.skeleton import forward
from stimuli.picture import Camera, Picture
from stimuli.rooms.portrait import portrait_studio

AWAY_M, PX_PER_DEG, AVERTED_DEG = 3.5, 12.0, 10.0
EYES_M = (0.11, 0.045)
NOISE_01 = 0.04
"""Noise of each pixel within the observer, as in `benchmarks.gaze_readable`."""
FINER = 4
"""Rays a pixel and direction, so that where the pixels fall does not matter."""
MIN_DETECTABILITY = 12.5
"""d' of an ideal observer between the two pictures; light irises gave 10.5 to 12.4 before they
darkened towards their rims, between greyer whites."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
GAMMA = 2.2
DARK_SKIN = ("chloe", "elif", "ike", "karim")
MAX_WHITE_01 = 0.58
"""Light of the brightest place about eyes in dark skin, of the display's; without lids that shade
them it was 0.60 to 0.77.
"""


def eyes_of(renderer: Renderer, person: Character, averted_deg: float) -> Vector:
    """Return the luminance (h, w), 0 to 1, about the eyes of somebody seen from before."""
    motion = PeopleMotion((Person(build_of(person), Idle(lively=0.0), 1, heading_deg=180.0),))
    towards = np.array([0.0, 0.0, 1.0])
    gaze = rotate(quat_from_yaw_pitch_deg(averted_deg), towards)
    people = motion.at(1.0, Aimed(gaze[None], np.ones(1), np.array([AWAY_M])))
    body = forward(person.skeleton, people.root_m[0], people.orientation_wxyz[0])
    rows = [person.skeleton.index(f"{side}_eye") for side in ("left", "right")]
    at = body.position_m[rows].mean(axis=0) + AWAY_M * towards
    wide, high = (round(float(np.degrees(m / AWAY_M)) * PX_PER_DEG) for m in EYES_M)
    across, up = (m / 2 / AWAY_M for m in EYES_M)
    camera = Camera(Pose(at, quat_from_yaw_pitch_deg(0.0)), -across, across, -up, up)
    picture = Picture(0, portrait_studio(), (person,), people)
    fine = renderer.image(picture, camera, (FINER * wide, FINER * high)) @ LUMINANCE / 255.0
    seen: Vector = fine.reshape(high, FINER, wide, FINER).mean(axis=(1, 3))
    return seen


@pytest.fixture(name="renderer", scope="module")
def _renderer() -> Iterator[Renderer]:
    try:
        renderer = Renderer(quality=Quality(4, "none"))
    except StageError as problem:
        pytest.skip(str(problem))
    with renderer:
        yield renderer


def test_irises_tell_direct_gaze_from_averted_at_three_and_a_half_metres(
    renderer: Renderer,
) -> None:
    """Irises that were pale as far as their rims, in grey whites, could not be read."""
    found = {}
    for person in load_cast():
        direct, left, right = (
            eyes_of(renderer, person, deg) for deg in (0.0, AVERTED_DEG, -AVERTED_DEG)
        )
        least = min(float(np.linalg.norm(direct - aside)) for aside in (left, right))
        found[person.name] = least / NOISE_01
    assert {} == {name: d for name, d in found.items() if d < MIN_DETECTABILITY}


def test_whites_of_eyes_do_not_glow_in_dark_skin(renderer: Renderer) -> None:
    found = {
        name: float(eyes_of(renderer, load_character(name), 0.0).max() ** GAMMA)
        for name in DARK_SKIN
    }
    assert {} == {name: light for name, light in found.items() if light > MAX_WHITE_01}
