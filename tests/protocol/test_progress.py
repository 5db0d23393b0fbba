from visavis.protocol.plan.session_plan import Block, Trial
from visavis.protocol.session.progress import Progress, progress_of, remaining_trials


def trial(number: int) -> Trial:
    return Trial(f"T{number:02d}", number, 0, False, {"condition": "A"}, seed=number)


BLOCK = Block(0, "Block 1", "Look around.", tuple(trial(n) for n in range(1, 5)))


def start(trial_id: str) -> dict[str, object]:
    return {"event": "trial_start", "trial_id": trial_id}


def end(trial_id: str, status: str) -> dict[str, object]:
    return {"event": "trial", "trial_id": trial_id, "status": status}


def ids(trials: tuple[Trial, ...]) -> list[str]:
    return [t.trial_id for t in trials]


def test_a_new_session_has_every_trial_left_in_planned_order() -> None:
    assert ["T01", "T02", "T03", "T04"] == ids(remaining_trials(BLOCK, Progress()))
    assert Progress().is_resumed is False


def test_a_trial_without_its_row_comes_back_at_the_end_of_the_block() -> None:
    progress = progress_of([start("T01"), end("T01", "complete"), start("T02")])

    assert ["T03", "T04", "T02"] == ids(remaining_trials(BLOCK, progress))
    assert progress.attempts == {"T01": 1, "T02": 1}


def test_an_interrupted_row_leaves_the_trial_to_be_done_again() -> None:
    progress = progress_of([start("T02"), end("T02", "interrupted")])

    assert ["T01", "T03", "T04", "T02"] == ids(remaining_trials(BLOCK, progress))


def test_a_trial_skipped_before_and_performed_now_is_not_skipped() -> None:
    skipped = [start("T01"), end("T01", "skipped")]
    assert {"T01"} == progress_of(skipped).skipped_trials == progress_of(skipped).finished
    performed = progress_of([*skipped, start("T01"), end("T01", "complete")])
    assert frozenset() == performed.skipped_trials
    assert {"T01"} == performed.finished


def test_a_skipped_trial_is_not_done_again() -> None:
    progress = progress_of([start("T01"), end("T01", "skipped")])
    assert ["T02", "T03", "T04"] == ids(remaining_trials(BLOCK, progress))


def test_a_repeat_asked_for_survives_a_crash() -> None:
    events = [
        start("T01"),
        end("T01", "complete"),
        {"event": "trial_repeat", "trial_id": "T01"},
    ]

    assert ["T02", "T03", "T04", "T01"] == ids(remaining_trials(BLOCK, progress_of(events)))


def test_what_a_simulated_participant_learned_last_is_kept():
    events = [
        {"event": "participant_memory", "trial_id": "T01", "memory": {"caution": 0.1}},
        end("T01", "complete"),
        {"event": "participant_memory", "trial_id": "T02", "memory": {"caution": 0.3}},
    ]

    assert {"caution": 0.3} == progress_of(events).memory
    assert {} == Progress().memory


def test_a_finished_second_attempt_ends_an_interrupted_trial() -> None:
    events = [
        start("T01"),
        end("T01", "interrupted"),
        start("T02"),
        end("T02", "complete"),
        start("T01"),
        end("T01", "complete"),
    ]
    progress = progress_of(events)

    assert ["T03", "T04"] == ids(remaining_trials(BLOCK, progress))
    assert progress.attempts["T01"] == 2


def test_answered_questionnaires_and_validations_are_counted() -> None:
    events = [
        {"event": "validation", "moment": "block_start"},
        {"event": "validation", "moment": "end"},
        {"event": "questionnaire_complete", "questionnaire": "liebowitz"},
    ]
    progress = progress_of(events)

    assert frozenset({"liebowitz"}) == progress.complete_questionnaires
    assert progress.calibrations == 2
    assert progress.validated_at_end
