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
            command, completion = self._mailbox.popleft()
            try:
                command()
            except DeviceError as problem:
                completion.set_exception(problem)
            else:
                completion.set_result(None)

    def later(self, command: Callable[[], None], failed: Callable[[DeviceError], None]) -> None:
        """Run a command in the thread that polls without waiting; `failed` gets its error."""

        def attempt() -> None:
            try:
                command()
            except DeviceError as problem:
                failed(problem)

        if self.is_elsewhere:
            self._mailbox.append((attempt, Future()))
        else:
            attempt()

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
        completion: Future[None] = Future()
        self._mailbox.append((command, completion))
        try:
            completion.result(timeout=self._timeout_s)
        except NoAnswerInTime as cause:
            raise DeviceTimeout(
                "the device thread did not take a command", role=self._role, remedy=self._remedy
            ) from cause
