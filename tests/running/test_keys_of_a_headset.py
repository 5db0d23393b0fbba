"""A key that the responses of a laboratory do not have is told before anybody takes part."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from visavis.cli.main import app  # type: ignore[attr-defined]
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import ConfigError
from visavis.results.opened_study import find_study
from visavis.running.sessions.device_setup import devices_for

STUDY = """
from visavis import Factor, Keys, Study, Text

study = Study("pressed", "S", factors=[Factor("a", [1, 2])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("+"), until=Keys("answer", KEYS), limit_s=1)
"""
NOT_THERE = r"pressed asks for the key 'f', which is not one of trigger .*name this control"


def written(folder: Path, keys: str) -> Path:
    (folder / "pressed.py").write_text(STUDY.replace("KEYS", keys), "utf-8")
    (folder / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    return folder / "pressed.py"


@pytest.mark.parametrize("verb", [["plan"], ["run", "--participant", "1", "--devices", "sim"]])
def test_a_key_that_a_headset_lacks_is_refused_at_plan_and_before_a_session(
    tmp_path: Path, verb: list[str]
) -> None:
    path = written(tmp_path, '["f", "j"]')
    words = [verb[0], str(path), *verb[1:], "--config", str(tmp_path / "lab_config.yaml")]
    answer = CliRunner().invoke(app, words)
    assert isinstance(answer.exception, ConfigError), answer.output
    assert "'f', which is not one of trigger" in str(answer.exception)
    assert [] == list(tmp_path.rglob("ses-*"))


def test_keys_that_a_configuration_names_or_cannot_tell_are_taken(tmp_path: Path) -> None:
    trigger = find_study(str(written(tmp_path, '["trigger"]'))).experiment({})
    assert "responses" in devices_for(load_config(EXAMPLE), trigger).devices
    letters = find_study(str(written(tmp_path, '["f", "j"]'))).experiment({})
    assert "responses" in devices_for(load_config(SCREEN_EXAMPLE), letters).devices
    config = load_config(EXAMPLE)
    controllers = config.devices["responses"].model_copy(
        update={"driver": "openxr_controllers", "options": {"controls": {"trigger": "any select"}}}
    )
    devices = {**config.devices, "responses": controllers}
    with pytest.raises(ConfigError, match=NOT_THERE):
        devices_for(config.model_copy(update={"devices": devices}), letters)


def test_a_key_that_the_configuration_calls_otherwise_is_refused_with_its_name_there(
    tmp_path: Path,
) -> None:
    lab = load_config(SCREEN_EXAMPLE)  # keys: {space: trigger, enter: select}
    space = find_study(str(written(tmp_path, '["space"]'))).experiment({})
    with pytest.raises(ConfigError, match=r"the key 'space', which keys .* calls 'trigger', so"):
        devices_for(lab, space)
    trigger = find_study(str(written(tmp_path, '["trigger"]'))).experiment({})
    assert "responses" in devices_for(lab, trigger).devices
    as_it_is = lab.devices["responses"].model_copy(update={"options": {"keys": {}}})
    own = lab.model_copy(update={"devices": {**lab.devices, "responses": as_it_is}})
    assert "responses" in devices_for(own, space).devices


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ('["F", "J"]', "the key 'F', which is no key of devices.responses; did you mean 'f'?"),
        ('["f", "spacebar"]', "'spacebar', which is no key of devices.responses"),
        ('["return"]', "'return', which is no key of devices.responses; "),
    ],
)
def test_a_key_that_no_keyboard_has_is_refused_with_the_nearest(
    tmp_path: Path, keys: str, says: str
) -> None:
    study = find_study(str(written(tmp_path, keys))).experiment({})
    with pytest.raises(ConfigError, match=re.escape(says)):
        devices_for(load_config(SCREEN_EXAMPLE), study)
