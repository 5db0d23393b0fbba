"""Areas of interest: read from every kind of file, refused by name, and hit as shapely says."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image as Files
from PIL import ImageDraw

from visavis.lab.errors import DataError, DesignError
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.area_files import read_areas
from visavis.stimuli.areas import (
    NOWHERE,
    Area,
    PlacedAreas,
    areas_at,
    areas_text,
    areas_under,
    pack_runs,
    read_areas_text,
)

SIZE = (640, 480)
SQUARE = ((100.0, 100.0), (200.0, 100.0), (200.0, 200.0), (100.0, 200.0))
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def star(rng, corners):
    """Return a polygon with notches: its corners at any distance, in order of angle."""
    at = np.sort(rng.uniform(0, 2 * np.pi, corners))
    far = rng.uniform(20, 220, corners)
    return tuple(zip(320 + far * np.cos(at), 240 + far * np.sin(at), strict=True))


@pytest.mark.parametrize("seed", range(10))
def test_points_are_in_a_polygon_exactly_where_shapely_says(seed):
    rng = np.random.default_rng(seed)
    outline = star(rng, int(rng.integers(3, 40)))
    x, y = rng.uniform(-20, 660, 10_000), rng.uniform(-20, 500, 10_000)
    expected = shapely.contains_xy(shapely.Polygon(outline), x, y)
    assert (expected == Area("star", outline).holds(x, y)).all()
    assert 0.01 < expected.mean() < 0.9


def test_points_are_in_an_ellipse_where_shapely_says():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 640, 10_000), rng.uniform(0, 480, 10_000)
    area = Area("oval", ellipse=(300.0, 200.0, 220.0, 90.0, 30.0))
    circle = shapely.Point(0, 0).buffer(1, quad_segs=4096)
    oval = shapely.affinity.scale(circle, 110, 45)
    oval = shapely.affinity.translate(shapely.affinity.rotate(oval, 30, origin=(0, 0)), 300, 200)
    assert (shapely.contains_xy(oval, x, y) == area.holds(x, y)).mean() > 0.9999
    assert area.size_px2() == pytest.approx(oval.area, rel=1e-5)


def test_distances_size_and_middle_are_those_of_shapely():
    rng = np.random.default_rng(2)
    outline = star(rng, 12)
    shape, area = shapely.Polygon(outline), Area("star", outline)
    x, y = rng.uniform(0, 640, 500), rng.uniform(0, 480, 500)
    out = ~area.holds(x, y)
    expected = shapely.distance(shape, shapely.points(x[out], y[out]))
    assert area.distances(x[out], y[out], (1, 1)) == pytest.approx(expected, abs=1e-9)
    assert area.size_px2() == pytest.approx(shape.area)
    assert area.middle() == pytest.approx((shape.centroid.x, shape.centroid.y))


def test_painted_pixels_hold_the_points_over_them():
    rng = np.random.default_rng(3)
    mask = rng.random((40, 60)) < 0.4
    mask[5] = False
    area = Area("spots", pixels=pack_runs(mask))
    x, y = rng.uniform(-3, 63, 20_000), rng.uniform(-3, 43, 20_000)
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    on = (column >= 0) & (column < 60) & (row >= 0) & (row < 40)
    expected = np.zeros(len(x), bool)
    expected[on] = mask[row[on], column[on]]
    assert (expected == area.holds(x, y)).all()
    assert area.size_px2() == mask.sum()
    boxes = shapely.union_all([shapely.box(c, r, c + 1, r + 1) for r, c in np.argwhere(mask)])
    far = shapely.distance(boxes, shapely.points(x[~expected], y[~expected]))
    assert area.distances(x[~expected], y[~expected], (1, 1)) == pytest.approx(far, abs=1e-9)


def test_the_last_of_several_areas_is_in_front_and_a_pad_goes_to_the_nearest():
    table = Area("table", SQUARE)
    cup = Area("cup", ellipse=(200.0, 150.0, 40.0, 40.0, 0.0))
    x = np.array([150.0, 195.0, 210.0, 90.0, 85.0, np.nan])
    y = np.full(6, 150.0)
    assert [0, 1, 1, NOWHERE, NOWHERE, NOWHERE] == areas_at([table, cup], x, y).tolist()
    assert [0, 1, 1, 0, NOWHERE, NOWHERE] == areas_at([table, cup], x, y, pad=12).tolist()


def test_a_ray_meets_the_pixel_that_stands_there_wherever_the_picture_is():
    turn = quat_from_yaw_pitch_deg(25.0, 10.0)
    placed = PlacedAreas(Pose(np.array([0.4, 1.3, -2.0]), turn), (1.6, 1.2), SIZE, ())
    eye = np.array([0.1, 1.2, 0.0])
    pixels = np.array([(0.0, 0.0), (640.0, 480.0), (123.0, 45.0)])
    to = np.array([placed.place_m(x, y) for x, y in pixels])
    assert to[0] == pytest.approx(placed.pose.position_m + rotate(turn, np.array([-0.8, 0.6, 0.0])))
    rays = np.concatenate([to - eye, [[0.0, 0.0, 1.0], [np.nan] * 3]])
    x, y = placed.pixels_met(np.tile(eye, (5, 1)), rays)
    assert np.stack([x, y], axis=1)[:3] == pytest.approx(pixels, abs=1e-9)
    assert np.isnan(x[3:]).all()


def test_rays_are_on_areas_by_name_padded_in_degrees():
    pose = Pose(np.array([0.0, 0.0, -1.0]), UPRIGHT)
    placed = PlacedAreas(
        pose, (0.64, 0.48), SIZE, (Area("door", SQUARE), Area("other", SQUARE[:3]))
    )
    at_m = [placed.place_m(x, 150.0) for x in (105.0, 90.0, 60.0, 195.0)]
    rays, eye = np.array(at_m), np.zeros((4, 3))
    assert [0, -1, -1, -1] == areas_under([placed], ["door"], eye, rays).tolist()
    # 10 pixels of a millimetre at a metre are 0.57 degrees
    assert [0, 0, -1, -1] == areas_under([placed], ["door"], eye, rays, 0.6).tolist()


def test_an_event_describes_areas_whole():
    pose = Pose(np.array([0.1, 1.2, -0.65]), UPRIGHT)
    areas = (
        Area("door", SQUARE, salience=2.0),
        Area("lamp", ellipse=(1.5, 2.0, 3.0, 4.0, 5.0)),
        Area("spots", pixels=pack_runs(np.eye(4, dtype=bool))),
    )
    text = areas_text([PlacedAreas(pose, (0.3, 0.2), SIZE, areas)])
    (again,) = read_areas_text(text)
    assert areas == again.areas
    assert (SIZE, (0.3, 0.2)) == (again.size_px, again.size_m)
    assert again.pose.position_m.tolist() == pose.position_m.tolist()
    with pytest.raises(DataError, match="no areas are described"):
        read_areas_text('[{"areas"')


YAML = """
door:
  polygon: [[100, 100], [200, 100], [200, 200], [100, 200]]
lamp: {ellipse: [300, 80, 60, 40], turn_deg: 10, salience: 3}
sill: {rectangle: [10, 400, 100, 20]}
window: {mask: room_mask.png, colour: "#102030"}
"""
SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 320 240">
<g><polygon id="door" points="50,50 100,50 100,100 50,100" data-salience="3"/>
<rect id="sill" x="5" y="200" width="50" height="10"/></g>
<ellipse id="lamp" cx="150" cy="40" rx="15" ry="10"/>
<path id="way" d="M 10 10 h 20 v 20 l -20,0 Z"/></svg>"""
CSV = (
    "area;x;y\n"
    + "".join(f"door;{x:g};{y:g}\n" for x, y in SQUARE)
    + "roof;0;0\nroof;9;0\nroof;0;9\n"
)


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, "utf-8")
    return folder / name


def painted(folder: Path, name: str = "room_mask.png", colour="#102030", size=SIZE) -> Path:
    picture = Files.new("RGB", size)
    ImageDraw.Draw(picture).rectangle((400, 50, 499, 149), colour)
    picture.save(folder / name)
    return folder / name


def test_areas_are_read_from_yaml(tmp_path):
    painted(tmp_path)
    door, lamp, sill, window = read_areas(write(tmp_path, "room.yaml", YAML), SIZE)
    assert (door.name, door.outline, door.salience) == ("door", SQUARE, None)
    assert (lamp.ellipse, lamp.salience) == ((300.0, 80.0, 60.0, 40.0, 10.0), 3)
    assert sill.size_px2() == 2000
    assert (window.middle(), window.size_px2()) == ((450.0, 100.0), 10_000)


def test_areas_are_read_from_svg_in_the_pictures_own_pixels(tmp_path):
    door, sill, lamp, way = read_areas(write(tmp_path, "room.svg", SVG), SIZE)
    assert (door.outline, door.salience) == (SQUARE, 3.0)
    assert sill.outline[0] == (10.0, 400.0)
    assert lamp.ellipse == (300.0, 80.0, 60.0, 40.0, 0.0)
    assert way.outline == ((20.0, 20.0), (60.0, 20.0), (60.0, 60.0), (20.0, 60.0))


def test_areas_are_read_from_a_table_of_corners_and_from_a_painting(tmp_path):
    door, roof = read_areas(write(tmp_path, "ä b.csv", CSV), SIZE)
    assert (door.outline, len(roof.outline)) == (SQUARE, 3)
    assert (door, roof) == read_areas(write(tmp_path, "mac.csv", CSV.replace("\n", "\r")), SIZE)
    (red,) = read_areas(painted(tmp_path, colour="red"), SIZE)
    assert (red.name, red.size_px2()) == ("red", 10_000)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.yaml", "", "has no areas"),
        ("a.yaml", "a: {rectangle: [600, 0, 50, 9]}", "line 1: area a reaches to .650, 0., out"),
        ("a.yaml", "\na: {rectangle: [0, 0, 9, 9]}\na: {rectangle: [1, 1, 2, 2]}", "line 3: a: "),
        ("a.yaml", "a b: {rectangle: [0, 0, 9, 9]}", "called 'a b'; columns bear its name"),
        ("a.yaml", "a: {polygon: [[0, 0], [9, 9]]}", "has 2 corners"),
        ("a.yaml", "a: {polygon: [[0, 0], [5, 5], [9, 9]]}", "is empty"),
        ("a.yaml", "a: {polygon: [[0, 0], [9, 9], [9, 0], [0, 9]]}", "crosses itself between corn"),
        ("a.yaml", "a: {polgon: [[0, 0]]}", "'polgon'; did you mean 'polygon'"),
        ("a.yaml", "a: {polygon: 7}", "in pixels"),
        ("a.yaml", "a: {ellipse: [5, 5, 0, 9]}", "is empty"),
        ("a.yaml", "a: {mask: room_mask.png, colour: red}", "no pixel .* 'red' .* #102030"),
        ("a.yaml", "a: {rectangle: [0, 0, 9, 9], salience: high}", "line 1: .* salience is 'high'"),
        ("a.yaml", "a: {rectangle: [0, 0, 9, 9], salience: 0}", "salience of a is 0; above 0"),
        ("a.yaml", "a: {mask: room_mask.png}", "line 1: area a: there is no colour ''"),
        ("a.yaml", "a: {rectangle: [0, 0, 9, 9], turn_deg: 30}", "turn_deg goes with ellipse; le"),
        ("a.yaml", "a: {rectangle: [0, 0, 9, 9], colour: red}", "colour goes with mask; leave it"),
        ("a.yaml", "a: {mask: none.png, colour: red}", "line 1: area a: there is no picture"),
        ("a.csv", "area,x\n", "no column 'y'"),
        ("a.csv", "area,x,y\na,0,0\na,1,q\n", "line 3: area a: could not convert"),
        ("a.csv", "area,x,y\na,0,0\nb,1,1\na,2,0\n", "line 4: area 'a' begins a second time"),
        ("a.svg", "<svg viewBox='0 0 640 480'><path id='a' d='M0 0 C1 1 2 2'/></svg>", "curves"),
        ("a.svg", "<svg><g transform='scale(2)'><rect id='a'/></g></svg>", "is moved by a tr"),
        ("a.svg", "<svg viewBox='0 0 100 100'><rect id='a'/></svg>", "drawn on 100 × 100"),
        ("a.svg", "<svg", "is no SVG"),
        ("a.svg", "<!DOCTYPE svg><svg/>", "without a DOCTYPE"),
        ("a.txt", "", "areas are read from"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_by_name_and_line(tmp_path, name, text, says):
    painted(tmp_path)
    with pytest.raises(DesignError, match=says) as problem:
        read_areas(write(tmp_path, name, text), SIZE)
    assert name in str(problem.value)


def test_a_missing_file_a_painting_of_another_size_and_smoothed_edges_are_refused(tmp_path):
    painted(tmp_path, "small.png", size=(600, 480))
    with pytest.raises(DesignError, match=r"did you mean 'small\.png'"):
        read_areas(tmp_path / "smal.png", SIZE)
    with pytest.raises(DesignError, match="has 600 × 480 pixels, and its picture 640 × 480"):
        read_areas(tmp_path / "small.png", SIZE)
    painted(tmp_path, "smooth.png", colour="#7f0000")
    with pytest.raises(DesignError, match=r"10000 pixels .* #7f0000, the first at \(400, 50\)"):
        read_areas(tmp_path / "smooth.png", SIZE)


def test_colours_that_can_be_painted_are_told_with_their_values(tmp_path):
    painted(tmp_path, colour="#0000ff")
    with pytest.raises(
        DesignError, match=r"paint .* white \(#ffffff\), .* blue \(#0050ff\)"
    ) as problem:
        read_areas(tmp_path / "room_mask.png", SIZE)
    assert "black" not in str(problem.value)  # is where no area is
    blue = write(tmp_path, "a.yaml", "a: {mask: room_mask.png, colour: blue}")
    with pytest.raises(
        DesignError, match=r"colour 'blue' \(#0050ff\) of area a; there are #0000ff"
    ):
        read_areas(blue, SIZE)


@pytest.mark.parametrize("rgba", [(0, 0, 0, 255), (255, 0, 0, 127), (0, 0, 0, 0)])
def test_of_a_png_on_which_nothing_counts_as_painted_is_told_why(tmp_path, rgba):
    Files.new("RGBA", SIZE, rgba).save(tmp_path / "bare.png")
    says = "bare.png has no areas: every pixel is black, or less than half opaque"
    with pytest.raises(DesignError, match=says):
        read_areas(tmp_path / "bare.png", SIZE)


def test_a_folder_in_the_place_of_a_file_is_not_proposed(tmp_path):
    (tmp_path / "room.png").mkdir()
    with pytest.raises(DesignError, match=r"room\.png; put it beside the study's file$"):
        read_areas(tmp_path / "room.png", SIZE)
