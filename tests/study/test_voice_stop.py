"""Somebody says stop before a monitor: what is shown ends, timed from the onset of the voice."""

from pathlib import Path

import pytest

from visavis.devices.contracts import NO_DEVICE_TIME
from visavis.lab.config import DeviceConfig, LabConfig, load_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.errors import ConfigError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.device_setup import devices_for
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

STUDY = """
from visavis import Factor, Keys, Rating, Scene, Study, WhenNear

study = Study("halt", "S", factors=[Factor("from_m", [1.9, 2.2])], calibrate=False)


@study.trial
def trial(t):
    yield t.dark(0.5)
    stop = Keys("stop", ["voice"], distance_to="person")
    walk = {"motion": "walk", "distance_m": t.from_m}
    yield t.show(Scene("person", **walk), until=stop, limit_s=10)
    yield t.ask(Rating("friendly", 1, 5))


@study.answer
def answer(seen, response, rng):
    return "4" if response.name == "friendly" else WhenNear("voice", within_m=1.5, other_s=0.3)
"""


def lab(folder: Path, driver: str = "voice_and_keyboard") -> LabConfig:
    config = load_config(SCREEN_EXAMPLE)
    key = DeviceConfig(role="responses", driver=driver, simulated=True, options={})
    roots = {"data_root": folder / "data", "key_root": folder / "keys"}
    return config.model_copy(update={**roots, "devices": {**config.devices, "responses": key}})


def perform(folder: Path, text: str = STUDY, **sections: str) -> Recording:
    (folder / "halt.py").write_text(text, encoding="utf-8")
    study = find_study(str(folder / "halt.py"))
    config = lab(folder, **sections)
    request = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    return Recording(perform_new(request))


def test_voice_stops_who_walks_up_and_a_key_answers_the_board(tmp_path: Path) -> None:
    recording = perform(tmp_path)
    rows = recording.trials()
    assert ["voice", "voice"] == rows["stop"].tolist()
    # 0.3 s of seeing and speaking after 1.5 m, more or less by the pace of the person
    assert rows["stop_distance_m"].between(0.9, 1.5).all()
    responses = recording.stream("responses")
    is_voice = responses["t_device_ns"] != NO_DEVICE_TIME
    onsets_ns = responses.loc[is_voice & (responses["value_01"] == 1.0), "t_host_ns"]
    answers = recording.events_named("answered", 1)["payload"]
    stops_ns = [of["answered_ns"] for of in answers if of["question"] == "stop"]
    assert onsets_ns.tolist() == stops_ns
    assert {("4", "keys")} == set(
        zip(rows["friendly"].astype(str), rows["friendly_by"], strict=True)
    )


def test_study_that_listens_is_refused_where_the_laboratory_has_keys_alone(tmp_path: Path) -> None:
    (tmp_path / "halt.py").write_text(STUDY, encoding="utf-8")
    experiment = find_study(str(tmp_path / "halt.py")).experiment({})
    with pytest.raises(
        ConfigError, match=r"'voice', which is no key .*; the drivers voice_key and"
    ):
        devices_for(lab(tmp_path, "keyboard"), experiment)
    assert devices_for(lab(tmp_path, "voice_key"), experiment)
