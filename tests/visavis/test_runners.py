"""What ends a process that works beside this one is told, with what to do next."""

import os

import pytest

from lab.errors import UsageError
from visavis.sessions.runners import on_this_machine


def ends_at_one(number: int) -> int:
    if number == 1:
        os._exit(9)
    return number


def test_a_process_ended_from_outside_is_no_internal_error() -> None:
    with pytest.raises(UsageError, match=r"memory.*--processes 1"):
        list(on_this_machine(ends_at_one, [0, 1], 2))
