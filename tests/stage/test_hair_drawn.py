"""Hair as it is drawn: in one piece, with soft edges."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy import ndimage

from tests.stage.figures import camera, plain_room
from tests.stage.test_irises_at_a_distance import standing
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate
from visavis.stage.errors import StageError
from visavis.stage.identity import IdentityBuffer
from visavis.stage.renderer import Quality
from visavis.stage.stills import Stills
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.character import MORPHS, Character, Material, SkinnedMesh
from visavis.stimuli.characters.levels import keep_triangles
from visavis.stimuli.picture import Camera, Picture, PosedPeople, Prop, Room, StaticMesh

AWAY_M, HEAD_M, SIDE_PX = 1.0, 0.34, 640
DIFFERS_CODES = 10
MAX_APART_M = 0.006
VIEWS_DEG = {
    "front": (0.0, 0.0),
    "half left": (40.0, 0.0),
    "half right": (-40.0, 0.0),
    "left": (90.0, 0.0),
    "right": (-90.0, 0.0),
    "back": (180.0, 0.0),
    "above": (0.0, 60.0),
}
"""How far round somebody, and how far down, one looks at them."""
MAX_OFF = 0.05
"""By which share hair may cover more or less than what is measured: of the first seven people with
hair of cards it was 4.6 %.
"""


@pytest.fixture(scope="module")
def stills() -> Iterator[Stills]:
    try:
        drawer = Stills(Quality(samples=0, shadows="none", fast=True, shrink_factor=2))
    except StageError as problem:
        pytest.skip(str(problem))
    yield drawer
    drawer.close()


@pytest.fixture(scope="module")
def buffer() -> Iterator[IdentityBuffer]:
    try:
        drawer = IdentityBuffer()
    except StageError as problem:
        pytest.skip(str(problem))
    with drawer:
        yield drawer


def _only(person: Character, material: str) -> Character:
    """Return nothing of somebody but one material, in black."""
    rank = [m.name for m in person.materials].index(material)
    full = person.levels[0]
    some = keep_triangles(full, full.triangle_material == rank)
    some = replace(some, colour_srgb=np.zeros_like(some.colour_srgb))
    return replace(person, levels=(some,) * len(person.levels))


def _image(stills: Stills, person: Character, material: str) -> npt.NDArray[np.int64]:
    picture, eyes_m = standing(person, AWAY_M, 0.0)
    picture = replace(picture, cast=(_only(person, material),))
    half = HEAD_M / 2 / AWAY_M
    at = eyes_m.mean(axis=0) + np.array([0.0, 0.0, AWAY_M])
    seen_by = Camera(Pose(at, quat_from_yaw_pitch_deg(0.0)), -half, half, -half, half)
    return stills.image(picture, seen_by, (SIDE_PX, SIDE_PX)).astype(np.int64)


def _longest_apart_m(stills: Stills, person: Character) -> float:
    """Return how long the longest piece of hair is that is drawn apart from the largest."""
    without, hair = (_image(stills, person, name) for name in ("shoe", "hair"))
    differs = np.abs(hair - without).max(axis=2) > DIFFERS_CODES
    pieces, _ = ndimage.label(differs, np.ones((3, 3)))
    largest = np.bincount(pieces.ravel())[1:].argmax()
    apart = [piece for k, piece in enumerate(ndimage.find_objects(pieces)) if k != largest]
    sides = [max(part.stop - part.start for part in piece) for piece in apart]
    return max(sides, default=0) * HEAD_M / SIDE_PX


@pytest.mark.parametrize("name", cast_names())
def test_no_lines_of_hair_stand_apart_from_it(stills: Stills, name: str) -> None:
    """Of two people lines of 10 and 15 mm did."""
    assert MAX_APART_M > _longest_apart_m(stills, load_character(name))


def _seen_px(buffer: IdentityBuffer, person: Character, mesh: SkinnedMesh) -> Vector:
    """Return how many pixels of pictures from all around show scalp and face (2, views)."""
    some = replace(person, levels=(mesh,) * 3, measuring=(mesh,))
    picture, eyes_m = standing(some, 2.0, 0.0)
    middle = eyes_m.mean(axis=0) + np.array([0.0, -0.05, -0.09])
    half = 0.34 / 2.0
    cameras = []
    for yaw_deg, down_deg in VIEWS_DEG.values():
        turn = quat_from_yaw_pitch_deg(yaw_deg, -down_deg)
        at = middle + rotate(turn, np.array([0.0, 0.0, 2.0]))
        cameras.append(Camera(Pose(at, turn), -half, half, -half, half))
    part = buffer.views(picture, cameras, (500, 500)).part
    parts = [part == PART_INDEX[name] for name in ("scalp", "face")]
    return np.sum(parts, axis=(2, 3), dtype=np.float64)


@pytest.mark.parametrize("name", cast_names())
def test_hair_covers_as_much_as_what_is_measured_says(name: str, buffer: IdentityBuffer) -> None:
    """Cards that reached farther to the front covered up to half more of five people's heads, and
    half of their cheeks from a side.
    """
    person = load_character(name)
    full, copy = (
        _seen_px(buffer, person, mesh) for mesh in (person.levels[0], person.measuring[0])
    )
    off = {
        (part, view): float(full[row, k] / copy[row, k] - 1)
        for row, (part, views) in enumerate({"scalp": 7, "face": 5}.items())
        for k, view in enumerate(list(VIEWS_DEG)[:views])
    }
    # Of faces nothing is seen from behind, and little but noses from above.
    assert {} == {where: share for where, share in off.items() if abs(share) > MAX_OFF}


def test_cut_outs_of_pictures_made_smaller_are_covered_by_as_much_as_they_hide(
    stills: Stills,
) -> None:
    """They were all there or not at all: hair ended in teeth."""

    def sheet(alpha: int) -> int:
        picture = np.full((4, 4, 4), 255, np.uint8)
        picture[..., 3] = alpha
        square = np.array([[-1, 0, -2], [1, 0, -2], [1, 3, -2], [-1, 3, -2]], np.float32)
        mesh = StaticMesh(
            square,
            np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
            np.full((4, 3), 255, np.uint8),
            np.array([[0, 1, 2], [0, 2, 3]], np.int32),
            np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
        )
        paper = Material("paper", "other", 0.9, picture)
        light = plain_room()
        room = Room(
            "one sheet", (Prop("sheet", mesh, paper),), (), light.sky, light.ground, (0, 0, 0)
        )
        nobody = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
        image = stills.image(Picture(0, room, (), nobody), camera(half_deg=5.0), (32, 24))
        assert image.std() < 1
        return int(image[12, 16, 1])

    def light_of(code: int) -> float:
        share = code / 255
        return float(((share + 0.055) / 1.055) ** 2.4)

    whole = light_of(sheet(255))
    assert whole > 0.1
    for alpha, share in ((0, 0.0), (64, 0.25), (128, 0.5), (192, 0.75)):
        assert share == pytest.approx(light_of(sheet(alpha)) / whole, abs=0.03)


def test_hair_looks_the_same_whoever_else_shares_its_array() -> None:
    """Pictures of hair have two heights, and stand in one array."""
    anna, jun = map(load_character, ("anna", "jun"))
    alone, eyes_m = standing(anna, AWAY_M, 0.0)
    people = alone.people
    both = PosedPeople(
        np.concatenate([people.root_m, people.root_m + np.array([40.0, 0.0, 0.0])]),
        np.concatenate([people.orientation_wxyz] * 2),
        np.concatenate([people.morphs_01] * 2),
    )
    half = HEAD_M / 2 / AWAY_M
    at = eyes_m.mean(axis=0) + np.array([0.0, 0.0, AWAY_M])
    seen_by = Camera(Pose(at, quat_from_yaw_pitch_deg(0.0)), -half, half, -half, half)
    size_px = (SIDE_PX // 2, SIDE_PX // 2)
    images = []
    for picture in (alone, replace(alone, cast=(anna, jun), people=both)):
        try:
            card = Stills(Quality(samples=0, shadows="none", fast=False))
        except StageError as problem:
            pytest.skip(str(problem))
        images.append(card.image(picture, seen_by, size_px).astype(np.int64))
        card.close()
    assert 20 < images[0].std()
    assert 1 >= np.abs(images[0] - images[1]).max()
