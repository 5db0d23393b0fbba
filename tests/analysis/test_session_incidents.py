"""What happened between trials is told with its reason, wherever that was given."""

from types import SimpleNamespace
from typing import Any, cast

import pandas as pd
import pytest

from visavis.analysis.session_incidents import Incident, incidents_of
from visavis.recording.reader import Recording

S = 1_000_000_000
TRIALS = (("T01", 10, 20), ("T02", 30, 40))
Event = tuple[float, str, dict[str, Any]]


def happened(*events: Event, status: str = "complete", reason: str = "") -> list[Incident]:
    """Return the incidents of one part with two trials, its times in seconds."""
    rows = [(1, int(t_s * S), name, payload) for t_s, name, payload in events]
    recording = SimpleNamespace(
        manifest=SimpleNamespace(
            parts=[SimpleNamespace(number=1, status=status, reason=reason)], configuration=None
        ),
        events=lambda: pd.DataFrame(rows, columns=["recording_part", "t_ns", "name", "payload"]),
        trial_entries=lambda _: [
            {"t_ns": end * S, "row": {"trial_id": name, "t_start_ns": begin * S}}
            for name, begin, end in TRIALS
        ],
    )
    return list(incidents_of(cast(Recording, recording)))


def asked(t_s: float, action: str, text: str = "", code: str = "") -> Event:
    return t_s, "operator", {"action": action, "text": text or None, "code": code}


def test_reason_given_while_the_session_waits_belongs_to_the_pause() -> None:
    assert [
        Incident("after T01", "pause of 5 s", "the participant is unwell (unwell): dizzy")
    ] == happened(
        asked(15, "pause"),
        (21, "pause_start", {}),
        asked(23, "reason", "dizzy", "unwell"),
        (26, "pause_end", {}),
    )


@pytest.mark.parametrize("at_s", [16, 28, 35])
def test_reason_belongs_to_the_last_pause_wherever_it_was_given(at_s: float) -> None:
    events = sorted(
        [
            asked(15, "pause"),
            (21, "pause_start", {}),
            (26, "pause_end", {}),
            asked(at_s, "reason", code="wish"),
        ],
        key=lambda event: event[0],
    )
    assert [
        Incident("after T01", "pause of 5 s", "the participant asked for it (wish)")
    ] == happened(*events)


def test_every_pause_has_its_own_length_and_reason() -> None:
    assert ["pause of 1 s", "pause of 2 s"] == [
        one.what
        for one in happened(
            (21, "pause_start", {}),
            (22, "pause_end", {}),
            (25, "pause_start", {}),
            (27, "pause_end", {}),
        )
    ]


def test_what_is_flagged_within_a_trial_stands_in_its_row_alone() -> None:
    assert [Incident("after T01", "moment flagged", "a device did not work (device)")] == happened(
        asked(12, "flag"),
        asked(13, "reason", code="unwell"),
        asked(25, "flag"),
        asked(26, "reason", code="device"),
    )


def test_notes_are_not_repeated_as_they_may_name_somebody() -> None:
    assert [] == happened(asked(25, "note", "Mrs Example felt cold"))


@pytest.mark.parametrize(
    ("status", "what"), [("aborted", "part 1 ended early"), ("crashed", "part 1 broke off")]
)
def test_a_part_that_ended_before_its_end_says_where_and_why(status: str, what: str) -> None:
    assert [Incident("after T02", what, "the power went")] == happened(
        status=status, reason="the power went"
    )
