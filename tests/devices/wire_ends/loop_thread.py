"""An event loop on a thread of its own, for a peer that serves until it is closed."""

import asyncio
import threading
from abc import abstractmethod

from visavis.lab.closing import Closing


class LoopThread(Closing):
    """Run `_serve` on a loop of its own until closed; a context manager.

    A subclass calls `_begin` at the end of its `__init__`; its `_serve` sets `_ready` when it can
    be used and returns soon after `_stop` is set. What stops the thread is raised again by `close`.
    """

    def __init__(self) -> None:
        self._failure: BaseException | None = None
        self._ready = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()

    def close(self) -> None:
        """Stop serving; re-raises what stopped the thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        self._loop.close()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    @abstractmethod
    async def _serve(self) -> None: ...

    def _begin(self, name: str, within_s: float) -> None:
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()
        if not self._ready.wait(within_s) or self._failure is not None:
            raise RuntimeError(f"the {name} did not start") from self._failure

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as failure:  # a thread top: close() hands it on
            self._failure = failure
            self._ready.set()
