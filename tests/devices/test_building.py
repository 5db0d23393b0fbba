"""Every driver can stand in a lab's configuration, simulated or real."""

import contextlib

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.body_rigs import WalkingBody
from tests.devices.every_driver import NEEDED
from tests.devices.openvr_rigs import needs_stub
from visavis.devices.building import build_device
from visavis.devices.contracts import GAZE, DeviceState
from visavis.devices.pump import Pump
from visavis.devices.registry import built_in, driver_wiring
from visavis.devices.wiring import no_wire
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceNotFound
from visavis.lab.geometry import angle_deg

TRACKERS = sorted(
    name
    for name, spec in built_in().items()
    if spec.kind == "eye tracker" and spec.wire.runtime != "openxr"
)
REAL = sorted(name for name in built_in() if driver_wiring(name).real is not None)
ON_A_SERIAL_PORT = (
    "serial_armband",
    "vhp_sleeve",
    "ascii_armband",
    "byte_buttons",
    "serial_triggers",
    "xid_buttons",
    "xid_triggers",
)
OPTIONS = {
    "gazepoint": {"camera_up_mm": -150.0, "screen_distance_mm": 700.0},
    "eyelink": {"screen_width_px": 1280, "screen_height_px": 1024, "screen_width_mm": 400.0},
    "hid_gaze": {"screen_center_up_mm": 30.0},
}


def build(name, stack, clock, body, *, simulated=True, **options):
    given = {**NEEDED.get(name, {}), **OPTIONS.get(name, {}), **options}
    config = DeviceConfig(role="eye_tracker", driver=name, simulated=simulated, options=given)
    return build_device(config, clock, body, 1, stack)


@pytest.mark.parametrize("name", TRACKERS)
def test_simulated_tracker_measures_the_participant(name):
    clock, body, batches = SimClock(), FixatingBody(5.0, 3.0), []
    with contextlib.ExitStack() as stack:
        tracker = build(name, stack, clock, body)
        tracker.open(2.0)
        pump = Pump(tracker, batches.append, clock)
        pump.start()
        for _ in range(90):
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
            pump.step()
        pump.stop()
        tracker.close()
    gaze = [b.values["direction_head"] for b in batches if b.schema.name == GAZE.name]
    seen = np.concatenate(gaze).astype("f8")
    assert tracker.info.is_simulated
    assert tracker.info.driver == name
    assert np.median(angle_deg(seen, body.direction)) < 12.0  # not calibrated


@pytest.mark.parametrize("name", REAL)
def test_real_device_is_built_without_touching_its_wire(name):
    own = {**built_in()[name].dialect.options}
    if name in ON_A_SERIAL_PORT:
        own["port"] = "no such port"
    with contextlib.ExitStack() as stack:
        device = build(name, stack, SimClock(), None, simulated=False, **own)

    assert device.state is DeviceState.CLOSED
    assert device.info.driver == name
    assert not device.info.is_simulated


def test_band_without_a_port_names_role_and_cure():
    with (
        contextlib.ExitStack() as stack,
        pytest.raises(DeviceNotFound, match="eye_tracker: no serial port is named; give port"),
    ):
        build("serial_armband", stack, SimClock(), None, simulated=False)


@pytest.mark.parametrize("name", sorted({*built_in()} - {*REAL}))
def test_device_of_simulation_alone_says_so(name):
    with contextlib.ExitStack() as stack, pytest.raises(DeviceNotFound, match="no real"):
        build(name, stack, SimClock(), None, simulated=False)


def test_devices_of_one_runtime_share_it():
    needs_stub()
    clock = SimClock()
    with contextlib.ExitStack() as stack:
        hands = build("openvr_controllers", stack, clock, WalkingBody())
        headset = build("openvr_headset", stack, clock, WalkingBody())
        for device in (hands, headset):
            device.open(1.0)
            assert device.state is DeviceState.OPEN
        for device in (hands, headset):
            device.close()


def test_a_participant_without_limbs_is_told():
    with contextlib.ExitStack() as stack, pytest.raises(ConfigError, match="no limbs to track"):
        build("xsens", stack, SimClock(), FixatingBody())


def test_a_real_tracker_gets_its_port():
    with contextlib.ExitStack() as stack:
        device = build("xsens", stack, SystemClock(), None, simulated=False, port=9770)
        assert device.info.transport == "udp port 9770"


def test_simulated_device_without_a_body_is_refused():
    with (
        contextlib.ExitStack() as stack,
        pytest.raises(ConfigError, match="simulated participant"),
    ):
        build("fove", stack, SimClock(), None)


def test_wrong_fault_is_told_with_its_role():
    with (
        contextlib.ExitStack() as stack,
        pytest.raises(ConfigError, match=r"devices\.eye_tracker .*faults: .*'los'.*'loss'"),
    ):
        build("neon", stack, SimClock(), FixatingBody(), faults=[{"kind": "los"}])


def test_option_that_no_file_was_checked_for_is_refused_by_name():
    with contextlib.ExitStack() as stack, pytest.raises(ConfigError, match=r"eye_tracker .* port"):
        build("neon", stack, SimClock(), FixatingBody(), port=99999)


def test_only_devices_without_a_wire_carry_nothing():
    bare = {name for name in built_in() if driver_wiring(name).simulated is no_wire}
    bare |= {
        "sound_card",
        "voice_and_keyboard",
        "voice_key",
    }  # a library that calls back, which no log could play again
    assert bare == {name for name, spec in built_in().items() if spec.wire.carries == "nothing"}
