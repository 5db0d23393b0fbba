"""Pictures drawn off-screen."""

from collections.abc import Iterator
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from tests.stage import figures
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.card.targets import EyeTarget
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stage.room_buffers import PropBuffers
from visavis.stage.stills import shrink
from visavis.stimuli.picture import Panel, Picture


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        engine = Renderer()
    except StageError as problem:
        pytest.skip(str(problem))
    with engine:
        yield engine


@pytest.fixture(scope="module")
def lightest(renderer: Renderer) -> Iterator[Renderer]:
    with Renderer(renderer.context, quality=LIGHTEST) as engine:
        yield engine


def test_people_stand_out_from_the_empty_room(renderer: Renderer) -> None:
    camera = figures.camera()
    without = renderer.image(figures.picture(0), camera, (160, 120))
    with_people = renderer.image(figures.picture(3), camera, (160, 120))
    changed = np.abs(with_people.astype(int) - without.astype(int)).max(axis=2) > 12
    assert 0.06 < changed.mean() < 0.4


def test_errors_that_others_left_behind_are_not_this_frame_s(renderer: Renderer) -> None:
    camera, picture = figures.camera(), figures.picture(1)
    for _ in range(2):  # a target released while bound spoils the making of the next
        target = EyeTarget(renderer.context, (64, 48), 0)
        renderer.draw(picture, [camera], [target])
        target.release()


def test_another_cast_is_drawn_after_targets_were_released(renderer: Renderer) -> None:
    for count in (1, 2):  # what is made for the second cast is made while drawing
        target = EyeTarget(renderer.context, (64, 48), 4)
        renderer.draw(figures.picture(count), [figures.camera()], [target])
        target.release()


def test_a_renderer_draws_on_after_one_with_its_own_context_was_closed(renderer: Renderer) -> None:
    camera, picture = figures.camera(), figures.picture(1)
    before = renderer.image(picture, camera, (64, 48))
    with Renderer() as passing:
        passing.image(picture, camera, (64, 48))
    assert np.array_equal(before, renderer.image(picture, camera, (64, 48)))
    target = EyeTarget(renderer.context, (64, 48), 4)
    renderer.draw(figures.picture(2), [camera], [target])
    target.release()


def test_black_scene_shows_only_the_mark(renderer: Renderer) -> None:
    camera = figures.camera()
    black = replace(figures.picture(3), brightness_01=0.0)
    assert not renderer.image(black, camera, (160, 120)).any()
    marked = renderer.image(
        replace(black, mark_m=np.array([0.0, 1.5, -2.0])), figures.camera(half_deg=5), (320, 240)
    )
    lit = np.argwhere(marked.max(axis=2) > 60)
    assert 100 < len(lit) < 400
    assert lit.mean(axis=0) == pytest.approx((119.5, 159.5), abs=1.0)


def test_pictures_of_a_camera_that_stands_still_are_as_each_alone(lightest: Renderer) -> None:
    pictures = [figures.picture(count) for count in (2, 1, 3, 2)]
    camera, small = figures.camera(), (160, 120)
    standing = [lightest.image(picture, camera, small) for picture in pictures]
    for picture, image in zip(pictures, standing, strict=True):
        lightest.image(picture, figures.camera(half_deg=5), small)  # the camera moved away
        assert np.array_equal(lightest.image(picture, camera, small), image)


def test_the_room_of_a_camera_that_stands_still_is_drawn_twice_at_most(lightest: Renderer) -> None:
    with patch.object(PropBuffers, "draw") as draw:
        for count in (1, 2, 1, 2):
            lightest.image(figures.picture(count), figures.camera(), (80, 60))
    assert draw.call_count == 2


def test_a_room_that_is_lit_otherwise_is_drawn_anew(lightest: Renderer) -> None:
    lit, camera = figures.picture(0), figures.camera()
    before = [lightest.image(lit, camera, (64, 48)) for _ in range(3)][-1]
    dim = lightest.image(replace(lit, brightness_01=0.4), camera, (64, 48))
    assert dim.mean() < 0.8 * before.mean()


@pytest.mark.parametrize("fast", [False, True])
def test_samples_of_a_pixel_are_averaged_in_light(fast: bool) -> None:
    """Edges that are means of codes are too dark, and thin bright things vanish from afar."""
    camera, picture = figures.camera(), figures.picture(3)
    try:
        with Renderer(quality=Quality(samples=4, fast=fast)) as few:
            smooth = few.image(picture, camera, (160, 120)).astype(float)
        with Renderer(quality=Quality(samples=0, fast=fast)) as rough:
            fine = rough.image(picture, camera, (8 * 160, 8 * 120))
    except StageError as problem:
        pytest.skip(str(problem))
    of_light = shrink(fine, (160, 120)).astype(float)
    of_codes = fine.reshape(120, 8, 160, 8, 3).mean(axis=(1, 3))
    edges = of_light - of_codes > 8
    assert edges.sum() > 100
    # Four samples stand for 64 points: what counts is which mean they lie about.
    lighter = np.mean((smooth - of_codes)[edges]) / np.mean((of_light - of_codes)[edges])
    assert lighter == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("fast", [False, True])
def test_colours_are_the_same_with_samples_and_without(fast: bool) -> None:
    panel = Panel(
        "How close?",
        ("1", "2", "3"),
        Pose(np.array([0.0, 1.2, -1.2]), quat_from_yaw_pitch_deg(0.0)),
        (2.4, 1.8),
    )
    picture = replace(figures.picture(2), panels=(panel,), brightness_01=0.6)
    try:
        images = [_image(replace(Quality(samples=n), fast=fast), picture) for n in (0, 4)]
    except StageError as problem:
        pytest.skip(str(problem))
    apart = np.abs(images[0] - images[1]).max(axis=2)
    # Edges differ, planes do not.
    assert np.percentile(apart, 75) <= 1.0


def _image(quality: Quality, picture: Picture) -> Vector:
    with Renderer(quality=quality) as renderer:
        image: Vector = renderer.image(picture, figures.camera(), (160, 120)).astype(float)
    return image
