"""A film all around as it is drawn: the picture that is due, in every direction, for each eye."""

import numpy as np
import pytest

from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import picture_crc32
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Panorama
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

pytest.importorskip("av")
from tests.panoramic_film import RATE_HZ, number_ahead, number_behind, write_film_around

HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
SCREEN = FlatScreen(0.32, 0.18, 640, 360, 0.6)
SINCE_NS = 5_000_000_000
PICTURES = 36
WHILE_RUNNING = (0, 7, 30, 8, PICTURES - 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("films")
    write_film_around(folder / "one.mp4", PICTURES)
    for name, axis in (("below.mp4", 0), ("beside.mp4", 1)):
        write_film_around(folder / name, 12, axis=axis)
    return folder


@pytest.fixture(scope="module")
def renderer():
    try:
        with Renderer(quality=Quality(samples=0)) as renderer:
            yield renderer
    except StageError as problem:
        pytest.skip(str(problem))


def scene(folder, panorama, surface=IN_HEADSET):
    return FlatScene(
        "flat",
        (),
        dressed_by=DRESSED_BY,
        head=HEAD,
        surface=surface,
        folder=folder,
        panorama=panorama,
        moves_since_ns=SINCE_NS,
    )


def picture_at(film_scene, t_s, turned_deg=(0.0, 0.0)):
    nobody = np.zeros((0, 3)), np.zeros(0)
    t_ns = SINCE_NS + round(t_s * 1e9)
    return picture_of(SceneFrame(film_scene, t_ns, *nobody, turned_deg=turned_deg))


def middle_of(image):
    return image[image.shape[0] // 2, image.shape[1] // 2]


@pytest.mark.parametrize("head_deg", [0.0, 120.0], ids=["ahead", "behind"])
def test_in_a_headset_every_direction_has_the_picture_that_is_due(folder, renderer, head_deg):
    film_scene = scene(folder, Panorama("one.mp4"))
    camera = eye_camera(
        Pose(HEAD.position_m, quat_from_yaw_pitch_deg(head_deg)), default_views()[0]
    )
    number_of = number_behind if head_deg else number_ahead
    for number in WHILE_RUNNING:
        image = renderer.image(picture_at(film_scene, (number + 0.5) / RATE_HZ), camera, (90, 100))
        assert number == number_of(middle_of(image))


@pytest.mark.parametrize("turned_deg", [0.0, 150.0], ids=["ahead", "behind"])
def test_before_a_monitor_a_turned_view_shows_another_part(folder, renderer, turned_deg):
    film_scene = scene(folder, Panorama("one.mp4"), Surface(PlacedScreen(SCREEN, HEAD)))
    camera = eye_camera(HEAD, SCREEN.view_from(np.zeros(3)))
    number_of = number_behind if turned_deg else number_ahead
    for number in WHILE_RUNNING:
        picture = picture_at(film_scene, (number + 0.5) / RATE_HZ, (turned_deg, 0.0))
        image = renderer.image(picture, camera, (64, 36))
        assert number == number_of(middle_of(image))


def test_after_its_end_its_last_picture_stays(folder, renderer):
    camera = eye_camera(HEAD, default_views()[0])
    image = renderer.image(picture_at(scene(folder, Panorama("one.mp4")), 60.0), camera, (90, 100))
    assert PICTURES - 1 == number_ahead(middle_of(image))


@pytest.mark.parametrize(
    ("file", "stereo"), [("below.mp4", "top-bottom"), ("beside.mp4", "left-right")]
)
def test_in_a_headset_each_eye_sees_its_half_of_the_picture_that_is_due(
    folder, renderer, file, stereo
):
    film_scene = scene(folder, Panorama(file, stereo))
    cameras = [eye_camera(HEAD, view) for view in default_views()]
    targets = [EyeTarget(renderer.context, (64, 64), 0) for _ in cameras]
    for number in (0, 9, 4):
        renderer.draw(picture_at(film_scene, (number + 0.5) / RATE_HZ), cameras, targets)
        left, right = (middle_of(target.read()).astype(int) for target in targets)
        assert [number, number] == [number_ahead(left), number_ahead(right)]
        assert abs(left[2] - left[0]) < 6
        assert right[2] < right[0] / 2
    for target in targets:
        target.release()


def test_the_checksum_of_a_frame_tells_the_picture_of_the_film(folder):
    film_scene = scene(folder, Panorama("one.mp4"))
    times_s = (3.2 / RATE_HZ, 3.8 / RATE_HZ, 4.2 / RATE_HZ)
    same, again, other = (picture_crc32(picture_at(film_scene, t_s)) for t_s in times_s)
    assert same == again
    assert same != other


def test_pictures_of_one_film_take_one_place_on_the_card(folder, renderer):
    film_scene = scene(folder, Panorama("below.mp4", "top-bottom"))
    camera = eye_camera(HEAD, default_views()[0])
    numbers = set()
    for number in range(8):
        picture = picture_at(film_scene, (number + 0.5) / RATE_HZ)
        renderer.image(picture, camera, (9, 9))
        textures = [renderer._overlays.send(picture.surround, eye) for eye in (0, 1)]
        numbers |= {texture.glo for texture in textures}
    assert 2 == len(numbers)
