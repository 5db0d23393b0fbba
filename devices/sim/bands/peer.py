"""Common part of the simulators of armbands without acknowledgement: faults, delays, motors.

Travel takes `latency_ms` in each direction and keeps its order. Motors follow their drive at
once. Not modelled: skin and strap, motor spread and inertia, radio collisions, flow control.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import MovingBody
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.sim.wire_noise import WireNoise
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound


class BandPeer(ABC):
    """The `BytePeer` of one band; a subclass interprets its bytes.

    Faults: late_start, disconnect, loss, duplicate, garbage (of what the host sends), burst,
    mute (of what it hears). With `splits`, messages to the band arrive cut in two at random.
    The body feels the motors at `places`, all by default.
    `levels_01` is what the motors do now, `log` every change with its session time.
    """

    def __init__(
        self,
        role: str,
        clock: Clock,
        *,
        seed: int = 0,
        body: MovingBody | None = None,
        faults: FaultSchedule | None = None,
        latency_ms: float = 1.0,
        splits: bool = False,
        motor_count: int = 4,
        places: Sequence[int] | None = None,
    ) -> None:
        self._role = role
        self._noise = WireNoise(seed, body)
        self._body = body
        self._faults = faults if faults is not None else FaultSchedule()
        self._latency_ns = round(latency_ms * NS_PER_MS)
        self._splits = splits
        self._places = range(motor_count) if places is None else tuple(places)
        self._origin_ns = clock.now_ns()
        self._inbound: deque[tuple[int, bytes]] = deque()
        self._outbound: deque[Chunk] = deque()
        self.levels_01: tuple[float, ...] = (0.0,) * motor_count
        self.log: list[tuple[int, tuple[float, ...]]] = []

    @abstractmethod
    def receive(self, data: bytes, t_ns: int) -> None:
        """Take bytes that reached the band; for the subclass."""

    def due_ns(self) -> int | None:
        """Return the time of the band's next action without a command; for the subclass."""
        return None

    def act(self, t_ns: int) -> None:  # noqa: B027 - most bands do nothing of their own accord
        """Perform actions that are due without a command; for the subclass."""

    def restart(self, t_ns: int) -> None:  # noqa: B027 - not every band keeps something
        """Clear the state of a connection; for the subclass."""

    def connect(self, t_ns: int) -> None:
        """Take a connection; bytes under way are lost, the motors go on."""
        if self._is_away(t_ns) or self._active("late_start", t_ns):
            raise DeviceNotFound("the simulated band is switched off", remedy="wait for it")
        self.advance(t_ns)
        self._inbound.clear()
        self._outbound.clear()
        self.restart(t_ns)

    def accept(self, data: bytes, t_ns: int) -> None:
        """Send bytes to the band, with delay and faults."""
        if self._is_away(t_ns):
            raise DeviceDisconnected("the simulated band is away", remedy="wait for it")
        for piece in self._travelling_pieces(data, t_ns):
            self._inbound.append((t_ns + self._latency_ns, piece))

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Perform everything due and return the bytes that have reached the host."""
        self.advance(until_ns)
        if self._is_away(until_ns):
            raise DeviceDisconnected("the simulated band is away", remedy="wait for it")
        if self._active("burst", until_ns):
            return ()
        chunks = []
        while self._outbound and self._outbound[0].t_host_ns <= until_ns:
            chunks.append(self._outbound.popleft())
        return chunks

    def advance(self, t_ns: int) -> None:
        """Do everything due up to this session time, in order."""
        while True:
            arrives_ns = self._inbound[0][0] if self._inbound else None
            acts_ns = self.due_ns()
            if arrives_ns is not None and arrives_ns <= t_ns and arrives_ns <= (acts_ns or t_ns):
                self.receive(self._inbound.popleft()[1], arrives_ns)
            elif acts_ns is not None and acts_ns <= t_ns:
                self.act(acts_ns)
            else:
                return

    def say(self, data: bytes, t_ns: int) -> None:
        """Send bytes to the host."""
        if not data or self._active("mute", t_ns):
            return
        for piece in self._pieces(data):
            self._outbound.append(Chunk(t_ns + self._latency_ns, piece))

    def set_levels(self, levels_01: Sequence[float], t_ns: int) -> None:
        """Set the levels of the motors from now on."""
        levels = tuple(levels_01)
        if levels == self.levels_01:
            return
        self.levels_01 = levels
        self.log.append((t_ns, levels))
        if self._body is not None:
            self._body.feel(self._role, [levels[i] for i in self._places], t_ns)

    def _travelling_pieces(self, data: bytes, t_ns: int) -> list[bytes]:
        rng = self._noise.rng()
        if (fault := self._active("loss", t_ns)) and rng.random() < fault.amount:
            return []
        if (fault := self._active("garbage", t_ns)) and rng.random() < fault.amount:
            noise = bytearray(data)
            noise[int(rng.integers(len(noise)))] ^= int(rng.integers(1, 256))
            data = bytes(noise)
        pieces = self._pieces(data)
        if (fault := self._active("duplicate", t_ns)) and rng.random() < fault.amount:
            return [*pieces, *pieces]
        return pieces

    def _pieces(self, data: bytes) -> list[bytes]:
        if not self._splits or len(data) < 2:
            return [data]
        cut = int(self._noise.rng().integers(1, len(data)))
        return [data[:cut], data[cut:]]

    def _active(self, kind: str, t_ns: int) -> WireFault | None:
        return self._faults.active(kind, t_ns - self._origin_ns)

    def _is_away(self, t_ns: int) -> bool:
        return self._active("disconnect", t_ns) is not None
