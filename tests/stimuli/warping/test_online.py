import threading
from dataclasses import replace

import numpy as np
import pytest

from tests.stimuli.warping.bodies import arm_raised, box_person, waving_clip
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.control import ControlSettings
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.online import OnlineWarp
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.units import units_named
from visavis.stimuli.rooms.solids import box

CENTRE = np.array([0.0, 1.1, 0.0])
FRAME_NS = NS_PER_S // 90
SETTINGS = ControlSettings(rate_hz=10.0)


def camera_at(yaw_deg=25.0, distance_m=3.0):
    yaw = np.radians(yaw_deg)
    eye = CENTRE + distance_m * np.array([-np.sin(yaw), 0.1, -np.cos(yaw)])
    return looking_at(eye, CENTRE, 1.15)


def online(change=0.25, *, clock=None, settings=SETTINGS, things=(), units=("all",)):
    target = (FeatureTarget("coverage", ("face", "right_hand"), change),)
    return OnlineWarp(
        box_person(),
        target,
        units_named(units),
        lambda c: outlook(c, 96, occluders=things),
        clock=clock or SimClock(),
        settings=settings,
    )


def played(warp, seconds=2.0, camera=None):
    """Return the turns of every frame of a standing pose, and the offsets shown."""
    root, turns = arm_raised()
    frames, offsets = [], []
    for k in range(round(seconds * 90)):
        frames.append(warp.turns(k * FRAME_NS, root, turns, camera or camera_at()))
        offsets.append(warp.shown_rad)
    return np.array(frames), np.array(offsets)


def test_target_is_reached_while_being_watched():
    with online() as warp:
        played(warp)
        state = warp.state
        assert state.is_reached
        assert state.seen[0] == pytest.approx(state.goal[0], rel=0.06)
        np.testing.assert_allclose(state.omega_rad, warp.shown_rad, atol=0.05)


def test_frames_move_smoothly_between_solutions():
    with online() as warp:
        _, offsets = played(warp)
    assert np.abs(offsets[-1]).max() > 0.05
    steps = np.abs(np.diff(offsets, axis=0)).max(axis=1)
    # A solution may move a unit by 5°; a frame shows a small part of that.
    assert np.degrees(steps.max()) < 0.6


def test_first_frame_is_the_original():
    root, turns = arm_raised()
    with online() as warp:
        np.testing.assert_array_equal(turns, warp.turns(0, root, turns, camera_at()))


def test_target_equal_to_the_present_changes_no_bit():
    _, turns = arm_raised()
    with online(0.0) as warp:
        frames, _ = played(warp, 0.5)
    np.testing.assert_array_equal(np.broadcast_to(turns, frames.shape), frames)


def test_runs_on_a_virtual_clock_repeat():
    runs = []
    for _ in range(2):
        with online() as warp:
            runs.append(played(warp, 0.6)[0])
    np.testing.assert_array_equal(runs[0], runs[1])


def test_loop_runs_at_its_rate_only():
    with online() as warp:
        played(warp, 1.0)
        assert 9 <= warp.state.steps <= 10


def test_hidden_body_goes_back_to_its_own_motion():
    wall = [box((0, 1.2, -1.2), (8, 8, 0.05), (0, 0, 0))]
    shut = []
    target = (FeatureTarget("coverage", ("face", "right_hand"), 0.25),)
    warp = OnlineWarp(
        box_person(),
        target,
        units_named(("all",)),
        lambda c: outlook(c, 96, occluders=wall if shut else ()),
        clock=SimClock(),
        settings=SETTINGS,
    )
    root, turns = arm_raised()
    with warp:
        played(warp, 1.0)
        before = np.abs(warp.state.omega_rad).max()
        shut.append(True)
        for k in range(90, 4 * 90):
            warp.turns(k * FRAME_NS, root, turns, camera_at())
        assert before > 0.05
        assert np.abs(warp.state.omega_rad).max() < 0.5 * before
        np.testing.assert_array_equal([0.0], warp.state.original)


def test_observer_inside_the_body_holds_the_offsets():
    root, turns = arm_raised()
    inside = camera_at()
    inside = replace(inside, pose=replace(inside.pose, position_m=root + np.array([0, 0.2, 0])))
    with online() as warp:
        played(warp, 0.5)
        held = warp.state.omega_rad
        warp.turns(NS_PER_S, root, turns, inside)
        assert not warp.state.sees
        np.testing.assert_array_equal(held, warp.state.omega_rad)


class StepClock:
    """A real-time clock of a test: sleeping waits until the test lets the loop go on."""

    is_virtual = False

    def __init__(self):
        self.go, self.waiting, self.t_ns = threading.Semaphore(0), threading.Semaphore(0), 0

    def now_ns(self):
        return self.t_ns

    def sleep_until_ns(self, deadline_ns):
        self.waiting.release()
        assert self.go.acquire(timeout=20.0)

    def wall_iso(self):
        return "2000-01-01T00:00:00+00:00"


def test_thread_beside_the_frame_loop_finds_what_the_virtual_clock_finds():
    root, turns = arm_raised()
    with online() as stepped:
        for k in range(4):
            stepped.turns(k * NS_PER_S // 10, root, turns, camera_at())
        expected = stepped.state.omega_rad
    clock = StepClock()
    beside = online(clock=clock)
    for k in range(4):
        beside.turns(k * NS_PER_S // 10, root, turns, camera_at())
        if k:
            clock.go.release()
        assert clock.waiting.acquire(timeout=20.0)
    np.testing.assert_array_equal(expected, beside.state.omega_rad)
    clock.go.release()
    beside.close()


def test_failure_of_the_loop_reaches_the_frame_loop():
    def broken(camera):
        raise ValueError("no such room")

    clock = StepClock()
    warp = OnlineWarp(
        box_person(),
        (FeatureTarget("coverage", ("face",), 0.2),),
        units_named(("all",)),
        broken,
        clock=clock,
        settings=SETTINGS,
    )
    clip = waving_clip()
    warp.turns(0, clip.root_m[0], clip.orientation_wxyz[0], camera_at())
    warp.close()  # waits for the thread
    with pytest.raises(MotionError, match="control loop") as caught:
        warp.turns(1, clip.root_m[0], clip.orientation_wxyz[0], camera_at())
    assert "no such room" in str(caught.value.__cause__)
