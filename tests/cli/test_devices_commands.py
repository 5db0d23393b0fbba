"""devices list, test, identify, capture and replay, as typed."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from tests.faults.sessions import CONFIG
from visavis.cli.device_report import _named
from visavis.cli.main import app
from visavis.devices.registry import built_in
from visavis.devices.wirelog import read_wire_log
from visavis.lab.errors import UsageError

SHORT = ["--config", str(CONFIG)]


def typed(*arguments: str) -> Result:
    result = CliRunner().invoke(app, ["devices", *arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_list_names_every_role_and_driver() -> None:
    found = json.loads(typed("list", "--json", *SHORT).output)
    assert {d["driver"] for d in found["drivers"]} == set(built_in())
    assert {"driver": "pupil_core", "simulated": True}.items() <= found["roles"][1].items()


def test_missing_library_is_listed_with_the_line_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "visavis.devices.states.is_installed", lambda library: library.module != "bleak"
    )
    found = json.loads(typed("list", "--json", *SHORT).output)
    state = next(d["state"] for d in found["drivers"] if d["driver"] == "neosensory_buzz")
    assert state == "missing: pip install 'visavis[ble]'"


def test_test_tells_rate_and_clock_of_a_device() -> None:
    pytest.importorskip("zmq")
    (tracker,) = json.loads(
        typed("test", "eye_tracker", "--seconds", "0.5", "--json", *SHORT).output
    )
    (gaze,) = tracker["streams"]
    assert 40 < gaze["samples"] < 80
    assert gaze["rate_hz"] == pytest.approx(120.0, rel=0.02)
    assert tracker["clock"]["exchanges"] >= 20
    assert tracker["clock"]["drift_ppm"] is None


@pytest.mark.parametrize("role", ["eye_tracker", "armband_left_forearm"])
def test_captured_wire_is_played_back_without_its_lab(role: str, tmp_path: Path) -> None:
    file = tmp_path / "prise é.wire"
    typed("capture", role, "-o", str(file), "--seconds", "0.5", *SHORT)
    log = read_wire_log(file)
    assert log.is_simulated
    assert log.note["role"] == role
    (trial,) = json.loads(typed("replay", str(file), "--json").output)
    assert trial["error"] == ""
    assert trial["simulated"] is True
    assert trial["streams"][0]["samples"] > 0
    assert [] == [f["message"] for f in trial["faults"] if "acknowledged" in f["message"]]
    if role == "eye_tracker":
        assert trial["streams"][0]["rate_hz"] == pytest.approx(120.0, rel=0.02)


def test_identify_counts_confirmed_pulses() -> None:
    said = typed("identify", "armband_left_forearm", *SHORT).output
    assert "3 pulses sent" in said
    assert "3 confirmed" in said


WRONG: dict[str, tuple[list[str], str]] = {
    "role": (["test", "eyetracker", *SHORT], "did you mean 'eye_tracker'"),
    "seconds": (["test", "--seconds", "0", *SHORT], "0.5 to 3600"),
    "no band": (["identify", "eye_tracker", *SHORT], "armband_left_forearm"),
    "no file": (["replay", "nowhere.wire"], "devices capture"),
    "no wire": (["capture", "headset", "--seconds", "0.5", *SHORT], "no wire"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_refused_with_the_way_out(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, way_out = WRONG[name]
    with pytest.raises(UsageError, match=way_out):
        typed(*arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_wire_is_a_wrong_argument(tmp_path: Path) -> None:
    file = tmp_path / "notes.wire"
    file.write_bytes(b"junk")
    with pytest.raises(UsageError, match="not a wire log"):
        typed("replay", str(file))


def test_capture_never_overwrites(tmp_path: Path) -> None:
    file = tmp_path / "eyes.wire"
    file.write_bytes(b"old")
    with pytest.raises(UsageError, match="left as it is"):
        typed("capture", "eye_tracker", "-o", str(file), *SHORT)
    assert file.read_bytes() == b"old"


def test_absent_device_is_told_with_its_remedy_and_a_code_of_its_own(tmp_path: Path) -> None:
    text = CONFIG.read_text("utf-8").replace(
        "driver: pupil_core\n    simulated: true", "driver: gazepoint\n    simulated: false"
    )
    text = text.replace("port: 50020", "port: 9").replace("rate_hz: 120", "rate_hz: 60")
    config = tmp_path / "lab_config.yaml"
    config.write_text(text, "utf-8")
    result = CliRunner().invoke(
        app, ["devices", "test", "eye_tracker", "--config", str(config), "--json"]
    )
    (trial,) = json.loads(result.output)
    assert result.exit_code == 4
    assert trial["error"]
    assert trial["remedy"]


def test_file_without_driver_asks_for_it(tmp_path: Path) -> None:
    import msgpack

    header: dict[str, Any] = {"format": "visavis-wire", "version": 1, "transport": "zmq"}
    file = tmp_path / "old.wire"
    file.write_bytes(msgpack.packb(header))
    with pytest.raises(UsageError, match="--driver"):
        typed("replay", str(file))


@pytest.mark.parametrize("name", ["gaze", "respiration_belt", "a_name_longer_than_any_column"])
def test_name_of_a_stream_ends_before_its_figures(name: str) -> None:
    assert _named(name, "500 samples").split() == [name, "500", "samples"]
