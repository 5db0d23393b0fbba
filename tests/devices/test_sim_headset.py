"""Frames of the simulated headset fall on an integer grid; late frames are dropped and told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.bodies import FixatingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.body.responses import SimulatedResponses
from visavis.lab.clock import SimClock
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceNotFound, ProtocolViolation
from visavis.people.observer import Observer
from visavis.people.person import StudyPerson


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
    heads = [b for b in got if b.schema.name == "head"]
    assert np.concatenate([b.seq for b in heads]).tolist() == [0, 4]


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


def test_poll_returns_the_samples_of_every_stream_it_delivered():
    headset, _, got = started()
    for i in range(40):
        frame = headset.wait_frame()
        headset.submit(frame, (1, 2))
        if i % 3 == 0:
            before = sum(map(len, got))
            count = headset.poll(0.0)
            sample_count = sum(map(len, got)) - before
            assert sample_count == count > 0


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


@pytest.mark.parametrize("standby_s", [(), (0.4,)])
def test_poses_and_timing_left_for_later_are_those_of_every_frame(standby_s):
    def performed(may_wait):
        faults = FaultSchedule.from_config(
            [{"kind": "standby", "start_s": start_s, "duration_s": 0.5} for start_s in standby_s]
        )
        clock, got, told = SimClock(), [], []
        headset = SimulatedHeadset("headset", FixatingBody(), clock, faults=faults)
        headset.open(1.0)
        pump = Pump(headset, got.append, clock)
        pump.start()
        for i in range(200):
            headset.wait_frame()
            if i % 50 == 49:
                clock.sleep_until_ns(clock.now_ns() + 30_000_000)
            pump.step(may_wait=may_wait)
            told.append((headset.head_foreseen(), headset.head_measured()))
        pump.stop()
        return got, told

    (each, told), (seldom, told_later) = performed(False), performed(True)

    assert len(seldom) < 20 < 200 <= len(each)
    for stream in ("head", "head_measured", "frame_timing"):
        assert rows(each, stream).tobytes() == rows(seldom, stream).tobytes()
        for stamp in ("seq", "t_device_ns", "t_host_ns"):
            stamps = [
                np.concatenate([getattr(b, stamp) for b in got if b.schema.name == stream])
                for got in (each, seldom)
            ]
            assert stamps[0].tolist() == stamps[1].tolist()
    for k, stream in enumerate(("head", "head_measured")):
        heads = rows(each, stream)
        assert heads["valid"].tolist() == [poses[k] is not None for poses in told]
        seen = [poses[k] for poses in told_later if poses[k] is not None]
        assert heads["position_m"][heads["valid"]].tolist() == [p.position_m.tolist() for p in seen]
        assert heads["orientation_wxyz"][heads["valid"]].tolist() == [
            p.orientation_wxyz.tolist() for p in seen
        ]


@pytest.mark.parametrize("look_ahead_ms", [None, 25.0])
def test_frames_passed_together_are_those_waited_for_one_by_one(look_ahead_ms):
    def performed(lengths):
        clock, got = SimClock(), []
        body = Observer(3, 5)
        headset = SimulatedHeadset("headset", body, clock, look_ahead_ms=look_ahead_ms)
        headset.open(1.0)
        headset.start(got.append)
        frames = [headset.wait_frame()]
        for n in lengths:
            ahead = headset.frames_ahead(10**15, 20)
            if frames[-1].index == 149:
                body.look_at([0.4, 1.3, -2.0], clock.now_ns())
                assert not headset.holds(ahead)
                ahead = headset.frames_ahead(10**15, 20)
            if n:
                frames.append(headset.pass_frames(ahead, n))
                assert frames[-1].t_ns == clock.now_ns() == ahead.t_ns[n - 1]
            else:
                frames.append(headset.wait_frame())
            headset.poll(0.0)
        headset.stop()
        return frames[-1], got, headset.head_foreseen(), headset.head_measured()

    last, each, *poses = performed([0] * 297)
    together = [20, 0, 3, 7, 0, 0, 20, 19, 1, 20, 20, 20, 15, 0, 20, 20, 20, 20, 20, 20, 20, 8]
    last_together, got, *poses_together = performed(together)

    assert 297 == sum(n or 1 for n in together)
    assert last == last_together
    assert [p.orientation_wxyz.tolist() for p in poses] == [
        p.orientation_wxyz.tolist() for p in poses_together
    ]
    for stream in ("head", "head_measured", "frame_timing"):
        assert rows(each, stream).tobytes() == rows(got, stream).tobytes()


def test_a_person_who_replaced_how_they_see_is_waited_for_frame_by_frame():
    class Own(Observer):
        def see(self, view, t_display_ns):
            self.look_at([0.0, 1.2, -2.0], t_display_ns)

    def frames_ahead(body):
        headset = SimulatedHeadset("headset", body, SimClock())
        headset.open(1.0)
        headset.start(lambda batch: None)
        headset.wait_frame()
        return headset.frames_ahead(10**9, 20)

    assert [None, None] == [frames_ahead(FixatingBody()), frames_ahead(Own(0, 1))]
    people = [Observer(0, 1), StudyPerson(0, 1, responses={})]
    assert [20, 20] == [len(frames_ahead(person).t_ns) for person in people]


class ForeseeablePresser(FixatingBody):
    """Tells when it presses next."""

    def next_press_ns(self):
        return self._presses[0][0] if self._presses else None


@pytest.mark.parametrize("fault", [(), ({"kind": "loss", "start_s": 9.0, "duration_s": 1.0},)])
def test_who_can_tell_when_it_presses_next_is_asked_then(fault):
    def performed(body):
        clock, got = SimClock(), []
        device = SimulatedResponses(
            "responses", body, clock, faults=FaultSchedule.from_config(fault)
        )
        device.open(1.0)
        pump = Pump(device, got.append, clock)
        pump.start()
        asked = 0
        for _ in range(90):
            clock.sleep_until_ns(clock.now_ns() + 11_000_000)
            asked += device.due_ns() <= clock.now_ns()
            pump.step()
        return asked, [(b.t_host_ns.tolist(), b.values.tolist()) for b in got]

    presses = [(200_000_000, "trigger", 1.0), (300_000_000, "trigger", 0.0)]
    always, each = performed(FixatingBody(presses=presses))
    seldom, foreseen = performed(ForeseeablePresser(presses=presses))

    assert 90 == always
    assert (90 if fault else 2) == seldom
    assert 2 == len(each)
    assert each == foreseen


class PresserByItself(ForeseeablePresser):
    """Presses what the class that it inherits from does not foresee."""

    def next_press_ns(self):
        return None


class Inheriting(PresserByItself):
    """Adds presses, and inherits the word that there are none."""

    def presses(self, until_ns):
        return super().presses(until_ns)


@pytest.mark.parametrize(("kind", "due"), [(PresserByItself, False), (Inheriting, True)])
def test_presses_that_an_inherited_forecast_does_not_know_are_asked_for_always(kind, due):
    device = SimulatedResponses("responses", kind(presses=[(1, "trigger", 1.0)]), SimClock())
    assert due is (device.due_ns() == 0)
