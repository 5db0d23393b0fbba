"""Google's vibrotactile boards as their wires show them.

Written against google/audio-to-tactile: the sleeve firmware's message handler and serial reader,
the slim board's Bluetooth LE handler (checksum over one whole packet, patterns only) and
tactile_pattern.h. Not modelled: microphone and tactile processor, equaliser, limiter, fades of
20 ms, the channel map (channels are taken as they are numbered), overheating, the wait after a
serial time-out.
"""

import struct
from typing import Any

from visavis.devices.sim.bands.peer import BandPeer
from visavis.lab.clock import NS_PER_MS

TACTORS = 12
FRAME_NS = 4_096_000
TELL_NS = 2500 * NS_PER_MS
TONES_HZ = (25, 30, 35, 45, 50, 60, 70, 90, 100, 125, 150, 175, 200, 250, 300, 350)


class SleeveSimulator(BandPeer):
    """The sleeve on its serial port: it repeats its last buffer until another comes.

    A tactor's level is half the swing of its 8 samples, as a share of the range. It asks for
    more samples with single bytes once per buffer while `asks_for_more`.
    """

    asks_for_more = True

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, motor_count=TACTORS, **kwargs)
        self._buffer = b""
        self._samples = bytes(96)
        self.amplifiers_on = False
        self._next_ns = self._origin_ns + FRAME_NS

    def due_ns(self) -> int | None:
        """Return the end of the buffer being played."""
        return self._next_ns if self.asks_for_more else None

    def act(self, t_ns: int) -> None:
        """Play the buffer again and ask for more."""
        self._next_ns = t_ns + FRAME_NS
        self.say(bytes((23,)), t_ns)

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take whole messages for the sleeve; other bytes are dropped."""
        self._buffer += data
        while self._buffer:
            start = self._buffer.find(b"\xc8")
            if start < 0:
                self._buffer = b""
                return
            self._buffer = self._buffer[start:]
            if len(self._buffer) < 4:
                return
            _, recipient, kind, size = self._buffer[:4]
            if size > 128:
                self._buffer = self._buffer[1:]
                continue
            if len(self._buffer) < 4 + size:
                return
            payload, self._buffer = self._buffer[4 : 4 + size], self._buffer[4 + size :]
            if recipient in (1, 3):
                self._obey(kind, payload, t_ns)

    def _obey(self, kind: int, payload: bytes, t_ns: int) -> None:
        if kind == 14:
            self.amplifiers_on = False
        elif kind == 15:
            self.amplifiers_on = True
        elif kind == 17 and len(payload) == 96:
            self._samples = payload
        self._vibrate(t_ns)

    def _vibrate(self, t_ns: int) -> None:
        if not self.amplifiers_on:
            self.set_levels((0.0,) * TACTORS, t_ns)
            return
        tactors = [self._samples[c::TACTORS] for c in range(TACTORS)]
        self.set_levels([(max(t) - min(t)) / 255 for t in tactors], t_ns)


class SlimBoardSimulator(BandPeer):
    """The slim board over Bluetooth LE; each `receive` is one packet, as its firmware wants.

    `log` follows the pattern; `tones_hz` is what every channel plays (0 none). Battery and
    temperature come every 2.5 s.
    """

    battery_v = 3.9
    temperature_c = 31.5

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, motor_count=TACTORS, **kwargs)
        self._plan: list[tuple[int, tuple[float, ...], tuple[float, ...]]] = []
        self._tell_at_ns = self._origin_ns + TELL_NS
        self.tones_hz: tuple[float, ...] = (0.0,) * TACTORS
        self.invalid = 0

    def due_ns(self) -> int | None:
        """Return the next change of a pattern, or the next report."""
        return min(self._plan[0][0], self._tell_at_ns) if self._plan else self._tell_at_ns

    def act(self, t_ns: int) -> None:
        """Go on with the pattern; report."""
        while self._plan and self._plan[0][0] <= t_ns:
            _, levels, self.tones_hz = self._plan.pop(0)
            self.set_levels(levels, t_ns)
        if t_ns >= self._tell_at_ns:
            self._tell_at_ns = t_ns + TELL_NS
            self._tell(28, struct.pack("<f", self.battery_v), t_ns)
            self._tell(16, struct.pack("<f", self.temperature_c), t_ns)

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take one packet if size and checksum are right; drop it otherwise."""
        if len(data) < 4 or len(data) < 4 + data[3] or data[3] > 128 or data[2] < 1:
            self.invalid += 1
            return
        body = data[2 : 4 + data[3]]
        if _fletcher(body) != data[0] + 256 * data[1]:
            self.invalid += 1
            return
        if data[2] == 36:
            self._start(body[2:], t_ns)

    def _start(self, ops: bytes, t_ns: int) -> None:
        waves, gains = [-1] * TACTORS, [0.15] * TACTORS
        at_ns, plan, i = t_ns, [], 0
        while i < len(ops) and ops[i]:
            op = ops[i]
            value = ops[i + 1] if i + 1 < len(ops) else 0
            channel = op & 15
            i += 2
            if op & 0xE0 == 0x80:
                i -= 1
                levels = tuple(g if w >= 0 else 0.0 for w, g in zip(waves, gains, strict=True))
                tones = tuple(float(TONES_HZ[w]) if 0 <= w < 16 else 0.0 for w in waves)
                plan.append((at_ns, levels, tones))
                at_ns += ((op & 31) + 1) * 20 * NS_PER_MS
                waves = [-1] * TACTORS
            elif op == 1:
                waves = [value] * TACTORS
            elif op == 2:
                gains = [value / 255] * TACTORS
            elif op == 3:
                waves[value & 15], waves[value >> 4] = waves[value >> 4], -1
            elif channel < TACTORS and op & 0xF0 == 0xA0:
                waves[channel] = value
            elif channel < TACTORS and op & 0xF0 == 0xB0:
                gains[channel] = value / 255
        plan.append((at_ns, (0.0,) * TACTORS, (0.0,) * TACTORS))
        self._plan = plan
        self.act(t_ns)

    def _tell(self, kind: int, payload: bytes, t_ns: int) -> None:
        body = bytes((kind, len(payload))) + payload
        total = _fletcher(body)
        self.say(bytes((total % 256, total // 256)) + body, t_ns)


def _fletcher(data: bytes) -> int:
    a, b = 1, 0
    for byte in data:
        a += byte
        b += a
    return b % 255 * 256 + a % 255
