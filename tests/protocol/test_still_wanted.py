"""What one answer to many body samples asks of the bands."""

from typing import Any

from visavis.protocol.plan.steps import Play, Silence
from visavis.protocol.session.frame_loop import still_wanted

PATTERN: Any = None  # not looked at here


def play(role: str) -> Play:
    return Play(role, PATTERN, (0,))


def test_no_motor_is_started_for_a_contact_that_is_over() -> None:
    stop = Silence("left")
    assert [stop] == still_wanted([play("left"), stop])
    assert [Silence("")] == still_wanted([play("left"), play("right"), Silence("")])


def test_a_contact_that_lasts_and_other_bands_are_answered() -> None:
    steps = [play("right"), Silence("left"), play("left")]
    assert steps == still_wanted(steps)
    assert [play("right"), Silence("left")] == still_wanted(
        [play("left"), play("right"), Silence("left")]
    )
