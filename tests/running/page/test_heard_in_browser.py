"""Films with a voice in a real browser: what is served, what is heard, and what is recorded."""

import base64
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.running.page.test_browser import Server, server, until
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector
from visavis.recording.reader import Recording
from visavis.running.page.spoken_digits import hear_digits, spoken_digits
from visavis.stimuli.sound import Waveform, part_of, read_sound

av = pytest.importorskip("av")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser, and films that are drawn

SPEECH = Path(__file__).resolve().parents[3] / "experiments" / "gestures" / "speech.wav"
FROM_S, SECONDS, FILM_HZ = 2.5, 2.0, 30
FRAME_MS = 1000 / FILM_HZ
BLOCK = 1024
TAP_MS = 250.0
"""The tap takes whole blocks, and its context has a delay of its own, 70 ms here when idle."""
STRETCH_S = 0.5
STUDY = Path(__file__).parents[2] / "studies" / "heard.py"
TAP = """
window.heard = [];
const play = HTMLMediaElement.prototype.play;
HTMLMediaElement.prototype.play = function () {
    if (this.tagName === "VIDEO" && !this.isTapped) {
        this.isTapped = true;
        const context = new AudioContext();
        const own = { rateHz: context.sampleRate, blocks: [], pictures: [] };
        window.heard.push(own);
        const tap = context.createScriptProcessor(1024, 1, 1);
        tap.onaudioprocess = (event) => own.blocks.push({
            at: context.getOutputTimestamp(), block_s: event.playbackTime,
            samples: Array.from(event.inputBuffer.getChannelData(0)) });
        context.createMediaElementSource(this).connect(tap);
        tap.connect(context.destination);
        const see = (now, data) => {
            own.pictures.push({ at_ms: data.expectedDisplayTime, media_s: data.mediaTime });
            this.requestVideoFrameCallback(see);
        };
        this.requestVideoFrameCallback(see);
    }
    return play.call(this);
};
"""
"""Listens to every film of the page."""

__all__ = ["server"]  # the fixture


def speech_sound() -> Waveform:
    return part_of(read_sound(SPEECH), FROM_S, SECONDS).at_rate(48_000)


def lag_s(heard: Vector, speech: Vector, rate_hz: float) -> tuple[float, float]:
    """Return by how much sooner `speech` begins in `heard` (negative: later), and how alike they
    are there, from −1 to 1.
    """
    n = 1 << int(np.ceil(np.log2(len(heard) + len(speech))))
    product = np.fft.irfft(np.fft.rfft(heard, n) * np.conj(np.fft.rfft(speech, n)), n)
    at = int(np.argmax(product))
    at = at - n if at > n // 2 else at
    first, own_first = max(at, 0), max(-at, 0)
    count = min(len(heard) - first, len(speech) - own_first)
    alike = np.corrcoef(heard[first : first + count], speech[own_first : own_first + count])[0, 1]
    return at / rate_hz, float(alike)


def decode(content: bytes) -> tuple[Vector, list[float]]:
    """Return sound (48 kHz) and times of the pictures of a film."""
    with av.open(io.BytesIO(content)) as film:
        pictures_s = [float(f.time) for f in film.decode(video=0)]
    with av.open(io.BytesIO(content)) as film:
        blocks = [np.asarray(f.to_ndarray(), np.float64).ravel() for f in film.decode(audio=0)]
    return np.concatenate(blocks), pictures_s


def digits_of(responses: list[Any]) -> str:
    """Return what the page says in the sound check, from what it was sent."""
    for response in responses:
        if "json" in response.headers.get("content-type", ""):
            for wav in wavs_in(response.json()):
                return hear_digits(base64.b64decode(wav), spoken_digits("en", SPEECH.parent))
    return ""


def wavs_in(content: Any) -> Iterator[str]:
    if isinstance(content, dict):
        if isinstance(content.get("wav"), str):
            yield content["wav"]
        for value in content.values():
            yield from wavs_in(value)


def test_a_film_is_heard_from_its_first_picture_on_and_its_sound_is_the_speech(
    server: Server, browser: Any
) -> None:
    once = ("--set", "repetitions=1")
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser", *once)
    page = browser.new_context().new_page()
    page.add_init_script(TAP)
    responses: list[Any] = []
    page.on("response", lambda response: responses.append(response))
    page.goto(address)
    until(page, "Play the voice")
    page.get_by_text("Play the voice").click()
    page.fill("#heard", digits_of(responses))
    page.get_by_text("Continue").click()
    until(page, "Thank you")
    server.end()
    (session,) = server.root.glob("data/simulated/heard/*/ses-*")
    recording = Recording(session)
    (checked,) = recording.events_named("sound_checked", 1)["payload"]
    assert checked["is_right"]

    # What was served is the speech, and begins with the pictures.
    (film,) = {r.url: r.body() for r in responses if "/films/" in r.url}.values()
    sound, pictures_s = decode(film)
    late_s, alike = lag_s(sound, samples_of(speech_sound()), 48_000)
    assert alike > 0.99
    assert abs(late_s - pictures_s[0]) < FRAME_MS / 1000 / 2

    # It was heard as the page says, from one film of the pair.
    row = recording.trials().iloc[0]
    # A pair is on when both films are: its sound may begin with the one that was sooner.
    for name, apart_ms in (("film", 0.0), ("film2", row["film2_apart_ms"])):
        off_ms = abs(row[f"{name}_sound_on_ns"] - row[f"{name}_on_ns"]) / NS_PER_MS
        assert off_ms < FRAME_MS + apart_ms
        assert row[f"{name}_volume_01"] == 1.0
    assert row["film2_apart_ms"] < 500  # of two seconds
    alone, left, right = page.evaluate("window.heard")
    assert not any(np.abs(block["samples"]).max() for block in right["blocks"])
    # The film of a pair that is ahead waits for the other.
    for own, waited_ms in ((alone, 0.0), (left, row["film2_apart_ms"])):
        rate_hz = round(own["rateHz"])
        speech = samples_of(part_of(read_sound(SPEECH), FROM_S, SECONDS).at_rate(rate_hz))
        heard_ms, speech_s = speech_onset(own, speech)
        begun_ms = begin_ms(own, heard_ms)
        assert abs(heard_ms - 1000 * speech_s - begun_ms) < TAP_MS + waited_ms


def begin_ms(own: dict[str, Any], heard_ms: float) -> float:
    """Return when a film would have begun by the pictures beside a stretch that is heard: while
    the tap's own context starts, seconds on a busy computer, the first picture stands still.
    """
    beside = [
        picture["at_ms"] - 1000 * picture["media_s"]
        for picture in own["pictures"]
        if heard_ms - TAP_MS <= picture["at_ms"] <= heard_ms + 1000 * STRETCH_S
    ]
    return float(np.median(beside))


def samples_of(sound: Waveform) -> Vector:
    return sound.samples[:, 0].astype(np.float64)


def speech_onset(own: dict[str, Any], speech: Vector) -> tuple[float, float]:
    """Return when the first stretch of speech that is whole in a tapped film is heard, on the
    page's clock, and how late in the speech it is: a browser in a hurry leaves blocks out.
    """
    heard = np.concatenate([block["samples"] for block in own["blocks"]])
    count = round(STRETCH_S * own["rateHz"])
    for first in range(0, len(speech) - count, count // 2):
        with np.errstate(invalid="ignore"):  # silence is like nothing
            at_s, alike = lag_s(heard, speech[first : first + count], own["rateHz"])
        if at_s >= 0 and alike > 0.8:
            return sample_ms(own, round(at_s * own["rateHz"]), count), first / own["rateHz"]
    pytest.fail("nothing of the speech was heard whole")


def sample_ms(own: dict[str, Any], sample: int, count: int) -> float:
    """Return when a sample leaves the browser, by the blocks from it on, on the page's clock."""
    blocks = range(sample // BLOCK, (sample + count) // BLOCK)
    times = [
        own["blocks"][k]["at"]["performanceTime"]
        + 1000 * (own["blocks"][k]["block_s"] - own["blocks"][k]["at"]["contextTime"])
        + 1000 * (sample - k * BLOCK) / own["rateHz"]
        for k in blocks
    ]
    return float(np.median(times))
