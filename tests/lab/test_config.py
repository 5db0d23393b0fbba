import hashlib
import re
from pathlib import Path
from textwrap import dedent

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field

from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import TAKEN_STREAMS, load_config, parse_config, with_devices
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError


class TrackerOptions(BaseModel):
    model_config = ConfigDict(extra="forbid")
    address: str = "127.0.0.1"
    port: int = Field(default=50020, ge=1, le=65535)
    rate_hz: float = Field(default=120.0, gt=0, le=300)
    gaze_delay_ms: float = 15.0
    timeout_s: float = 2.0
    jitter_ms: float = Field(default=5.0, json_schema_extra={"any_magnitude": True})


class KeyboardOptions(BaseModel):
    keys: list[str] = Field(default_factory=lambda: ["space"])


MODELS = {"pupil_core": TrackerOptions, "keyboard": KeyboardOptions}

GOOD = """\
lab: Somewhere
data_root: data
key_root: keys
privacy: {consent_version: "1"}
devices:
  eye_tracker:
    driver: pupil_core
    gaze_delay_ms: 12
  responses: {driver: keyboard, simulated: true}
"""


def write(folder, text=GOOD):
    path = folder / "lab_config.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def problems(text, models=MODELS):
    with pytest.raises(ConfigError) as caught:
        parse_config(dedent(text), Path("lab_config.yaml"), models)
    return caught.value.problems


def the_problem(old, new, models=MODELS):
    assert old in GOOD
    (only,) = problems(GOOD.replace(old, new), models)
    return only


# ---- what is right ---------------------------------------------------------------------------


def test_the_shipped_configuration_is_valid_and_simulated_throughout():
    config = load_config(EXAMPLE)
    assert ["headset", "eye_tracker", "responses", "body_tracker"] == list(config.devices)[:4]
    assert 4 == sum(role.startswith("armband_") for role in config.devices)
    assert all(device.simulated for device in config.devices.values())
    tracker = config.devices["eye_tracker"]
    assert ("pupil_core", 50020, 120) == (
        tracker.driver,
        tracker.options["port"],
        tracker.options["rate_hz"],
    )


def test_paths_are_relative_to_the_file_whatever_they_are_called(tmp_path):
    folder = tmp_path / "Labor für Wahrnehmung, été 2"
    folder.mkdir()
    config = load_config(write(folder))
    assert (folder / "data", folder / "keys") == (config.data_root, config.key_root)


def test_text_and_hash_are_those_of_the_file(tmp_path):
    path = write(tmp_path)
    config = load_config(path)
    assert GOOD == config.text
    assert hashlib.sha256(path.read_bytes()).hexdigest() == config.sha256
    assert path == config.path


def test_a_kept_copy_of_the_text_gives_the_same_configuration(tmp_path):
    config = load_config(write(tmp_path), MODELS)
    assert config == parse_config(config.text, config.path, MODELS)


def test_options_are_kept_and_defaults_of_the_driver_added(tmp_path):
    plain = load_config(write(tmp_path)).devices["eye_tracker"]
    assert {"gaze_delay_ms": 12} == plain.options
    assert plain.simulated is False
    checked = load_config(write(tmp_path), MODELS).devices["eye_tracker"]
    assert 12.0 == checked.options["gaze_delay_ms"]
    assert 50020 == checked.options["port"]


def test_every_device_can_be_put_on_a_simulated_or_a_real_wire(tmp_path):
    config = load_config(write(tmp_path))
    assert {False, True} == {d.simulated for d in config.devices.values()}
    for kind, expected in (("sim", True), ("real", False)):
        changed = with_devices(config, kind)
        assert {expected} == {d.simulated for d in changed.devices.values()}
        assert config.sha256 == changed.sha256


def test_armbands_have_roles_of_their_own():
    text = GOOD + "  armband_left_upper: {driver: keyboard}\n"
    assert "armband_left_upper" in parse_config(text, Path("c.yaml"), MODELS).devices


# ---- what is wrong ---------------------------------------------------------------------------


def test_a_value_out_of_bounds_is_told_in_one_sentence():
    problem = the_problem("gaze_delay_ms: 12", "port: 70000")
    assert "is 70000; should be less than or equal to 65535" == problem.message


@pytest.mark.parametrize("role", ["heart_belt", "eeg", "heart_rate"])
def test_a_role_of_the_labs_own_name_is_taken(role):
    text = GOOD.replace("  responses:", f"  {role}: {{driver: keyboard}}\n  responses:")

    assert role in parse_config(text, Path("lab_config.yaml"), MODELS).devices


@pytest.mark.parametrize(
    ("role", "message"),
    [
        ("headst", "unknown role; did you mean 'headset'?"),
        ("eyetracker", "unknown role; did you mean 'eye_tracker'?"),
        ("Heart", "cannot be a role"),
        ("gaze", "cannot be a role"),
        ("../belt", "cannot be a role"),
    ],
)
def test_a_misspelt_or_impossible_role_is_refused(role, message):
    told = problems(GOOD.replace("  responses:", f"  {role}: {{driver: keyboard}}\n  responses:"))

    assert [message in problem.message for problem in told] == [True]


def test_every_problem_is_told_at_once_with_file_line_and_key(tmp_path):
    text = (
        GOOD.replace("lab: Somewhere", "lab: 3")
        .replace("privacy", "privcy")
        .replace("pupil_core", "pupil_cor")
        .replace("simulated: true", "simulated: maybe")
    )
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_config(path, MODELS)
    lines = str(caught.value).splitlines()
    assert f"{path} has 5 problems; correct and try again:" == lines[0]
    assert [f"  {path}:{n}" for n in (1, 1, 4, 7, 9)] == [
        re.match(r"(.*?:\d+):", line)[1] for line in lines[1:]
    ]


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "message"),
    [
        ("data_root: data", "data_rot: data", 1, "data_root", "is missing"),
        ("lab: Somewhere", "", 1, "lab", "is missing"),
        ("key_root: keys", "key_root: data/keys", 3, "key_root", "lies in data_root"),
        ("key_root: keys", "key_root: x/../data", 3, "key_root", "lies in data_root"),
        ('consent_version: "1"', "consent_version: 1.0", 4, "privacy.consent_version", "quotes"),
        ('"1"}', '"1", cnotact: x}', 4, "privacy.cnotact", "did you mean 'contact'"),
        ("eye_tracker:", "eye_traker:", 6, "devices.eye_traker", "did you mean 'eye_tracker'"),
        ("pupil_core", "pupil-core", 7, "devices.eye_tracker.driver", "mean 'pupil_core'"),
        ("driver: pupil_core", "address: x", 6, "devices.eye_tracker.driver", "name the driver"),
        ("gaze_delay_ms: 12", f"port: {'9' * 400}", 8, "devices.eye_tracker.port", "65535"),
        (
            "gaze_delay_ms: 12",
            f"rate_hz: {'9' * 400}",
            8,
            "devices.eye_tracker.rate_hz",
            "in hertz",
        ),
        ("gaze_delay_ms: 12", "adress: x", 8, "devices.eye_tracker.adress", "mean 'address'"),
        ("gaze_delay_ms: 12", "simulatd: true", 8, "devices.eye_tracker.simulatd", "'simulated'"),
        ("gaze_delay_ms: 12", "port: 70000", 8, "devices.eye_tracker.port", "equal to 65535"),
        ("{driver: keyboard, simulated: true}", "keyboard", 9, "devices.responses", "{driver: "),
        ("simulated: true", "keyz: [a]", 9, "devices.responses.keyz", "mean 'keys'"),
        ("lab: Somewhere", "lab: A\nlab: B", 2, "lab", "given twice, first on line 1"),
        ("  responses:", "  eye_tracker:", 9, "devices.eye_tracker", "first on line 6"),
    ],
)
def test_a_problem_names_line_key_and_way_out(old, new, line, key, message):
    assert old in GOOD
    errors = problems(GOOD.replace(old, new))
    matching = [p for p in errors if p.key == key and message in p.message]
    assert [line] == [p.line for p in matching]


def test_a_misspelt_top_key_gives_the_nearest():
    errors = problems(GOOD.replace("data_root", "data_rot"))
    assert any("did you mean 'data_root'" in p.message and p.line == 2 for p in errors)


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("gaze_delay_ms: 15ms", "gaze_delay_ms: 15"),
        ("gaze_delay_ms: 0.015 s", "gaze_delay_ms: 15"),
        ('gaze_delay_ms: "1,5"', "gaze_delay_ms: 1.5"),
        ("gaze_delay: 15", "gaze_delay_ms: 15"),
        ("gaze_delay: 15 ms", "gaze_delay_ms: 15"),
        ("gaze_delay_s: 0.015", "gaze_delay_ms: 15"),
        ("gaze_delay_ms: 0.015", "gaze_delay_ms: 15"),
        ("timeout_s: 2000", "timeout_s: 2"),
        ("timeout_ms: 2000", "timeout_s: 2"),
        ("rate_hz: 0.12 kHz", "rate_hz: 120"),
        ("rate: 120 Hz", "rate_hz: 120"),
    ],
)
def test_a_wrong_unit_is_named_with_the_setting_to_write(setting, meant):
    problem = the_problem("gaze_delay_ms: 12", setting)
    unit = {"ms": "milliseconds", "_s": "seconds", "hz": "hertz"}[meant.split(":")[0][-2:]]
    assert 8 == problem.line
    assert unit in problem.message
    assert problem.message.endswith(meant)


def test_a_bound_of_a_setting_with_a_unit_names_the_unit():
    assert "in hertz" in the_problem("gaze_delay_ms: 12", "rate_hz: 1200").message


@pytest.mark.parametrize("setting", ["gaze_delay_ms: 0.3", "gaze_delay_ms: 900", "timeout_s: 60"])
def test_unusual_but_sensible_values_pass(setting):
    parse_config(GOOD.replace("gaze_delay_ms: 12", setting), Path("c.yaml"), MODELS)


def test_a_driver_can_switch_off_doubt_about_magnitude():
    text = GOOD.replace("gaze_delay_ms: 12", "jitter_ms: 0.005")
    options = parse_config(text, Path("c.yaml"), MODELS).devices["eye_tracker"].options
    assert 0.005 == options["jitter_ms"]


def test_units_of_options_are_checked_without_a_model_too():
    assert "gaze_delay_ms: 15" in the_problem("delay_ms: 12", "delay_ms: 15ms", None).message
    assert "seconds" in the_problem("delay_ms: 12", "delay_ms: 0.015", None).message


def test_a_room_in_centimetres_is_noticed():
    (problem,) = problems(GOOD + "room: {width_m: 420}\n")
    assert (10, "room.width_m") == (problem.line, problem.key)
    assert problem.message.endswith("width_m: 4.2")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "expects settings"),
        (b"- a\n- b\n", "expects settings"),
        (b"lab: [1\n", "not valid YAML"),
        (b"lab: x\n\tdata_root: y\n", "indent with spaces"),
        (b"lab: caf\xe9\n", "save the file as UTF-8"),
        (b"lab: &a [*a]\n", "contains itself"),
        (b"? [a]\n: b\n", "not valid YAML"),
        (b"lab: 2026-13-45\n", "cannot be read"),
        (b"lab: !!python/name:os.system\n", "not valid YAML"),
        (b"lab: a\x00b\n", "not valid YAML"),
    ],
)
def test_what_is_no_configuration_at_all_is_refused_with_the_file(tmp_path, data, message):
    path = tmp_path / "c.yaml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=message) as caught:
        load_config(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match="is not there"):
        load_config(tmp_path / "c.yaml")


def test_a_byte_order_mark_does_no_harm(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert "Somewhere" == load_config(path).lab


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.dates()
    | st.text(max_size=8)
    | st.sampled_from(["15ms", "1,5", "pupil_core", "true"]),
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.dictionaries(
            st.integers() | st.booleans() | st.sampled_from(["driver", "simulated", "port", "x"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=5,
)


@given(
    st.sampled_from([(), ("privacy",), ("devices",), ("devices", "eye_tracker")]),
    st.sampled_from(
        ["lab", "data_root", "room", "devices", "eye_tracker", "driver", "gaze_delay_ms", "wording"]
    )
    | st.integers()
    | st.booleans(),
    VALUES,
)
@settings(deadline=None, max_examples=200)
def test_whatever_stands_anywhere_is_accepted_or_refused_with_a_line(place, key, value):
    data = yaml.safe_load(GOOD)
    inner = data
    for part in place:
        inner = inner[part]
    inner[key] = value
    text = yaml.safe_dump(data, allow_unicode=True)
    assert all(1 <= line <= text.count("\n") + 1 for line in refused_lines(text))


def refused_lines(text):
    try:
        parse_config(text, Path("c.yaml"), MODELS)
    except ConfigError as error:
        return [p.line for p in error.problems]
    return []


def test_what_a_model_of_ours_refuses_is_told_in_its_own_words(tmp_path):
    text = EXAMPLE.read_text("utf-8")
    without_address = text.replace(
        "  armband_left_forearm:\n    driver: simulated_armband",
        "  armband_left_forearm:\n    driver: ble_armband",
    )
    with pytest.raises(ConfigError) as refused:
        parse_config(without_address, tmp_path / "c.yaml", OPTION_MODELS)
    assert "armband_left_forearm: give the device's address or the name" in str(refused.value)
    assert "alue error" not in str(refused.value)


def test_no_stream_of_a_session_itself_can_be_a_device_of_the_labs_own():
    from visavis.recording.bids import BOOKKEEPING

    assert BOOKKEEPING <= TAKEN_STREAMS


def test_a_lab_has_reasons_of_its_own_or_those_that_come_along(tmp_path):
    assert "unwell" in load_config(write(tmp_path)).incidents
    own = load_config(write(tmp_path, GOOD + "incidents: {late: came late, fire: fire alarm}\n"))
    assert {"late": "came late", "fire": "fire alarm"} == own.incidents


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("{Late: came late}", "is not a code"),
        ("{late: ' '}", "says nothing"),
        ("{" + ", ".join(f"code_{i}: x" for i in "abcdefghij") + "}", "at most 9"),
    ],
)
def test_a_reason_that_nobody_could_choose_is_refused(tmp_path, said, why):
    with pytest.raises(ConfigError, match=why):
        load_config(write(tmp_path, GOOD + f"incidents: {said}\n"))


def test_example_configuration_is_that_at_the_top_of_the_repository():
    top = Path(__file__).resolve().parents[2] / "lab_config.yaml"
    assert top.read_bytes() == EXAMPLE.read_bytes()
