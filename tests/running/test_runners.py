"""Jobs in processes of their own: what ends the processes is told as what it was."""

import os
import signal
import sys

import pytest

from visavis.lab.errors import UsageError
from visavis.running.sessions.runners import on_this_machine

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


def _ended_by(number: int) -> None:
    os.kill(os.getpid(), number)


def test_processes_asked_to_end_make_an_interruption_and_no_defect() -> None:
    with pytest.raises(KeyboardInterrupt):
        list(on_this_machine(_ended_by, [int(signal.SIGTERM)] * 2, 2))


def test_a_process_killed_from_outside_is_told_with_what_to_do() -> None:
    with pytest.raises(UsageError, match=r"killed from outside.*smaller --processes"):
        list(on_this_machine(_ended_by, [int(signal.SIGKILL)] * 2, 2))
