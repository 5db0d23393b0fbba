"""Take buttons, triggers and rays of the controllers of an OpenXR runtime; let them buzz.

The state of both hands is asked for at a steady rate; a press bears the time of the answer in
which it was first seen. A controller that is off or out of sight points nowhere.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgpack

from devices.contracts import (
    POINTER,
    RESPONSES,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.openvr.trackers import PolledPoses
from devices.drivers.openxr.actions import BUTTON_STATES, BUTTONS, HAND, HANDS
from devices.drivers.openxr.packing import INSTANT
from devices.drivers.openxr.spec import OPENXR_CONTROLLERS
from devices.drivers.runtimes.controller_rows import Change, Levels, Ray, ray_batch, response_batch
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.transports import Message, MessageTransport
from lab.clock import NS_PER_S, Clock
from lab.errors import ConfigError, DeviceDisconnected, DeviceError
from lab.schema import StreamSchema

REMEDY = "switch the controllers on and look at the OpenXR runtime"
TRIGGER_AXIS = "trigger axis"
PARTS = (*BUTTONS, TRIGGER_AXIS)
DEFAULT_CONTROLS: Mapping[str, str] = {
    "select": "any select",
    "menu": "any menu",
    "grip": "any grip",
}
RATE_HZ = 90.0
SILENT_NS = NS_PER_S
RECONNECT_EVERY_NS = NS_PER_S // 2
LONGEST_PULSE_US = 1_000_000
POSE_VALID = 0b0011
ORIENTATION_TRACKED = 0b0100

_PER_HAND = struct.Struct("<" + (BUTTON_STATES.format + HAND.format).replace("<", ""))


class OpenXrControllers:
    """Follow the `ResponseInput` contract; streams are `RESPONSES` and `POINTER`.

    `controls` maps the experiment's names to a hand and a part: "left select", "any grip",
    "right trigger axis".
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        controls: Mapping[str, str] | None = None,
    ) -> None:
        chosen = dict(controls) if controls else dict(DEFAULT_CONTROLS)
        self.controls = tuple(chosen)
        self._wanted = [_parsed(role, name, text) for name, text in chosen.items()]
        self._transport = PolledPoses(transport, clock, RATE_HZ, ask=b"hands")
        self._clock = clock
        self._life = Lifecycle(role)
        self._meter = StreamMeter(0.0)
        self._sink: Sink | None = None
        self._levels = Levels()
        self._is_there = (False, False)
        self._seqs = [0, 0]
        self._last_ns = self._retry_ns = 0
        self.info = OPENXR_CONTROLLERS.info(role, transport)

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the session is lost."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Join the session; it opens without any controller, and `check` tells."""
        self._life.require("open", DeviceState.CLOSED)
        try:
            self._transport.open(deadline_s)
            frames = self._transport.request((b"runtime",), 1.0).frames
            if frames[0] or len(frames) < 2:
                raise DeviceError("the OpenXR runtime does not answer", remedy=REMEDY)
        except DeviceError as problem:
            self._transport.close()
            if problem.role:
                raise
            raise type(problem)(str(problem), role=self.info.role) from problem
        name = msgpack.unpackb(frames[1])[0]
        self.info = replace(
            self.info,
            model=f"OpenXR controllers ({name})",
            is_simulated=self._transport.is_simulated,
        )
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the responses and the rays."""
        return (RESPONSES, POINTER)

    def start(self, sink: Sink) -> None:
        """Begin delivering; what is held down now counts as pressed before."""
        self._life.require("start", DeviceState.OPEN)
        self._sink = None
        self._levels = Levels()
        for message in self._transport.receive(0.0):
            self._take(message)
        self._sink = sink
        self._seqs = [0, 0]
        self._last_ns = self._clock.now_ns()
        self._meter = StreamMeter(0.0)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Deliver what changed and where both hands point."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            self._reconnect()
        delivered = sum(self._take(message) for message in self._transport.receive(timeout_s))
        if self._clock.now_ns() - self._last_ns > SILENT_NS:
            self._life.state = DeviceState.FAULT
            raise DeviceDisconnected(
                "the OpenXR session gives no state of the hands", role=self.info.role, remedy=REMEDY
            )
        return delivered

    def stop(self) -> None:
        """Stop delivering."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Leave the session; idempotent."""
        self._sink = None
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report the rows of both streams so far."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, received=sum(self._seqs))

    def check(self) -> tuple[Fault, ...]:
        """Tell missing controllers."""
        role = self.info.role
        if self.state is DeviceState.FAULT:
            return (Fault(role, "blocking", "lost the OpenXR session", REMEDY),)
        if self.state is DeviceState.STREAMING and not any(self._is_there):
            return (Fault(role, "warning", "no controller is on, or none is in sight", REMEDY),)
        return ()

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: the runtime's times are converted to this computer's clock."""
        return ()

    def pulse(self, hand: str, duration_us: int) -> None:
        """Buzz the controller of a hand ("left", "right", "any") for up to a second."""
        self._life.require("pulse", DeviceState.OPEN, DeviceState.STREAMING)
        if hand not in (*HANDS, "any") or not 0 < duration_us <= LONGEST_PULSE_US:
            raise ConfigError(
                f"{self.info.role}: a pulse needs left, right or any and 1 to {LONGEST_PULSE_US} "
                f"µs, not {hand!r} and {duration_us}"
            )
        for number, name in enumerate(HANDS):
            if hand in (name, "any"):
                self._transport.post((b"buzz", f"{number} {duration_us}".encode()))

    # ---- private --------------------------------------------------------------------------

    def _take(self, message: Message) -> int:
        """Take the state of both hands; return how many rows it gave."""
        _, error, *rest = message.frames
        if error or not rest or len(rest[0]) != INSTANT.size + 2 * _PER_HAND.size:
            return 0
        self._last_ns = message.t_host_ns
        _, now = INSTANT.unpack_from(rest[0])
        states: list[dict[str, float]] = []
        rays: list[Ray] = []
        for hand in range(2):
            numbers = _PER_HAND.unpack_from(rest[0], INSTANT.size + hand * _PER_HAND.size)
            state = {name: float(down) for name, down in zip(BUTTONS, numbers[:3], strict=True)}
            state[TRIGGER_AXIS] = numbers[4] if numbers[3] else -1.0
            states.append(state)
            rays.append(_ray(int(numbers[5]), numbers[6:]))
        self._is_there = (rays[0] is not None, rays[1] is not None)
        changes: list[Change] = []
        for control, (hands, part) in enumerate(self._wanted):
            level = max(states[hand][part] for hand in hands)
            is_axis = part == TRIGGER_AXIS
            if level >= 0.0 and self._levels.changed(control, level, axis=is_axis):
                changes.append((message.t_host_ns, message.t_host_ns, control, level))
        if self._sink is None:
            return 0
        if changes:
            self._sink(response_batch(self._seqs[0], changes))
            self._seqs[0] += len(changes)
            self._meter.update([c[0] for c in changes], message.t_host_ns)
        self._sink(ray_batch(self._seqs[1], now, message.t_host_ns, rays))
        self._seqs[1] += len(rays)
        return len(changes) + len(rays)

    def _reconnect(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns >= self._retry_ns:
            self._retry_ns = now_ns + RECONNECT_EVERY_NS
            try:
                self._transport.open(0.2)
                self._last_ns = self._clock.now_ns()
                self._life.state = DeviceState.STREAMING
            except DeviceError as problem:
                raise DeviceDisconnected(
                    f"still away: {problem}", role=self.info.role, remedy=REMEDY
                ) from problem
        else:
            raise DeviceDisconnected("still away", role=self.info.role, remedy=REMEDY)


def _ray(flags: int, numbers: Sequence[float]) -> Ray:
    x, y, z, i, j, k, w = numbers
    length = (w * w + i * i + j * j + k * k) ** 0.5
    good = flags & POSE_VALID == POSE_VALID and flags & ORIENTATION_TRACKED
    if not good or not 0.9 < length < 1.1:
        return None
    return (x, y, z), (w / length, i / length, j / length, k / length)


def _parsed(role: str, name: str, text: str) -> tuple[tuple[int, ...], str]:
    hand, _, part = text.partition(" ")
    if hand not in (*HANDS, "any") or part not in PARTS:
        raise ConfigError(
            f"{role}: control {name!r} is {text!r}; say left, right or any and one of "
            f"{', '.join(PARTS)}"
        )
    return tuple(i for i, side in enumerate(HANDS) if hand in (side, "any")), part
