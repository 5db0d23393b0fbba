"""Files of panoramas and of their areas: what is read, and what is refused by name."""

import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Files

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, direction_from_yaw_pitch_deg, quat_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stimuli.area_files import read_areas
from visavis.stimuli.areas import Area, SurroundingAreas, areas_text, areas_under, read_areas_text
from visavis.stimuli.film_file import FilmFacts
from visavis.stimuli.flat import Panorama
from visavis.stimuli.flat_pixels import read_picture
from visavis.stimuli.panorama_pixels import eye_size_px, panorama_pixels
from visavis.stimuli.view_turns import SPEED_DEG_PER_S, ViewTurns, read_turns

SIZE = (2048, 1024)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
FRAME_NS = 16_666_667


def saved(path, size_px=SIZE, mode="RGB", **how):
    Files.new(mode, size_px).save(path, **how)
    return path


def lying(path):
    exif = Files.Exif()
    exif[0x0112] = 6
    return saved(path, (1024, 2048), exif=exif)


def cut(path):
    noise = np.random.default_rng(1).integers(0, 256, (*SIZE[::-1], 3), dtype=np.uint8)
    Files.fromarray(noise).save(path)
    path.write_bytes(path.read_bytes()[:300_000])


@pytest.mark.parametrize(
    ("name", "save", "says"),
    [
        ("none.png", lambda p: None, "there is no picture .*none.png"),
        ("flat.png", lambda p: saved(p, (2048, 1152)), "2048 × 1152 pixels; .* twice as wide"),
        ("square.png", lambda p: saved(p, (2048, 2048)), 'With stereo="top-bottom" it would be'),
        ("broad.png", lambda p: saved(p, (4096, 1024)), 'With stereo="left-right" it would be'),
        ("small.png", lambda p: saved(p, (1024, 512)), "1024 pixels wide .* 2048 at least"),
        ("print.jpg", lambda p: saved(p, mode="CMYK"), "colours for print"),
        ("deep.png", lambda p: saved(p, mode="I;16"), "more than 8 bits"),
        ("lying.jpg", lying, "lies on its side .* turn it upright"),
        ("cut.png", cut, "is damaged"),
        ("text.png", lambda p: p.write_text("no picture"), "no picture that can be read"),
    ],
)
def test_a_file_that_is_no_panorama_is_named_with_what_to_do(tmp_path, name, save, says):
    save(tmp_path / name)
    with pytest.raises(DesignError, match=says):
        panorama_pixels(Panorama(name), tmp_path)


def test_of_a_wrong_stereo_picture_what_each_eye_would_have_is_said(tmp_path):
    saved(tmp_path / "mono.png")
    with pytest.raises(DesignError, match="2048 × 512 for each eye"):
        eye_size_px(Panorama("mono.png", "top-bottom"), tmp_path)


def test_colours_of_16_bits_are_refused_and_not_read_as_8(tmp_path):
    """Pillow cannot write them: a PNG of one pixel, by hand."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", 1, 1, 16, 2, 0, 0, 0)
    data = zlib.compress(b"\0" + bytes(6))
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
    (tmp_path / "deep.png").write_bytes(b"\x89PNG\r\n\x1a\n" + parts)
    with pytest.raises(DesignError, match="more than 8 bits"):
        read_picture(tmp_path / "deep.png")


def test_each_eye_has_its_half_and_a_file_is_decoded_once(tmp_path):
    both = np.zeros((2048, 2048, 3), np.uint8)
    both[:1024], both[1024:] = 10, 200
    Files.fromarray(both).save(tmp_path / "both.png")
    panorama = Panorama("both.png", "top-bottom")
    pixels = panorama_pixels(panorama, tmp_path)
    assert SIZE == eye_size_px(panorama, tmp_path)
    assert [10, 200] == [int(eye.max()) for eye in pixels.eyes]
    assert pixels is panorama_pixels(panorama, tmp_path)


@pytest.mark.parametrize(
    ("how", "says"),
    [({"stereo": "top-botom"}, "did you mean '?top-bottom"), ({"yaw_deg": 400}, "-360 to 360")],
)
def test_a_value_that_is_not_possible_is_refused(how, says):
    with pytest.raises(DesignError, match=says):
        Panorama("a.png", **how)


# ---- areas ----


def around(*areas, yaw_deg=0.0, turns=None):
    pose = Pose(np.array([0.0, 1.2, 0.0]), quat_from_yaw_pitch_deg(40.0))
    more = {} if turns is None else {"turns": turns}
    return SurroundingAreas(pose, yaw_deg, SIZE, areas, **more)


def looking(one, right_deg, up_deg, names, pad_deg=0.0, t_ns=None):
    """Return the areas met by looks so far to the right of straight ahead, and upwards."""
    direction = direction_from_yaw_pitch_deg(40.0 - np.array(right_deg), np.array(up_deg))
    eyes_m = np.zeros_like(direction)
    under = areas_under([one], names, eyes_m, direction, pad_deg, t_ns)
    return [names[k] if k >= 0 else "" for k in under.tolist()]


def read(path, text):
    path.write_text(text, "utf-8")
    return read_areas(path, SIZE, is_around=True)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.yaml", "door: {rectangle: [20, 30, 40, 50]}\nback: {ellipse: [180, 0, 20, 40]}\n"),
        (
            "a.csv",
            "area,yaw_deg,pitch_deg\ndoor,20,30\ndoor,60,30\ndoor,60,-20\ndoor,20,-20\n"
            "back,170,20\nback,190,20\nback,190,-20\nback,170,-20\n",
        ),
    ],
)
def test_areas_in_degrees_are_where_they_say_and_reach_across_the_edge(tmp_path, name, text):
    one = around(*read(tmp_path / name, text))
    found = looking(
        one, [40, 61, 22, 22, 179, -179, 168], [0, 0, 29, -22, 0, 5, 0], ["door", "back"]
    )
    assert ["door", "", "door", "", "back", "back", ""] == found


def test_what_is_straight_ahead_at_first_is_yaw_deg(tmp_path):
    areas = read(tmp_path / "a.yaml", "door: {rectangle: [20, 30, 40, 50]}")
    assert ["door", ""] == looking(around(*areas, yaw_deg=40.0), [0, 40], [0, 0], ["door"])


@pytest.mark.parametrize("up_deg", [0.0, 60.0])
def test_padding_is_in_degrees_of_the_eye_at_every_height(up_deg):
    high = (0.5 - up_deg / 180) * SIZE[1]
    left, right = SIZE[0] / 2 - 10, SIZE[0] / 2
    outline = ((left, high - 20), (right, high - 20), (right, high + 20), (left, high + 20))
    one = around(Area("spot", outline))
    yaw_of_2_deg = 2.0 / np.cos(np.radians(up_deg))
    where = [0.9 * yaw_of_2_deg, 1.1 * yaw_of_2_deg]
    assert ["spot", ""] == looking(one, where, [up_deg, up_deg], ["spot"], pad_deg=2.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: {rectangle: [0, 100, 10, 10]}", "from -90 to 90 upwards"),
        ("a: {rectangle: [-200, 10, 370, 10]}", "360 degrees wide at most"),
        ("a: {rectangle: [350, 10, 30, 10]}", "yaws from -360 to 360"),
        ("a: {mask: m.png, colour: red}", "a mask of a panorama is a PNG of its own"),
        ("a: {rectangle: [0, 10]}", "of a panorama in degrees"),
    ],
)
def test_an_area_that_does_not_fit_around_is_named(tmp_path, text, says):
    with pytest.raises(DesignError, match=f"line 1: area a.*{says}"):
        read(tmp_path / "a.yaml", text)


def test_a_table_in_pixels_is_refused_for_a_panorama(tmp_path):
    with pytest.raises(DesignError, match=r"no column 'yaw_deg'; .* area, yaw_deg and pitch_deg"):
        read(tmp_path / "a.csv", "area,x,y\na,1,1\na,2,1\na,2,2\n")


def test_areas_around_are_read_back_from_an_event(tmp_path):
    areas = read(tmp_path / "a.yaml", "back: {ellipse: [180, 0, 20, 40]}")
    (again,) = read_areas_text(areas_text([around(*areas, yaw_deg=15.0)]))
    assert (15.0, SIZE, areas) == (again.yaw_deg, again.size_px, again.areas)
    assert ["back", ""] == looking(again, [165, 180], [0, 25], ["back"])


FILM = FilmFacts(SIZE, np.arange(40) / 10, 4.0, False, 0.0)
SINCE_NS = 7_000_000_000
BALLOON = """balloon:
  keys: [{t_s: 1, rectangle: [160, 5, 20, 10]}, {t_s: 3, rectangle: [200, 45, 20, 10]}]
"""
"""It goes 20 degrees a second across the picture's edge, and as many upwards."""
BALLOON_TABLE = """area,t_s,yaw_deg,pitch_deg
balloon,1,160,5
balloon,1,180,5
balloon,1,180,-5
balloon,1,160,-5
balloon,3,200,45
balloon,3,220,45
balloon,3,220,35
balloon,3,200,35
"""


@pytest.mark.parametrize(("name", "text"), [("a.yaml", BALLOON), ("a.csv", BALLOON_TABLE)])
def test_gaze_is_on_an_area_where_that_is_at_its_time_in_the_film(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    areas = read_areas(tmp_path / name, SIZE, is_around=True, film=FILM)
    pose = Pose(np.array([0.0, 1.2, 0.0]), quat_from_yaw_pitch_deg(40.0))
    (one,) = read_areas_text(
        areas_text([SurroundingAreas(pose, 0.0, SIZE, areas, since_ns=SINCE_NS, end_s=3.9)])
    )
    t_s = np.array([0.9, 1.1, 1.1, 2.0, 2.0, 2.0, 2.9, 3.1])
    yaw_deg = [170, 172, -172, 190, -170, 171, -152, -150]
    pitch_deg = [0, 2, 2, 20, 20, 20, 38, 40]
    on = ["", "balloon", "", "balloon", "balloon", "", "balloon", ""]
    t_ns = SINCE_NS + np.round(t_s * 1e9).astype(np.int64)
    assert on == looking(one, yaw_deg, pitch_deg, ["balloon"], t_ns=t_ns)
    assert [True, False] == [one.areas_now(t)[0] is None for t in t_ns[[0, 1]].tolist()]


def test_an_area_of_a_picture_around_has_no_key_frames(tmp_path):
    with pytest.raises(DesignError, match=r"area balloon .* for films: .* or the Panorama of a"):
        read(tmp_path / "a.yaml", BALLOON)


@pytest.mark.parametrize(
    ("size_px", "stereo", "says"),
    [
        ((1920, 960), "none", None),
        ((1918, 959), "none", "1918 pixels wide for an eye; a panorama has 1920 at least"),
        ((4096, 2048), "none", None),
        ((4098, 2049), "none", "4098 pixels wide for an eye; .* 4096 at most"),
        ((8192, 2048), "left-right", None),
        ((4096, 4096), "top-bottom", None),
        ((8194, 2048), "left-right", "8194 × 2048 pixels; up to 8192 each way"),
        ((3840, 1920), "top-bottom", 'With stereo="none" it would be'),
    ],
)
def test_a_film_around_has_so_many_pixels_for_each_eye(
    tmp_path, monkeypatch, size_px, stereo, says
):
    (tmp_path / "a.mp4").write_bytes(b"")
    monkeypatch.setattr(
        "visavis.stimuli.film_file._facts", lambda *_: replace(FILM, size_px=size_px)
    )
    if says is None:
        across = 2 if stereo == "left-right" else 1
        assert size_px[0] == across * eye_size_px(Panorama("a.mp4", stereo), tmp_path)[0]
    else:
        with pytest.raises(DesignError, match=says):
            eye_size_px(Panorama("a.mp4", stereo), tmp_path)


@pytest.mark.parametrize("controls", [(), ("right", "right", "right", "up")])
def test_a_place_is_where_its_own_direction_meets_it(controls):
    turns = ViewTurns(FRAME_NS)
    for control in controls:
        turns.press(control, 0)
    one, later_ns = around(yaw_deg=25.0, turns=turns), 10**10
    offset_m = one.place_m(300.0, 700.0, turns.at(later_ns)) - one.pose.position_m
    x, y = one.pixels_met(offset_m[None] / np.linalg.norm(offset_m), np.array([later_ns]))
    assert [300.0, 700.0] == pytest.approx([x[0], y[0]])


def test_who_looks_beside_the_screen_sees_nothing_of_what_it_would_show_there():
    below = Area("below", ((900.0, 620.0), (1148.0, 620.0), (1148.0, 1000.0), (900.0, 1000.0)))
    turns = ViewTurns(FRAME_NS)
    turns.press("down", 0)
    whole = around(below, turns=turns)
    flat = FlatScreen(0.531, 0.299, 1920, 1080, 0.65)  # 13 degrees up and down
    on_screen = replace(whole, screen=PlacedScreen(flat, whole.pose))
    gaze = direction_from_yaw_pitch_deg(np.array([40.0, 40.0, 40.0]), np.array([-30.0, 0.0, -12.0]))
    eyes_m, begin_ns = np.broadcast_to(whole.pose.position_m, gaze.shape), np.zeros(3, np.int64)
    times_ns = begin_ns, begin_ns + 10**10  # 30 degrees further down
    under = [
        areas_under([one], ["below"], eyes_m, gaze, t_ns=t_ns)
        for one in (whole, on_screen)
        for t_ns in times_ns
    ]
    assert [[0, -1, -1], [0, 0, 0], [-1, -1, -1], [-1, 0, 0]] == [u.tolist() for u in under]


# ---- turning the view ----


def test_a_press_turns_the_view_by_thirty_degrees_at_one_speed():
    turns = ViewTurns(FRAME_NS)
    assert turns.press("right", 0)
    step_deg = FRAME_NS / 1e9 * SPEED_DEG_PER_S
    assert (0.0, 0.0) == turns.at(FRAME_NS // 2)  # a display changes from frame to frame
    assert (step_deg, 0.0) == pytest.approx(turns.at(FRAME_NS))
    assert (step_deg, 0.0) == pytest.approx(turns.at(2 * FRAME_NS - 1_000_000))
    assert (30.0, 0.0) == pytest.approx(turns.at(FRAME_NS * 60))


def test_presses_add_up_and_the_view_never_goes_over_the_top():
    turns = ViewTurns(FRAME_NS)
    assert [True, True, True, True, False, False] == [
        turns.press(control, k) for k, control in enumerate(["left", "left", "up", "up", "up", "f"])
    ]
    assert (-60.0, 60.0) == pytest.approx(turns.at(10**10))


def test_turns_are_the_same_from_their_events():
    turns = ViewTurns(FRAME_NS)
    for t_ns, control in ((0, "right"), (5 * FRAME_NS, "up"), (9 * FRAME_NS, "left")):
        turns.press(control, t_ns)
    again = read_turns([turn.as_event(FRAME_NS) for turn in turns.turns])
    t_ns = np.arange(0, 10**9, 3_000_000)
    assert turns.course(t_ns).tolist() == again.course(t_ns).tolist()
