"""Common part of the wires of body trackers: sampling a body, the clock, and faults.

Not modelled: the tracker's noise and lag of its filter, soft tissue, magnetic disturbance,
swapped markers. A sample taken at t arrives after a least delay and a random one.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Required, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import MovingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.wire_noise import WireNoise
from visavis.devices.transports import Frames, Message
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import ConfigError
from visavis.lab.geometry import Vector

MILLI_HZ = 1000
_DELAY_STREAM, _GARBAGE_STREAM = 0xD1, 0x6B
_LOSS, _DUPLICATE, _REORDER, _GARBAGE = range(4)


class Streaming(TypedDict, total=False):
    """Keyword arguments of every `BodyWire`: how a simulated tracker streams."""

    seed: Required[int]
    rate_hz: float
    faults: FaultSchedule | None
    drift_ppm: float
    delay_ms: float
    jitter_ms: float


class BodyWire(ABC):
    """Follow `visavis.devices.transports.Peer`: sample a body's segments and stream them.

    Sample k is taken at `k * 10**9 // rate_hz` ns of the session clock, counted from the first
    after the simulator is made. Its clock starts at `epoch_ns` and runs `drift_ppm` fast.
    """

    usual_rate_hz = 100.0
    usual_delay_ms = 2.0
    usual_jitter_ms = 0.5
    epoch_ns = 0

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        segments: Sequence[str],
        **streaming: Unpack[Streaming],
    ) -> None:
        self.segments = tuple(segments)
        self._body = body
        self._rate_hz = streaming.get("rate_hz", self.usual_rate_hz)
        self._rate_milli_hz = round(self._rate_hz * MILLI_HZ)
        self._faults = streaming.get("faults") or FaultSchedule()
        self._drift = streaming.get("drift_ppm", 0.0) * 1e-6
        self._delay_ms = streaming.get("delay_ms", self.usual_delay_ms)
        self._jitter_ms = streaming.get("jitter_ms", self.usual_jitter_ms)
        seed = streaming["seed"]
        self._origin_ns = clock.now_ns()
        self._delays = WireNoise([seed, _DELAY_STREAM], body)
        self._garbage = WireNoise([seed, _GARBAGE_STREAM], body)
        self._next = -(-self._origin_ns * self._rate_milli_hz // (NS_PER_S * MILLI_HZ))
        self._first = self._next
        self._outbox: list[Message] = []
        unknown = {f.text for f in self._faults.of_kind("part_frozen")} - set(self.segments)
        if unknown:
            raise ConfigError(
                f"fault 'part_frozen': this tracker has no segment {', '.join(sorted(unknown))}; "
                f"it has {', '.join(self.segments)}"
            )
        self._last_poses = np.full((len(self.segments), 7), np.nan)

    @abstractmethod
    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return the datagrams of one sample: positions (n, 3), turns (n, 4), our frame."""

    def answer(self, request: bytes, t_ns: int) -> bytes | None:
        """Answer a request; a device that only streams has nothing to say."""
        return None

    def is_streaming(self, t_ns: int) -> bool:
        """Tell whether it sends samples now."""
        return True

    def advance(self, t_ns: int) -> None:
        """Take every sample due up to this session time."""
        scale = NS_PER_S * MILLI_HZ
        last = ((t_ns + 1) * self._rate_milli_hz - 1) // scale
        if last < self._next:
            return
        times = np.array(
            [k * scale // self._rate_milli_hz for k in range(self._next, last + 1)], np.int64
        )
        positions, turns = self._body.segments(self.segments, times)
        if self._faults.faults:
            self._hold(positions, turns, times - self._origin_ns)
        for i, t in enumerate(times.tolist()):
            self._sample(self._next + i - self._first, t, positions[i], turns[i])
        self._next = last + 1

    def outgoing(self, until_ns: int) -> Sequence[Message]:
        """Return the messages that have arrived at the host by this time, in order of arrival."""
        due = [m for m in self._outbox if m.t_host_ns <= until_ns]
        if due:
            self._outbox = [m for m in self._outbox if m.t_host_ns > until_ns]
            due.sort(key=lambda message: message.t_host_ns)
        return due

    def leg_ns(self) -> int:
        """Draw how long a request or an answer travels."""
        return round(self._delay_ms * NS_PER_MS / 2) + 1

    def handle_request(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer, unless a fault keeps it silent."""
        since_ns = t_ns - self._origin_ns
        for kind in ("late_start", "disconnect", "mute"):
            if self._faults.active(kind, since_ns) is not None:
                return None
        reply = self.answer(frames[0], t_ns)
        return None if reply is None else (reply,)

    def accept(self, frames: Frames, t_ns: int) -> None:
        """Take a message nobody answers."""
        self.handle_request(frames, t_ns)

    def device_ns(self, t_ns: int) -> int:
        """Return what the device's clock shows at a session time."""
        since_ns = t_ns - self._origin_ns
        own_ns = self.epoch_ns + since_ns + round(self._drift * since_ns)
        return own_ns + self._faults.clock_error_ns(since_ns)

    def _hold(self, positions: Vector, turns: Vector, since_ns: npt.NDArray[np.int64]) -> None:
        """Replace frozen segments by their previous pose."""
        parts = self._faults.of_kind("part_frozen")
        for i, t_ns in enumerate(since_ns.tolist()):
            frozen_segments = [
                self.segments.index(f.text) for f in parts if f.start_ns <= t_ns < f.end_ns
            ]
            if self._faults.active("frozen", t_ns):
                frozen_segments = list(range(len(self.segments)))
            for s in frozen_segments:
                if np.isfinite(self._last_poses[s]).all():
                    positions[i, s], turns[i, s] = self._last_poses[s, :3], self._last_poses[s, 3:]
            self._last_poses[:, :3], self._last_poses[:, 3:] = positions[i], turns[i]

    def _sample(
        self,
        number: int,
        t_ns: int,
        position_m: npt.NDArray[np.float64],
        turn: npt.NDArray[np.float64],
    ) -> None:
        faults, since_ns = self._faults, t_ns - self._origin_ns
        rng = self._delays.rng()
        draws = rng.random(4)
        delay_ms = self._delay_ms + float(rng.exponential(self._jitter_ms))
        active = {f.kind: f for f in faults.faults if f.start_ns <= since_ns < f.end_ns}
        if active.keys() & {"late_start", "silence", "disconnect"}:
            return
        if not self.is_streaming(t_ns):
            return
        device_ns = self.device_ns(t_ns)
        if "backward" in active:
            device_ns -= round(active["backward"].amount * NS_PER_S)
        parts = self.encode(number, device_ns, position_m, turn, tracked="standby" not in active)
        arrival_ns = t_ns + round(delay_ms * NS_PER_MS)
        if "burst" in active:
            arrival_ns = max(arrival_ns, self._origin_ns + active["burst"].end_ns)

        def happens(kind: str, which: int) -> bool:
            return kind in active and bool(draws[which] < active[kind].amount)

        if happens("loss", _LOSS):
            return
        if happens("reorder", _REORDER):
            arrival_ns += 2 * NS_PER_S * MILLI_HZ // self._rate_milli_hz
        copies = 2 if happens("duplicate", _DUPLICATE) else 1
        for part in parts:
            data = part
            if happens("garbage", _GARBAGE):
                garbage = self._garbage.rng()
                data = garbage.bytes(int(garbage.integers(1, 900)))
            self._outbox += [Message(arrival_ns, (data,))] * copies


class NamedBodiesWire(BodyWire):
    """A tracker of bodies that its operator named; `bodies` maps their names to segments."""

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        **streaming: Unpack[Streaming],
    ) -> None:
        self.names = tuple(bodies)
        super().__init__(body, clock, segments=tuple(bodies.values()), **streaming)
