import io
from dataclasses import replace

from rich.console import Console

from visavis.cli.operator_screen import KeyInterpreter, TerminalOperator, render
from visavis.devices.contracts import DeviceState, Fault, Health
from visavis.protocol.session.operator import (
    Action,
    CalibrationStatus,
    Command,
    SessionStatus,
    TrialCounts,
)
from visavis.protocol.session.states import SessionState

HEALTH = Health(DeviceState.STREAMING, 1200, 119.9, 2, 33.0, 4.0)
STATUS = SessionStatus(
    state=SessionState.TRIAL,
    participant="07K",
    trial_id="T05",
    trials=TrialCounts(done_count=5, planned_count=73, left_s=1200),
    block="Block 1",
    condition="AD, place left_far",
    trial_left_s=9.2,
    health={"eye_tracker": HEALTH, "responses": replace(HEALTH, received=0)},
    calibration=CalibrationStatus(accuracy_deg=0.8, precision_deg=0.1, age_s=130),
    faults=(Fault("eye_tracker", "blocking", "disconnected", "check the cable"),),
    prompt="",
    messages=("noted in T05: sneezed",),
)


def drawn(status: SessionStatus, entry_line: str = "") -> str:
    console = Console(file=io.StringIO(), width=120, color_system=None)
    console.print(render(status, entry_line, is_simulated=True))
    text: str = console.file.getvalue()  # type: ignore[attr-defined]  # a StringIO
    return text


def test_a_streams_rate_stands_beside_the_one_promised() -> None:
    promised = replace(STATUS, health={"eye_tracker": replace(HEALTH, nominal_rate_hz=120.0)})
    assert "119.9 of 120 Hz" in drawn(promised)


def test_no_fault_is_green_only_where_nothing_was_missed() -> None:
    calm = replace(STATUS, faults=())
    whole = {"eye_tracker": replace(HEALTH, gaps=0)}
    holes = {"headset": replace(HEALTH, gaps=380, longest_gap_ms=222.0, dropped=7)}

    assert "no faults" in drawn(replace(calm, health=whole))
    text = drawn(replace(calm, health=holes))
    assert "no fault now, but headset: 380 gaps, longest 222 ms, 7 lost" in text
    assert "no faults" not in text


def test_everything_an_operator_needs_is_on_the_screen() -> None:
    text = drawn(STATUS)

    for expected in (
        "T05",
        "condition  AD, place left_far",
        "10 s",
        "5/73",
        "~20 min",
        "longest gap",
        "119.9 Hz",
        "accuracy 0.80°",
        "2 min old",
        "eye_tracker: disconnected → check the cable",
        "noted in T05: sneezed",
        "SIMULATED",
    ):
        assert expected in text


def test_a_blinded_condition_is_hidden_and_none_is_claimed_between_trials() -> None:
    assert "(hidden)" in drawn(replace(STATUS, condition=""))
    assert "(hidden)" not in drawn(replace(STATUS, condition="", trial_id=""))


def test_a_trial_whose_time_is_up_claims_no_seconds_and_one_that_runs_at_least_one() -> None:
    assert "trial ends in  –" in drawn(replace(STATUS, trial_left_s=None))
    assert "trial ends in  1 s" in drawn(replace(STATUS, trial_left_s=0.2))


def test_a_study_without_calibration_lacks_none() -> None:
    status = replace(STATUS, calibration=CalibrationStatus())
    assert "calibration  none yet" in drawn(status)
    assert "calibration  not needed" in drawn(
        replace(STATUS, calibration=CalibrationStatus(is_planned=False))
    )


def test_skipped_trials_are_not_counted_as_done() -> None:
    assert "5/73, 2 skipped" in drawn(
        replace(STATUS, trials=replace(STATUS.trials, skipped_count=2))
    )
    assert "skipped" not in drawn(STATUS)


def test_a_device_without_samples_yet_shows_no_rate() -> None:
    line = next(t for t in drawn(STATUS).splitlines() if "responses" in t)
    assert "nothing yet" in line
    assert "Hz" not in line


def test_a_device_that_is_waited_for_stands_above_what_waits_for_the_operator() -> None:
    screen = drawn(replace(STATUS, waiting="Waiting for hand: in 9 s the session ends."))
    assert "in 9 s the session ends" in screen
    assert "Waiting for" not in drawn(STATUS)


def test_the_key_that_goes_on_without_a_device_is_named_where_it_does_something() -> None:
    waiting = replace(STATUS, waiting="Waiting for responses: you can go on without it.")

    assert "space goes on without it" in drawn(replace(waiting, can_go_on=True))
    assert "space goes on" not in drawn(waiting)


def test_escape_asks_before_it_ends_the_session() -> None:
    keys = KeyInterpreter()

    assert [] == keys.feed("\x1b")
    assert "Finished trials are kept" in keys.entry_line
    assert [] == keys.feed("n")
    assert [] == keys.feed("\x1b")
    assert [Command(Action.ABORT)] == keys.feed("y")


def test_a_note_is_typed_corrected_and_sent_with_enter() -> None:
    keys = KeyInterpreter()

    assert [] == keys.feed("nsnee\x7fz\x7f\x7fok p")
    assert "snok p" in keys.entry_line
    assert [Command(Action.NOTE, "snok p")] == keys.feed("\r")
    assert [Command(Action.PAUSE)] == keys.feed("p")


def test_a_reason_is_chosen_by_its_number_and_may_have_words() -> None:
    keys = KeyInterpreter({"unwell": "feels unwell", "noise": "noise outside"})

    assert [] == keys.feed("s")
    assert "1 feels unwell   2 noise outside" in keys.entry_line
    assert [Command(Action.SKIP, "dizzy", "unwell")] == keys.feed("1dizzy\r")
    assert [Command(Action.SKIP, "3 people came", "")] == keys.feed("s" + " 3 people came\r")
    assert [Command(Action.FLAG), Command(Action.REASON, "", "noise")] == keys.feed("fw2\r")
    assert [] == keys.feed("w\r")  # nothing was given
    assert [] == keys.feed("w9\x1b")  # there is no ninth


def test_numbers_stay_the_participants_answers_until_a_reason_is_asked_for() -> None:
    keys = KeyInterpreter()

    assert [Command(Action.FLAG), Command(Action.ANSWER, "3")] == keys.feed("f3")
    keys.feed("f")
    assert "W says why" in keys.entry_line
    keys.feed("z")
    assert "" == keys.entry_line


def test_a_forgotten_note_leaves_the_keys_as_they_were() -> None:
    keys = KeyInterpreter()

    assert [] == keys.feed("nabc\x1b")
    assert "" == keys.entry_line
    assert [Command(Action.FLAG)] == keys.feed("f")


def test_without_a_terminal_every_change_is_one_line_that_says_what_is_waited_for() -> None:
    console = Console(file=io.StringIO(), width=60, color_system=None)
    operator = TerminalOperator(console, is_simulated=False, confirm_waits=True)
    calm = replace(STATUS, faults=())

    operator.show(replace(calm, state=SessionState.INSTRUCTING, prompt="Hand over the\nheadset."))
    for left_s in (9.0, 8.0):
        operator.show(replace(calm, trial_left_s=left_s))
    operator.show(replace(calm, state=SessionState.INTERTRIAL))
    operator.show(STATUS)

    assert [
        "instructing, 5 of 73 done; waiting for you (space): Hand over the headset.",
        "trial T05, 5 of 73 done",
        "trial T05, 5 of 73 done; eye_tracker: disconnected → check the cable",
    ] == console.file.getvalue().splitlines()  # type: ignore[attr-defined]  # a StringIO
