"""Read and write OptiTrack Motive's NatNet messages; pure, `DataError` alone on bad bytes.

Sources: OptiTrack's description of the stream and a public client (TimSchneider42,
python-natnet-client, MIT) that agree. Little-endian; header u16 message, u16 size of what
follows. The layout depends on the protocol version of the server: 3.0 to 4.2 are read here. From
4.1 on every section states its size, so that sections not needed here can be skipped.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from visavis.lab.errors import DataError

CONNECT, SERVER_INFO, REQUEST_MODEL, MODEL, FRAME, KEEP_ALIVE, UNRECOGNISED_REQUEST = (
    0,
    1,
    4,
    5,
    7,
    10,
    100,
)
OLDEST, NEWEST_KNOWN = (3, 0), (4, 2)
SIZED_FROM, ASSETS_FROM, OFFSET_TURN_FROM, MARKER_NAMES_FROM = (4, 1), (4, 1), (4, 2), (4, 0)
RIGID_BODY = struct.Struct("<i3f4ffh")
MOST = 10_000
"""A message that counts more items than this is taken as damaged."""

Version = tuple[int, int]


@dataclass(frozen=True)
class Server:
    """Who streams: its program, versions, and the ticks per second of its time stamps."""

    program: str
    program_version: str
    version: Version
    clock_hz: int
    data_port: int
    multicast: str


@dataclass(frozen=True, slots=True)
class RigidBody:
    """One body: metres, quaternion (x, y, z, w) as sent."""

    number: int
    position: tuple[float, float, float]
    turn_xyzw: tuple[float, float, float, float]
    is_tracked: bool


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: rigid bodies by id, bones by (skeleton, id), ticks of the middle exposure."""

    number: int
    bodies: Mapping[int, RigidBody]
    bones: Mapping[tuple[int, int], RigidBody]
    exposure_ticks: int
    models_changed: bool


@dataclass(frozen=True)
class Models:
    """Names: rigid body -> id, (skeleton, bone) -> (skeleton id, bone id)."""

    bodies: Mapping[str, int] = field(default_factory=dict)
    bones: Mapping[tuple[str, str], tuple[int, int]] = field(default_factory=dict)


class _Reader:
    """Step through a message; a read beyond its end raises DataError."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.at = 0

    def take(self, shape: struct.Struct) -> tuple[Any, ...]:
        end = self.at + shape.size
        if end > len(self._data):
            raise DataError(f"NatNet message ends at {len(self._data)}, before byte {end}")
        values = shape.unpack_from(self._data, self.at)
        self.at = end
        return values

    def integer(self) -> int:
        return int(self.take(_I32)[0])

    def count(self) -> int:
        n = self.integer()
        if not 0 <= n <= MOST:
            raise DataError(f"NatNet message counts {n} things at byte {self.at - 4}")
        return n

    def skip(self, n_bytes: int) -> None:
        if n_bytes < 0 or self.at + n_bytes > len(self._data):
            raise DataError(f"NatNet section of {n_bytes} bytes runs over the message")
        self.at += n_bytes

    def text(self) -> str:
        end = self._data.find(b"\0", self.at)
        if end < 0:
            raise DataError(f"NatNet name at byte {self.at} has no end")
        name = self._data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return name


_I32 = struct.Struct("<i")
_HEADER = struct.Struct("<HH")
_SERVER = struct.Struct("<256s4B4B")
_SERVER_CLOCK = struct.Struct("<QHB4B")
_SUFFIX = struct.Struct("<IIdQQQ")
_PRECISION = struct.Struct("<II")
_FLAGS = struct.Struct("<H")
_DESCRIPTION = struct.Struct("<ii3f")
_BODY = RIGID_BODY


def encode(message: int, payload: bytes = b"") -> bytes:
    """Return a message with its header."""
    return _HEADER.pack(message, len(payload)) + payload


def split_message(data: bytes) -> tuple[int, bytes]:
    """Return message number and payload; raises DataError when the size does not fit."""
    if len(data) < _HEADER.size:
        raise DataError(f"NatNet message of {len(data)} bytes")
    message, size = _HEADER.unpack_from(data)
    if size != len(data) - _HEADER.size:
        raise DataError(f"NatNet message says {size} bytes and has {len(data) - _HEADER.size}")
    return message, data[_HEADER.size :]


def decode_server(payload: bytes) -> Server:
    """Read message 1; a server before 3.0 has no clock and is refused for its version."""
    reader = _Reader(payload)
    name, *numbers = reader.take(_SERVER)
    program = name.partition(b"\0")[0].decode("utf-8", "replace")
    version = (int(numbers[4]), int(numbers[5]))
    if version < OLDEST:
        return Server(program, _dotted_text(numbers[:4]), version, 0, 0, "")
    clock_hz, port, multicast, *group = reader.take(_SERVER_CLOCK)
    address = _dotted_text(group) if multicast else ""
    return Server(program, _dotted_text(numbers[:4]), version, int(clock_hz), int(port), address)


def decode_models(payload: bytes, version: Version) -> Models:
    """Read message 5: the names of rigid bodies, skeletons and their bones.

    Before 4.1 sections state no size, so reading ends at the first section not needed here.
    """
    reader = _Reader(payload)
    bodies: dict[str, int] = {}
    bones: dict[tuple[str, str], tuple[int, int]] = {}
    for _ in range(reader.count()):
        kind = reader.integer()
        end = None
        if version >= SIZED_FROM:
            size = reader.integer()
            end = reader.at + size
        if kind == 0:
            reader.text()
            for _ in range(reader.count()):
                reader.text()
        elif kind == 1:
            name, number = _description(reader, version)
            bodies[name] = number
        elif kind == 2:
            skeleton, number = reader.text(), reader.integer()
            for _ in range(reader.count()):
                bone, bone_number = _description(reader, version)
                bones[skeleton, bone] = (number, bone_number)
        elif end is None:
            break
        if end is not None:
            reader.skip(end - reader.at)
    return Models(bodies, bones)


def decode_frame(payload: bytes, version: Version) -> Frame:
    """Read message 7."""
    reader = _Reader(payload)
    number = reader.integer()
    has_sizes = version >= SIZED_FROM

    def section() -> tuple[int, int | None]:
        n = reader.count()
        return n, reader.integer() if has_sizes else None

    def over() -> None:
        """Skip a section that states its size."""
        _, size = section()
        reader.skip(size or 0)

    if has_sizes:
        over()
        over()
    else:
        for _ in range(reader.count()):
            reader.text()
            reader.skip(12 * reader.count())
        reader.skip(12 * reader.count())
    bodies = {}
    for _ in range(section()[0]):
        body = _body(reader)
        bodies[body.number] = body
    bones = {}
    for _ in range(section()[0]):
        skeleton = reader.integer()
        for _ in range(reader.count()):
            bone = _body(reader)
            bones[skeleton, bone.number & 0xFFFF] = bone
    if has_sizes:
        for _ in range(4):  # assets, labelled markers, force plates, devices
            over()
    else:
        reader.skip(26 * reader.count())
        for _ in range(2):
            for _ in range(reader.count()):
                reader.integer()
                for _ in range(reader.count()):
                    reader.skip(4 * reader.count())
    ticks = int(reader.take(_SUFFIX)[3])
    if has_sizes:
        reader.take(_PRECISION)
    flags = int(reader.take(_FLAGS)[0])
    return Frame(number, bodies, bones, ticks, bool(flags & 2))


def _body(reader: _Reader) -> RigidBody:
    number, x, y, z, i, j, k, w, _, flags = reader.take(_BODY)
    return RigidBody(int(number), (x, y, z), (i, j, k, w), bool(int(flags) & 1))


def _description(reader: _Reader, version: Version) -> tuple[str, int]:
    name = reader.text()
    number = int(reader.take(_DESCRIPTION)[0])
    if version >= OFFSET_TURN_FROM:
        reader.skip(16)
    markers = reader.count()
    reader.skip(16 * markers)
    if version >= MARKER_NAMES_FROM:
        for _ in range(markers):
            reader.text()
    return name, number


def _dotted_text(numbers: Sequence[int]) -> str:
    return ".".join(str(n) for n in numbers)
