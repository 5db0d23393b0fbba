"""Flat stimuli on the page that shows a session again: their places, areas, gaze, the window."""

import base64
import io
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files

from tests.cli.viewer_tab import page_array, page_parts, viewer_tab
from tests.running.page.test_browser import faults_for_people
from tests.sessions import request_in
from visavis.analysis.gaze.aoi import LOST, NONE
from visavis.analysis.gaze.targets import GazeTargets
from visavis.cli.recorded_trial import recorded_trial
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.flat import Showing, flat_content
from visavis.cli.viewer.models import Models
from visavis.cli.viewer.page import page_of
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.geometry import Pose, rotate
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.areas import Area, KeyFrame, PlacedAreas, pack_runs
from visavis.stimuli.dressing.flat import first_sheets, monitor_of, place_of
from visavis.stimuli.dressing.picture_of import NOBODY, NOWHERE
from visavis.stimuli.flat import Dots, Shape
from visavis.stimuli.picture import Picture
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.area_measures import gaze_by_area
from visavis.study.measures import TrialRecord

STUDY = """
from visavis import Compare, Dots, Factor, Image, Shape, Study, Text, looks_at

study = Study("flat", "S", factors=[Factor("seen", ["gaze", "around gaze"])], calibrate=False,
              measures=[*looks_at("door")], compare=[Compare("door_dwell_ms", within="seen")])

@study.trial
def trial(t):
    yield t.show(Shape("rectangle", 8, colour="red", at_deg=(-4, 2)), 0.23, background="white",
                 name="square")
    yield t.show([Image("room.png", 20, areas="room.yaml"), Text("ä", at_deg=(9, 0))], 1.5)
    yield t.show(Image("room.png", 20, areas="room.yaml"), 0.5, reveal=t.seen, window_deg=5,
                 background="grey", name="covered")
    yield t.show(Dots(0.5, 90), 0.2, name="dots")
"""
WIDE_PX, HIGH_PX = 800, 600
FRAME_NS = 20_000_000
"""Longer than a frame, by which a stimulus comes later to the page's pictures than to its row."""
SIDES = {"screen": SCREEN_EXAMPLE, "headset": EXAMPLE}


@dataclass(frozen=True)
class Page:
    """A session, and its page: header and arrays."""

    study: OpenedStudy
    recording: CachedRecording
    header: dict[str, Any]
    arrays: bytes
    file: Path

    def array(self, ref: dict[str, Any]) -> np.ndarray[Any, Any]:
        """Return an array of the page; on it columns stand one after the other."""
        return page_array(self.arrays, ref)

    def picture(self, number: int) -> np.ndarray[Any, Any]:
        """Return a small picture of the page with its opacity."""
        content = self.array(self.header["textures"][number]["file"]).tobytes()
        return np.asarray(Files.open(io.BytesIO(content)).convert("RGBA"))

    def scene(self, row: Any, name: str) -> dict[str, Any]:
        """Return the scene of the page in the middle of what a trial showed under a name."""
        middle_s = self.second(row[f"{name}_on_ns"]) / 2 + self.second(row[f"{name}_off_ns"]) / 2
        scenes = self.header["scenes"]
        return next(scene for scene in scenes if scene["t0"] <= middle_s < scene["t1"])

    def second(self, t_ns: float) -> float:
        """Return the second on the page of a time of the page."""
        (part,) = self.header["parts"]
        return float(part["t0"] + (t_ns - part["started_ns"]) / 1e9)


@pytest.fixture(scope="module", params=SIDES)
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("flat")
    (folder / "flat.py").write_text(STUDY, "utf-8")
    (folder / "room.yaml").write_text(
        "door: {rectangle: [0, 0, 200, 600]}\nlamp: {ellipse: [600, 300, 200, 300]}\n", "utf-8"
    )
    Files.new("RGB", (WIDE_PX, HIGH_PX), (0, 200, 0)).save(folder / "room.png")
    study = find_study(str(folder / "flat.py"))
    about = request_in(folder, study, SIDES[request.param])
    recording = CachedRecording(perform_new(about))
    header, bundle = page_content(study, recording, list(trial_lengths_ns(recording)))
    parts = page_parts(bundle.text(header))
    (folder / "flat.html").write_text(page_of(header, bundle), "utf-8")
    return Page(study, recording, *parts, folder / "flat.html")


def corners_m(at: Any, turn: Any, size: Any) -> np.ndarray[Any, Any]:
    half = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    return np.array(at) + rotate(np.array(turn), half * [*size, 0.0])


@pytest.mark.parametrize("name", ["square", "stimulus", "covered", "dots"])
def test_a_stimulus_stands_on_the_page_where_it_was_staged(page: Page, name: str) -> None:
    for _, row in page.recording.trials().iterrows():
        trial = recorded_trial(page.recording, str(row["trial_id"]))
        moment = trial.shown_at(int(row[f"{name}_on_ns"] + row[f"{name}_off_ns"]) // 2)
        scene = next(iter(page.study.views_of(moment))).scene
        assert isinstance(scene, FlatScene)
        monitor, flat = monitor_of(scene), page.scene(row, name)["flat"]
        places = [place_of(item, scene)[:2] for item in scene.items]
        in_scene = [(monitor.pose, monitor.size_m), *places] if monitor is not None else places
        assert len(in_scene) == len(flat["sheets"])
        for (pose, size_m), sheet in zip(in_scene, flat["sheets"], strict=True):
            staged = corners_m(pose.position_m, pose.orientation_wxyz, size_m)
            assert np.array_equal(staged, corners_m(sheet["at"], sheet["turn"], sheet["size"]))
        assert ["moving" in sheet for sheet in flat["sheets"][-1:]] == [name == "dots"]
        assert ("window" in flat) is (name == "covered")
        if name == "covered":
            wanted_window = {"deg": 5, "isAround": row["seen"] == "around gaze"}
            assert wanted_window == flat["window"]


def test_a_picture_that_is_another_one_now_is_named_where_it_was_shown(
    page: Page, tmp_path: Path
) -> None:
    folder = page.study.study.files.folder
    for name in ("flat.py", "room.yaml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    Files.new("RGB", (WIDE_PX, HIGH_PX), (200, 0, 0)).save(tmp_path / "room.png")
    study, trial_id = find_study(str(tmp_path / "flat.py")), next(iter(page.header["trials"]))["id"]
    header, _ = page_content(study, page.recording, [trial_id])
    notes = [scene["flat"]["notes"] for scene in header["scenes"] if scene.get("flat")]
    words = ["room.png is another file now than was shown"]
    assert [[], words, words, []] == notes
    assert not any(s["flat"]["notes"] for s in page.header["scenes"] if s.get("flat"))


def test_stimuli_are_there_from_the_frame_of_their_onset_to_that_of_their_end(
    page: Page,
) -> None:
    frame_s = float(np.median(np.diff(page.recording.stream_arrays("frames")["t_host_ns"]))) / 1e9
    for _, row in page.recording.trials().iterrows():
        for name in ("square", "stimulus", "covered"):
            scene = page.scene(row, name)
            assert abs(scene["t0"] - page.second(row[f"{name}_on_ns"])) < 1.1 * frame_s
            assert abs(scene["t1"] - page.second(row[f"{name}_off_ns"])) < 1.1 * frame_s
    for scene, after in zip(page.header["scenes"], page.header["scenes"][1:], strict=False):
        assert scene["t1"] == after["t0"] or scene["trial"] != after["trial"]


def test_each_picture_is_there_once_small_and_in_its_colours(page: Page) -> None:
    rows = [row for _, row in page.recording.trials().iterrows()]
    numbers = {page.scene(row, "square")["flat"]["sheets"][-1]["picture"] for row in rows}
    numbers |= {page.scene(row, "stimulus")["flat"]["sheets"][-2]["picture"] for row in rows}
    red, green = sorted(numbers)
    assert (page.picture(red) == [255, 0, 0, 255]).all()
    assert (page.picture(green) == [0, 200, 0, 255]).all()
    pictures = [n for n, t in enumerate(page.header["textures"]) if t.get("flat")]
    contents = Counter(page.picture(n).tobytes() for n in pictures)
    assert {1} == set(contents.values())
    assert max(max(page.picture(n).shape) for n in pictures) <= 512


def test_gaze_is_on_the_areas_on_which_it_is_measured(page: Page) -> None:
    counts: Counter[str] = Counter()
    targets = GazeTargets.from_columns(page.recording.stream_arrays("gaze_targets"))
    for (_, row), ends in zip(
        page.recording.trials().iterrows(), page.header["gazeEnds"], strict=True
    ):
        measured = gaze_by_area(
            TrialRecord({str(k): v for k, v in row.items()}, page.recording, targets),
            "stimulus",
            0.0,
        )
        assert measured is not None
        t_s = np.cumsum(page.array(ends["t"])) / 1e6
        on = dict(zip(np.rint(1e5 * t_s).astype(int), page.array(ends["on"]), strict=True))
        inside_ns = range(measured.window[0] + FRAME_NS, measured.window[1] - FRAME_NS)
        for t_ns, area in zip(measured.samples.t_ns, measured.area, strict=True):
            key = int(np.rint(1e5 * page.second(int(t_ns))))
            if area != LOST and key in on and int(t_ns) in inside_ns:
                name = ends["names"][on[key]]
                counts[name] += 1
                area_name = None if area == NONE else measured.names[area]
                assert area_name == (name if name in measured.names else None), (t_ns, name)
    assert {"door", "lamp"} & set(counts)
    assert 100 < counts.total()


def test_gaze_ends_on_what_stands_there(page: Page) -> None:
    for ends in page.header["gazeEnds"]:
        assert {"stimulus", "door", "lamp"} & set(ends["names"])
        assert set(ends["names"]) <= {"", "stimulus", "screen", "door", "lamp"}
        assert ("screen" in ends["names"]) <= any("eye" in s["flat"] for s in page.header["scenes"])


def test_an_area_that_moves_is_where_it_is_and_one_that_is_gone_nowhere() -> None:
    pose = Pose(np.array([0.0, 1.0, -2.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    square = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0))
    later = tuple((x + 40.0, y) for x, y in square)
    moving = Area("ball", keys=(KeyFrame(0.0, square), KeyFrame(1.0, later)))
    areas = (moving, Area("still", square))
    sheet = PlacedAreas(pose, (1.0, 1.0), (100, 100), areas, end_s=3.0)
    scene = FlatScene("flat", (), items=(Dots(seed=1), Shape("cross")))
    bundle, picture = Bundle(), Picture(0, NOWHERE, (), NOBODY, sheets=first_sheets(scene)[1])
    flat = flat_content(
        Showing(scene, (sheet,)),
        [0, 500_000_000, 2_000_000_000],
        [picture] * 3,
        Models(bundle, level=1),
        bundle,
    )
    raw = zlib.decompress(base64.b64decode(bundle.text({})))
    page = Page(None, None, {}, raw[16:], Path())  # type: ignore[arg-type]
    ball, still = (page.array(area["corners"]) for area in flat["areas"])
    assert np.allclose([[-0.5, 1.5, -2.0], [-0.3, 1.5, -2.0]], ball[:2, 0])
    assert np.isnan(ball[2]).all()
    assert (1, 3, 3) == still.shape


def test_a_painted_area_has_the_outlines_of_its_pixels_on_its_picture() -> None:
    pose = Pose(np.array([0.0, 1.0, -2.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    mask = np.zeros((100, 100), np.bool_)
    mask[20:80, 20:80] = True
    mask[40:60, 40:60] = False
    speck = np.zeros((100, 100), np.bool_)
    speck[50, 50] = True
    areas = tuple(Area(name, pixels=pack_runs(m)) for name, m in (("a", mask), ("b", speck)))
    sheet = PlacedAreas(pose, (1.0, 1.0), (100, 100), areas, end_s=3.0)
    scene = FlatScene("flat", (), items=(Shape("cross"),))
    bundle = Bundle()
    flat = flat_content(
        Showing(scene, (sheet,)),
        [0],
        [Picture(0, NOWHERE, (), NOBODY)],
        Models(bundle, level=1),
        bundle,
    )
    raw = zlib.decompress(base64.b64decode(bundle.text({})))
    page = Page(None, None, {}, raw[16:], Path())  # type: ignore[arg-type]
    assert [[4, 4], [1]] == [area["outlines"] for area in flat["areas"]]
    around, point = (page.array(area["corners"])[0] for area in flat["areas"])
    for corners, half_m in ((around[:4], 0.3), (around[4:], 0.1)):
        assert np.allclose(half_m, np.abs(corners[:, 0]))
        assert np.allclose(half_m, np.abs(corners[:, 1] - 1.0))
    assert np.allclose([[0.005, 0.995, -2.0]], point)


@pytest.fixture(scope="module")
def tab(page: Page, playwright: Any) -> Iterator[Any]:
    with viewer_tab(playwright, page.file, 1000, 700) as (window, problems):
        yield window
    assert [] == problems


COLOUR = """([t, x, y]) => { viewer.setCamera('eyes'); viewer.show.gaze = false; viewer.seek(t);
    viewer.draw(); const s = viewer.sceneAt(t).data.flat.sheets.at(-1), gl = viewer.drawing.gl,
        w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, p = new Uint8Array(4),
        at = add(s.at, rotate(s.turn, [x * s.size[0], y * s.size[1], 0])),
        q = viewer.project(viewer.view(viewer.sceneAt(t), w, h), at, w, h);
    gl.readPixels(Math.floor(q[0]), Math.floor(h - q[1]), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, p);
    viewer.show.gaze = true; return [...p]; }"""
"""The colour on the canvas of a place on the stimulus in front, in parts of its size."""


@pytest.mark.slow  # a browser
def test_a_browser_draws_a_stimulus_in_its_colour_at_its_place(tab: Any, page: Page) -> None:
    row = page.recording.trials().iloc[0]
    t_s = page.scene(row, "square")["t0"] + 0.1
    for x, y in ((0.0, 0.0), (-0.45, 0.45), (0.45, -0.45)):
        assert [255, 0, 0, 255] == tab.evaluate(COLOUR, [t_s, x, y])
    assert [255, 255, 255, 255] == tab.evaluate(COLOUR, [t_s, 0.6, 0.0])
    t_s = page.scene(row, "covered")["t0"] + 0.2
    assert [0, 200, 0, 255] == tab.evaluate(COLOUR, [t_s, 0.4, 0.4])
    assert [128, 128, 128, 255] == tab.evaluate(COLOUR, [t_s, 0.0, 0.55])


@pytest.mark.slow  # a browser
def test_areas_are_outlined_where_asked_and_a_click_says_how_long_they_were_looked_at(
    tab: Any, page: Page
) -> None:
    row = page.recording.trials().iloc[0]
    t_s = page.scene(row, "stimulus")["t0"] + 0.5
    names, tip, about = tab.evaluate(
        """t => { viewer.setCamera('eyes'); viewer.seek(t); viewer.draw();
        const [door] = viewer.outlines[0].paths, middle = [0, 1].map(a => door.reduce((s, p) =>
            s + p[a], 0) / door.length), tip = viewer.under(...middle).text;
        viewer.click(...middle);
        return [viewer.outlines.map(o => o.name), tip, viewer.about.name]; }""",
        t_s,
    )
    assert (["door", "lamp"], "door") == (names, about)
    assert tip.startswith("door: ")
    tab.keyboard.press("o")
    assert [] == tab.evaluate("(viewer.draw(), viewer.outlines)")
    tab.keyboard.press("o")


RING = """t => { viewer.seek(t); viewer.setCamera('eyes'); const scene = viewer.sceneAt(t),
        s = scene.data.flat.sheets.at(-1), stage = document.getElementById('stage'),
        place = (x, y) => add(s.at, rotate(s.turn, [x * s.size[0], y * s.size[1], 0])),
        square = r => [[-r, -r], [r, -r], [r, r], [-r, r]].map(([x, y]) => place(x, y));
    scene.flat.areas.push({name: 'ring', at: () => [...square(0.4), ...square(0.1)].flat(),
        outlines: [4, 4]});
    viewer.draw();
    const names = [0, 0.3, 0.45].map(x => { const w = stage.clientWidth, h = stage.clientHeight,
        p = viewer.project(viewer.view(scene, w, h), place(x, 0), w, h);
        return viewer.under(p[0], p[1])?.key?.name; });
    scene.flat.areas.pop();
    return names.map(name => name === 'ring'); }"""
"""Whether the middle, the rim and the outside of a painted ring are found to be of it."""


@pytest.mark.slow  # a browser
def test_a_hole_in_a_painted_area_is_none_of_it(tab: Any, page: Page) -> None:
    row = page.recording.trials().iloc[0]
    t_s = page.scene(row, "square")["t0"] + 0.1
    assert [False, True, False] == tab.evaluate(RING, t_s)


@pytest.mark.slow  # a browser
def test_the_window_is_a_circle_of_its_width_around_what_is_looked_at(tab: Any, page: Page) -> None:
    windows = page.recording.stream_arrays("gaze_window")
    row = page.recording.trials().iloc[0]
    inside = (windows["t_host_ns"] > row["covered_on_ns"] + 50_000_000) & windows["valid"]
    k = int(np.flatnonzero(inside)[0])
    eye, along, rim = tab.evaluate(
        """t => { viewer.seek(t); viewer.draw(); const read = n => viewer.streams.at('gaze_window',
        n, t, 0.1), eye = read('origin_world_m'), along = read('direction_world');
        return [eye, along, viewer.sceneAt(t).flat.rim(eye, unit(along))]; }""",
        page.second(int(windows["t_host_ns"][k])) + 1e-4,
    )
    assert np.allclose(windows["direction_world"][k], along, atol=1e-3)
    rays = np.array(rim) - eye
    cosines = rays @ along / np.linalg.norm(rays, axis=1) / np.linalg.norm(along)
    assert np.allclose(2.5, np.degrees(np.arccos(cosines)), atol=1e-3)
    assert "window after gaze" in tab.inner_text("#legend")
    assert "moving dots and films: 20 pictures a second" in tab.inner_text("#legend")


@pytest.mark.slow  # a browser
def test_a_page_with_stimuli_shuts_nobody_out(tab: Any) -> None:
    assert [] == faults_for_people(tab)
