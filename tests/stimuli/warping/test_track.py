"""A track corrected ahead of what is shown: what was shown stays, what comes follows the eye."""

from concurrent.futures import Executor, Future

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stimuli.warping.bodies import arm_raised, box_person
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Situation,
    see,
    steer,
    tolerance_of,
)
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.track import SHOWN_AHEAD_S, TrackLoop, WarpTrack, solve_offsets
from visavis.stimuli.motion.warping.units import units_named
from visavis.study.background import InlineExecutor

UNITS = units_named(("neck_head",))
START_S, GAP_S, FADE_S = 1.0, 1 / 30, 0.5
FRAME_S = 1 / 90
EYE = np.array([0.0, 1.6, 0.0])


def track(keys=31, seed=0):
    omega = np.random.default_rng(seed).normal(0.0, 0.2, (keys, len(UNITS)))
    return WarpTrack(UNITS, START_S, GAP_S, omega, FADE_S)


class Later(Executor):
    """Perform what it is given some frames later."""

    def __init__(self, frames):
        self.frames, self.waiting = frames, []

    def submit(self, fn, /, *args):
        future = Future()
        self.waiting.append([self.frames, future, fn, args])
        return future

    def tick(self):
        for entry in self.waiting:
            entry[0] -= 1
            if entry[0] == 0:
                entry[1].set_result(entry[2](*entry[3]))


def test_offsets_pass_through_the_keys():
    one = track()
    for t_s, omega in zip(one.key_s, one.omega_rad, strict=True):
        np.testing.assert_allclose(omega, one.at(t_s), atol=1e-9)


def test_offsets_come_in_before_the_first_key_and_go_out_after_the_last():
    one = track()
    assert not one.at(START_S - FADE_S).any()
    assert not one.at(one.key_s[-1] + FADE_S).any()
    np.testing.assert_allclose(one.omega_rad[0] / 2, one.at(START_S - FADE_S / 2))


@given(key=st.integers(0, 30), t_s=st.floats(0.0, 3.0))
def test_a_key_that_is_open_at_a_time_changes_nothing_up_to_it(key, t_s):
    one = track()
    other = one.with_key(key, np.array([0.4, -0.4, 0.1]))
    if key >= one.first_open(t_s):
        for earlier in np.linspace(0.0, t_s, 50):
            np.testing.assert_array_equal(one.at(earlier), other.at(earlier))


def test_keys_after_a_corrected_one_are_shifted_by_as_much_within_their_range():
    one = track()
    other = one.with_key(3, one.omega_rad[3] + 0.05)
    np.testing.assert_array_equal(one.omega_rad[:3], other.omega_rad[:3])
    np.testing.assert_allclose(one.omega_rad[3:] + 0.05, other.omega_rad[3:])
    far = one.with_key(3, np.full(len(UNITS), 9.0))
    assert (far.omega_rad[4:] <= np.radians([u.range_deg for u in UNITS])).all()


def moved(t_s, start_rad, eye_m):
    return start_rad + 0.001 * eye_m[1]


def frames(loop, beside=None, until_s=2.2):
    """Return the offsets drawn for every frame, a frame's light leaving after it was shown."""
    drawn = []
    for k in range(round(until_s / FRAME_S)):
        if isinstance(beside, Later):
            beside.tick()
        loop.step(k * FRAME_S, EYE)
        drawn.append((k * FRAME_S + SHOWN_AHEAD_S, loop.track))
    return drawn


@pytest.mark.parametrize("beside", [InlineExecutor(), Later(1), Later(8)])
def test_what_a_frame_showed_is_what_the_last_track_says_of_its_time(beside):
    loop = TrackLoop(track(), moved, beside)
    drawn = frames(loop, beside)
    assert loop.n_taken > 10
    for t_s, then in drawn:
        np.testing.assert_array_equal(loop.track.at(t_s), then.at(t_s))


def test_every_key_is_corrected_once_where_solutions_come_at_once():
    asked = []
    loop = TrackLoop(track(), lambda t_s, start, eye: asked.append(t_s) or start, InlineExecutor())
    frames(loop)
    # When the arm begins to rise the lead is shorter than the keys that shape it.
    np.testing.assert_allclose(asked, [loop.track.key_s[0], *loop.track.key_s[1:]])
    assert (31, 0) == (loop.n_taken, loop.late)


def test_a_solution_that_comes_too_late_is_left_out_and_counted():
    slow = Later(40)
    loop = TrackLoop(track(), moved, slow)
    frames(loop, slow)
    assert loop.late >= 1


def test_an_error_of_the_loop_is_raised_in_a_frame():
    def fails(*_):
        raise ValueError("no body")

    loop = TrackLoop(track(), fails, InlineExecutor())
    loop.step(0.0, EYE)
    with pytest.raises(ValueError, match="no body"):
        loop.step(FRAME_S, EYE)


def situation(change, yaw_deg=25.0):
    centre = np.array([0.0, 1.1, 0.0])
    yaw = np.radians(yaw_deg)
    eye = centre + 3.0 * np.array([-np.sin(yaw), 0.1, -np.cos(yaw)])
    target = (FeatureTarget("coverage", ("face", "right_hand"), change),)
    root, turns = arm_raised()
    view = outlook(looking_at(eye, centre, 1.15), 192)
    return Situation(box_person(), view, target, units_named(("all",)), root, turns)


def test_offsets_that_meet_the_target_stay_bit_for_bit():
    still = np.zeros(len(units_named(("all",))))
    assert np.array_equal(
        still, solve_offsets(situation(0.0), still, ControlSettings(most_steps=1))
    )


def test_one_step_a_key_follows_an_observer_who_has_moved():
    planned = steer(situation(0.25), ControlSettings(most_steps=12, search=True))
    assert planned.is_reached
    elsewhere, omega = situation(0.25, 35.0), planned.omega_rad
    original = see(elsewhere, np.zeros((1, len(omega))))[0]
    tolerance = tolerance_of(elsewhere, original, 1.25 * original)[0]
    off = abs(1.25 * original[0] - see(elsewhere, omega[None])[0, 0])
    assert off > tolerance
    for _ in range(6):
        omega = solve_offsets(elsewhere, omega, ControlSettings(most_steps=1, search=True))
    assert abs(1.25 * original[0] - see(elsewhere, omega[None])[0, 0]) <= tolerance
