"""A lab's own films on a page in a real browser: their pictures, their times, their sound."""

import contextlib
from typing import Any

import pytest

from benchmarks.film_in_step import BITS, RATE_HZ, write_film
from tests.running.page.test_browser import (
    PATIENCE_S,
    Server,
    playwright_error,
    server,
    state_of,
    step_on,
)
from tests.running.page.test_flat_in_browser import measure_screen
from visavis.lab.clock import StopWatch
from visavis.recording.reader import Recording

pytest.importorskip("av")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser

__all__ = ["server"]  # the fixture

STUDY = """
from visavis import Factor, Keys, Study, Text, Video

study = Study("shown", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False)


@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.3)
    film = [Video("film ü.mp4", width_deg=12), Text("in front", colour="red")]
    yield t.show(film, until=Keys("f", "j"), limit_s=60, name="film")
"""
PICTURE = """async () => {
    const video = document.querySelector(".stage video");
    if (!video || video.style.visibility !== "visible" || video.paused) return null;
    const own = new OffscreenCanvas(video.videoWidth, video.videoHeight);
    const on = own.getContext("2d");
    on.drawImage(video, 0, 0);
    const row = on.getImageData(0, own.height / 2, own.width, 1).data;
    const wide = own.width / BITS;
    const isWhite = (k) => row[4 * Math.round((k + 0.5) * wide) + 1] > 127;
    const bits = Array.from({ length: BITS }, (_, k) => isWhite(k));
    const box = video.getBoundingClientRect().toJSON();
    // A busy browser's pictures go on before its script hears of it: the next place counts.
    const atS = video.currentTime;
    for (let k = 0; k < 60 && video.currentTime === atS && !video.paused; k += 1)
        await new Promise((resolve) => setTimeout(resolve, 5));
    return { number: bits.reduce((sum, bit) => 2 * sum + bit, 0), at_s: video.currentTime,
        box, muted: video.muted };
}""".replace("BITS", str(BITS))
"""What is on a page's film, and where in the film the page then says that it stands."""


def test_a_page_shows_a_film_in_step_and_says_when(server: Server, browser: Any) -> None:
    write_film(server.root / "film ü.mp4", 3000, is_heard=True)
    (server.root / "shown.py").write_text(STUDY, "utf-8")
    address = server.start("run", "./shown.py", "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    seen: list[dict[str, Any]] = []
    watch = StopWatch()
    while "Thank you" not in state_of(page)["text"]:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        with contextlib.suppress(playwright_error()):  # the page went on meanwhile
            measure_screen(page)
            found = page.evaluate(PICTURE)
            if found:
                seen.append(found)
                watch = StopWatch()  # a busy computer shows each picture late
            if found and found["number"] >= 5:
                page.keyboard.press("f")
            elif state_of(page)["kind"] != "flat":
                step_on(page)
        page.wait_for_timeout(30)
    output = server.end()
    assert [] == problems
    assert any(one["number"] for one in seen)
    for one in seen:
        assert one["number"] <= one["at_s"] * RATE_HZ + 2, seen  # a busy browser may be behind
        assert pytest.approx(320 / 180, abs=0.02) == one["box"]["width"] / one["box"]["height"]
        assert one["muted"]  # its sound is played by the audio clock
    recording = Recording(server.root / "data/simulated/shown/sub-S01B/ses-001")
    assert "complete" == recording.status, output
    rows = recording.trials()
    assert {"complete"} == set(rows["status"])
    assert (rows["film_film_pictures"] >= 1).all()
    assert (rows["film_film_on_ns"] >= rows["film_on_ns"] - 50_000_000).all()
    assert rows["film_sound_on_ns"].notna().all()
