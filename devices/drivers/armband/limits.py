"""What may be asked of an armband; a wrong command is refused before it reaches the wire."""

import math
from collections.abc import Sequence

from devices.contracts import VibrationPattern
from lab.errors import DeviceError

MAX_PATTERN_MS = 2000
MAX_TTL_MS = 10_000
FASTEST_MODULATION_HZ = 50.0


class Limits:
    """The limits of one band; every method raises DeviceError naming the role."""

    def __init__(self, role: str, motors: int, rate_range_hz: tuple[float, float]) -> None:
        self._role = role
        self._motors = motors
        self.rate_range_hz = rate_range_hz

    def check_setting(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None
    ) -> None:
        """Check one amplitude per motor, a time to live, and one rate per motor if given."""
        self._check_amplitudes(amplitudes_01)
        if not 1 <= ttl_ms <= MAX_TTL_MS:
            raise self._wrong(f"ttl_ms is 1 to {MAX_TTL_MS}, not {ttl_ms}")
        if rates_hz is None:
            return
        if len(rates_hz) != self._motors:
            raise self._wrong(f"{len(rates_hz)} rates for {self._motors} motors")
        for rate in rates_hz:
            self._check_rate(rate)

    def check_pattern(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float
    ) -> None:
        """Check a pattern, the motors it shall play on and its amplitude, above 0."""
        self._check_amplitudes([amplitude_01] * self._motors)
        if not motors or amplitude_01 == 0:
            raise self._wrong("a pattern needs a motor and an amplitude; use silence() for none")
        for motor in motors:
            if not 0 <= motor < self._motors:
                raise self._wrong(f"motors are 0 to {self._motors - 1}, not {motor}")
        if not 1 <= pattern.duration_ms <= MAX_PATTERN_MS:
            raise self._wrong(
                f"a pattern lasts 1 to {MAX_PATTERN_MS} ms, not {pattern.duration_ms}"
            )
        self._check_rate(pattern.low_hz)
        self._check_rate(pattern.high_hz)
        if pattern.low_hz > pattern.high_hz:
            raise self._wrong("low_hz of a pattern must not exceed its high_hz")
        if not 0.1 <= pattern.modulation_hz <= FASTEST_MODULATION_HZ:
            raise self._wrong(
                f"modulation_hz is 0.1 to {FASTEST_MODULATION_HZ:g}, not {pattern.modulation_hz}"
            )

    def _check_amplitudes(self, amplitudes_01: Sequence[float]) -> None:
        if len(amplitudes_01) != self._motors:
            raise self._wrong(f"{len(amplitudes_01)} amplitudes for {self._motors} motors")
        for amplitude in amplitudes_01:
            if not 0 <= amplitude <= 1:
                raise self._wrong(f"an amplitude is 0 to 1, not {amplitude}")

    def _check_rate(self, rate_hz: float) -> None:
        low, high = self.rate_range_hz
        if rate_hz < low or rate_hz > high or not math.isfinite(rate_hz):
            raise self._wrong(f"this band vibrates at {low:g} to {high:g} Hz, not {rate_hz:g}")

    def _wrong(self, text: str) -> DeviceError:
        return DeviceError(text, role=self._role, remedy="correct the command in the experiment")
