"""Work that a trial has done beside its frames: in a process of its own where time is real.

On a virtual clock the same work is done at once, so that a seed repeats a session bit for bit.
"""

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class AtOnce(Executor):
    """Perform work when it is submitted; an error comes out with the result."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return a future that is done."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Beside(Executor):
    """Executor of a session's work beside its frames: at once, or in a process while one runs.

    In a process, functions and what they are given have to be picklable: functions of a module.
    """

    def __init__(self) -> None:
        self._performer: Executor = AtOnce()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit work and return; without a process the work is done first."""
        return self._performer.submit(fn, *args, **kwargs)

    @contextmanager
    def in_process(self) -> Iterator[None]:
        """Work in a process until the block is left; it is started with the first work."""
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
