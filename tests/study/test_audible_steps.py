"""Tones and a lab's own sounds in a trial: onsets, durations, keys, and who hears them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile
from typer.testing import CliRunner

from tests.study.test_press_times import frame
from visavis.cli.main import app
from visavis.cli.quick_tracker import tracker_of
from visavis.devices.contracts import SOUND_EVENTS
from visavis.lab.config import DeviceConfig, LabConfig, load_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import ConfigError, DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import NextFrame
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.quick import quick_study
from visavis.running.sessions.device_setup import devices_for
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.audible import Tone
from visavis.study.responses import Keys
from visavis.study.trial import TrialScript

STUDY = """
from visavis import Factor, Keys, Race, Sound, Study, Text, Tone

study = Study("pitch", "S", factors=[Factor("tone", ["low", "high"])], calibrate=False)

@study.trial
def trial(t):
    hz = {"low": 440, "high": 880}[t.tone]
    yield t.show(Sound("hum.wav", level_db=-30, ear="left"), name="hum")
    keys = Keys("a", "b", right={"low": "a", "high": "b"}[t.tone])
    yield t.show(Tone(hz, seconds=0.2), until=keys, limit_s=2)
    yield t.show([Text("+"), Tone(hz), Tone(2 * hz)], seconds=0.3, name="both")

@study.answer
def answer(seen, response, rng):
    heard = seen.sounds[-1]
    assert abs(heard.level_db + 20) < 1
    return Race({"ab"[heard.pitch_hz > 600]: 2.0}, noise=0.1, other_s=0.3)
"""


def with_sound(config: LabConfig, folder: Path) -> LabConfig:
    sound = DeviceConfig(role="sound", driver="sound_card", simulated=True, options={})
    devices = {**config.devices, "sound": sound}
    roots = {"data_root": folder / "data", "key_root": folder / "keys"}
    return config.model_copy(update={**roots, "devices": devices})


def write_study(folder: Path, text: str = STUDY) -> Path:
    hum = np.random.default_rng(1).integers(-9000, 9000, 22_050).astype(np.int16)
    wavfile.write(folder / "hum.wav", 44_100, hum)
    (folder / "pitch.py").write_text(text, encoding="utf-8")
    return folder / "pitch.py"


def perform(folder: Path, config: LabConfig) -> Recording:
    study = find_study(str(write_study(folder)))
    asked = with_sound(config, folder)
    request = simulated_request(study, study.experiment({}), asked, label="S01", index=0, seed=1)
    return Recording(perform_new(request))


@pytest.fixture(scope="module", params=["monitor", "headset"])
def recording(request, tmp_path_factory):
    example = {"monitor": SCREEN_EXAMPLE, "headset": EXAMPLE}[request.param]
    keyboard = load_config(SCREEN_EXAMPLE).devices["responses"]
    config = load_config(example)
    devices = {**config.devices, "responses": keyboard}
    return perform(tmp_path_factory.mktemp("pitch"), config.model_copy(update={"devices": devices}))


def test_onset_of_every_sound_is_the_stamp_of_its_device(recording):
    stream, trials = recording.stream("sound"), recording.trials()
    began = stream[stream["event"] == SOUND_EVENTS.index("began")]
    names = ["hum_sound", "stimulus_sound", "both_sound", "both_sound2"]
    columns = [f"{name}_on_ns" for name in names]
    assert began["t_sounding_ns"].tolist() == trials[columns].to_numpy().ravel().tolist()


def test_recording_says_which_sound_it_was_and_how_loud(recording):
    events = recording.events()
    played = events.loc[events["name"] == "sound", "payload"].tolist()[:4]
    tone = recording.trials()["tone"][0]
    hz = {"low": 440, "high": 880}[tone]
    assert ["hum", f"{hz} Hz", f"{hz} Hz", f"{2 * hz} Hz"] == [one["sound"] for one in played]
    assert [-20.0] * 3 == [one["gain_db"] for one in played[1:]]
    shown = events.loc[events["name"] == "shown", "payload"].tolist()[1]
    tone = f"Tone(frequency_hz={hz}, seconds=0.2, level_db=-20.0, ear='both')"
    assert f"({tone},)" == shown["option_sounds"]


def test_sound_alone_lasts_as_long_as_it_sounds(recording):
    trials = recording.trials()
    lasts_ms = (trials["stimulus_sound_on_ns"] - trials["hum_sound_on_ns"]) / 1e6
    assert (lasts_ms >= 500.0).all()
    assert lasts_ms.max() < 600.0


def test_press_at_a_sound_counts_from_its_onset_and_answers_what_was_heard(recording):
    trials = recording.trials()
    assert trials["answer_is_right"].all()
    events = recording.events()
    answered = events.loc[events["name"] == "answered", "payload"].tolist()
    onsets = [one["asked_ns"] for one in answered]
    assert trials["stimulus_sound_on_ns"].tolist() == onsets
    assert (trials["answer_ms"] > 300.0).all()


def result_of(action, frames):
    """Perform a step frame by frame; return its result."""

    def whole():
        yield [(yield from action.perform())]

    steps = whole()
    step = next(steps)
    while not isinstance(step, list):
        step = steps.send(next(frames) if isinstance(step, NextFrame) else None)
    return step[0]


def test_press_that_comes_before_the_stamp_of_a_sound_is_kept(tmp_path):
    settings = find_study(str(write_study(tmp_path))).experiment({}).settings
    script = TrialScript(Trial("T1", 1, 0, False, {}, 1), settings)

    pressed = frame(133, ["j"], [130.0])
    frames = iter([frame(100), frame(117), pressed, *map(frame, range(150, 4000, 17))])
    answer = result_of(script.show(Tone(440.0), until=Keys("f", "j")), frames)
    assert ("j", 130_000_000) == (answer.option, answer.answered_ns)


def test_condition_beside_a_sound_alone_ends_it_though_its_stamp_has_not_come(tmp_path):
    settings = find_study(str(write_study(tmp_path))).experiment({}).settings
    script = TrialScript(Trial("T1", 1, 0, False, {}, 1), settings)
    shown = result_of(
        script.show(Tone(440.0), 2.0, until=lambda view: view.t_ns >= 150_000_000),
        map(frame, range(100, 4000, 10)),
    )
    assert 150_000_000 == shown.view.t_ns


def test_power_lets_the_same_people_hear(tmp_path):
    study = find_study(str(write_study(tmp_path)))
    simulated = quick_study(study, study.experiment({}), tracker_of, [0], seed=1)
    assert simulated.trials["answer_is_right"].all()


@pytest.mark.parametrize(
    ("step", "told"),
    [
        ('Sound("nowhere.wav")', r"nowhere\.wav: cannot be read"),
        ('Sound("pitch.py")', "no WAV file"),
        ('Sound("cut.wav")', r"cut\.wav: cut short"),
        ('Sound("hum.wav", level_db=-1)', r"hum\.wav: .* above full scale.*level_db=-1.8"),
        ('Sound("hum.wav", level_db=3)', "level_db is 3"),
        ('Sound("hum.wav", ear="middle")', "ear is 'middle'"),
        ("Tone(5)", "frequency_hz is 5"),
        ("Tone(440, seconds=0)", "seconds is 0"),
        ('[Tone(440), "x"]', "t.show shows a Scene"),
    ],
)
def test_sound_that_cannot_be_played_is_told_at_plan(tmp_path, step, told):
    text = STUDY.replace('[Text("+"), Tone(hz), Tone(2 * hz)], seconds=0.3', f"{step}, seconds=1")
    path = write_study(tmp_path, text)
    (tmp_path / "cut.wav").write_bytes((tmp_path / "hum.wav").read_bytes()[:9000])
    with pytest.raises(DesignError, match=told):
        _ = find_study(str(path)).experiment({}).sounds


def plan_on_a_page(folder, text):
    path = write_study(folder, text.replace("calibrate=False", 'on="browser"'))
    (folder / "lab.yaml").write_bytes(SCREEN_EXAMPLE.read_bytes())
    return CliRunner().invoke(app, ["plan", str(path), "--config", str(folder / "lab.yaml")])


def test_sounds_on_a_page_are_planned(tmp_path):
    assert 0 == plan_on_a_page(tmp_path, STUDY).exit_code


@pytest.mark.parametrize(
    ("step", "told"),
    [
        ('t.play("hum.wav")', "play a sound at a place"),
        ("t.show(Tone(440, seconds=200))", "Tone: 200 s of sound are more than a page loads"),
    ],
)
def test_sound_that_a_page_cannot_play_is_told_at_plan(tmp_path, step, told):
    text = STUDY.replace('t.show(Sound("hum.wav", level_db=-30, ear="left"), name="hum")', step)
    result = plan_on_a_page(tmp_path, text)
    assert told in f"{result.exception} {result.output}"
    assert result.exit_code > 0


def test_place_without_a_loudspeaker_is_told_at_plan(tmp_path):
    experiment = find_study(str(write_study(tmp_path))).experiment({})
    screen = load_config(SCREEN_EXAMPLE)
    silent = {role: of for role, of in screen.devices.items() if role != "sound"}
    with pytest.raises(ConfigError, match=r"pitch needs sound.*sound: {driver: sound_card}`"):
        devices_for(screen.model_copy(update={"devices": silent}), experiment)
