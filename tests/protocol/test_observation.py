from dataclasses import replace

import numpy as np
import pytest

from visavis.devices.contracts import GAZE
from visavis.lab.geometry import Pose, direction_from_yaw_pitch_deg, quat_from_yaw_pitch_deg
from visavis.lab.schema import SampleBatch, empty_values
from visavis.protocol.plan.steps import GazeView
from visavis.protocol.session.observation import GazeObserver, LateGaze
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.protocol.session.streams import gaze_targets_schema
from visavis.stimuli.scene import Agent, Scene

EYE = np.array([0.0, 1.2, 0.0])


def agent(yaw_deg: float, distance_m: float = 2.0) -> Agent:
    centre = EYE + distance_m * direction_from_yaw_pitch_deg(yaw_deg, 0.0)
    return Agent(f"agent_{yaw_deg}", "woman_1", "seat", centre, 0.12, -centre, centre)


def gaze_batch(t_ns: list[int], yaw_deg: float, *, valid: bool = True) -> SampleBatch:
    n = len(t_ns)
    values = empty_values(GAZE, n)
    values["direction_head"] = direction_from_yaw_pitch_deg(yaw_deg, 0.0)
    values["valid"] = valid
    stamps = np.array(t_ns, dtype=np.int64)
    return SampleBatch(GAZE, np.arange(n), stamps, stamps, values)


def observer(scene: Scene, delay_ns: int = 0) -> tuple[GazeObserver, list[SampleBatch], RowBuffer]:
    recorded: list[SampleBatch] = []
    rows = RowBuffer(gaze_targets_schema(2, 120.0), recorded.append, hold_ns=10**12)
    made = GazeObserver(rows, delay_ns=delay_ns)
    made.show(scene)
    return made, recorded, rows


SCENE = Scene("two", (agent(0.0), agent(20.0)))


def test_gaze_turned_in_a_turned_head_meets_the_agent_straight_ahead() -> None:
    seen, _, _ = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(-15.0)))
    seen.take(gaze_batch([0], 15.0))

    view = seen.observe(1, 0)

    assert view.hit.tolist() == [0]
    assert view.angle_deg[0, 0] == pytest.approx(0.0, abs=1e-4)


def test_the_pose_at_the_samples_own_time_is_used_not_the_latest() -> None:
    seen, _, _ = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.heads.add_measured(100, Pose(EYE, quat_from_yaw_pitch_deg(20.0)))
    seen.take(gaze_batch([0, 50, 100], 0.0))

    view = seen.observe(1, 100)

    assert view.hit.tolist() == [0, -1, 1]
    assert view.angle_deg[1].tolist() == pytest.approx([10.0, 10.0], abs=1e-3)


def test_the_trackers_own_delay_is_taken_off_before_the_head_is_looked_up() -> None:
    seen, recorded, rows = observer(SCENE, delay_ns=50)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.heads.add_measured(100, Pose(EYE, quat_from_yaw_pitch_deg(20.0)))
    seen.take(gaze_batch([50, 100], 0.0))

    view = seen.observe(1, 100)
    rows.flush()

    assert [0, 50] == view.t_ns.tolist()
    assert [0, 50] == recorded[0].values["t_sample_ns"].tolist()
    assert [0, -1] == view.hit.tolist()


def test_a_sample_older_than_every_pose_takes_the_oldest_pose() -> None:
    seen, _, _ = observer(SCENE)
    for t in range(100, 200):
        seen.heads.add_measured(t, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.take(gaze_batch([0], 0.0))

    assert seen.observe(1, 200).hit.tolist() == [0]


def test_the_clock_offset_moves_samples_to_session_time() -> None:
    seen, recorded, rows = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.clock_offset_ns = -7
    seen.take(gaze_batch([1000], 0.0))
    seen.observe(3, 1000)
    rows.flush()

    assert recorded[0].values["t_sample_ns"].tolist() == [993]
    assert recorded[0].values["frame_index"].tolist() == [3]


def test_a_lost_sample_hits_nothing_and_counts_as_received_only() -> None:
    seen, _, _ = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.take(gaze_batch([0, 1], 0.0, valid=False))

    view = seen.observe(1, 1)

    assert view.hit.tolist() == [-2, -2]
    assert (2, 0) == (seen.received_count, seen.valid_count)


def test_a_frame_without_samples_brings_an_empty_view() -> None:
    seen, _, _ = observer(SCENE)

    assert (0, 2) == seen.observe(1, 0).angle_deg.shape


def test_all_samples_of_a_long_pause_are_recorded_though_they_come_in_one_frame() -> None:
    seen, recorded, rows = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    for first, n in ((0, 3), (3, 2000), (2003, 2)):
        seen.take(gaze_batch(list(range(first, first + n)), 20.0))
        seen.observe(1, 5000)
    rows.flush()
    values = np.concatenate([batch.values for batch in recorded])

    assert list(range(2005)) == values["t_sample_ns"].tolist()
    assert {1} == set(values["hit"].tolist())


def test_frames_that_wait_see_what_each_would_have_seen_at_once() -> None:
    def performed(*, later: bool) -> tuple[list[list[object]], bytes, int]:
        seen, recorded, rows = observer(SCENE)
        views: list[GazeView | LateGaze] = []
        for frame in range(60):
            t_ns = 100 * frame
            if frame % 7:  # the head is lost now and then
                seen.heads.add_measured(t_ns, Pose(EYE, quat_from_yaw_pitch_deg(0.5 * frame)))
            if frame % 5:
                stamps = [t_ns - 90, t_ns - 40][: 1 + frame % 2]
                seen.take(gaze_batch(stamps, 10.0 - frame % 3, valid=frame % 11 > 0))
            if later:
                views.append(seen.wait(frame, t_ns, lambda: None))
            else:
                views.append(seen.observe(frame, t_ns))
        if later:
            counts = seen.observe_waiting()
            assert counts == [view.t_ns.shape[0] for view in views]
        rows.flush()
        columns = [[getattr(v, f).tolist() for f in GazeView._fields] for v in views]
        (batch,) = recorded
        return columns, batch.t_host_ns.tobytes() + batch.values.tobytes(), seen.valid_count

    at_once, later = performed(later=False), performed(later=True)

    assert repr(at_once) == repr(later)


def test_gaze_left_for_later_is_evaluated_when_it_is_looked_at() -> None:
    seen, _, _ = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))

    def catch_up() -> None:
        seen.observe_waiting()

    gaze = seen.wait(1, 0, catch_up)
    seen.take(gaze_batch([0], 0.0))

    assert gaze.hit.tolist() == [0]


def test_gaze_before_the_first_trial_is_dated_on_the_sessions_clock_not_the_trackers() -> None:
    seen, recorded, rows = observer(SCENE)
    assert seen.clock_offset_ns is None
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.heads.add_measured(100, Pose(EYE, quat_from_yaw_pitch_deg(20.0)))
    seen.take(shifted([0, 50], 0.0, clock_ns=79_000 * 10**9))
    assert [0, 50] == seen.observe(1, 100).t_ns.tolist()
    assert -79_000 * 10**9 == seen.clock_offset_ns
    seen.take(shifted([100], 0.0, clock_ns=79_000 * 10**9 - 7))
    assert [93] == seen.observe(2, 100).t_ns.tolist()  # the offset moves with the trial alone
    rows.flush()
    assert [0, 50, 93] == recorded[0].values["t_sample_ns"].tolist()


def shifted(t_ns: list[int], yaw_deg: float, *, clock_ns: int) -> SampleBatch:
    """Return a batch of a tracker whose clock shows `clock_ns` more than the session's."""
    batch = gaze_batch(t_ns, yaw_deg)
    return replace(batch, t_device_ns=batch.t_device_ns + clock_ns)


def test_a_sample_that_comes_after_the_last_frame_waits_for_the_next() -> None:
    seen, recorded, rows = observer(SCENE)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.wait(1, 100, lambda: None)
    seen.wait(2, 200, lambda: None)
    seen.take(gaze_batch([50, 150, 201], 0.0))

    assert [1, 1] == list(seen.observe_waiting())
    seen.wait(3, 300, lambda: None)
    assert [1] == list(seen.observe_waiting())
    rows.flush()
    columns = np.concatenate([batch.values["frame_index"] for batch in recorded])
    assert [1, 2, 3] == columns.tolist()


@pytest.mark.parametrize("at_once", [1, 64])
def test_the_least_delay_is_that_of_the_last_seconds_however_many_come_at_once(
    at_once: int,
) -> None:
    seen, _, _ = observer(SCENE)
    device_ns = np.arange(500) * 10_000_000
    host_ns = device_ns + 3_000_000
    host_ns[[20, 300]] = device_ns[[20, 300]] + np.array([1_000_000, 2_000_000])
    for first in range(0, 500, at_once):
        part = slice(first, first + at_once)
        n = len(host_ns[part])
        values = empty_values(GAZE, n)
        seen.take(SampleBatch(GAZE, np.arange(n), device_ns[part], host_ns[part], values))
    assert 2_000_000 == seen.least_delay_ns
