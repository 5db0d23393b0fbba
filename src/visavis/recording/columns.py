"""Translate stream schemas to Arrow and back, and sample batches to Arrow IPC messages."""

import json
import math
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from visavis.lab.errors import RecordingError
from visavis.lab.plain_files import parse_json
from visavis.lab.schema import UNIT_OF_SUFFIX, Field, StreamSchema
from visavis.lab.ucum import code_of, is_ucum
from visavis.recording.framing import read_message

FORMAT_VERSION = 1
"""Version of stream files; a reader understands this and all earlier ones."""

MAX_ITEMS = 1_000_000
"""No field holds more values a sample."""

END_OF_STREAM = b"\xff\xff\xff\xff\x00\x00\x00\x00"
"""The eight bytes that close an Arrow IPC stream."""

STAMPS: tuple[Field, ...] = (
    Field("seq", "i8", "", description="sample number as the driver counted it; a hole is a loss"),
    Field("t_device_ns", "i8", "ns", description="the device's own clock, never corrected"),
    Field("t_host_ns", "i8", "ns", description="session clock at arrival"),
)
"""The columns that precede every stream's own fields."""

_ARROW_TYPES: dict[str, Any] = {
    "b1": pa.bool_(),
    "i1": pa.int8(),
    "i2": pa.int16(),
    "i4": pa.int32(),
    "i8": pa.int64(),
    "u1": pa.uint8(),
    "u2": pa.uint16(),
    "u4": pa.uint32(),
    "u8": pa.uint64(),
    "f2": pa.float16(),
    "f4": pa.float32(),
    "f8": pa.float64(),
}


def arrow_schema(schema: StreamSchema, *, is_simulated: bool) -> Any:
    """Return the Arrow schema of a stream file: stamps first, vectors as fixed-size lists.

    Units, frames, shapes and descriptions are field metadata; format version, stream version,
    nominal rate and `is_simulated` are schema metadata.
    """
    fields = []
    for field in STAMPS + schema.fields:
        code = np.dtype(field.dtype).str[1:]
        if code not in _ARROW_TYPES:
            raise RecordingError(
                f"stream {schema.name!r}, field {field.name!r}: dtype {field.dtype!r} cannot be "
                f"recorded; use one of {', '.join(sorted(_ARROW_TYPES))}"
            )
        kind = _ARROW_TYPES[code]
        if field.shape:
            kind = pa.list_(pa.field("item", kind, nullable=False), int(np.prod(field.shape)))
        metadata = {
            "dtype": field.dtype,
            "unit": field.unit,
            "frame": field.frame,
            "shape": json.dumps(list(field.shape)),
            "description": field.description,
        }
        fields.append(pa.field(field.name, kind, nullable=False, metadata=metadata))
    return pa.schema(
        fields,
        metadata={
            "visavis_format": str(FORMAT_VERSION),
            "stream": schema.name,
            "stream_version": str(schema.version),
            "nominal_rate_hz": repr(float(schema.nominal_rate_hz)),
            "is_simulated": "true" if is_simulated else "false",
        },
    )


def stream_schema(schema: Any) -> StreamSchema:
    """Read a stream schema back from the Arrow schema of a stream file."""
    meta = {k.decode(): v.decode() for k, v in (schema.metadata or {}).items()}
    fields = []
    for column in list(schema)[len(STAMPS) :]:
        notes = {k.decode(): v.decode() for k, v in (column.metadata or {}).items()}
        unit, description = notes["unit"], notes["description"]
        if unit and not is_ucum(unit):  # recorded before units were those of UCUM
            description = (
                description if unit in description else f"{description or column.name} in {unit}"
            )
            code = code_of(unit)
            unit = code if code not in UNIT_OF_SUFFIX.values() else ""
        fields.append(
            Field(
                name=column.name,
                dtype=notes["dtype"],
                unit=unit,
                frame=notes["frame"],
                shape=_shape(notes["shape"]),
                description=description,
            )
        )
        if np.dtype(fields[-1].dtype).str[1:] not in _ARROW_TYPES:
            raise ValueError(f"a dtype that can be recorded: {column.name!r}")
    return StreamSchema(
        name=meta["stream"],
        fields=tuple(fields),
        nominal_rate_hz=float(meta["nominal_rate_hz"]),
        version=int(meta["stream_version"]),
    )


def _shape(text: str) -> tuple[int, ...]:
    shape = parse_json(text)
    if not isinstance(shape, list) or not all(
        type(n) is int and 0 <= n <= MAX_ITEMS for n in shape
    ):
        raise ValueError(f"a shape that can be: {text!r}")
    if math.prod(shape) > MAX_ITEMS:
        raise ValueError(f"a shape that can be: {text!r}")
    return tuple(shape)


def row_dtype(schema: StreamSchema) -> np.dtype[np.void]:
    """Return the dtype of one row of a stream file: stamps, then the stream's fields."""
    return np.dtype([(f.name, f.dtype, f.shape) for f in STAMPS + schema.fields])


def buffer_bytes(field: Field, n: int) -> int:
    """Return how many bytes n values of a field take, without padding."""
    items = n * int(np.prod(field.shape))
    return (items + 7) // 8 if is_flag(field) else items * np.dtype(field.dtype).itemsize


def is_flag(field: Field) -> bool:
    """Tell whether a field is stored as packed bits."""
    return np.dtype(field.dtype) == np.bool_


_CRC_HOLE = b"c" * 8
_ROW_HOLE = b"r" * 12
_MAX_TEMPLATES = 32
"""Per stream: messages of a real session differ in length, and each may be as long as a second."""


@dataclass
class _Template:
    """A message with its columns as writable views, and where CRC-32 and first row stand."""

    message: memoryview
    columns: list[npt.NDArray[Any]]
    crc_at: slice
    row_at: slice


class BatchEncoder:
    """Turn rows into Arrow IPC record batch messages.

    pyarrow lays out one message per row count; later batches of that length are the same bytes
    with other columns, CRC-32 and first row, and are filled in by NumPy alone.
    """

    def __init__(self, schema: StreamSchema, *, is_simulated: bool) -> None:
        self._arrow = arrow_schema(schema, is_simulated=is_simulated)
        self._fields = STAMPS + schema.fields
        self._own = [(f.name, is_flag(f)) for f in schema.fields]
        self._templates: dict[int, _Template] = {}
        self.header: bytes = self._arrow.serialize().to_pybytes()
        self._templates[1] = self._template(1)

    def encode(
        self,
        stamps: npt.NDArray[np.int64],
        values: npt.NDArray[np.void],
        first_row: int,
    ) -> memoryview:
        """Return one message holding n rows; it is overwritten by the next of equal length.

        `stamps` is (3, n): seq, device and host time; `values` (n,).
        """
        n = stamps.shape[1]
        template = self._templates.pop(n, None) or self._template(n)
        self._templates[n] = template  # behind those used longer ago
        columns = template.columns
        row = b"%012d" % first_row
        crc = zlib.crc32(row)
        for i in range(3):
            columns[i][...] = stamps[i]
            crc = zlib.crc32(columns[i].data, crc)
        for i, (name, is_packed) in enumerate(self._own, start=3):
            columns[i][...] = (
                np.packbits(values[name], bitorder="little") if is_packed else values[name]
            )
            crc = zlib.crc32(columns[i].data, crc)
        template.message[template.crc_at] = b"%08x" % crc
        template.message[template.row_at] = row
        return template.message

    def _template(self, n: int) -> _Template:
        arrays = []
        for field, column in zip(self._fields, self._arrow, strict=True):
            buffer = pa.py_buffer(bytes(buffer_bytes(field, n)))
            if field.shape:
                length = n * column.type.list_size
                items = pa.Array.from_buffers(column.type.value_type, length, [None, buffer])
                arrays.append(pa.Array.from_buffers(column.type, n, [None], 0, 0, [items]))
            else:
                arrays.append(pa.Array.from_buffers(column.type, n, [None, buffer]))
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, self._arrow) as writer:
            writer.write_batch(
                pa.RecordBatch.from_arrays(arrays, schema=self._arrow),
                custom_metadata={"crc32": _CRC_HOLE, "row": _ROW_HOLE},
            )
        data = bytearray(sink.getvalue().to_pybytes()[len(self.header) : -len(END_OF_STREAM)])
        layout = read_message(memoryview(data), 0)
        # Validity buffers are empty (nothing is nullable), and so are those of columns without
        # values; the others are the columns in order.
        offsets = iter([int(at) for at, length in layout.buffers if length > 0])
        columns = []
        for field in self._fields:
            size = buffer_bytes(field, n)
            at = layout.body + next(offsets) if size else 0
            raw = np.frombuffer(data, np.uint8, count=size, offset=at)
            if not is_flag(field):
                raw = raw.view(field.dtype).reshape((n, *field.shape))
            columns.append(raw)
        crc_at, row_at = data.index(_CRC_HOLE), data.index(_ROW_HOLE)
        template = _Template(
            memoryview(data),
            columns,
            slice(crc_at, crc_at + len(_CRC_HOLE)),
            slice(row_at, row_at + len(_ROW_HOLE)),
        )
        if len(self._templates) >= _MAX_TEMPLATES:
            self._templates.pop(next(iter(self._templates)))
        return template
