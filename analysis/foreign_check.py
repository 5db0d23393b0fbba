"""Judge recordings made elsewhere by their times alone: XDF files and BIDS data sets.

Reports what LabRecorder and others do not: streams without clock offsets, stamps that go back,
gaps, rates off the nominal, streams that began or ended apart from the others.
"""

import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.session_verdict import Level
from visavis.lab.errors import DataError
from visavis.lab.plain_files import open_plain, parse_json, read_packed, read_plain

GAP_PERIODS = 1.5
LONG_GAP_S = 1.0
RATE_AMBER_01, RATE_RED_01 = 0.01, 0.05
APART_S = 5.0
"""Streams that begin or end further from the others than this are reported."""
MAX_HEADER_BYTES = 16 * 1024 * 1024
_HEADER, _SAMPLES, _OFFSET, _FOOTER = 2, 3, 4, 6
_SIZES = {"int8": 1, "int16": 2, "int32": 4, "float32": 4, "int64": 8, "double64": 8}

Times = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ForeignStream:
    """The times of one stream: stamps in seconds, corrected where offsets are known.

    `offsets` counts clock offsets (None where the format has none); `host` is empty if unknown.
    """

    name: str
    stamps_s: Times = field(repr=False)
    rate_hz: float
    offsets: int | None = None
    host: str = ""


@dataclass(frozen=True)
class StreamVerdict:
    """Verdict on one stream; `findings` are pairs of a problem and its remedy."""

    name: str
    samples: int
    rate_hz: float | None
    level: Level
    findings: tuple[tuple[str, str], ...]


def check_foreign(path: Path) -> tuple[StreamVerdict, ...]:
    """Return a verdict on every stream of an XDF file or a BIDS data set.

    Raises:
        DataError: it is neither, or it cannot be read, with the place.
    """
    streams = read_xdf_times(path) if path.suffix.lower() == ".xdf" else read_bids_times(path)
    if not streams:
        raise DataError(f"{path} holds no stream with times; give an XDF file or a BIDS data set")
    spans = [(s.stamps_s[0], s.stamps_s[-1]) for s in streams if s.rate_hz and len(s.stamps_s) > 1]
    hosts = {s.host for s in streams if s.host}
    return tuple(_verdict(s, spans, several_hosts=len(hosts) > 1) for s in streams)


def _verdict(
    stream: ForeignStream, spans: Sequence[tuple[float, float]], *, several_hosts: bool
) -> StreamVerdict:
    findings: list[tuple[Level, str, str]] = []
    stamps, rate_hz = stream.stamps_s, stream.rate_hz
    n = len(stamps)
    if not n:
        findings.append(
            (Level.RED, "no sample", "see whether the program that sends it was running")
        )
    if stream.offsets == 0:
        level = Level.RED if several_hosts else Level.AMBER
        findings.append(
            (
                level,
                "no clock offset",
                "its times are of the sender's clock alone; from another computer they cannot be "
                "compared with the others: record it again, let the sender run to the end",
            )
        )
    steps = np.diff(stamps)
    back = int((steps < 0).sum())
    if back:
        findings.append(
            (
                Level.RED,
                f"stamps go back {back} times, by up to {-steps.min() * 1000:.0f} ms",
                "do not sort blindly: the sender stamps wrongly, or two senders share one name",
            )
        )
    measured_hz = None
    if rate_hz and n > 2 and stamps[-1] > stamps[0]:
        measured_hz = float(1 / np.median(steps[steps > 0])) if (steps > 0).any() else None
        gaps = steps[steps > GAP_PERIODS / rate_hz]
        if len(gaps):
            level = Level.RED if gaps.max() > LONG_GAP_S else Level.AMBER
            findings.append(
                (
                    level,
                    f"{len(gaps)} gaps, the longest {gaps.max():.3f} s",
                    "samples were lost on the way or never sent; leave out trials they overlap",
                )
            )
        mean_hz = (n - 1) / float(stamps[-1] - stamps[0] - gaps.sum() + len(gaps) / rate_hz)
        off = abs(mean_hz / rate_hz - 1)
        if off > RATE_AMBER_01:
            findings.append(
                (
                    Level.RED if off > RATE_RED_01 else Level.AMBER,
                    f"{mean_hz:.2f} Hz instead of {rate_hz:g} Hz nominal",
                    "use the stamps, not the nominal rate; find out which of the two is right",
                )
            )
    if rate_hz and n > 1 and len(spans) > 1:
        findings += _apart(float(stamps[0]), float(stamps[-1]), spans)
    level = max((f[0] for f in findings), default=Level.GREEN)
    return StreamVerdict(
        stream.name, n, measured_hz, level, tuple((w, do) for _, w, do in findings)
    )


def _apart(
    first_s: float, last_s: float, spans: Sequence[tuple[float, float]]
) -> Iterator[tuple[Level, str, str]]:
    begin, end = (float(np.median([s[i] for s in spans])) for i in (0, 1))
    if last_s < begin or first_s > end:
        yield (
            Level.RED,
            f"does not overlap the others: off by {first_s - begin:.0f} s",
            "its clock was not mapped onto the others'; look for its clock offsets",
        )
        return
    for what, off in (("begins", first_s - begin), ("ends", last_s - end)):
        if abs(off) > APART_S:
            side = "after" if off > 0 else "before"
            yield (
                Level.AMBER,
                f"{what} {abs(off):.0f} s {side} the others",
                "analyse only the time that all streams cover",
            )


# ---- XDF -------------------------------------------------------------------------------------


@dataclass
class _Xdf:
    name: str
    format: str
    channels: int
    rate_hz: float
    host: str
    stamps: list[float] = field(default_factory=list)
    offsets: list[tuple[float, float]] = field(default_factory=list)


def read_xdf_times(path: Path) -> tuple[ForeignStream, ...]:
    """Return the times of every stream of an XDF file; samples themselves are passed over.

    Raises:
        DataError: it is no XDF file, or a chunk cannot be read, with its place.
    """
    streams: dict[int, _Xdf] = {}
    try:
        with open_plain(path) as file:
            if file.read(4) != b"XDF:":
                raise DataError(f"{path} is no XDF file: it does not begin with XDF:")
            while (size := _length(file)) is not None:
                at = file.tell()
                tag = struct.unpack("<H", file.read(2))[0]
                if tag in (_HEADER, _SAMPLES, _OFFSET):
                    _take_chunk(file, tag, size - 2, streams)
                file.seek(at + size)
    except (OSError, struct.error, ValueError, KeyError, ET.ParseError, EOFError) as error:
        raise DataError(f"{path} cannot be read as XDF: {error}; copy it anew") from error
    return tuple(_on_common_clock(s) for _, s in sorted(streams.items()))


def _take_chunk(file: BufferedReader, tag: int, size: int, streams: dict[int, _Xdf]) -> None:
    number = struct.unpack("<I", file.read(4))[0]
    if tag == _HEADER:
        if size > MAX_HEADER_BYTES:
            raise ValueError(f"the header of stream {number} is larger than {MAX_HEADER_BYTES} B")
        info = ET.fromstring(file.read(size - 4))  # noqa: S314 - expat bounds entities by itself
        header = {e.tag: (e.text or "").strip() for e in info}
        streams[number] = _Xdf(
            header.get("name", f"stream {number}"),
            header["channel_format"],
            int(header["channel_count"]),
            float(header.get("nominal_srate") or 0),
            header.get("hostname", ""),
        )
    elif tag == _OFFSET:
        streams[number].offsets.append(struct.unpack("<dd", file.read(16)))
    else:
        _take_samples(file, streams[number])


def _take_samples(file: BufferedReader, stream: _Xdf) -> None:
    count = _length(file) or 0
    width = _SIZES[stream.format] * stream.channels if stream.format in _SIZES else 0
    for _ in range(count):
        has = file.read(1)
        if not has:
            raise EOFError(f"{stream.name} ends in the middle of a sample")
        if has[0]:
            stream.stamps.append(struct.unpack("<d", file.read(8))[0])
        else:
            period_s = 1 / stream.rate_hz if stream.rate_hz else 0.0
            stream.stamps.append((stream.stamps[-1] if stream.stamps else 0.0) + period_s)
        if width:
            file.seek(width, 1)
        else:
            for _ in range(stream.channels):
                file.seek(_length(file) or 0, 1)


def _length(file: BufferedReader) -> int | None:
    """Return a length as XDF writes it: its width in bytes, then itself; None at the end."""
    width = file.read(1)
    if not width:
        return None
    if width[0] not in (1, 4, 8):
        raise ValueError(f"byte {file.tell() - 1} is no length")
    return int.from_bytes(file.read(width[0]), "little")


def _on_common_clock(stream: _Xdf) -> ForeignStream:
    stamps = np.array(stream.stamps, np.float64)
    if stream.offsets:
        at, by = np.array(stream.offsets, np.float64).T
        order = np.argsort(at)
        stamps = stamps + np.interp(stamps, at[order], by[order])
    return ForeignStream(stream.name, stamps, stream.rate_hz, len(stream.offsets), stream.host)


# ---- BIDS ------------------------------------------------------------------------------------


def read_bids_times(root: Path) -> tuple[ForeignStream, ...]:
    """Return the times of every recording of a data set that bears times for its samples.

    Raises:
        DataError: it is no data set, or a file cannot be read.
    """
    if not (root / "dataset_description.json").is_file():
        raise DataError(f"{root} is no BIDS data set: it has no dataset_description.json")
    streams = []
    for path in sorted((*root.rglob("*_physio.tsv.gz"), *root.rglob("*_motion.tsv"))):
        side = path.with_name(path.name.removesuffix(".gz").removesuffix(".tsv") + ".json")
        try:
            sidecar = {**parse_json(read_plain(side))}
            stamps = _times_of(path, sidecar)
            rate_hz = float(sidecar.get("SamplingFrequency") or 0)
        except (OSError, ValueError, EOFError, LookupError, TypeError, OverflowError) as error:
            raise DataError(f"{path} cannot be read with {side.name}: {error}") from error
        if stamps is not None:
            streams.append(ForeignStream(path.relative_to(root).as_posix(), stamps, rate_hz))
    return tuple(streams)


def _times_of(path: Path, sidecar: Mapping[str, Any]) -> Times | None:
    """Return a file's times: its column timestamp, or its channel latency; None without one."""
    if path.name.endswith("_motion.tsv"):
        channels = path.with_name(path.name.replace("_motion.tsv", "_channels.tsv"))
        lines = read_plain(channels).decode().splitlines()
        names = [line.split("\t")[0] for line in lines[1:]]
        column, text = "latency", read_plain(path).decode()
    else:
        names, column = [str(c) for c in sidecar["Columns"]], "timestamp"
        text = read_packed(path).decode()
    if column not in names:
        return None
    at = names.index(column)
    cells = (line.split("\t")[at] for line in text.splitlines())
    return np.array([float("nan") if c == "n/a" else float(c) for c in cells], np.float64)
