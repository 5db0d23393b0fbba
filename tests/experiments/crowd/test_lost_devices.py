"""A band or tracker that goes away for seconds: who waits, what is flagged, nothing invented."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from tests.experiments.crowd.sessions import request, session
from tests.experiments.crowd.tables import measured
from tests.faults.sessions import ScriptedOperator
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.experiments.crowd.pulses import pulse_rows
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new

ROLE = "armband_right_forearm"
NOT_HAPTIC_S, HAPTIC_S = 18.0, 36.0
"""Session times within T01, which does not vibrate, and T02, which does."""


def lost(folder: Path, kind: str, start_s: float, duration_s: float, role: str = ROLE) -> Recording:
    away = [{"kind": kind, "start_s": start_s, "duration_s": duration_s}]
    return session(folder, faults={role: away}, limit_s=15.0)


@pytest.fixture(scope="module")
def away_mid_contact(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return lost(tmp_path_factory.mktemp("away"), "disconnect", HAPTIC_S, 4.0)


def test_a_walk_whose_band_stays_away_is_interrupted_and_walked_again(
    away_mid_contact: Recording,
) -> None:
    rows = away_mid_contact.trials().query("trial_id == 'T02'")
    assert ["interrupted", "complete"] == rows["status"].tolist()
    assert f"{ROLE}: disconnected" in rows["reason"].iloc[0]
    assert f"{ROLE}_lost" in rows["flags"].iloc[0]
    assert "complete" == away_mid_contact.status


def test_no_time_is_invented_for_a_command_that_never_left(away_mid_contact: Recording) -> None:
    pulses = pd.DataFrame(pulse_rows(away_mid_contact))
    lost_ones = pulses[~pulses["acknowledged"]]
    assert 0 < len(lost_ones)
    assert lost_ones["sent_ms"].isna().any()
    assert lost_ones[["acknowledged_ms", "risen_ms"]].isna().all(axis=None)
    assert (pulses["sent_ms"].dropna() >= 0).all()


def test_pulses_of_an_interrupted_walk_are_not_those_of_the_walk_that_counts(
    away_mid_contact: Recording,
) -> None:
    pulses = pd.DataFrame(pulse_rows(away_mid_contact))
    assert {1, 2} == set(pulses["attempt"])
    _, rows = measured(away_mid_contact, MeasureParameters(surface="capsules"))
    row = next(row for row in rows if row["trial_id"] == "T02")
    assert (pulses["attempt"] == 2).sum() == row["pulses"]
    assert 0 == row["pulses_lost"]
    assert "pulse_lost" not in row["flags"]


def test_a_silent_band_that_goes_away_costs_no_walk_that_does_not_vibrate(tmp_path: Path) -> None:
    rows = lost(tmp_path, "disconnect", NOT_HAPTIC_S, 5.0).trials()
    assert {"complete"} == set(rows["status"])
    assert f"{ROLE}_lost" in rows.set_index("trial_id").loc["T01", "flags"]


@pytest.mark.parametrize("kind", ["disconnect", "silence"])
def test_a_tracker_that_stays_away_interrupts_the_walk_and_the_study_goes_on(
    kind: str, tmp_path: Path
) -> None:
    recording = lost(tmp_path, kind, NOT_HAPTIC_S, 6.0, role="body_tracker")
    rows = recording.trials().query("trial_id == 'T01'")
    assert ["interrupted", "complete"] == rows["status"].tolist()
    assert "body_tracker" in rows["reason"].iloc[0]
    assert "complete" == recording.status


def test_recalibrating_a_study_without_gaze_is_answered_and_harmless(tmp_path: Path) -> None:
    operator = ScriptedOperator((SessionState.TRIAL, 2, 60, Command(Action.RECALIBRATE)))
    wanted = replace(request(tmp_path, limit_s=2.0), operator=operator)
    assert "complete" == Recording(perform_new(wanted)).status
    assert "nothing to calibrate: this study does not measure gaze" in operator.messages


def test_the_operator_may_go_on_without_a_band_that_stays_away(tmp_path: Path) -> None:
    broken = [{"kind": "disconnect", "start_s": NOT_HAPTIC_S, "duration_s": 10_000}]
    go_on = (SessionState.PAUSED, 1, 30, Command(Action.ADVANCE))
    operator = ScriptedOperator(go_on)
    wanted = replace(request(tmp_path, faults={ROLE: broken}, limit_s=12.0), operator=operator)
    recording = Recording(perform_new(wanted))
    rows = recording.trials().set_index("trial_id")
    assert {"complete"} == set(rows["status"])
    assert all(f"{ROLE}_lost" in rows.loc[trial, "flags"] for trial in ("T01", "T02", "T03"))
    names = recording.events()["name"].tolist()
    assert 1 == names.count("device_lost") == names.count("device_done_without")
    assert any("you can go on without it" in wait for wait in operator.waits)
