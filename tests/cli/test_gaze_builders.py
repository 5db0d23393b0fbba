"""Every eye tracker can stand in a lab's configuration, simulated or real."""

import contextlib

import numpy as np
import pytest

from cli.gaze_builders import DRIVERS, build_gaze
from devices.pump import Pump
from lab.clock import NS_PER_S, SimClock
from lab.config import DeviceConfig
from lab.errors import ConfigError
from lab.geometry import angle_deg
from tests.devices.bodies import FixatingBody

OWN_OPTIONS = {
    "gazepoint": {"camera_up_mm": -150.0, "screen_distance_mm": 700.0},
    "eyelink": {"screen_width_px": 1280, "screen_height_px": 1024, "screen_width_mm": 400.0},
    "hid_gaze": {"screen_center_up_mm": 30.0},
}


def config(name, simulated, options):
    return DeviceConfig(role="eye_tracker", driver=name, simulated=simulated, options=options)


@pytest.mark.parametrize("name", sorted(DRIVERS))
def test_simulated_tracker_measures_the_participant(name):
    clock, body, batches = SimClock(), FixatingBody(5.0, 3.0), []
    with contextlib.ExitStack() as stack:
        device = config(name, True, OWN_OPTIONS.get(name, {}))
        tracker = build_gaze("eye_tracker", device, clock, body, 1, stack)
        tracker.open(2.0)
        pump = Pump(tracker, batches.append, clock)
        pump.start()
        for _ in range(90):
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
            pump.step()
        pump.stop()
        tracker.close()
    seen = np.concatenate([b.values["direction_head"] for b in batches]).astype("f8")
    assert tracker.info.is_simulated
    assert tracker.info.driver == name
    assert np.median(angle_deg(seen, body.direction)) < 12.0  # not calibrated


@pytest.mark.parametrize("name", sorted(DRIVERS))
def test_real_tracker_is_built_without_touching_its_wire(name):
    with contextlib.ExitStack() as stack:
        device = config(name, False, {})
        tracker = build_gaze("eye_tracker", device, SimClock(), None, 1, stack)

    assert not tracker.info.is_simulated


def test_simulated_tracker_without_a_body_is_refused():
    with contextlib.ExitStack() as stack, pytest.raises(ConfigError, match="simulated participant"):
        build_gaze("eye_tracker", config("fove", True, {}), SimClock(), None, 1, stack)


def test_wrong_fault_names_the_place_in_the_configuration():
    device = config("neon", True, {"faults": [{"kind": "los"}]})

    with (
        contextlib.ExitStack() as stack,
        pytest.raises(ConfigError, match=r"devices\.eye_tracker\.faults in lab_config\.yaml"),
    ):
        build_gaze("eye_tracker", device, SimClock(), FixatingBody(), 1, stack)
