"""Turn an armband's commands, in the contract's units, into frames, and bytes into answers.

Keeps no time and does no I/O.
"""

from collections.abc import Sequence
from typing import NamedTuple

from visavis.devices.contracts import PATTERN_NAMES, VibrationPattern
from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.codec import Answer

FULL = 255


class Drive(NamedTuple):
    """A setting of the motors: amplitudes 0..1 and rates in Hz (None: amplitude decides)."""

    amplitudes_01: tuple[float, ...]
    rates_hz: tuple[float, ...] | None = None

    @property
    def is_silent(self) -> bool:
        """Tell whether no motor runs."""
        return not any(self.amplitudes_01)


class FramedDialect:
    """Our own protocol with four motors; sequence numbers run 0..255."""

    motor_count = codec.MOTORS

    def __init__(self) -> None:
        self._reader = codec.FrameReader()
        self._unknown = 0

    @property
    def unreadable_count(self) -> int:
        """Frames that failed their check or are unknown."""
        return self._reader.damaged_frame_count + self._unknown

    def greeting(self, seq: int) -> bytes:
        """Return HELLO."""
        return codec.encode_hello(seq)

    def arming(self, seq: int, armed: bool) -> bytes:
        """Return ARM."""
        return codec.encode_arm(seq, armed)

    def set(self, seq: int, drive: Drive, ttl_ms: int) -> bytes:
        """Return SET; a running motor never rounds to off."""
        amplitudes = [_byte(a) for a in drive.amplitudes_01]
        rates = [0] * len(amplitudes)
        if drive.rates_hz is not None:
            rates = [max(1, min(FULL, round(rate))) for rate in drive.rates_hz]
        return codec.encode_set(seq, ttl_ms, amplitudes, rates)

    def pattern(
        self, seq: int, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float
    ) -> bytes:
        """Return PATTERN."""
        return codec.encode_pattern(
            seq,
            PATTERN_NAMES.index(pattern.name),
            sum(1 << motor for motor in set(motors)),
            _byte(amplitude_01),
            round(pattern.low_hz),
            round(pattern.high_hz),
            modulation_dhz=round(pattern.modulation_hz * 10),
            duration_ms=pattern.duration_ms,
        )

    def stop(self, seq: int) -> bytes:
        """Return STOP."""
        return codec.encode_stop(seq)

    def ping(self, seq: int, running_seq: int | None) -> bytes:
        """Return PING."""
        return codec.encode_ping(seq, running_seq)

    def feed(self, data: bytes) -> list[Answer]:
        """Return the answers completed by these bytes."""
        answers: list[Answer] = []
        for frame in self._reader.feed(data):
            answer = codec.decode_answer(frame)
            if answer is None:
                self._unknown += 1
            else:
                answers.append(answer)
        return answers

    def reset(self) -> None:
        """Discard a frame that is only partly received."""
        self._reader.reset()


def _byte(amplitude_01: float) -> int:
    return 0 if amplitude_01 <= 0 else max(1, round(min(1.0, amplitude_01) * FULL))
