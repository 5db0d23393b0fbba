"""Take buttons, axes and rays of OpenVR controllers, and let them buzz.

The runtime's events say how old they are; a press bears the time at which it happened. Axes and
poses have no time of their own: they bear that of asking, once per `poll`.
"""

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
from devices.drivers.openvr import codec
from devices.drivers.openvr.spec import OPENVR_CONTROLLERS
from devices.drivers.runtimes.controller_rows import Change, Levels, Ray, ray_batch, response_batch
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.transports import Message, MessageTransport
from lab.clock import NS_PER_S, Clock
from lab.errors import ConfigError, DeviceDisconnected, DeviceError
from lab.schema import StreamSchema

REMEDY = "switch the controllers on and look at SteamVR"
DEFAULT_CONTROLS: Mapping[str, str] = {
    "trigger": "any trigger",
    "grip": "any grip",
    "menu": "any menu",
    "trackpad": "any trackpad",
    "a": "any a",
}
AXES = {"trigger axis": 2, "trackpad x": 0, "trackpad y": 1}
"""Axis -> its place among x and y of the runtime's axes (openvr.h, k_EButton_Axis)."""
TWO_SIDED = frozenset({"trackpad x", "trackpad y"})
HANDS = {"left": codec.LEFT_HAND, "right": codec.RIGHT_HAND, "any": 0}
RECONNECT_EVERY_NS = NS_PER_S // 2
LONGEST_PULSE_US = 3999
LOW_BATTERY_01 = 0.2


class OpenVrControllers:
    """Follow the `ResponseInput` contract over the controllers of an OpenVR runtime.

    `controls` maps the experiment's names to a hand and a button or axis: "left grip", "any
    trigger", "right trigger axis". A trackpad's axes run from 0 (left, bottom) to 1. With `rays`
    there is a second stream, `POINTER`.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        controls: Mapping[str, str] | None = None,
        rays: bool = False,
    ) -> None:
        chosen = dict(controls) if controls else dict(DEFAULT_CONTROLS)
        self.controls = tuple(chosen)
        self._wanted = [_parsed(role, name, text) for name, text in chosen.items()]
        self._transport = transport
        self._clock = clock
        self._life = Lifecycle(role)
        self._meter = StreamMeter(0.0)
        self._sink: Sink | None = None
        self._rays = rays
        self._has_axes = any(part in AXES for _, part in self._wanted)
        self._levels = Levels()
        self._ray_seq = 0
        self._hand_of: dict[int, int] = {}
        self._batteries: dict[str, float] = {}
        self._retry_ns = 0
        self._seq = 0
        self.info = OPENVR_CONTROLLERS.info(role, transport)

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the runtime is gone."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Connect and see which controllers are on; it opens without any, and `check` tells."""
        self._life.require("open", DeviceState.CLOSED)
        try:
            self._transport.open(deadline_s)
            self._learn()
        except DeviceError as problem:
            self._transport.close()
            if problem.role:
                raise
            raise type(problem)(str(problem), role=self.info.role) from problem
        self.info = replace(self.info, is_simulated=self._transport.is_simulated)
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the responses and, where wanted, the rays."""
        return (RESPONSES, POINTER) if self._rays else (RESPONSES,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; earlier presses are gone."""
        self._life.require("start", DeviceState.OPEN)
        self._transport.receive(0.0)
        self._sink = sink
        self._seq = self._ray_seq = 0
        self._levels = Levels()
        self._meter = StreamMeter(0.0)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Deliver presses and releases of the configured buttons; see the contract."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            self._reconnect()
            return 0
        rows: list[Change] = []
        for message in self._transport.receive(timeout_s):
            self._take(message, rows)
        if self._has_axes and self._hand_of:
            self._take_axes(rows)
        told = self._tell_rays() if self._rays else 0
        if rows and self._sink is not None:
            self._deliver(rows)
        if self.state is DeviceState.FAULT:
            raise DeviceDisconnected(
                "the OpenVR runtime was closed", role=self.info.role, remedy=REMEDY
            )
        return len(rows) + told

    def stop(self) -> None:
        """Stop delivering."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Leave the runtime; idempotent."""
        self._sink = None
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report rows so far and the weakest battery when it was last looked at."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(
            health,
            received=health.received + self._ray_seq,
            battery_01=min(self._batteries.values(), default=None),
        )

    def check(self) -> tuple[Fault, ...]:
        """Tell missing controllers and weak batteries."""
        role, faults = self.info.role, []
        if not self._hand_of:
            faults.append(Fault(role, "blocking", "no controller is on", REMEDY))
        for serial, level in self._batteries.items():
            if level < LOW_BATTERY_01:
                text = f"controller {serial} has {level:.0%} of its battery left"
                faults.append(Fault(role, "warning", text, "charge it"))
        return tuple(faults)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: the runtime stamps by this computer's clock."""
        return ()

    def pulse(self, hand: str, duration_us: int) -> None:
        """Buzz the controller of a hand ("left", "right", "any") for up to 3999 µs."""
        self._life.require("pulse", DeviceState.OPEN, DeviceState.STREAMING)
        if hand not in HANDS or not 0 < duration_us <= LONGEST_PULSE_US:
            raise ConfigError(
                f"{self.info.role}: a pulse needs left, right or any and 1 to {LONGEST_PULSE_US} "
                f"µs, not {hand!r} and {duration_us}"
            )
        for slot, held_in in self._hand_of.items():
            if HANDS[hand] in (0, held_in):
                self._transport.post((b"haptic", f"{slot} {duration_us}".encode()))

    # ---- private --------------------------------------------------------------------------

    def _learn(self) -> None:
        frames = self._transport.request((b"devices",), 1.0).frames
        if frames[0] or len(frames) < 2:
            raise DeviceError("the runtime lists no devices", remedy=REMEDY)
        rows = [r for r in msgpack.unpackb(frames[1]) if r[1] == codec.CONTROLLER]
        self._hand_of = {row[0]: row[2] for row in rows}
        self._batteries = {row[3]: row[6] for row in rows if row[6] is not None}

    def _take(self, message: Message, rows: list[Change]) -> None:
        event = codec.decode_event(message.frames[-1])
        if event is None:
            return
        if event.kind in ("activated", "deactivated"):
            self._learn()
        elif event.kind == "quit":
            self._life.state = DeviceState.FAULT
        elif event.kind in ("press", "release") and event.slot in self._hand_of:
            hand = self._hand_of[event.slot]
            t_ns = message.t_host_ns - round(event.age_s * NS_PER_S)
            for control, (wanted_hand, button) in enumerate(self._wanted):
                if button == event.button and wanted_hand in (0, hand):
                    rows.append((t_ns, message.t_host_ns, control, float(event.kind == "press")))

    def _take_axes(self, rows: list[Change]) -> None:
        slots = " ".join(str(slot) for slot in self._hand_of)
        exchange = self._transport.request((b"axes", slots.encode()), 1.0)
        if exchange.frames[0] or len(exchange.frames) < 2:
            return
        found = [
            (self._hand_of.get(slot), axes) for slot, axes in msgpack.unpackb(exchange.frames[1])
        ]
        for control, (wanted_hand, part) in enumerate(self._wanted):
            levels = [
                axes[AXES[part]]
                for hand, axes in found
                if part in AXES and axes is not None and wanted_hand in (0, hand)
            ]
            if levels:
                level = max(levels, key=abs)
                level = (level + 1.0) / 2.0 if part in TWO_SIDED else level
                level = min(max(level, 0.0), 1.0)
                if self._levels.changed(control, level, axis=True):
                    rows.append((exchange.t_receive_ns, exchange.t_receive_ns, control, level))

    def _tell_rays(self) -> int:
        exchange = self._transport.request((b"poses",), 1.0)
        if exchange.frames[0] or len(exchange.frames) < 2 or self._sink is None:
            return 0
        poses = codec.decode_poses(exchange.frames[1])
        rays: list[Ray] = [None, None]
        for slot, hand in self._hand_of.items():
            if hand in (codec.LEFT_HAND, codec.RIGHT_HAND) and slot < len(poses):
                rays[hand - codec.LEFT_HAND] = codec.decode_pose(poses[slot])
        t_ns = exchange.t_receive_ns
        self._sink(ray_batch(self._ray_seq, t_ns, t_ns, rays))
        self._ray_seq += len(rays)
        return len(rays)

    def _deliver(self, rows: list[Change]) -> None:
        self._meter.update([row[0] for row in rows], rows[-1][1])
        if self._sink is not None:
            self._sink(response_batch(self._seq, rows))
        self._seq += len(rows)

    def _reconnect(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_ns:
            return
        self._retry_ns = now_ns + RECONNECT_EVERY_NS
        try:
            self._transport.open(1.0)
            self._learn()
        except DeviceError as problem:
            raise DeviceDisconnected(
                f"still away: {problem}", role=self.info.role, remedy=REMEDY
            ) from problem
        self._life.state = DeviceState.STREAMING


def _parsed(role: str, name: str, text: str) -> tuple[int, str]:
    hand, _, button = text.partition(" ")
    if hand not in HANDS or button not in (*codec.BUTTONS.values(), *AXES):
        buttons = ", ".join((*codec.BUTTONS.values(), *AXES))
        raise ConfigError(
            f"{role}: control {name!r} is {text!r}; say left, right or any and one of {buttons}"
        )
    return HANDS[hand], button
