"""Frames of the simulated headset fall on an integer grid; late frames are dropped and told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.faults import FaultSchedule
from devices.sim.body.headset import SimulatedHeadset
from devices.sim.body.responses import SimulatedResponses
from lab.clock import SimClock
from lab.errors import ConfigError, DeviceDisconnected, DeviceNotFound, ProtocolViolation
from tests.devices.bodies import FixatingBody


def started(start_ns=0, **options):
    clock, got = SimClock(start_ns), []
    headset = SimulatedHeadset("headset", FixatingBody(), clock, **options)
    headset.open(1.0)
    headset.start(got.append)
    return headset, clock, got


def rows(got, stream="head"):
    return np.concatenate([b.values for b in got if b.schema.name == stream])


@given(st.integers(0, 10**15), st.sampled_from([72, 90, 120, 144]))
def test_frames_are_on_the_grid_of_the_clock(start_ns, rate_hz):
    headset, _, _ = started(start_ns, display_rate_hz=rate_hz)

    frames = [headset.wait_frame() for _ in range(5)]

    k = frames[0].t_ns * rate_hz // 10**9
    first = next(j for j in (k - 1, k, k + 1) if j * 10**9 // rate_hz >= start_ns)
    assert [f.t_ns for f in frames] == [(first + i) * 10**9 // rate_hz for i in range(5)]
    assert all(f.dropped == 0 for f in frames)


def test_late_frame_counts_those_it_missed():
    headset, clock, got = started()
    headset.wait_frame()
    clock.sleep_until_ns(40_000_000)

    frame = headset.wait_frame()
    headset.poll(0.0)

    assert (frame.index, frame.dropped) == (4, 3)
    assert [int(b.seq[0]) for b in got] == [0, 4]


def test_timing_says_when_images_came_and_what_was_shown_again():
    headset, clock, got = started()
    for i in range(3):
        frame = headset.wait_frame()
        if i == 1:
            clock.sleep_until_ns(40_000_000)
        if i < 2:
            headset.submit(frame, (1, 2))
        headset.poll(0.0)
    headset.stop()

    timing = rows(got, "frame_timing")
    assert timing["frame"].tolist() == timing["pose_seq"].tolist() == [0, 1, 4]
    assert timing["t_submitted_ns"].tolist() == [0, 40_000_000, -1]
    assert timing["skipped"].tolist() == [0, 0, 2]
    assert timing["runtime_dropped"].tolist() == [0, 2, 0]
    assert timing["timing_known"].all()


def test_standby_makes_poses_missing_and_is_a_fault():
    faults = FaultSchedule.from_config([{"kind": "standby", "start_s": 0.5, "duration_s": 0.5}])
    headset, _clock, got = started(faults=faults)
    for _ in range(60):
        headset.wait_frame()
    assert "standby" in headset.check()[0].message
    for _ in range(60):
        headset.wait_frame()
    headset.poll(0.0)

    values = rows(got)
    assert headset.check() == ()
    assert np.isnan(values["position_m"][~values["valid"]]).all()
    assert (~values["valid"]).sum() == 45


def test_rate_of_zero_is_a_configuration_error():
    with pytest.raises(ConfigError, match="display_rate_hz"):
        SimulatedHeadset("headset", FixatingBody(), SimClock(), display_rate_hz=0)


def test_press_arrives_with_its_own_time_and_control():
    clock, got = SimClock(), []
    body = FixatingBody(presses=[(5_000_000, "yes", 1.0), (7_000_000, "no", 1.0)])
    device = SimulatedResponses("buttons", body, clock, controls=("no", "yes"))
    device.open(1.0)
    device.start(got.append)
    clock.sleep_until_ns(10_000_000)
    device.poll(0.0)

    assert got[0].t_host_ns.tolist() == [5_000_000, 7_000_000]
    assert got[0].values["control"].tolist() == [1, 0]


def test_press_of_an_unknown_control_is_refused_by_name():
    clock = SimClock()
    body = FixatingBody(presses=[(5, "lever", 1.0)])
    device = SimulatedResponses("buttons", body, clock)
    device.open(1.0)
    device.start(lambda batch: None)
    clock.sleep_until_ns(10)

    with pytest.raises(ProtocolViolation, match="'lever'"):
        device.poll(0.0)


PRESSES = tuple((1_000_000_000 * i, "trigger", 1.0) for i in range(1, 41))


def arrivals(*faults, seed=0):
    """Poll once a second for 41 s; return (second of arrival, second of the press)."""
    clock, got = SimClock(), []
    schedule = FaultSchedule.from_config(faults)
    body = FixatingBody(presses=list(PRESSES))
    device = SimulatedResponses("buttons", body, clock, faults=schedule, seed=seed)
    device.open(1.0)
    seconds = []
    device.start(lambda b: seconds.extend((now, int(t) // 10**9) for t in b.t_host_ns))
    for now in range(1, 42):
        clock.sleep_until_ns(now * 10**9)
        try:
            device.poll(0.0)
        except DeviceDisconnected:
            got.append(now)
    return seconds, got


def test_presses_while_the_response_device_is_silent_or_away_never_arrive():
    window = {"start_s": 10.0, "duration_s": 5.0}
    for kind, away in (("silence", []), ("disconnect", [10, 11, 12, 13, 14])):
        seconds, gone = arrivals({"kind": kind, **window})
        assert away == gone
        assert [*range(1, 10), *range(15, 41)] == [pressed for _, pressed in seconds]


def test_presses_held_back_arrive_together_with_their_own_times():
    seconds, _ = arrivals({"kind": "burst", "start_s": 10.0, "duration_s": 5.0})
    assert list(range(1, 41)) == [pressed for _, pressed in seconds]
    assert [15] * 6 == [now for now, pressed in seconds if 10 <= pressed <= 15]


def test_presses_are_lost_and_doubled_at_the_share_given_by_the_seed():
    few, _ = arrivals({"kind": "loss", "amount": 0.5}, seed=4)
    assert 10 < len(few) < 30
    assert arrivals({"kind": "loss", "amount": 0.5}, seed=4)[0] == few
    assert 50 < len(arrivals({"kind": "duplicate", "amount": 0.5})[0]) < 70


def test_a_response_device_that_starts_late_is_named_and_opens_later():
    clock = SimClock()
    schedule = FaultSchedule.from_config([{"kind": "late_start", "duration_s": 3.0}])
    device = SimulatedResponses("buttons", FixatingBody(), clock, faults=schedule)
    with pytest.raises(DeviceNotFound, match=r"buttons: .* is away; look at its batteries"):
        device.open(1.0)
    clock.sleep_until_ns(3 * 10**9)
    device.open(1.0)
