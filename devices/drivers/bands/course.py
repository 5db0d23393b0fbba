"""What a band driven from this side runs, and what may be asked of it; pure."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from devices.contracts import VibrationPattern
from lab.errors import DeviceError

MAX_TTL_MS = 10_000
MAX_PATTERN_MS = 2000


@dataclass(slots=True)
class Course:
    """What runs: amplitudes as a function of ns since `start_ns`, until `until_ns`."""

    start_ns: int
    until_ns: int
    amplitudes_at: Callable[[int], tuple[float, ...]]
    rates_hz: tuple[float, ...] | None
    changes: bool


@dataclass(frozen=True)
class Limits:
    """What may be asked of a band; the checks raise DeviceError saying what may be."""

    role: str
    motor_count: int
    rate_range_hz: tuple[float, float]

    def check_set(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None
    ) -> None:
        """Check a setting of all motors."""
        self._check_amplitudes(amplitudes_01)
        if not 1 <= ttl_ms <= MAX_TTL_MS:
            raise self._wrong(f"ttl_ms is 1 to {MAX_TTL_MS}, not {ttl_ms}")
        if rates_hz is None:
            return
        low, high = self.rate_range_hz
        if math.isnan(low):
            raise self._wrong("this band cannot be told a vibration rate")
        if len(rates_hz) != self.motor_count:
            raise self._wrong(f"{len(rates_hz)} rates for {self.motor_count} motors")
        for rate in rates_hz:
            if not low <= rate <= high:
                raise self._wrong(f"this band vibrates at {low:g} to {high:g} Hz, not {rate:g}")

    def check_pattern(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float
    ) -> None:
        """Check a pattern and the motors it shall run on."""
        self._check_amplitudes([amplitude_01] * self.motor_count)
        for motor in motors:
            if not 0 <= motor < self.motor_count:
                raise self._wrong(f"motors are 0 to {self.motor_count - 1}, not {motor}")
        if not 1 <= pattern.duration_ms <= MAX_PATTERN_MS:
            raise self._wrong(
                f"a pattern lasts 1 to {MAX_PATTERN_MS} ms, not {pattern.duration_ms}"
            )
        if not 0 < pattern.low_hz <= pattern.high_hz or not 0 < pattern.modulation_hz <= 50:
            raise self._wrong("a pattern has low_hz <= high_hz and modulation_hz up to 50")

    def _check_amplitudes(self, amplitudes_01: Sequence[float]) -> None:
        if len(amplitudes_01) != self.motor_count:
            raise self._wrong(f"{len(amplitudes_01)} amplitudes for {self.motor_count} motors")
        for amplitude in amplitudes_01:
            if not 0 <= amplitude <= 1:
                raise self._wrong(f"an amplitude is 0 to 1, not {amplitude}")

    def _wrong(self, text: str) -> DeviceError:
        return DeviceError(text, role=self.role, remedy="correct the command in the experiment")


def share_01(pattern: VibrationPattern, since_s: float) -> float:
    """Return a pattern's rate at a time as a share of its highest; 0 where `square` is off."""
    low_01 = pattern.low_hz / pattern.high_hz
    if pattern.name == "steady":
        return 1.0
    if pattern.name == "square":
        return 1.0 if (since_s * pattern.modulation_hz) % 1.0 < 0.5 else 0.0
    if pattern.name == "ramp":
        return low_01 + (1 - low_01) * min(1.0, since_s * 1000 / pattern.duration_ms)
    swing = math.sin(2 * math.pi * pattern.modulation_hz * since_s)
    return (1 + low_01) / 2 + (1 - low_01) / 2 * swing
