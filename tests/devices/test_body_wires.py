"""Xsens MVN and NatNet drivers on simulated wires: contract, truth, faults, clock, real UDP."""

import socket
from functools import partial

import numpy as np
import pytest

from tests.devices.body_rigs import BodyRig, WalkingBody
from tests.devices.openvr_rigs import passer
from visavis.devices.conformance import check_batches, check_body_tracker, check_lifecycle
from visavis.devices.contracts import BodyTracker, DeviceState
from visavis.devices.datagrams import UdpTransport
from visavis.devices.drivers.lsl.body import LslBody
from visavis.devices.drivers.natnet.driver import MOTIVE_BONES, NatNet
from visavis.devices.drivers.vicon.driver import Vicon
from visavis.devices.drivers.xsens.driver import XsensMvn
from visavis.devices.pump import Pump
from visavis.devices.sim.lsl.body import LslBodySimulator
from visavis.devices.sim.natnet import NatNetSimulator
from visavis.devices.sim.vicon import ViconSimulator
from visavis.devices.sim.xsens import XsensSimulator
from visavis.devices.transports import MemoryTransport
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import ConfigError, DeviceNotFound, DeviceTimeout, ProtocolViolation

WORN = {"Wand": "right_hand", "Cap": "head"}
XSENS = (XsensSimulator, XsensMvn, 1_000_000_000)
NATNET = (partial(NatNetSimulator, bodies=WORN), partial(NatNet, bodies=WORN), 5_000 * NS_PER_S)
SKELETON = (partial(NatNetSimulator, bodies=MOTIVE_BONES, skeleton="Bob"), NatNet, 5_000 * NS_PER_S)
LSL = (partial(LslBodySimulator, bodies=WORN), partial(LslBody, objects=WORN), 90 * NS_PER_S)
VICON = (partial(ViconSimulator, bodies=WORN), partial(Vicon, bodies=WORN), 0)
WIRES = pytest.mark.parametrize(
    "wire",
    [XSENS, NATNET, SKELETON, LSL, VICON],
    ids=["xsens", "rigid", "bones", "lsl", "vicon"],
)
NUMBERED = pytest.mark.parametrize("wire", [XSENS, NATNET, VICON], ids=["xsens", "natnet", "vicon"])
TWO = pytest.mark.parametrize("wire", [XSENS, NATNET], ids=["xsens", "natnet"])


def rig_of(wire, *faults, **options):
    return BodyRig(wire[0], wire[1], *faults, **options)


@WIRES
def test_drivers_keep_the_contract(wire):
    rig = rig_of(wire)

    def make():
        simulator = wire[0](rig.body, rig.clock, seed=1)
        return wire[1]("body", MemoryTransport(simulator, rig.clock), rig.clock)

    assert isinstance(make(), BodyTracker)
    check_lifecycle(make, passer(rig.clock))
    check_batches(make, passer(rig.clock))
    check_body_tracker(make, passer(rig.clock))


@WIRES
def test_capture_replays_to_the_same_samples_and_keeps_the_contract(wire, tmp_path):
    path = tmp_path / "body.wire"
    rig = rig_of(wire, wrap=lambda inner, clock: TeeTransport(inner, path, clock))
    rig.start().run(3)
    rig.driver.close()
    clock = SimClock()

    def replay():
        return wire[1]("body", ReplayTransport(path, clock), clock)

    check_lifecycle(replay, passer(clock))
    check_batches(replay, passer(clock))
    check_body_tracker(replay, passer(clock))
    again, batches = replay(), []
    again.open(2.0)
    pump = Pump(again, batches.append, clock)
    pump.start()
    for _ in range(260):
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
        pump.step()
    values = np.concatenate([b.values for b in batches])
    first = np.concatenate([b.values for b in rig.batches])
    overlap = min(len(values), len(first)) - 4
    assert overlap > 160
    values = values[:overlap]
    assert values.tobytes() in (first[i : i + overlap].tobytes() for i in range(4))


@WIRES
def test_segments_are_where_the_body_has_them(wire):
    rig = rig_of(wire).start().run(2)
    since_ns = rig.stamps("t_device_ns") - wire[2]
    positions, turns = rig.body.segments(rig.driver.segments, since_ns)
    assert rig.column("valid").all()
    # MVN's time code has whole milliseconds, in which the body moves by 1 mm.
    np.testing.assert_allclose(rig.column("position_m"), positions, atol=1.5e-3)
    np.testing.assert_allclose(rig.column("orientation_wxyz"), turns, atol=1e-3)


@NUMBERED
def test_lost_samples_are_holes_and_told(wire):
    rig = rig_of(wire, {"kind": "loss", "amount": 0.05}).start().run(10)
    seq = rig.stamps("seq")
    missing = int(seq[-1] - seq[0] + 1 - seq.size)
    assert 0.03 < missing / seq.size < 0.07
    assert "samples were lost on the way" in rig.messages()


@NUMBERED
def test_duplicates_and_late_ones_are_left_out_and_told(wire):
    faults = [{"kind": "duplicate", "amount": 0.2}, {"kind": "reorder", "amount": 0.1}]
    rig = rig_of(wire, *faults).start().run(5)
    assert (np.diff(rig.stamps("seq")) > 0).all()
    assert (np.diff(rig.stamps("t_device_ns")) > 0).all()
    assert "came late or twice" in rig.messages()


@NUMBERED
def test_noise_on_the_wire_is_counted_and_never_delivered(wire):
    rig = rig_of(wire, {"kind": "garbage", "amount": 0.3}).start().run(5)
    assert "could not be read" in rig.messages()
    assert np.isfinite(rig.column("position_m")).all()


@TWO
def test_burst_after_a_stall_arrives_whole_and_in_order(wire):
    rig = rig_of(wire, {"kind": "burst", "start_s": 1.0, "duration_s": 0.5}).start().run(3)
    assert (np.diff(rig.stamps("seq")) == 1).all()
    arrivals = rig.stamps("t_host_ns")
    assert np.max(np.unique(arrivals, return_counts=True)[1]) > 1
    assert "silent" in [e.kind for e in rig.pump.take_events()]


@TWO
def test_lost_tracking_is_nan_and_told(wire):
    rig = rig_of(wire, {"kind": "standby", "start_s": 1.0}).start().run(2)
    assert not rig.column("valid")[-1].any()
    assert np.isnan(rig.column("position_m")[-1]).all()
    assert "not tracked now" in rig.messages()


@TWO
def test_disconnect_is_reported_and_the_stream_comes_back_within_two_seconds(wire):
    fault = {"kind": "disconnect", "start_s": 2.0, "duration_s": 4.0}
    rig = rig_of(wire, fault).start().run(5)
    assert rig.driver.state is DeviceState.FAULT
    rig.run(5)
    assert rig.driver.state is DeviceState.STREAMING
    events = {e.kind: e for e in rig.pump.take_events()}
    assert events["reconnected"].gap_ms == pytest.approx(4000, abs=2000)
    arrivals = rig.stamps("t_host_ns")
    assert (arrivals[arrivals > 6 * NS_PER_S][0] - 6 * NS_PER_S) / 1e9 < 2.0


@TWO
def test_clock_jump_is_told(wire):
    rig = rig_of(wire, {"kind": "clock_jump", "start_s": 1.0, "amount": 3.0}).start().run(3)
    assert "jumps of the tracker's clock" in rig.messages()


@TWO
def test_offset_is_recovered_with_drift_and_jitter(wire):
    rig = rig_of(wire, seed=3, drift_ppm=50.0, delay_ms=2.0, jitter_ms=5.0).start().run(60)
    health = rig.driver.health()
    assert health.clock_drift_ppm == pytest.approx(-50.0, abs=10)
    fit = rig.driver._one_way.fit()
    t_ns = rig.clock.now_ns()
    device_ns = np.array([rig.simulator.device_ns(t_ns)])
    least_delay_ns = 2_000_000
    error_ms = (int(fit.to_host_ns(device_ns)[0]) - t_ns - least_delay_ns) / 1e6
    resolution_ms = 1.0 if wire is XSENS else 0.0
    assert abs(error_ms) < 0.2 + resolution_ms


@pytest.mark.parametrize("kind", ["late_start", "mute"])
def test_a_peer_that_never_answers_is_a_timeout_with_a_remedy(kind):
    rig = rig_of(NATNET, {"kind": kind})
    with pytest.raises(DeviceTimeout, match="switch streaming on"):
        rig.driver.open(1.0)
    assert rig.driver.state is DeviceState.CLOSED


def test_mvn_that_streams_another_type_is_told_by_name():
    rig = rig_of(XSENS, message_type="01")
    with pytest.raises(DeviceTimeout, match=r"only types MXTP01.*Quaternion"):
        rig.driver.open(1.0)


def test_old_motive_is_refused_and_a_newer_one_is_a_warning():
    with pytest.raises(ProtocolViolation, match=r"NatNet 2\.10"):
        rig_of(NATNET, {"kind": "version", "text": "2.10"}).driver.open(1.0)
    rig = rig_of(NATNET, {"kind": "version", "text": "4.9"}).start().run(0.2)
    assert "newer than this driver" in rig.messages()


def test_a_body_motive_does_not_know_is_named():
    drive = partial(NatNet, bodies={**WORN, "Belt": "hips"})
    rig = BodyRig(NATNET[0], drive).start().run(0.5)
    assert "Motive does not know Belt" in rig.messages()
    assert rig.column("valid")[-1].tolist() == [True, True, False]


def test_motive_forgets_a_client_that_is_silent_so_the_driver_keeps_alive():
    rig = rig_of(NATNET).start().run(12)
    assert (np.diff(rig.stamps("seq")) == 1).all()
    rig.driver._tick = lambda now_ns: None
    rig.run(8)
    assert "disconnected" in [e.kind for e in rig.pump.take_events()]


def test_a_sample_cut_into_datagrams_is_put_together():
    rig = rig_of(XSENS, items_per_datagram=9).start().run(1)
    assert rig.column("valid").all()
    assert (np.diff(rig.stamps("seq")) == 1).all()


def test_real_udp_brings_every_datagram():
    clock = SystemClock()
    wire = UdpTransport(clock, local_address="127.0.0.1")
    wire.open(1.0)
    simulator = XsensSimulator(WalkingBody(), SimClock(), seed=1)
    simulator.advance(NS_PER_S)
    sent = [m.frames[0] for m in simulator.outgoing(2 * NS_PER_S)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mvn:
        for datagram in sent:
            mvn.sendto(datagram, ("127.0.0.1", wire.port))
    heard = []
    end_ns = clock.now_ns() + 5 * NS_PER_S
    while len(heard) < len(sent) and clock.now_ns() < end_ns:
        heard += wire.receive(0.5)
    wire.close()
    assert [m.frames[0] for m in heard] == sent
    assert wire.receive(0.0) == []


def test_a_port_that_is_taken_is_said():
    clock = SystemClock()
    first = UdpTransport(clock, local_address="127.0.0.1")
    first.open(1.0)
    second = UdpTransport(clock, local_address="127.0.0.1", local_port=first.port)
    with pytest.raises(DeviceNotFound, match="another port"):
        second.open(1.0)
    first.close()


def test_an_lsl_object_the_stream_does_not_have_is_named_with_those_it_has():
    rig = BodyRig(LSL[0], partial(LslBody, objects={"Belt": "hips"}))
    with pytest.raises(ProtocolViolation, match=r"PositionX.*of 'Belt'; its objects: Cap, Wand"):
        rig.driver.open(1.0)


def test_an_lsl_stream_in_nan_is_lost_and_noise_is_counted():
    rig = rig_of(LSL, {"kind": "standby", "start_s": 1.0}).start().run(2)
    assert not rig.column("valid")[-1].any()
    rig = rig_of(LSL, {"kind": "garbage", "amount": 0.5}).start().run(2)
    assert "could not be read" in rig.messages()


@WIRES
def test_one_segment_that_repeats_its_last_pose_is_held_and_named(wire):
    held = {"kind": "part_frozen", "start_s": 2, "duration_s": 2, "text": "right_hand"}
    rig = rig_of(wire, held).start().run(3)
    assert "right_hand repeats its last pose while the body moves" in rig.messages()
    assert "head" not in rig.messages()
    rig.run(2)
    assert "last pose" not in rig.messages()
    hand = rig.driver.segments.index("right_hand")
    still = (np.diff(rig.column("position_m"), axis=0) == 0).all(axis=2)
    rate_hz = rig.driver.describe()[0].nominal_rate_hz
    assert still[:, hand].sum() == pytest.approx(2 * rate_hz, abs=3)
    assert not np.delete(still, hand, axis=1).any()


@WIRES
def test_a_wire_without_that_segment_refuses_to_freeze_it(wire):
    with pytest.raises(ConfigError, match="no segment left_wing"):
        rig_of(wire, {"kind": "part_frozen", "text": "left_wing"})


@WIRES
def test_a_body_that_moves_is_told_to_the_operator_without_a_frozen_segment(wire):
    assert "last pose" not in rig_of(wire).start().run(5).messages()
