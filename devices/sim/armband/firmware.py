"""Behave as our armband's firmware does: the same protocol, limits and dead man, in Python.

Not modelled: bytes per interrupt, EEPROM, brown-out. The C of firmware/armband is the reference;
tests hold both against the same script.
"""

import math
from dataclasses import dataclass, field

from devices.drivers.armband import codec
from devices.drivers.armband.codec import Acknowledgement, BandEvent, Frame, Welcome

DEAD_MAN_US = 250_000
LONGEST_TTL_MS = 10_000
LONGEST_PATTERN_MS = 2000
LOWEST_DUTY, HIGHEST_DUTY = 115, 255
LOWEST_HZ, HIGHEST_HZ = 57, 126
STEADY, SINE, SQUARE, RAMP = range(4)
BOOT, DEAD_MAN, EXPIRED, BATTERY_LOW, BATTERY_GOOD, HOT, COOL, PATTERN_ENDED = range(1, 9)
LOW_MV, GOOD_MV, EMPTY_MV = 3500, 3600, 3300
HOT_CENTI_C, COOL_CENTI_C = 6000, 5500
WRAP_US = 2**32


@dataclass
class Surroundings:
    """What the band's analogue inputs see."""

    battery_mv: int = 3900
    temperature_c: float = 25.0


@dataclass
class _Course:
    """What the motors are doing, and until when."""

    seq: int
    until_us: int
    amplitudes: tuple[int, ...] = (0,) * codec.MOTORS
    rates_hz: tuple[int, ...] = (0,) * codec.MOTORS
    pattern: tuple[int, ...] | None = None
    started_us: int = 0


@dataclass
class ArmbandFirmware:
    """The band's processor; times are its own microseconds, never wrapping inside."""

    surroundings: Surroundings = field(default_factory=Surroundings)
    serial: str = "SIM00001"
    version: int = codec.VERSION

    def __post_init__(self) -> None:
        self._reader = codec.FrameReader()
        self.boot(0)

    def boot(self, now_us: int) -> bytes:
        """Start anew, silent and disarmed; return the message that says so."""
        self._reader.reset()
        self._armed = False
        self._course: _Course | None = None
        self._last: tuple[int, int] | None = None
        self._last_ack = b""
        self._fed_us = now_us
        self._event_seq = 0
        self._is_low = self._is_hot = False
        self.duties: tuple[int, ...] = (0,) * codec.MOTORS
        return self._event(BOOT, now_us, 0)

    def feed(self, data: bytes, now_us: int) -> bytes:
        """Take bytes and return the answers."""
        return b"".join(self._obey(frame, now_us) for frame in self._reader.feed(data))

    def step(self, now_us: int) -> bytes:
        """Let time pass to `now_us`; return what the band says unasked."""
        said = b""
        course = self._course
        if course is not None:
            if now_us - self._fed_us > DEAD_MAN_US:
                self._silence()
                said += self._event(DEAD_MAN, now_us, 0)
            elif now_us >= course.until_us:
                ended = EXPIRED if course.pattern is None else PATTERN_ENDED
                self._silence()
                said += self._event(ended, now_us, course.seq)
            else:
                self.duties = _duties(course, now_us)
        return said + self._look_around(now_us)

    @property
    def is_running(self) -> bool:
        """Tell whether a command drives the motors."""
        return self._course is not None

    def _obey(self, frame: Frame, now_us: int) -> bytes:
        kind, seq, payload = frame
        if not codec.is_command(frame):
            return b""
        self._fed_us = now_us
        if kind == codec.HELLO:
            self._armed = False
            self._silence()
            self._last = None
            return codec.encode_welcome(
                Welcome(
                    seq, self.version, codec.MOTORS, (1, 0), 1, self.serial,
                    now_us % WRAP_US, (LOWEST_DUTY, HIGHEST_DUTY), (LOWEST_HZ, HIGHEST_HZ),
                )
            )  # fmt: skip
        if kind == codec.STOP:
            self._silence()
        elif self._last == (kind, seq):
            return self._last_ack
        status = self._carry_out(kind, seq, payload, now_us)
        room = self.surroundings
        ack = Acknowledgement(
            kind, seq, now_us % WRAP_US, status, self.duties, room.battery_mv, room.temperature_c
        )
        self._last = (kind, seq)
        self._last_ack = codec.encode_acknowledgement(ack)
        return self._last_ack

    def _carry_out(self, kind: int, seq: int, payload: bytes, now_us: int) -> int:
        if kind == codec.ARM:
            if payload[0] > 1:
                return codec.BAD_ARGUMENT
            self._armed = payload[0] == 1
            if not self._armed:
                self._silence()
        elif kind == codec.PING:
            running = self._course
            expected = payload[1] if payload[0] else None
            if running is not None and running.seq != expected:
                self._silence()
                return codec.DISAGREED
        elif kind == codec.SET:
            ttl_ms, amplitudes, rates_hz = codec.decode_set(payload)
            if not 1 <= ttl_ms <= LONGEST_TTL_MS:
                return codec.BAD_ARGUMENT
            if not any(amplitudes):
                self._silence()
                return codec.OK
            return self._run(_Course(seq, now_us + ttl_ms * 1000, amplitudes, rates_hz), now_us)
        elif kind == codec.PATTERN:
            pattern = codec.decode_pattern(payload)
            mask, name, amplitude, low, high, modulation, duration_ms = pattern
            if (
                not 1 <= mask < 2**codec.MOTORS
                or name > RAMP
                or not amplitude
                or not LOWEST_HZ <= low <= high <= HIGHEST_HZ
                or not 1 <= modulation <= 500
                or not 1 <= duration_ms <= LONGEST_PATTERN_MS
            ):
                return codec.BAD_ARGUMENT
            until_us = now_us + duration_ms * 1000
            return self._run(_Course(seq, until_us, pattern=pattern, started_us=now_us), now_us)
        return codec.OK

    def _run(self, course: _Course, now_us: int) -> int:
        if not self._armed:
            return codec.NOT_ARMED
        if self._is_hot:
            return codec.TOO_HOT
        if self.surroundings.battery_mv < EMPTY_MV:
            return codec.BATTERY_EMPTY
        self._course = course
        self.duties = _duties(course, now_us)
        return codec.OK

    def _silence(self) -> None:
        self._course = None
        self.duties = (0,) * codec.MOTORS

    def _look_around(self, now_us: int) -> bytes:
        said = b""
        room = self.surroundings
        if not self._is_low and room.battery_mv < LOW_MV:
            self._is_low = True
            said += self._event(BATTERY_LOW, now_us, room.battery_mv)
        elif self._is_low and room.battery_mv > GOOD_MV:
            self._is_low = False
            said += self._event(BATTERY_GOOD, now_us, room.battery_mv)
        centi_c = round(room.temperature_c * 100)
        if not self._is_hot and centi_c > HOT_CENTI_C:
            self._is_hot = True
            self._silence()
            said += self._event(HOT, now_us, centi_c)
        elif self._is_hot and centi_c < COOL_CENTI_C:
            self._is_hot = False
            said += self._event(COOL, now_us, centi_c)
        return said

    def _event(self, code: int, now_us: int, value: int) -> bytes:
        self._event_seq = (self._event_seq + 1) % 256
        return codec.encode_event(BandEvent(self._event_seq, code, now_us % WRAP_US, value))


def duty_of(amplitude: int, rate_hz: float) -> int:
    """Return the PWM duty of one motor; the drive's range is `LOWEST_DUTY..HIGHEST_DUTY`."""
    if not amplitude:
        return 0
    span = HIGHEST_DUTY - LOWEST_DUTY
    if not rate_hz:
        return LOWEST_DUTY + (amplitude * span + 127) // 255
    hz = min(max(rate_hz, LOWEST_HZ), HIGHEST_HZ)
    return LOWEST_DUTY + round((hz - LOWEST_HZ) * span / (HIGHEST_HZ - LOWEST_HZ))


def rate_of(duty: float) -> float:
    """Return the rate in Hz at which a motor turns at a duty, by the published range."""
    return LOWEST_HZ + (duty - LOWEST_DUTY) * (HIGHEST_HZ - LOWEST_HZ) / (
        HIGHEST_DUTY - LOWEST_DUTY
    )


def _duties(course: _Course, now_us: int) -> tuple[int, ...]:
    if course.pattern is None:
        pairs = zip(course.amplitudes, course.rates_hz, strict=True)
        return tuple(duty_of(amplitude, rate) for amplitude, rate in pairs)
    mask, name, amplitude, low, high, modulation_dhz, duration_ms = course.pattern
    elapsed_us = now_us - course.started_us
    turns = elapsed_us * modulation_dhz / 10_000_000
    on = amplitude
    if name == SINE:
        rate = low + (high - low) * (1 + math.sin(2 * math.pi * turns)) / 2
    elif name == RAMP:
        rate = low + (high - low) * min(1.0, elapsed_us / (duration_ms * 1000))
    else:
        rate = float(high)
        if name == SQUARE and turns % 1 >= 0.5:
            on = 0
    duty = duty_of(on, rate)
    return tuple([duty if mask >> motor & 1 else 0 for motor in range(codec.MOTORS)])
