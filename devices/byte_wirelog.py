"""Write what crosses a byte link to a `.wire` file, and play such a file back.

The file is that of `devices.wirelog`: a message is one chunk that came, a sent one what went out.
"""

import bisect
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO

import msgpack

from devices.byte_links import ByteLink, Chunk
from devices.wirelog import read_wire_log, wire_header
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.errors import DeviceNotFound

_CAME, _SENT = 0, 2


class TeeLink:
    """Pass everything through to another link and write it down with its times."""

    def __init__(
        self,
        inner: ByteLink,
        path: Path,
        clock: Clock,
        note: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self._inner = inner
        self._path = path
        self._note = note
        self._clock = clock
        self._file: BinaryIO | None = None

    @property
    def kind(self) -> str:
        """Name the link itself."""
        return self._inner.kind

    @property
    def is_simulated(self) -> bool:
        """Tell what the link tells."""
        return self._inner.is_simulated

    def open(self, deadline_s: float) -> None:
        """Open the link; the log is appended to when it exists."""
        self._inner.open(deadline_s)
        if self._file is None:
            self._file = self._path.open("ab", buffering=0)
            if self._file.tell() == 0:
                inner = self._inner
                header = wire_header(inner.kind, is_simulated=inner.is_simulated, note=self._note)
                self._file.write(msgpack.packb(header))

    def write(self, data: bytes) -> int:
        """Pass on and log."""
        if self._file is not None:
            self._file.write(msgpack.packb((_SENT, self._clock.now_ns(), (data,))))
        return self._inner.write(data)

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Pass on and log every chunk."""
        chunks = self._inner.read(timeout_s)
        if chunks and self._file is not None:
            records = [msgpack.packb((_CAME, c.t_host_ns, None, (c.data,))) for c in chunks]
            self._file.write(b"".join(records))
        return chunks

    def close(self) -> None:
        """Close the link; the log stays open for the next connection until `end`."""
        self._inner.close()

    def end(self) -> None:
        """Close the log; idempotent."""
        if self._file is not None:
            self._file.close()
            self._file = None


class ReplayLink:
    """Play a `.wire` file through the driver that wrote it, moved to begin when opened.

    A chunk comes when its moved time has come and the driver has written as often as the
    recorded one had by then; so answers meet their questions when the same calls are made. An
    answer to a question that was asked later than in the recording comes later by as much.
    Opening again plays the file from its start.
    """

    kind = "replay"
    is_simulated = True

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path = path
        self._clock = clock
        self._shift_ns = 0
        self._written_ns: list[int] = []
        self._last_ns = 0
        self._chunks: deque[tuple[Chunk, int, int]] = deque()

    def open(self, deadline_s: float) -> None:
        """Read the file."""
        try:
            log = read_wire_log(self._path)
        except OSError as cause:
            raise DeviceNotFound(
                f"cannot read {self._path}: {cause.strerror}", remedy="check the path"
            ) from cause
        sent_ns = [message.t_host_ns for message in log.sent]
        starts = sent_ns[:1] + [message.t_host_ns for message in log.messages[:1]]
        self._shift_ns = self._clock.now_ns() - min(starts, default=0)
        self._written_ns = []
        self._last_ns = 0
        self._chunks.clear()
        for message in log.messages:
            before = bisect.bisect_right(sent_ns, message.t_host_ns)
            delay_ns = message.t_host_ns - sent_ns[before - 1] if before else 0
            moved = Chunk(message.t_host_ns + self._shift_ns, message.frames[0])
            self._chunks.append((moved, before, delay_ns))

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
        chunks = self._due()
        if chunks or timeout_s <= 0:
            return chunks
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while not chunks and (now_ns := self._clock.now_ns()) < deadline_ns:
            self._clock.sleep_until_ns(min(now_ns + NS_PER_MS, deadline_ns))
            chunks = self._due()
        return chunks

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
