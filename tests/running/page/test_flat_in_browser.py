"""Flat stimuli on a page in a real browser: light to the frame, keys, kills, and equal pixels."""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files
from typer.testing import CliRunner

from tests.running.page.test_browser import (
    PATIENCE_S,
    Server,
    playwright_error,
    state_of,
    step_on,
)
from tests.running.page.test_browser import server as server
from tests.running.page.test_elsewhere import Host, recording_of, save, served_files
from visavis.cli.main import app
from visavis.lab.clock import StopWatch
from visavis.recording.reader import Recording
from visavis.running.new_study import write_examples
from visavis.running.page.earlier_parts import RESTART_FLAG
from visavis.stimuli.flat import Grating
from visavis.stimuli.flat_pixels import pixels_of

pytestmark = [
    pytest.mark.slow,  # a browser
    pytest.mark.timeout(600),
]
FRAME_MS = 1000 / 60


def measure_screen(page: Any) -> None:
    """Say how large the screen is and how far away, where the page asks."""
    if page.query_selector(".slider input[type=range]") and page.query_selector("#far"):
        page.fill("#far", "60")
        page.eval_on_selector(
            ".slider input",
            "e => { e.value = 324; e.dispatchEvent(new Event('input')); }",
        )


def perform(page: Any, keys: str, words: str, part: int) -> None:
    """Press keys in turn while a part of a step is shown, until the page says something."""
    watch, n = StopWatch(), 0
    while words not in state_of(page)["text"]:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        with contextlib.suppress(playwright_error()):
            measure_screen(page)
            if page.query_selector(f"canvas.flat[data-part='{part}']"):
                page.keyboard.press(keys[n % len(keys)])
                n += 1
            elif state_of(page)["kind"] != "flat":
                step_on(page)
        page.wait_for_timeout(30)
        if words.isdigit() and n >= int(words):
            return


def test_stroop_runs_on_a_page_through_a_killed_server_to_its_report(
    server: Server, browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_examples(server.root / "examples")
    short = ("--set", "repetitions=1", "--set", "practice=0")
    study = "examples/stroop.py"
    run = ("run", study, "--participant", "1", "--on", "browser", *short)
    address = server.start(*run)
    page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    perform(page, "rgb", "4", 1)
    server.kill()
    session = server.root / "data/simulated/stroop/sub-S01B/ses-001"
    assert address == server.start("resume", str(session))
    perform(page, "rgb", "Thank you", 1)
    output = server.end()

    recording = Recording(session)
    assert "complete" == recording.status, output
    rows = recording.trials()
    assert 9 == len(rows)
    assert {"complete"} == set(rows["status"])
    assert RESTART_FLAG in ";".join(rows["flags"])
    whole = rows[rows["frames_dropped"] == 0]
    cross_ms = (whole["stimulus_off_ns"] - whole["stimulus_on_ns"]) / 1e6
    assert (abs(cross_ms - 500) <= FRAME_MS).all()
    assert (rows["stimulus2_on_ns"] == rows["stimulus_off_ns"]).all()
    assert (rows["answer_ms"] >= 0).all()  # the test presses without looking, to a tenth of a ms
    answers = rows["answer"].dropna()  # a busy processor may miss the two seconds
    assert len(answers) > 4
    assert set(answers) <= {"r", "g", "b"}
    assert {0} == set(rows["stimuli_outside"])
    events = recording.events()
    (measured,) = events.loc[events["name"] == "screen_measured", "payload"]
    assert ("card", "typed", 600.0) == (
        measured["size_by"],
        measured["distance_by"],
        measured["distance_mm"],
    )
    assert pytest.approx(324 / 85.6) == measured["px_per_mm"]
    assert [] == problems
    monkeypatch.chdir(server.root)
    result = CliRunner().invoke(app, ["analyse", "data/simulated/stroop"])
    assert 0 == result.exit_code, result.output
    assert list(server.root.rglob("report.html"))


PIXELS = """async ({grating, wide, high}) => {
    const {gratingPixels} = await import("/flat.js");
    return [...gratingPixels(grating, wide, high)];
}"""


PICTURES = """
from visavis import Factor, Grating, Image, Keys, Shape, Study, Text

study = Study("pictures", factors=[Factor("one", ["ä b😀.png", "c.png"])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.show([Image(t.one, width_deg=4), Text("L", at_deg=(4, 0))], frames=3)
    yield t.dark(0.1)
    yield t.show([Shape("ellipse", 2), Grating(3, at_deg=(0, 4))], frames=5, background="grey")
    yield t.wait(0.1)
    yield t.key(Keys("left", "space"))
"""


def test_pictures_are_asked_for_once_and_gratings_are_those_of_a_monitor(
    server: Server, browser: Any
) -> None:
    Files.new("RGB", (40, 30), (200, 30, 40)).save(server.root / "ä b😀.png")
    Files.new("RGBA", (30, 40), (0, 200, 40, 128)).save(server.root / "c.png")
    (server.root / "pictures.py").write_text(PICTURES, "utf-8")
    address = server.start("run", "./pictures.py", "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
    asked: list[str] = []
    page.on("request", lambda r: asked.append(r.url) if "/assets/" in r.url else None)
    page.goto(address)
    grating = Grating(4, 2, 0.7, orientation_deg=30, phase_deg=20, mask="circle")
    content = {
        **{n: getattr(grating, n) for n in ("width_deg", "cycles_per_deg", "contrast_01")},
        **{n: getattr(grating, n) for n in ("orientation_deg", "phase_deg", "mask", "sd_deg")},
    }
    drawn = page.evaluate(PIXELS, {"grating": content, "wide": 96, "high": 96})
    here = pixels_of(grating, (96, 96), Path())
    assert (np.array(drawn).reshape(96, 96, 4) == here).mean() > 0.9999
    perform(page, " ", "Thank you", 4)
    server.end()
    assert 2 == len(asked) == len(set(asked))
    rows = Recording(server.root / "data/simulated/pictures/sub-S01B/ses-001").trials()
    assert {3} == set(rows["stimulus_frames"])
    assert (rows["answer"] == "space").all()
    lasted_ms = (rows["stimulus2_off_ns"] - rows["stimulus2_on_ns"]) / 1e6
    assert (lasted_ms > 5 * FRAME_MS + 100 - FRAME_MS).all()  # it stays while a key is waited for
    assert (rows["answer_ms"] > 5 * FRAME_MS + 100 - FRAME_MS).all()


APART = """
from visavis import Factor, Image, Keys, Study

study = Study("apart", factors=[Factor("place", [1, 2, 3])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.show(Image("ü.png", width_deg=4), until=Keys("f", "j"), limit_s=20)
"""


def test_a_bundle_shows_pictures_and_remembers_its_screen_through_a_reload(
    tmp_path: Path, browser: Any
) -> None:
    Files.new("RGB", (40, 30), (200, 30, 40)).save(tmp_path / "ü.png")
    host = Host(tmp_path, APART)
    with served_files(host.export()) as address:
        context = browser.new_context(
            accept_downloads=True, viewport={"width": 1200, "height": 800}
        )
        page = context.new_page()
        page.goto(f"{address}?place=1")
        perform(page, "f", "1", 0)
        page.reload()
        perform(page, "f", "Save my answers", 0)
        results = save(page, host)
    _, recording = recording_of(host, results)
    rows = recording.trials()
    assert ["f"] * 3 == list(rows["answer"])
    assert 1 == rows["px_per_deg"].nunique()
    assert 0.102 == rows["size_error_01"].iloc[-1]


MOVING = """
from visavis import Dots, Factor, Keys, Study, Text

study = Study("moving", factors=[Factor("way", [0, 180])], on="browser", uses=(), calibrate=False)


@study.trial
def trial(t):
    yield t.show([Dots(0.5, t.way, 4, lifetime_s=0.2), Text("+")], frames=30)
    yield t.wait(5)
    yield t.key(Keys("f"))
"""
CANVAS = """() => {
    const canvas = document.querySelector("canvas.flat[data-part='1']");
    if (!canvas) return null;
    const wide = 300, left = Math.round((canvas.width - wide) / 2);
    const top = Math.round((canvas.height - wide) / 2);
    const drawn = canvas.getContext("2d").getImageData(left, top, wide, wide).data;
    return drawn.filter((_, at) => at % 4 === 0).join("");
}"""


def test_dots_move_on_while_a_page_waits(server: Server, browser: Any) -> None:
    (server.root / "moving.py").write_text(MOVING, "utf-8")
    address = server.start("run", "./moving.py", "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    seen: list[str] = []
    watch = StopWatch()
    while len(seen) < 2:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        drawn = page.evaluate(CANVAS)
        if drawn is None:
            perform(page, "x", "0", 0)
        elif drawn not in seen:
            seen.append(drawn)
    assert all("255" in drawn for drawn in seen)
    assert [] == problems
