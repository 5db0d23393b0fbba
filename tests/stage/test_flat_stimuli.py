"""Texts, pictures, shapes and gratings as they are drawn: their place, size and grey."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Files

from benchmarks.film_in_step import number_of, write_film
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stage.drawn_stage import eye_camera
from visavis.stage.errors import StageError
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dots import places_deg
from visavis.stimuli.dressing.flat import box_px
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Dots, Grating, Image, Shape, Text, Video, rgb_of
from visavis.stimuli.flat_pixels import moving_pixels, pixels_of, read_picture, text_size_em
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
SCREEN = FlatScreen(0.32, 0.18, 640, 360, 0.6)
"""Half a millimetre a pixel: a degree in the middle is 20.9 pixels."""
PX_PER_M = 2000.0


def px(deg):
    return 2 * 0.6 * np.tan(np.radians(deg) / 2) * PX_PER_M


def scene(*items, surface=None, background=(0, 0, 0), folder=None):
    surface = Surface(PlacedScreen(SCREEN, HEAD)) if surface is None else surface
    return FlatScene(
        "flat",
        (),
        dressed_by=DRESSED_BY,
        items=items,
        background_srgb=background,
        head=HEAD,
        surface=surface,
        **({} if folder is None else {"folder": folder}),
    )


def drawn(*items, **how):
    picture = picture_of(SceneFrame(scene(*items, **how), 0, np.zeros((0, 3)), np.zeros(0)))
    camera = eye_camera(HEAD, SCREEN.view_from(np.zeros(3)))
    try:
        with Renderer(quality=Quality(samples=0)) as renderer:
            return renderer.image(picture, camera, (640, 360)).astype(int)
    except StageError as problem:
        pytest.skip(str(problem))


def extent(image, background=0):
    rows, columns = np.nonzero(np.abs(image - background).max(axis=2) > 40)
    return columns.min(), rows.min(), columns.max() + 1, rows.max() + 1


@pytest.mark.parametrize("at_deg", [(0.0, 0.0), (5.0, 0.0), (-4.0, 3.0)])
def test_a_shape_covers_the_pixels_of_its_degrees(at_deg):
    image = drawn(Shape("rectangle", 2.0, 1.0, at_deg=at_deg))
    left, right = (0.6 * np.tan(np.radians(at_deg[0] + d)) * PX_PER_M + 320 for d in (-1, 1))
    top, bottom = (180 - 0.6 * np.tan(np.radians(at_deg[1] + d)) * PX_PER_M for d in (0.5, -0.5))
    assert extent(image) == pytest.approx((left, top, right, bottom), abs=0.51)
    assert set(np.unique(image)) == {0, 255}


@pytest.mark.parametrize("grey", [1, 64, 128, 200, 254])
def test_a_grey_is_shown_as_it_is_whatever_lamps_there_are(grey):
    image = drawn(Shape("rectangle", 4.0, colour=(grey, grey, grey)))
    assert (image[180, 320] == grey).all()


def test_the_background_is_the_colour_that_was_asked_for():
    assert (drawn(Text("+"), background=(128, 128, 128))[5, 5] == 128).all()


def test_a_picture_is_shown_pixel_for_pixel_where_its_size_is_its_own(tmp_path):
    rng = np.random.default_rng(1)
    wide = round(px(4.0))
    pixels = rng.integers(0, 256, (wide, wide, 3), dtype=np.uint8)
    Files.fromarray(pixels).save(tmp_path / "noise ä 🙂.png")
    image = drawn(Image("noise ä 🙂.png", width_deg=4.0), folder=tmp_path)
    left, top, right, bottom = box_px((0.0, 0.0), (4.0, 4.0), SCREEN)
    assert right - left == wide
    assert np.abs(image[top:bottom, left:right] - pixels).max() <= 1


def test_the_letters_of_a_line_are_as_high_as_asked():
    image = drawn(Text("hg", height_deg=3.0))
    _, top, _, bottom = extent(image)
    assert bottom - top == pytest.approx(px(3.0), rel=0.05)


def letters(text, em_px):
    """Return where ink is in the box of a text of so many pixels."""
    size_px = tuple(max(1, round(em * em_px)) for em in text_size_em(Text(text)))
    return pixels_of(Text(text), size_px, Path())[..., 3]


@pytest.mark.parametrize("text", ["angry: F    neutral: J", "seen", "J", "jj", "Wof", "Ägj\nÄfj"])
def test_no_letter_of_any_size_is_cut_off_by_the_box_of_its_text(text):
    for em_px in (100, 240):
        ink = letters(text, em_px)
        assert 0 == max(ink[[0, -1]].max(), ink[:, [0, -1]].max()), em_px
    for em_px in (5, 9):
        small = letters(text, em_px)
        large = pixels_of(Text(text), (small.shape[1] * 12, small.shape[0] * 12), Path())[..., 3]
        shrunk = Files.fromarray(large).resize(small.shape[::-1], Files.Resampling.BOX)
        assert small == pytest.approx(np.asarray(shrunk), abs=64), em_px


def test_a_grating_has_its_cycles_contrast_and_mean():
    image = drawn(
        Grating(6.0, cycles_per_deg=2.0, contrast_01=0.5, mask="none"), background=(128,) * 3
    )
    row = image[180, 320 - 50 : 320 + 50, 0] - 127.5
    assert np.abs(row).max() == pytest.approx(0.5 * 127.5, abs=2.0)
    spectrum = np.abs(np.fft.rfft(row * np.hanning(100), 4096))
    cycles_per_px = spectrum.argmax() / 4096
    assert cycles_per_px * px(6.0) / 6.0 == pytest.approx(2.0, rel=0.03)


def test_vertical_bars_are_upright_and_ninety_degrees_lie():
    upright, lying = (
        drawn(Grating(6.0, 1.0, mask="none", orientation_deg=o), background=(128,) * 3)
        for o in (0.0, 90.0)
    )
    assert np.ptp(upright[150:210, 320, 0]) <= 1 < 100 < np.ptp(upright[180, 290:350, 0])
    assert np.ptp(lying[180, 290:350, 0]) <= 1 < 100 < np.ptp(lying[150:210, 320, 0])


def test_the_last_stimulus_is_in_front():
    image = drawn(Shape("rectangle", 4.0, colour="red"), Shape("ellipse", 2.0, colour="blue"))
    assert tuple(image[180, 320]) == rgb_of("blue")
    assert tuple(image[180, 320 + int(px(3.0) / 2)]) == rgb_of("red")


def test_in_a_headset_a_stimulus_has_its_degrees_around_the_head():
    image = drawn(Shape("rectangle", 2.0, at_deg=(4.0, -2.0)), surface=IN_HEADSET)
    left, top, right, bottom = extent(image)
    assert (left + right) / 2 - 320 == pytest.approx(np.tan(np.radians(4.0)) * 1200, rel=0.03)
    assert (top + bottom) / 2 - 180 == pytest.approx(np.tan(np.radians(2.0)) * 1200, rel=0.03)
    assert right - left == pytest.approx(px(2.0), rel=0.03)


def moving(path):
    first, *others = (Files.new("RGB", (8, 8), (90 * k, 0, 0)) for k in range(3))
    first.save(path, save_all=True, append_images=others)


@pytest.mark.parametrize(
    ("name", "save", "says"),
    [
        ("none.png", None, "there is no picture .*none.png"),
        ("text.png", lambda p: p.write_text("no picture"), "no picture that can be read"),
        ("print.jpg", lambda p: Files.new("CMYK", (4, 4)).save(p), "colours for print"),
        ("folder.png", lambda p: p.mkdir(), "folder.png is a folder; name the file of a picture"),
        ("moving.gif", lambda p: moving(p), "holds 3 pictures, which move; save one of them as"),
        ("moving.webp", lambda p: moving(p), "holds 3 pictures, which move"),
        ("deep.png", lambda p: Files.new("I;16", (4, 4)).save(p), "more than 8 bits"),
    ],
)
def test_a_picture_that_cannot_be_shown_is_named_with_what_to_do(tmp_path, name, save, says):
    if save is not None:
        save(tmp_path / name)
    with pytest.raises(DesignError, match=says):
        read_picture(tmp_path / name)


def test_a_truncated_picture_is_damaged(tmp_path):
    noise = np.random.default_rng(1).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    Files.fromarray(noise).save(tmp_path / "whole.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:3000])
    with pytest.raises(DesignError, match=r"cut\.png is damaged"):
        read_picture(tmp_path / "cut.png")


def test_a_photograph_stands_upright_as_its_camera_says(tmp_path):
    exif = Files.Exif()
    exif[0x0112] = 6  # turned to the right
    Files.new("RGB", (40, 20)).save(tmp_path / "turned.jpg", exif=exif)
    assert read_picture(tmp_path / "turned.jpg").size == (20, 40)


def test_a_name_in_other_letters_is_pointed_out(tmp_path):
    Files.new("RGB", (4, 4)).save(tmp_path / "Face.PNG")
    with pytest.raises(DesignError, match=r"did you mean Face.PNG\?"):
        read_picture(tmp_path / "face.png")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Text("a", colour="gren"), "did you mean 'green'"),
        (lambda: Text(" "), "nothing to read"),
        (lambda: Text("a", height_deg=0), "from 0 to 150 degrees"),
        (lambda: Image("a.png"), "width_deg or its height_deg"),
        (lambda: Shape("circle"), "kind is 'circle'; it takes 'rectangle', 'ellipse', "),
        (lambda: Grating(contrast_01=1.5), "from 0 to 1"),
        (lambda: Text("a", at_deg=(95, 0)), "degrees to the right"),
    ],
)
def test_a_stimulus_that_is_not_possible_is_refused_with_the_reason(make, says):
    with pytest.raises(DesignError, match=says):
        make()


@pytest.mark.parametrize("surface", [None, IN_HEADSET])
def test_dots_are_drawn_where_they_are_in_each_frame(surface):
    dots = Dots(1.0, 90.0, width_deg=6, dot_deg=0.3, density_per_deg2=1, seed=3, rate_hz=60)
    before = scene(dots, surface=surface)
    camera = eye_camera(HEAD, SCREEN.view_from(np.zeros(3)))
    try:
        with Renderer(quality=Quality(samples=0)) as renderer:
            images = []
            for step in (0, 30, 31, 30):
                t_ns = round(step * 1e9 / 60)
                picture = picture_of(SceneFrame(before, t_ns, np.zeros((0, 3)), np.zeros(0)))
                images.append(renderer.image(picture, camera, (640, 360)).astype(int))
    except StageError as problem:
        pytest.skip(str(problem))
    first, later, next_one, again = images
    assert (later == again).all()
    assert (first != later).any()
    assert (later != next_one).any()
    if surface is None:  # the display's own pixels
        left, top, right, bottom = box_px((0.0, 0.0), (6.0, 6.0), SCREEN)
        expected = moving_pixels(dots, (right - left, bottom - top), 31)[..., 3]
        assert (next_one[top:bottom, left:right, 0] == expected).all()
    else:
        shown = np.isfinite(places_deg(dots, 0)[:, 0]).sum()
        expected_px = shown * np.pi * (px(0.3) / 2) ** 2
        assert first.max(axis=2).sum() / 255 == pytest.approx(expected_px, rel=0.15)


def test_a_film_is_drawn_with_the_picture_that_is_due_in_each_frame(tmp_path):
    pytest.importorskip("av")
    write_film(tmp_path / "film.mp4", 45)
    before = scene(Video("film.mp4", width_deg=12), folder=tmp_path)
    camera = eye_camera(HEAD, SCREEN.view_from(np.zeros(3)))
    try:
        with Renderer(quality=Quality(samples=0)) as renderer:
            for number in (0, 7, 30, 8, 44):
                t_ns = round((number + 0.5) / 30 * 1e9)
                picture = picture_of(SceneFrame(before, t_ns, np.zeros((0, 3)), np.zeros(0)))
                image = renderer.image(picture, camera, (640, 360))
                left, top, right, bottom = box_px((0.0, 0.0), (12.0, 6.75), SCREEN)
                assert number == number_of(image[top:bottom, left:right])
    except StageError as problem:
        pytest.skip(str(problem))
