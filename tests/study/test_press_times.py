"""Reaction times run from the onset to the press itself, not to the frame that brought it."""

import numpy as np
import pytest

from visavis.lab.geometry import Pose
from visavis.protocol.plan.steps import FrameView, GazeView
from visavis.study.asking import await_press

MS = 1_000_000
NOWHERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
NO_GAZE = GazeView(*[np.empty(0)] * 8)


def frame(t_ms, keys=(), at_ms=()):
    heard = tuple(round(t * MS) for t in at_ms)
    return FrameView(0, t_ms * MS, NOWHERE, True, NO_GAZE, tuple(keys), pressed_ns=heard)


def answer(frames, limit_s=1.0):
    asking = await_press(("f", "j"), limit_s, frame(100), 100 * MS, lambda view: None)
    next(asking)
    for view in frames:
        try:
            asking.send(view)
        except StopIteration as done:
            return done.value
    raise AssertionError("nothing was answered")


def test_a_press_between_two_frames_is_timed_by_itself():
    press = answer([frame(117), frame(133, ["j"], [121.4])])
    assert (press.option, press.ms) == ("j", pytest.approx(21.4))


def test_the_first_of_two_presses_of_one_frame_counts():
    press = answer([frame(117, ["f", "j"], [104.0, 110.0])])
    assert (press.option, press.ms) == ("f", pytest.approx(4.0))


def test_a_press_made_before_the_onset_is_no_answer_though_it_comes_later():
    press = answer([frame(117, ["f"], [99.0]), frame(133, ["j"], [130.0])])
    assert (press.option, press.ms) == ("j", pytest.approx(30.0))


def test_a_press_after_the_limit_is_no_answer_though_its_frame_began_before():
    assert answer([frame(150, ["f"], [141.0]), frame(200)], limit_s=0.04).option is None


def test_where_nobody_knows_the_time_of_a_press_its_frame_stands_for_it():
    assert answer([frame(117, ["f"])]).ms == pytest.approx(17.0)
