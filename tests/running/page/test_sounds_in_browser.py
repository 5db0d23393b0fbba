"""Tones and sounds on a page in a real browser: every sample, its onset, gestures, and breaks."""

import contextlib
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.io import wavfile

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
from visavis.running.page.course import SOUND_FLAG
from visavis.running.sound_store import PAGE_RATE_HZ
from visavis.stimuli.audible import Tone, at_ear, tone_waveform
from visavis.stimuli.sound import Waveform, read_sound

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser

__all__ = ["server"]  # the fixture

FRAME_MS = 1000 / 60
STUDY = """
from visavis import Factor, Keys, Sound, Study, Text, Tone

study = Study("heard", factors=[Factor("pitch", [440, 880])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.5)
    # Longer than the tone: on a busy computer it may begin late, and what is shown ends it.
    yield t.show([Text("x"), Tone(t.pitch, seconds=0.2)], seconds=1.5, name="beep")
    yield t.show(Sound("hum.wav", ear="left"), until=Keys("f", "j"), limit_s=60, name="hum")
"""
TAP = """
const Context = window.AudioContext;
const CODE = `registerProcessor("tap", class extends AudioWorkletProcessor {
    process([channels]) {
        if (channels.some((c) => c.some((v) => v !== 0))) this.port.postMessage(
            { frame: currentFrame, channels: channels.map((c) => Array.from(c)) });
        return true;
    }
});`;
window.AudioContext = class extends Context {
    constructor(options) {
        super(options);
        window.tap = { context: this, isReady: false, blocks: [] };
        const all = new GainNode(this);
        const output = super.destination;
        all.connect(output);
        Object.defineProperty(this, "destination", { value: all });
        const code = URL.createObjectURL(new Blob([CODE], { type: "text/javascript" }));
        this.audioWorklet.addModule(code).then(() => {
            const node = new AudioWorkletNode(this, "tap");
            node.port.onmessage = ({ data }) => {
                const at = this.getOutputTimestamp();
                window.tap.blocks.push(
                    { ...data, offset_ms: at.performanceTime - 1000 * at.contextTime });
            };
            all.connect(node).connect(output);
            window.tap.isReady = true;
        });
    }
};
"""
"""Listens to whatever the page plays, sample by sample."""
BLOCKS = "() => window.tap ? window.tap.blocks : []"
COUNT = "() => window.tap.blocks.length"
COMPARED = 4800
"""Samples of each sound: a tenth of a second."""
BLOCKS_BEFORE_PRESS = 4 * COMPARED // 128
"""The tone's 75 may come among them, where the browser is busy, and as many of the sound alone."""
PART = "canvas.flat[data-part='2']"


@pytest.fixture
def page(server: Server, browser: Any) -> Any:
    hum = np.random.default_rng(1).integers(-9000, 9000, 20 * 48_000).astype(np.int16)
    hum[np.abs(hum) < 10] = 10  # no sample is silence
    wavfile.write(server.root / "hum.wav", 48_000, hum)
    (server.root / "heard.py").write_text(STUDY, "utf-8")
    address = server.start("run", "./heard.py", "--participant", "1", "--on", "browser")
    opened = browser.new_context(bypass_csp=True).new_page()
    opened.add_init_script(TAP)
    opened.goto(address)
    return opened


def go_on(page: Any, is_there: str) -> None:
    """Do what the page asks for until something is there; it begins when the tap is ready."""
    watch = StopWatch()
    while True:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        with contextlib.suppress(playwright_error()):  # the page went on meanwhile
            if page.evaluate(is_there):
                return
            measure_screen(page)
            has_begun = page.evaluate("() => !window.tap || window.tap.isReady")
            if state_of(page)["kind"] != "flat" and has_begun:
                step_on(page)
        page.wait_for_timeout(50)


def answer(page: Any) -> None:
    """Press a key once a tenth of a second of the sound alone is heard, until the part is over."""
    go_on(page, f'() => Boolean(document.querySelector("{PART}"))')
    watch = StopWatch()
    blocks = page.evaluate(COUNT)
    page.wait_for_function(f"{blocks + BLOCKS_BEFORE_PRESS} <= window.tap.blocks.length")
    while page.query_selector(PART):
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        page.keyboard.press("f")
        page.wait_for_timeout(50)


def recording_of(server: Server) -> Recording:
    output = server.end()
    recording = Recording(server.root / "data/simulated/heard/sub-S01B/ses-001")
    assert "complete" == recording.status, output
    return recording


def replies(recording: Recording) -> list[dict[str, Any]]:
    events = recording.events()
    payloads = events.loc[events["name"] == "page_event", "payload"]
    found = [p["reply"] for p in payloads if p["kind"] == "reply"]
    return [reply for reply in found if "parts" in reply]


def places_of(window: npt.NDArray[np.float32], among: npt.NDArray[np.float32]) -> list[int]:
    """Return where a window of samples stands among others, to the bit."""
    last = len(among) - len(window) + 1
    starts = np.flatnonzero((among[:last] == window[0]).all(axis=1))
    return [int(k) for k in starts if np.array_equal(among[k : k + len(window)], window)]


def begin_of(blocks: list[dict[str, Any]], sound: Waveform, after: int) -> tuple[int, float]:
    """Return the frame at which a sound began after another one, and which share of its first tenth
    of a second was heard.
    """
    # A busy browser may put silence between two blocks, and the tap may miss one.
    blocks = sorted((b for b in blocks if b["frame"] + 128 > after), key=lambda b: b["frame"])
    frames = np.concatenate([block["frame"] + np.arange(128) for block in blocks])
    channels = [np.array(block["channels"], np.float32).T for block in blocks]
    samples_played = np.concatenate([np.broadcast_to(block, (128, 2)) for block in channels])
    samples = sound.at_both_ears(0.0)
    begins, has_one_place = [], []
    for k in range(0, min(len(samples), COMPARED) - 127, 128):
        window = samples[k : k + 128]
        frames_of_k = frames[places_of(window, samples_played)]
        begins.append(frames_of_k[frames_of_k > after] - k)
        has_one_place.append([k] == places_of(window, samples))
    exact = [of_k[0] for of_k, is_exact in zip(begins, has_one_place, strict=True) if is_exact]
    assert exact, f"{sound.name} was not played"
    begin = int(min(exact))
    return begin, float(np.mean([(abs(of_k - begin) < PAGE_RATE_HZ / 2).any() for of_k in begins]))


def test_a_page_plays_every_sample_and_says_when(server: Server, page: Any) -> None:
    answer(page)
    answer(page)
    go_on(page, "() => document.getElementById('main').innerText.includes('Thank you')")
    blocks = page.evaluate(BLOCKS)
    recording = recording_of(server)
    rows, answers = recording.trials(), replies(recording)
    offsets_ms = [block["offset_ms"] for block in blocks]
    hum = at_ear(read_sound(server.root / "hum.wav"), "left")
    start = 0
    for row, reply in zip(rows.to_dict("records"), answers, strict=True):
        tone = Tone(row["pitch"], seconds=0.2)
        waveform = tone_waveform(tone)
        loud = Waveform(
            waveform.name, waveform.samples * np.float32(10 ** (tone.level_db / 20)), PAGE_RATE_HZ
        )
        for part, sound in ((1, loud), (2, hum)):
            sound_report = reply["parts"][part]["sound"]
            start, share = begin_of(blocks, sound, start)
            assert share > 0.9
            assert "output_timestamp" == sound_report["by"]
            at_ms = 1000 * start / PAGE_RATE_HZ + float(np.median(offsets_ms))
            unsure_ms = sound_report["error_ms"] + max(offsets_ms) - min(offsets_ms)
            assert abs(at_ms - sound_report["on_ms"]) <= unsure_ms + 1.0
    whole = rows[rows["frames_dropped"] == 0]
    apart_ms = (whole["beep_sound_on_ns"] - whole["beep_on_ns"]).abs() / 1e6
    assert (apart_ms <= FRAME_MS + whole["beep_sound_error_ms"]).all()
    assert (rows["answer_ms"] > 0).all()


def test_a_sound_that_the_browser_stops_is_flagged_and_begins_again(
    server: Server, page: Any
) -> None:
    go_on(page, f'() => Boolean(document.querySelector("{PART}"))')
    page.evaluate("() => window.tap.context.suspend()")
    page.wait_for_selector("text=The sound of this part could not be played")
    page.get_by_role("button", name="Try again").click()
    answer(page)
    page.reload()  # a page that was loaded anew asks for a gesture, where its browser wants one
    answer(page)
    go_on(page, "() => document.getElementById('main').innerText.includes('Thank you')")
    rows = recording_of(server).trials()
    assert [True, False] == [SOUND_FLAG in flags for flags in rows["flags"]]
    assert rows["hum_sound_on_ns"].notna().all()
