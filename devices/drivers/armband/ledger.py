"""Rows for the commands of an armband: under way, acknowledged or given up."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from visavis.devices.contracts import BAND, HAPTICS, NO_DEVICE_TIME
from visavis.lab.schema import SampleBatch, empty_values

SET, PATTERN, SILENCE, KEEP_ALIVE = range(4)
"""Codes of `HAPTICS.kind`."""

COLUMNS = 4
NO_PATTERN = 255
NO_VALUES = (math.nan,) * COLUMNS


@dataclass(slots=True)
class Command:
    """One command of ours and what is known about it so far."""

    number: int
    kind: int
    seq: int
    data: bytes
    t_commanded_ns: int
    amplitudes_01: Sequence[float] = ()
    rates_hz: Sequence[float] | None = None
    duration_ms: float = math.nan
    pattern: int = NO_PATTERN
    low_hz: float = math.nan
    modulation_hz: float = math.nan
    t_write_ns: int = 0
    t_sent_ns: int = NO_DEVICE_TIME
    tries: int = 0
    t_host_ns: int = 0
    t_device_ns: int = NO_DEVICE_TIME
    is_acknowledged: bool = False


@dataclass(slots=True)
class PendingRequest:
    """A command without a row of its own, whose answer is waited for."""

    seq: int
    t_write_ns: int = 0
    tries: int = 0
    is_answered: bool = False


@dataclass(frozen=True, slots=True)
class BandRow:
    """One row of the `BAND` stream."""

    t_host_ns: int
    t_device_ns: int
    event: int
    battery_01: float
    electronics_temperature_c: float
    skin_temperature_c: float = math.nan


class DeviceMicros:
    """Unwrap the band's 32-bit microseconds into nanoseconds."""

    def __init__(self) -> None:
        self._last_us: int | None = None

    def unwrap_ns(self, device_us: int) -> int:
        """Return ns that continue over the wrap; a late answer may get an earlier time."""
        last = self._last_us
        if last is None:
            self._last_us = device_us
            return device_us * 1000
        step = (device_us - last + 2**31) % 2**32 - 2**31
        now_us = last + step
        if step > 0:
            self._last_us = now_us
        return now_us * 1000


def command_batch(rows: Sequence[Command], first_seq: int) -> SampleBatch:
    """Return finished commands as samples of `HAPTICS`."""
    # In the order of the columns of `HAPTICS`.
    values = [
        (
            row.number,
            row.kind,
            row.t_commanded_ns,
            row.t_sent_ns,
            row.is_acknowledged,
            _of_motors(row.amplitudes_01),
            NO_VALUES if row.rates_hz is None else _of_motors(row.rates_hz),
            row.duration_ms,
            row.pattern,
            row.low_hz,
            row.modulation_hz,
        )
        for row in rows
    ]
    return SampleBatch(
        HAPTICS,
        np.arange(first_seq, first_seq + len(rows), dtype=np.int64),
        np.array([row.t_device_ns for row in rows], np.int64),
        np.array([row.t_host_ns for row in rows], np.int64),
        np.array(values, HAPTICS.dtype),
    )


def _of_motors(values: Sequence[float]) -> tuple[float, ...]:
    """Return the values of the motors that have columns, NaN where there is no motor."""
    return (*values, *NO_VALUES)[:COLUMNS]


def band_batch(rows: Sequence[BandRow], first_seq: int) -> SampleBatch:
    """Return the band's reports about itself as samples of `BAND`."""
    values = empty_values(BAND, len(rows))
    for name in ("event", "battery_01", "electronics_temperature_c", "skin_temperature_c"):
        values[name] = [getattr(row, name) for row in rows]
    return SampleBatch(
        BAND,
        np.arange(first_seq, first_seq + len(rows), dtype=np.int64),
        np.array([row.t_device_ns for row in rows], np.int64),
        np.array([row.t_host_ns for row in rows], np.int64),
        values,
    )
