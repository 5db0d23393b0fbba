"""A monitor paces the session as a headset does, and says where the eyes are."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices import conformance
from visavis.devices.contracts import FRAME_TIMING, GAZE, HEAD
from visavis.devices.screen.display import ScreenDisplay
from visavis.devices.screen.resting_body import BodyBeforeScreen, before_screen
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.geometry import Pose, rotate
from visavis.lab.schema import SampleBatch
from visavis.lab.screen import FlatScreen
from visavis.people.observer.observer import Observer

MS = 1_000_000
SCREEN = FlatScreen(0.5, 0.3, 1000, 600, 0.6)
PLACE = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))


class Refreshing:
    """A monitor that refreshes every `period_ns`, and a window that forwards nothing."""

    closed = False

    def __init__(self, clock, period_ns):
        self.clock, self.period_ns, self.shown = clock, period_ns, []

    def attend(self, until_ns):
        self.clock.sleep_until_ns(max(until_ns, self.clock.now_ns()))

    def flip(self, image):
        now_ns = self.clock.now_ns()
        self.clock.sleep_until_ns((now_ns // self.period_ns + 1) * self.period_ns)
        self.shown.append((self.clock.now_ns(), image))
        return self.clock.now_ns()


def display(clock, **more):
    return ScreenDisplay(SCREEN, PLACE, clock, rate_hz=100, **more)


def streaming(clock, **more):
    found = display(clock, **more)
    batches = []
    found.open(1.0)
    found.start(batches.append)
    return found, batches


@pytest.mark.parametrize("tracked", [False, True])
def test_it_keeps_the_contract_of_what_paces_a_session(tracked):
    clock = SimClock()
    conformance.check_lifecycle(
        lambda: display(clock, is_tracked=tracked),
        lambda seconds: clock.sleep_until_ns(clock.now_ns() + round(seconds * NS_PER_S)),
    )
    conformance.check_headset(lambda: display(clock, is_tracked=tracked))


def test_frames_begin_with_the_monitors_refresh_and_say_when_their_picture_was_shown():
    clock = SimClock()
    screen, batches = streaming(clock)
    monitor = Refreshing(clock, 10 * MS)
    screen.attach(monitor)
    frame = screen.wait_frame()
    for number in range(3):
        screen.submit(frame, [f"picture {number}"])
        frame = screen.wait_frame()
        screen.poll(0.0)
    assert [image for _, image in monitor.shown] == ["picture 0", "picture 1", "picture 2"]
    flips = [t for t, _ in monitor.shown]
    assert np.diff(flips).tolist() == [10 * MS, 10 * MS]
    assert frame.t_ns == flips[-1]
    timing = [b for b in batches if b.schema.name == FRAME_TIMING.name]
    assert [int(b.t_device_ns[0]) for b in timing] == flips
    assert [int(b.values["frame"][0]) for b in timing] == [0, 1, 2]


def test_a_picture_that_comes_late_is_a_dropped_frame():
    clock = SimClock()
    screen, batches = streaming(clock)
    screen.attach(Refreshing(clock, 10 * MS))
    frame = screen.wait_frame()
    screen.submit(frame, ["in time"])
    frame = screen.wait_frame()
    clock.sleep_until_ns(clock.now_ns() + 25 * MS)  # the study computed for so long
    screen.submit(frame, ["late"])
    late = screen.wait_frame()
    screen.poll(0.0)
    assert (late.index, late.dropped) == (frame.index + 3, 2)
    told = [b for b in batches if b.schema.name == FRAME_TIMING.name][-1]
    assert int(told.values["runtime_dropped"][0]) == 2


def test_a_monitor_without_refresh_is_paced_by_the_clock():
    class Idle(Refreshing):
        def flip(self, image):
            return self.clock.now_ns()

    clock = SimClock()
    screen, _ = streaming(clock)
    screen.attach(Idle(clock, 1))
    frame = screen.wait_frame()
    times = [frame.t_ns]
    for _ in range(5):
        screen.submit(frame, ["x"])
        frame = screen.wait_frame()
        times.append(frame.t_ns)
    assert np.diff(times).tolist() == [10 * MS] * 5


def test_a_closed_window_is_a_fault_that_blocks():
    clock = SimClock()
    screen, _ = streaming(clock)
    monitor = Refreshing(clock, 10 * MS)
    screen.attach(monitor)
    assert screen.check() == ()
    monitor.closed = True
    (fault,) = screen.check()
    assert fault.severity == "blocking"
    assert screen.wait_frame().t_ns <= screen.wait_frame().t_ns  # the session goes on, to pause


def seen_at(origin_m, t_ns, *, valid=True):
    values = np.zeros(1, GAZE.dtype)
    values["origin_m"], values["valid"] = origin_m, valid
    stamp = np.array([t_ns])
    return SampleBatch(GAZE, np.array([0]), stamp, stamp, values)


def heads(screen, batches):
    screen.wait_frame()
    screen.poll(0.0)
    row = next(b for b in reversed(batches) if b.schema.name == HEAD.name).values[0]
    return row["position_m"].astype(float).round(4).tolist(), bool(row["valid"])


def test_a_fixed_head_rests_at_the_viewing_place():
    clock = SimClock()
    screen, batches = streaming(clock)
    screen.watch(seen_at((0.1, 0.0, 0.0), 0))
    assert heads(screen, batches) == ([0.0, 1.2, 0.0], True)


def test_a_tracked_head_is_where_the_tracker_found_the_eyes():
    clock = SimClock()
    screen, batches = streaming(clock, is_tracked=True)
    assert heads(screen, batches) == ([0.0, 1.2, 0.0], False)
    screen.watch(seen_at((0.05, -0.02, 0.1), clock.now_ns()))
    assert heads(screen, batches) == ([0.05, 1.18, 0.1], True)
    screen.watch(seen_at((np.nan, 0.0, 0.0), clock.now_ns()))
    screen.watch(seen_at((3.0, 0.0, 0.0), clock.now_ns()))
    screen.watch(seen_at((0.2, 0.0, 0.0), clock.now_ns(), valid=False))
    assert heads(screen, batches) == ([0.05, 1.18, 0.1], True)
    clock.sleep_until_ns(clock.now_ns() + NS_PER_S)
    assert heads(screen, batches) == ([0.05, 1.18, 0.1], False)


@pytest.mark.parametrize(("yaw_deg", "pitch_deg"), [(0.0, 0.0), (12.0, -5.0), (-8.0, 9.0)])
def test_a_body_in_the_chin_rest_looks_at_the_same_point_of_the_world(yaw_deg, pitch_deg):
    body = FixatingBody(yaw_deg, pitch_deg, distance_m=1.5)
    place = Pose(np.array([0.05, 1.25, 0.1]), np.array([1.0, 0.0, 0.0, 0.0]))
    t_ns = np.array([0, 3 * NS_PER_S])
    position, turn = body.head(int(t_ns[1]))
    point = position + rotate(turn, body.point_m)
    eyes = BodyBeforeScreen(body, place).eyes(t_ns)[1]
    for name, side in (("left", -0.032), ("right", 0.032)):
        expected = point - (place.position_m + np.array([side, 0.0, 0.0]))
        expected /= np.linalg.norm(expected)
        assert eyes[f"{name}_direction_head"] == pytest.approx(expected, abs=1e-6)
    assert BodyBeforeScreen(body, place).head(0)[0] == pytest.approx(place.position_m)


def _rows(batches, name):
    some = [batch for batch in batches if batch.schema.name == name]
    stamps = [np.stack([b.seq, b.t_device_ns, b.t_host_ns], axis=1) for b in some]
    return np.concatenate(stamps).tolist(), b"".join(batch.values.tobytes() for batch in some)


def test_frames_that_pass_together_are_those_one_waits_for():
    def perform(*, together):
        clock = SimClock(1_234_567)
        screen, batches = streaming(clock)
        screen.seat(before_screen(Observer(2, 5), PLACE))
        frames = [screen.wait_frame()]
        if together:
            ahead = screen.frames_ahead(frames[0].t_ns + 8 * 10 * MS + 1, 30)
            assert 8 == len(ahead.t_ns)
            assert screen.holds(ahead)
            frames.append(screen.pass_frames(ahead, 8))
        else:
            frames += [screen.wait_frame() for _ in range(8)]
        frames.append(screen.wait_frame())
        screen.poll(0.0)
        return frames[-2:], clock.now_ns(), batches

    (each, each_ns, of_each), (last, last_ns, of_last) = (
        perform(together=False),
        perform(together=True),
    )
    assert each == last
    assert each_ns == last_ns
    for name in (HEAD.name, FRAME_TIMING.name):
        assert _rows(of_each, name) == _rows(of_last, name)
        assert 9 <= len(_rows(of_last, name)[0]) <= 10


@pytest.mark.parametrize("why", ["tracked", "no plans", "few", "window"])
def test_frames_are_not_told_ahead_where_they_may_come_otherwise(why):
    clock = SimClock()
    screen, _ = streaming(clock, is_tracked=why == "tracked")
    body = FixatingBody() if why == "no plans" else Observer(2, 5)
    screen.seat(before_screen(body, PLACE))
    frame = screen.wait_frame()
    if why == "window":
        screen.attach(Refreshing(clock, 10 * MS))
    assert screen.frames_ahead(frame.t_ns + 1000 * MS, 2 if why == "few" else 30) is None
