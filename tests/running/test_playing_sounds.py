"""Sounds of a study: stamped in the row, recorded, ended with the trial, refused where wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile
from typer.testing import CliRunner

from tests.faults.sessions import lab
from visavis.cli.main import app
from visavis.devices.contracts import SOUND_EVENTS
from visavis.lab.config import DeviceConfig
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError, DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.results.tables.dictionary import trial_columns
from visavis.running.sessions.device_setup import devices_for, simulated_as_before
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

STUDY = """
from visavis import Choice, Factor, Keys, Scene, Study

study = Study("sounds", factors=[Factor("at", ["active", "nowhere"])], calibrate=False)


@study.trial
def trial(t):
    yield t.show(Scene("two_people"), seconds=0.3)
    heard = yield t.play("hum.wav", at="active" if t.at == "active" else None, loops=True)
    yield t.play("hum.wav", wait="end", name="word")
    yield t.mark("said")
    t.row["ms_waited"] = (t.now_ns - t.row["word_on_ns"]) / 1e6
    yield t.dark(0.2)
"""


def perform(folder: Path, *, without: tuple[str, ...] = ()) -> Recording:
    study = find_study(str(folder / "sounds.py"))
    silent = lab(folder / "out")
    sound = DeviceConfig(role="sound", driver="sound_card", simulated=True, options={})
    config = silent.model_copy(update={"devices": {**silent.devices, "sound": sound}})
    request = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    return Recording(perform_new(replace(request, without=without)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    wavfile.write(tmp_path / "hum.wav", 44_100, rng.integers(-9000, 9000, 11_025).astype(np.int16))
    (tmp_path / "sounds.py").write_text(STUDY, encoding="utf-8")
    return tmp_path


def test_row_and_recording_tell_when_every_sound_began(folder: Path) -> None:
    recording = perform(folder)
    told, events = recording.stream("sound"), recording.events()
    began = told[told["event"] == SOUND_EVENTS.index("began")]
    played = events[events["name"] == "sound"]["payload"].tolist()
    rows = recording.trials().to_dict("records")
    stamps = [row[f"{name}_on_ns"] for row in rows for name in ("sound", "word")]
    assert stamps == began["t_sounding_ns"].tolist()
    assert began["sound"].tolist() == [of["number"] for of in played]
    assert ["hum"] * 4 == [of["sound"] for of in played]
    assert 1 == sum(of["x_m"] is not None for of in played)
    assert [250.0, 250.0] == pytest.approx([row["ms_waited"] for row in rows], abs=40.0)


def test_what_still_sounds_ends_with_the_trial(folder: Path) -> None:
    recording = perform(folder)
    told = recording.stream("sound")
    stopped = told[told["event"] == SOUND_EVENTS.index("stopped")]
    starts = recording.events().query("name == 'trial_start'")["t_ns"].tolist()
    assert 0 == stopped["sound"].iloc[0]  # what sounds last may end with the session
    assert stopped["t_sounding_ns"].iloc[0] < starts[1]


@pytest.mark.parametrize(
    ("step", "told"),
    [
        ('t.play("nowhere.wav")', r"nowhere\.wav: cannot be read"),
        ('t.play("sounds.py")', "no WAV file"),
        ('t.play("hum.wav", gain_db=90)', "gain_db is 90"),
        ('t.play("hum.wav", wait="end", loops=True)', "no end to wait for"),
        ('t.play("hum.wav", wait="ever")', "wait is 'ever'; it takes 'onset'"),
    ],
)
def test_sound_that_cannot_be_played_is_refused_before_anybody_comes(
    folder: Path, step: str, told: str
) -> None:
    text = f"{STUDY.split('@study')[0]}\n@study.trial\ndef trial(t):\n    yield {step}\n"
    (folder / "own.py").write_text(text.replace('"sounds"', '"own"'), encoding="utf-8")
    with pytest.raises(DesignError, match=told):
        _ = find_study(str(folder / "own.py")).experiment({}).demands


def test_study_that_plays_needs_the_role_sound(folder: Path) -> None:
    experiment = find_study(str(folder / "sounds.py")).experiment({})
    assert ("sound",) == experiment.needed_roles
    assert ["hum"] == [sound.name for sound in experiment.demands.sounds]


def test_lab_without_sound_is_told_which_role_is_missing(folder: Path) -> None:
    experiment = find_study(str(folder / "sounds.py")).experiment({})
    silent = lab(folder / "out")
    devices = {role: of for role, of in silent.devices.items() if role != "sound"}
    with pytest.raises(ConfigError, match="needs sound under devices"):
        devices_for(silent.model_copy(update={"devices": devices}), experiment)


def test_operator_may_go_on_without_sound_and_the_row_says_that_nobody_knows(folder: Path) -> None:
    text = STUDY.replace("calibrate=False)", 'calibrate=False, spares=["sound"])')
    text = text.replace('    t.row["ms', '    # t.row["ms')
    (folder / "sounds.py").write_text(text, encoding="utf-8")
    recording = perform(folder, without=("sound",))
    assert recording.trials()["sound_on_ns"].isna().all()


def test_sessions_are_analysed_where_the_recordings_they_played_are_not(folder: Path) -> None:
    recording = perform(folder)
    (folder / "hum.wav").unlink()
    experiment = find_study(str(folder / "sounds.py")).experiment({})
    described = trial_columns(experiment, ())
    assert {"sound_on_ns", "word_on_ns"} <= set(recording.trials()) & set(described)


@pytest.mark.parametrize(("study", "parameter"), [("stare", "voice"), ("crowd", "murmur")])
def test_shipped_studies_are_silent_unless_a_lab_gives_a_recording(
    folder: Path, study: str, parameter: str
) -> None:
    silent = find_study(study).experiment({})
    heard = find_study(study).experiment({parameter: str(folder / "hum.wav")})
    assert () == silent.sounds
    assert "sound" not in silent.needed_roles
    assert "sound" in heard.needed_roles
    assert ["hum"] == [sound.name for sound in heard.sounds]


@pytest.mark.parametrize("more", [(), ("--json",)])
def test_a_plan_says_which_recording_is_not_there(folder: Path, more: tuple[str, ...]) -> None:
    config, gone = folder / "lab_config.yaml", folder / "voice.wav"
    config.write_bytes(EXAMPLE.read_bytes())
    ask = ("plan", "stare", "--config", str(config), "--set", f"voice={gone}", *more)
    result = CliRunner().invoke(app, ask)
    assert result.exit_code == 0
    assert "voice.wav: cannot be read" in " ".join(result.stderr.split())
    assert "visavis run" in result.stderr
    if more:
        assert json.loads(result.stdout)["study"] == "stare"
    (folder / "hum.wav").rename(gone)
    assert "voice.wav" not in CliRunner().invoke(app, ask).stderr


def test_session_goes_on_with_the_devices_simulated_that_were_when_it_began(folder: Path) -> None:
    sim = lab(folder / "out")
    eyes = sim.devices["eye_tracker"].model_copy(update={"simulated": False})
    card = DeviceConfig(role="sound", driver="sound_card", simulated=False, options={})
    written = {**sim.devices, "sound": card, "eye_tracker": eyes}
    at_begin = {"sound": {"simulated": True}, "eye_tracker": {"simulated": False}}
    now = simulated_as_before(sim.model_copy(update={"devices": written}), at_begin).devices
    assert [True, False] == [now[role].simulated for role in ("sound", "eye_tracker")]
    assert sim.devices["headset"] == now["headset"]
