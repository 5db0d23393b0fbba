"""A gaze stream on a real LSL outlet, pushed from the simulator in a thread."""

import struct
import threading
from typing import Any
from xml.etree.ElementTree import Element

from visavis.devices.sim.lsl.gaze import LslGazeSimulator
from visavis.lab.clock import NS_PER_MS, Clock


class LslOutletHost:
    """Push a simulator's samples through a real outlet, in a thread; a context manager."""

    def __init__(self, simulator: LslGazeSimulator, clock: Clock, name: str) -> None:
        import pylsl

        self._simulator = simulator
        self._clock = clock
        count, rate_hz = simulator.channel_count(), simulator.source.rate_hz
        info = pylsl.StreamInfo(name, "Gaze", count, rate_hz, pylsl.cf_double64, name)
        copy_description(simulator.desc(), info.desc())
        self._outlet: Any = pylsl.StreamOutlet(info, chunk_size=1)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="lsl-host", daemon=True)

    def __enter__(self) -> "LslOutletHost":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stopping.set()
        self._thread.join()
        self._outlet = None

    def _serve(self) -> None:
        while not self._stopping.is_set():
            now_ns = self._clock.now_ns()
            self._simulator.advance(now_ns)
            for message in self._simulator.outgoing(now_ns):
                raw = message.frames[1]
                stamp_s, *values = struct.unpack(f"<{len(raw) // 8}d", raw)
                self._outlet.push_sample(values, stamp_s)
            self._clock.sleep_until_ns(now_ns + NS_PER_MS)


def copy_description(source: Element, target: Any) -> None:
    """Write a description into the library's own kind of element."""
    for child in source:
        if len(child):
            copy_description(child, target.append_child(child.tag))
        else:
            target.append_child_value(child.tag, child.text or "")
