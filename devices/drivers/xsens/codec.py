"""Read the datagrams of Xsens MVN's network streamer; pure, never raises on bad bytes.

Sources: public parsers of the protocol that agree (document MV0305P describes it). Big-endian;
header of 24 bytes: "MXTP" and a two-digit type, sample counter u32, datagram counter u8 (bit 7:
last of the sample), items u8, time code ms u32, character u8, body segments u8, props u8, finger
segments u8, reserved u16, payload size u16. Type 02: per segment id i32, position m, quaternion
(w, x, y, z). MVN's world is right-handed, z up, x the way a T-pose faces.
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

Flags = npt.NDArray[np.bool_]

HEADER = struct.Struct(">6sIBBIBBBBHH")
QUATERNIONS = b"MXTP02"
SEGMENT_DTYPE = np.dtype([("id", ">i4"), ("position", ">f4", (3,)), ("turn", ">f4", (4,))])
LAST_DATAGRAM = 0x80
MAX_PENDING = 8

SEGMENT_OF_ID = {
    1: "hips",
    2: "spine",
    4: "chest",
    5: "upper_chest",
    6: "neck",
    7: "head",
    **{
        first + i: f"{side}_{part}"
        for first, side, parts in (
            (8, "right", ("shoulder", "upper_arm", "lower_arm", "hand")),
            (12, "left", ("shoulder", "upper_arm", "lower_arm", "hand")),
            (16, "right", ("upper_leg", "lower_leg", "foot", "toes")),
            (20, "left", ("upper_leg", "lower_leg", "foot", "toes")),
        )
        for i, part in enumerate(parts)
    },
}
"""MVN's 23 body segments by id; L3 (id 3) has no joint of its own in our skeleton."""

SEGMENTS = tuple(SEGMENT_OF_ID.values())
BODY_SEGMENTS = 23
_ROW_OF_ID = {number: row for row, number in enumerate(SEGMENT_OF_ID)}
_ROWS = np.array([_ROW_OF_ID.get(number, -1) for number in range(BODY_SEGMENTS + 1)])
UNIT_WITHIN = 1e-2


@dataclass(frozen=True)
class Datagram:
    """One datagram of type 02; `part` counts from 0 within the sample."""

    sample: int
    part: int
    is_last: bool
    time_code_ms: int
    character: int
    items: bytes


@dataclass(frozen=True, eq=False)
class Pose:
    """A whole sample in our frame: (n, 3), (n, 4), (n,), n = len(SEGMENTS)."""

    sample: int
    time_code_ms: int
    position_m: Vector
    orientation_wxyz: Vector
    valid: Flags


def decode_datagram(data: bytes) -> Datagram | str | None:
    """Return a datagram of quaternions, the type of another one, or None when malformed."""
    if len(data) < HEADER.size or data[:4] != b"MXTP" or not data[4:6].isdigit():
        return None
    kind, sample, counter, items, time_ms, character, *_, size = HEADER.unpack_from(data)
    if kind != QUATERNIONS:
        return str(kind.decode("ascii"))
    payload = data[HEADER.size :]
    if len(payload) != items * SEGMENT_DTYPE.itemsize or size not in (0, len(payload)):
        return None
    return Datagram(
        sample, counter & 0x7F, bool(counter & LAST_DATAGRAM), time_ms, character, payload
    )


class Assembler:
    """Put the datagrams of a sample together, in any order of arrival.

    `incomplete` counts samples given up because a part never came.
    """

    def __init__(self) -> None:
        self.incomplete = 0
        self._pending: dict[int, dict[int, Datagram]] = {}

    def add(self, datagram: Datagram) -> Pose | None:
        """Take one; return the pose when it completes a sample."""
        if datagram.is_last and datagram.part == 0:
            return decode_pose(datagram.sample, datagram.time_code_ms, datagram.items)
        parts = self._pending.setdefault(datagram.sample, {})
        parts[datagram.part] = datagram
        last = next((p.part for p in parts.values() if p.is_last), None)
        if last is not None and all(i in parts for i in range(last + 1)):
            del self._pending[datagram.sample]
            items = b"".join(parts[i].items for i in range(last + 1))
            return decode_pose(datagram.sample, datagram.time_code_ms, items)
        while len(self._pending) > MAX_PENDING:
            del self._pending[next(iter(self._pending))]
            self.incomplete += 1
        return None


def decode_pose(sample: int, time_code_ms: int, items: bytes) -> Pose:
    """Return the pose of whole items; absent or malformed segments are NaN and not valid."""
    rows = np.frombuffer(items, SEGMENT_DTYPE)
    n = len(SEGMENTS)
    position = np.full((n, 3), np.nan)
    turn = np.full((n, 4), np.nan)
    valid = np.zeros(n, np.bool_)
    ids = rows["id"].astype(np.int64)
    is_known = (ids >= 1) & (ids <= BODY_SEGMENTS)
    at = _ROWS[np.where(is_known, ids, 0)]
    with np.errstate(invalid="ignore", over="ignore"):
        q = rows["turn"].astype(np.float64)
        p = rows["position"].astype(np.float64)
        length = np.sqrt((q * q).sum(axis=1))
        good = (at >= 0) & (abs(length - 1) < UNIT_WITHIN) & np.isfinite(p).all(axis=1)
    q, p, length, at = q[good], p[good], length[good], at[good]
    position[at] = np.stack((-p[:, 1], p[:, 2], -p[:, 0]), axis=1)
    turn[at] = np.stack((q[:, 0], -q[:, 2], q[:, 3], -q[:, 1]), axis=1) / length[:, None]
    valid[at] = True
    return Pose(sample, time_code_ms, position, turn, valid)
