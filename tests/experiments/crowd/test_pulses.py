"""Which command answered which contact."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from visavis.experiments.crowd.pulses import ASKED_WITHIN_NS, PATTERN, pulse_rows
from visavis.lab.clock import NS_PER_MS
from visavis.recording.reader import Recording

ROLE = "armband_left_forearm"


def recorded(
    contacts_ms: list[tuple[int, int]],
    commanded_ms: list[int],
    starts_ms: tuple[tuple[int, int], ...] = (),
) -> Recording:
    """Return contacts (begin, end) of one band, and when a pattern was commanded.

    `starts_ms` holds when the walk began, and at which attempt.
    """
    events: list[dict[str, Any]] = [
        {
            "recording_part": 1,
            "t_ns": t_ms * NS_PER_MS,
            "name": "trial_start",
            "payload": {"trial_id": "T09", "attempt": attempt},
        }
        for t_ms, attempt in starts_ms
    ]
    events += [
        {
            "recording_part": 1,
            "t_ns": t_ms * NS_PER_MS,
            "name": name,
            "payload": {
                "trial_id": "T09",
                "role": ROLE,
                "segment": "left_hand",
                "person": 4,
                "motors": "0",
                "vibrates": True,
                "t_contact_ns": t_ms * NS_PER_MS,
            },
        }
        for span in contacts_ms
        for name, t_ms in zip(("contact_begin", "contact_end"), span, strict=True)
    ]
    at_ns = np.array(commanded_ms, np.int64) * NS_PER_MS
    arrays = {
        "kind": np.full(len(at_ns), PATTERN),
        "t_commanded_ns": at_ns,
        "t_sent_ns": at_ns,
        "acknowledged": np.ones(len(at_ns), bool),
        "t_device_ns": at_ns,
        "t_host_ns": at_ns + NS_PER_MS,
    }
    return cast(
        Recording,
        SimpleNamespace(
            events=lambda: pd.DataFrame(events),
            manifest=SimpleNamespace(parts=[SimpleNamespace(number=1)]),
            stream_names=(f"haptics_{ROLE}",),
            stream_arrays=lambda _, part: arrays,
        ),
    )


def test_a_contact_never_answered_does_not_take_the_command_of_the_next() -> None:
    rows = pulse_rows(recorded([(1000, 1020), (1050, 1200)], commanded_ms=[1051, 1150]))
    assert [None, 1.0] == [row["commanded_ms"] for row in rows]
    assert [20.0, 150.0] == [row["held_ms"] for row in rows]


def test_each_contact_has_the_first_command_after_it() -> None:
    rows = pulse_rows(recorded([(1000, 1040), (1050, 1200)], commanded_ms=[1002, 1030, 1051]))
    assert [2.0, 1.0] == [row["commanded_ms"] for row in rows]
    assert [3.0, 2.0] == [row["acknowledged_ms"] for row in rows]


def test_a_command_long_after_a_contact_is_not_its_answer() -> None:
    (row,) = pulse_rows(recorded([(1000, 2000)], commanded_ms=[1500]))
    assert row["commanded_ms"] is None


def test_a_command_of_the_very_sample_that_began_a_contact_is_that_contacts() -> None:
    rows = pulse_rows(recorded([(1000, 1020), (1050, 1200)], commanded_ms=[1050]))
    assert [None, 0.0] == [row["commanded_ms"] for row in rows]


def test_a_command_exactly_at_the_limit_is_the_answer_and_one_after_is_not() -> None:
    limit_ms = ASKED_WITHIN_NS // NS_PER_MS
    (at,) = pulse_rows(recorded([(1000, 2000)], commanded_ms=[1000 + limit_ms]))
    assert limit_ms == at["commanded_ms"]
    (after,) = pulse_rows(recorded([(1000, 2000)], commanded_ms=[1001 + limit_ms]))
    assert after["commanded_ms"] is None


@pytest.mark.parametrize(("t_ms", "attempt"), [(899, None), (900, 1), (1199, 1), (1200, 2)])
def test_a_contact_is_of_the_attempt_begun_last_before_it_or_with_it(t_ms, attempt) -> None:
    starts = ((900, 1), (1200, 2))
    (row,) = pulse_rows(recorded([(t_ms, 2000)], commanded_ms=[], starts_ms=starts))
    assert attempt == row["attempt"]
