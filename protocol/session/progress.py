"""What earlier parts of a session have finished, and what is left of a block."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from visavis.protocol.plan.session_plan import Block, Trial
from visavis.recording.reader import Recording

FINAL_STATUSES = frozenset({"complete", "skipped"})
"""Statuses of a trial that need no further attempt."""


@dataclass(frozen=True)
class Progress:
    """The state a resumed session starts from; empty for a new one.

    `attempts` counts performances of each trial so far, `finished` holds trials that need no
    other, `skipped_trials` those of them that were not performed, `unfinished` those that were
    interrupted, in order. `complete_questionnaires` holds names, `answers` every (questionnaire,
    question) that was asked. `calibrations` is the number of validations stored, `memory` what a
    simulated participant had learned.
    """

    attempts: Mapping[str, int] = field(default_factory=dict)
    finished: frozenset[str] = frozenset()
    skipped_trials: frozenset[str] = frozenset()
    unfinished: tuple[str, ...] = ()
    complete_questionnaires: frozenset[str] = frozenset()
    answers: frozenset[tuple[str, str]] = frozenset()
    calibrations: int = 0
    validated_at_end: bool = False
    memory: Mapping[str, float] = field(default_factory=dict)
    again: Mapping[str, int] = field(default_factory=dict)
    """How often the study has had each trial performed again."""
    further_practice: int = 0
    """How many rounds of practice were begun after the first."""
    endings: Mapping[int | None, str] = field(default_factory=dict)
    """Why blocks, by index, or the whole session (None) ended before their end."""

    @property
    def is_resumed(self) -> bool:
        """Tell whether anything happened before."""
        return bool(self.attempts) or self.calibrations > 0


def progress_of(events: Iterable[Mapping[str, Any]]) -> Progress:
    """Derive progress from the events of all earlier parts, oldest first."""
    attempts: dict[str, int] = {}
    finished_ids: set[str] = set()
    skipped_ids: set[str] = set()
    unfinished_ids: dict[str, None] = {}
    complete_questionnaires: set[str] = set()
    answers: set[tuple[str, str]] = set()
    calibrations = 0
    validated_at_end = False
    memory: dict[str, float] = {}
    again: Counter[str] = Counter()
    further_practice = 0
    endings: list[tuple[str, int | None, str]] = []
    for event in events:
        kind = event.get("event")
        if kind == "trial_start":
            trial_id = str(event["trial_id"])
            attempts[trial_id] = attempts.get(trial_id, 0) + 1
            unfinished_ids.pop(trial_id, None)  # what is begun once more comes after the others
            unfinished_ids[trial_id] = None
            finished_ids.discard(trial_id)
        elif kind == "trial":
            trial_id = str(event["trial_id"])
            again[trial_id] += event["status"] == "repeated"
            if event["status"] in FINAL_STATUSES:
                finished_ids.add(trial_id)
                skipped_ids.discard(trial_id)
                unfinished_ids.pop(trial_id, None)
                if event["status"] == "skipped":
                    skipped_ids.add(trial_id)
                if event["status"] == "skipped" and trial_id not in attempts:
                    attempts[trial_id] = 0
        elif kind == "trial_repeat":
            trial_id = str(event["trial_id"])
            finished_ids.discard(trial_id)
            unfinished_ids[trial_id] = None
        elif kind == "practice_again":
            further_practice += 1
            again.update(event["trial_ids"])
            finished_ids.difference_update(event["trial_ids"])
            unfinished_ids |= dict.fromkeys(event["trial_ids"])
        elif kind == "ended_early":
            block = event["block"] if event["of"] == "block" else None
            endings.append((str(event["trial_id"]), block, str(event["reason"])))
        elif kind == "answer":
            answers.add((str(event["questionnaire"]), str(event["question"])))
        elif kind == "questionnaire_complete":
            complete_questionnaires.add(str(event["questionnaire"]))
        elif kind == "validation":
            calibrations += 1
            validated_at_end = validated_at_end or event.get("moment") == "end"
        elif kind == "participant_memory":
            memory = {str(name): float(value) for name, value in event["memory"].items()}
    return Progress(
        attempts,
        frozenset(finished_ids),
        frozenset(skipped_ids & finished_ids),
        tuple(unfinished_ids),
        frozenset(complete_questionnaires),
        frozenset(answers),
        calibrations,
        validated_at_end,
        memory,
        +again,
        further_practice,
        # An ending counts with the row of its trial, which is written after it.
        {block: reason for trial_id, block, reason in endings if trial_id in finished_ids},
    )


def progress_of_recording(recording: Recording) -> Progress:
    """Derive progress from everything a session has recorded so far."""
    rows = {
        (str(row["trial_id"]), int(row["attempt"])): row
        for row in recording.trials().to_dict("records")
    }
    entries: list[dict[str, Any]] = []
    for event in recording.events().to_dict("records"):
        entry = {**event["payload"], "event": event["name"]}
        entries.append(entry)
        if event["name"] == "trial_start":
            row = rows.get((str(entry["trial_id"]), int(entry["attempt"])))
            if row is not None:
                entries.append({**{str(k): v for k, v in row.items()}, "event": "trial"})
    return progress_of(entries)


def remaining_trials(block: Block, progress: Progress) -> tuple[Trial, ...]:
    """Return a block's trials still to do: never begun in planned order, then interrupted ones."""
    order_by_id = {trial_id: order for order, trial_id in enumerate(progress.unfinished)}
    fresh = [
        t
        for t in block.trials
        if t.trial_id not in progress.finished and t.trial_id not in order_by_id
    ]
    again = sorted(
        (t for t in block.trials if t.trial_id in order_by_id),
        key=lambda t: order_by_id[t.trial_id],
    )
    return (*fresh, *again)
