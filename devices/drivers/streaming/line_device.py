"""Record any device that sends one sample per line of text, on a serial port or another byte link.

A driver states its columns, what to write when it is opened and how a line is read. The stream is
named after the role, so that one recording can hold two such devices.
"""

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import Fault
from visavis.devices.drivers.streaming.message_device import UNREADABLE
from visavis.devices.drivers.streaming.stream_device import StreamDevice
from visavis.devices.spec import AnySpec
from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceTimeout
from visavis.lab.schema import Field, StreamSchema

MAX_LINE = 4096
MAX_STAMP_NS = 2**62
LOST_PERIODS = 5
"""A device counts as lost when this many samples in a row are missing, even a slow one."""


class Line(NamedTuple):
    """One sample: the device's own time (None if it sends none), a number per column.

    NaN means unknown; do not pass on a zero that the device writes for it.
    """

    t_device_ns: int | None
    numbers: Sequence[float]


class _Sample(NamedTuple):
    seq: int
    t_device_ns: int
    numbers: Sequence[float]


class LineDevice(StreamDevice[_Sample]):
    """Follow the `Device` contract; a subclass sets what is named here and adds `read`.

    `columns` are scalars, `rate_hz` is 0 for a device that speaks when something happens. Lines
    that cannot be read leave a hole in `seq`. Without a time of the device's own, `t_device_ns` is
    the arrival.
    """

    spec: ClassVar[AnySpec]
    columns: ClassVar[tuple[Field, ...]]
    rate_hz: ClassVar[float] = 0.0
    hello: ClassVar[bytes] = b""
    """Written when the device is opened, for one that has to be started."""

    def __init__(
        self, role: str, link: ByteLink, clock: Clock, *, lost_after_s: float = 2.0
    ) -> None:
        schema = StreamSchema(role, self.columns, self.rate_hz)
        lost_s = max(lost_after_s, LOST_PERIODS / self.rate_hz) if self.rate_hz else math.inf
        self._rest = b""
        self._seq = -1
        super().__init__(
            role, LinkMessages(link), clock, self.spec, schema, lost_after_s=min(lost_s, 1e6)
        )

    @abstractmethod
    def read(self, line: bytes) -> Line | None:
        """Return the sample of a line; None if it holds none. An exception marks it as damaged."""

    def check(self) -> tuple[Fault, ...]:
        """Return the faults of the lines since start."""
        faults = list(self._notes.values())
        for count, text, remedy in (
            (self._malformed, "lines could not be read", "look at the cable and the baud rate"),
            (self._meter.gaps, "gaps in the stream", "look at the device and its cable"),
            (len(self._one_way.jumps_ms), "jumps of the device's clock", "was it switched off?"),
        ):
            if count:
                faults.append(self._warning(f"{count} {text}", remedy))
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        """Wait for a first sample; do not wait for a device without a steady rate."""
        self._resume()
        if not self.rate_hz:
            return
        byte_count = 0
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            for message in self._transport.receive((deadline_ns - now_ns) / NS_PER_S):
                byte_count += len(message.frames[0])
                for line in self._lines(message.frames[0]):
                    if self._sample(line, message.t_host_ns) is not None:
                        return
        text = (
            f"{byte_count} bytes came, but no sample" if byte_count else "the device says nothing"
        )
        raise DeviceTimeout(text, remedy=self._spec.remedy)

    def _resume(self) -> None:
        self._rest = b""
        if self.hello:
            self._transport.post((self.hello,))

    def _decode(self, message: Message) -> Iterable[_Sample]:
        for line in self._lines(message.frames[0]):
            sample = self._sample(line, message.t_host_ns)
            if sample is not None:
                yield sample

    def _lines(self, data: bytes) -> list[bytes]:
        *lines, rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(rest) > MAX_LINE:
            self._malformed += 1
            rest = b""
        self._rest = rest
        return [line for line in lines if line.strip()]

    def _sample(self, line: bytes, t_host_ns: int) -> _Sample | None:
        try:
            reading = self.read(line)
            if reading is None:
                return None
            fits = _fits(self.columns, reading)
        except UNREADABLE:
            fits, reading = False, None
        self._seq += 1
        if not fits or reading is None:
            self._malformed += 1
            return None
        stamp_ns = t_host_ns if reading.t_device_ns is None else reading.t_device_ns
        return _Sample(self._seq, stamp_ns, reading.numbers)

    def _number(self, sample: _Sample) -> int:
        return sample.seq

    def _values(self, samples: Sequence[_Sample]) -> npt.NDArray[np.void]:
        rows = [tuple(sample.numbers) for sample in samples]
        values: npt.NDArray[np.void] = np.array(rows, self._schema.dtype)
        return values

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._seq = -1
        self._rest = b""


def _fits(columns: Sequence[Field], line: Line) -> bool:
    """Tell whether there is one number per column, each within the range of its type."""
    if len(line.numbers) != len(columns):
        return False
    if line.t_device_ns is not None and not abs(line.t_device_ns) < MAX_STAMP_NS:
        return False
    for column, number in zip(columns, line.numbers, strict=True):
        kind = np.dtype(column.dtype)
        if kind.kind == "f":
            if math.isfinite(number) and abs(number) > float(np.finfo(kind).max):
                return False
        elif kind.kind == "b":
            if number not in (0, 1):
                return False
        elif int(number) != number or not np.iinfo(kind).min <= number <= np.iinfo(kind).max:
            return False
    return True


class LinkMessages(NoTopics):
    """A byte link as a wire of messages, one per chunk."""

    def __init__(self, link: ByteLink) -> None:
        self._link = link

    @property
    def kind(self) -> str:
        """Name the link."""
        return self._link.kind

    @property
    def is_simulated(self) -> bool:
        """Tell whether a simulator is at the other end."""
        return self._link.is_simulated

    def open(self, deadline_s: float) -> None:
        """Open the link."""
        self._link.open(deadline_s)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Refuse: on a byte link only the codec can recognise an answer."""
        raise NotImplementedError("post, and read what comes")

    def post(self, frames: Frames) -> None:
        """Write."""
        self._link.write(b"".join(frames))

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the chunks that came."""
        return [Message(t_ns, (data,)) for t_ns, data in self._link.read(timeout_s)]

    def send(self, port: int, frames: Frames) -> None:
        """Write."""
        self.post(frames)

    def close(self) -> None:
        """Close the link."""
        self._link.close()
