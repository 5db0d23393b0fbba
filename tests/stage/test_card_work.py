"""What shadows ask of a card, and that they are as right as what asks for more."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from tests.stage import figures
from tests.stage.card_work import counted_work, reads_of_maps
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.card.targets import EyeTarget
from visavis.stage.errors import StageError
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.picture import Camera, Light, Picture, Prop, Room
from visavis.stimuli.rooms.solids import box

SIZE_PX = (200, 200)
WIDE_M = 2.0
SUN = Light(
    "sun", np.full(3, 0.7), direction=np.array([0.3, -1.0, 0.2]) / np.sqrt(1.13), casts_shadow=True
)
GREY = np.full(3, 0.2)
ROOF_M = (-0.6, -0.8, 0.5, 0.7)
"""Of the shading boards: x and z from and to, about the middle of the floor."""
ROD_M = (0.7, -0.9, 0.72, 0.9)
ABOVE_M = 0.5
RAISED_M = 0.018
"""Maps are read from so far before a surface, lest it shade itself."""
ONE_AND_ITS_EDGE = 1 + 9
"""Reads of a map: what bounds say, and where they do not, three by three taps."""


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        engine = Renderer(quality=Quality(samples=0))
    except StageError as problem:
        pytest.skip(str(problem))
    with engine:
        yield engine


@cache
def ground() -> Prop:
    return figures.plane("floor", (-3, 0, -6), (0, 0, 6), (6, 0, 0), (150, 150, 150))


def board(name: str, x_m: float, z_m: float, to_x_m: float, to_z_m: float) -> Prop:
    size = (0, 0, to_z_m - z_m), (to_x_m - x_m, 0, 0)
    flat = figures.plane(name, (x_m, ABOVE_M, z_m - 3.0), *size, (90, 90, 90))
    return replace(flat, casts_shadow=True)


@cache
def shaded() -> Picture:
    """A floor below a board and a rod in the sun; nobody is there."""
    boards = (board("roof", *ROOF_M), board("rod", *ROD_M))
    room = Room("shaded", (ground(), *boards), (SUN,), GREY, GREY)
    return replace(figures.picture(1), room=room, cast=(), people=figures.standing((), []))


def below_boards() -> Camera:
    """Return a camera between the boards and the floor that looks straight down."""
    high = 0.4
    pose = Pose(np.array([0.0, high, -3.0]), quat_from_yaw_pitch_deg(0.0, -90.0))
    wide = WIDE_M / 2 / high
    return Camera(pose, -wide, wide, -wide, wide, near_m=0.01)


def floor_m() -> tuple[Vector, Vector]:
    """Return x and z − (−3) m of the floor at each pixel (h, w)."""
    steps = (np.arange(SIZE_PX[0]) + 0.5) / SIZE_PX[0] * WIDE_M - WIDE_M / 2
    x, z = np.meshgrid(steps, steps)
    return x, z


def shade_01(width_m: float) -> Vector:
    """Return how much of the sun the boards hide from each pixel's floor (h, w), spread over a
    square of that width.
    """
    x, z = floor_m()
    slope = SUN.direction[[0, 2]] / -SUN.direction[1]  # type: ignore[index]
    high_m = ABOVE_M - RAISED_M
    x, z = x - slope[0] * high_m, z - slope[1] * high_m

    def within(at: Vector, low: float, high: float) -> Vector:
        half = width_m / 2
        covered = np.minimum(at + half, high) - np.maximum(at - half, low)
        return np.maximum(covered, 0.0) / width_m

    hidden: Vector = sum(
        (within(x, b[0], b[2]) * within(z, b[1], b[3]) for b in (ROOF_M, ROD_M)), np.zeros_like(x)
    )
    return hidden


def light_of(image: npt.NDArray[np.uint8]) -> Vector:
    codes: Vector = image.mean(axis=2) / 255
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_shades_are_those_of_rays_spread_by_some_texels(renderer: Renderer) -> None:
    light = light_of(renderer.image(shaded(), below_boards(), SIZE_PX))
    x, z = floor_m()
    dark = light[abs(x + 0.1) + abs(z) < 0.2].mean()
    open_light = light[x > 0.95].mean()
    shade = (open_light - light) / (open_light - dark)
    # A texel of the map about this room is 9 mm wide, what is read of it 5 texels.
    assert abs(shade - shade_01(0.045)).mean() < 0.008
    assert abs(shade - shade_01(0.045)).max() < 0.2
    # Of sharp rays over a pixel: the 25 taps that were read before were 0.024 off.
    assert abs(shade - shade_01(0.01)).mean() < 0.02
    assert shade[shade_01(0.15) == 1.0].min() > 0.98


def test_who_stands_in_full_light_has_no_shade_of_their_own(renderer: Renderer) -> None:
    """Seen from where the sun is, nothing that is seen is shaded by something else."""
    person = load_cast()[9]
    people = figures.standing((person,), [(0.0, 0.0, -8.0)])
    sun = replace(SUN, direction=np.array([0.0, 0.0, -1.0]))
    room = Room("noon", (ground(),), (sun,), GREY, GREY)
    given = replace(figures.picture(1), room=room, cast=(person,), people=people)
    from_sun = figures.camera((0.0, 0.9, 12.0), half_deg=2.9, aspect=1.0)
    with Renderer(quality=replace(renderer.quality, shadows="none")) as plain:
        open_image = plain.image(given, from_sun, SIZE_PX).astype(int)
    image = renderer.image(given, from_sun, SIZE_PX).astype(int)
    darker = (open_image - image).max(axis=2)
    # Edges of the body; with 25 taps about the finest level it was 0.0025.
    assert (darker > 6).mean() < 0.0024


@pytest.mark.parametrize("samples", [0, 4])
def test_of_many_layers_only_what_is_seen_is_lit(samples: int) -> None:
    rows = [(0.5 * (i % 3) - 0.5, 0.0, -3.0 + 0.3 * (i // 3)) for i in range(12)]
    cast = (figures.figure(),) * 12
    given = replace(figures.picture(1), cast=cast, people=figures.standing(cast, rows))
    try:
        engine = Renderer(quality=Quality(samples=samples))
    except StageError as problem:
        pytest.skip(str(problem))
    with engine:
        target, near = EyeTarget(engine.context, SIZE_PX, samples), figures.camera(half_deg=10)
        engine.draw(given, [near], [target])
        with counted_work(engine) as work:
            engine.draw(given, [near], [target])
    assert work.lit_px < 1.02 * SIZE_PX[0] * SIZE_PX[1] * max(samples, 1)


def test_nobody_casts_more_triangles_than_the_second_finest_level() -> None:
    cast = (figures.figure(),) * 3
    behind = (0.0, 0.0, 3.0)
    given = figures.picture(1)
    people = figures.standing(cast, [(-0.5, 0.0, -2.0), (0.5, 0.0, -2.0), behind])
    given = replace(given, cast=cast, people=people)
    fine, casting, coarse = (len(mesh.triangles) for mesh in cast[0].levels)
    assert fine > casting > coarse
    try:
        engine = Renderer(quality=Quality(samples=0))
    except StageError as problem:
        pytest.skip(str(problem))
    with engine:
        target = EyeTarget(engine.context, SIZE_PX, 0)
        engine.draw(given, [figures.camera()], [target])
        asked = []
        for levels in ([0, 0, -1], [2, 0, -1]):
            with counted_work(engine) as work:
                engine.draw(given, [figures.camera()], [target], levels=np.array(levels))
            asked.append(work.map_triangles)
    lamps = sum(lamp.casts_shadow for lamp in given.room.lights)
    bounds = 2
    # Who is behind the camera casts all the same.
    assert [lamps * 3 * casting + bounds, lamps * (coarse + 2 * casting) + bounds] == asked


def test_what_is_all_lit_or_all_dark_takes_one_read() -> None:
    try:
        reads = reads_of_maps(shaded(), below_boards(), SIZE_PX)
    except StageError as problem:
        pytest.skip(str(problem))
    shade = shade_01(0.15)
    assert (reads[(shade == 0.0) | (shade == 1.0)] == 1).mean() > 0.99
    assert reads.max() <= ONE_AND_ITS_EDGE


def test_what_faces_away_from_a_lamp_reads_nothing() -> None:
    solid = box((0, 0.5, -3), (1, 1, 1), (150, 150, 150))
    thing = Prop("box", solid, ground().material, casts_shadow=True)
    behind = replace(SUN, direction=np.array([0.0, -0.6, 0.8]))
    room = Room("box", (thing,), (behind,), GREY, GREY)
    pose = Pose(np.array([0.0, 0.5, -4.0]), quat_from_yaw_pitch_deg(180.0, 0.0))
    from_sun = Camera(pose, -0.5, 0.5, -0.5, 0.5, near_m=0.01)
    pose = Pose(np.array([0.0, 0.5, -2.0]), quat_from_yaw_pitch_deg(0.0, 0.0))
    from_shade = Camera(pose, -0.5, 0.5, -0.5, 0.5, near_m=0.01)
    given = replace(shaded(), room=room)
    try:
        lit, dark = (reads_of_maps(given, c, SIZE_PX) for c in (from_sun, from_shade))
    except StageError as problem:
        pytest.skip(str(problem))
    assert lit[100, 100] > 0
    assert dark[100, 100] == 0
