from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.faults.sessions import (
    PRACTICE_S,
    TRIALS,
    ScriptedOperator,
    events,
    findings,
    lab,
    path_of,
    perform,
    resume,
    trial_table,
    verdict,
)
from visavis.analysis.session_verdict import Level
from visavis.devices.contracts import Health
from visavis.devices.registry import driver_spec
from visavis.experiments.stare.trial import TRAINING_PROMPT
from visavis.lab.config import DeviceConfig, GazeChecks
from visavis.lab.errors import SessionAborted
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.operator_desk import HEALTH_NS
from visavis.protocol.session.rig import RunningRig
from visavis.protocol.session.states import TRANSITIONS, SessionState
from visavis.recording.reader import Recording

TRIAL, INTERTRIAL, BREAK = SessionState.TRIAL, SessionState.INTERTRIAL, SessionState.BREAK
IN_T02 = (TRIAL, 3, 5)  # after training and T01
BEFORE_T02 = (INTERTRIAL, 3, 5)


def operated(data_root: Path, operator: ScriptedOperator) -> Recording:
    """Perform a session with this operator and check that the table of states was kept."""
    recording = perform(lab(data_root), operator, trial_s=1.0)
    assert_moves_allowed(operator)
    assert "complete" == recording.status
    return recording


def assert_moves_allowed(operator: ScriptedOperator) -> None:
    for before, after in zip(operator.trail, operator.trail[1:], strict=False):
        # a status is shown once a frame, so a state may pass unseen
        ways = TRANSITIONS[before] | {w for via in TRANSITIONS[before] for w in TRANSITIONS[via]}
        assert after in ways, f"{before} to {after}"


def asked(recording: Recording) -> list[Mapping[str, Any]]:
    return [e for e in events(recording, "operator") if e["action"] != "advance"]


def order(recording: Recording) -> list[str]:
    return list(recording.trials()["trial_id"])


def test_a_pause_in_a_trial_waits_for_its_end_and_costs_nothing(tmp_path: Path) -> None:
    operator = ScriptedOperator((*IN_T02, Command(Action.PAUSE)))
    recording = operated(tmp_path, operator)

    assert ["P1", *TRIALS] == order(recording)
    assert {"complete"} == set(recording.trials()["status"])
    assert [{"action": "pause", "text": None}] == asked(recording)
    assert 1 == len(events(recording, "pause_start")) == len(events(recording, "pause_end"))
    after = operator.trail[operator.trail.index(SessionState.PAUSED) - 1]
    assert TRIAL is after
    assert "Paused." in operator.prompts
    asked_for = "pausing before the next trial"
    assert asked_for in operator.messages
    told = [s.messages for s in operator.seen if s.state is SessionState.PAUSED]
    assert not [messages for messages in told if asked_for in messages]
    assert "pauses: 1" in findings(recording)


def test_the_operator_is_told_conditions_by_their_name_and_no_second_that_is_over(
    tmp_path: Path,
) -> None:
    operator = ScriptedOperator()
    rows = trial_table(operated(tmp_path, operator))

    told = {s.trial_id: s.condition for s in operator.seen if s.trial_id in TRIALS}
    names = ("zone", "depth", "place")
    assert {
        trial: ", ".join(
            [
                rows.loc[(trial, 1), "condition"],
                *(f"{n} {rows.loc[(trial, 1), n].replace('_', ' ')}" for n in names),
            ]
        )
        for trial in TRIALS
    } == told
    left = [s.trial_left_s for s in operator.seen if s.state is TRIAL]
    assert None in left
    assert 0 < min(s for s in left if s is not None)


def test_a_pause_between_trials_comes_before_the_next_one(tmp_path: Path) -> None:
    operator = ScriptedOperator((*BEFORE_T02, Command(Action.PAUSE)))
    recording = operated(tmp_path, operator)

    paused = operator.trail.index(SessionState.PAUSED)
    assert INTERTRIAL is operator.trail[paused - 1]
    assert ["P1", *TRIALS] == order(recording)


def test_repeat_within_a_trial_ends_it_and_performs_it_again_last(tmp_path: Path) -> None:
    recording = operated(tmp_path, ScriptedOperator((*IN_T02, Command(Action.REPEAT))))

    assert ["P1", "T01", "T02", "T03", "T02", "T13", "T14", "T15"] == order(recording)
    rows = trial_table(recording)
    assert "interrupted" == rows.loc[("T02", 1), "status"]
    assert "complete" == rows.loc[("T02", 2), "status"]
    assert "T02, attempt 1, was interrupted: repeat asked for by the operator" in findings(
        recording
    )


def test_repeat_between_trials_means_the_one_just_performed(tmp_path: Path) -> None:
    recording = operated(tmp_path, ScriptedOperator((*BEFORE_T02, Command(Action.REPEAT))))

    assert ["P1", "T01", "T02", "T03", "T01", "T13", "T14", "T15"] == order(recording)
    assert {"complete"} == set(recording.trials()["status"])
    assert [{"trial_id": "T01"}] == events(recording, "trial_repeat")
    assert "repeated on the operator's request: T01" in findings(recording)


@pytest.mark.parametrize("when", [IN_T02, BEFORE_T02])
def test_a_skipped_trial_keeps_its_reason_and_is_not_done_again(
    tmp_path: Path, when: tuple[SessionState, int, int]
) -> None:
    operator = ScriptedOperator((*when, Command(Action.SKIP, "participant coughed")))
    recording = operated(tmp_path, operator)

    last = operator.seen[-1]
    assert (6, 1, 7) == (
        last.trials.done_count,
        last.trials.skipped_count,
        last.trials.planned_count,
    )
    assert 0 == last.trials.left_s
    row = trial_table(recording).loc[("T02", 1)]
    assert ("skipped", "participant coughed") == (row["status"], row["reason"])
    assert ["P1", *TRIALS] == order(recording)
    assert "skipped with a reason: T02" in findings(recording)


def test_recalibrate_comes_before_the_next_trial_and_is_in_its_row(tmp_path: Path) -> None:
    recording = operated(tmp_path, ScriptedOperator((*IN_T02, Command(Action.RECALIBRATE))))

    rows = trial_table(recording)
    assert rows.loc[("T02", 1), "calibration_id"] == rows.loc[("T01", 1), "calibration_id"]
    assert rows.loc[("T03", 1), "calibration_id"] != rows.loc[("T02", 1), "calibration_id"]
    assert [{"action": "recalibrate", "text": None}] == asked(recording)


def test_notes_and_flags_are_kept_with_their_trial(tmp_path: Path) -> None:
    operator = ScriptedOperator(
        (*IN_T02, Command(Action.NOTE, "sneezed, äöü")),
        (*IN_T02, Command(Action.FLAG)),
    )
    recording = operated(tmp_path, operator)

    assert "operator_flag" == trial_table(recording).loc[("T02", 1), "flags"]
    assert "note: sneezed, äöü" in findings(recording)
    assert "flagged: T02 (operator_flag)" in findings(recording)
    assert "flagged in T02" in operator.messages


def test_a_reason_given_after_a_flag_is_a_flag_of_the_trial_and_in_the_verdict(
    tmp_path: Path,
) -> None:
    operator = ScriptedOperator(
        (*IN_T02, Command(Action.FLAG)),
        (*IN_T02, Command(Action.REASON, "drill next door", "disturbance")),
    )
    recording = operated(tmp_path, operator)

    assert "operator_flag;disturbance" == trial_table(recording).loc[("T02", 1), "flags"]
    assert (
        "reasons: given by the operator: noise, or somebody came in (disturbance) once"
        in findings(recording)
    )
    assert "note: drill next door" in findings(recording)
    given = [e for e in asked(recording) if e["action"] == "reason"]
    assert [{"action": "reason", "text": "drill next door", "code": "disturbance"}] == given


def test_a_reason_of_the_labs_own_list_is_told_in_its_words(tmp_path: Path) -> None:
    own = lab(tmp_path).model_copy(update={"incidents": {"tram": "the tram passed below"}})
    operator = ScriptedOperator((*IN_T02, Command(Action.FLAG, code="tram")))
    recording = perform(own, operator, trial_s=1.0)

    assert "given by the operator: the tram passed below (tram) once" in findings(recording)


def test_a_skipped_trial_bears_the_code_of_its_reason(tmp_path: Path) -> None:
    command = Command(Action.SKIP, "dizzy", "unwell")
    recording = operated(tmp_path, ScriptedOperator((*IN_T02, command)))

    row = trial_table(recording).loc[("T02", 1)]
    assert ("skipped", "unwell: dizzy") == (row["status"], row["reason"])
    assert "unwell" in row["flags"]


def test_silence_is_answered_even_without_a_haptic_device(tmp_path: Path) -> None:
    operator = ScriptedOperator((*IN_T02, Command(Action.SILENCE)))
    recording = operated(tmp_path, operator)

    assert "silenced: no haptic device is connected" in operator.messages
    assert [{"action": "silence", "text": None}] == asked(recording)
    assert {"complete"} == set(recording.trials()["status"])


def test_requests_that_make_no_sense_now_are_answered_not_swallowed(tmp_path: Path) -> None:
    instructing = (SessionState.INSTRUCTING, 1, 1)
    operator = ScriptedOperator(
        (*instructing, Command(Action.SKIP, "too early")),
        (*instructing, Command(Action.REPEAT)),
    )
    recording = operated(tmp_path, operator)

    assert "nothing to skip: no trial is running or about to" in operator.messages
    assert "nothing to repeat: no trial has been performed yet" in operator.messages
    assert ["P1", *TRIALS] == order(recording)


@pytest.mark.parametrize(
    ("when", "kept"),
    [(IN_T02, ["P1", "T01"]), ((BREAK, 2, 2), ["P1", "T01", "T02", "T03"])],
)
def test_an_aborted_session_keeps_its_trials_and_is_completed_by_resume(
    tmp_path: Path, when: tuple[SessionState, int, int], kept: list[str]
) -> None:
    config = lab(tmp_path)
    operator = ScriptedOperator((*when, Command(Action.ABORT)))
    with pytest.raises(SessionAborted, match="every finished trial is kept") as ended:
        perform(config, operator)

    assert 3 == ended.value.exit_code
    assert_moves_allowed(operator)
    recording = Recording(path_of(config))
    rows = recording.trials()
    assert "aborted" == recording.status
    assert kept == list(rows.loc[rows["status"] == "complete", "trial_id"])
    assert Level.RED is verdict(recording).level
    assert "recording: ended early: the session was ended by the operator" in findings(recording)

    whole = resume(config)
    rows = whole.trials()
    assert "complete" == whole.status
    assert {"P1", *TRIALS} == set(rows.loc[rows["status"] == "complete", "trial_id"])
    assert "part 1 ended early: the session was ended by the operator" in findings(whole)


def test_training_goes_on_until_the_operator_ends_it(tmp_path: Path) -> None:
    operator = ScriptedOperator()
    recording = operated(tmp_path, operator)

    assert TRAINING_PROMPT in operator.prompts
    assert [{"trial_id": "P1", "by": "operator"}] == events(recording, "training_end")
    row = trial_table(recording).loc["P1", 1]
    assert row["t_end_ns"] - row["t_start_ns"] > PRACTICE_S * 1e9


def test_training_that_is_repeated_takes_its_prompt_off_the_screen(tmp_path: Path) -> None:
    waiting = round(PRACTICE_S * 30) + 3  # frames at 30 Hz, just after the prompt
    operator = Distracted((TRIAL, 1, waiting, Command(Action.REPEAT)))
    recording = operated(tmp_path, operator)

    assert ["interrupted", "complete"] == trial_table(recording).loc["P1"]["status"].tolist()
    assert 1 == len(events(recording, "training_end"))


class Distracted(ScriptedOperator):
    """Let the first training's prompt stand until the script has said something."""

    def poll(self) -> Sequence[Command]:
        commands = super().poll()
        if self._script:
            return [c for c in commands if c.action is not Action.ADVANCE or self._in_setup()]
        return commands

    def _in_setup(self) -> bool:
        return not self.trail or self.trail[-1] is not TRIAL


def drift_checks(recording: Recording) -> list[Mapping[str, Any]]:
    return [dict(e) for e in events(recording, "drift_check")]


def test_drift_is_checked_before_the_next_trial_when_the_operator_asks(tmp_path: Path) -> None:
    operator = ScriptedOperator((*IN_T02, Command(Action.CHECK_DRIFT)))
    recording = operated(tmp_path, operator)

    (check,) = drift_checks(recording)
    assert ("operator", True, 2.0) == (check["moment"], check["accepted"], check["limit_deg"])
    assert 0 < check["error_deg"] < 2.0
    assert not check["corrected"]
    rows = trial_table(recording)
    assert rows.loc[("T03", 1), "calibration_id"] == rows.loc[("T02", 1), "calibration_id"]
    assert any(message.startswith("drift of gaze: ") for message in operator.messages)


def test_drift_beyond_the_limit_is_calibrated_anew_by_the_rule_of_the_lab(tmp_path: Path) -> None:
    checks = GazeChecks(drift_check_trials=2, drift_limit_deg=0.01)
    operator = ScriptedOperator()
    recording = perform(lab(tmp_path).model_copy(update={"gaze": checks}), operator, trial_s=1.0)
    assert_moves_allowed(operator)

    found = drift_checks(recording)
    assert {("rule", False)} == {(c["moment"], c["accepted"]) for c in found}
    rows = trial_table(recording)
    first, third = rows.loc[("T01", 1), "calibration_id"], rows.loc[("T03", 1), "calibration_id"]
    assert first != third
    assert ["P1", *TRIALS] == order(recording)


def test_an_eyelink_is_calibrated_by_its_host_between_trials(tmp_path: Path) -> None:
    config = lab(tmp_path)
    options = driver_spec("eyelink").options(
        rate_hz=100.0, screen_width_mm=1200.0, screen_height_mm=900.0
    )
    tracker = DeviceConfig(
        role="eye_tracker", driver="eyelink", simulated=True, options=options.model_dump()
    )
    config = config.model_copy(update={"devices": {**config.devices, "eye_tracker": tracker}})
    operator = ScriptedOperator((*IN_T02, Command(Action.RECALIBRATE)))
    recording = perform(config, operator, trial_s=1.0)
    assert_moves_allowed(operator)

    calibrations = [dict(e) for e in events(recording, "calibration")]
    assert {(True, "calibration result: GOOD")} == {
        (c["succeeded"], c["message"]) for c in calibrations
    }
    rows = trial_table(recording)
    assert rows.loc[("T03", 1), "calibration_id"] != rows.loc[("T02", 1), "calibration_id"]
    assert rows.loc[("T03", 1), "calibration_accepted"]
    assert [] == [e for e in events(recording, "fault") if e["role"] == "eye_tracker"]


def test_figures_of_streams_are_made_as_often_as_people_read_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whoever is shown every frame gets no clock fitted for every frame.
    made_ns: list[int] = []
    make = RunningRig.health

    def health(rig: RunningRig) -> dict[str, Health]:
        made_ns.append(rig._clock.now_ns())
        return make(rig)

    monkeypatch.setattr(RunningRig, "health", health)
    operator = ScriptedOperator()
    perform(lab(tmp_path), operator, trial_s=1.0)
    assert HEALTH_NS <= min(later - now for now, later in pairwise(made_ns))
    assert len(made_ns) < len(operator.seen) / 4
    received = [status.health["eye_tracker"].received for status in operator.seen]
    assert sorted(received) == received
    assert 0 < received[-1]
