"""Leave every armband silent, however a session ends: normally, by error, signal or standstill.

Layers, from the inside out: a command's own time to live; the driver, which stops refreshing
when the experiment loop is not heard of; the guard here, which silences on leaving its `with`
block, at interpreter exit, on signals and on a standstill; the band's own dead man, which acts
when the whole computer is gone.
"""

import atexit
import os
import signal
import threading
from collections.abc import Callable, Iterable, Mapping
from types import FrameType
from typing import Any, Protocol

from visavis.lab.clock import NS_PER_MS, Clock

STANDSTILL_MS = 150
LOOK_EVERY_S = 0.02

SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK", "SIGQUIT")
    if hasattr(signal, name)
)
"""Signals that may end a session from outside, as far as this system has them."""


class Silenceable(Protocol):
    """What the guard needs of an armband."""

    def keep_alive(self) -> None:
        """Receive the sign that the experiment loop runs."""
        ...

    def silence(self) -> int:
        """Stop every motor now."""
        ...


class HapticGuard:
    """Watch over armbands by role; a context manager.

    Call `tick` once per frame of the experiment loop. On a real clock a thread looks every 20 ms
    and silences all bands once `standstill_ms` went by without a tick; on a virtual clock, whose
    time stands still with the loop, call `look`. With `handle_signals` (main thread only) the
    previous handlers run after silence, or the signal has its usual effect.
    """

    def __init__(
        self,
        bands: Mapping[str, Silenceable],
        clock: Clock,
        *,
        standstill_ms: float = STANDSTILL_MS,
        handle_signals: bool = True,
    ) -> None:
        self._bands = dict(bands)
        self._clock = clock
        self._standstill_ns = round(standstill_ms * NS_PER_MS)
        self._handles_signals = handle_signals
        self._ticked_ns = clock.now_ns()
        self._is_silenced = False
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._former: dict[int, Any] = {}
        self.standstills = 0

    def __enter__(self) -> "HapticGuard":
        self._leaving.clear()
        self._ticked_ns = self._clock.now_ns()
        atexit.register(self.silence)
        if self._handles_signals and threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                former = signal.getsignal(number)
                if former is not None and former is not signal.SIG_IGN:
                    self._former[number] = former
                    signal.signal(number, self._on_signal)
        if not self._clock.is_virtual:
            self._thread = threading.Thread(target=self._watch, name="haptic-guard", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def tick(self) -> None:
        """Report one more round of the experiment loop."""
        self._ticked_ns = self._clock.now_ns()
        self._is_silenced = False
        for band in self._bands.values():
            band.keep_alive()

    def look(self) -> bool:
        """Silence all bands if the loop stands still; tell whether it does."""
        stands = self._clock.now_ns() - self._ticked_ns > self._standstill_ns
        if stands and not self._is_silenced:
            self._is_silenced = True
            self.standstills += 1
            self.silence()
        return stands

    def silence(self) -> None:
        """Stop every motor of every band, whatever else fails; never raises."""
        silence_all(self._bands.values())

    def close(self) -> None:
        """Silence, stop watching and put the signal handlers back; idempotent."""
        self.silence()
        self._leaving.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        for number, former in self._former.items():
            if signal.getsignal(number) == self._on_signal:
                signal.signal(number, former)
        self._former = {}
        atexit.unregister(self.silence)

    def _watch(self) -> None:
        while not self._leaving.wait(LOOK_EVERY_S):
            self.look()

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.silence()
        former: Callable[[int, FrameType | None], Any] | int = self._former[number]
        if callable(former):
            former(number, frame)
            return
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)


def silence_all(bands: Iterable[Silenceable]) -> None:
    """Silence one band after the other; the failure of one does not stop the rest."""
    for band in bands:
        try:
            band.silence()
        except Exception:  # noqa: S112 - on the way out; the band's own dead man remains
            continue
