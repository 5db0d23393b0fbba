"""What check says of a session can be acted on: numbers are told, not replaced by dots."""

import pytest

from visavis.analysis.session_check import drift_words, in_one, stream_findings
from visavis.analysis.session_verdict import Level, StreamCheck


@pytest.mark.parametrize(
    ("expected", "messages"),
    [
        ("no data for 120 ms", ["no data for 120 ms"]),
        ("silent for 9 to 120 ms", ["silent for 20 ms", "silent for 120 ms", "silent for 9 ms"]),
        ("7 dropped of 10 to 12.5", ["7 dropped of 12.5", "7 dropped of 10"]),
        ("the left eye is not seen", ["the left eye is not seen"] * 3),
    ],
)
def test_messages_that_differ_in_numbers_are_told_with_their_range(
    expected: str, messages: list[str]
) -> None:
    assert expected == in_one(messages)


def test_streams_that_lack_the_same_are_told_once() -> None:
    few = [
        StreamCheck(name, 940, 1000, 84.6, 111.2, Level.AMBER)
        for name in ("head", "frame_timing", "frames")
    ]
    gaze = StreamCheck("gaze", 700, 1000, 84.0, 320.0, Level.RED)
    whole = StreamCheck("responses", 0, None, None, None, Level.GREEN)

    assert [
        ("head", "94 % of the expected samples, longest gap 111 ms; so frame_timing, frames"),
        ("gaze", "70 % of the expected samples, longest gap 320 ms"),
    ] == [(f.subject, f.message) for f in stream_findings([*few, gaze, whole])]


@pytest.mark.parametrize(
    ("expected", "start_deg", "end_deg"),
    [
        (", 0.22° better than before the last block", 1.02, 0.80),
        (", 0.50° worse than before the last block", 0.5, 1.0),
        (", as before the last block", 0.8, 0.801),
        ("", None, 0.8),
    ],
)
def test_a_change_of_accuracy_is_told_without_a_sign_to_interpret(
    expected: str, start_deg: float | None, end_deg: float
) -> None:
    assert expected == drift_words(start_deg, end_deg)
