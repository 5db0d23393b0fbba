"""Translate between armband messages and bytes of the framed protocol, version 1; pure.

A frame is COBS(type u8, sequence u8, payload, CRC-16/CCITT-FALSE little-endian) and a zero byte,
so any zero resynchronises and a damaged frame fails its CRC, its type or its exact length. Times
are the band's microseconds (u32, wrapping); rates are Hz, amplitudes 0..255 on the wire.
docs/armbands.md has the table. Decoding never raises.
"""

import binascii
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

VERSION = 1
MOTORS = 4
MAX_RAW = 48
"""Bytes of the longest frame before stuffing, far below the 254 of one COBS block."""

HELLO, SET, PATTERN, STOP, PING, ARM = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
REPLY = 0x80
EVENT = 0xF0

OK, NOT_ARMED, BAD_ARGUMENT, TOO_HOT, BATTERY_EMPTY, DISAGREED, RESTING, HELD, BLIND = range(9)
STATUS_TEXTS = (
    "done",
    "refused: not armed",
    "refused: bad argument",
    "refused: too hot",
    "refused: battery empty",
    "silenced: host and band disagreed on what was running",
    "refused: the motors' time is used up",
    "refused: the same setting has held for as long as it may",
    "refused: the skin's temperature cannot be read",
)
COUPLED_DRIVE, SKIN_IS_TOLD = 1, 2
"""Capabilities of a band: rate and amplitude share one drive; the temperature is the skin's."""

COMMAND_BYTES = 12
"""Payload of every command, padded with zeros: with the zero that leads it, a command is as long
as its answer, so that round trips give the band's clock without a bias."""

_SET = struct.Struct("<H8B2x")
_PATTERN = struct.Struct("<5BHH3x")
_ACK = struct.Struct("<IB4BHh")
_HELLO = struct.Struct("<4BH8sIBBHH")
_EVENT = struct.Struct("<BIh")
_MEANINGFUL_BYTES = {HELLO: 1, SET: 10, PATTERN: 9, STOP: 0, PING: 2, ARM: 1}


class Frame(NamedTuple):
    """A whole, undamaged frame."""

    kind: int
    seq: int
    payload: bytes


@dataclass(frozen=True)
class Welcome:
    """The band's answer to HELLO; rates are the range its drive allows."""

    seq: int
    version: int
    motor_count: int
    firmware: tuple[int, int]
    capabilities: int
    serial: str
    device_us: int
    duty_range: tuple[int, int]
    rate_range_hz: tuple[float, float]


class Acknowledgement(NamedTuple):
    """The band's answer to a command: when it was applied and the PWM duties (0..255) then.

    `battery_mv` and `temperature_c` are None when the band cannot measure them; the temperature is
    the skin's where the welcome says `SKIN_IS_TOLD`, else that of the processor's die. A motor
    that waits for its turn to start is reported with the duty that it will have.
    """

    kind: int
    seq: int
    device_us: int
    status: int
    duties: tuple[int, ...]
    battery_mv: int | None = None
    temperature_c: float | None = None


@dataclass(frozen=True)
class BandEvent:
    """A message the band sends unasked; `code` indexes `visavis.devices.contracts.BAND_EVENTS`."""

    seq: int
    code: int
    device_us: int
    value: int


Answer = Welcome | Acknowledgement | BandEvent


def crc16(data: bytes | bytearray) -> int:
    """Return CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF)."""
    return binascii.crc_hqx(data, 0xFFFF)


def encode_frame(kind: int, seq: int, payload: bytes = b"") -> bytes:
    """Return one frame with its closing zero."""
    raw = bytes((kind, seq)) + payload
    raw += crc16(raw).to_bytes(2, "little")
    if len(raw) > MAX_RAW:
        raise ValueError(f"a frame holds at most {MAX_RAW - 4} bytes, not {len(payload)}")
    frame = bytearray()
    for block in raw.split(b"\0"):
        frame.append(len(block) + 1)
        frame += block
    frame.append(0)
    return bytes(frame)


def decode_frame(stuffed_bytes: bytes) -> Frame | None:
    """Return the frame in the bytes between two zeros; None when it is damaged."""
    if 0 in stuffed_bytes:
        return None
    raw = bytearray(stuffed_bytes)
    at, end = 0, len(raw)
    while at < end:
        skip, raw[at] = raw[at], 0
        at += skip
    del raw[:1]
    if at > end or not 4 <= len(raw) <= MAX_RAW or crc16(raw[:-2]) != raw[-2] | raw[-1] << 8:
        return None
    return Frame(raw[0], raw[1], bytes(raw[2:-2]))


class FrameReader:
    """Cut a stream of bytes, however chunked, into frames; damaged ones are only counted."""

    def __init__(self) -> None:
        self._tail = b""
        self.damaged_frame_count = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by these bytes."""
        *pieces, tail = (self._tail + data).split(b"\0")
        self._tail = tail[: MAX_RAW + 2]  # overlong noise stays overlong, not unbounded
        frames = []
        for piece in pieces:
            if not piece:
                continue
            frame = decode_frame(piece)
            if frame is None:
                self.damaged_frame_count += 1
            else:
                frames.append(frame)
        return frames

    def reset(self) -> None:
        """Discard a frame that is only partly received."""
        self._tail = b""


# ---- commands -------------------------------------------------------------------------------


def encode_command(kind: int, seq: int, payload: bytes = b"") -> bytes:
    """Return a command's padded frame; a leading zero ends any noise that came before it."""
    return b"\0" + encode_frame(kind, seq, payload.ljust(COMMAND_BYTES, b"\0"))


def is_command(frame: Frame) -> bool:
    """Tell whether a frame is a command: known type, exact length, zeros for padding."""
    byte_count = _MEANINGFUL_BYTES.get(frame.kind)
    return (
        byte_count is not None
        and len(frame.payload) == COMMAND_BYTES
        and not any(frame.payload[byte_count:])
    )


def encode_hello(seq: int) -> bytes:
    """Return the greeting that starts a connection."""
    return encode_command(HELLO, seq, bytes((VERSION,)))


def encode_set(
    seq: int, ttl_ms: int, amplitudes: Sequence[int], rates_hz: Sequence[int] = (0, 0, 0, 0)
) -> bytes:
    """Return the command that drives all motors; a rate of 0 lets the amplitude decide."""
    pairs = [v for pair in zip(amplitudes, rates_hz, strict=True) for v in pair]
    return encode_command(SET, seq, _SET.pack(ttl_ms, *pairs))


def encode_pattern(
    seq: int,
    pattern: int,
    mask: int,
    amplitude: int,
    low_hz: int,
    high_hz: int,
    *,
    modulation_dhz: int,
    duration_ms: int,
) -> bytes:
    """Return the command that plays a pattern on the band's clock; tenths of Hz, ms."""
    payload = _PATTERN.pack(mask, pattern, amplitude, low_hz, high_hz, modulation_dhz, duration_ms)
    return encode_command(PATTERN, seq, payload)


def encode_stop(seq: int) -> bytes:
    """Return the command that silences every motor."""
    return encode_command(STOP, seq)


def encode_ping(seq: int, running_seq: int | None) -> bytes:
    """Return the keep-alive; it says which command should be running, or None for silence.

    A band that runs anything else falls silent and answers `DISAGREED`.
    """
    return encode_command(PING, seq, bytes((running_seq is not None, running_seq or 0)))


def encode_arm(seq: int, armed: bool) -> bytes:
    """Return the command that allows motors to run, or forbids it."""
    return encode_command(ARM, seq, bytes((armed,)))


def decode_set(payload: bytes) -> tuple[int, tuple[int, ...], tuple[int, ...]]:
    """Return time to live (ms), amplitudes and rates; for the band's side."""
    ttl_ms, *pairs = _SET.unpack(payload)
    return ttl_ms, tuple(pairs[0::2]), tuple(pairs[1::2])


def decode_pattern(payload: bytes) -> tuple[int, int, int, int, int, int, int]:
    """Return mask, pattern, amplitude, low, high, modulation (dHz), duration (ms)."""
    mask, pattern, amplitude, low, high, modulation, duration = _PATTERN.unpack(payload)
    return mask, pattern, amplitude, low, high, modulation, duration


# ---- answers --------------------------------------------------------------------------------


def decode_answer(frame: Frame) -> Answer | None:
    """Return what the band says; None for a type or length the protocol does not know."""
    kind, seq, payload = frame
    if kind == EVENT and len(payload) == _EVENT.size:
        code, device_us, value = _EVENT.unpack(payload)
        return BandEvent(seq, code, device_us, value)
    command = kind ^ REPLY
    if command == HELLO and len(payload) == _HELLO.size:
        version, motors, major, minor, caps, serial, at_us, low, high, slow, fast = _HELLO.unpack(
            payload
        )
        return Welcome(
            seq,
            version,
            motors,
            (major, minor),
            caps,
            serial.rstrip(b"\0").decode("ascii", "replace"),
            at_us,
            (low, high),
            (slow / 10, fast / 10),
        )
    if command not in (SET, PATTERN, STOP, PING, ARM) or len(payload) != _ACK.size:
        return None
    at_us, status, *duties, battery_mv, centi_c = _ACK.unpack(payload)
    return Acknowledgement(
        command,
        seq,
        at_us,
        status,
        tuple(duties),
        battery_mv or None,
        None if centi_c == -(2**15) else centi_c / 100,
    )


def encode_welcome(welcome: Welcome) -> bytes:
    """Return the answer to HELLO; for the band's side."""
    low_hz, high_hz = welcome.rate_range_hz
    payload = _HELLO.pack(
        welcome.version,
        welcome.motor_count,
        *welcome.firmware,
        welcome.capabilities,
        welcome.serial.encode("ascii"),
        welcome.device_us,
        *welcome.duty_range,
        round(low_hz * 10),
        round(high_hz * 10),
    )
    return encode_frame(HELLO | REPLY, welcome.seq, payload)


def encode_acknowledgement(ack: Acknowledgement) -> bytes:
    """Return the answer to any other command; for the band's side."""
    centi_c = -(2**15) if ack.temperature_c is None else round(ack.temperature_c * 100)
    payload = _ACK.pack(ack.device_us, ack.status, *ack.duties, ack.battery_mv or 0, centi_c)
    return encode_frame(ack.kind | REPLY, ack.seq, payload)


def encode_event(event: BandEvent) -> bytes:
    """Return the frame of an event; for the band's side."""
    payload = _EVENT.pack(event.code, event.device_us, event.value)
    return encode_frame(EVENT, event.seq, payload)
