"""A simulated crowd session end to end: what is recorded, what is measured from it alone."""

import numpy as np
import pandas as pd
import pytest

from tests.experiments.crowd.sessions import session
from tests.experiments.crowd.tables import measured
from visavis.analysis.session_check import check_session
from visavis.experiments.crowd.design import CONDITIONS
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.experiments.crowd.walks import walks
from visavis.stimuli.contact.body import ARM_JOINTS, capsule_body
from visavis.stimuli.contact.touch import TouchSensor


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return session(tmp_path_factory.mktemp("crowd"))


@pytest.fixture(scope="module")
def intake(recording):
    return measured(recording, MeasureParameters(surface="capsules"))


def test_every_walk_goes_to_the_board_and_comes_back(recording):
    trials = recording.trials()
    assert ["Training", *CONDITIONS] == trials["condition"].tolist()
    assert trials["came_back"].all()
    assert (trials["track_read"] == trials["track"]).all()


def test_bands_are_driven_in_the_haptic_block_only(recording):
    trials = recording.trials().set_index("condition")
    for role in BAND_ROLES:
        rows = recording.stream_arrays(f"haptics_{role}")
        played = rows["t_commanded_ns"][rows["kind"] == 1]
        haptic = trials.loc["Haptic"]
        assert ((played >= haptic["t_start_ns"]) & (played <= haptic["t_end_ns"])).all()
    total = sum((recording.stream_arrays(f"haptics_{r}")["kind"] == 1).sum() for r in BAND_ROLES)
    assert total >= trials.loc["Haptic", "contacts_online"] > 5


def test_every_band_is_silent_at_the_end(recording):
    for role in BAND_ROLES:
        rows = recording.stream_arrays(f"haptics_{role}")
        orders = np.flatnonzero(np.isin(rows["kind"], (0, 1, 2)))
        assert rows["kind"][orders[-1]] == 2


def test_contacts_can_be_found_again_from_the_recording(recording):
    walk = next(w for w in walks(recording) if w.row["condition"] == "Haptic")
    events = recording.events()
    begins = [
        e["payload"]
        for e in events[events["name"] == "contact_begin"].to_dict("records")
        if e["payload"]["trial_id"] == walk.trial_id
    ]
    sensor, arms = TouchSensor(walk.crowd), capsule_body(walk.stature_m, ARM_JOINTS)
    again = 0
    for payload in begins:
        i = int(np.argmin(np.abs(walk.t_ns - payload["t_contact_ns"])))
        starts, ends = arms.posed(walk.position_m[i], walk.orientation_wxyz[i])
        radius = arms.radius_m + 0.01  # a grid step and float32 positions lie between
        touched = sensor.touches(starts, ends, radius, float(walk.crowd_t_s[i]))
        again += any(
            t.person == payload["person"] and ARM_JOINTS[t.part] == payload["segment"]
            for t in touched
        )
    assert again >= 0.95 * len(begins) > 5


def test_measures_come_from_the_recording_alone(intake):
    tables, rows = intake[0].tables, intake[1]
    trials = pd.DataFrame(rows).set_index("condition")
    assert set(CONDITIONS) == set(trials.index)
    assert (trials["collisions"] > 5).all()
    assert trials["speed_m_s"].between(0.25, 0.7).all()
    assert trials["shoulders_to_gap_deg"].between(10, 70).all()
    counted = tables["collisions"].query("counted")
    assert trials["collisions"].sum() == len(counted)
    assert (counted["max_volume_dm3"] > 1e-3).all()
    assert (counted["duration_s"] > 0.010).all()
    assert set(counted["side"]) <= {"left", "right", "middle"}
    assert ("volume", "capsules") == (counted["rule"].iloc[0], counted["surface"].iloc[0])


def test_every_pulse_tells_commanded_sent_acknowledged_and_risen_in_order(intake):
    pulses = intake[0].tables["pulses"]
    assert len(pulses) > 5
    assert pulses["acknowledged"].all()
    assert (pulses["commanded_ms"] >= 0).all()
    assert (pulses["sent_ms"] >= pulses["commanded_ms"]).all()
    assert (pulses["acknowledged_ms"] > pulses["sent_ms"]).all()
    assert (pulses["risen_ms"] > pulses["sent_ms"] + 25).all()


def test_commands_leave_less_than_five_milliseconds_after_the_sample_that_shows_contact(intake):
    pulses = intake[0].tables["pulses"]
    assert (pulses["sent_ms"] < 5).all()


def test_presence_and_embodiment_are_asked_after_every_block(intake):
    blocks = intake[0].blocks
    assert list(CONDITIONS) == blocks["condition"].tolist()
    for scale in ("presence", "agency", "change", "ownership"):
        assert blocks[scale].between(1, 7).all()
    assert {"age", "gender"} <= set(intake[0].person)


def test_exchanges_of_time_with_bands_are_no_events_but_stand_with_their_commands(recording):
    events = recording.events()
    payloads = events.loc[events["name"] == "clock_exchanges", "payload"]
    assert [] == [payload["role"] for payload in payloads]


def test_a_study_without_gaze_is_not_asked_for_a_calibration(recording):
    subjects = {f.subject for f in check_session(recording).findings}
    assert "recording" in subjects
    assert "calibration" not in subjects


def test_no_eye_tracker_is_connected_and_no_walk_is_flagged_for_one(recording):
    assert "eye_tracker" not in {device["role"] for device in recording.manifest.devices}
    assert not {"gaze", "gaze_targets"} & set(recording.stream_names)
    assert [""] * len(recording.trials()) == recording.trials()["flags"].tolist()


def test_gaze_is_recorded_where_the_study_is_told_to_and_walks_stay_the_same(recording, tmp_path):
    both = session(tmp_path, record_gaze=True)

    def walks(of):
        rows = of.trials()
        return [(rows[column] - rows["t_start_ns"]).tolist() for column in ("t_end_ns", "board_ns")]

    assert {"gaze", "gaze_targets"} <= set(both.stream_names)
    assert walks(recording) == walks(both)
