"""Flat stimuli of a page in a browser, seen again: where and when they were in its window."""

import base64
import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files
from typer.testing import CliRunner

from tests.cli.viewer_tab import page_array, viewer_tab
from visavis.cli.app import app
from visavis.cli.recorded_trial import trial_row
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.content import page_content, times_of
from visavis.cli.viewer.flat_pages import flat_page_scenes
from visavis.cli.viewer.models import Models
from visavis.cli.viewer.page import page_of
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.page import seen_trial as seen
from visavis.running.page.perform import perform_new
from visavis.running.page.seen_trial import SeenTrial, seen_trial
from visavis.running.page.visitor import DISTANCE_MM, PX_PER_MM, VIEW_PX
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import settle, study_of_session, wanted_settings

STUDY = """
from visavis import Factor, Image, Keys, Rating, Shape, Study, Text, pointer_at

study = Study("paged", "S", factors=[Factor("side", ["left"])], on="browser", uses=(),
              calibrate=False, measures=[*pointer_at("door")])

@study.trial
def trial(t):
    yield t.show(Shape("rectangle", 6, colour="red", at_deg=(-4, 2)), 0.5, background="white",
                 name="square")
    yield t.show(Shape("rectangle", 8, 2, colour="blue", at_deg=(16, 0)), 0.25, name="cut")
    yield t.wait(0.25)
    yield t.show(Image("room.png", 12, areas="room.yaml"), 0.5, name="plain")
    yield t.show(Image("room.png", 12, areas="room.yaml"), until=Keys("f", "j"), limit_s=2,
                 reveal="pointer", window_deg=3, name="revealed")
    yield t.ask(Rating("liked", 1, 7))
"""
DOOR_PX = [20, 60, 120, 230]
AREAS = f"door: {{rectangle: {DOOR_PX}}}\nlamp: {{ellipse: [300, 100, 80, 60], salience: 9}}\n"
DISTANCE_PX = PX_PER_MM * DISTANCE_MM


@dataclass(frozen=True)
class Page:
    """A session on a page, and the page that shows it again: header and arrays."""

    study: OpenedStudy
    recording: CachedRecording
    row: dict[str, Any]
    header: dict[str, Any]
    arrays: bytes
    file: Path

    def array(self, ref: dict[str, Any]) -> np.ndarray[Any, Any]:
        return page_array(self.arrays, ref)

    def second(self, t_ns: float) -> float:
        (part,) = self.header["parts"]
        return float(part["t0"] + (t_ns - part["started_ns"]) / 1e9)

    def scene(self, name: str) -> dict[str, Any]:
        """Return the scene of what the trial showed under a name."""
        on_s = self.second(self.row[f"{name}_on_ns"])
        return next(s for s in self.header["scenes"] if abs(s["t0"] - on_s) < 1e-5)


def write_study(folder: Path, text: str = STUDY) -> OpenedStudy:
    (folder / "paged.py").write_text(text, "utf-8")
    (folder / "room.yaml").write_text(AREAS, "utf-8")
    Files.new("RGB", (400, 300), (0, 200, 0)).save(folder / "room.png")
    study = find_study(str(folder / "paged.py"))
    assert isinstance(study, OpenedStudy)
    return study


def perform_in(folder: Path, study: OpenedStudy) -> CachedRecording:
    config = load_config(EXAMPLE).model_copy(
        update={"data_root": folder / "data", "key_root": folder / "keys"}
    )
    about = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    return CachedRecording(perform_new(about))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("paged")
    study = write_study(folder)
    recording = perform_in(folder, study)
    row = trial_row(recording, "T01")
    header, bundle = page_content(study, recording, ["T01"])
    raw = zlib.decompress(base64.b64decode(bundle.text(header)))
    begin = 8 + int.from_bytes(raw[:8], "little")
    (folder / "paged.html").write_text(page_of(header, bundle), "utf-8")
    header = json.loads(raw[8:begin])
    return Page(study, recording, row, header, raw[begin:], folder / "paged.html")


def seen_again(page: Page, study: OpenedStudy | None = None) -> SeenTrial:
    return seen_trial(study or page.study, page.recording, page.row)


def scenes_of(page: Page, trial: SeenTrial) -> list[dict[str, Any]]:
    bundle = Bundle()
    times = times_of(page.recording)
    return flat_page_scenes(page.recording, trial, Models(bundle, level=1), bundle, times)


def pixels(place_m: Any) -> np.ndarray[Any, Any]:
    """Return places (n, 3) before the eyes as pixels of the window."""
    x, y, z = np.array(place_m, np.float64).reshape(-1, 3).T
    at_px = np.stack([x, -y], axis=1) / -z[:, None] * DISTANCE_PX
    return at_px + np.array(VIEW_PX) / 2


def edges_px(sheet: dict[str, Any]) -> list[float]:
    """Return left, top, right and bottom of an upright sheet in pixels of the window."""
    at, half = np.array(sheet["at"]), np.array([*sheet["size"], 0.0]) / 2
    corners = pixels([at + half * [-1, 1, 0], at + half * [1, -1, 0]])
    return [float(v) for v in corners.ravel()]


def box_of(at_deg: tuple[float, float], size_deg: tuple[float, float]) -> list[int]:
    """Return what a page's own code makes of angles: whole pixels along each axis."""
    right, up = (
        [DISTANCE_PX * np.tan(np.radians(at + sign * size / 2)) for sign in (-1, 1)]
        for at, size in zip(at_deg, size_deg, strict=True)
    )
    wide, high = VIEW_PX
    edges = wide / 2 + right[0], high / 2 - up[1], wide / 2 + right[1], high / 2 - up[0]
    return [round(v) for v in edges]


def test_each_stimulus_is_there_from_its_onset_to_its_end_as_recorded(page: Page) -> None:
    scenes, row = page.header["scenes"], page.row
    spans_s = [(scene["t0"], scene["t1"]) for scene in scenes]
    assert 5 == len(scenes)  # with what t.wait left there
    for name in ("square", "plain", "revealed"):
        on_s, off_s = (page.second(row[f"{name}_{end}_ns"]) for end in ("on", "off"))
        assert any(np.allclose((on_s, off_s), span, atol=2e-6) for span in spans_s), name
    (cut, waits) = scenes[1:3]
    assert page.second(row["cut_on_ns"]) == pytest.approx(cut["t0"], abs=2e-6)
    assert page.second(row["cut_off_ns"]) == pytest.approx(waits["t1"], abs=2e-6)
    assert ["liked: from 1 (low) to 7 (high)"] == [
        q["prompt"] for step in page.header["pages"] for q in step["questions"]
    ]


def test_each_stimulus_is_on_the_pixels_of_the_window_on_which_the_page_drew_it(
    page: Page,
) -> None:
    window, square = page.scene("square")["flat"]["sheets"]
    assert [0, 0, *VIEW_PX] == pytest.approx(edges_px(window))
    assert box_of((-4, 2), (6, 6)) == pytest.approx(edges_px(square), abs=1e-6)
    assert ["window 1280 × 800 px; 39.6 px per degree"] == page.scene("square")["flat"]["notes"]


def test_what_reached_beyond_the_window_is_cut_at_its_edge(page: Page) -> None:
    _, bar = page.scene("cut")["flat"]["sheets"]
    left, top, right, bottom = box_of((16, 0), (8, 2))
    assert VIEW_PX[0] < right
    assert [left, top, VIEW_PX[0], bottom] == pytest.approx(edges_px(bar), abs=1e-6)


@pytest.mark.parametrize("name", ["plain", "revealed"])
def test_areas_of_interest_lie_on_the_picture_by_name(page: Page, name: str) -> None:
    flat = page.scene(name)["flat"]
    assert ["door", "lamp"] == [area["name"] for area in flat["areas"]]
    corners = pixels(page.array(flat["areas"][0]["corners"])[0])
    left, top, right, bottom = box_of((0, 0), (12, 9))
    x, y, wide, high = DOOR_PX
    shares = np.array([[x, y], [x + wide, y + high]]) / [400, 300]
    wanted_px = np.array([left, top]) + shares * [right - left, bottom - top]
    assert np.allclose(wanted_px, [corners.min(axis=0), corners.max(axis=0)], atol=0.01)


def test_areas_that_the_recording_has_not_are_said_to_be_those_of_today(page: Page) -> None:
    today = "areas of interest: by the study's files today"
    assert today in page.scene("plain")["flat"]["notes"]
    assert today not in page.scene("revealed")["flat"]["notes"]


def test_the_window_is_where_the_recorded_pointer_was(page: Page) -> None:
    events = page.recording.events()
    (event,) = events.loc[events["name"] == "pointer_window", "payload"]
    path = json.loads(event["path"])
    window = page.scene("revealed")["flat"]["window"]
    assert len(path) > 0
    assert [page.second(t_ns) for t_ns, _, _ in path] == pytest.approx(
        page.array(window["t"]).tolist(), abs=2e-6
    )
    assert np.allclose([at[1:] for at in path], pixels(page.array(window["at"])), atol=0.05)
    assert 1.5 == pytest.approx(np.degrees(window["radius"] / (DISTANCE_MM / 1000)))
    assert "window" not in page.scene("plain")["flat"]


def test_without_the_size_of_its_window_a_page_has_no_edges_and_says_so(page: Page) -> None:
    trial = seen_again(page)
    steps = tuple(
        replace(step, parts=tuple(replace(part, window_px=None) for part in step.parts))
        for step in trial.steps
    )
    flat = scenes_of(page, replace(trial, steps=steps))[1]["flat"]
    assert flat["isWide"]
    (bar,) = flat["sheets"]
    assert box_of((16, 0), (8, 2)) == pytest.approx(edges_px(bar), abs=1e-6)
    (note,) = flat["notes"]
    assert "the window's size was not recorded: its edges are not drawn" in note


@pytest.mark.parametrize(
    ("messages", "size_px"),
    [
        ([{"kind": "about", "about": {"view_px": [900, 500]}}], [900, 500]),
        (
            [
                {"kind": "opened", "about": {"view_px": [900, 500]}},
                {"kind": "resize", "view_px": [700, 400]},
            ],
            [700, 400],
        ),
        ([{"kind": "resize", "view_px": "large"}], None),
        ([], None),
    ],
)
def test_a_reply_that_does_not_say_how_large_the_window_was_has_what_was_said_before(
    messages: list[dict[str, Any]], size_px: list[int] | None
) -> None:
    pieces = [*messages, {"kind": "reply", "step": 1, "reply": {}}]
    events = [{"name": "trial_start", "t_ns": 0, "payload": {"trial_id": "T01", "attempt": 1}}]
    events += [
        {"name": "page_event", "t_ns": 5, "payload": {"tab": "a", "n": n, "at_ms": 1.0, **piece}}
        for n, piece in enumerate(pieces)
    ]
    recording: Any = SimpleNamespace(
        manifest=SimpleNamespace(parts=[SimpleNamespace(number=1)]),
        journal=lambda number: SimpleNamespace(events=events),
    )
    ((_, _, payload, _, _),) = seen._replies(recording, "T01", 1)
    assert size_px == payload["reply"].get("view_px")


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (('name="plain"', 'name="picture"'), ["plain"]),
        (("    yield t.wait", "    yield t.mark('x')\n    yield t.wait"), ["plain", "revealed"]),
    ],
)
def test_what_the_study_shows_no_more_is_said(
    page: Page, tmp_path: Path, change: tuple[str, str], names: list[str]
) -> None:
    assert "" == seen_again(page).problem
    trial = seen_again(page, write_study(tmp_path, STUDY.replace(*change)))
    assert trial.problem.startswith("not shown again: ")
    assert all(name in trial.problem for name in names)


def test_a_picture_that_is_another_one_now_is_named_where_it_was_shown(
    page: Page, tmp_path: Path
) -> None:
    study = write_study(tmp_path)
    Files.new("RGB", (400, 300), (200, 0, 0)).save(tmp_path / "room.png")
    header, _ = page_content(study, page.recording, ["T01"])
    words = "room.png is another file now than was shown"
    notes = [scene["flat"]["notes"] for scene in header["scenes"]]
    assert [False, False, False, True, True] == [words in those for those in notes]
    assert not any(words in scene["flat"]["notes"] for scene in page.header["scenes"])


def test_files_that_are_other_ones_now_are_named_with_what_to_do(tmp_path: Path) -> None:
    study = write_study(tmp_path)
    recording = perform_in(tmp_path, study)
    folder = recording.path.parent.parent
    settle(folder, wanted_settings(folder, study, is_simulated=True), seed_given=False)
    assert "" == study_of_session(recording)[1]
    Files.new("RGB", (400, 300), (200, 0, 0)).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text("door: {rectangle: [0, 0, 9, 9]}", "utf-8")
    _, warning = study_of_session(recording)
    assert warning.startswith("room.png, room.yaml are other files now than when ")
    assert warning.endswith("put them back to see what was shown")


def test_a_page_says_that_its_study_has_changed_since(tmp_path: Path) -> None:
    study = write_study(tmp_path)
    recording = perform_in(tmp_path, study)
    folder, warnings = recording.path.parent.parent, []
    settle(folder, wanted_settings(folder, study, is_simulated=True), seed_given=False)
    for name, text in (
        ("same", STUDY),
        ("other", STUDY.replace('"room.png", 12', '"room.png", 5')),
    ):
        write_study(tmp_path, text)
        page = tmp_path / f"{name}.html"
        result = CliRunner().invoke(app, ["view", str(recording.path), "-o", str(page)])
        assert 0 == result.exit_code, result.output
        (data,) = re.findall(r'id="data">([^<]*)<', page.read_text("utf-8"))
        raw = zlib.decompress(base64.b64decode(data))
        header = json.loads(raw[8 : 8 + int.from_bytes(raw[:8], "little")])
        warnings.append(header.get("warning"))
    assert [None, "the study has changed since: drawn as it is now"] == warnings


@pytest.fixture(scope="module")
def tab(page: Page, playwright: Any) -> Iterator[Any]:
    with viewer_tab(playwright, page.file, 1000, 700) as (window, problems):
        yield window
    assert [] == problems


PLACES = """([t, places]) => { viewer.seek(t); viewer.draw(); const gl = viewer.drawing.gl,
        w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, p = new Uint8Array(4);
    return places.map(place => { const view = viewer.view(viewer.sceneAt(t), w, h),
        q = viewer.project(view, place, w, h);
        gl.readPixels(Math.floor(q[0]), Math.floor(h - q[1]), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, p);
        return [...p].slice(0, 3); }); }"""
"""Colours on the canvas of places before the eyes."""


def place_m(x_px: float, y_px: float) -> list[float]:
    right, down = np.array([x_px, y_px]) - np.array(VIEW_PX) / 2
    return [right / DISTANCE_PX, -down / DISTANCE_PX, -1.0]


@pytest.mark.slow  # a browser
def test_a_browser_draws_it_in_its_colour_on_its_pixels(tab: Any, page: Page) -> None:
    left, top, right, bottom = box_of((-4, 2), (6, 6))
    inside = [(left + 4, top + 4), (right - 4, bottom - 4)]
    outside = [(left - 4, top), (right + 4, bottom), (4, 4), (VIEW_PX[0] - 4, VIEW_PX[1] - 4)]
    t_s = page.scene("square")["t0"] + 0.2
    places = [place_m(*px) for px in [*inside, *outside]]
    assert [[255, 0, 0]] * 2 + [[255, 255, 255]] * 4 == tab.evaluate(PLACES, [t_s, places])
    assert "window 1280 × 800 px; 39.6 px per degree" in tab.inner_text("#said")


@pytest.mark.slow  # a browser
def test_a_browser_names_areas_and_moves_the_window_with_the_pointer(tab: Any, page: Page) -> None:
    scene = page.scene("revealed")
    window = scene["flat"]["window"]
    first_s, last_s = page.array(window["t"])[[0, -1]]
    early, names, rim, name = tab.evaluate(
        """([t0, t1, door]) => { const at = t => { viewer.seek(t); viewer.draw();
            return viewer.sceneAt(t).flat; };
        const early = at(t0 - 0.01).rimAt(viewer.streams, t0 - 0.01), flat = at(t1 + 0.001);
        const s = document.getElementById('stage'), w = s.clientWidth, h = s.clientHeight,
            q = viewer.project(viewer.view(viewer.sceneAt(t1 + 0.001), w, h), door, w, h);
        return [early, viewer.outlines.map(one => one.name), flat.rimAt(viewer.streams, t1 + 0.001),
            viewer.under(q[0], q[1]).text]; }""",
        [float(first_s), float(last_s), place_m(*pixels_of_door())],
    )
    assert early is None
    assert ["door", "lamp"] == names
    assert "door" == name
    middle_px = pixels(page.array(window["at"])[-1:])
    reach_px = np.hypot(*(pixels(rim) - middle_px).T)
    assert np.allclose(DISTANCE_PX * np.radians(1.5), reach_px, atol=0.01)
    assert "window after the pointer: it alone was sharp" in tab.inner_text("#legend")


def pixels_of_door() -> tuple[float, float]:
    left, top, right, bottom = box_of((0, 0), (12, 9))
    x, y, wide, high = DOOR_PX
    return left + (x + wide / 2) / 400 * (right - left), top + (y + high / 2) / 300 * (bottom - top)
