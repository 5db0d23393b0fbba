"""Films and dots on the page that shows a session again: each moment has its own picture."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.viewer_tab import page_array, page_parts, viewer_tab
from tests.sessions import request_in
from visavis.cli.recorded_trial import recorded_trial
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.moving import MOVING_SIDE_PX, with_small_pictures
from visavis.cli.viewer.page import page_of
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.dressing.picture_of import picture_of

pytest.importorskip("av")
from benchmarks.film_in_step import number_of, write_film
from tests.panoramic_film import RATE_HZ, number_ahead, write_film_around

STUDY = """
from visavis import Dots, Factor, Panorama, Study, Video

study = Study("moving", "S", factors=[Factor("one", ["a"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Video("film.mp4", width_deg=20), 1.0, name="film")
    yield t.show(Video("film.mp4", width_deg=20, at_deg=(15, 0)), 0.5, name="cut")
    yield t.show(Dots(0.5, 90, seed=3), 0.4, name="dots")
    yield t.show(Panorama("lake.mp4"), 0.6, name="lake")
    yield t.show(Panorama("lake.mp4"), 0.3, name="lake_again")
"""
ROUNDED_NS = 1000
"""Seconds of a page are whole microseconds."""
pytestmark = pytest.mark.slow  # a session, and a browser


class Page:
    """A session of stimuli that move, and its page."""

    def __init__(self, folder: Any) -> None:
        (folder / "moving.py").write_text(STUDY, "utf-8")
        write_film(folder / "film.mp4", 60, (640, 360))
        write_film_around(folder / "lake.mp4", 2 * RATE_HZ)
        self.study = find_study(str(folder / "moving.py"))
        self.recording = CachedRecording(
            perform_new(request_in(folder, self.study, SCREEN_EXAMPLE))
        )
        header, bundle = page_content(
            self.study, self.recording, list(trial_lengths_ns(self.recording))
        )
        self.header, self.arrays = page_parts(bundle.text(header))
        self.file = folder / "page.html"
        self.file.write_text(page_of(header, bundle), "utf-8")
        self.row = self.recording.trials().iloc[0]

    def scene(self, name: str) -> dict[str, Any]:
        middle_s = (self._second(f"{name}_on_ns") + self._second(f"{name}_off_ns")) / 2
        return next(s for s in self.header["scenes"] if s["t0"] <= middle_s < s["t1"])

    def _second(self, column: str) -> float:
        (part,) = self.header["parts"]
        return float(part["t0"] + (self.row[column] - part["started_ns"]) / 1e9)

    def pictures(self, moving: dict[str, Any]) -> list[np.ndarray[Any, Any]]:
        """Return the picture of each sample."""
        files = [page_array(self.arrays, ref).tobytes() for ref in moving["files"]]
        pictures = [np.asarray(Image.open(io.BytesIO(file)).convert("RGBA")) for file in files]
        return [pictures[k] for k in page_array(self.arrays, moving["at"])]

    def pictures_anew(self, name: str) -> list[Any]:
        """Return what was shown at each sample, drawn anew."""
        trial, scene = recorded_trial(self.recording, str(self.row["trial_id"])), self.scene(name)
        (part,) = self.header["parts"]
        start_ns = part["started_ns"] + round((scene["t0"] - part["t0"]) * 1e9) + ROUNDED_NS
        step_ns = 10**9 // scene["rate"]
        views = (
            next(iter(self.study.views_of(trial.shown_at(start_ns + k * step_ns))))
            for k in range(scene["n"])
        )
        return [picture_of(view) for view in views]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(tmp_path_factory.mktemp("moving"))


@pytest.mark.parametrize("name", ["film", "dots"])
def test_each_sample_has_the_picture_of_its_time(page: Page, name: str) -> None:
    moving = page.scene(name)["flat"]["sheets"][-1]["moving"]
    expected = [with_small_pictures(one).sheets[0].pixels for one in page.pictures_anew(name)]
    pictures = page.pictures(moving)
    assert len(expected) == len(pictures)
    for whole, small in zip(expected, pictures, strict=True):
        assert whole.shape == small.shape
        assert np.abs(whole.astype(int) - small).mean() < 3
    assert len({one.tobytes() for one in pictures}) > len(pictures) / 3
    assert max(pictures[0].shape) <= MOVING_SIDE_PX


def test_a_film_is_kept_once_however_often_it_is_shown_and_cut_where_the_monitor_ends(
    page: Page,
) -> None:
    whole, part = (page.scene(name)["flat"]["sheets"][-1] for name in ("film", "cut"))
    numbers = [number_of(one) for one in page.pictures(whole["moving"])]
    assert sorted(numbers) == numbers
    assert len(set(numbers)) > 12
    uncut_m = page.pictures_anew("cut")[0].sheets[0].size_m[0]
    assert part["size"][0] < 0.9 * uncut_m
    cut = page.pictures(part["moving"])[0]
    assert cut.shape[1] == pytest.approx(MOVING_SIDE_PX * part["size"][0] / uncut_m, abs=1)
    again = page.scene("film")["flat"]["sheets"][-1]["moving"]["files"]
    assert len(again) == len({ref["o"] for ref in again})


def test_a_film_all_around_goes_on(page: Page) -> None:
    moving = page.scene("lake")["flat"]["around"]["moving"]
    expected = [_ahead(one.surround.eyes[0]) for one in page.pictures_anew("lake")]
    assert expected == [_ahead(one) for one in page.pictures(moving)]
    assert len(set(expected)) > 3


def test_a_film_all_around_is_kept_once_however_often_it_is_shown(page: Page) -> None:
    places = [
        {ref["o"] for ref in page.scene(name)["flat"]["around"]["moving"]["files"]}
        for name in ("lake", "lake_again")
    ]
    assert set() < places[1] < places[0]


def _ahead(pixels: np.ndarray[Any, Any]) -> int:
    return number_ahead(pixels[pixels.shape[0] // 2, pixels.shape[1] // 2])


@pytest.fixture(scope="module")
def tab(page: Page, playwright: Any) -> Iterator[Any]:
    with viewer_tab(playwright, page.file, 1000, 700) as (window, problems):
        yield window
    assert [] == problems


ROW = """async t => { viewer.setCamera('eyes'); viewer.show.gaze = false; viewer.seek(t);
    await viewer.drawWhole(); const scene = viewer.sceneAt(t), s = scene.data.flat.sheets.at(-1),
        gl = viewer.drawing.gl, w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, row = [];
    for (let k = 0; k < 320; k++) { const p = new Uint8Array(4),
        at = add(s.at, rotate(s.turn, [((k + .5) / 320 - .5) * s.size[0], 0, 0])),
        q = viewer.project(viewer.view(scene, w, h), at, w, h);
        gl.readPixels(Math.floor(q[0]), Math.floor(h - q[1]), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, p);
        row.push([...p]); }
    return row; }"""
"""The colours across the middle of the stimulus in front."""


def test_a_browser_draws_the_picture_of_each_moment_forwards_and_back(tab: Any, page: Page) -> None:
    scene = page.scene("film")
    numbers = [number_of(one) for one in page.pictures(scene["flat"]["sheets"][-1]["moving"])]
    for k in (3, 12, 5, 0):
        row = tab.evaluate(ROW, scene["t0"] + (k + 0.5) / scene["rate"])
        assert numbers[k] == number_of(np.array([row], np.uint8))


def test_a_picture_that_is_saved_has_the_moment_it_is_of(tab: Any, page: Page) -> None:
    scene = page.scene("film")
    rows = []
    for k in (14, 2):
        t_s = scene["t0"] + (k + 0.5) / scene["rate"]
        rows.append(
            tab.evaluate(
                """async t => { viewer.seek(t); const image = await createImageBitmap(
                await viewer.saving.png(1)), c = new OffscreenCanvas(image.width, image.height),
                g = c.getContext('2d'); g.drawImage(image, 0, 0);
                const row = g.getImageData(0, (image.height - 30) >> 1, image.width, 1).data;
                return [...row].join(); }""",
                t_s,
            )
        )
    assert rows[0] != rows[1]
