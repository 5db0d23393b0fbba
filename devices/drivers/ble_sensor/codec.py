"""Read the notifications of sensors on Bluetooth LE; pure, raises only DataError.

Sources: Bluetooth SIG, "Heart Rate Service" 1.0 and its Heart Rate Measurement (0x2A37), which
every chest strap sends; Polar, "Polar Measurement Data Specification" (polarofficial/polar-ble-sdk,
technical_documentation), for the ECG of an H10; layouts of a lab's own by options.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.schema import Field

NAN = math.nan


class Reading(NamedTuple):
    """One row: the sensor's own time (None: it sends none), ns before the arrival, its numbers."""

    t_device_ns: int | None
    before_ns: int
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class Profile:
    """What a sensor sends: its characteristics, what starts it, its columns and their rate.

    `rate_hz` is 0 where a row comes when something happens. `read` returns the rows of one
    notification; it raises DataError for a damaged one.
    """

    notify_uuid: str
    columns: tuple[Field, ...]
    read: Callable[[bytes], Sequence[Reading]]
    rate_hz: float = 0.0
    write_uuid: str = ""
    hello: bytes = b""


# ---- heart rate ---------------------------------------------------------------------------

RATE_IS_16_BIT, SKIN_CONTACT, TELLS_CONTACT, HAS_ENERGY, HAS_INTERVALS = 1, 2, 4, 8, 16
INTERVAL_NS = NS_PER_S / 1024
"""Unit of the intervals between beats."""


def read_heart_rate(packet: bytes) -> Sequence[Reading]:
    """Return a row per interval between beats in the packet, or one row without an interval.

    Beats come with the packet after them, so that a beat is dated back by the intervals that
    follow it in the same packet.
    """
    if len(packet) < 2:
        raise DataError(f"a heart rate in {len(packet)} bytes")
    flags, at = packet[0], 1
    size = 2 if flags & RATE_IS_16_BIT else 1
    rate = float(int.from_bytes(packet[at : at + size], "little"))
    at += size + (2 if flags & HAS_ENERGY else 0)
    intervals: list[int] = []
    if flags & HAS_INTERVALS:
        raw = packet[at:]
        if not raw or len(raw) % 2:
            raise DataError(f"intervals between beats in {len(raw)} bytes")
        intervals = list(struct.unpack(f"<{len(raw) // 2}H", raw))
    elif len(packet) < at:
        raise DataError(f"a heart rate in {len(packet)} bytes")
    contact = float(bool(flags & SKIN_CONTACT)) if flags & TELLS_CONTACT else NAN
    rate = rate if rate > 0 and contact != 0 else NAN
    if not intervals:
        return (Reading(None, 0, (rate, NAN, contact)),)
    rows = []
    for i, interval in enumerate(intervals):
        before_ns = round(sum(intervals[i + 1 :]) * INTERVAL_NS)
        rows.append(Reading(None, before_ns, (rate, interval * 1000 / 1024, contact)))
    return rows


HEART_RATE = Profile(
    notify_uuid="00002a37-0000-1000-8000-00805f9b34fb",
    columns=(
        Field("heart_rate", "f4", "/min", description="beats; NaN without contact to the skin"),
        Field("interval_ms", "f4", "ms", description="between two beats; NaN if none was sent"),
        Field("contact_01", "f4", "1", description="1 on skin, 0 not; NaN if it does not say"),
    ),
    read=read_heart_rate,
)

# ---- Polar's ECG ---------------------------------------------------------------------------

ECG, CONTROL_ANSWER = 0x00, 0xF0
START, SAMPLE_RATE, RESOLUTION = 0x02, 0x00, 0x01
ECG_HZ, ECG_BITS = 130, 14
RAW_FRAME = 0x00
HEAD = struct.Struct("<BQB")
"""Kind of measurement, time of the last sample (ns since 2000), type of the frame."""
ERRORS = {
    1: "invalid command",
    2: "invalid measurement",
    3: "not supported",
    5: "invalid parameter",
    6: "already started",
    8: "invalid sample rate",
    10: "packets of this adapter are too short",
    13: "in its charger",
}
MAX_STAMP_NS = 2**62
ALREADY_STARTED = 6

START_ECG = bytes((START, ECG, SAMPLE_RATE, 1)) + struct.pack("<H", ECG_HZ)
START_ECG += bytes((RESOLUTION, 1)) + struct.pack("<H", ECG_BITS)


def read_polar_ecg(packet: bytes) -> Sequence[Reading]:
    """Return the samples of one packet; none of an answer that says that the ECG was started."""
    if packet[:1] == bytes((CONTROL_ANSWER,)):
        status = packet[3] if len(packet) > 3 else -1
        if status in (0, ALREADY_STARTED):
            return ()
        raise DataError(f"the strap refuses to send its ECG: {ERRORS.get(status, status)}")
    if len(packet) < HEAD.size:
        raise DataError(f"an ECG in {len(packet)} bytes")
    kind, last_ns, frame_type = HEAD.unpack_from(packet)
    raw = packet[HEAD.size :]
    if kind != ECG or frame_type != RAW_FRAME or len(raw) % 3 or last_ns >= MAX_STAMP_NS:
        raise DataError(f"no ECG: kind {kind}, frame type {frame_type}, {len(raw)} bytes")
    count = len(raw) // 3
    values = [int.from_bytes(raw[i : i + 3], "little", signed=True) for i in range(0, len(raw), 3)]
    return [
        Reading(last_ns - (count - 1 - i) * NS_PER_S // ECG_HZ, 0, (float(value),))
        for i, value in enumerate(values)
    ]


POLAR_ECG = Profile(
    notify_uuid="fb005c82-02e7-f387-1cad-8acd2d8df0c8",
    write_uuid="fb005c81-02e7-f387-1cad-8acd2d8df0c8",
    hello=START_ECG,
    columns=(Field("ecg_uv", "f4", "uV"),),
    read=read_polar_ecg,
    rate_hz=float(ECG_HZ),
)
PROFILES = {"heart_rate": HEART_RATE, "polar_ecg": POLAR_ECG}

# ---- a lab's own layout ----------------------------------------------------------------------


@dataclass(frozen=True)
class Column:
    """Where a number stands in a packet: byte, type ("u1", "i2", "f4", …), factor to its unit."""

    name: str
    at: int
    kind: str
    unit: str = "1"
    factor: float = 1.0
    is_big_endian: bool = False

    def number(self, packet: bytes) -> float:
        """Return the number; raises DataError where the packet ends before it."""
        size = int(self.kind[1:])
        raw = packet[self.at : self.at + size]
        if len(raw) < size:
            raise DataError(f"{self.name} at byte {self.at} of a packet of {len(packet)}")
        order: Literal["big", "little"] = "big" if self.is_big_endian else "little"
        if self.kind[0] == "f":
            code = {4: "f", 8: "d"}[size]
            (value,) = struct.unpack((">" if self.is_big_endian else "<") + code, raw)
            return float(value) * self.factor
        return int.from_bytes(raw, order, signed=self.kind[0] == "i") * self.factor


def own_profile(
    columns: Sequence[Column], notify_uuid: str, write_uuid: str, hello: bytes, rate_hz: float
) -> Profile:
    """Return the profile of a sensor that sends one row per notification."""

    def read(packet: bytes) -> Sequence[Reading]:
        return (Reading(None, 0, tuple(column.number(packet) for column in columns)),)

    fields = tuple(Field(column.name, "f8", column.unit) for column in columns)
    return Profile(notify_uuid, fields, read, rate_hz, write_uuid, hello)
