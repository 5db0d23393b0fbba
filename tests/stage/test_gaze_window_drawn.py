"""A window that follows gaze as it is drawn: picture within it, cover outside, to the degree."""

import numpy as np
import pytest
from PIL import Image as Files

from visavis.lab.geometry import Pose, direction_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import picture_crc32
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Image, Panorama
from visavis.stimuli.gaze_window import NO_WINDOW, GazeWindow, WindowPlace
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
SCREEN = FlatScreen(0.32, 0.18, 640, 360, 0.6)
ON_SCREEN = Surface(PlacedScreen(SCREEN, HEAD))
GREY = (90, 90, 90)
RIGHT_DEG, UP_DEG = 5.0, -3.0
PLACE = WindowPlace.of(
    1, HEAD.position_m, direction_from_yaw_pitch_deg(np.array(-RIGHT_DEG), np.array(UP_DEG))
)
STRIPES_PX = 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Red and green stripes, flat and all around."""
    folder = tmp_path_factory.mktemp("windows")
    for name, wide, high in (("flat.png", 800, 400), ("around.png", 2048, 1024)):
        pixels = np.zeros((high, wide, 3), np.uint8)
        is_red = np.arange(wide) // STRIPES_PX % 2 == 0
        pixels[:, is_red, 0] = pixels[:, ~is_red, 1] = 250
        Files.fromarray(pixels).save(folder / name)
    return folder


@pytest.fixture(scope="module", params=[0, 4], ids=["plain", "smoothed"])
def renderer(request):
    try:
        with Renderer(quality=Quality(samples=request.param)) as renderer:
            yield renderer
    except StageError as problem:
        pytest.skip(str(problem))


def scene(folder, window, surface=ON_SCREEN, panorama=None):
    return FlatScene(
        "flat",
        (),
        dressed_by=DRESSED_BY,
        items=() if panorama else (Image("flat.png", 28),),
        background_srgb=GREY,
        head=HEAD,
        surface=surface,
        folder=folder,
        panorama=panorama,
        gaze_window=window,
    )


def picture(shown, place=PLACE):
    return picture_of(SceneFrame(shown, 0, np.zeros((0, 3)), np.zeros(0), window_at=place))


def drawn(renderer, what):
    """Return the pixels of a screen and how far each is from the place that is looked at, in
    degrees.
    """
    camera = eye_camera(HEAD, SCREEN.view_from(np.zeros(3)))
    image = renderer.image(what, camera, (SCREEN.width_px, SCREEN.height_px)).astype(int)
    rows, columns = np.indices(image.shape[:2]).reshape(2, -1) + 0.5
    towards = SCREEN.directions_of(np.stack([columns, rows], axis=1))
    chord = np.linalg.norm(towards - PLACE.direction, axis=1)
    return image, np.degrees(2 * np.arcsin(chord / 2)).reshape(image.shape[:2])


def is_within_picture(angle_deg):
    rows, columns = np.indices(angle_deg.shape)
    return (abs(rows - 180) < 120) & (abs(columns - 320) < 250)


@pytest.mark.parametrize("is_around", [False, True])
def test_inside_is_the_picture_and_outside_the_cover(folder, renderer, is_around):
    whole, angle_deg = drawn(renderer, picture(scene(folder, None)))
    image, _ = drawn(renderer, picture(scene(folder, GazeWindow(6, is_around=is_around))))
    inside, outside = angle_deg < 2.95, angle_deg > 3.05
    seen, covered = (outside, inside) if is_around else (inside, outside)
    assert (image[seen] == whole[seen]).all()
    assert (image[covered] == GREY).all()
    assert (whole[inside] != GREY).any()


def test_a_soft_edge_is_half_inside(folder, renderer):
    image, angle_deg = drawn(renderer, picture(scene(folder, GazeWindow(6, edge_deg=2))))
    whole, _ = drawn(renderer, picture(scene(folder, None)))
    assert (image[angle_deg < 1.95] == whole[angle_deg < 1.95]).all()
    assert (image[angle_deg > 4.05] == GREY).all()
    at_edge = (abs(angle_deg - 3) < 0.1) & is_within_picture(angle_deg)
    if not renderer.quality.samples:  # elsewhere light is mixed, not its codes
        assert image[at_edge] == pytest.approx((whole[at_edge] + np.array(GREY)) / 2, abs=14)


@pytest.mark.parametrize("is_around", [False, True])
def test_while_gaze_is_lost_all_is_covered(folder, renderer, is_around):
    image, _ = drawn(
        renderer, picture(scene(folder, GazeWindow(6, is_around=is_around)), NO_WINDOW)
    )
    assert (image == GREY).all()


def test_what_is_outside_can_be_blurred(folder, renderer):
    image, angle_deg = drawn(renderer, picture(scene(folder, GazeWindow(6, blur_deg=1))))
    whole, _ = drawn(renderer, picture(scene(folder, None)))
    assert (image[angle_deg < 2.95] == whole[angle_deg < 2.95]).all()
    outside = (angle_deg > 3.5) & is_within_picture(angle_deg)
    spread = [np.ptp(one[outside][:, 0]) for one in (whole, image)]
    assert spread[0] > 200
    assert spread[1] < 60
    assert image[outside].mean(axis=0)[:2] == pytest.approx([125, 125], abs=25)
    edge, _ = drawn(renderer, picture(scene(folder, GazeWindow(6, blur_deg=1)), NO_WINDOW))
    assert (abs(edge[outside] - image[outside]) <= 1).all()  # blurred alike, wherever gaze is


@pytest.mark.parametrize("panorama", [None, Panorama("around.png")], ids=["flat", "around"])
def test_in_a_headset_both_eyes_see_the_window_at_one_place(folder, renderer, panorama):
    what = picture(scene(folder, GazeWindow(8), IN_HEADSET, panorama))
    cameras = [eye_camera(HEAD, view) for view in default_views()]
    targets = [EyeTarget(renderer.context, (450, 500), renderer.quality.samples) for _ in cameras]
    renderer.draw(what, cameras, targets)
    far_m = what.veil.distance_m
    for camera, target in zip(cameras, targets, strict=True):
        image = target.read().astype(int)
        rows, columns = np.nonzero((image != GREY).any(axis=2))
        wide, high = camera.right - camera.left, camera.top - camera.bottom
        x = camera.left + (columns.mean() + 0.5) / 450 * wide
        y = camera.top - (rows.mean() + 0.5) / 500 * high
        to_m = HEAD.position_m + far_m * PLACE.direction - camera.pose.position_m
        assert (x, y) == pytest.approx((to_m[0] / -to_m[2], to_m[1] / -to_m[2]), abs=0.01)
        tall_deg = np.degrees(np.arctan(camera.top - rows.min() / 500 * high)) - np.degrees(
            np.arctan(camera.top - (rows.max() + 1) / 500 * high)
        )
        assert tall_deg == pytest.approx(8, abs=0.5)
        target.release()


def test_the_checksum_of_a_frame_tells_where_the_window_was(folder):
    shown = scene(folder, GazeWindow(6))
    elsewhere = WindowPlace.of(1, HEAD.position_m, (0.0, 0.0, -1.0))
    checksums = [picture_crc32(picture(shown, at)) for at in (PLACE, PLACE, elsewhere, NO_WINDOW)]
    assert checksums[0] == checksums[1]
    assert len(set(checksums)) == 3
