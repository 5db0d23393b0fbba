"""Background work of a trial, so that slow functions delay no frame.

In real time it runs in a process of its own. On a virtual clock it runs inline, when it is
submitted, so that a seed reproduces a session bit for bit.
"""

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class InlineExecutor(Executor):
    """Runs each call when it is submitted. An error is raised when the result is read."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return a future that is done."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class BackgroundExecutor(Executor):
    """Executor of background work: in a process while `in_process` is open, else inline.

    For a process, functions and their arguments must be picklable: functions of a module.
    """

    def __init__(self) -> None:
        self._performer: Executor = InlineExecutor()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit work and return; without a process the call runs before this returns."""
        return self._performer.submit(fn, *args, **kwargs)

    @contextmanager
    def in_process(self) -> Iterator[None]:
        """Run work in a process until the block ends; the process starts with the first call."""
        before = self._performer
        with ProcessPoolExecutor(1, get_context("spawn"), _leave_interrupts) as performer:
            self._performer = performer
            try:
                yield
            finally:
                self._performer = before
                performer.shutdown(wait=True, cancel_futures=True)


def _leave_interrupts(*_: Any) -> None:
    # Ctrl-C reaches the whole terminal; only the session handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
