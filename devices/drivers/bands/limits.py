"""Limits of commands to an armband; a wrong one is refused before it reaches the wire."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from visavis.devices.contracts import VibrationPattern
from visavis.lab.errors import DeviceError

MAX_PATTERN_MS = 2000
MAX_TTL_MS = 10_000
MIN_MODULATION_HZ = 0.1
MAX_MODULATION_HZ = 50.0


@dataclass(frozen=True)
class Limits:
    """The limits of one band; every check raises DeviceError naming the role.

    `rate_range_hz` is NaN until the band reports it, and if it takes no rates (`takes_rates`).
    `plays_patterns` is true for a band that makes a pattern's rates itself.
    """

    role: str
    motor_count: int
    rate_range_hz: tuple[float, float]
    takes_rates: bool = True
    plays_patterns: bool = False

    def check_setting(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None
    ) -> None:
        """Check one amplitude per motor, a time to live, and one rate per motor if given."""
        self._check_amplitudes(amplitudes_01)
        if not 1 <= ttl_ms <= MAX_TTL_MS:
            raise self._wrong(f"ttl_ms is 1 to {MAX_TTL_MS}, not {ttl_ms}")
        if rates_hz is None:
            return
        if not self.takes_rates:
            raise self._wrong("this band cannot be told a vibration rate")
        if len(rates_hz) != self.motor_count:
            raise self._wrong(f"{len(rates_hz)} rates for {self.motor_count} motors")
        for rate in rates_hz:
            self._check_rate(rate)

    def check_pattern(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float
    ) -> None:
        """Check a pattern, the motors it plays on and its amplitude, which must be above 0."""
        self._check_amplitudes([amplitude_01] * self.motor_count)
        if not motors or amplitude_01 == 0:
            raise self._wrong("a pattern needs a motor and an amplitude; use silence() for none")
        for motor in motors:
            if not 0 <= motor < self.motor_count:
                raise self._wrong(f"motors are 0 to {self.motor_count - 1}, not {motor}")
        if not 1 <= pattern.duration_ms <= MAX_PATTERN_MS:
            raise self._wrong(
                f"a pattern lasts 1 to {MAX_PATTERN_MS} ms, not {pattern.duration_ms}"
            )
        if self.plays_patterns:
            self._check_rate(pattern.low_hz)
            self._check_rate(pattern.high_hz)
        if not 0 < pattern.low_hz <= pattern.high_hz < math.inf:
            raise self._wrong("low_hz of a pattern is above 0 and must not exceed its high_hz")
        if not MIN_MODULATION_HZ <= pattern.modulation_hz <= MAX_MODULATION_HZ:
            raise self._wrong(
                f"modulation_hz is {MIN_MODULATION_HZ:g} to {MAX_MODULATION_HZ:g}, "
                f"not {pattern.modulation_hz}"
            )

    def _check_amplitudes(self, amplitudes_01: Sequence[float]) -> None:
        if len(amplitudes_01) != self.motor_count:
            raise self._wrong(f"{len(amplitudes_01)} amplitudes for {self.motor_count} motors")
        for amplitude in amplitudes_01:
            if not 0 <= amplitude <= 1:
                raise self._wrong(f"an amplitude is 0 to 1, not {amplitude}")

    def _check_rate(self, rate_hz: float) -> None:
        low, high = self.rate_range_hz
        if rate_hz < low or rate_hz > high or not math.isfinite(rate_hz):
            raise self._wrong(f"this band vibrates at {low:g} to {high:g} Hz, not {rate_hz:g}")

    def _wrong(self, text: str) -> DeviceError:
        return DeviceError(text, role=self.role, remedy="correct the command in the experiment")
