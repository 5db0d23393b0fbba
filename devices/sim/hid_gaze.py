"""A HID eye tracker of usage page 0x12: descriptor, reports, features.

Written from the HID usage tables and Microsoft's public driver. Not modelled: head position,
capabilities, changes of mode. Linux's own hidraw is tested separately, with umockdev.
"""

import struct
from typing import Unpack

from visavis.devices.contracts import Body
from visavis.devices.drivers.streaming.screen import Screen, Triple
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_S

UNAVAILABLE = 2**31 - 1
REPORT = struct.Struct("<B3xQii3i3i")
SERIAL = "SIM12"
VENDOR_ID, PRODUCT_ID = 0x2104, 0x0124


def _collection(usage: int, kind: int, *items: bytes) -> bytes:
    return bytes((0x09, usage, 0xA1, kind)) + b"".join(items) + b"\xc0"


def _values(*usages: int, size: int = 32, count: int | None = None, item: int = 0x81) -> bytes:
    usage_items = b"".join(struct.pack("<BH", 0x0A, usage) for usage in usages)
    n = len(usages) if count is None else count
    return usage_items + bytes((0x75, size, 0x95, n, item, 0x02))


_PADDING = bytes((0x75, 8, 0x95, 3, 0x81, 0x03))

DESCRIPTOR = b"\x05\x12" + _collection(
    0x01, 0x01,
    _collection(
        0x10, 0x02, b"\x85\x10", _PADDING, _values(0x20, size=8, count=8),
        _collection(0x24, 0x00, _values(0x21, 0x22)),
        _collection(0x25, 0x00, _values(0x21, 0x22, 0x23)),
        _collection(0x26, 0x00, _values(0x21, 0x22, 0x23)),
    ),
    _collection(0x12, 0x02, b"\x85\x12", _values(0x204, 0x205, item=0xB1)),
    _collection(
        0x13, 0x02, b"\x85\x13", _values(0x300, size=16, item=0xB1),
        _values(0x301, size=8, item=0xB1),
    ),
    _collection(0x14, 0x02, b"\x85\x14", _values(0x400, size=8, item=0xB1)),
)  # fmt: skip
"""The report descriptor this tracker gives."""


class HidGazeSimulator(GazePeer):
    """Send tracking reports of a body that looks at a screen; `ticks_per_s` is its clock's unit.

    `status` is the configuration status: 1 ready, 4 calibration needed.
    """

    is_calibrated_before = True

    def __init__(
        self,
        body: Body,
        *,
        screen: Screen | None = None,
        ticks_per_s: int = 1_000_000,
        status: int = 1,
        descriptor: bytes = DESCRIPTOR,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.modes: list[int] = []
        self.descriptor = descriptor
        self._screen = screen or Screen()
        self._ticks_per_s = ticks_per_s
        self._status = status

    def to_message(self, shot: Shot) -> Frames:
        """Return one tracking report."""
        return (self.report(shot) if shot.garbage is None else shot.garbage,)

    def report(self, shot: Shot) -> bytes:
        """Return the 44 bytes of a report."""
        ticks = shot.t_device_ns * self._ticks_per_s // NS_PER_S
        if not (shot.left_seen or shot.right_seen):
            return REPORT.pack(0x10, ticks, *[UNAVAILABLE] * 8)
        eyes: list[int] = []
        for x_m, is_seen in ((-EYE_X_M, shot.left_seen), (EYE_X_M, shot.right_seen)):
            eyes += self._from_top_left_um((x_m, 0.0, 0.0)) if is_seen else [UNAVAILABLE] * 3
        rays = [(-EYE_X_M, shot.left, shot.left_seen), (EYE_X_M, shot.right, shot.right_seen)]
        points = [self._screen.shares_of((x, 0.0, 0.0), ray) for x, ray, is_seen in rays if is_seen]
        x = sum(p[0] for p in points) / len(points)
        y = sum(p[1] for p in points) / len(points)
        if x != x or abs(x) > 100 or abs(y) > 100:
            return REPORT.pack(0x10, ticks, UNAVAILABLE, UNAVAILABLE, *eyes)
        gx, gy = x * self._screen.width_mm * 1e3, y * self._screen.height_mm * 1e3
        return REPORT.pack(0x10, ticks, round(gx), round(gy), *eyes)

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as the host's HID driver does."""
        kind = frames[0]
        if kind == b"descriptor":
            return kind, self.descriptor
        if kind == b"identity":
            return kind, f"Simulated eye tracker\n{SERIAL}".encode()
        if kind.startswith(b"feature:"):
            return kind, self.feature(int(kind.removeprefix(b"feature:"), 16))
        if kind == b"set" and len(frames[1]) > 1:
            self.modes.append(frames[1][1])
        return None

    def feature(self, number: int) -> bytes:
        """Return a feature report; empty for one it has not."""
        if number == 0x12:
            width_um, height_um = self._screen.width_mm * 1e3, self._screen.height_mm * 1e3
            return struct.pack("<BII", 0x12, round(width_um), round(height_um))
        if number == 0x13:
            return struct.pack("<BHB", 0x13, round(self.source.rate_hz), self._status)
        return b""

    def _from_top_left_um(self, at: Triple) -> list[int]:
        x, y, z = self._screen.from_top_left_m(0.0, 0.0)
        return [round((at[0] - x) * 1e6), round((y - at[1]) * 1e6), round((at[2] - z) * 1e6)]
