"""Translate the bytes of the synchronisation board (firmware/sync_board); pure.

Frames are those of the armband (`visavis.devices.drivers.armband.codec`: COBS, CRC-16, closing
zero). SAMPLES holds the board's microseconds of its first sample (u32, wrapping), the spacing in
microseconds (u16) and twelve samples of three channels (u8): light, sound, motion. ASK, from the
host, is answered by TOLD with the board's microseconds. Messages of the board end with a second
check, CRC-16/ARC of the payload, because sixteen bits alone let one of a million damaged frames
pass. Decoding never raises.
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.devices.drivers.armband.codec import Frame, encode_frame

SAMPLES, ASK, TOLD = 0x41, 0x42, 0x43
CHANNELS = ("light", "sound", "motion")
BLOCK = 12
CHECK_BYTES = 2
MIN_PERIOD_US, MAX_PERIOD_US = 100, 2000
_HEAD = struct.Struct("<IH")
_TIME = struct.Struct("<I")
_SAMPLES_BYTES = _HEAD.size + BLOCK * len(CHANNELS)


def _arc(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_ARC = tuple(_arc(byte) for byte in range(256))


@dataclass(frozen=True, eq=False)
class Samples:
    """A block of samples: `levels` (12, 3), u8; `seq` counts blocks modulo 256."""

    seq: int
    device_us: int
    period_us: int
    levels: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class BoardTime:
    """The board's clock when it answered the question with this number."""

    seq: int
    device_us: int


def encode_ask(seq: int) -> bytes:
    """Return the question for the board's clock, led by a zero against noise before it."""
    return b"\0" + encode_frame(ASK, seq)


def encode_time(board_time: BoardTime) -> bytes:
    """Return the answer to ASK; for the board's side."""
    return encode_frame(TOLD, board_time.seq, _with_check(_TIME.pack(board_time.device_us)))


def encode_samples(samples: Samples) -> bytes:
    """Return a block of samples; for the board's side."""
    head = _HEAD.pack(samples.device_us, samples.period_us)
    return encode_frame(SAMPLES, samples.seq, _with_check(head + samples.levels.tobytes()))


def decode(frame: Frame) -> Samples | BoardTime | None:
    """Return what the board says; None for a type, length or spacing that it does not use."""
    payload = frame.payload[:-CHECK_BYTES]
    if _with_check(payload) != frame.payload:
        return None
    if frame.kind == TOLD and len(payload) == _TIME.size:
        return BoardTime(frame.seq, *_TIME.unpack(payload))
    if frame.kind != SAMPLES or len(payload) != _SAMPLES_BYTES:
        return None
    device_us, period_us = _HEAD.unpack_from(payload)
    if not MIN_PERIOD_US <= period_us <= MAX_PERIOD_US:
        return None
    levels = np.frombuffer(payload, np.uint8, offset=_HEAD.size)
    return Samples(frame.seq, device_us, period_us, levels.reshape(BLOCK, len(CHANNELS)))


def _with_check(payload: bytes) -> bytes:
    """Return the payload with its second check."""
    check = 0
    for byte in payload:
        check = check >> 8 ^ _ARC[(check ^ byte) & 0xFF]
    return payload + check.to_bytes(CHECK_BYTES, "little")
