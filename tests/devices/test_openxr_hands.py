"""Hand joints on the genuine OpenXR loader: where they are, what a runtime refuses, loss."""

import ctypes
import struct

import numpy as np
import pytest

from tests.devices.body_rigs import WalkingBody
from tests.devices.openvr_rigs import passer
from tests.devices.test_openxr import column, poll, running, simulated
from visavis.devices.conformance import check_batches, check_body_tracker, check_lifecycle
from visavis.devices.drivers.openxr.hand_joints import OpenXrHands
from visavis.devices.drivers.openxr.joints import JOINT, JOINTS
from visavis.devices.sim.openxr.joints import offsets_m
from visavis.devices.transports import MemoryTransport, Message
from visavis.lab.clock import SimClock
from visavis.lab.errors import DeviceNotFound
from visavis.lab.geometry import quat_from_yaw_pitch_deg, quat_multiply, rotate

HANDS = ("left_hand", "right_hand")


def test_joints_have_the_extensions_order_and_layout():
    xr = pytest.importorskip("xr", reason="pip install pyopenxr")
    assert [joint.name.lower() for joint in xr.HandJointEXT] == list(JOINTS)
    location = xr.HandJointLocationEXT
    assert ctypes.sizeof(location) == JOINT.itemsize == struct.calcsize("<Q8f")
    assert (location.pose.offset, location.radius.offset) == (
        JOINT.fields["turn_xyzw"][1],
        JOINT.fields["radius_m"][1],
    )


def test_driver_keeps_the_contract():
    with simulated(body=WalkingBody()) as (runtime, clock):

        def make():
            return OpenXrHands("hands", runtime.library().transport(), clock)

        for check in (check_lifecycle, check_batches, check_body_tracker):
            check(make, passer(clock))


def test_joints_are_the_bodys_and_a_flat_hand_in_a_t_pose_is_the_identity():
    body = WalkingBody()
    with running(OpenXrHands, body=body) as (device, _, clock, batches):
        poll(device, clock, 1.0)
    places, turns = body.segments(HANDS, np.concatenate([b.t_device_ns for b in batches]))
    seen_m, seen = (
        column(batches, "position_m", "device"),
        column(batches, "orientation_wxyz", "device"),
    )
    assert column(batches, "valid", "device").all()
    for hand in (0, 1):
        turned = quat_multiply(turns[:, hand], quat_from_yaw_pitch_deg(90.0 - 180.0 * hand))
        for joint, offset in enumerate(offsets_m(hand)):
            row = hand * len(JOINTS) + joint
            where = places[:, hand] + rotate(turned, np.array(offset))
            np.testing.assert_allclose(seen_m[:, row], where, atol=1e-5)
            dots = np.abs((seen[:, row] * turns[:, hand]).sum(axis=-1))
            np.testing.assert_allclose(dots, 1.0, atol=1e-6)


def test_fingers_of_a_t_pose_point_outwards():
    for hand, outwards in ((0, -1.0), (1, 1.0)):
        turn = quat_from_yaw_pitch_deg(90.0 - 180.0 * hand)
        tip = rotate(turn, np.array(offsets_m(hand)[JOINTS.index("middle_tip")]))
        thumb = rotate(turn, np.array(offsets_m(hand)[JOINTS.index("thumb_tip")]))
        assert tip[0] * outwards > 0.1
        assert thumb[2] < -0.02  # palms down, thumbs ahead


def test_hand_that_is_not_followed_is_missing_and_the_other_goes_on():
    with running(OpenXrHands, body=WalkingBody()) as (device, runtime, clock, batches):
        poll(device, clock, 0.5)
        runtime.hands.off.add(0)
        poll(device, clock, 0.5)
        last = batches[-1].values[-1]
        messages = " ".join(fault.message for fault in device.check())
    assert not last["valid"][: len(JOINTS)].any()
    assert last["valid"][len(JOINTS) :].all()
    assert np.isnan(last["position_m"][: len(JOINTS)]).all()
    assert "not tracked now: left_palm" in messages


def test_inferred_joint_is_missing():
    device = OpenXrHands("hands", MemoryTransport(None, SimClock()), SimClock())
    joints = np.zeros(2 * len(JOINTS), JOINT)
    joints["turn_xyzw"][:, 3], joints["flags"] = 1.0, 0b1111
    joints["flags"][3], joints["flags"][4] = 0b0011, 0b1101
    joints["turn_xyzw"][5] = 0.0
    frames = (b"joints", b"", struct.pack("<qq", 5, 7) + joints.tobytes())
    (sample,) = device._decode(Message(6, frames, 4))
    assert sample.t_device_ns == 5
    assert np.flatnonzero(~sample.valid).tolist() == [3, 4, 5]


def test_runtime_without_hand_tracking_is_named():
    with simulated() as (runtime, clock):
        runtime.joints.is_supported = False
        device = OpenXrHands("hands", runtime.library().transport(), clock)
        with pytest.raises(DeviceNotFound, match="tracks no hands; switch hand tracking on"):
            device.open(1.0)
        device.close()


@pytest.mark.parametrize(("count", "time", "result"), [(25, 1, -1), (26, 0, -30)])
def test_simulated_runtime_refuses_what_is_an_error(count, time, result):
    with running(OpenXrHands, body=WalkingBody()) as (_, runtime, _clock, _batches):
        xr = pytest.importorskip("xr")
        located = xr.HandJointLocationsEXT()
        located.joint_count = count
        info = xr.HandJointsLocateInfoEXT(time=time)
        handle = next(iter(runtime.joints._hand_of))
        answer = runtime.joints._xr_LocateHandJointsEXT(
            handle, ctypes.pointer(info), ctypes.pointer(located)
        )
    assert answer == result


def test_streams_of_two_trackers_have_their_own_names():
    wire = MemoryTransport(None, SimClock())
    trackers = [OpenXrHands(role, wire, SimClock()) for role in ("body_tracker", "hands")]
    assert [tracker.describe()[0].name for tracker in trackers] == ["body", "hands"]
