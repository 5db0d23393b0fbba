"""Jobs in processes of their own: what ends the processes is told as what it was."""

import os
import signal
import sys

import pytest

from visavis.lab.errors import UsageError
from visavis.lab.processes import begin_worker
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


def test_a_process_begins_though_its_module_cannot_be_imported_so_that_the_job_says_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    handlers: list[object] = []
    monkeypatch.setattr(signal, "signal", lambda number, handler: handlers.append(handler))
    begin_worker("a_module_that_nobody_has")
    assert [signal.SIG_IGN] == handlers
