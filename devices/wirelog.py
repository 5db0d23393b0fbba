"""Write what crosses a wire to a `.wire` file, and play such a file back; messages or bytes.

The file is a sequence of msgpack values: a header map, then one list per record, appended and
flushed as it happens; a torn tail is ignored when reading. Times are session nanoseconds. For a
byte link a received record is one chunk that arrived, a sent record one write.
"""

import bisect
import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, Generic, TypeVar

import msgpack

from visavis.devices.byte_links import ByteLink, Chunk
from visavis.devices.transports import Exchange, Frames, Message, MessageTransport, OnlyListening
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DataError, DeviceNotFound, DeviceTimeout

FORMAT = "visavis-wire"
VERSION = 1

_MESSAGE, _EXCHANGE, _SENT_MESSAGE = 0, 1, 2


@dataclass(frozen=True)
class WireLog:
    """The content of a `.wire` file, times as recorded; `exchanges` pairs requests with answers.

    `note` is the writer's description, such as driver and options; empty in old files.
    """

    transport: str
    is_simulated: bool
    messages: tuple[Message, ...]
    exchanges: tuple[tuple[Frames, Exchange], ...]
    sent_messages: tuple[Message, ...]
    note: Mapping[str, Any] = field(default_factory=dict)


def read_wire_log(path: Path) -> WireLog:
    """Read a `.wire` file up to its last whole record; raises DataError when it is none."""
    messages: list[Message] = []
    exchanges: list[tuple[Frames, Exchange]] = []
    sent_messages: list[Message] = []
    with path.open("rb") as file:
        records = msgpack.Unpacker(file, use_list=False)
        try:
            header = next(records)
        except (StopIteration, ValueError, msgpack.UnpackException) as cause:
            raise DataError(
                f"{path} is not a wire log: it is empty or cut in its header"
            ) from cause
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            raise DataError(f"{path} is not a wire log: its header does not say {FORMAT!r}")
        if not isinstance(header.get("note", {}), dict):
            raise DataError(f"{path} is not a wire log: the note in its header is damaged")
        if header.get("version") != VERSION:
            raise DataError(
                f"{path}: wire log version {header.get('version')!r}; this program reads "
                f"{VERSION}: update Visavis"
            )
        for number, record in enumerate(_whole(records, path), start=1):
            try:
                kind, *fields = record
                if kind == _MESSAGE:
                    t_host_ns, t_sent_ns, frames = fields
                    messages.append(Message(t_host_ns, frames, t_sent_ns))
                elif kind == _EXCHANGE:
                    send_ns, receive_ns, request, answer = fields
                    exchanges.append((request, Exchange(answer, send_ns, receive_ns)))
                elif kind == _SENT_MESSAGE:
                    t_host_ns, frames = fields
                    sent_messages.append(Message(t_host_ns, frames))
            except (TypeError, ValueError) as cause:
                raise DataError(f"{path}: record {number} is not a wire log record") from cause
    return WireLog(
        str(header.get("transport", "")),
        bool(header.get("is_simulated", False)),
        tuple(messages),
        tuple(exchanges),
        tuple(sent_messages),
        dict(header.get("note", {})),
    )


def _whole(records: msgpack.Unpacker, path: Path) -> Iterator[Any]:
    """Yield every whole record; a torn last one ends them.

    Raises:
        DataError: the content is not msgpack.
    """
    try:
        yield from records
    except msgpack.OutOfData:
        return
    except (ValueError, msgpack.UnpackException) as cause:
        raise DataError(f"{path}: a record is damaged ({cause}); restore the file") from cause


W = TypeVar("W", MessageTransport, ByteLink)


class _Tee(Generic[W]):
    """A wire around another that also writes a file."""

    def __init__(
        self,
        inner: W,
        path: Path,
        clock: Clock,
        note: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self._inner: W = inner
        self._path = path
        self._note = note
        self._clock = clock
        self._file: BinaryIO | None = None
        self._packer = msgpack.Packer()

    @property
    def kind(self) -> str:
        """Name the wire itself."""
        return self._inner.kind

    @property
    def is_simulated(self) -> bool:
        """Return the answer of the wire."""
        return self._inner.is_simulated

    def open(self, deadline_s: float) -> None:
        """Open the wire; the log is appended to when it exists."""
        self._inner.open(deadline_s)
        if self._file is None:
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
            # personal data: readable by this account only
            self._file = os.fdopen(os.open(self._path, flags, 0o600), "ab", buffering=0)
            if self._file.tell() == 0:
                self._write(
                    {
                        "format": FORMAT,
                        "version": VERSION,
                        "transport": self._inner.kind,
                        "is_simulated": self._inner.is_simulated,
                        "note": dict(self._note),
                    }
                )

    def end(self) -> None:
        """Close the log; idempotent."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, *records: Any) -> None:
        if records and self._file is not None:
            self._file.write(b"".join(self._packer.pack(record) for record in records))


class TeeTransport(_Tee[MessageTransport]):
    """Pass everything through to another transport and write it down with its times."""

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Pass on; an unanswered request is logged as sent."""
        try:
            exchange = self._inner.request(frames, timeout_s)
        except DeviceTimeout:
            self._write((_SENT_MESSAGE, self._clock.now_ns(), frames))
            raise
        record = (_EXCHANGE, exchange.t_send_ns, exchange.t_receive_ns, frames, exchange.frames)
        self._write(record)
        return exchange

    def post(self, frames: Frames) -> None:
        """Pass on and log as sent; the answer is logged when it is received."""
        self._write((_SENT_MESSAGE, self._clock.now_ns(), frames))
        self._inner.post(frames)

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Pass on."""
        self._inner.subscribe(port, topics)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Pass on and log every message."""
        messages = self._inner.receive(timeout_s)
        self._write(*((_MESSAGE, m.t_host_ns, m.t_sent_ns, m.frames) for m in messages))
        return messages

    def send(self, port: int, frames: Frames) -> None:
        """Pass on and log as sent."""
        self._write((_SENT_MESSAGE, self._clock.now_ns(), frames))
        self._inner.send(port, frames)

    def close(self) -> None:
        """Close the wire and the log; idempotent."""
        self._inner.close()
        self.end()


class TeeLink(_Tee[ByteLink]):
    """Pass everything through to another link and write it down with its times.

    The log stays open for the next connection until `end`.
    """

    def write(self, data: bytes) -> int:
        """Pass on and log."""
        self._write((_SENT_MESSAGE, self._clock.now_ns(), (data,)))
        return self._inner.write(data)

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Pass on and log every chunk."""
        chunks = self._inner.read(timeout_s)
        self._write(*((_MESSAGE, c.t_host_ns, None, (c.data,)) for c in chunks))
        return chunks

    def close(self) -> None:
        """Close the link, not the log."""
        self._inner.close()


T = TypeVar("T")


class _Replay:
    """A `.wire` file that is played from its start whenever it is opened."""

    kind = "replay"
    is_simulated = True
    begins_when_asked = False
    """Whether the first sent record also sets the beginning of the file."""

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path = path
        self._clock = clock
        self._shift_ns = 0

    def _log(self) -> WireLog:
        """Read the file, and store the shift of its times that lets it begin now."""
        try:
            log = read_wire_log(self._path)
        except OSError as cause:
            raise DeviceNotFound(
                f"cannot read {self._path}: {cause.strerror}", remedy="check the path"
            ) from cause
        first_messages = log.messages + (log.sent_messages[:1] if self.begins_when_asked else ())
        starts = [e.t_send_ns for _, e in log.exchanges] + [m.t_host_ns for m in first_messages]
        self._shift_ns = self._clock.now_ns() - min(starts, default=0)
        return log

    def _wait_for(self, due: Callable[[], list[T]], timeout_s: float) -> list[T]:
        """Return the items that are due; wait for them for at most `timeout_s`."""
        items = due()
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while not items and (now_ns := self._clock.now_ns()) < deadline_ns:
            self._clock.sleep_until_ns(min(now_ns + NS_PER_MS, deadline_ns))
            items = due()
        return items


class ReplayTransport(_Replay, OnlyListening):
    """Play a `.wire` file through the driver that wrote it, moved to begin when opened.

    Requests get the recorded answers to the same first frame in order, then the last one again and
    again; a request without an answer times out. Messages keep their spacing.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        super().__init__(path, clock)
        self._messages: deque[Message] = deque()
        self._answers: dict[bytes, deque[Exchange]] = {}

    def open(self, deadline_s: float) -> None:
        """Read the file."""
        log = self._log()
        self._messages = deque(log.messages)
        self._answers = {}
        for request, exchange in log.exchanges:
            self._answers.setdefault(request[0], deque()).append(exchange)

    @property
    def is_finished(self) -> bool:
        """Tell whether every message was delivered."""
        return not self._messages

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Answer as recorded, with the recorded times moved."""
        answers = self._answers.get(frames[0])
        if not answers:
            raise DeviceTimeout(f"{self._path} holds no answer to {frames[0][:40]!r}")
        exchange = answers.popleft() if len(answers) > 1 else answers[0]
        shift_ns = self._shift_ns
        return Exchange(
            exchange.frames, exchange.t_send_ns + shift_ns, exchange.t_receive_ns + shift_ns
        )

    def post(self, frames: Frames) -> None:
        """Do nothing: recorded answers come by themselves."""

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the messages whose moved time has come."""
        return self._wait_for(self._due, timeout_s)

    def close(self) -> None:
        """Forget the file; idempotent."""
        self._messages.clear()
        self._answers = {}

    def _due(self) -> list[Message]:
        shift_ns, until_ns = self._shift_ns, self._clock.now_ns() - self._shift_ns
        due = []
        while self._messages and self._messages[0].t_host_ns <= until_ns:
            m = self._messages.popleft()
            sent_ns = None if m.t_sent_ns is None else m.t_sent_ns + shift_ns
            due.append(Message(m.t_host_ns + shift_ns, m.frames, sent_ns))
        return due


class ReplayLink(_Replay):
    """Play a `.wire` file through the driver that wrote it, moved to begin when opened.

    A chunk arrives once its moved time has come and the driver has written as often as in the
    recording; so answers follow their requests when the same calls are made. If a request comes
    later than in the recording, its answer is delayed by as much.
    """

    begins_when_asked = True

    def __init__(self, path: Path, clock: Clock) -> None:
        super().__init__(path, clock)
        self._written_ns: list[int] = []
        self._last_ns = 0
        self._chunks: deque[tuple[Chunk, int, int]] = deque()

    def open(self, deadline_s: float) -> None:
        """Read the file."""
        log = self._log()
        sent_ns = [message.t_host_ns for message in log.sent_messages]
        self._written_ns = []
        self._last_ns = 0
        self._chunks.clear()
        for message in log.messages:
            before = bisect.bisect_right(sent_ns, message.t_host_ns)
            delay_ns = message.t_host_ns - sent_ns[before - 1] if before else 0
            chunk = Chunk(message.t_host_ns + self._shift_ns, message.frames[0])
            self._chunks.append((chunk, before, delay_ns))

    @property
    def is_finished(self) -> bool:
        """Tell whether every chunk was delivered."""
        return not self._chunks

    def write(self, data: bytes) -> int:
        """Count the bytes as written."""
        now_ns = self._clock.now_ns()
        self._written_ns.append(now_ns)
        return now_ns

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the chunks that are due."""
        return self._wait_for(self._due, timeout_s)

    def close(self) -> None:
        """Forget the file; idempotent."""
        self._chunks.clear()

    def _due(self) -> list[Chunk]:
        due = []
        now_ns = self._clock.now_ns()
        while self._chunks:
            chunk, before, delay_ns = self._chunks[0]
            if before > len(self._written_ns):
                break
            asked_ns = self._written_ns[before - 1] if before else chunk.t_host_ns
            arrival_ns = max(self._last_ns, chunk.t_host_ns, asked_ns + delay_ns)
            if arrival_ns > now_ns:
                break
            self._chunks.popleft()
            self._last_ns = arrival_ns
            due.append(Chunk(arrival_ns, chunk.data))
        return due
