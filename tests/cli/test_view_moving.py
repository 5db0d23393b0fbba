"""Films and dots on the page that shows a session again: each moment has its own picture."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.viewer_tab import page_array, page_parts, viewer_tab
from tests.sessions import request_in
from visavis.cli.recorded_trial import recorded_trial
from visavis.cli.viewer import models
from visavis.cli.viewer.content import page_content, samples_of, trial_lengths_ns
from visavis.cli.viewer.moving import MOVING_SIDE_PX
from visavis.cli.viewer.page import TrialsBeside, page_of
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
    expected = [_small(one.sheets[0].pixels) for one in page.pictures_anew(name)]
    pictures = page.pictures(moving)
    assert len(expected) == len(pictures)
    for whole, small in zip(expected, pictures, strict=True):
        assert whole.shape == small.shape
        assert np.abs(whole.astype(int) - small).mean() < 3
    assert len({one.tobytes() for one in pictures}) > len(pictures) / 3
    assert max(pictures[0].shape) <= MOVING_SIDE_PX


def test_what_was_shown_of_a_film_is_held_as_small_files_alone(page: Page) -> None:
    samples = samples_of(page.study, recorded_trial(page.recording, str(page.row["trial_id"])))
    around = [s.picture.surround for s in samples]
    pixels = [sheet.pixels for s in samples for sheet in s.picture.sheets]
    pixels += [eye for one in around if one is not None for eye in one.eyes]
    assert 1000 > sum(one.nbytes for one in {id(one): one for one in pixels}.values())
    assert 15 < len({s.moving.sheets for s in samples})


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


def _small(pixels: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    image = Image.fromarray(pixels)
    image.thumbnail((MOVING_SIDE_PX, MOVING_SIDE_PX))
    return np.asarray(image)


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


def test_a_picture_that_cannot_be_decoded_is_named_and_the_next_goes_on(
    tab: Any, page: Page
) -> None:
    scene = page.scene("film")
    moving = scene["flat"]["sheets"][-1]["moving"]
    numbers = [number_of(one) for one in page.pictures(moving)]
    at = page_array(page.arrays, moving["at"])
    bad, good = 9, 13
    begin_s, rate = scene["t0"], scene["rate"]
    tab.evaluate(ROW, begin_s + 0.5 / rate)
    whole_file = tab.evaluate(
        """([t, n]) => { const {files} = viewer.sceneAt(t).flat.data.sheets.at(-1).moving,
        file = viewer.content.flat(files[n]), before = [...file]; file.fill(0); return before; }""",
        [begin_s, int(at[bad])],
    )
    try:
        stands = tab.evaluate(ROW, begin_s + (bad + 0.5) / rate)
        is_named = f"film.mp4: no picture at {list(at).index(at[bad]) / rate:.2f} s"
        tab.wait_for_function("words => $('said').textContent.includes(words)", arg=is_named)
        goes_on = tab.evaluate(ROW, begin_s + (good + 0.5) / rate)
    finally:
        tab.evaluate(
            """([t, n, file]) => { const [moving] = viewer.sceneAt(t).flat.moving.values();
            viewer.content.flat(moving.files[n]).set(file); moving.missing.clear(); }""",
            [begin_s, int(at[bad]), whole_file],
        )
    assert numbers[0] == number_of(np.array([stands], np.uint8))
    assert numbers[good] == number_of(np.array([goes_on], np.uint8))


TO_AND_FRO = """() => Promise.race([
    Promise.all([0, 1, 2, 3, 4, 0].map(n => viewer.content.pieces.get(n)))
        .then(all => all.filter(Boolean).length),
    new Promise(done => setTimeout(done, 60000, 'one of them never comes'))])"""
"""How many files of pictures come where the first is asked for again before it is there."""
HOURS = """async () => {
    const {header} = viewer.content, {moving} = header.scenes[0].flat.sheets.at(-1),
        frames = Array(12 * 7200).fill(moving.files[0]), film = {frames, seconds: 7200, rate: 12},
        content = {header: {pages: [], films: [film]}, picture: of => viewer.content.picture(of)},
        pages = new Pages(content, viewer.drawing);
    for (let k = 3; k < 12; k++) frames[k] = {d: 'u1', s: [8], o: 0}; // no pictures
    let most = 0, shown = 0;
    for (let s = 1 / 24; s < 7200; s += s % 600 < 5 ? 1 / 12 : 5) {
        pages.picture(pages.films[0], s);
        await Promise.all(viewer.drawing.waiting);
        shown += Boolean(pages.picture(pages.films[0], s));
        most = Math.max(most, pages.films[0].pictures.size); }
    return [most, shown, pages.notesAt({films: [0]})]; }"""
"""Two hours of a film, in leaps and picture by picture: how many pictures were held at most."""


def test_of_a_film_of_two_hours_few_pictures_are_held(tab: Any) -> None:
    most, picture_count, (note,) = tab.evaluate(HOURS)
    assert 25 >= most
    assert 1500 < picture_count
    assert note.startswith(
        "no picture of the film at 0.25 s, 0.33 s, 0.42 s, 0.50 s, 0.58 s and 4 more ("
    )


def test_pictures_of_long_films_are_beside_the_page_and_few_files_of_them_held(
    page: Page, playwright: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(models, "FILM_BYTES", 0)
    monkeypatch.setattr(models, "PIECE_BYTES", 600)
    file, beside = tmp_path / "page.html", TrialsBeside(tmp_path / "page.html")
    header, bundle = page_content(
        page.study, page.recording, list(trial_lengths_ns(page.recording)), beside=beside.write
    )
    file.write_text(page_of(header, bundle), "utf-8")
    scene = page.scene("film")
    numbers = [number_of(one) for one in page.pictures(scene["flat"]["sheets"][-1]["moving"])]
    assert 5 < len(beside.files) == len(header["pieces"])
    with viewer_tab(playwright, file, 1000, 700) as (window, problems):
        assert 6 == window.evaluate(TO_AND_FRO)
        for k in (0, 4, 8, 12, 16, 3):
            row = window.evaluate(ROW, scene["t0"] + (k + 0.5) / scene["rate"])
            assert numbers[k] == number_of(np.array([row], np.uint8))
            assert 3 >= window.evaluate("viewer.content.pieces.held.size")
        last = beside.files[-1]
        last.unlink()
        lake = page.scene("lake")
        window.evaluate(
            "async t => { viewer.seek(t); await viewer.drawWhole(); }", lake["t1"] - 0.01
        )
        window.wait_for_function("$('said').textContent.includes('lake.mp4: no picture at')")
    assert [] == problems
