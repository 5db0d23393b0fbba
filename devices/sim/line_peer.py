"""Common part of simulated devices that send one line of text per sample, at a rate.

Faults: late_start, disconnect, silence, loss, garbage, clock_jump, drift. Lines arrive 2 ms after
their sample. Not modelled: echoes, flow control, a device that waits to be started.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import Body
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.wire_noise import WireNoise
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

WIRE_NS = 2 * NS_PER_MS


class LinePeer(ABC):
    """The `BytePeer` of one device; a subclass sets `rate_hz` and adds `line`.

    Sample k is taken at k / `rate_hz` of the session; the device's own clock began at 0 with it.
    """

    rate_hz = 1.0

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
        self._noise = WireNoise(seed, body)
        self._origin_ns = self._sent_until_ns = clock.now_ns()

    @abstractmethod
    def line(self, t_s: float, t_device_ns: int, rng: np.random.Generator) -> bytes:
        """Return the line of a sample taken at this time of the session, without its end."""

    def connect(self, t_ns: int) -> None:
        """Take a connection; earlier lines are lost."""
        if self._active("disconnect", t_ns) or self._active("late_start", t_ns):
            raise DeviceNotFound(f"the simulated {self._role} is not there", remedy="wait for it")
        self._sent_until_ns = t_ns

    def accept(self, data: bytes, t_ns: int) -> None:  # noqa: B027 - most are told nothing
        """Ignore bytes of the host."""

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Return the lines that have arrived."""
        if self._active("disconnect", until_ns):
            raise DeviceDisconnected(f"the simulated {self._role} is gone", remedy="wait for it")
        chunks = []
        first = int((self._sent_until_ns - WIRE_NS) * self.rate_hz // NS_PER_S) + 1
        last = int((until_ns - WIRE_NS) * self.rate_hz // NS_PER_S)
        for number in range(max(first, 0), last + 1):
            t_ns = round(number * NS_PER_S / self.rate_hz)
            if not self._active("silence", t_ns):
                chunks += self._line_chunks(t_ns)
        self._sent_until_ns = max(self._sent_until_ns, until_ns)
        return chunks

    def quiet_until_ns(self, now_ns: int) -> int:
        """Return the earliest arrival of the next line."""
        number = int((now_ns - WIRE_NS) * self.rate_hz // NS_PER_S) + 1
        return max(now_ns, round(number * NS_PER_S / self.rate_hz) + WIRE_NS)

    def _line_chunks(self, t_ns: int) -> list[Chunk]:
        rng = self._noise.rng()
        lost_01, noise_01 = rng.random(2)
        data = self.line(t_ns / NS_PER_S, self._device_ns(t_ns), rng) + b"\r\n"
        loss, garbage = self._amount("loss", t_ns), self._amount("garbage", t_ns)
        if garbage is not None and noise_01 < garbage:
            data = rng.bytes(len(data) - 2).replace(b"\n", b" ").replace(b"\r", b" ") + b"\r\n"
        return [] if loss is not None and lost_01 < loss else [Chunk(t_ns + WIRE_NS, data)]

    def _device_ns(self, t_ns: int) -> int:
        since_ns = t_ns - self._origin_ns
        return since_ns + self._faults.clock_error_ns(since_ns)

    def _active(self, kind: str, t_ns: int) -> bool:
        return self._amount(kind, t_ns) is not None

    def _amount(self, kind: str, t_ns: int) -> float | None:
        fault = self._faults.active(kind, t_ns - self._origin_ns)
        return None if fault is None else fault.amount
