"""Tones and sounds on a page without a browser: samples, simulated people, replies, bundles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import wavfile

from tests.running.page.test_flat_on_page import request_of
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import Mark
from visavis.recording.reader import Recording
from visavis.running.film_store import film_store
from visavis.running.live_store import LiveStore, page_files
from visavis.running.page.course import SOUND_FLAG
from visavis.running.page.other_hosts.bundle import files_of, steps_of_place
from visavis.running.page.perform import perform_new
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageError, PageStep, Reply
from visavis.running.page.trial import FilmFailed, perform_on_page
from visavis.running.sound_store import PAGE_RATE_HZ, SoundStore
from visavis.stimuli.audible import Sound, Tone, gain_db_of
from visavis.study.trial import TrialScript

STUDY = """
from visavis import Factor, Keys, Race, Sound, Study, Text, Tone

study = Study("flats", factors=[Factor("tone", ["low", "high"])], on="browser", uses=(),
              calibrate=False)

@study.trial
def trial(t):
    hz = {"low": 440, "high": 880}[t.tone]
    yield t.show(Sound("hum.wav", level_db=-30, ear="left"), name="hum")
    keys = Keys("a", "b", right={"low": "a", "high": "b"}[t.tone])
    yield t.show(Tone(hz, seconds=0.2), until=keys, limit_s=2)
    yield t.show([Text("+"), Tone(hz), Tone(2 * hz)], seconds=0.3, name="both")
    yield t.hush()

@study.answer
def answer(seen, response, rng):
    heard = seen.sounds[-1]
    assert abs(heard.level_db + 20) < 1
    return Race({"ab"[heard.pitch_hz > 600]: 2.0}, noise=0.1, other_s=0.05)
"""
HEARD = {"on_ms": 12.0, "error_ms": 0.5, "latency_ms": 20.0, "by": "output_timestamp"}
PART = {"on_ms": 10.0, "off_ms": 300.0, "frames": 1, "dropped": 0}
SHOWN = {
    "shown_ms": 0.0,
    "parts": [PART | {"sound": HEARD}, PART | {"sound": HEARD | {"on_ms": 212.0}}],
    "screen": {"px_per_mm": None, "distance_mm": None},
    "outside": 0,
    "answer": {"option": "b", "at_ms": 500.0, "by": "keys"},
}


def request(folder: Path) -> Any:
    hum = np.random.default_rng(1).integers(-9000, 9000, (22_050, 2)).astype(np.int16)
    wavfile.write(folder / "hum.wav", 44_100, hum)
    return request_of(STUDY, folder)


def performing(folder: Path) -> tuple[PageStep, Any, TrialScript]:
    experiment = request(folder).experiment
    script = TrialScript(Trial("T1", 1, 0, False, {"tone": "high"}, 1), experiment.settings)
    sounds = SoundStore(experiment.settings.sound_of)
    store = film_store(experiment)
    files = page_files(store, LiveStore(()), is_simulated=True, sounds=sounds)
    going_on = perform_on_page(script, experiment.study.trial_plan, files)
    step = next(going_on)
    assert isinstance(step, PageStep)
    return step, going_on, script


@pytest.mark.parametrize(
    "audible", [Tone(440.0), Tone(880.0, ear="left"), Sound("hum.wav", level_db=-30.0)]
)
def test_a_page_gets_the_samples_that_a_card_plays(audible: Any, tmp_path: Path) -> None:
    settings = request(tmp_path).experiment.settings
    store = SoundStore(settings.sound_of)
    description = store.describe(audible)
    data = store.assets[description["sound"]]
    assert description["bytes"] == len(data)
    sound = settings.sound_of(audible)
    here = sound.at_rate(PAGE_RATE_HZ).at_both_ears(gain_db_of(audible, sound))
    there = np.frombuffer(data, "<f4").reshape(description["channels"], -1).T
    assert np.array_equal(here, np.broadcast_to(there, here.shape))


def test_a_simulated_person_hears_what_the_page_plays_and_presses_in_their_time(
    tmp_path: Path,
) -> None:
    recording = Recording(perform_new(request(tmp_path)))
    rows = recording.trials()
    assert 2 == len(rows)
    assert rows["answer_is_right"].all()
    assert (rows["answer_ms"] >= 200.0).all()  # nobody answers before enough was heard
    lasts_ms = (rows["stimulus_sound_on_ns"] - rows["hum_sound_on_ns"]) / 1e6
    assert lasts_ms.to_numpy() == pytest.approx(500.0, abs=17.0)
    assert (rows["both_sound_on_ns"] == rows["both_sound2_on_ns"]).all()
    assert (rows["both_sound_error_ms"] == 0.0).all()
    assert "px_per_deg" in rows
    events = recording.events()
    played = events.loc[events["name"] == "sound", "payload"].tolist()[:4]
    assert "hum" == played[0]["sound"]
    assert [-20.0] * 3 == [one["gain_db"] for one in played[1:]]


def test_a_press_at_a_sound_alone_counts_from_its_first_sample(tmp_path: Path) -> None:
    step, going_on, script = performing(tmp_path)
    assert ["sound", "tone"] == [part["sounds"][0]["kind"] for part in step.content["parts"][:2]]
    check_reply(step, SHOWN)
    marks = [going_on.send(Reply(SHOWN, 0, lambda ms: round(ms * 1e6)))]
    while isinstance(marks[-1], Mark):
        marks.append(going_on.send(None))
    assert 288.0 == script.row["answer_ms"]
    assert (12_000_000, 0.5) == (script.row["hum_sound_on_ns"], script.row["hum_sound_error_ms"])
    assert [212_000_000] == [m.payload["on_ns"] for m in marks[:-1] if "880" in str(m.payload)]


def test_a_sound_that_the_browser_stopped_is_left_out_by_name(tmp_path: Path) -> None:
    _, going_on, _ = performing(tmp_path)
    failed = {"shown_ms": 0.0, "failed": {"sound": True, "why": "the browser stopped it"}}
    with pytest.raises(FilmFailed, match="sound: the browser stopped it"):
        going_on.send(Reply(failed, 0, lambda ms: 0))


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ([PART, PART], "every part with sounds says when they began"),
        ([PART | {"sound": HEARD | {"by": "ear"}}] * 2, "a sound was timed by 'ear'"),
        ([PART | {"sound": HEARD | {"error_ms": -1}}] * 2, "error_ms is -1"),
        ([PART | {"sound": HEARD | {"on_ms": None}}] * 2, "on_ms is not a number"),
    ],
)
def test_a_forged_reply_about_sound_is_refused(parts: list[Any], says: str, tmp_path: Path) -> None:
    step, _, _ = performing(tmp_path)
    with pytest.raises(PageError, match=says):
        check_reply(step, SHOWN | {"parts": parts})


def test_a_trial_whose_sound_broke_off_is_flagged_though_it_was_heard_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from visavis.running.page.visitor import Visitor

    once: list[int] = []
    reply = Visitor.reply

    def fail_once(self: Visitor, step: PageStep) -> dict[str, Any]:
        first = step.kind == "show" and not once
        once.extend([1] if first else [])
        return reply(self, step) | ({"sound_breaks": 1} if first else {})

    monkeypatch.setattr(Visitor, "reply", fail_once)
    rows = Recording(perform_new(request(tmp_path))).trials()
    assert [True, False] == [SOUND_FLAG in flags for flags in rows["flags"].fillna("")]


def test_a_bundle_has_the_files_of_its_sounds(tmp_path: Path) -> None:
    page_request = request(tmp_path)
    store = film_store(page_request.experiment)
    steps = steps_of_place(page_request, store, 0)
    (preload,) = (step for step in steps if step.kind == "preload")
    names = {sound["sound"] for sound in preload.content["sounds"]}
    assert 4 == len(names)  # the hum, and tones of three pitches
    assert names == set(files_of(store, page_request.experiment)[1])


def test_a_sound_that_cannot_be_played_is_no_silence(tmp_path: Path) -> None:
    page_request = request_of(STUDY, tmp_path)
    with pytest.raises(DesignError, match=r"hum\.wav: cannot be read"):
        steps_of_place(page_request, film_store(page_request.experiment), 0)
