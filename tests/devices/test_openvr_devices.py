"""OpenVR controllers and trackers on the simulated runtime and on captures of it."""

import contextlib
import threading

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.body_rigs import WalkingBody
from tests.devices.openvr_rigs import passer, simulated_runtime
from visavis.devices.conformance import (
    check_batches,
    check_body_tracker,
    check_lifecycle,
    check_response_input,
)
from visavis.devices.contracts import BodyTracker, DeviceState, ResponseInput
from visavis.devices.drivers.openvr.controllers import OpenVrControllers
from visavis.devices.drivers.openvr.headset import OpenVrHeadset
from visavis.devices.drivers.openvr.trackers import OpenVrTrackers, mount_of
from visavis.devices.pump import Pump
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import ConfigError, DeviceDisconnected
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, rotate

WORN = {"LHR-0A": "left_hand", "LHR-0B": "hips"}


@contextlib.contextmanager
def running(make, *faults, **options):
    with simulated_runtime(*faults, **options) as (runtime, clock):
        device = make(runtime.library().transport(), clock)
        device.open(1.0)
        batches = []
        device.start(batches.append)
        try:
            yield device, runtime, clock, batches
        finally:
            device.close()


def controllers(wire, clock, **options):
    return OpenVrControllers("responses", wire, clock, **options)


def trackers(wire, clock, **options):
    return OpenVrTrackers("body", wire, clock, worn=WORN, **options)


def column(batches, name):
    return np.concatenate([b.values[name] for b in batches])


def test_controllers_keep_the_contract(tmp_path):
    path = tmp_path / "controllers.wire"
    presses = [(i * 50_000_000, "trigger", float(i % 2)) for i in range(60)]
    with simulated_runtime(body=FixatingBody(presses=presses)) as (runtime, clock):

        def make():
            return controllers(TeeTransport(runtime.library().transport(), path, clock), clock)

        assert isinstance(make(), ResponseInput)
        check_lifecycle(make, passer(clock))
        check_response_input(make, passer(clock))
    clock = SimClock()

    def replay():
        return controllers(ReplayTransport(path, clock), clock)

    check_lifecycle(replay, passer(clock))
    check_response_input(replay, passer(clock))


def test_trackers_keep_the_contract_on_runtime_and_capture(tmp_path):
    path = tmp_path / "trackers.wire"
    with simulated_runtime(body=WalkingBody(), trackers=WORN) as (runtime, clock):

        def make():
            return trackers(runtime.library("other").transport(), clock)

        assert isinstance(make(), BodyTracker)
        for check in (check_lifecycle, check_batches, check_body_tracker):
            check(make, passer(clock))
        teed = trackers(TeeTransport(runtime.library("other").transport(), path, clock), clock)
        check_batches(lambda: teed, passer(clock), seconds=2.0)
    clock = SimClock()

    def replay():
        return trackers(ReplayTransport(path, clock), clock)

    for check in (check_lifecycle, check_batches, check_body_tracker):
        check(replay, passer(clock))


def test_a_press_bears_the_time_at_which_it_happened():
    presses = [(400_000_000, "trigger", 1.0), (450_000_000, "left_grip", 1.0)]
    body = FixatingBody(presses=presses)
    with running(controllers, body=body) as (device, _, clock, batches):
        clock.sleep_until_ns(NS_PER_S)
        assert device.poll(0.0) == 2
        stamps = np.concatenate([b.t_device_ns for b in batches])
        assert stamps.tolist() == pytest.approx([400_000_000, 450_000_000], abs=100)
        assert column(batches, "control").tolist() == [0, 1]


def test_controls_can_be_told_apart_by_hand():
    presses = [(1, "left_trigger", 1.0), (2, "right_trigger", 1.0)]

    def make(wire, clock):
        return controllers(wire, clock, controls={"no": "left trigger", "yes": "right trigger"})

    with running(make, body=FixatingBody(presses=presses)) as (device, _, clock, batches):
        # Presses before start are gone; these are made after it.
        assert device.poll(0.0) == 0
        clock.sleep_until_ns(10)
        device.poll(0.0)
        assert column(batches, "control").tolist() == [0, 1]


def test_an_unknown_button_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="say left, right or any and one of system"):
        OpenVrControllers("responses", None, SimClock(), controls={"go": "left knob"})


def test_a_pulse_reaches_the_controller_of_that_hand():
    with running(controllers) as (device, runtime, _, _):
        device.pulse("right", 1500)
        device.pulse("any", 500)
        assert runtime.haptic_pulses == ((2, 1500), (1, 500), (2, 500))


def test_an_axis_is_told_when_it_moves_and_presses_once_past_the_middle():
    def make(wire, clock):
        return controllers(
            wire, clock, controls={"pull": "right trigger axis", "x": "any trackpad x"}
        )

    with running(make) as (device, runtime, _clock, batches):
        for pulled in (0.0, 0.004, 0.3, 0.301, 1.0, 0.0):
            runtime.axes[2] = {1: (pulled, 0.0), 0: (-1.0, 0.5)}
            device.poll(0.0)
        rows = np.concatenate([b.values for b in batches])
        assert rows[rows["control"] == 0]["value_01"].tolist() == pytest.approx([0.3, 1.0, 0.0])
        assert rows[rows["control"] == 1]["value_01"].tolist() == []
        runtime.axes[2] = {0: (1.0, 0.0)}
        device.poll(0.0)
        assert batches[-1].values["value_01"].tolist() == [1.0]


def test_rays_are_the_controllers_own_poses_left_hand_first():
    body = FixatingBody()

    def make(wire, clock):
        return controllers(wire, clock, rays=True)

    with running(make, body=body) as (device, runtime, clock, batches):
        assert [schema.name for schema in device.describe()] == ["responses", "pointer"]
        assert device.poll(0.0) == 2
        place, turn = body.head(clock.now_ns())
        (batch,) = batches
        assert batch.values["hand"].tolist() == [0, 1]
        expected = [place + rotate(turn, np.array([x, -0.45, -0.3])) for x in (-0.25, 0.25)]
        np.testing.assert_allclose(batch.values["position_m"], expected, atol=1e-6)
        runtime.devices[1].is_connected = False
        device.poll(0.0)
        assert batches[-1].values["valid"].tolist() == [False, True]
        assert np.isnan(batches[-1].values["position_m"][0]).all()


def test_headset_and_controllers_share_the_runtime_and_both_hear_its_end():
    with simulated_runtime() as (runtime, clock):
        library = runtime.library()
        headset = OpenVrHeadset("headset", library.transport(), clock)
        hands = controllers(library.transport(), clock)
        for device in (headset, hands):
            device.open(1.0)
            device.start(lambda batch: None)
        runtime.press(1, "trigger", down=True)
        headset.wait_frame()
        headset.poll(0.0)
        assert hands.poll(0.0) == 1
        runtime.quit()
        headset.wait_frame()
        headset.poll(0.0)
        with pytest.raises(DeviceDisconnected):
            hands.poll(0.0)
        assert headset.state is DeviceState.FAULT
        for device in (headset, hands):
            device.close()


def test_trackers_are_told_apart_by_serial_number_not_by_slot():
    with running(trackers, body=WalkingBody(), trackers=dict(reversed(WORN.items()))) as (
        device,
        runtime,
        clock,
        batches,
    ):
        clock.sleep_until_ns(NS_PER_S)
        device.poll(0.0)
        at_ns = batches[-1].t_device_ns[-1:]
        positions, turns = runtime._body.segments(("left_hand", "hips"), at_ns)
        np.testing.assert_allclose(column(batches, "position_m")[-1], positions[0], atol=1e-6)
        found = column(batches, "orientation_wxyz")[-1]
        agreement = np.abs((found * turns[0]).sum(axis=1))
        np.testing.assert_allclose(agreement, 1.0, atol=1e-6)


def test_a_mount_puts_the_segment_back_where_it_is():
    tracker = Pose(np.array([1.0, 2.0, 3.0]), quat_from_yaw_pitch_deg(70.0, 20.0))
    segment = Pose(np.array([1.1, 2.0, 2.9]), quat_from_yaw_pitch_deg(10.0, 0.0))

    def make(wire, clock):
        return trackers(wire, clock, mounts={"LHR-0A": mount_of(tracker, segment)})

    with running(make, body=WalkingBody(), trackers=WORN) as (device, runtime, clock, batches):
        held = next(d for d in runtime.devices if d.serial == "LHR-0A")
        held.pose_at = lambda now_ns, t_ns: (
            tracker.position_m.tolist(),
            tracker.orientation_wxyz.tolist(),
        )
        clock.sleep_until_ns(NS_PER_S)
        device.poll(0.0)
        np.testing.assert_allclose(
            column(batches, "position_m")[-1][0], segment.position_m, atol=1e-5
        )
        np.testing.assert_allclose(
            column(batches, "orientation_wxyz")[-1][0], segment.orientation_wxyz, atol=1e-5
        )


def test_a_tracker_that_is_off_is_named_with_what_is_there():
    with running(trackers, body=WalkingBody(), trackers={"LHR-0A": "left_hand"}) as (
        device,
        _,
        clock,
        batches,
    ):
        clock.sleep_until_ns(NS_PER_S)
        device.poll(0.0)
        texts = " | ".join(f.message for f in device.check())
        assert "trackers not there: LHR-0B; the runtime has LHB-BASE0001" in texts
        assert column(batches, "valid")[-1].tolist() == [True, False]


def test_a_runtime_simulated_in_this_process_is_polled_by_the_sessions_thread():
    with simulated_runtime(clock=SystemClock()) as (runtime, clock):
        device = controllers(runtime.library().transport(), clock)
        device.open(1.0)
        pump = Pump(device, lambda batch: None, clock)
        pump.start()
        threads = {thread.name for thread in threading.enumerate()}
        pump.stop()
        device.close()
    assert "device-responses" not in threads


def test_controllers_that_change_hands_keep_the_controls_of_their_hand():
    with running(controllers) as (device, runtime, clock, _):
        device.poll(0.0)
        device.pulse("left", 500)
        runtime.swap_hands()
        clock.sleep_until_ns(clock.now_ns() + 10_000_000)
        device.poll(0.0)
        device.pulse("left", 500)
        (before, _), (after, _) = runtime.haptic_pulses
    assert {before, after} == {1, 2}
