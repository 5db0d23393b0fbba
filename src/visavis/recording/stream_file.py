"""Read one stream file, whole, torn or damaged."""

import mmap
import os
import zlib
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from visavis.lab.errors import RecordingError
from visavis.lab.plain_files import open_plain
from visavis.lab.schema import Field, StreamSchema
from visavis.recording.columns import (
    FORMAT_VERSION,
    STAMPS,
    buffer_bytes,
    is_flag,
    row_dtype,
    stream_schema,
)
from visavis.recording.framing import CONTINUATION, Message, TornMessage, read_message

Columns = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Gap:
    """Rows lost from a stream file, between two readable samples.

    `n_rows` is None where nothing says how many there were; `after_ns` and `before_ns` are the
    host times of the samples on both sides, None at the file's beginning and end.
    """

    first_row: int
    n_rows: int | None
    after_ns: int | None
    before_ns: int | None


@dataclass(frozen=True)
class StreamContent:
    """What a stream file held.

    `columns` maps seq, t_device_ns, t_host_ns and the stream's fields to arrays of n rows;
    `problems` names every damage found, `gaps` which rows it cost; `tail_problem` is the one of
    them that a killed process or a full disk leaves behind, too. `is_ended` tells whether the end
    marker is there and `last_ns` when the last readable sample came. `is_unbegun`: the file ends
    within its own header, before which no stream has a sample.
    """

    schema: StreamSchema | None
    is_simulated: bool | None
    columns: Columns
    n_rows: int
    n_batches: int
    is_ended: bool
    problems: tuple[str, ...]
    gaps: tuple[Gap, ...] = ()
    last_ns: int | None = None
    is_unbegun: bool = False

    @property
    def tail_problem(self) -> str:
        """Return the problem at the file's end; empty when there is none."""
        is_cut = self.is_unbegun or (self.gaps and self.gaps[-1].n_rows is None)
        return self.problems[-1] if is_cut else ""


@dataclass(frozen=True)
class _Batch:
    first_row: int
    n_rows: int
    buffers: tuple[memoryview, ...]

    def t_host_ns(self, row: int) -> int:
        """Return when one of its samples came; the third column of every stream."""
        return int(np.frombuffer(self.buffers[2], np.int64)[row])


def read_stream_file(
    path: Path, spare_header: bytes | None = None, *, with_columns: bool = True
) -> StreamContent:
    """Read every intact batch of a stream file; never raises for damage.

    `spare_header` is the journal's copy of the file's header; without `with_columns` everything
    is checked and no sample returned. Raises RecordingError when the
    file was written by a newer Visavis or cannot be opened.
    """
    try:
        data = memoryview(_bytes_of(path))
    except FileNotFoundError:
        return _nothing(f"{path} is missing")
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}; check the disk") from error
    problems: list[str] = []
    start, arrow = _header(data, path, spare_header, problems)
    if arrow is None:
        is_unbegun = spare_header is None and _ends_in_header(data)
        return replace(_nothing(*problems), is_unbegun=is_unbegun)
    _check_version(arrow, path)
    try:
        schema = stream_schema(arrow)
    except (KeyError, ValueError, TypeError) as error:
        return _nothing(*problems, f"{path}: the header lacks {error}")
    fields = STAMPS + schema.fields
    batches, is_ended, gaps = _batches(data, start, fields, path, problems)
    return StreamContent(
        schema=schema,
        is_simulated=(arrow.metadata or {}).get(b"is_simulated") == b"true",
        columns=_columns(batches, fields) if with_columns else {},
        n_rows=sum(b.n_rows for b in batches),
        n_batches=len(batches),
        is_ended=is_ended,
        problems=tuple(problems),
        gaps=tuple(gaps),
        last_ns=batches[-1].t_host_ns(-1) if batches else None,
    )


def empty_columns(schema: StreamSchema) -> Columns:
    """Return the columns of a stream without rows."""
    rows = np.zeros(0, dtype=row_dtype(schema))
    return {name: rows[name] for name in rows.dtype.names or ()}


def _bytes_of(path: Path) -> bytes | mmap.mmap:
    with open_plain(path) as file:
        if os.fstat(file.fileno()).st_size == 0:
            return b""
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _nothing(*problems: str) -> StreamContent:
    return StreamContent(None, None, {}, 0, 0, False, problems)


def _header(
    data: memoryview, path: Path, spare: bytes | None, problems: list[str]
) -> tuple[int, Any]:
    """Return where batches begin and the Arrow schema, None when there is none to be had."""
    if spare is not None:
        if data[: len(spare)] != spare:
            problems.append(f"{path}: the header is damaged; the journal's copy was used")
        try:
            return min(len(spare), len(data)), pa.ipc.read_schema(pa.py_buffer(spare))
        except (pa.ArrowException, OSError, ValueError) as error:
            problems.append(f"{path}: the journal's copy of the header is not a header ({error})")
            return 0, None
    try:
        message = read_message(data, 0)
        if not message.is_schema:
            raise TornMessage("the first message is not a schema")
        return message.end, pa.ipc.read_schema(pa.py_buffer(bytes(data[: message.end])))
    except (TornMessage, pa.ArrowException, OSError, ValueError) as error:
        problems.append(f"{path}: the header is cut or damaged ({error})")
        return 0, None


def _ends_in_header(data: memoryview) -> bool:
    """Tell whether a file is the beginning of a header and nothing more."""
    if len(data) < 8:
        return CONTINUATION.startswith(data[:4])
    length = int.from_bytes(data[4:8], "little", signed=True)
    is_cut = data[:4] == CONTINUATION and length > len(data) - 8
    return is_cut and not any(_is_message(data, at) for at in range(8, len(data) - 7, 8))


def _is_message(data: memoryview, at: int) -> bool:
    try:
        read_message(data, at)
    except TornMessage:
        return False
    return True


def _check_version(arrow: Any, path: Path) -> None:
    version = (arrow.metadata or {}).get(b"visavis_format", b"")
    if not version.isdigit():
        raise RecordingError(f"{path} states no format version; it is not a Visavis stream")
    if int(version) > FORMAT_VERSION:
        raise RecordingError(
            f"{path} has format version {int(version)}, this Visavis reads up to "
            f"{FORMAT_VERSION}; install a newer Visavis"
        )


def _batches(
    data: memoryview, start: int, fields: tuple[Field, ...], path: Path, problems: list[str]
) -> tuple[list[_Batch], bool, list[Gap]]:
    batches: list[_Batch] = []
    gaps: list[Gap] = []
    at, row = start, 0
    while at < len(data):
        try:
            message = read_message(data, at)
            if message.is_end:
                if message.end < len(data):
                    problems.append(f"{path}: {len(data) - message.end} bytes follow the end")
                return batches, True, gaps
            batch = _decode(data, message, fields)
            end = message.end
        except TornMessage as error:
            next_batch = _next_intact(data, at + 8, fields, row)
            if next_batch is None:
                n_lost = len(data) - at
                problems.append(
                    f"{path}: batch {len(batches)} (byte {at}) is cut: {error}; "
                    f"the last {n_lost} bytes are not a whole batch"
                )
                gaps.append(Gap(row, None, _last_ns(batches), None))
                return batches, _ends_in_marker(data, at), gaps
            where, batch, end = next_batch
            problems.append(
                f"{path}: bytes {at} to {where} are damaged ({error}); "
                f"rows {row} to {batch.first_row - 1} are lost"
            )
        else:
            if batch.first_row != row:
                problems.append(
                    f"{path}: the batch at byte {at} begins with row {batch.first_row}, "
                    f"row {row} was due"
                )
        at = end
        if batch.first_row < row:
            continue  # rows that came before: a copy, or out of order
        if batch.first_row > row:
            n_lost = batch.first_row - row
            gaps.append(Gap(row, n_lost, _last_ns(batches), batch.t_host_ns(0)))
        batches.append(batch)
        row = batch.first_row + batch.n_rows
    return batches, False, gaps


def _last_ns(batches: list[_Batch]) -> int | None:
    return batches[-1].t_host_ns(-1) if batches else None


def _ends_in_marker(data: memoryview, at: int) -> bool:
    return len(data) - at > 8 and data[len(data) - 8 :] == CONTINUATION + bytes(4)


def _next_intact(
    data: memoryview, start: int, fields: tuple[Field, ...], least_row: int
) -> tuple[int, _Batch, int] | None:
    """Return position, content and end of the next batch whose CRC-32 agrees."""
    raw = cast(bytes | mmap.mmap, data.obj)
    at = raw.find(CONTINUATION, start)
    while at >= 0:
        if at % 8 == 0:
            try:
                message = read_message(data, at)
                if not message.is_end:
                    batch = _decode(data, message, fields)
                    if batch.first_row >= least_row:
                        return at, batch, message.end
            except TornMessage:
                pass
        at = raw.find(CONTINUATION, at + 1)
    return None


@lru_cache(maxsize=1024)
def _sizes(fields: tuple[Field, ...], n: int) -> tuple[int, ...]:
    return tuple(buffer_bytes(field, n) for field in fields)


def _decode(data: memoryview, message: Message, fields: tuple[Field, ...]) -> _Batch:
    """Return the column buffers of a message; raises TornMessage when it was changed or cut."""
    if message.is_schema:
        raise TornMessage("a second header")
    places = [(at, size) for at, size in message.buffers.tolist() if size > 0]
    n, body, end = message.n_rows, message.body, message.end
    sizes = _sizes(fields, n)
    n_filled = len(sizes) - sizes.count(0)  # a column without values takes no bytes
    if not places or len(places) != n_filled:
        raise TornMessage(f"{len(places)} columns instead of {n_filled}")
    if end - body != -(-sum(places[-1]) // 8) * 8:
        raise TornMessage("the body has another length than its columns")
    row, crc_text = message.metadata.get("row", ""), message.metadata.get("crc32", "")
    crc = zlib.crc32(row.encode())
    buffers = []
    place = iter(places)
    for field, due in zip(fields, sizes, strict=True):
        at, size = next(place) if due else (0, 0)
        if size != due or at < 0 or body + at + size > end:
            raise TornMessage(f"column {field.name!r} has another size")
        buffer = data[body + at : body + at + size]
        crc = zlib.crc32(buffer, crc)
        buffers.append(buffer)
    if crc_text != f"{crc:08x}" or not row.isdigit():
        raise TornMessage("the checksum disagrees")
    return _Batch(int(row), n, tuple(buffers))


def _columns(batches: list[_Batch], fields: tuple[Field, ...]) -> Columns:
    columns: Columns = {}
    n_rows = sum(b.n_rows for b in batches)
    for i, field in enumerate(fields):
        if is_flag(field):
            columns[field.name] = _unpack(batches, i, field)
            continue
        raw = b"".join([b.buffers[i] for b in batches])
        columns[field.name] = np.frombuffer(raw, field.dtype).reshape((n_rows, *field.shape))
    return columns


def _unpack(batches: list[_Batch], index: int, field: Field) -> npt.NDArray[np.bool_]:
    per_row = int(np.prod(field.shape))
    pieces = [
        np.unpackbits(
            np.frombuffer(b.buffers[index], np.uint8), count=b.n_rows * per_row, bitorder="little"
        )
        for b in batches
    ]
    bits = np.concatenate(pieces) if pieces else np.zeros(0, np.uint8)
    return bits.view(np.bool_).reshape((sum(b.n_rows for b in batches), *field.shape))
