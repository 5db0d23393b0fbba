"""Write a recorded session as XDF, one file per part, for the tools of Lab Streaming Layer.

Source: the XDF 1.0 specification (sccn/xdf wiki). Samples bear the device's own time; where time
exchanges were recorded they become clock offsets, from which readers map to the session clock. A
stream without exchanges whose device stamps are another clock than the session's bears the time
of arrival instead. Events and trials are string streams on the session clock.
"""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import RecordingError
from visavis.lab.schema import StreamSchema
from visavis.lab.xdf_channels import channels_of, content_type, describe, flat_columns
from visavis.recording.durable import make_folder, write_failure
from visavis.recording.journal import as_json
from visavis.recording.reader import Recording
from visavis.recording.session_times import EXCHANGE_EVENT, exchanges_by_stream

FILE_HEADER, STREAM_HEADER, SAMPLES, CLOCK_OFFSET, STREAM_FOOTER = 1, 2, 3, 4, 6
SAMPLES_PER_CHUNK = 5000
SAME_CLOCK_NS = NS_PER_S
"""Device and host stamps that never differ by more than this are of one clock."""

Times = npt.NDArray[np.float64]


@dataclass(frozen=True)
class XdfStream:
    """The content of a stream header; `format` is "double64" or "string"."""

    number: int
    name: str
    content: str
    rate_hz: float
    format: str
    channels: int
    source: str
    schema: StreamSchema | None = None


class XdfWriter:
    """Write chunks to an open binary file; call `finish` for every stream at its end."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._counts: dict[int, tuple[int, float, float]] = {}
        file.write(b"XDF:")
        info = Element("info")
        SubElement(info, "version").text = "1.0"
        self._chunk(FILE_HEADER, _xml(info))

    def begin(self, stream: XdfStream, facts: dict[str, str]) -> None:
        """Write a stream's header; `facts` go into its description."""
        info = Element("info")
        for tag, text in (
            ("name", stream.name),
            ("type", stream.content),
            ("channel_count", str(stream.channels)),
            ("nominal_srate", f"{stream.rate_hz:g}"),
            ("channel_format", stream.format),
            ("source_id", stream.source),
        ):
            SubElement(info, tag).text = text
        desc = SubElement(info, "desc")
        for tag, text in facts.items():
            SubElement(desc, tag).text = text
        if stream.schema is not None:
            describe(desc, stream.schema)
        self._chunk(STREAM_HEADER, struct.pack("<I", stream.number) + _xml(info))
        self._counts[stream.number] = (0, float("nan"), float("nan"))

    def samples(self, number: int, stamps_s: Times, values: npt.NDArray[np.float64]) -> None:
        """Write numbers (n, channels) with their stamps (n,)."""
        k = values.shape[1]
        rows = np.empty(len(values), [("has", "u1"), ("t", "<f8"), ("v", "<f8", (k,))])
        rows["has"], rows["t"], rows["v"] = 8, stamps_s, values
        for start in range(0, len(rows), SAMPLES_PER_CHUNK):
            part = rows[start : start + SAMPLES_PER_CHUNK]
            content = struct.pack("<I", number) + _length(len(part)) + part.tobytes()
            self._chunk(SAMPLES, content)
        self._count(number, stamps_s)

    def texts(self, number: int, stamps_s: Times, texts: Sequence[str]) -> None:
        """Write one string per stamp."""
        for t_s, text in zip(stamps_s.tolist(), texts, strict=True):
            raw = text.encode()
            row = struct.pack("<Bd", 8, t_s) + _length(len(raw)) + raw
            self._chunk(SAMPLES, struct.pack("<I", number) + _length(1) + row)
        self._count(number, stamps_s)

    def clock_offset(self, number: int, device_s: float, offset_s: float) -> None:
        """Write that adding `offset_s` at `device_s` gives the session's clock."""
        self._chunk(CLOCK_OFFSET, struct.pack("<Idd", number, device_s, offset_s))

    def finish(self, number: int) -> None:
        """Write a stream's footer."""
        count, first_s, last_s = self._counts[number]
        info = Element("info")
        SubElement(info, "first_timestamp").text = repr(first_s)
        SubElement(info, "last_timestamp").text = repr(last_s)
        SubElement(info, "sample_count").text = str(count)
        self._chunk(STREAM_FOOTER, struct.pack("<I", number) + _xml(info))

    def _count(self, number: int, stamps_s: Times) -> None:
        if len(stamps_s):
            count, first_s, _ = self._counts[number]
            first_s = float(stamps_s[0]) if count == 0 else first_s
            self._counts[number] = (count + len(stamps_s), first_s, float(stamps_s[-1]))

    def _chunk(self, tag: int, content: bytes) -> None:
        self._file.write(_length(len(content) + 2) + struct.pack("<H", tag) + content)


def export_xdf(recording: Recording, target: Path) -> tuple[Path, ...]:
    """Write `<participant>_ses-<n>_part-<m>.xdf` for every part and return the files.

    Raises RecordingError when a file is there already.
    """
    make_folder(target, exist_ok=True)
    manifest = recording.manifest
    paths = []
    for part in manifest.parts:
        name = f"{manifest.participant}_ses-{manifest.session:03d}_{part.folder}.xdf"
        path = target / name
        try:
            with path.open("xb") as file:
                _write_part(recording, part.number, XdfWriter(file))
        except FileExistsError as error:
            raise RecordingError(f"{path} exists already; export into an empty folder") from error
        except OSError as error:
            raise write_failure(path, error) from error
        paths.append(path)
    return tuple(paths)


def _write_part(recording: Recording, part: int, writer: XdfWriter) -> None:
    manifest = recording.manifest
    source = f"{manifest.study}-{manifest.participant}-{manifest.session:03d}"
    facts = {
        "is_simulated": "true" if recording.is_simulated else "false",
        "study": manifest.study,
        "participant": manifest.participant,
    }
    events = recording.events()
    events = events[events["recording_part"] == part]
    exchanges = exchanges_by_stream(events[events["name"] == EXCHANGE_EVENT]["payload"])
    number = 0
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        if schema is None:
            continue
        number += 1
        columns = recording.stream_arrays(name, part=part)
        flat = flat_columns(schema, dict(columns))
        stream = XdfStream(
            number,
            name,
            content_type(schema),
            schema.nominal_rate_hz,
            "double64",
            len(channels_of(schema)),
            f"{source}-{name}",
            schema,
        )
        pairs = exchanges.get(name, [])
        device_ns, host_ns = columns["t_device_ns"], columns["t_host_ns"]
        # Device stamps are usable when exchanges map them, or when they are the session's clock.
        own = bool(pairs) or bool((np.abs(device_ns - host_ns) <= SAME_CLOCK_NS).all())
        clock = "device" if own else "arrival"
        writer.begin(stream, {**facts, "time_stamps": clock})
        stamps_ns = device_ns if own else host_ns
        writer.samples(number, stamps_ns / NS_PER_S, flat)
        for send, device, receive in pairs:
            # Middle of the round trip: the usual estimate when both ways take equally long.
            offset_ns = (send + receive) // 2 - device
            writer.clock_offset(number, device / NS_PER_S, offset_ns / NS_PER_S)
        if not pairs and len(stamps_ns):  # they are on the session's clock already
            for stamp_ns in (stamps_ns[0], stamps_ns[-1]):
                writer.clock_offset(number, stamp_ns / NS_PER_S, 0.0)
        writer.finish(number)
    trials = recording.trial_entries(part)
    for name, times, texts in (
        (
            "events",
            events["t_ns"].to_numpy(np.int64),
            [
                _text({"event": n, **p})
                for n, p in zip(events["name"], events["payload"], strict=True)
            ],
        ),
        (
            "trials",
            np.array([t["t_ns"] for t in trials], np.int64),
            [_text(t["row"]) for t in trials],
        ),
    ):
        number += 1
        stream = XdfStream(number, name, "Markers", 0.0, "string", 1, f"{source}-{name}")
        writer.begin(stream, facts)
        writer.texts(number, times / NS_PER_S, texts)
        writer.finish(number)


def _text(row: dict[str, Any]) -> str:
    return json.dumps(as_json(row), ensure_ascii=False, sort_keys=True)


def _xml(element: Element) -> bytes:
    return f'<?xml version="1.0"?>{tostring(element, encoding="unicode")}'.encode()


def _length(n: int) -> bytes:
    if n < 2**8:
        return struct.pack("<BB", 1, n)
    return struct.pack("<BI", 4, n) if n < 2**32 else struct.pack("<BQ", 8, n)
