"""What one answer to many body samples asks of the bands."""

from typing import Any

from visavis.protocol.plan.steps import Play, Silence
from visavis.protocol.session.frame_loop import without_ended_steps

PATTERN: Any = None  # not looked at here


def play(role: str) -> Play:
    return Play(role, PATTERN, (0,))


def test_no_motor_is_started_for_a_contact_that_is_over() -> None:
    stop = Silence("left")
    assert [stop] == without_ended_steps([play("left"), stop])
    assert [Silence("")] == without_ended_steps([play("left"), play("right"), Silence("")])


def test_a_contact_that_lasts_and_other_bands_are_answered() -> None:
    steps = [play("right"), Silence("left"), play("left")]
    assert steps == without_ended_steps(steps)
    assert [play("right"), Silence("left")] == without_ended_steps(
        [play("left"), play("right"), Silence("left")]
    )
