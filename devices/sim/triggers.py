"""Ends of trigger wires: lines that show the last byte, and a LabJack that answers packets.

`log` holds every change of the lines with its session time. Not modelled: the delay of a box or of
USB, lines that a box clears by itself.
"""

from collections.abc import Sequence
from typing import Any

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import Body
from visavis.devices.faults import FaultSchedule
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

USB_NS = NS_PER_MS
FEEDBACK, IO_WRITE, DIRECTION_WRITE = 0xF8, 27, 29


class LinesPeer:
    """Eight lines that show the byte written last. Faults: late_start, disconnect, mute."""

    def __init__(
        self,
        role: str,
        clock: Clock,
        *,
        seed: int = 0,
        body: Body | None = None,
        faults: FaultSchedule | None = None,
    ) -> None:
        self._role = role
        self._faults = faults if faults is not None else FaultSchedule()
        self._origin_ns = clock.now_ns()
        self.log: list[tuple[int, int]] = []
        self.answers: list[Chunk] = []

    def connect(self, t_ns: int) -> None:
        """Take a connection."""
        if self.is_active("disconnect", t_ns) or self.is_active("late_start", t_ns):
            raise DeviceNotFound(f"the simulated {self._role} is not there", remedy="wait for it")

    def accept(self, data: bytes, t_ns: int) -> None:
        """Show the bytes on the lines, one after another."""
        if self.is_active("disconnect", t_ns):
            raise DeviceDisconnected(f"the simulated {self._role} is gone", remedy="wait for it")
        self.receive(data, t_ns)

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take bytes from the host."""
        self.log += [(t_ns, byte) for byte in data]

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Return the answers that have arrived."""
        if self.is_active("disconnect", until_ns):
            raise DeviceDisconnected(f"the simulated {self._role} is gone", remedy="wait for it")
        chunks = [chunk for chunk in self.answers if chunk.t_host_ns <= until_ns]
        self.answers = self.answers[len(chunks) :]
        return chunks

    def is_active(self, kind: str, t_ns: int) -> bool:
        """Tell whether a fault is in force."""
        return self._faults.active(kind, t_ns - self._origin_ns) is not None


class LabJackPeer(LinesPeer):
    """A U3 that understands Feedback with writes of ports, after its User's Guide, 5.2.5."""

    directions = 0

    def receive(self, data: bytes, t_ns: int) -> None:
        """Carry a packet out and answer it; one with a wrong checksum with `B8 B8`."""
        head, body = data[:6], data[6:]
        is_intact = sum(body) == head[4] + 256 * head[5] and head[0] == _sum8(head[1:])
        if not is_intact or head[1] != FEEDBACK or len(body) != 2 * head[2]:
            self._answer(b"\xb8\xb8", t_ns)
            return
        at, error = 1, 0
        while at < len(body) and not error:
            kind, mask, state = body[at], body[at + 1 : at + 4], body[at + 4 : at + 7]
            if kind == 0 and at == len(body) - 1:
                break  # padding of the last word
            if kind == DIRECTION_WRITE:
                self.directions = self.directions & ~mask[1] | state[1] & mask[1]
            elif kind == IO_WRITE:
                if mask[1]:
                    self.log.append((t_ns, state[1]))
            else:
                error = 20  # an unknown IO type
            at += 7
        self._answer(self._packet(bytes((error, 0, body[0], 0))), t_ns)

    def _answer(self, data: bytes, t_ns: int) -> None:
        if not self.is_active("mute", t_ns):
            self.answers.append(Chunk(t_ns + USB_NS, data))

    @staticmethod
    def _packet(body: bytes) -> bytes:
        total = sum(body)
        head = bytes((FEEDBACK, len(body) // 2, 0, total % 256, total // 256))
        return bytes((_sum8(head),)) + head + body


def _sum8(data: bytes) -> int:
    total = sum(data)
    while total > 255:
        total = total % 256 + total // 256
    return total


class XidLinesPeer(LinesPeer):
    """A Cedrus unit whose lines are raised by `mh`; `width_ms` is what `mp` said."""

    def __init__(self, *options: Any, **more: Any) -> None:
        super().__init__(*options, **more)
        self.width_ms = 0
        self._rest = b""

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take commands, however they are cut; other bytes are skipped."""
        self._rest += data
        while len(self._rest) >= 2:
            size = {b"mp": 6, b"mh": 4}.get(self._rest[:2], 1)
            if len(self._rest) < size:
                return
            command, self._rest = self._rest[:size], self._rest[size:]
            number = int.from_bytes(command[2:], "little")
            if command[:2] == b"mp":
                self.width_ms = number
            elif command[:2] == b"mh":
                self.log.append((t_ns, number))
