"""Read the times of an XDF file that may be damaged, and map each stream's clock onto the others'.

Source: the XDF 1.0 specification (sccn/xdf wiki). What cannot be read is passed over up to the next
boundary chunk, and told; a clock that was reset gives segments, each with a fit of its own.
"""

import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.plain_files import open_plain, read_packed
from visavis.lab.sampling import time_returns

MAX_HEADER_BYTES = 16 * 1024 * 1024
MAX_CHUNK_BYTES = 1 << 30
BOUNDARY = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")
MAX_AWAY_S = 60.0
RESET_S = 1.0
"""Offsets of one clock never jump by so much from one exchange to the next, drift aside."""
MAX_DRIFT = 1e-3
MAX_CLOCK_S = 4e9
"""No clock shows more: 126 years."""
OUTLYING_SPREADS, MIN_OUTLYING_S = 8.0, 0.002
_HEADER, _SAMPLES, _OFFSET, _BOUNDARY, _FOOTER = 2, 3, 4, 5, 6
_SIZES = {"int8": 1, "int16": 2, "int32": 4, "float32": 4, "int64": 8, "double64": 8}

Times = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ClockSegment:
    """Samples `first` to before `after` between two resets of a sender's clock.

    `exchanges` of them were used (0: none belongs to it) and `outlying` rejected; offsets drift by
    `drift_ppm`, and exchanges cover the device times `from_s` to `to_s`.
    """

    first: int
    after: int
    exchanges: int = 0
    outlying: int = 0
    drift_ppm: float = 0.0
    from_s: float = np.nan
    to_s: float = np.nan


@dataclass
class XdfTimes:
    """A stream's times as they stand: the sender's stamps and its clock exchanges, in file order.

    `own_s` is filled by `read_xdf`; `damage` says what could not be read of the file.
    """

    name: str
    format: str
    channels: int
    rate_hz: float
    host: str
    parts: list[Times] = field(default_factory=list)
    exchanges: list[tuple[float, float]] = field(default_factory=list)
    last_s: float = 0.0

    @property
    def own_s(self) -> Times:
        """The sender's stamps (n,)."""
        return np.concatenate(self.parts) if self.parts else np.zeros(0)


class _DamageError(Exception):
    """A chunk that cannot be read."""


def read_xdf(path: Path) -> tuple[tuple[XdfTimes, ...], tuple[str, ...]]:
    """Return the streams of an XDF file, and what of it could not be read.

    `.xdfz` and `.xdf.gz` are unpacked on the way.

    Raises:
        DataError: it is no XDF file, or cannot be opened.
    """
    try:
        with open_plain(path) as raw:
            if raw.read(2) == b"\x1f\x8b":  # what is left of a cut one ends within a chunk
                return _read(path, BytesIO(read_packed(path, may_be_cut=True)))
            raw.seek(0)
            return _read(path, raw)
    except OSError as error:
        raise DataError(f"{path} cannot be read as XDF: {error}; copy it anew") from error


def _read(path: Path, file: BinaryIO) -> tuple[tuple[XdfTimes, ...], tuple[str, ...]]:
    if file.read(4) != b"XDF:":
        raise DataError(f"{path} is no XDF file: it does not begin with XDF:")
    streams: dict[int, XdfTimes] = {}
    damage: list[str] = []
    while True:
        begin = file.tell()
        try:
            size = _length(file)
            if size is None:
                break
            if not 2 <= size <= MAX_CHUNK_BYTES:
                raise _DamageError(f"a chunk of {size} bytes")
            content = file.read(size)
            tag = int.from_bytes(content[:2], "little")
            if not 1 <= tag <= _FOOTER:
                raise _DamageError(f"a chunk of the unknown kind {tag}")
            is_cut = len(content) < size
            if is_cut:
                # What a cut chunk holds is left out, as pyxdf does: nothing says that it is whole.
                damage.append(f"cut at byte {file.tell()}; the chunk there was left out")
                break
            _take_chunk(content[2:], tag, streams)
        except (_DamageError, struct.error, ValueError, KeyError, ET.ParseError) as error:
            at = _next_boundary(file, begin + 1)
            if at is None:
                damage.append(f"nothing from byte {begin} on can be read ({error})")
                break
            damage.append(f"bytes {begin} to {at} cannot be read ({error}) and were passed over")
            file.seek(at)
    if damage and not streams:
        raise DataError(f"{path} cannot be read as XDF: {damage[0]}; copy it anew")
    return tuple(stream for _, stream in sorted(streams.items())), tuple(damage)


def _next_boundary(file: BinaryIO, start: int) -> int | None:
    """Return where the chunk after the next boundary begins; None where there is none."""
    file.seek(start)
    tail = b""
    offset = start
    while piece := file.read(1 << 20):
        data = tail + piece
        if (at := data.find(BOUNDARY)) >= 0:
            return offset - len(tail) + at + len(BOUNDARY)
        tail = data[-len(BOUNDARY) :]
        offset += len(piece)
    return None


def _take_chunk(content: bytes, tag: int, streams: dict[int, XdfTimes]) -> None:
    if tag == _HEADER:
        number = struct.unpack("<I", content[:4])[0]
        header = _header(content[4:])
        streams[number] = XdfTimes(
            header.get("name", f"stream {number}"),
            header["channel_format"],
            int(header["channel_count"]),
            float(header.get("nominal_srate") or 0),
            header.get("hostname", ""),
        )
    elif tag == _OFFSET:
        number, at_s, by_s = struct.unpack("<Idd", content[:20])
        streams[number].exchanges.append((at_s, by_s))
    elif tag == _SAMPLES:
        _take_samples(content, streams[struct.unpack("<I", content[:4])[0]])


def _header(content: bytes) -> dict[str, str]:
    """Return a header's entries; programs write XML in Latin-1 and call it UTF-8."""
    if len(content) > MAX_HEADER_BYTES:
        raise _DamageError(f"a header of more than {MAX_HEADER_BYTES} bytes")
    if b"<!DOCTYPE" in content.replace(b"\0", b""):  # its attributes unpack to gigabytes
        raise _DamageError("a header with a DOCTYPE")
    try:
        info = ET.fromstring(content)  # noqa: S314 - expat bounds entities by itself
    except ET.ParseError:
        text = content.decode("latin-1")
        _, declaration, after = text.partition("?>")
        info = ET.fromstring(after if declaration else text)  # noqa: S314 - as above
    return {e.tag: (e.text or "").strip() for e in info}


def _take_samples(content: bytes, stream: XdfTimes) -> None:
    head = BytesIO(content)
    head.seek(4)
    count = _length(head) or 0
    start = head.tell()
    size = _SIZES.get(stream.format, 0) * stream.channels
    row = 9 + size
    if size and len(content) - start == count * row:
        table = np.frombuffer(
            content, [("has", "u1"), ("t", "<f8"), ("v", f"V{size}")], count, start
        )
        if (table["has"] == 8).all():
            stamps = table["t"].astype(np.float64)
            stream.parts.append(stamps)
            stream.last_s = float(stamps[-1]) if count else stream.last_s
            return
    times: list[float] = []
    period_s, last_s = 1 / stream.rate_hz if stream.rate_hz else 0.0, stream.last_s
    for _ in range(count):
        has = head.read(1)
        if has not in (b"\x00", b"\x08"):
            raise _DamageError(f"a sample of {stream.name} that is none")
        last_s = struct.unpack("<d", head.read(8))[0] if has[0] else last_s + period_s
        for _ in range(1 if size else stream.channels):
            length = size or _length(head) or 0
            if len(head.read(length)) < length:
                raise _DamageError(f"{stream.name} ends in the middle of a sample")
        times.append(last_s)
    stream.last_s = last_s
    stream.parts.append(np.array(times, np.float64))


def _length(file: BinaryIO) -> int | None:
    """Return a length as XDF writes it: its width in bytes, then itself; None at the end."""
    width = file.read(1)
    if not width:
        return None
    if width[0] not in (1, 4, 8):
        raise _DamageError(f"byte {file.tell() - 1} is no length")
    number = file.read(width[0])
    if len(number) < width[0]:
        return None
    return int.from_bytes(number, "little")


# ---- clocks --------------------------------------------------------------------------------------


def on_common_clock(stream: XdfTimes) -> tuple[Times, tuple[ClockSegment, ...]]:
    """Return a stream's stamps (n,) on the recorder's clock, and its clock's segments.

    A segment ends where the sender's clock was reset. Its offsets are fitted by a line that
    outlying exchanges do not move, and the line goes on where exchanges are missing.
    """
    own_s = stream.own_s
    out = own_s.copy()
    fits = [_fit(np.array(part)) for part in _exchange_parts(stream.exchanges)]
    segments = []
    for first, after, fit in _fits_of_parts(own_s, fits):
        if fit is None:
            segments.append(ClockSegment(first, after))
            continue
        own = own_s[first:after]
        out[first:after] = own + fit.offset_s + fit.drift * (own - fit.from_s)
        segments.append(
            ClockSegment(
                first, after, fit.used, fit.outlying, fit.drift * 1e6, fit.from_s, fit.to_s
            )
        )
    return out, tuple(segments)


def _fits_of_parts(
    own_s: Times, fits: Sequence["_Fit"]
) -> Iterator[tuple[int, int, "_Fit | None"]]:
    """Yield parts of the samples (first row, row after) with the fit that belongs to each.

    Parts and fits follow each other where there are as many of both; else a part takes the fit
    whose exchanges are near it in the sender's time, and none that lies a minute away.
    """
    parts = _sample_parts(own_s)
    if len(parts) == len(fits):
        yield from ((first, after, fit) for (first, after), fit in zip(parts, fits, strict=True))
        return
    for first, after in parts:
        own = own_s[first:after]
        if len(fits) < 2 and len(parts) < 2:
            yield first, after, fits[0] if fits else None
            continue
        if not fits:
            yield first, after, None
            continue
        away = np.stack([np.maximum(f.from_s - own, own - f.to_s) for f in fits])
        nearest = np.where(away.min(axis=0) > MAX_AWAY_S, -1, away.argmin(axis=0))
        edges = np.flatnonzero(np.diff(nearest)) + 1
        for low, high in pairwise((0, *edges.tolist(), len(own))):
            which = int(nearest[low])
            yield first + low, first + high, fits[which] if which >= 0 else None


@dataclass(frozen=True)
class _Fit:
    offset_s: float
    drift: float
    from_s: float
    to_s: float
    used: int
    outlying: int


def _exchange_parts(exchanges: list[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """Part exchanges where the sender's clock was reset: its time goes back, or offsets jump.

    One exchange that jumps and comes back is no reset; it is rejected later.
    """
    parts: list[list[tuple[float, float]]] = []
    for i, (at_s, by_s) in enumerate(exchanges):
        if parts:
            last_at, last_by = parts[-1][-1]
            allowed_s = RESET_S + MAX_DRIFT * abs(at_s - last_at)
            jumps = at_s < last_at or abs(by_s - last_by) > allowed_s
            following = exchanges[i + 1] if i + 1 < len(exchanges) else None
            comes_back = following is not None and (
                following[0] >= last_at
                and abs(following[1] - last_by) <= RESET_S + MAX_DRIFT * abs(following[0] - last_at)
            )
            if not jumps or (comes_back and at_s >= last_at):
                if not jumps:
                    parts[-1].append((at_s, by_s))
                continue
        parts.append([(at_s, by_s)])
    return parts


def _fit(exchanges: Times) -> _Fit:
    """Fit offsets by a line: median of slopes, then least squares without what lies far from it."""
    at_s, by_s = exchanges.T
    x = at_s - at_s[0]
    slope = 0.0
    if len(x) > 2 and np.ptp(x) > 0:
        half = len(x) // 2
        run = x[half : 2 * half] - x[:half]
        rise = by_s[half : 2 * half] - by_s[:half]
        slope = float(np.median(rise[run > 0] / run[run > 0])) if (run > 0).any() else 0.0
    away = by_s - slope * x
    away = away - np.median(away)
    limit_s = max(MIN_OUTLYING_S, OUTLYING_SPREADS * 1.4826 * float(np.median(np.abs(away))))
    fits = np.abs(away) <= limit_s
    if fits.sum() > 1 and np.ptp(x[fits]) > 0:
        slope, offset = np.polyfit(x[fits], by_s[fits], 1)
    else:
        slope, offset = 0.0, float(np.median(by_s))
    fit_count = int(fits.sum())
    lasts = at_s[fits]
    return _Fit(
        float(offset),
        float(slope),
        float(at_s[0]),
        float(lasts.max()) if fit_count else float(at_s[-1]),
        fit_count,
        len(x) - fit_count,
    )


def whole_ns(times_s: Times) -> npt.NDArray[np.int64]:
    """Return times in whole nanoseconds; what lies beyond int64, or is none, at its bounds."""
    bounded = np.clip(np.nan_to_num(times_s), -MAX_CLOCK_S, MAX_CLOCK_S)
    out: npt.NDArray[np.int64] = np.rint(bounded * NS_PER_S).astype(np.int64)
    return out


def _sample_parts(own_s: Times) -> list[tuple[int, int]]:
    """Return first row and row after each part between restarts of the sender's clock."""
    if not len(own_s):
        return []
    edges = [0, *time_returns(whole_ns(own_s)).restarts, len(own_s)]
    return list(pairwise(edges))
