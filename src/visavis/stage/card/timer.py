"""How long the card works on each frame, by the card's own timers, without waiting for them."""

import ctypes
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from visavis.lab.clock import NS_PER_MS
from visavis.lab.frame import FrameInfo
from visavis.stage.card.gl_calls import GlCalls

MAX_OPEN = 8
"""Frames whose time may be outstanding; a card is one to three frames behind."""
GL_TIME_ELAPSED, GL_QUERY_COUNTER_BITS = 0x88BF, 0x8864
GL_QUERY_RESULT, GL_QUERY_RESULT_AVAILABLE = 0x8866, 0x8867


class CardTimer:
    """Time the card's own work on frames, in the context that draws them.

    The card is never waited for: what it has not told when `MAX_OPEN` frames have gone by is
    missing, as is everything from a driver without timers, and a time of zero, which is none.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._calls = GlCalls(context)
        bits = ctypes.c_int(0)
        self._calls.query("glGetQueryiv", GL_TIME_ELAPSED, GL_QUERY_COUNTER_BITS, bits)
        names = (ctypes.c_uint * MAX_OPEN)()
        if bits.value:
            self._calls.query("glGenQueries", MAX_OPEN, names)
        self._free = [int(name) for name in names if name]
        self._open: deque[tuple[FrameInfo, int]] = deque()

    @contextmanager
    def time_frame(self, frame: FrameInfo) -> Iterator[None]:
        """Time the drawing in this block as the frame's work."""
        if not self._free:
            yield
            return
        name = self._free.pop()
        self._calls.query("glBeginQuery", GL_TIME_ELAPSED, name)
        try:
            yield
        finally:
            self._calls.query("glEndQuery", GL_TIME_ELAPSED)
            self._open.append((frame, name))

    def results(self) -> list[tuple[FrameInfo, float]]:
        """Return the frames whose time has come in since the last call, each with its time (ms)."""
        results = []
        while self._open:
            frame, name = self._open[0]
            is_available, elapsed_ns = ctypes.c_uint(0), ctypes.c_uint64(0)
            self._calls.query("glGetQueryObjectuiv", name, GL_QUERY_RESULT_AVAILABLE, is_available)
            if not is_available.value and self._free:
                break
            self._open.popleft()
            self._free.append(name)
            if is_available.value:
                self._calls.query("glGetQueryObjectui64v", name, GL_QUERY_RESULT, elapsed_ns)
            if elapsed_ns.value:
                results.append((frame, elapsed_ns.value / NS_PER_MS))
        return results

    def release(self) -> None:
        """Free the card's timers."""
        names = [*self._free, *(name for _, name in self._open)]
        self._calls.query("glDeleteQueries", len(names), (ctypes.c_uint * len(names))(*names))
        self._free.clear()
        self._open.clear()
