"""Simulate an armband at its wire: link delays and faults, firmware, motors with inertia.

A virtual clock drives it through `visavis.devices.byte_links.MemoryLink`; for tests
`tests/devices/wire_ends/armband_pty.py` hosts the same on a pseudo-terminal. Motors follow their
drive with a first-order lag; not modelled: skin and strap, motor spread, magnetic coupling, radio
collisions.
"""

import math
import zlib
from collections import deque
from collections.abc import Sequence

import numpy as np

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import MovingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.armband.firmware import HIGHEST_DUTY, ArmbandFirmware, Surroundings
from visavis.devices.sim.wire_noise import WireNoise
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

BAUD = 38_400
BITS_PER_BYTE = 10
STEP_NS = NS_PER_MS
RISE_MS = 30.0
"""Time constant of a coin motor; makers' figures for lag and rise lie at 20 to 50 ms."""

FELT_STEP_01 = 0.02


class _Way:
    """One direction of a serial line: bytes one after the other, then a delay that keeps order."""

    def __init__(self, baud: int, latency_ns: float, jitter_ns: float) -> None:
        self._byte_ns = BITS_PER_BYTE * NS_PER_S / baud
        self._latency_ns = latency_ns
        self._jitter_ns = jitter_ns
        self._free_ns = 0
        self._arrival_ns = 0

    def carry(
        self, pieces: Sequence[bytes], t_ns: int, rng: np.random.Generator
    ) -> list[tuple[int, bytes]]:
        """Return the pieces handed over at `t_ns` with their arrival times."""
        arrivals = []
        delay_ns = self._latency_ns
        if self._jitter_ns:
            delay_ns += rng.exponential(self._jitter_ns)
        for piece in pieces:
            self._free_ns = max(t_ns, self._free_ns) + round(len(piece) * self._byte_ns)
            self._arrival_ns = max(self._arrival_ns, self._free_ns + round(delay_ns))
            arrivals.append((self._arrival_ns, piece))
        return arrivals


class ArmbandSimulator:
    """The `BytePeer` of one band worn as `role`.

    `latency_ms` and `jitter_ms` are added to the wire time of `baud` in each direction; `drift_ppm`
    is how fast the band's clock runs. Delays and cuts are drawn from (`seed`, `body.stretch()`).
    Faults: late_start, disconnect, loss, duplicate, garbage,
    burst, mute, clock_jump, drift, version (text: a number).
    """

    def __init__(
        self,
        role: str,
        clock: Clock,
        *,
        seed: int = 0,
        body: MovingBody | None = None,
        faults: FaultSchedule | None = None,
        baud: int = BAUD,
        latency_ms: float = 1.0,
        jitter_ms: float = 0.5,
        drift_ppm: float = 0.0,
        rise_ms: float = RISE_MS,
        surroundings: Surroundings | None = None,
    ) -> None:
        self._role = role
        self._noise = WireNoise(seed, body)
        self._body = body
        self._faults = faults if faults is not None else FaultSchedule()
        self._is_sound = not self._faults.faults
        self._towards_band, self._towards_host = (
            _Way(baud, latency_ms * NS_PER_MS, jitter_ms * NS_PER_MS) for _ in range(2)
        )
        self._rate = 1 + drift_ppm * 1e-6
        self._rise_ns = max(1.0, rise_ms * NS_PER_MS)
        self._left = math.exp(-STEP_NS / self._rise_ns)
        self._origin_ns = self._at_ns = clock.now_ns()
        self.firmware = ArmbandFirmware(surroundings or Surroundings(), serial=serial_of(role))
        version = next(iter(self._faults.of_kind("version")), None)
        if version is not None:
            self.firmware.version = int(version.text)
        self._inbound: deque[tuple[int, bytes]] = deque()
        self._outbound: deque[Chunk] = deque()
        self._levels_01 = [0.0] * len(self.firmware.duties)
        self._felt_01 = [0.0] * len(self.firmware.duties)
        self.duty_log: list[tuple[int, tuple[int, ...]]] = []

    def connect(self, t_ns: int) -> None:
        """Take a connection; bytes under way are lost."""
        if self._is_away(t_ns) or self._faults.active("late_start", t_ns):
            raise DeviceNotFound("the simulated band is switched off", remedy="wait for it")
        self.advance(t_ns)
        self._inbound.clear()
        self._outbound.clear()

    def accept(self, data: bytes, t_ns: int) -> None:
        """Send bytes to the band, with delay and faults."""
        if self._is_away(t_ns):
            raise DeviceDisconnected("the simulated band is away", remedy="wait for it")
        rng = self._noise.rng()
        for arrival_ns, piece in self._towards_band.carry(
            self._travelling_pieces(data, t_ns), t_ns, rng
        ):
            self._inbound.append((arrival_ns, piece))

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Perform everything due and return the bytes that have reached the host."""
        self.advance(until_ns)
        if not self._is_sound:
            if self._is_away(until_ns):
                raise DeviceDisconnected("the simulated band is away", remedy="wait for it")
            if self._faults.active("burst", until_ns):
                return ()
        chunks: list[Chunk] = []
        while self._outbound and self._outbound[0].t_host_ns <= until_ns:
            chunks.append(self._outbound.popleft())
        return chunks

    def quiet_until_ns(self, now_ns: int) -> int:
        """Return until when nothing of the band's can arrive; `now_ns` while motors or faults run.

        Changes of its battery or heat are reported with the next message from the host.
        """
        if not self._is_sound or self._is_busy():
            return now_ns
        due_ns = [chunk.t_host_ns for chunk in self._outbound]
        due_ns += [arrival_ns for arrival_ns, _ in self._inbound]
        return min(due_ns, default=now_ns + NS_PER_S)

    def advance(self, t_ns: int) -> None:
        """Run firmware and motors up to this session time."""
        while self._at_ns < t_ns:
            since_ns = self._at_ns
            if not self._is_busy():
                following = self._inbound[0][0] if self._inbound else t_ns
                self._at_ns = max(self._at_ns, min(t_ns, following))
                if not self._inbound or self._inbound[0][0] > t_ns:
                    self._say(self.firmware.step(self._device_us(self._at_ns)), self._at_ns)
                    self._at_ns = t_ns
                    return
            else:
                self._at_ns = min(t_ns, self._at_ns + STEP_NS)
            self._step(self._at_ns - since_ns)

    def _step(self, elapsed_ns: int) -> None:
        now_ns, firmware = self._at_ns, self.firmware
        left = self._left if elapsed_ns == STEP_NS else math.exp(-elapsed_ns / self._rise_ns)
        levels_01 = []
        felt_01 = self._felt_01
        is_new = False
        for duty, before, felt_level in zip(firmware.duties, self._levels_01, felt_01, strict=True):
            target = duty / HIGHEST_DUTY
            level = target + (before - target) * left
            if level < FELT_STEP_01 and not duty:
                level = 0.0
            is_new = (
                is_new or abs(level - felt_level) >= FELT_STEP_01 or (level == 0 and felt_level > 0)
            )
            levels_01.append(level)
        while self._inbound and self._inbound[0][0] <= now_ns:
            arrival_ns, data = self._inbound.popleft()
            self._say(firmware.feed(data, self._device_us(arrival_ns)), arrival_ns)
        self._say(firmware.step(self._device_us(now_ns)), now_ns)
        if not self.duty_log or self.duty_log[-1][1] != firmware.duties:
            self.duty_log.append((now_ns, firmware.duties))
        self._levels_01 = levels_01
        if is_new:
            self._felt_01 = levels_01.copy()
            if self._body is not None:
                self._body.feel(self._role, levels_01.copy(), now_ns)

    def _is_busy(self) -> bool:
        return self.firmware.is_running or any(self._levels_01)

    def _say(self, data: bytes, t_ns: int) -> None:
        if not data or self._faults.active("mute", t_ns):
            return
        rng = self._noise.rng()
        for arrival_ns, piece in self._towards_host.carry(
            self._travelling_pieces(data, t_ns), t_ns, rng
        ):
            self._outbound.append(Chunk(arrival_ns, piece))

    def _travelling_pieces(self, data: bytes, t_ns: int) -> list[bytes]:
        """Return the pieces of these bytes that travel on: none, one, damaged, or twice."""
        rng, faults = self._noise.rng(), self._faults
        if not self._is_sound:
            if (fault := faults.active("loss", t_ns)) and rng.random() < fault.amount:
                return []
            if (fault := faults.active("garbage", t_ns)) and rng.random() < fault.amount:
                noise = bytearray(data)
                noise[int(rng.integers(len(noise)))] ^= int(rng.integers(1, 256))
                data = bytes(noise)
            if (fault := faults.active("duplicate", t_ns)) and rng.random() < fault.amount:
                return [data, data]
        if len(data) > 2 and rng.random() < 0.5:  # links may split and join chunks
            cut = int(rng.integers(1, len(data)))
            return [data[:cut], data[cut:]]
        return [data]

    def _is_away(self, t_ns: int) -> bool:
        return self._faults.active("disconnect", t_ns) is not None

    def _device_us(self, t_ns: int) -> int:
        elapsed_ns = (t_ns - self._origin_ns) * self._rate
        if self._is_sound:
            return round(elapsed_ns / 1000)
        for fault in self._faults.of_kind("drift"):
            elapsed_ns += max(0, t_ns - fault.start_ns) * fault.amount * 1e-6
        for fault in self._faults.of_kind("clock_jump"):
            if t_ns >= fault.start_ns:
                elapsed_ns += fault.amount * NS_PER_S
        return round(elapsed_ns / 1000)


def serial_of(role: str) -> str:
    """Return the serial number of the simulated band worn as `role`: every band has its own."""
    return f"SIM{zlib.crc32(role.encode()) % 100_000:05d}"
