"""OpenXR controllers on the genuine loader over the simulated runtime, and on a capture."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.openvr_rigs import passer
from tests.devices.test_openxr import column, poll, running, simulated
from visavis.devices.conformance import check_batches, check_lifecycle, check_response_input
from visavis.devices.contracts import POINTER, DeviceState, ResponseInput
from visavis.devices.drivers.openxr.actions import PROFILES_OF_EXTENSIONS
from visavis.devices.drivers.openxr.controllers import OpenXrControllers
from visavis.devices.sim.openxr import hands
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import ConfigError
from visavis.lab.geometry import rotate

MS = 1_000_000


def make(role, wire, clock, **options):
    return OpenXrControllers(role, wire, clock, **options)


def test_controllers_keep_the_contract_on_runtime_and_capture(tmp_path):
    path = tmp_path / "hands.wire"
    presses = [(i * 50 * MS, "trigger", float(i % 2)) for i in range(60)]
    with simulated(body=FixatingBody(presses=presses)) as (runtime, clock):

        def on_runtime():
            return make(
                "responses", TeeTransport(runtime.library().transport(), path, clock), clock
            )

        assert isinstance(on_runtime(), ResponseInput)
        for check in (check_lifecycle, check_batches, check_response_input):
            check(on_runtime, passer(clock))
    clock = SimClock()

    def replay():
        return make("responses", ReplayTransport(path, clock), clock)

    for check in (check_lifecycle, check_response_input):
        check(replay, passer(clock))


def test_presses_and_releases_come_once_each_by_hand():
    presses = [
        (100 * MS, "trigger", 1.0),
        (200 * MS, "left_grip", 1.0),
        (300 * MS, "trigger", 0.0),
        (400 * MS, "left_grip", 0.0),
    ]
    with running(make, body=FixatingBody(presses=presses)) as (device, _, clock, batches):
        poll(device, clock, 1.0)
        assert device.controls == ("select", "menu", "grip")
        assert column(batches, "control", "responses").tolist() == [0, 2, 0, 2]
        assert column(batches, "value_01", "responses").tolist() == [1, 1, 0, 0]


def test_controls_are_hands_and_parts_and_a_trigger_has_an_axis():
    def chosen(role, wire, clock):
        wanted = {"no": "left select", "yes": "right select", "pull": "right trigger axis"}
        return make(role, wire, clock, controls=wanted)

    presses = [(100 * MS, "left_trigger", 1.0), (200 * MS, "right_trigger", 1.0)]
    with running(chosen, body=FixatingBody(presses=presses)) as (device, _, clock, batches):
        poll(device, clock, 0.5)
        assert column(batches, "control", "responses").tolist() == [0, 1, 2]


def test_rays_point_where_the_hands_do_and_a_missing_hand_points_nowhere():
    body = FixatingBody()
    with running(make, body=body) as (device, runtime, clock, batches):
        runtime.hands.off.add(0)
        poll(device, clock, 0.05)
        rays = np.concatenate([b.values for b in batches if b.schema.name == POINTER.name])
        left, right = rays[rays["hand"] == 0], rays[rays["hand"] == 1]
        assert not left["valid"].any()
        assert np.isnan(left["position_m"]).all()
        t_ns = [int(b.t_host_ns[0]) for b in batches]
        expected = [
            body.head(t)[0] + rotate(body.head(t)[1], np.array([0.25, -0.45, -0.3])) for t in t_ns
        ]
        np.testing.assert_allclose(right["position_m"], expected, atol=1e-6)
        assert not device.check()
        runtime.hands.off.add(1)
        poll(device, clock, 0.05)
        assert "no controller is on" in device.check()[0].message


def test_buzz_reaches_the_hand_for_its_time():
    with running(make) as (device, runtime, _, _):
        device.pulse("right", 1500)
        device.pulse("any", 500)
        assert runtime.hands.pulses == [(1, 1500), (0, 500), (1, 500)]
        with pytest.raises(ConfigError, match="left, right or any"):
            device.pulse("third", 500)


def test_lost_session_is_told_and_hands_come_back():
    fault = {"kind": "disconnect", "start_s": 0.2, "duration_s": 0.5}
    with running(make, fault) as (device, _, clock, batches):
        poll(device, clock, 1.5)
        states = {device.state}
        poll(device, clock, 2.0)
        assert device.state is DeviceState.STREAMING
        assert column(batches, "valid", "pointer")[-1]
        assert states <= {DeviceState.FAULT, DeviceState.STREAMING}
        late = [b for b in batches if b.t_host_ns[0] > 3 * NS_PER_S]
        assert late


def test_unknown_part_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="say left, right or any and one of select"):
        OpenXrControllers("responses", None, SimClock(), controls={"go": "left knob"})


NEWER = {
    "META_TOUCH_CONTROLLER_PLUS": "meta/touch_controller_plus",
    "FB_TOUCH_CONTROLLER_PRO": "facebook/touch_controller_pro",
    "BD_CONTROLLER_INTERACTION": "bytedance/pico4_controller",
    "HTC_VIVE_FOCUS3_CONTROLLER_INTERACTION": "htc/vive_focus3_controller",
}


def test_extensions_of_newer_controllers_bear_the_names_of_the_header():
    xr = pytest.importorskip("xr", reason="pip install pyopenxr")
    names = {getattr(xr, f"{name}_EXTENSION_NAME"): profile for name, profile in NEWER.items()}

    assert {name: profile for name, (profile, _) in PROFILES_OF_EXTENSIONS.items()} == names


@pytest.mark.parametrize("offered", [(), tuple(PROFILES_OF_EXTENSIONS)[:2]])
def test_profiles_of_newer_controllers_are_suggested_where_the_runtime_offers_them(offered):
    with simulated() as (runtime, clock):
        runtime.hands.extensions = list(offered)
        device = make("responses", runtime.library().transport(), clock)
        device.open(1.0)
        device.close()

    suggested = [name for name in NEWER.values() if name in runtime.hands.profiles]
    assert suggested == [PROFILES_OF_EXTENSIONS[name][0] for name in offered]
    assert "khr/simple_controller" in runtime.hands.profiles


def test_profile_whose_path_an_older_revision_lacks_leaves_the_others(monkeypatch):
    pico = "/interaction_profiles/bytedance/pico4_controller"
    monkeypatch.setitem(hands.VALID_PATHS, pico, ("input/trigger/value",))
    with running(make) as (device, runtime, _, _):
        assert device.state is DeviceState.STREAMING
        assert "oculus/touch_controller" in runtime.hands.profiles
