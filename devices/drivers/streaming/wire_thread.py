"""Keep a wire to the thread that polls it; commands of other threads wait in a mailbox."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NoAnswerInTime

from visavis.lab.errors import DeviceError, DeviceTimeout


class WireThread:
    """The thread that owns a wire now, and the commands of other threads for it."""

    def __init__(self, role: str, *, remedy: str, timeout_s: float) -> None:
        self._role = role
        self._remedy = remedy
        self._timeout_s = timeout_s
        self._owner: int | None = None
        self._mailbox: deque[tuple[Callable[[], None], Future[None]]] = deque()

    @property
    def is_elsewhere(self) -> bool:
        """Tell whether another thread polls the wire."""
        return self._owner not in (None, threading.get_ident())

    def claim(self) -> None:
        """Take the wire for this thread and run the commands of other threads."""
        self._owner = threading.get_ident()
        while self._mailbox:
            command, done = self._mailbox.popleft()
            try:
                command()
            except DeviceError as problem:
                done.set_exception(problem)
            else:
                done.set_result(None)

    def later(self, command: Callable[[], None], failed: Callable[[DeviceError], None]) -> None:
        """Run a command in the thread that polls without waiting; `failed` gets its error."""

        def tried() -> None:
            try:
                command()
            except DeviceError as problem:
                failed(problem)

        if self.is_elsewhere:
            self._mailbox.append((tried, Future()))
        else:
            tried()

    def release(self) -> None:
        """Let any thread use the wire: nobody polls it."""
        self._owner = None

    def do(self, command: Callable[[], None]) -> None:
        """Run a command in the thread that polls, and wait for it.

        Raises DeviceTimeout when that thread does not take it, and what the command raised.
        """
        if not self.is_elsewhere:
            command()
            return
        done: Future[None] = Future()
        self._mailbox.append((command, done))
        try:
            done.result(timeout=self._timeout_s)
        except NoAnswerInTime as cause:
            raise DeviceTimeout(
                "the device thread did not take a command", role=self._role, remedy=self._remedy
            ) from cause
