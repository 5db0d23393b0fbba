"""Translate between Google's open vibrotactile boards (VHP) and their messages; pure.

Source: google/audio-to-tactile, src/cpp/message.* (header, checksum, types), pwm_sleeve.h (order
and scale of samples), tactile_pattern.h (op codes) and the firmware of sleeve and slim board.
Two ways in, because the firmware differs. The sleeve's serial port plays PWM samples: it repeats
its last buffer of 8 samples for every tactor until another arrives, so one cycle of a sine in
the buffer vibrates at 244 Hz for ever, and zeros must be sent on every way out. The slim board's
Bluetooth LE knows patterns only: one says tone and gain of every motor and how long, and ends.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from visavis.devices.drivers.armband.status import charge_01
from visavis.devices.drivers.bands.language import Condition, Notice, level

START = 0xC8
SLEEVE, SLIM_BOARD = 3, 4
HEADER = 4
MAX_PAYLOAD = 128
DISABLE_AMPLIFIERS, ENABLE_AMPLIFIERS, TEMPERATURE, ALL_TACTORS = 14, 15, 16, 17
REQUEST_MORE, BATTERY_VOLTAGE, EX_PATTERN = 23, 28, 36
LAST_TYPE = 36

TACTORS = 12
SAMPLES = 8
MIDDLE = 128
SLEEVE_RATE_HZ = 16e6 / (512 * 2 * 64)
"""One buffer lasts 64 PWM periods of 1024 ticks at 16 MHz."""

OP_END, OP_SET_ALL_GAIN, OP_PLAY, OP_SET_WAVEFORM, OP_SET_GAIN = 0x00, 0x02, 0x80, 0xA0, 0xB0
TONES_HZ = (25, 30, 35, 45, 50, 60, 70, 90, 100, 125, 150, 175, 200, 250, 300, 350)
DEFAULT_TONE_HZ = 125.0
PLAY_STEP_MS, MAX_PLAY_MS = 20, 640


class VhpMessage(NamedTuple):
    """A whole message; `recipient` is 0 over Bluetooth LE."""

    kind: int
    payload: bytes
    recipient: int = 0


def fletcher16(data: bytes, start: int = 1) -> int:
    """Return the Fletcher-16 checksum that begins at `start`, low sum in the low byte."""
    low, high = start, 0
    for byte in data:
        low = (low + byte) % 255
        high = (high + low) % 255
    return high << 8 | low


def encode_serial(kind: int, payload: bytes = b"", recipient: int = SLEEVE) -> bytes:
    """Return a message for the serial port."""
    return bytes((START, recipient, kind, len(payload))) + payload


def encode_ble(kind: int, payload: bytes = b"") -> bytes:
    """Return a message for Bluetooth LE; it must travel in one packet."""
    body = bytes((kind, len(payload))) + payload
    return fletcher16(body).to_bytes(2, "little") + body


def sleeve_samples(amplitudes_01: Sequence[float], channels: Sequence[int]) -> bytes:
    """Return one buffer, (sample, tactor) interleaved; an idle tactor gets zeros.

    A running tactor gets one cycle of a sine around the middle of the PWM's range.
    """
    buffer = bytearray(TACTORS * SAMPLES)
    for amplitude, channel in zip(amplitudes_01, channels, strict=True):
        if amplitude <= 0:
            continue
        swing = min(1.0, amplitude) * (MIDDLE - 1)
        for i in range(SAMPLES):
            value = MIDDLE + swing * math.sin(2 * math.pi * i / SAMPLES)
            buffer[i * TACTORS + channel] = round(value)
    return bytes(buffer)


def ex_pattern(
    amplitudes_01: Sequence[float],
    channels: Sequence[int],
    tones: Sequence[int],
    duration_ms: int,
) -> bytes:
    """Return the op codes that run tones with gains for a time, rounded up to 20 ms.

    After each Play op all channels fall silent unless their waveform is set again.
    """
    gains, waves = bytearray(), bytearray()
    for amplitude, channel, tone in zip(amplitudes_01, channels, tones, strict=True):
        if amplitude > 0:
            gains += bytes((OP_SET_GAIN | channel, level(amplitude, 255)))
            waves += bytes((OP_SET_WAVEFORM | channel, tone))
    ops = bytes((OP_SET_ALL_GAIN, 0)) + gains
    steps = -(-duration_ms // PLAY_STEP_MS)
    while steps > 0 and len(ops) + len(waves) + 2 <= MAX_PAYLOAD:
        now = min(steps, MAX_PLAY_MS // PLAY_STEP_MS)
        ops += waves + bytes((OP_PLAY | now - 1,))
        steps -= now
    return ops + bytes((OP_END,))


def longest_pattern_ms(motors: int) -> int:
    """Return how long `ex_pattern` can run that many motors."""
    room = MAX_PAYLOAD - 3 - 2 * motors
    return room // (2 * motors + 1) * MAX_PLAY_MS


def nearest_tone(rate_hz: float) -> int:
    """Return the index of the tone nearest by ratio."""
    return min(range(len(TONES_HZ)), key=lambda i: abs(math.log(TONES_HZ[i] / rate_hz)))


class VhpReader:
    """Cut bytes, however chunked, into messages; bytes that fit none are skipped and counted.

    `has_checksum` is true for Bluetooth LE, false for serial. On serial the sleeve also sends
    single bytes that ask for more samples; they come out as messages of type 23 without payload.
    """

    def __init__(self, *, has_checksum: bool) -> None:
        self._has_checksum = has_checksum
        self._buffer = bytearray()
        self.unreadable_count = 0

    def feed(self, data: bytes) -> list[VhpMessage]:
        """Return the messages completed by these bytes."""
        self._buffer += data
        return list(self._cut_checked() if self._has_checksum else self._cut_serial())

    def reset(self) -> None:
        """Discard a message that is only partly received."""
        self._buffer.clear()

    def _cut_serial(self) -> Iterator[VhpMessage]:
        buffer = self._buffer
        while buffer:
            if buffer[0] == REQUEST_MORE:
                del buffer[0]
                yield VhpMessage(REQUEST_MORE, b"")
                continue
            if buffer[0] != START:
                self._skip()
                continue
            if len(buffer) < HEADER:
                return
            _, recipient, kind, size = buffer[:HEADER]
            if kind > LAST_TYPE or size > MAX_PAYLOAD or not kind:
                self._skip()
                continue
            if len(buffer) < HEADER + size:
                return
            payload = bytes(buffer[HEADER : HEADER + size])
            del buffer[: HEADER + size]
            yield VhpMessage(kind, payload, recipient)

    def _cut_checked(self) -> Iterator[VhpMessage]:
        buffer = self._buffer
        while len(buffer) >= HEADER:
            kind, size = buffer[2], buffer[3]
            if not 1 <= kind <= LAST_TYPE or size > MAX_PAYLOAD:
                self._skip()
                continue
            if len(buffer) < HEADER + size:
                return
            body = bytes(buffer[2 : HEADER + size])
            if fletcher16(body) != buffer[0] | buffer[1] << 8:
                self._skip()
                continue
            del buffer[: HEADER + size]
            yield VhpMessage(kind, body[2:])

    def _skip(self) -> None:
        del self._buffer[0]
        self.unreadable_count += 1


class _VhpLanguage:
    """The common part of both languages."""

    answers = False

    def __init__(self, channels: Sequence[int], *, has_checksum: bool) -> None:
        self._channels = tuple(channels)
        self._reader = VhpReader(has_checksum=has_checksum)
        self.motor_count = len(self._channels)

    @property
    def unreadable_count(self) -> int:
        """Bytes that fitted no message."""
        return self._reader.unreadable_count

    def inquiry(self) -> Sequence[bytes]:
        """Return nothing: the board reports every few seconds by itself."""
        return ()

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return battery and temperature as they come."""
        notices: list[Notice] = []
        for message in self._reader.feed(data):
            if len(message.payload) != 4:
                continue
            (value,) = struct.unpack("<f", message.payload)
            if not math.isfinite(value):
                continue
            if message.kind == BATTERY_VOLTAGE:
                notices.append(Condition(battery_01=charge_01(round(value * 1000))))
            elif message.kind == TEMPERATURE:
                notices.append(Condition(temperature_c=value))
        return notices

    def reset(self) -> None:
        """Discard a message that is only partly received."""
        self._reader.reset()


class VhpSleeveLanguage(_VhpLanguage):
    """Speak to the sleeve's serial port; see `BandLanguage`. Its rate is 244 Hz and no other."""

    rate_range_hz = (math.nan, math.nan)

    def __init__(self, channels: Sequence[int] = (5, 7, 8, 6), recipient: int = SLEEVE) -> None:
        super().__init__(channels, has_checksum=False)
        self._recipient = recipient

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return None: the firmware repeats its buffer until another comes."""
        return None

    def opening(self) -> Sequence[bytes]:
        """Put zeros in the buffer before the amplifiers are on."""
        return (*self.silence(), encode_serial(ENABLE_AMPLIFIERS, recipient=self._recipient))

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one buffer, and switch the amplifiers on in case that was lost before."""
        samples = sleeve_samples(amplitudes_01, self._channels)
        return (
            encode_serial(ALL_TACTORS, samples, self._recipient),
            encode_serial(ENABLE_AMPLIFIERS, recipient=self._recipient),
        )

    def silence(self) -> Sequence[bytes]:
        """Return a buffer of zeros."""
        return (encode_serial(ALL_TACTORS, bytes(TACTORS * SAMPLES), self._recipient),)

    def closing(self) -> Sequence[bytes]:
        """Switch the amplifiers off, after the zeros."""
        return (encode_serial(DISABLE_AMPLIFIERS, recipient=self._recipient),)


class VhpSlimLanguage(_VhpLanguage):
    """Speak to the slim board over Bluetooth LE; see `BandLanguage`.

    A refresh would fade in again, so a pattern is as long as the time to live.
    """

    rate_range_hz = (float(TONES_HZ[0]), float(TONES_HZ[-1]))

    def __init__(self, channels: Sequence[int] = (0, 2, 4, 8)) -> None:
        super().__init__(channels, has_checksum=True)

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return the time to live, as far as a pattern can be that long."""
        return min(ttl_ms, longest_pattern_ms(self.motor_count))

    def opening(self) -> Sequence[bytes]:
        """Return nothing: the board is ready once it is connected."""
        return ()

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one pattern."""
        rates = (DEFAULT_TONE_HZ,) * self.motor_count if rates_hz is None else rates_hz
        tones = [nearest_tone(rate) for rate in rates]
        ops = ex_pattern(amplitudes_01, self._channels, tones, ttl_ms)
        return (encode_ble(EX_PATTERN, ops),)

    def silence(self) -> Sequence[bytes]:
        """Return a pattern that ends at once."""
        return (encode_ble(EX_PATTERN, bytes((OP_END,))),)

    def closing(self) -> Sequence[bytes]:
        """Return nothing more than the silence before."""
        return ()
