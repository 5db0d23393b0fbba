"""One walk of the crowd study, frame by frame: the board, the way back, the end."""

import numpy as np
import pytest

from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.study import plan_session
from visavis.experiments.crowd.trial import run_trial
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose
from visavis.protocol.plan.steps import Ask, AskReply, FrameView, Mark, NextFrame, Show, Silence
from visavis.stimuli.scenes.station_crowd import BOARD_M, READ_WITHIN_M, START_M, CrowdFrame

FRAME_NS = NS_PER_S // 100
"""A whole number of frames is a second."""
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
HALFWAY = (0.0, 0.0)
BOARD = (BOARD_M[0], BOARD_M[2])
HOME_WITHIN_M = CrowdParameters().home_within_m


def from_mark(distance_m):
    """Return a place that far from the mark, in metres."""
    return (START_M[0] + distance_m, START_M[1])


def walk(*places, params=None, lost=()):
    """Walk a trial, at the last place for good; `lost` are frames in which no head is tracked.

    Return its row, the frames shown with the crowd, and the events marked.
    """
    params = params or CrowdParameters()
    trial = plan_session(0, 1, configuration=[1]).trials[0]
    performed = run_trial(trial, params)
    shown, marks, row = [], [], None
    frame, step = 0, next(performed)
    try:
        while True:
            reply = None
            if isinstance(step, NextFrame):
                # the walk begins with the second frame, the first with the crowd in view
                at = START_M if frame == 0 else places[min(frame - 1, len(places) - 1)]
                head = Pose(np.array([at[0], 1.6, at[1]]), UPRIGHT)
                reply = FrameView(frame, frame * FRAME_NS, head, frame - 1 not in lost, None)
                frame += 1
            elif isinstance(step, Ask):
                reply = AskReply(step.options[0], frame * FRAME_NS)
            elif isinstance(step, Show) and isinstance(step.view, CrowdFrame):
                shown.append(step.view)
            elif isinstance(step, Mark):
                marks.append(step)
            step = performed.send(reply)
    except StopIteration as end:
        row = end.value
    return row, shown, marks


def test_a_walk_to_the_board_and_back_to_the_mark_came_back():
    row, shown, marks = walk(HALFWAY, BOARD, HALFWAY, START_M)
    assert row["came_back"]
    assert 3 * FRAME_NS == row["t_end_ns"] - row["t_start_ns"]
    assert ["crowd", "scene_on", "board_on"] == [m.name for m in marks]
    assert [None, None, row["track"], None] == [view.track for view in shown]
    assert "" == row["walk_flags"].replace("body_never_tracked", "")


def test_who_never_saw_the_board_does_not_come_back():
    row, _, _ = walk(HALFWAY, START_M, params=CrowdParameters(limit_s=1.0))
    assert not row["came_back"]
    assert row["board_ns"] is None
    assert "not_back_in_time" in row["walk_flags"]


def test_the_mark_is_reached_at_exactly_its_radius_and_not_beyond():
    place = from_mark(0.5)
    radius_m = float(np.hypot(place[0] - START_M[0], 0.0))
    at = CrowdParameters(limit_s=1.0, home_within_m=radius_m)
    within = CrowdParameters(limit_s=1.0, home_within_m=float(np.nextafter(radius_m, 0.0)))
    assert walk(BOARD, place, params=at)[0]["came_back"]
    assert not walk(BOARD, place, params=within)[0]["came_back"]


@pytest.mark.parametrize(
    ("distance_m", "came_back"), [(HOME_WITHIN_M - 0.01, True), (HOME_WITHIN_M + 0.01, False)]
)
def test_the_mark_is_the_place_where_one_started_as_wide_as_the_parameter_says(
    distance_m, came_back
):
    params = CrowdParameters(limit_s=1.0)
    assert came_back == walk(BOARD, from_mark(distance_m), params=params)[0]["came_back"]


def test_a_head_that_is_not_tracked_has_not_come_back():
    away = walk(BOARD, START_M, HALFWAY, START_M, lost={1})
    seen = walk(BOARD, START_M, HALFWAY, START_M)
    assert (4, 2) == (away[0]["scene_frames"], seen[0]["scene_frames"])
    never = CrowdParameters(limit_s=1.0)
    assert not walk(BOARD, START_M, params=never, lost=set(range(1, 200)))[0]["came_back"]


def test_a_head_that_is_not_tracked_reads_nothing():
    row, shown, marks = walk(BOARD, BOARD, START_M, lost={0})
    assert FRAME_NS == row["board_ns"] - row["t_start_ns"]
    assert 1 == sum(view.track is not None for view in shown)
    assert 1 == sum(mark.name == "board_on" for mark in marks)


def test_the_board_is_read_at_exactly_its_distance_and_not_beyond():
    def reads(distance_m):
        place = (BOARD_M[0] - distance_m, BOARD_M[2])
        row, _, _ = walk(place, START_M, params=CrowdParameters(limit_s=0.1))
        return row["board_ns"] is not None

    at_m = READ_WITHIN_M
    assert READ_WITHIN_M == BOARD_M[0] - (BOARD_M[0] - at_m)
    assert reads(at_m)
    assert not reads(at_m + 1e-6)


def test_a_walk_ends_in_the_frame_that_reaches_the_limit():
    params = CrowdParameters(limit_s=1.0)
    row, _, _ = walk(HALFWAY, params=params)
    assert NS_PER_S == row["t_end_ns"] - row["t_start_ns"]
    assert not row["came_back"]
    back, _, _ = walk(BOARD, *[HALFWAY] * 99, START_M, params=params)
    assert NS_PER_S == back["t_end_ns"] - back["t_start_ns"]
    assert back["came_back"]
    late, _, _ = walk(BOARD, *[HALFWAY] * 100, START_M, params=params)
    assert not late["came_back"]


def test_bands_are_silenced_before_the_operator_is_asked_for_the_track():
    params = CrowdParameters()
    performed = run_trial(plan_session(0, 1, configuration=[1]).trials[0], params)
    before, step = None, next(performed)
    for frame in range(200):
        while not isinstance(step, NextFrame | Ask):
            before, step = step, performed.send(None)
        if isinstance(step, Ask):
            break
        at = BOARD if frame == 1 else START_M
        head = Pose(np.array([at[0], 1.6, at[1]]), UPRIGHT)
        step = performed.send(FrameView(frame, frame * FRAME_NS, head, True, None))
    assert isinstance(step, Ask)
    assert Silence() == before
