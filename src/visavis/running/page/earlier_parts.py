"""What the earlier parts of a session on a page hold, and how it is gone back to a checkpoint."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from visavis.recording.reader import Recording
from visavis.study.returning import Resumes, Returning

RESTART_FLAG: Final = "server restarted"
REWOUND: Final = "rewound"
REWOUND_FLAG: Final = "begun anew"
PAGE_EVENT: Final = "page_event"
CHECKPOINTS: Final[Mapping[Resumes, tuple[str, ...]]] = {
    "trial": ("trial_start", "block_end"),
    "block": ("block_start", "block_end"),
    "start": ("consent",),
}
"""Events of the course after which something is done again."""


@dataclass(frozen=True)
class EarlierParts:
    """Content of the earlier parts of a session: page events in order, and what else was written.

    `events` are (part, session time, payload). `rows` are the attempts (trial, number) that have a
    row, `started` those that were begun, `answers` pairs (questionnaire, question),
    `answered_questions` triples of trial, question and how often it had been answered, `complete`
    finished questionnaires. A trial that continues in a later part is flagged with `broken_by`; ""
    means that nothing interrupted it. What was gone back behind is in none of them; `attempts`
    holds the last attempt of every trial that has a row. `checkpoints` are the course's events:
    name, trial, and how many page events were before each. `rewinding` is the last of `events`
    where the session has just been gone back; it is to be recorded.
    """

    events: Sequence[tuple[int, int, Mapping[str, Any]]] = ()
    rows: frozenset[tuple[str, int]] = frozenset()
    started: frozenset[tuple[str, int]] = frozenset()
    answers: frozenset[tuple[str, str]] = frozenset()
    answered_questions: Counter[tuple[str, str]] = field(default_factory=Counter)
    complete: frozenset[str] = frozenset()
    broken_by: str = RESTART_FLAG
    attempts: Mapping[str, int] = field(default_factory=dict)
    checkpoints: Sequence[tuple[str, str, int]] = ()
    rewinding: Mapping[str, Any] | None = None
    rows_on_disk: Mapping[str, int] = field(default_factory=dict)
    """The number after the last recorded row of each stream of a headset."""

    def attempt_of(self, trial_id: str, nth: int) -> int:
        """Return the attempt that a trial's nth performance in the course is."""
        numbers = sorted(n for trial, n in self.rows if trial == trial_id)
        if nth <= len(numbers):
            return numbers[nth - 1]
        return self.attempts.get(trial_id, 0) + nth - len(numbers)


def since_rewinding(
    records: Sequence[Mapping[Any, Any]],
) -> tuple[
    list[tuple[int, int, Mapping[str, Any]]],
    list[tuple[int, str, Mapping[str, Any]]],
    set[tuple[str, int]],
]:
    """Return a session's page events and course events that still count, and attempts that do not.

    Page events are (part, session time, payload); course events are (number of page events before
    each, name, payload), so that going back forgets what is later. Attempts are (trial, number).
    """
    pages: list[tuple[int, int, Mapping[str, Any]]] = []
    course: list[tuple[int, str, Mapping[str, Any]]] = []
    left_behind: set[tuple[str, int]] = set()
    for event in records:
        name, payload = event["name"], event["payload"]
        if name != PAGE_EVENT:
            course.append((len(pages), name, payload))
            continue
        if payload["kind"] == REWOUND:
            to, again = payload["to"], payload["again"]
            pages = pages[:to]
            later = [
                n > to or (n == to and about.get("trial_id") in again) for n, _, about in course
            ]
            left_behind |= {
                (str(about["trial_id"]), int(about["attempt"]))
                for (_, what, about), is_later in zip(course, later, strict=True)
                if is_later and what == "trial_start"
            }
            course = [one for one, is_later in zip(course, later, strict=True) if not is_later]
        pages.append((int(event["recording_part"]), int(event["t_ns"]), payload))
    return pages, course, left_behind


def past_of(recording: Recording, rewinding: Mapping[str, Any] | None = None) -> EarlierParts:
    """Return the content of the earlier parts of a session, gone back by `rewinding` at last."""
    trials = recording.trials()
    rows: set[tuple[str, int]] = set()
    if "trial_id" in trials:
        rows = set(zip(map(str, trials["trial_id"]), map(int, trials["attempt"]), strict=True))
    records: list[dict[Any, Any]] = recording.events().to_dict("records")
    if rewinding is not None:
        part = recording.manifest.parts[-1].number
        about = {"recording_part": part, "t_ns": 0, "name": PAGE_EVENT, "payload": rewinding}
        records.append(about)
    pages, course, left_behind = since_rewinding(records)

    def all_of(name: str, *keys: str) -> frozenset[Any]:
        contents = (about for _, what, about in course if what == name)
        return frozenset(tuple(str(about[key]) for key in keys) for about in contents)

    return EarlierParts(
        pages,
        frozenset(rows - left_behind),
        frozenset(
            (str(about["trial_id"]), int(about["attempt"]))
            for _, what, about in course
            if what == "trial_start"
        ),
        all_of("answer", "questionnaire", "question"),
        Counter(
            (str(about["trial_id"]), str(about["question"]))
            for _, what, about in course
            if what == "answered"
        ),
        frozenset(name for (name,) in all_of("questionnaire_complete", "questionnaire")),
        attempts={trial: max(n for t, n in rows if t == trial) for trial, _ in rows},
        checkpoints=[(what, str(about.get("trial_id", "")), n) for n, what, about in course],
        rewinding=rewinding,
        rows_on_disk={
            name: 1 + int(seq.max())
            for name in recording.stream_names
            if len(seq := recording.stream_arrays(name)["seq"])
        },
    )


def back_to(recording: Recording, checkpoint: Resumes) -> EarlierParts:
    """Return the past of a session gone back to a checkpoint, or as it is where it is at one.

    What was done since stays recorded; its trials are done again as further attempts.
    """
    past = past_of(recording)
    names = CHECKPOINTS.get(checkpoint, ())
    places = [n for what, _, n in past.checkpoints if what in names]
    if not places and checkpoint != "start":
        return past
    to = places[-1] if places else 0
    if not any(payload["kind"] == "reply" for _, _, payload in past.events[to:]):
        return past
    trials = {t for what, t, n in past.checkpoints if what == "trial_start" and n >= to}
    performed = {trial for trial, _ in past.rows}
    all_events = recording.events()
    events = [*all_events.loc[all_events["name"] == PAGE_EVENT, "payload"]]
    return past_of(
        recording,
        {
            "kind": REWOUND,
            "to": to,
            "again": sorted(trials & performed),
            "n": max((int(p["n"]) for p in events if "n" in p), default=0),
            "number": 1 + max(int(p.get("number", p.get("step", -1) + 1)) for p in events),
        },
    )


def returning_to(recording: Recording, policy: Returning, now_iso: str) -> EarlierParts | None:
    """Return the past of a session that somebody comes back to; None where it is too old."""
    begin = datetime.fromisoformat(recording.manifest.created_wall_iso)
    age_h = (datetime.fromisoformat(now_iso) - begin).total_seconds() / 3600
    checkpoint = policy.checkpoint(age_h)
    return None if checkpoint is None else back_to(recording, checkpoint)
