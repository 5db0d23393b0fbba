"""A lab that cannot run the study is told so before anything is shown, and nothing is recorded."""

from pathlib import Path
from typing import Any

import pytest

import visavis.experiments.crowd.trial
from tests.experiments.crowd.sessions import request, session
from visavis.experiments.crowd.study import plan_session, study
from visavis.experiments.crowd.trial import crowd_scene, laid_out
from visavis.lab.config import Room
from visavis.lab.errors import ConfigError, DeviceError
from visavis.protocol.plan.experiment import Demands
from visavis.protocol.session.rig import unmet
from visavis.study.experiment import StudyExperiment

ARM = ("upper_arm", "lower_arm", "hand")


def refused(folder: Path, **lab: Any) -> str:
    with pytest.raises(DeviceError) as error:
        session(folder, **lab)
    trials = list(folder.glob("simulated/crowd/sub-*/ses-001/part-*/events.jsonl"))
    assert not any("trial_start" in path.read_text("utf-8") for path in trials)
    return str(error.value)


def test_rates_beyond_the_bands_reach_are_refused_before_the_first_walk(tmp_path: Path) -> None:
    message = refused(tmp_path, pattern_low_hz=40)
    assert "armband_left_forearm: the study's vibration swings from 40 to 126 Hz" in message
    assert "57 to 126 Hz" in message
    assert 4 == message.count("set the study's pattern rates")


def test_a_tracker_without_forearms_is_refused_with_what_is_missing(tmp_path: Path) -> None:
    bodies = {f"Rigid {k}": name for k, name in enumerate(("hips", "left_hand", "right_hand"))}
    worn = {"body_tracker": {"driver": "natnet", "bodies": bodies}}
    message = refused(tmp_path, drivers=worn)
    assert "left_upper_arm, left_lower_arm, right_upper_arm, right_lower_arm" in message
    assert "lab_config.yaml" in message


def test_a_room_smaller_than_the_crowd_is_refused_with_its_size(tmp_path: Path) -> None:
    wanted = request(tmp_path)
    small = wanted.config.model_copy(update={"room": Room(name="Lab", width_m=6.0, depth_m=12.0)})
    with pytest.raises(ConfigError, match=r"needs 8\.9 m .* room\.width_m 6 is written"):
        session(tmp_path, config=small)


def test_a_band_with_too_few_motors_is_refused() -> None:
    class Band:
        motor_count = 3
        rate_range_hz = (float("nan"), float("nan"))

    bands: Any = {"armband_left_forearm": Band()}
    found = list(unmet(StudyExperiment(study).demands, (*_segments(), "hips"), bands))
    assert ["blocking"] == [fault.severity for fault in found]
    assert "drives 4 motors, this band has 3" in found[0].message


def test_whoever_demands_nothing_is_refused_nothing() -> None:
    assert [] == list(unmet(Demands(), (), {}))


def test_crowds_are_laid_out_before_anything_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    laid_out.cache_clear()
    two = {"configuration": [1, 2]}
    StudyExperiment(study, two).prepare()

    def too_late(configuration: int, density: float) -> None:
        raise AssertionError(f"crowd {configuration} is laid out while somebody looks")

    monkeypatch.setattr(visavis.experiments.crowd.trial, "station_crowd", too_late)
    for trial in plan_session(0, 1, **two).trials:
        crowd, _ = crowd_scene(trial)
        assert len(crowd.position_m) > 80


def _segments() -> tuple[str, ...]:
    return tuple(f"{side}_{part}" for side in ("left", "right") for part in ARM)
