"""A panorama as it is drawn: every direction where it belongs, for each eye its own."""

import numpy as np
import pytest
from PIL import Image as Files

from visavis.lab.geometry import (
    Pose,
    direction_from_yaw_pitch_deg,
    quat_from_yaw_pitch_deg,
    rotate,
    yaw_pitch_deg_of,
)
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import picture_crc32
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dressing.flat import areas_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Panorama, Shape
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
SCREEN = FlatScreen(0.32, 0.18, 640, 360, 0.6)
SIZE = (2048, 1024)
EYE_PX = (450, 500)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A panorama whose red is the yaw and whose green is the pitch, and one for two eyes."""
    folder = tmp_path_factory.mktemp("panoramas")
    yaw, pitch = np.meshgrid(np.arange(SIZE[0]) / SIZE[0], np.arange(SIZE[1]) / SIZE[1])
    pixels = np.zeros((*SIZE[::-1], 3), np.uint8)
    pixels[..., 0], pixels[..., 1] = 256 * yaw, 256 * pitch
    Files.fromarray(pixels).save(folder / "angles.png")
    for name, axis in (("two.png", 0), ("beside.png", 1)):
        halves = [np.full_like(pixels, grey) for grey in (40, 200)]
        Files.fromarray(np.concatenate(halves, axis=axis)).save(folder / name)
    return folder


def scene(folder, panorama, surface=IN_HEADSET, items=()):
    return FlatScene(
        "flat",
        (),
        dressed_by=DRESSED_BY,
        items=items,
        head=HEAD,
        surface=surface,
        folder=folder,
        panorama=panorama,
    )


def frame_of(scene, turned_deg=(0.0, 0.0)):
    return SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0), turned_deg=turned_deg)


@pytest.fixture(scope="module")
def renderer():
    try:
        with Renderer(quality=Quality(samples=0)) as renderer:
            yield renderer
    except StageError as problem:
        pytest.skip(str(problem))


def angles_at(image, camera, direction):
    """Return yaw and pitch of a panorama that are drawn in a direction (3,) of the camera."""
    x, y, z = direction.tolist()
    high, wide = image.shape[:2]
    column = int((x / -z - camera.left) / (camera.right - camera.left) * wide)
    row = int((camera.top - y / -z) / (camera.top - camera.bottom) * high)
    red, green, _ = image[row, column] / 256
    return (red - 0.5) * 360, (0.5 - green) * 180


@pytest.mark.parametrize(
    ("yaw_deg", "turned_deg", "head_deg"),
    [
        (0.0, (0.0, 0.0), 0.0),
        (60.0, (0.0, 0.0), 0.0),
        (0.0, (90.0, 0.0), 0.0),
        (-40.0, (30.0, 30.0), 0.0),
        (0.0, (0.0, 0.0), -70.0),
        (174.0, (0.0, 0.0), 0.0),
    ],
)
def test_every_direction_shows_its_part_of_the_picture(
    folder, renderer, yaw_deg, turned_deg, head_deg
):
    surface = Surface(PlacedScreen(SCREEN, HEAD)) if any(turned_deg) else IN_HEADSET
    panorama = Panorama("angles.png", yaw_deg=yaw_deg)
    shown = scene(folder, panorama, surface)
    head = Pose(HEAD.position_m, quat_from_yaw_pitch_deg(head_deg))
    camera = eye_camera(head, default_views()[0])
    image = renderer.image(picture_of(frame_of(shown, turned_deg)), camera, EYE_PX)
    (one,) = areas_of(shown)
    view = quat_from_yaw_pitch_deg(-(yaw_deg + turned_deg[0]), turned_deg[1])
    for right_deg, up_deg in ((0, 0), (20, 10), (-30, 5), (10, -30)):
        seen = direction_from_yaw_pitch_deg(-right_deg, up_deg)
        drawn = angles_at(image, camera, seen)
        world = rotate(head.orientation_wxyz, seen)
        left_deg, pitch_deg = yaw_pitch_deg_of(rotate(view, world))
        assert abs((drawn[0] + left_deg + 180) % 360 - 180) < 2.5
        assert drawn[1] == pytest.approx(float(pitch_deg), abs=1.5)
        if not any(turned_deg):  # areas lie where they are drawn
            x, y = one.pixels_met(world[None], None)
            assert x[0] % SIZE[0] == pytest.approx((0.5 - left_deg / 360) * SIZE[0] % SIZE[0])
            assert y[0] == pytest.approx((0.5 - pitch_deg / 180) * SIZE[1])


@pytest.mark.parametrize(
    ("file", "stereo"), [("two.png", "top-bottom"), ("beside.png", "left-right")]
)
def test_in_a_headset_each_eye_sees_its_half(folder, renderer, file, stereo):
    picture = picture_of(frame_of(scene(folder, Panorama(file, stereo))))
    cameras = [eye_camera(HEAD, view) for view in default_views()]
    targets = [EyeTarget(renderer.context, (64, 64), 0) for _ in cameras]
    renderer.draw(picture, cameras, targets)
    assert [40, 200] == [int(target.read()[32, 32, 0]) for target in targets]
    for target in targets:
        target.release()


@pytest.mark.parametrize("yaw_deg", [180.0, 172.7, 200.0])
def test_where_the_edges_of_the_picture_meet_there_is_no_seam(folder, yaw_deg, renderer):
    pixels = np.full((*SIZE[::-1], 3), 200, np.uint8)
    pixels[:, SIZE[0] // 4 : 3 * SIZE[0] // 4] = 0  # the mean of all is another grey
    Files.fromarray(pixels).save(folder / "behind.png")
    picture = picture_of(frame_of(scene(folder, Panorama("behind.png", yaw_deg=yaw_deg))))
    image = renderer.image(picture, eye_camera(HEAD, default_views()[0]), EYE_PX)
    assert {200} == set(np.unique(image).tolist())


def test_below_people_a_fine_pattern_is_as_sharp_as_ahead(folder, renderer):
    pixels = np.zeros((*SIZE[::-1], 3), np.uint8)
    pixels[::8], pixels[1::8], pixels[2::8], pixels[3::8] = 255, 255, 255, 255
    Files.fromarray(pixels).save(folder / "rings.png")
    picture = picture_of(frame_of(scene(folder, Panorama("rings.png"))))
    down = Pose(HEAD.position_m, quat_from_yaw_pitch_deg(0.0, -80.0))
    contrasts = [
        np.ptp(renderer.image(picture, eye_camera(head, default_views()[0]), EYE_PX)[230:270, 225])
        for head in (HEAD, down)
    ]
    assert min(contrasts) > 0.9 * 200


def test_flat_stimuli_stand_before_a_panorama(folder, renderer):
    items = (Shape("rectangle", 4.0, colour="red"),)
    picture = picture_of(frame_of(scene(folder, Panorama("angles.png"), items=items)))
    image = renderer.image(picture, eye_camera(HEAD, default_views()[0]), EYE_PX)
    assert [255, 0, 0] == image[EYE_PX[1] // 2, EYE_PX[0] // 2].tolist()


def test_another_turn_of_the_view_is_another_picture_in_the_recording(folder):
    shown = scene(folder, Panorama("angles.png"), Surface(PlacedScreen(SCREEN, HEAD)))
    checksums = [picture_crc32(picture_of(frame_of(shown, deg))) for deg in ((0, 0), (1, 0))]
    assert 2 == len(set(checksums))
