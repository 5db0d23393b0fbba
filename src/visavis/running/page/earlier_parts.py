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

    `events` are (part, session time, payload). `rows` are trials that have a row, `answers` pairs
    (questionnaire, question), `answered_questions` pairs (trial, question), `complete` finished
    questionnaires. A trial that continues in a later part is flagged with `broken_by`; "" means
    that nothing interrupted it. What was gone back behind is in none of them; `attempts` counts
    every row of a trial. `checkpoints` are the course's events: name, trial, and how many page
    events were before each. `rewinding` is the last of `events` where the session has just been
    gone back; it is to be recorded.
    """

    events: Sequence[tuple[int, int, Mapping[str, Any]]] = ()
    rows: frozenset[str] = frozenset()
    started: frozenset[str] = frozenset()
    answers: frozenset[tuple[str, str]] = frozenset()
    answered_questions: frozenset[tuple[str, str]] = frozenset()
    complete: frozenset[str] = frozenset()
    broken_by: str = RESTART_FLAG
    attempts: Mapping[str, int] = field(default_factory=dict)
    checkpoints: Sequence[tuple[str, str, int]] = ()
    rewinding: Mapping[str, Any] | None = None
    rows_on_disk: Mapping[str, int] = field(default_factory=dict)
    """The number after the last recorded row of each stream of a headset."""


def past_of(recording: Recording, rewinding: Mapping[str, Any] | None = None) -> EarlierParts:
    """Return the content of the earlier parts of a session, gone back by `rewinding` at last."""
    trials = recording.trials()
    rows = Counter(map(str, trials["trial_id"])) if "trial_id" in trials else Counter[str]()
    records: list[dict[Any, Any]] = recording.events().to_dict("records")
    if rewinding is not None:
        part = recording.manifest.parts[-1].number
        about = {"recording_part": part, "t_ns": 0, "name": PAGE_EVENT, "payload": rewinding}
        records.append(about)
    pages: list[tuple[int, int, Mapping[str, Any]]] = []
    # Each thing with the number of page events before it, so that going back forgets what is later.
    course: list[tuple[int, str, Mapping[str, Any]]] = []
    left_behind: Counter[str] = Counter()
    for event in records:
        name, payload = event["name"], event["payload"]
        if name != PAGE_EVENT:
            course.append((len(pages), name, payload))
            continue
        if payload["kind"] == REWOUND:
            to, again = payload["to"], payload["again"]
            pages = pages[:to]
            left_behind.update(again)
            course = [
                (n, what, about)
                for n, what, about in course
                if n < to or (n == to and about.get("trial_id") not in again)
            ]
        pages.append((int(event["recording_part"]), int(event["t_ns"]), payload))

    def all_of(name: str, *keys: str) -> frozenset[Any]:
        contents = (about for _, what, about in course if what == name)
        return frozenset(tuple(str(about[key]) for key in keys) for about in contents)

    return EarlierParts(
        pages,
        frozenset(trial for trial, n in rows.items() if n > left_behind[trial]),
        frozenset(trial for (trial,) in all_of("trial_start", "trial_id")),
        all_of("answer", "questionnaire", "question"),
        all_of("answered", "trial_id", "question"),
        frozenset(name for (name,) in all_of("questionnaire_complete", "questionnaire")),
        attempts=rows,
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
    all_events = recording.events()
    events = [*all_events.loc[all_events["name"] == PAGE_EVENT, "payload"]]
    return past_of(
        recording,
        {
            "kind": REWOUND,
            "to": to,
            "again": sorted(trials & past.rows),
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
