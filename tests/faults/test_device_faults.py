import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.faults.sessions import (
    TRIAL_S,
    TRIALS,
    Rows,
    events,
    findings,
    lab,
    path_of,
    perform,
    resume,
    span_s,
    trial_table,
    verdict,
)
from visavis.analysis.gaze.targets import gaze_of_part
from visavis.analysis.session_verdict import Level
from visavis.devices.drivers.streaming import exchange_log
from visavis.experiments.stare.comparisons import RULES
from visavis.lab.errors import DeviceError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.results.selection import select
from visavis.study.exclusions import limits_in_force


@pytest.fixture(scope="module")
def in_t02(tmp_path_factory: pytest.TempPathFactory) -> float:
    """Return a time one second into trial T02 of a session without faults."""
    recording = perform(lab(tmp_path_factory.mktemp("plain")))
    assert {""} == set(recording.trials()["flags"])
    return span_s(recording, "T02")[0] + 1.0


def fault(kind: str, start_s: float, duration_s: float = 1e6, **more: object) -> Rows:
    return [{"kind": kind, "start_s": float(start_s), "duration_s": duration_s, **more}]


def flags_of(recording: Recording) -> dict[str, str]:
    rows = trial_table(recording)
    return {str(t): f for t, f in zip(rows["trial_id"], rows["flags"], strict=True) if f}


def measured(recording: Recording) -> pd.DataFrame:
    rows: pd.DataFrame = find_study("stare").measure(recording).rows
    return rows[rows["status"] == "complete"].set_index("trial_id")


def is_whole(recording: Recording) -> bool:
    done = recording.trials()
    complete = set(done.loc[done["status"] == "complete", "trial_id"])
    return recording.status == "complete" and complete == {"P1", *TRIALS}


def test_a_silent_second_flags_its_trial_alone_and_is_measured_as_loss(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("silence", in_t02, 1.2)))

    assert {"T02": "eye_tracker_warning;eye_tracker_lost"} == flags_of(recording)
    assert is_whole(recording)
    assert measured(recording).loc["T02", "lost_01"] > 0.25
    assert re.search(r"eye_tracker: no data for \d+ ms", findings(recording))
    assert "flagged: T02" in findings(recording)


def test_a_trial_without_any_gaze_is_interrupted_and_done_again_at_the_end_of_its_block(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("eyes_lost", in_t02 - 1, 4.5)))

    assert ["P1", "T01", "T02", "T03", "T02", "T13", "T14", "T15"] == list(
        recording.trials()["trial_id"]
    )
    rows = trial_table(recording)
    assert "eye_tracker: neither eye is seen" == rows.loc[("T02", 1), "reason"]
    assert "complete" == rows.loc[("T02", 2), "status"]
    assert "T02, attempt 1, was interrupted: eye_tracker: neither eye is seen" in findings(
        recording
    )


def test_a_tracker_gone_and_back_is_waited_for_and_calibrated_again(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("disconnect", in_t02, 9.0)))

    rows = trial_table(recording)
    assert "interrupted" == rows.loc[("T02", 1), "status"]
    assert "eye_tracker_lost" in rows.loc[("T02", 1), "flags"]
    assert "complete" == rows.loc[("T02", 2), "status"]
    assert rows.loc[("T02", 2), "calibration_id"] != rows.loc[("T01", 1), "calibration_id"]
    assert is_whole(recording)
    assert 1 == len(events(recording, "device_back"))
    assert "then came back" in findings(recording)
    assert Level.AMBER is verdict(recording).level


def test_a_tracker_gone_for_good_ends_the_session_which_can_be_resumed(
    tmp_path: Path, in_t02: float
) -> None:
    config = lab(tmp_path, tracker=fault("disconnect", in_t02))
    with pytest.raises(DeviceError) as ended:
        perform(config)

    said = str(ended.value)
    assert "eye_tracker: did not come back within 20 s" in said
    assert "check cable and program, then continue with `visavis resume`" in said
    assert 4 == ended.value.exit_code
    recording = Recording(path_of(config))
    assert "aborted" == recording.status
    assert {"P1", "T01"} <= set(recording.trials()["trial_id"])
    assert Level.RED is verdict(recording).level
    assert "not done: T02, T03, T13, T14, T15" in findings(recording)

    assert is_whole(resume(lab(tmp_path)))


def test_a_tracker_gone_while_it_is_calibrated_is_calibrated_again(tmp_path: Path) -> None:
    recording = perform(lab(tmp_path, tracker=fault("disconnect", 3.0, 6.0)))

    assert is_whole(recording)
    assert {} == flags_of(recording)
    assert list(recording.trials()["calibration_accepted"]) == [True] * 7


def test_a_jump_of_the_trackers_clock_flags_its_trial_and_spares_the_next(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("clock_jump", in_t02, amount=100.0)))

    assert {"T02": "eye_tracker_warning"} == flags_of(recording)
    rows = measured(recording)
    assert rows.loc["T02", "lost_01"] > 0.5
    assert rows.loc["T03", "lost_01"] < 0.1
    assert "the tracker's clock jumped" in findings(recording)


def test_a_trial_in_which_the_clock_jumps_is_excluded_by_a_rule_of_that_name(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("clock_jump", in_t02, amount=3.5)))

    rows = find_study("stare").measure(recording).rows
    by_trial = rows.set_index("trial_id")
    assert by_trial.loc["T02", "clock_jump_ms"] == pytest.approx(3500)
    assert set(by_trial.drop("T02")["clock_jump_ms"]) == {0.0}
    # The trial is cut at the jump, after a quarter of it; the samples that the session dated 3.5 s
    # late are of their own trial, not of the next.
    assert by_trial.loc["T02", "lost_01"] == pytest.approx(0.75, abs=0.05)
    assert by_trial.loc[["T02", "T03"], "gaze_samples"].tolist() == [TRIAL_S * 60] * 2
    selection = select(
        rows, RULES, limits_in_force(RULES, {}), cells=(), planned_counts={}, cell_count=1
    )
    assert [("max_clock_jump_ms", 1)] == [
        (left.rule, left.count) for left in selection.left if left.rule == "max_clock_jump_ms"
    ]
    reason = selection.rows.set_index("trial_id").loc["T02", "left_out_because"]
    assert "the eye tracker's clock jumped by 3500 ms (limit 20 ms)" == reason


def test_gaze_follows_a_clock_that_drifts_within_trials(tmp_path: Path) -> None:
    steady = perform(lab(tmp_path / "steady"))
    drifting = perform(lab(tmp_path / "drifting", tracker=fault("drift", 0.0, amount=50.0)))

    recorded, dated = (
        [r.stream_arrays("gaze_targets")["t_sample_ns"], gaze_of_part(r, 1).targets.t_ns]
        for r in (steady, drifting)
    )
    assert np.array_equal(*recorded)
    # The session knew the past alone: it dated samples up to 3 ms from when they were taken.
    assert np.abs(dated[0] - recorded[1]).max() > 1e6
    assert np.abs(dated[1] - recorded[1]).max() < 2_000
    own = drifting.stream_arrays("gaze")
    assert (np.diff(own["t_device_ns"] - own["t_host_ns"]) != 0).any()  # raw stamps stay


def test_duplicate_stamps_are_left_out_counted_and_flagged(tmp_path: Path, in_t02: float) -> None:
    recording = perform(lab(tmp_path, tracker=fault("duplicate", in_t02, 1.0, amount=0.5)))

    assert {"T02": "eye_tracker_warning"} == flags_of(recording)
    rows = measured(recording)
    assert rows.loc["T02", "repeated_samples"] > 10
    assert 0 == rows.loc["T03", "repeated_samples"]
    assert "repeated time stamps" in findings(recording)


def test_backward_stamps_are_sorted_counted_and_flagged(tmp_path: Path, in_t02: float) -> None:
    recording = perform(lab(tmp_path, tracker=fault("backward", in_t02, 1.0, amount=0.05)))

    assert {"T02": "eye_tracker_warning"} == flags_of(recording)
    rows = measured(recording)
    assert rows.loc["T02", "backward_samples"] >= 1
    assert rows.loc["T02", "conflicting_samples"] <= rows.loc["T02", "repeated_samples"]
    assert 0 == rows.loc["T03", "backward_samples"]
    assert "backward time stamps" in findings(recording)


def test_one_lost_eye_is_flagged_by_name_and_the_other_still_measures(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, tracker=fault("eyes_lost", in_t02, 2.0, eyes="left")))

    assert {"T02": "left_eye_lost"} == flags_of(recording)
    assert measured(recording).loc["T02", "lost_01"] < 0.3
    assert "flagged: T02 (left_eye_lost)" in findings(recording)


def test_a_headset_in_standby_interrupts_the_trial_which_is_done_again(
    tmp_path: Path, in_t02: float
) -> None:
    recording = perform(lab(tmp_path, headset=fault("standby", in_t02, 5.0)))

    rows = trial_table(recording)
    assert "headset: no head tracking: in standby" == rows.loc[("T02", 1), "reason"]
    assert "complete" == rows.loc[("T02", 2), "status"]
    assert is_whole(recording)
    assert "headset: was away" in findings(recording)


def test_a_tracker_that_never_answers_a_calibration_is_named(tmp_path: Path) -> None:
    recording = perform(lab(tmp_path, tracker=fault("mute", 3.0)))

    assert recording.status == "complete"
    assert "calibrations that failed" in findings(recording)
    assert re.search(r"no answer to time requests for \d+ s", findings(recording))
    assert not events(recording, "calibration")[-1]["succeeded"]


def test_time_exchanges_of_trials_are_recorded_once_where_a_device_keeps_the_latest_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    all_of_them = exchanges_of(perform(lab(tmp_path / "all")))
    monkeypatch.setattr(exchange_log, "MAX_KEPT", 40)
    recording = perform(lab(tmp_path / "latest"))
    told = exchanges_of(recording)
    trials = recording.trials()
    followed = trials[
        trials["block"] == trials["block"].shift(-1)
    ]  # where those of before are told
    spans = list(zip(followed["t_start_ns"], followed["t_end_ns"], strict=True))
    in_trials = [
        e for e in all_of_them if any(start <= e[0] and e[2] <= end for start, end in spans)
    ]

    assert [] == [exchange for exchange in in_trials if exchange not in told]
    assert sorted({tuple(e) for e in told}) == [tuple(e) for e in told]
    assert len(in_trials) > 10


def exchanges_of(recording: Recording) -> list[list[int]]:
    payloads = events(recording, "clock_exchanges")
    return [triple for payload in payloads for triple in payload["send_device_receive_ns"]]
