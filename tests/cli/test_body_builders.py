"""Every headset runtime and body tracker can stand in a lab's configuration."""

from contextlib import ExitStack

import pytest

from cli.body_builders import BODY_BUILDERS
from cli.rigs import BUILDERS
from devices.body_options import BODY_OPTION_MODELS
from devices.contracts import DeviceState
from lab.clock import NS_PER_S, SimClock, SystemClock
from lab.config import DeviceConfig
from lab.errors import ConfigError
from tests.devices.bodies import FixatingBody
from tests.devices.body_rigs import WalkingBody
from tests.devices.openvr_rigs import needs_stub

NEEDED = {
    "openvr_trackers": {"worn": {"LHR-0A": "left_hand"}},
    "lsl_body": {"objects": {"Wand": "right_hand"}},
    "natnet": {"multicast_group": ""},
}


def configured(driver, **options):
    given = {**NEEDED.get(driver, {}), **options}
    return DeviceConfig(role="device", driver=driver, simulated=True, options=given)


def build(driver, stack, clock, body, **options):
    builder = BODY_BUILDERS[driver]
    return builder("device", configured(driver, **options), clock, body, 1, stack)


def test_every_driver_can_be_built_in_a_session():
    assert set(BODY_BUILDERS) == set(BODY_OPTION_MODELS)
    assert set(BODY_BUILDERS) <= set(BUILDERS)


@pytest.mark.parametrize("driver", sorted(BODY_BUILDERS))
def test_a_simulated_device_streams_from_its_configuration(driver):
    if driver.startswith("openxr"):
        pytest.importorskip("xr", reason="pip install pyopenxr")
    if driver.startswith("open"):
        needs_stub()
    clock, batches = SimClock(), []
    with ExitStack() as stack:
        device = build(driver, stack, clock, WalkingBody(presses=[(10, "trigger", 1.0)]))
        device.open(2.0)
        assert device.info.is_simulated
        device.start(batches.append)
        for _ in range(10):
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
            if hasattr(device, "wait_frame"):
                device.wait_frame()
            device.poll(0.0)
        device.close()
    assert batches or driver == "openvr_controllers"


def test_devices_of_one_runtime_share_it():
    needs_stub()
    clock = SimClock()
    with ExitStack() as stack:
        hands = build("openvr_controllers", stack, clock, WalkingBody())
        headset = build("openvr_headset", stack, clock, WalkingBody())
        for device in (hands, headset):
            device.open(1.0)
            assert device.state is DeviceState.OPEN
        for device in (hands, headset):
            device.close()


def test_a_participant_without_limbs_is_told():
    with ExitStack() as stack, pytest.raises(ConfigError, match="no limbs to track"):
        build("xsens", stack, SimClock(), FixatingBody())


def test_a_real_tracker_gets_its_port():
    config = DeviceConfig(role="body", driver="xsens", simulated=False, options={"port": 9770})
    with ExitStack() as stack:
        device = BODY_BUILDERS["xsens"]("body", config, SystemClock(), None, 1, stack)
        assert device.info.transport == "udp port 9770"
        assert not device.info.is_simulated
