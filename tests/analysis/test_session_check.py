"""What check says of a session can be acted on: numbers are told, not replaced by dots."""

import pytest

from analysis.session_check import in_one


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
