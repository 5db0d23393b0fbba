"""Carry one LSL stream: samples with their raw stamps, clock offsets from a thread of its own.

`time_correction` can block for a second, so it never runs in the thread that polls. No
post-processing flag is set: stamps stay the sender's.
"""

import ctypes
import json
import struct
import threading
from collections import deque
from collections.abc import Sequence
from typing import Any

from visavis.devices.contracts import ClockPair
from visavis.devices.drivers.lsl.outlet import lsl_library
from visavis.devices.one_of_a_kind import the_only
from visavis.devices.transports import Exchange, Frames, Message, OnlyListening
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceTimeout

OFFSET = struct.Struct("<dd")
"""Seconds: local minus remote clock, and the round trip it was measured with."""

MAX_OFFSET_S = 4e9
MAX_SAMPLES = 1024
MANY = 32
LOOK_FOR_OTHERS_S = 1.0
"""How long other streams that fit are waited for; on one network they answer within half of it."""


def read_offset(frames: Sequence[bytes], t_host_ns: int) -> ClockPair | None:
    """Return a measured clock offset as the exchange it came from; None when malformed."""
    if len(frames) != 2 or len(frames[1]) != OFFSET.size:
        return None
    offset_s, round_trip_s = OFFSET.unpack(frames[1])
    if not (abs(offset_s) < MAX_OFFSET_S and 0 <= round_trip_s < MAX_OFFSET_S):
        return None
    round_trip_ns = round(round_trip_s * NS_PER_S)
    device_ns = t_host_ns - round_trip_ns // 2 - round(offset_s * NS_PER_S)
    return ClockPair(t_host_ns - round_trip_ns, device_ns, t_host_ns)


class LslInlet(OnlyListening):
    """Find the only stream of a name, type and source (empty: any) and read it.

    `configuration` is liblsl's. It sets the session and the reach on the network, and only the
    first user of LSL in this process can set it. Use that of the study's outlets.
    """

    is_simulated = False

    def __init__(
        self,
        clock: Clock,
        *,
        name: str = "",
        content_type: str = "Gaze",
        source_id: str = "",
        configuration: str = "",
    ) -> None:
        self._clock = clock
        self._configuration = configuration
        criteria = {"name": name, "type": content_type, "source_id": source_id}
        self._predicate = " and ".join(f"{k}='{_plain(v)}'" for k, v in criteria.items() if v)
        self._content_type = content_type
        self._opened: tuple[str, ...] | None = None
        self._lsl: Any = None
        self._inlet: Any = None
        self._info = b""
        self._answers: deque[Message] = deque()
        self._offset_request = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def kind(self) -> str:
        """Name the stream that is searched for."""
        return f"lsl {self._predicate}"

    def open(self, deadline_s: float) -> None:
        """Resolve the stream and subscribe to it."""
        self.close()
        pylsl = self._lsl = lsl_library()
        if self._configuration:
            pylsl.set_config_content(self._configuration)
            self._configuration = ""
        stream = self._resolved(pylsl, max(0.1, deadline_s * 0.5))
        inlet = pylsl.StreamInlet(stream, max_buflen=60, recover=True)
        try:
            inlet.open_stream(timeout=max(0.1, deadline_s * 0.5))
            self._info = inlet.info(timeout=1.0).as_xml().encode()
        except (pylsl.TimeoutError, pylsl.LostError) as cause:
            inlet.close_stream()
            raise DeviceTimeout(f"the stream {stream.name()!r} does not open") from cause
        self._inlet = inlet
        self._opened = _source_of(stream)
        self._answers.clear()
        self._stopping.clear()
        self._offset_request.clear()
        self._thread = threading.Thread(target=self._measure, name="lsl-offset", daemon=True)
        self._thread.start()

    def _resolved(self, pylsl: Any, within_s: float) -> Any:
        """Return the only stream that fits, or the one that was open before.

        Streams of one source are one: LSL itself goes on with the other when one ends.
        """
        predicate = self._predicate or "true()"
        streams = pylsl.resolve_bypred(predicate, MANY, min(within_s, LOOK_FOR_OTHERS_S))
        if not streams:
            streams = pylsl.resolve_bypred(predicate, 1, within_s)
        by_source = {_source_of(s): s for s in streams}
        if not by_source:
            raise DeviceTimeout(f"no stream with {self._predicate} was found on the network")
        if self._opened in by_source:
            return by_source[self._opened]
        return the_only(
            list(by_source.values()),
            lambda s: f"{s.name()!r} of {s.hostname()} (source_id {s.source_id() or 'none'})",
            f"LSL streams of type {self._content_type or 'any'}",
            "give stream_name or source_id in lab_config.yaml, or end the other program",
        )

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Give the stream's XML, or measure the clock offset now."""
        sent_ns = self._clock.now_ns()
        if frames[0] == b"info":
            return Exchange((b"info", self._info), sent_ns, self._clock.now_ns())
        measurement = self._offset(timeout_s)
        if measurement is None:
            raise DeviceTimeout(f"no clock offset within {timeout_s:g} s")
        return Exchange((b"time", OFFSET.pack(*measurement)), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Ask the measuring thread for an offset."""
        self._offset_request.set()

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return waiting samples, each stamped when it is pulled."""
        if self._inlet is None:
            raise DeviceDisconnected("the stream is not open")
        messages: list[Message] = []
        wait_s = max(0.0, timeout_s)
        try:
            while len(messages) < MAX_SAMPLES:
                values, stamp_s = self._inlet.pull_sample(timeout=wait_s)
                if stamp_s is None:
                    break
                now_ns = self._clock.now_ns()
                if values and isinstance(values[0], str):
                    text = struct.pack("<d", stamp_s) + json.dumps(values).encode()
                    messages.append(Message(now_ns, (b"text", text)))
                else:
                    raw = struct.pack(f"<{len(values) + 1}d", stamp_s, *map(float, values))
                    messages.append(Message(now_ns, (b"sample", raw)))
                wait_s = 0.0
        except self._lsl.LostError as cause:
            raise DeviceDisconnected("the stream's sender is gone") from cause
        while self._answers:
            messages.append(self._answers.popleft())
        messages.sort(key=lambda message: message.t_host_ns)
        return messages

    def close(self) -> None:
        """Close the stream and end the thread; idempotent."""
        self._stopping.set()
        self._offset_request.set()
        if self._thread is not None:
            self._thread.join(3.0)
            self._thread = None
        if self._inlet is not None:
            self._inlet.close_stream()
            self._inlet = None

    def _measure(self) -> None:
        while True:
            self._offset_request.wait()
            if self._stopping.is_set():
                return
            self._offset_request.clear()
            sent_ns = self._clock.now_ns()
            measurement = self._offset(2.0)
            if measurement is not None:
                frames = (b"time", OFFSET.pack(*measurement))
                self._answers.append(Message(self._clock.now_ns(), frames, sent_ns))

    def _offset(self, timeout_s: float) -> tuple[float, float] | None:
        """Return local − remote clock and the round trip, seconds."""
        measure = self._lsl.util.lib.lsl_time_correction_ex
        measure.restype = ctypes.c_double
        remote, spread, code = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
        offset_s = measure(
            self._inlet.obj,
            ctypes.byref(remote),
            ctypes.byref(spread),
            ctypes.c_double(timeout_s),
            ctypes.byref(code),
        )
        return None if code.value else (float(offset_s), float(spread.value))


def _source_of(stream: Any) -> tuple[str, ...]:
    """Return what tells a stream's source from others; LSL recovers one that has a source_id."""
    if stream.source_id():
        return stream.source_id(), stream.name(), stream.hostname()
    return (stream.uid(),)


def _plain(text: str) -> str:
    return text.replace("'", "")
