"""Record any LSL stream: EEG, skin conductance, a respiration belt, another program's markers.

Transport: `visavis.devices.drivers.lsl.inlet.LslInlet`. The stream is named for its role and has a
column per channel, by the labels of the stream's own description; its stamps stay the sender's, and
LSL's clock offsets are kept as exchanges. Text (a stream of markers) is UTF-8 in a column of bytes.
"""

import json
import re
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import ClockPair, Fault
from visavis.devices.drivers.lsl.gaze_codec import StreamInfo, parse_info, require_rate
from visavis.devices.drivers.lsl.inlet import read_offset
from visavis.devices.drivers.lsl.spec import LSL_STREAM
from visavis.devices.drivers.streaming.exchange_log import ExchangeLog
from visavis.devices.drivers.streaming.stream_device import StreamDevice
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.clock_fit import ClockFit, fit_clock
from visavis.lab.errors import DataError, ProtocolViolation
from visavis.lab.schema import Field, StreamSchema
from visavis.lab.ucum import code_of

TEXT_BYTES = 256
MAX_CHANNELS = 4096
MAX_STAMP_S = 4e9
NEVER_S = 1e6
"""Time without samples after which an irregular stream counts as lost: in effect never."""


@dataclass(frozen=True)
class StreamSample:
    """One sample: numbers (n,), or a text as bytes."""

    t_device_ns: int
    numbers: npt.NDArray[np.float64] | None
    text: bytes = b""


def schema_of(info: StreamInfo, name: str) -> StreamSchema:
    """Return the columns of a stream by its own labels and units, as far as it states them.

    A unit that UCUM does not know is named only in the description of the column.
    """
    if info.is_text:
        description = f"UTF-8, at most {TEXT_BYTES} bytes, the rest zero"
        fields = [Field("text", "u1", "", shape=(TEXT_BYTES,), description=description)]
        return StreamSchema(name, tuple(fields), info.rate_hz)
    fields = []
    column_names: set[str] = set()
    for i in range(info.n_channels):
        channel = info.channels[i] if len(info.channels) == info.n_channels else {}
        label, unit = channel.get("label", ""), channel.get("unit", "")
        plain = re.sub(r"\W+", "_", label, flags=re.ASCII).strip("_").lower() or f"channel_{i + 1}"
        while plain in column_names:
            plain += "_"
        column_names.add(plain)
        description = label if not unit else f"{label} in {unit}"
        try:
            fields.append(Field(plain, "f8", code_of(unit), description=description))
        except DataError:  # the label ends like a name with another unit
            fields.append(Field(f"{plain}_", "f8", "", description=description))
            column_names.add(f"{plain}_")
    return StreamSchema(name, tuple(fields), info.rate_hz)


class LslStream(StreamDevice[StreamSample]):
    """Follow the `Device` contract over any LSL stream; its columns are known once it is open."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        lost_after_s: float = 2.0,
        exchange_interval_s: float = 5.0,
    ) -> None:
        self._interval_ns = round(exchange_interval_s * NS_PER_S)
        self._given_lost_ns = round(lost_after_s * NS_PER_S)
        self._exchanges = ExchangeLog()
        self._jumps = 0
        self._next_exchange_ns = 0
        super().__init__(
            role,
            transport,
            clock,
            LSL_STREAM,
            StreamSchema(role, (), 0.0),
            lost_after_s=lost_after_s,
        )

    def check(self) -> tuple[Fault, ...]:
        """Return the faults of stream and clock since start."""
        faults = list(self._notes.values())
        for count, text, remedy in (
            (self._malformed, "samples could not be read", "keep the .wire log and report it"),
            (self._cut, f"texts were longer than {TEXT_BYTES} bytes and cut", "send shorter ones"),
            (self._jumps, "jumps of the sender's clock", "let nobody set its clock"),
            (self._meter.gaps, "gaps in the stream", "use a cable; close other programs"),
        ):
            if count:
                faults.append(self._warning(f"{count} {text}", remedy))
        return tuple(faults)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return LSL's clock offsets as exchanges, oldest first."""
        return tuple(self._exchanges.pairs)

    # ---- inside -----------------------------------------------------------------------------

    def _prepare(self) -> None:
        super()._prepare()
        self._exchanges.clear()

    def _connect(self, deadline_ns: int) -> None:
        info = parse_info(self._ask((b"info",), deadline_ns).frames[1])
        if info is None or not 0 < info.n_channels <= MAX_CHANNELS:
            raise ProtocolViolation(
                "the stream does not describe itself", remedy="restart the program that sends it"
            )
        require_rate(info)
        self._schema = schema_of(info, self.info.role)
        self._lost_after_ns = self._given_lost_ns if info.rate_hz else round(NEVER_S * NS_PER_S)
        self.info = replace(self.info, model=info.name or self.info.model, serial=info.source_id)
        exchange = self._ask((b"time",), deadline_ns)
        self._take_offset(exchange.frames, exchange.t_receive_ns)

    def _tick(self, now_ns: int) -> None:
        if now_ns >= self._next_exchange_ns:
            self._next_exchange_ns = now_ns + self._interval_ns
            self._transport.post((b"time",))

    def _decode(self, message: Message) -> Iterable[StreamSample]:
        frames = message.frames
        if message.t_sent_ns is not None:
            self._take_offset(frames, message.t_host_ns)
            return
        sample = None
        if len(frames) == 2:
            is_text = self._schema.fields[0].name == "text" and self._schema.fields[0].shape
            sample = self._of_text(frames[1]) if is_text else self._of(frames[1])
        if sample is None:
            self._malformed += 1
        else:
            yield sample

    def _of(self, raw: bytes) -> StreamSample | None:
        if len(raw) != 8 * (1 + len(self._schema.fields)):
            return None
        numbers = np.frombuffer(raw, "<f8")
        if not abs(numbers[0]) < MAX_STAMP_S:
            return None
        return StreamSample(round(float(numbers[0]) * NS_PER_S), numbers[1:])

    def _of_text(self, raw: bytes) -> StreamSample | None:
        if len(raw) < 8:
            return None
        (stamp_s,) = struct.unpack_from("<d", raw)
        try:
            texts = json.loads(raw[8:])
        except ValueError:
            return None
        if not abs(stamp_s) < MAX_STAMP_S or not isinstance(texts, list):
            return None
        return StreamSample(round(stamp_s * NS_PER_S), None, "\t".join(map(str, texts)).encode())

    def _number(self, sample: StreamSample) -> int:
        self._seq += 1
        return self._seq

    def _values(self, samples: Sequence[StreamSample]) -> npt.NDArray[np.void]:
        numbers = [sample.numbers for sample in samples if sample.numbers is not None]
        if len(numbers) == len(samples):  # the columns are doubles, side by side
            return np.array(numbers).view(self._schema.dtype).reshape(len(numbers))
        values = np.zeros(len(samples), self._schema.dtype)
        for row, sample in zip(values, samples, strict=True):
            self._cut += len(sample.text) > TEXT_BYTES
            text_bytes = np.frombuffer(sample.text[:TEXT_BYTES], np.uint8)
            row["text"][: text_bytes.size] = text_bytes
        return values

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._seq = -1
        self._cut = self._jumps = 0
        self._next_exchange_ns = now_ns

    def _clock_fit(self) -> ClockFit | None:
        pairs = self._exchanges.recent
        return fit_clock(pairs) if pairs else super()._clock_fit()

    def _take_offset(self, frames: Sequence[bytes], t_host_ns: int) -> None:
        pair = read_offset(frames, t_host_ns)
        if pair is None:
            self._malformed += 1
        elif self._exchanges.add(pair) is not None:
            self._jumps += 1
