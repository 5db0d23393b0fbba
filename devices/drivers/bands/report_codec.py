"""Speak to a band that takes its motors as bytes of a fixed report, over USB; pure.

No public standard describes such a band, so the layout is the laboratory's: a report of
`report_bytes` with an optional fixed start (`prefix`, after the report number of a HID), one byte
per motor from `first_motor_byte`, and, if the firmware knows one, a byte with the time to live in
tens of milliseconds. An input report may carry the battery as a percentage.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from visavis.devices.drivers.bands.language import Condition, Notice, level

TTL_STEP_MS = 10
MAX_REPORT_TTL_MS = 255 * TTL_STEP_MS


@dataclass(frozen=True)
class ReportLayout:
    """Positions in bytes from the start of the report, without its number.

    `report_id` leads every output report of a HID, 0 when they bear no number; None for a
    vendor-class endpoint, which has no such byte.
    """

    report_bytes: int = 8
    report_id: int | None = 0
    prefix: bytes = b""
    first_motor_byte: int = 0
    motor_count: int = 4
    full_scale: int = 255
    ttl_byte: int | None = None
    battery_byte: int | None = None

    def problems(self) -> tuple[str, ...]:
        """Return what does not fit, one sentence each."""
        misfits: list[str] = []
        motors = range(self.first_motor_byte, self.first_motor_byte + self.motor_count)
        if motors.stop > self.report_bytes:
            misfits.append(f"{self.motor_count} motors from byte {motors.start} overrun the report")
        if motors.start < len(self.prefix):
            misfits.append("the prefix overlaps the motors")
        if self.ttl_byte is not None:
            if not len(self.prefix) <= self.ttl_byte < self.report_bytes:
                misfits.append("ttl_byte lies outside the report or in its prefix")
            if self.ttl_byte in motors:
                misfits.append("ttl_byte overlaps the motors")
        return tuple(misfits)


class ReportLanguage:
    """Speak in reports; see `BandLanguage`. One message is one report."""

    answers = False
    rate_range_hz = (math.nan, math.nan)

    def __init__(self, layout: ReportLayout) -> None:
        if problems := layout.problems():
            raise ValueError("; ".join(problems))
        self._layout = layout
        self.unreadable_count = 0
        self.motor_count = layout.motor_count

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return the time to live the report can carry; None when it carries none."""
        return None if self._layout.ttl_byte is None else min(ttl_ms, MAX_REPORT_TTL_MS)

    def opening(self) -> Sequence[bytes]:
        """Return nothing."""
        return ()

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one report."""
        layout = self._layout
        report = bytearray(layout.report_bytes)
        report[: len(layout.prefix)] = layout.prefix
        for i, amplitude in enumerate(amplitudes_01):
            report[layout.first_motor_byte + i] = level(amplitude, layout.full_scale)
        if layout.ttl_byte is not None:
            report[layout.ttl_byte] = min(255, -(-ttl_ms // TTL_STEP_MS))
        number = b"" if layout.report_id is None else bytes((layout.report_id,))
        return (number + bytes(report),)

    def silence(self) -> Sequence[bytes]:
        """Return a report of zeros."""
        return self.drive((0.0,) * self.motor_count, 0)

    def closing(self) -> Sequence[bytes]:
        """Return nothing more than the silence before."""
        return ()

    def inquiry(self) -> Sequence[bytes]:
        """Return nothing: such a band reports by itself."""
        return ()

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return the battery; `data` is one input report, as the links deliver it."""
        at = self._layout.battery_byte
        if at is None:
            return ()
        if at >= len(data) or data[at] > 100:
            self.unreadable_count += 1
            return ()
        return (Condition(battery_01=data[at] / 100),)

    def reset(self) -> None:
        """Do nothing: reports are whole."""
