"""Behave as our armband's firmware does: the same protocol, limits and dead man, in Python.

Not modelled: bytes per interrupt, brown-out, the thermistor's divider. The C of firmware/armband is
the reference; tests hold both against the same script.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.codec import Acknowledgement, BandEvent, Frame, Welcome

DEAD_MAN_US = 250_000
MAX_TTL_MS = 10_000
MAX_PATTERN_MS = 2000
LOWEST_DUTY, HIGHEST_DUTY = 115, 255
LOWEST_HZ, HIGHEST_HZ = 57, 126
STEADY, SINE, SQUARE, RAMP = range(4)
BOOT, DEAD_MAN, EXPIRED, BATTERY_LOW, BATTERY_GOOD, HOT, COOL, PATTERN_ENDED = range(1, 9)
RESTS, RESTED, HELD_TOO_LONG, SENSOR_LOST = range(9, 13)
LOW_MV, GOOD_MV, EMPTY_MV = 3500, 3600, 3300
DIE_HOT_C, DIE_COOL_C = 60.0, 55.0
SKIN_HOT_C, SKIN_COOL_C = 43.0, 41.0
WRAP_US = 2**32
HANG_MAX_US: Final = 150_000
BINS: Final = 25
"""The current bin and the 24 of the window."""
ALL_MOTORS: Final = range(codec.MOTORS)


@dataclass(frozen=True)
class Protection:
    """Limits that protect motors, supply and skin; the values of firmware/armband/config.h."""

    motor_max_mv: int = 3600
    motor_worst_mv: int = 4250
    motor_start_ma: int = 120
    motor_run_ma: int = 80
    current_max_ma: int = 500
    start_ms: int = 50
    stagger_ms: int = 4
    coast_ms: int = 100
    window_ms: int = 120_000
    budget_ms: int = 60_000
    hold_max_ms: int = 20_000
    has_skin_sensor: bool = False

    @property
    def bin_us(self) -> int:
        """How long one bin of the window is."""
        return self.window_ms * 1000 // (BINS - 1)


@dataclass
class Surroundings:
    """Values of the band's analogue inputs; `skin_c` is None without a working thermistor."""

    battery_mv: int = 3900
    temperature_c: float = 25.0
    motor_mv: int = 3300
    skin_c: float | None = None


class _Ledger:
    """For how long each motor was on in the window; a reset does not clear it."""

    def __init__(self) -> None:
        self.bins_us = [[0] * codec.MOTORS for _ in range(BINS)]
        self.spent_us = [0] * codec.MOTORS
        self.at = 0
        self.into_us = 0

    def add(self, duties: tuple[int, ...], elapsed_us: int, bin_us: int) -> None:
        """Add this time to the motors that are on."""
        if any(duties):
            now_us = self.bins_us[self.at]
            for motor in ALL_MOTORS:
                if duties[motor]:
                    now_us[motor] += elapsed_us
                    self.spent_us[motor] += elapsed_us
        self.into_us += elapsed_us
        if self.into_us < bin_us:
            return
        whole_bins, self.into_us = divmod(self.into_us, bin_us)
        for _ in range(min(whole_bins, BINS)):
            self.at = (self.at + 1) % BINS
            gone_us = self.bins_us[self.at]
            for motor in ALL_MOTORS:
                self.spent_us[motor] -= gone_us[motor]
                gone_us[motor] = 0


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
    protection: Protection = field(default_factory=Protection)

    def __post_init__(self) -> None:
        self._reader = codec.FrameReader()
        self._ledger = _Ledger()
        self.duties: tuple[int, ...] = (0,) * codec.MOTORS
        self.boot(0)

    def boot(self, now_us: int) -> bytes:
        """Start anew, silent and disarmed; return the message that says so.

        A program that hung left its motors on until the watchdog reset it; that time counts as on.
        """
        self._ledger.add(self.duties, HANG_MAX_US, self.protection.bin_us)
        self._reader.reset()
        self._armed = False
        self._course: _Course | None = None
        self._last: tuple[int, int] | None = None
        self._last_ack = b""
        self._fed_us = now_us
        self._event_seq = 0
        self._is_low = self._is_hot = self._is_blind = self._is_held = False
        self._held_since_us = self._counted_us = self._last_start_us = now_us
        self._last_setting: tuple[tuple[int, ...], ...] = ()
        self._resting = [False] * codec.MOTORS
        self._stands = [True] * codec.MOTORS
        self._off_since_us = [now_us] * codec.MOTORS
        self._starting_us: dict[int, int] = {}
        self.duties = (0,) * codec.MOTORS
        self.granted_duties = self.duties
        """The duty of each motor once its turn to start has come."""
        return self._event(BOOT, now_us, 0)

    def feed(self, data: bytes, now_us: int) -> bytes:
        """Take bytes and return the answers."""
        return b"".join(self._obey(frame, now_us) for frame in self._reader.feed(data))

    def step(self, now_us: int) -> bytes:
        """Let time pass to `now_us`; return the band's event messages."""
        event_bytes = b""
        self._account(now_us)
        event_bytes += self._look_at_budget(now_us)
        course = self._course
        if course is not None:
            if now_us - self._fed_us > DEAD_MAN_US:
                self._silence()
                event_bytes += self._event(DEAD_MAN, now_us, 0)
            elif now_us >= course.until_us:
                held_us = now_us - self._held_since_us
                reason = EXPIRED if course.pattern is None else PATTERN_ENDED
                if course.pattern is None and held_us >= self.protection.hold_max_ms * 1000:
                    self._is_held, reason = True, HELD_TOO_LONG
                self._silence()
                event_bytes += self._event(reason, now_us, course.seq)
            else:
                self._drive(course, now_us)
        return event_bytes + self._look_around(now_us)

    @property
    def is_running(self) -> bool:
        """Tell whether a command drives the motors."""
        return self._course is not None

    def _obey(self, frame: Frame, now_us: int) -> bytes:
        kind, seq, payload = frame
        if not codec.is_command(frame):
            return b""
        self._fed_us = now_us
        self._account(now_us)
        if kind == codec.HELLO:
            self._armed = False
            self._release()
            self._last = None
            return codec.encode_welcome(
                Welcome(
                    seq,
                    self.version,
                    codec.MOTORS,
                    (1, 1),
                    codec.COUPLED_DRIVE | codec.SKIN_IS_TOLD * self.protection.has_skin_sensor,
                    self.serial,
                    now_us % WRAP_US,
                    (LOWEST_DUTY, HIGHEST_DUTY),
                    (LOWEST_HZ, HIGHEST_HZ),
                )
            )
        if kind == codec.STOP:
            self._release()
        elif self._last == (kind, seq):
            return self._last_ack
        status = self._carry_out(kind, seq, payload, now_us)
        room = self.surroundings
        reported_c = room.skin_c if self.protection.has_skin_sensor else room.temperature_c
        ack = Acknowledgement(
            kind, seq, now_us % WRAP_US, status, self.granted_duties, room.battery_mv, reported_c
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
                self._release()
        elif kind == codec.PING:
            running = self._course
            expected = payload[1] if payload[0] else None
            if running is not None and running.seq != expected:
                self._silence()
                return codec.DISAGREED
        elif kind == codec.SET:
            ttl_ms, amplitudes, rates_hz = codec.decode_set(payload)
            if not 1 <= ttl_ms <= MAX_TTL_MS:
                return codec.BAD_ARGUMENT
            if not any(amplitudes):
                self._release()
                return codec.OK
            status = self._refusal(amplitudes)
            if status != codec.OK:
                return status
            held_us = 0
            if (amplitudes, rates_hz) == self._last_setting:
                if self._is_held:
                    return codec.HELD
                if self._course is not None:
                    held_us = now_us - self._held_since_us
            if not held_us:
                self._held_since_us = now_us
            left_us = self.protection.hold_max_ms * 1000 - held_us
            if left_us <= 0:
                return codec.HELD
            self._last_setting, self._is_held = (amplitudes, rates_hz), False
            until_us = now_us + min(ttl_ms * 1000, left_us)
            return self._run(_Course(seq, until_us, amplitudes, rates_hz), now_us)
        elif kind == codec.PATTERN:
            pattern = codec.decode_pattern(payload)
            mask, name, amplitude, low, high, modulation, duration_ms = pattern
            if (
                not 1 <= mask < 2**codec.MOTORS
                or name > RAMP
                or not amplitude
                or not LOWEST_HZ <= low <= high <= HIGHEST_HZ
                or not 1 <= modulation <= 500
                or not 1 <= duration_ms <= MAX_PATTERN_MS
            ):
                return codec.BAD_ARGUMENT
            status = self._refusal([mask >> motor & 1 for motor in ALL_MOTORS])
            if status != codec.OK:
                return status
            self._last_setting, self._is_held = (), False
            until_us = now_us + duration_ms * 1000
            return self._run(_Course(seq, until_us, pattern=pattern, started_us=now_us), now_us)
        return codec.OK

    def _refusal(self, motors: Sequence[int]) -> int:
        """Return the reason why nothing may run; `motors` are the requested ones."""
        if not self._armed:
            return codec.NOT_ARMED
        if self._is_blind:
            return codec.BLIND
        if self._is_hot:
            return codec.TOO_HOT
        if self.surroundings.battery_mv < EMPTY_MV:
            return codec.BATTERY_EMPTY
        if all(rests or not on for on, rests in zip(motors, self._resting, strict=True)):
            return codec.RESTING
        return codec.OK

    def _run(self, course: _Course, now_us: int) -> int:
        self._course = course
        self._drive(course, now_us)
        return codec.OK

    def _silence(self) -> None:
        self._course = None
        self.duties = self.granted_duties = (0,) * codec.MOTORS

    def _release(self) -> None:
        """Silence on request of the host: the same setting may come again."""
        self._silence()
        self._is_held = False

    def _account(self, now_us: int) -> None:
        self._ledger.add(self.duties, now_us - self._counted_us, self.protection.bin_us)
        self._counted_us = now_us

    def _look_at_budget(self, now_us: int) -> bytes:
        protection = self.protection
        full_us = protection.budget_ms * 1000
        before = sum(rests << motor for motor, rests in enumerate(self._resting))
        for motor, spent_us in enumerate(self._ledger.spent_us):
            if self.duties[motor]:
                self._off_since_us[motor] = now_us
            elif now_us - self._off_since_us[motor] >= protection.coast_ms * 1000:
                self._stands[motor] = True
            if spent_us >= full_us:
                self._resting[motor] = True
            elif spent_us <= full_us - protection.bin_us:
                self._resting[motor] = False
        after = sum(rests << motor for motor, rests in enumerate(self._resting))
        event_bytes = b""
        if after & ~before:
            event_bytes += self._event(RESTS, now_us, after)
        if before & ~after:
            event_bytes += self._event(RESTED, now_us, after)
        return event_bytes

    def _drive(self, course: _Course, now_us: int) -> None:
        protection, supply_mv = self.protection, self.surroundings.motor_mv
        supply_mv = supply_mv or protection.motor_worst_mv
        highest = min(255, 255 * protection.motor_max_mv // supply_mv)
        duties = [
            0 if rests else min(duty, highest)
            for duty, rests in zip(_duties(course, now_us), self._resting, strict=True)
        ]
        self.granted_duties = tuple(duties)
        self._take_turns(duties, now_us)
        full_ma = [
            protection.motor_start_ma if motor in self._starting_us else protection.motor_run_ma
            for motor in ALL_MOTORS
        ]
        needed_duty_ma = sum(duty * ma for duty, ma in zip(duties, full_ma, strict=True))
        available_duty_ma = protection.current_max_ma * 255
        if needed_duty_ma > available_duty_ma:
            duties = [duty * available_duty_ma // needed_duty_ma for duty in duties]
        self.duties = tuple(duties)

    def _take_turns(self, duties: list[int], now_us: int) -> None:
        """Start motors at rest one after the other."""
        protection, starting = self.protection, self._starting_us
        for motor in ALL_MOTORS:
            if now_us - starting.get(motor, now_us) >= protection.start_ms * 1000:
                del starting[motor]
            if not duties[motor] or not self._stands[motor]:
                continue
            if starting and now_us - self._last_start_us < protection.stagger_ms * 1000:
                duties[motor] = 0
                continue
            self._stands[motor] = False
            starting[motor] = self._last_start_us = now_us

    def _look_around(self, now_us: int) -> bytes:
        event_bytes = b""
        room = self.surroundings
        if not self._is_low and room.battery_mv < LOW_MV:
            self._is_low = True
            event_bytes += self._event(BATTERY_LOW, now_us, room.battery_mv)
        elif self._is_low and room.battery_mv > GOOD_MV:
            self._is_low = False
            event_bytes += self._event(BATTERY_GOOD, now_us, room.battery_mv)
        has_skin = self.protection.has_skin_sensor
        is_blind = has_skin and room.skin_c is None
        if is_blind and not self._is_blind:
            self._silence()
            event_bytes += self._event(SENSOR_LOST, now_us, 0)
        self._is_blind = is_blind
        skin_c = room.skin_c if has_skin else None
        skin_is_hot = skin_c is not None and skin_c > SKIN_HOT_C
        is_cool = room.temperature_c < DIE_COOL_C and not is_blind
        if not self._is_hot and (skin_is_hot or room.temperature_c > DIE_HOT_C):
            self._is_hot = True
            self._silence()
            hot_c = skin_c if skin_is_hot and skin_c is not None else room.temperature_c
            event_bytes += self._event(HOT, now_us, round(hot_c * 100))
        elif self._is_hot and is_cool and (skin_c is None or skin_c < SKIN_COOL_C):
            self._is_hot = False
            cool_c = room.temperature_c if skin_c is None else skin_c
            event_bytes += self._event(COOL, now_us, round(cool_c * 100))
        return event_bytes

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
