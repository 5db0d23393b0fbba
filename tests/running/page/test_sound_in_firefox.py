"""Sounds and films of a page in Firefox, heard at the speakers of a sound server."""

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.film_in_step import RATE_HZ, TONE_HZ, write_film
from tests.running.page.test_browser import PATIENCE_S, Server, other_steps_on, server
from tests.running.page.test_videos_in_browser import PICTURE
from tests.sound_server import SPEAKER_HZ, sound_server
from visavis.lab.clock import StopWatch
from visavis.recording.reader import Recording

pytest.importorskip("av")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser

__all__ = ["server"]  # the fixture

PITCHES_HZ = (600, 900)
BLOCK = 4800
"""Samples in which a pitch is looked for: a tenth of a second."""
STUDY = f"""
from visavis import Factor, Keys, Study, Text, Tone, Video

study = Study("heard", factors=[Factor("pitch", {list(PITCHES_HZ)})], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.show([Text("x"), Tone(t.pitch, seconds=0.5)], seconds=1.5, name="beep")
    yield t.show(Video("film.mp4", width_deg=12), until=Keys("f", "j"), limit_s=60, name="film")
"""
SCREEN = """(() => {
    const far = document.querySelector("#far");
    const wide = document.querySelector(".slider input[type=range]");
    if (!far || !wide) return;
    for (const [input, value] of [[far, 60], [wide, 324]]) {
        input.value = value;
        input.dispatchEvent(new Event("input", { bubbles: true }));
    }
})()"""


@pytest.fixture
def speakers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A sound server with speakers that nobody hears; yields the file of what they play, two
    channels of float32.
    """
    file = tmp_path / "played.raw"
    with sound_server(tmp_path / "pulse") as here, file.open("wb") as played:
        monkeypatch.setenv("PULSE_SERVER", here["PULSE_SERVER"])
        listen = ["parec", "-d", "ears.monitor", "--format=float32le", "--channels=2"]
        hearing = subprocess.Popen([*listen, f"--rate={SPEAKER_HZ}"], env=here, stdout=played)
        try:
            yield file
        finally:
            hearing.send_signal(signal.SIGTERM)
            hearing.wait(timeout=PATIENCE_S)


def pitches_of(samples: npt.NDArray[np.float32]) -> list[float]:
    """Return the pitch of each block of samples (n,) that is no silence, to the next 10 Hz."""
    blocks = samples[: len(samples) // BLOCK * BLOCK].reshape(-1, BLOCK)
    spectra = np.abs(np.fft.rfft(blocks * np.hanning(BLOCK), axis=1))
    loud = np.abs(blocks).max(axis=1) > 0.01
    pitches: list[float] = (spectra.argmax(axis=1) * SPEAKER_HZ / BLOCK)[loud].tolist()
    return pitches


def test_the_speakers_play_tones_and_films_while_their_pictures_are_shown(
    server: Server, speakers: Path, request: pytest.FixtureRequest
) -> None:
    write_film(server.root / "film.mp4", 600, is_heard=True)
    (server.root / "heard.py").write_text(STUDY, "utf-8")
    address = server.start("run", "./heard.py", "--participant", "1", "--on", "browser")
    window = request.getfixturevalue("other_browser")
    window.size(1200, 800)
    window.goto(address)
    text, pictures, watch = "", [], StopWatch()
    while "Thank you" not in text:
        assert watch.elapsed_s() < PATIENCE_S, text
        window.evaluate(SCREEN)
        picture: Any = window.evaluate(f"({PICTURE})()")
        if picture:
            pictures.append(picture)
            if picture["number"] >= RATE_HZ:
                window.press("f")
        elif not window.evaluate("Boolean(document.querySelector('canvas.flat'))"):
            other_steps_on(window)
        text = window.evaluate("document.getElementById('main').innerText")
    output = server.end()

    recording = Recording(server.root / "data/simulated/heard/sub-S01B/ses-001")
    assert "complete" == recording.status, output
    rows = recording.trials()
    assert {"complete"} == set(rows["status"])
    assert pictures
    for one in pictures:
        assert one["number"] <= one["at_s"] * RATE_HZ + 2, pictures
    assert rows["beep_sound_on_ns"].notna().all()
    assert rows["film_sound_on_ns"].notna().all()
    pitches = pitches_of(np.fromfile(speakers, np.float32).reshape(-1, 2)[:, 0])
    for pitch in (*PITCHES_HZ, TONE_HZ):
        assert 3 <= sum(abs(one - pitch) <= 10 for one in pitches), pitches
