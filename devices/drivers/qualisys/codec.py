"""Read and write Qualisys' real-time protocol (QTM RT 1.24, little-endian); pure.

Sources: Qualisys' own client qtm-rt 3.1 (qualisys/qualisys_python_sdk, MIT) for packets and
components; its C++ SDK's settings (qualisys_cpp_sdk) for the XML. The nine numbers of a rotation
are its columns, one after another, as public clients of the C++ SDK map them.
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree

from visavis.lab.errors import DataError

ERROR, COMMAND, XML, DATA, NO_MORE_DATA, EVENT = 0, 1, 2, 3, 4, 6
"""Kinds of packets."""
SIX_D_WITH_RESIDUAL = 11
HEADER = struct.Struct("<II")
"""Size of the packet with its header, and its kind."""
FRAME = struct.Struct("<qII")
"""Time (µs since the measurement began), number of the frame, number of components."""
COMPONENT = struct.Struct("<II")
"""Size with this header, and kind."""
BODIES = struct.Struct("<IHH")
"""Number of bodies; per mille of frames dropped, and of cameras out of step."""
BODY = struct.Struct("<3f9ff")
"""Place (mm), rotation by columns, residual (mm); NaN where the body is not seen."""
MAX_PACKET = 262_144
MAX_STAMP_US = 2**52


class Packet(NamedTuple):
    """One packet of the stream."""

    kind: int
    payload: bytes


@dataclass(frozen=True)
class Frame:
    """A frame's bodies in QTM's order: place (m) and columns of the rotation, as QTM has them."""

    t_us: int
    number: int
    bodies: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]


@dataclass(frozen=True)
class Settings:
    """What QTM states of a project: names of its bodies in order, the upward axis, the rate."""

    names: tuple[str, ...]
    up: str
    rate_hz: float


class PacketReader:
    """Cut a byte stream into packets; an impossible size drops what has come so far."""

    def __init__(self) -> None:
        self.malformed = 0
        self._rest = b""

    def feed(self, chunk: bytes) -> list[Packet]:
        """Return the packets that this chunk completes."""
        self._rest += chunk
        packets = []
        while len(self._rest) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._rest)
            if not HEADER.size <= size <= MAX_PACKET:
                self.malformed += 1
                self._rest = b""
                break
            if len(self._rest) < size:
                break
            packets.append(Packet(kind, self._rest[HEADER.size : size]))
            self._rest = self._rest[size:]
        return packets


def packet(kind: int, payload: bytes) -> bytes:
    """Return a packet with its header."""
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def command(text: str) -> bytes:
    """Return a command."""
    return packet(COMMAND, text.encode() + b"\0")


def text_of(payload: bytes) -> str:
    """Return the text of an answer, an error or an XML packet."""
    return payload.partition(b"\0")[0].decode("utf-8", "replace")


def decode_frame(payload: bytes) -> Frame:
    """Read the bodies of a data packet; raises DataError when it is cut or has none."""
    if len(payload) < FRAME.size:
        raise DataError(f"a QTM frame of {len(payload)} bytes")
    t_us, number, components = FRAME.unpack_from(payload)
    if not 0 <= t_us < MAX_STAMP_US:
        raise DataError(f"a QTM frame at {t_us} µs")
    at = FRAME.size
    for _ in range(components):
        if at + COMPONENT.size > len(payload):
            break
        size, kind = COMPONENT.unpack_from(payload, at)
        if size < COMPONENT.size or at + size > len(payload):
            break
        if kind == SIX_D_WITH_RESIDUAL:
            return Frame(t_us, number, _bodies(payload[at + COMPONENT.size : at + size]))
        at += size
    raise DataError("a QTM frame without 6DOF bodies, or one that is cut")


def decode_settings(xml: str) -> Settings:
    """Read the XML of the parameters general, 3d and 6d; raises DataError when it is not XML."""
    try:
        root = ElementTree.fromstring(xml)  # noqa: S314 - of a computer in the lab
    except ElementTree.ParseError as cause:
        raise DataError("QTM's parameters are not XML") from cause
    names = tuple((body.findtext("Name") or "").strip() for body in root.iterfind("./The_6D/Body"))
    up = (root.findtext("./The_3D/AxisUpwards") or "").strip()
    try:
        rate_hz = float(root.findtext("./General/Frequency") or "nan")
    except ValueError:
        rate_hz = math.nan
    return Settings(names, up, rate_hz)


def quaternion(columns: tuple[float, ...]) -> tuple[float, float, float, float] | None:
    """Return the unit quaternion (w, x, y, z) of a rotation's columns; None of other numbers."""
    xx, yx, zx, xy, yy, zy, xz, yz, zz = columns
    lengths = (
        xx * xx + yx * yx + zx * zx,
        xy * xy + yy * yy + zy * zy,
        xz * xz + yz * yz + zz * zz,
    )
    if not all(abs(length - 1) < 0.02 for length in lengths):
        return None
    # From the largest of the four numbers, so that nothing is divided by one near zero.
    fours = (xx + yy + zz, xx - yy - zz, yy - xx - zz, zz - xx - yy)
    largest = max(range(4), key=fours.__getitem__)
    r = math.sqrt(max(1e-12, 1 + fours[largest]))
    found = (
        (r, (zy - yz) / r, (xz - zx) / r, (yx - xy) / r),
        ((zy - yz) / r, r, (yx + xy) / r, (xz + zx) / r),
        ((xz - zx) / r, (yx + xy) / r, r, (zy + yz) / r),
        ((yx - xy) / r, (xz + zx) / r, (zy + yz) / r, r),
    )[largest]
    length = math.sqrt(sum(v * v for v in found))
    if not abs(length - 2) < 0.1:
        return None
    w, x, y, z = found
    return w / length, x / length, y / length, z / length


def _bodies(content: bytes) -> tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]:
    if len(content) < BODIES.size:
        raise DataError("QTM's bodies are cut")
    count, *_ = BODIES.unpack_from(content)
    if len(content) != BODIES.size + count * BODY.size:
        raise DataError(f"{count} bodies of QTM in {len(content)} bytes")
    bodies = []
    for i in range(count):
        x, y, z, *numbers = BODY.unpack_from(content, BODIES.size + i * BODY.size)
        bodies.append(((x * 1e-3, y * 1e-3, z * 1e-3), tuple(numbers[:9])))
    return tuple(bodies)


EVENT_TEXTS: Mapping[int, str] = {
    4: "QTM stopped its measurement",
    2: "QTM's cameras were disconnected",
    12: "QTM was closed",
}
"""Events after which nothing more comes."""
