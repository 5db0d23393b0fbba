"""Every driver keeps the contract on its simulator, on a capture of it, and on a stored capture."""

import json

import pytest

from tests.devices.every_driver import (
    capture,
    check_on_replay,
    check_on_simulator,
    checks_of,
)
from tests.wire.record import EXPECTED, FOLDER, FRAMES, decoded, wired
from visavis.devices.conformance import check_headset, collect
from visavis.devices.registry import built_in
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.wirelog import read_wire_log

WITHOUT_WIRE = (
    "simulated_body",
    "simulated_headset",
    "simulated_responses",
    "sound_card",
    "voice_key",
    "voice_and_keyboard",
)
CASES = [(driver, name) for driver in sorted(built_in()) for name in checks_of(driver)]


def need(driver):
    """Skip where the driver's simulator cannot run."""
    library = built_in()[driver].wire.library
    if built_in()[driver].wire.runtime in ("openvr", "openxr"):
        pytest.importorskip(library.module, reason=f"{library.install}")
        if find_compiler() is None:
            pytest.skip("the simulated runtime needs a C compiler: apt-get install gcc")


@pytest.mark.parametrize(("driver", "name"), CASES)
def test_driver_keeps_the_contract_on_its_simulator(driver, name):
    need(driver)
    check_on_simulator(driver, checks_of(driver)[name])


@pytest.mark.parametrize(("driver", "name"), [c for c in CASES if c[0] not in WITHOUT_WIRE])
def test_driver_keeps_the_contract_on_a_capture(driver, name, tmp_path):
    need(driver)
    path = tmp_path / "capturé.wire"
    check = checks_of(driver)[name]

    def as_long(make, let_pass):
        if built_in()[driver].kind in ("armband", "headset", "triggers"):
            check(make, let_pass)  # answers meet their questions: the same calls are made
        else:
            device = make()
            collect(device, let_pass, seconds=2.0)
            device.close()

    assert capture(driver, as_long, path)
    check_on_replay(path, check)


TRACKERS = [name for name in sorted(built_in()) if built_in()[name].kind == "eye tracker"]


@pytest.mark.parametrize("driver", TRACKERS)
def test_every_eye_tracker_takes_its_own_delay_and_tells_it_once_open(driver):
    need(driver)
    told = []

    def opened(make, let_pass):
        device = make()
        device.open(5.0)
        told.append(device.info.gaze_delay_ms)
        device.close()

    check_on_simulator(driver, opened, gaze_delay_ms=12.5)
    assert [12.5] == told


STORED = sorted(path.stem for path in FOLDER.glob("*.wire"))


def test_every_driver_with_a_wire_has_a_stored_capture():
    own_wire = set(built_in()) - {*WITHOUT_WIRE, "simulated_armband"}  # which speaks serial_armband
    assert own_wire == set(STORED)


@pytest.mark.parametrize("driver", STORED)
def test_stored_capture_says_that_it_is_simulated(driver):
    assert read_wire_log(FOLDER / f"{driver}.wire").is_simulated


@pytest.mark.parametrize("driver", STORED)
def test_driver_keeps_the_contract_on_its_stored_capture(driver):
    checks = checks_of(driver)
    kind = built_in()[driver].kind
    if kind == "headset":
        checks = {kind: lambda make, _: check_headset(make, n_frames=FRAMES - 2)}
    elif kind in ("armband", "triggers"):
        checks = {kind: checks[kind]}
    for check in checks.values():
        check_on_replay(FOLDER / f"{driver}.wire", check)


@pytest.mark.parametrize("driver", wired())
def test_stored_capture_decodes_to_the_same_numbers(driver):
    expected = json.loads(EXPECTED.read_text("utf-8"))[driver]
    found = decoded(driver)
    assert expected.keys() == found.keys()
    for stream, numbers in expected.items():
        assert numbers == pytest.approx(found[stream], rel=1e-4, abs=1e-6)
