"""Measure how long the key of an answer was held, where the device tells of its release.

On a page the browser tells it; before a monitor and with button boxes the stream `responses` holds
every release. Some boxes, and answers by mouse, touch or gaze, have none: then it is missing.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Final

import numpy as np

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.kinds import takes_kinds
from visavis.protocol.plan.steps import Scalar
from visavis.recording.reader import Recording
from visavis.study.measures import Measure, TrialRecord

RESPONSES: Final = "responses"
MAX_HELD_S: Final = 60.0
"""A key is looked for so long after it was pressed."""
FRAME_MS: Final = 50.0
"""A board takes a press up to so long after it was heard."""
SAME_MS: Final = 1e-3


@takes_kinds()
def key_held(answer: str, *, column: str = "") -> Measure:
    """Return how long the key was held that gave an answer, from press to release, in ms.

    `answer` is the name of a response; the column is `ANSWER_held_ms` unless `column` names it.
    Missing where no release is known, never zero. A page keeps releases for studies with this
    measure alone.
    """

    def of(record: TrialRecord) -> Scalar | None:
        if record.recording is None or record.row.get(f"{answer}_by") != "keys":
            return None
        part, lasted_ms = int(record.row["recording_part"]), record.number(f"{answer}_ms")
        for payload in _answered(record.recording, part).get((record.row["trial_id"], answer), ()):
            since_ms = (payload["answered_ns"] - payload["asked_ns"]) / NS_PER_MS
            if lasted_ms is None or abs(since_ms - lasted_ms) > SAME_MS:
                continue  # of another attempt
            if payload.get("released_ns") is not None:
                return float((payload["released_ns"] - payload["answered_ns"]) / NS_PER_MS)
            if RESPONSES in record.recording.stream_names:
                return _held_ms(record, int(payload["answered_ns"]))
        return None

    words = f"Time for which the key of {answer.replace('_', ' ')} was held"
    return Measure(column or f"{answer}_held_ms", "ms", words, of, held=answer)


@lru_cache(maxsize=2)
def _answered(
    recording: Recording, part: int
) -> Mapping[tuple[Any, str], tuple[Mapping[str, Any], ...]]:
    """Return what a part's events say of answers, by trial and question, the last one first."""
    found: dict[tuple[Any, str], tuple[Mapping[str, Any], ...]] = {}
    for payload in recording.events_named("answered", part)["payload"]:
        key = (payload["trial_id"], payload["question"])
        found[key] = (payload, *found.get(key, ()))
    return found


def _held_ms(record: TrialRecord, answered_ns: int) -> float | None:
    """Return how long a button was held; None where its press or its release is not certain."""
    earliest_ns = answered_ns - round(FRAME_MS * NS_PER_MS)
    rows = record.stream(RESPONSES, earliest_ns, answered_ns + round(MAX_HELD_S * NS_PER_S))
    t_ns, control, level = rows["t_host_ns"], rows["control"], rows["value_01"]
    pressed = np.flatnonzero((t_ns <= answered_ns) & (level > 0.5))
    exact = pressed[t_ns[pressed] == answered_ns]
    pressed = exact if len(exact) else pressed
    if len(pressed) != 1:
        return None
    first = int(pressed[0])
    for row in range(first + 1, len(t_ns)):
        if control[row] != control[first]:
            continue
        if level[row] <= 0.5:
            return float((t_ns[row] - t_ns[first]) / NS_PER_MS)
        if level[row] == level[first]:  # pressed again: this device tells of no release
            return None
    return None
