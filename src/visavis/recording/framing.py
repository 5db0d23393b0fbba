"""Walk the messages of an Arrow IPC stream without trusting a byte of it.

pyarrow's own stream reader stops at the first damage. Here every message is located, bounds
are checked, and reading can go on behind a damaged stretch. The layout is that of the Arrow
columnar format, IPC message section (Message.fbs and RecordBatch in its flatbuffer schema).
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CONTINUATION = b"\xff\xff\xff\xff"
_PREFIX_BYTES = 8
_SCHEMA_HEADER = 1
_RECORD_BATCH_HEADER = 3


class TornMessage(Exception):
    """The bytes at hand are not a whole message."""


@dataclass(frozen=True)
class Message:
    """One IPC message: [`start`, `end`) in the file, its body at [`body`, `end`).

    For record batches `n_rows` and `buffers` (k, 2), offset from `body` and length of each
    column buffer; for the end-of-stream marker `is_end`.
    """

    start: int
    body: int
    end: int
    is_schema: bool
    is_end: bool
    n_rows: int
    buffers: npt.NDArray[np.int64]
    metadata: dict[str, str]


_NO_BUFFERS = np.zeros((0, 2), dtype=np.int64)


class _Table:
    """A flatbuffer table, every access bounds-checked by `struct`."""

    def __init__(self, data: memoryview, at: int) -> None:
        self._data = data
        self._at = at
        self._vtable = at - struct.unpack_from("<i", data, at)[0]
        if not 0 <= self._vtable <= len(data) - 4:
            raise TornMessage("table outside the message")
        self._size = struct.unpack_from("<H", data, self._vtable)[0]

    def position(self, index: int) -> int | None:
        """Return where field `index` is stored, None when absent."""
        slot = 4 + 2 * index
        if slot + 2 > self._size:
            return None
        offset = struct.unpack_from("<H", self._data, self._vtable + slot)[0]
        return self._at + offset if offset else None

    def number(self, index: int, code: str) -> int:
        """Return a scalar field, 0 when absent."""
        at = self.position(index)
        return 0 if at is None else int(struct.unpack_from(code, self._data, at)[0])

    def target(self, index: int) -> int | None:
        """Return where the offset stored in a field points."""
        at = self.position(index)
        if at is None:
            return None
        return at + int(struct.unpack_from("<I", self._data, at)[0])

    def text(self, index: int) -> str:
        """Return a string field, empty when absent."""
        at = self.target(index)
        if at is None:
            return ""
        length = struct.unpack_from("<I", self._data, at)[0]
        if at + 4 + length > len(self._data):
            raise TornMessage("text outside the message")
        return bytes(self._data[at + 4 : at + 4 + length]).decode()


def read_message(data: memoryview, start: int) -> Message:
    """Return the message that begins at `start`; raises `TornMessage` when it is cut or damaged."""
    try:
        return _parse(data, start)
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        raise TornMessage(str(error)) from error


def _parse(data: memoryview, start: int) -> Message:
    if data[start : start + 4] != CONTINUATION:
        raise TornMessage("no message starts here")
    size = int(struct.unpack_from("<i", data, start + 4)[0])
    body = start + _PREFIX_BYTES + size
    if size == 0:
        return Message(start, body, body, False, True, 0, _NO_BUFFERS, {})
    if size < 0 or body > len(data):
        raise TornMessage("the message is cut")
    flat = data[start + _PREFIX_BYTES : body]
    message = _Table(flat, struct.unpack_from("<I", flat, 0)[0])
    kind = message.number(1, "<B")
    end = body + message.number(3, "<q")
    if not body <= end <= len(data):
        raise TornMessage("the body is cut")
    metadata = _metadata(flat, message)
    if kind == _SCHEMA_HEADER:
        return Message(start, body, end, True, False, 0, _NO_BUFFERS, metadata)
    header = message.target(2)
    if kind != _RECORD_BATCH_HEADER or header is None:
        raise TornMessage("not a record batch")
    batch = _Table(flat, header)
    n_rows = batch.number(0, "<q")
    at = batch.target(2)
    if at is None:
        raise TornMessage("a record batch without buffers")
    count = struct.unpack_from("<I", flat, at)[0]
    if at + 4 + 16 * count > len(flat):
        raise TornMessage("buffer list outside the message")
    buffers = np.frombuffer(flat, dtype="<i8", count=2 * count, offset=at + 4).reshape(-1, 2)
    return Message(start, body, end, False, False, n_rows, buffers, metadata)


def _metadata(flat: memoryview, message: _Table) -> dict[str, str]:
    at = message.target(4)
    if at is None:
        return {}
    count = struct.unpack_from("<I", flat, at)[0]
    if count > len(flat) // 4:
        raise TornMessage("metadata outside the message")
    pairs = {}
    for slot in range(at + 4, at + 4 + 4 * count, 4):
        entry = _Table(flat, slot + struct.unpack_from("<I", flat, slot)[0])
        pairs[entry.text(0)] = entry.text(1)
    return pairs
