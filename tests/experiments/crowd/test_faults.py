"""What goes wrong in a walk is flagged, invents nothing, and leaves the motors silent."""

import numpy as np
import pytest

from tests.experiments.crowd.sessions import session
from tests.experiments.crowd.tables import measured
from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.experiments.crowd.trial import run_trial
from visavis.experiments.crowd.walks import walks
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import NextFrame, Reflex, Silence, TrialInterrupted
from visavis.results.opened_study import find_study

QUICK = MeasureParameters(surface="capsules")
HAPTIC_TRIAL = Trial(
    "T02", 2, 2, False, {"condition": "Haptic", "configuration": 1, "vibrates": True}, 7
)


XSENS = {"driver": "xsens", "rate_hz": 100}


def last_orders(recording):
    for role in BAND_ROLES:
        rows = recording.stream_arrays(f"haptics_{role}")
        ordered = np.flatnonzero(np.isin(rows["kind"], (0, 1, 2)))
        yield rows["kind"][ordered[-1]]


@pytest.fixture(scope="module")
def troubled(tmp_path_factory):
    body = [
        {"kind": "frozen", "start_s": 30, "duration_s": 4},
        {"kind": "part_lost", "start_s": 100, "duration_s": 5, "text": "left_hand"},
        {"kind": "silence", "start_s": 190, "duration_s": 0.8},
    ]
    bands = [{"kind": "loss", "start_s": 150, "duration_s": 40, "amount": 0.2}]
    faults = {"body_tracker": body, "armband_left_forearm": bands}
    return session(tmp_path_factory.mktemp("troubled"), faults=faults)


def test_trials_are_flagged_by_what_happened_in_them(troubled):
    flags = troubled.trials()["walk_flags"].fillna("").tolist()
    happened = ";".join(flags)
    assert "body_frozen" in happened
    assert "body_part_lost" in happened
    assert "body_silent" in happened
    assert "" in flags


def test_untracked_time_is_missing_and_not_measured(troubled):
    found = {w.trial_id: w for w in walks(troubled)}
    lost_s = {
        trial_id: float(np.isnan(w.position_m).any(axis=(1, 2)).sum() * 0.01)
        for trial_id, w in found.items()
    }
    assert sum(lost_s.values()) == pytest.approx(5 + 0.8, abs=0.6)
    assert min(lost_s.values()) == 0


def test_motors_are_silent_at_the_end_in_spite_of_lost_commands(troubled):
    assert {2} == set(last_orders(troubled))


def test_measures_of_a_troubled_session_say_what_was_lost(troubled):
    _, rows = measured(troubled, QUICK)
    assert any(row["lost_01"] > 0.05 for row in rows)
    assert any("body_part_lost" in row["flags"] for row in rows)
    for row in rows:
        assert row["collisions"] > 0
        assert np.isfinite(row["speed_m_s"])


@pytest.fixture(scope="module")
def one_dead_sensor(tmp_path_factory):
    dead = [
        {"kind": "part_frozen", "start_s": 20, "duration_s": 3, "text": "left_hand"},
        {"kind": "part_frozen", "start_s": 20, "duration_s": 3, "text": "left_lower_arm"},
    ]
    return session(
        tmp_path_factory.mktemp("dead"),
        faults={"body_tracker": dead},
        drivers={"body_tracker": XSENS},
        limit_s=12.0,
    )


def named(text):
    return {name: float(ms) for name, _, ms in (part.partition("=") for part in text.split(";"))}


def test_segments_that_repeat_their_last_pose_are_named_while_the_body_walks(one_dead_sensor):
    trials = one_dead_sensor.trials()
    is_hit = trials["walk_flags"].str.contains("segment_frozen")
    assert 1 == is_hit.sum()
    assert (trials.loc[~is_hit, "frozen_segments"] == "").all()
    hit = named(trials.loc[is_hit, "frozen_segments"].item())
    assert {"left_hand", "left_lower_arm"} == set(hit)
    assert hit["left_hand"] == pytest.approx(2850, abs=60)
    assert (trials["flags"].str.contains("body_tracker_warning") == is_hit).all()


def test_warnings_stand_among_the_events_of_a_study_without_calibration(one_dead_sensor):
    events = one_dead_sensor.events()
    told = events[events["name"].isin(["fault", "fault_over"])]
    assert ["fault", "fault_over"] == told["name"].tolist()
    assert told["payload"].astype(str).str.contains("last pose while the body moves").all()


def test_segments_that_repeat_their_last_pose_are_missing_in_the_measures(one_dead_sensor):
    found = {w.trial_id: w for w in walks(one_dead_sensor)}
    rows = {row["trial_id"]: row for row in measured(one_dead_sensor, QUICK)[1]}
    hit = [k for k, row in rows.items() if row["frozen_segments_measured"]]
    assert 1 == len(hit)
    (trial,) = hit
    lost = np.isnan(found[trial].position_m).all(axis=2)
    assert {"left_lower_arm", "left_hand"} == {
        BODY_JOINTS[j] for j in lost.any(axis=0).nonzero()[0]
    }
    assert 0.01 * lost.any(axis=1).sum() == pytest.approx(3, abs=0.1)
    for ms in named(rows[trial]["frozen_segments_measured"]).values():
        assert ms == pytest.approx(3000, abs=60)
    assert 1 == rows[trial]["flags"].split(";").count("segment_frozen")
    assert all("segment_frozen" not in row["flags"] for k, row in rows.items() if k != trial)


def test_a_sensor_that_stays_dead_is_missing_in_every_later_walk(tmp_path):
    dead = [{"kind": "part_frozen", "start_s": 20, "text": "right_hand"}]
    drivers = {"body_tracker": XSENS}
    recording = session(tmp_path, faults={"body_tracker": dead}, drivers=drivers, limit_s=12.0)
    trials = recording.trials()
    later = trials[trials["t_start_ns"] > 20 * 1e9]
    assert len(later) >= 2
    assert later["walk_flags"].str.contains("segment_frozen").all()
    for row in measured(recording, QUICK)[1]:
        if row["t_start_ns"] > 20 * 1e9:
            assert row["lost_01"] > 0.99
            assert row["collisions"] is None
            assert {"right_hand"} == set(named(row["frozen_segments_measured"]))


def test_a_clean_walk_on_the_same_wire_has_no_frozen_segment(tmp_path):
    recording = session(tmp_path, drivers={"body_tracker": XSENS}, limit_s=12.0)
    _, rows = measured(recording, QUICK)
    assert all("segment_frozen" not in row["flags"] for row in rows)
    assert {""} == {row["frozen_segments_measured"] for row in rows}


def test_a_whole_simulated_walk_has_no_frozen_segment(troubled):
    _, rows = measured(troubled, QUICK)
    assert {""} == {row["frozen_segments_measured"] for row in rows}
    assert {""} == set(troubled.trials()["frozen_segments"])


def test_a_band_that_goes_away_does_not_end_the_walk(tmp_path):
    away = [{"kind": "disconnect", "start_s": 170, "duration_s": 2}]
    recording = session(tmp_path, faults={"armband_right_forearm": away})
    trials = recording.trials()
    assert trials["came_back"].all()
    assert "armband_right_forearm" in ";".join(trials["flags"].fillna(""))
    assert {2} == set(last_orders(recording))


def test_a_control_group_never_vibrates(tmp_path):
    groups = ["haptics", "control"]
    recording = session(tmp_path, group="control", groups=groups, limit_s=12.0)
    assert not recording.trials()["vibrates"].any()
    for role in BAND_ROLES:
        assert 1 not in recording.stream_arrays(f"haptics_{role}")["kind"]


def test_an_interrupted_walk_silences_every_band():
    plan = run_trial(HAPTIC_TRIAL, CrowdParameters())
    assert isinstance(next(plan), NextFrame)
    assert plan.throw(TrialInterrupted("operator")) == Reflex(None)
    assert next(plan) == Silence()
    with pytest.raises(TrialInterrupted):
        next(plan)


def test_an_area_too_small_for_the_crowd_is_refused_with_what_is_needed():
    with pytest.raises(DesignError, match=r"need 8\.9 m"):
        find_study("crowd").experiment({"tracking_side_m": 7.0})


def test_an_unknown_pattern_is_refused_with_those_there_are():
    with pytest.raises(DesignError, match="published, steady"):
        find_study("crowd").experiment({"pattern": "tickle"})
