"""Gaze is turned by the head of its own time, whichever headset and tracker deliver the two."""

import numpy as np
import pytest

from benchmarks.gaze_while_turning import HEADSETS, LIMIT_DEG, SOURCES, errors_deg
from visavis.devices.sim.native_build import find_compiler
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.protocol.session.head_history import (
    MAX_WAITING,
    POSES_KEPT,
    HeadHistory,
    heads_between,
)

EYE = np.array([0.0, 1.2, 0.0])


def needs_of(headset: str, source: str) -> None:
    for name, package in (("openvr", "openvr"), ("openxr", "xr")):
        if f"{headset} {source}".count(name):
            pytest.importorskip(package)
            if find_compiler() is None:
                pytest.skip("a simulated runtime needs a C compiler: apt-get install gcc")


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("headset", HEADSETS)
def test_eyes_on_a_target_stay_there_while_the_head_turns(headset: str, source: str) -> None:
    needs_of(headset, source)
    errors = errors_deg(headset, source, 150.0)
    assert len(errors) > 100
    assert np.percentile(errors, 95) <= LIMIT_DEG


@pytest.mark.parametrize("look_ahead_ms", [11.0, 60.0])
@pytest.mark.parametrize("headset", HEADSETS)
def test_how_far_a_headset_foresees_does_not_move_gaze(headset: str, look_ahead_ms: float) -> None:
    needs_of(headset, "")
    errors = errors_deg(headset, "pupil_core", 100.0, look_ahead_ms)
    assert np.percentile(errors, 95) <= LIMIT_DEG


def pose(yaw_deg: float) -> Pose:
    return Pose(EYE, quat_from_yaw_pitch_deg(yaw_deg))


def yaw_and_beyond(history: HeadHistory, t_ns: int) -> tuple[float, float]:
    found = history.at(t_ns)
    assert found is not None
    turn, beyond_ms = found[0].orientation_wxyz, found[1]
    return float(np.degrees(2 * np.arctan2(turn[2], turn[0]))), beyond_ms


MS = 1_000_000


def test_a_measured_head_is_interpolated_and_what_was_foreseen_for_that_time_is_not_used() -> None:
    history = HeadHistory()
    history.add_measured(0, pose(0.0))
    history.add_foreseen(5 * MS, pose(40.0))
    history.add_measured(10 * MS, pose(10.0))
    assert yaw_and_beyond(history, 5 * MS) == (pytest.approx(5.0), 0.0)
    assert yaw_and_beyond(history, -MS) == (pytest.approx(0.0), 0.0)


def test_beyond_the_last_measured_pose_the_head_goes_towards_the_foreseen_one_and_says_so() -> None:
    history = HeadHistory()
    history.add_foreseen(8 * MS, pose(90.0))  # of an earlier frame, and wrong
    history.add_measured(10 * MS, pose(10.0))
    history.add_foreseen(30 * MS, pose(30.0))
    assert yaw_and_beyond(history, 20 * MS) == (pytest.approx(20.0), 10.0)
    assert yaw_and_beyond(history, 40 * MS) == (pytest.approx(30.0), 30.0)
    history.add_foreseen(40 * MS, pose(50.0))
    assert yaw_and_beyond(history, 35 * MS) == (pytest.approx(40.0), 25.0)


def test_where_nothing_is_measured_the_foreseen_poses_count_each_at_its_time() -> None:
    history = HeadHistory()
    assert history.at(0) is None
    for k in range(60):
        history.add_foreseen(k * 10 * MS, pose(float(k)))
    yaw_deg, beyond_ms = yaw_and_beyond(history, 555 * MS)
    assert yaw_deg == pytest.approx(55.5)
    assert np.isnan(beyond_ms)


def test_a_head_that_was_lost_is_foreseen_from_nothing_older_than_what_is_measured() -> None:
    history = HeadHistory()
    history.add_foreseen(10 * MS, pose(70.0))
    history.add_measured(20 * MS, pose(20.0))
    assert yaw_and_beyond(history, 25 * MS) == (pytest.approx(20.0), 5.0)


def test_heads_of_many_samples_are_those_of_their_times() -> None:
    times = [0, 10 * MS, 20 * MS]
    places, turns = heads_between(
        times, [pose(0.0), pose(10.0), pose(30.0)], np.array([-5, 5, 15, 99]) * MS
    )
    yaws = np.degrees(2 * np.arctan2(turns[:, 2], turns[:, 0]))
    assert yaws == pytest.approx([0.0, 5.0, 20.0, 30.0], abs=1e-3)
    assert places == pytest.approx(np.tile(EYE, (4, 1)))
    assert heads_between([0], [pose(1.0)], np.array([7]))[0].shape == (1, 3)
    assert heads_between([], [], np.array([7]))[0].shape == (0, 3)


def test_the_head_in_a_frame_is_known_when_many_have_passed_since() -> None:
    history = HeadHistory()
    for frame in range(POSES_KEPT + MAX_WAITING):
        history.add_measured(frame * MS, pose(float(frame)))
    assert yaw_and_beyond(history, 40 * MS) == (pytest.approx(40.0), 0.0)
