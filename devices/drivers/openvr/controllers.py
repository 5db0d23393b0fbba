"""Take buttons, axes and rays of OpenVR controllers, and let them buzz.

The runtime's events state their age, so a press has the time at which it happened. Axes and poses
have no time of their own: they get the time of the request, once per `poll`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import msgpack

from visavis.devices.contracts import DeviceState, Fault, Health
from visavis.devices.drivers.openvr import codec
from visavis.devices.drivers.openvr.spec import OPENVR_CONTROLLERS
from visavis.devices.drivers.runtimes.controllers import SIDES, Change, Ray, RuntimeControllers
from visavis.devices.drivers.streaming.message_device import UNREADABLE, legible
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, ProtocolViolation

AXES = {"trigger axis": 2, "trackpad x": 0, "trackpad y": 1}
"""Axis -> its place among x and y of the runtime's axes (openvr.h, k_EButton_Axis)."""
TWO_SIDED = frozenset({"trackpad x", "trackpad y"})
HANDS = {codec.LEFT_HAND: "left", codec.RIGHT_HAND: "right"}
LOW_BATTERY_01 = 0.2
CALL_TIMEOUT_S = 1.0


class OpenVrControllers(RuntimeControllers):
    """Follow the `ResponseInput` contract; a trackpad's axes run from 0 (left, bottom) to 1."""

    max_pulse_us = 3999
    parts = (*codec.BUTTONS.values(), *AXES)
    usual_controls: Mapping[str, str] = {
        "trigger": "any trigger",
        "grip": "any grip",
        "menu": "any menu",
        "trackpad": "any trackpad",
        "a": "any a",
    }

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        controls: Mapping[str, str] | None = None,
        rays: bool = False,
    ) -> None:
        spec = OPENVR_CONTROLLERS
        super().__init__(role, transport, clock, spec, controls=controls, rays=rays)
        self._has_axes = any(part in AXES for _, part in self._hands_and_parts)
        self._hand_of: dict[int, str] = {}
        self._batteries: dict[str, float] = {}

    def poll(self, timeout_s: float) -> int:
        """Deliver presses and releases of the configured buttons; see the contract."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            self._try_again("still away")
            return 0
        changes: list[Change] = []
        for message in self._transport.receive(timeout_s):
            self._take(message, changes)
        if self._has_axes and self._hand_of:
            self._take_axes(changes)
        row_count = self._ask_rays() if self._rays else 0
        row_count += self._tell(changes)
        if self.state is DeviceState.FAULT:
            raise DeviceDisconnected(
                "the OpenVR runtime was closed", role=self.info.role, remedy=self._spec.remedy
            )
        return row_count

    def health(self) -> Health:
        """Report rows so far and the weakest battery at the last reading."""
        weakest = min(self._batteries.values(), default=None)
        return replace(super().health(), battery_01=weakest)

    def check(self) -> tuple[Fault, ...]:
        """Report missing controllers and weak batteries."""
        faults = []
        if not self._hand_of:
            faults.append(self._blocking("no controller is on", self._spec.remedy))
        for serial, level in self._batteries.items():
            if level < LOW_BATTERY_01:
                text = f"controller {serial} has {level:.0%} of its battery left"
                faults.append(self._warning(text, "charge it"))
        if self._malformed:
            text = f"{self._malformed} messages could not be read"
            faults.append(self._warning(text, "keep the .wire log and report it"))
        return tuple(faults)

    # ---- private --------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        """Find the controllers that are on; `check` reports when there are none."""
        frames = self._transport.request((b"devices",), CALL_TIMEOUT_S).frames
        if frames[0] or len(frames) < 2:
            raise ProtocolViolation("the runtime lists no devices")
        rows = [r for r in msgpack.unpackb(frames[1]) if r[1] == codec.CONTROLLER]
        hands = {int(row[0]): HANDS.get(row[2], "") for row in rows}
        batteries = {str(row[3]): float(row[6]) for row in rows if row[6] is not None}
        self._hand_of, self._batteries = hands, batteries

    def _buzz(self, hand: str, duration_us: int) -> None:
        for slot, held_in in self._hand_of.items():
            if hand in ("any", held_in):
                self._transport.post((b"haptic", f"{slot} {duration_us}".encode()))

    def _take(self, message: Message, changes: list[Change]) -> None:
        event = codec.decode_event(message.frames[-1])
        if event is None:
            return
        if event.kind in ("activated", "deactivated", "role_changed"):
            try:
                with legible("the runtime's list of devices", self._spec.remedy):
                    self._connect(self._clock.now_ns())
            except DeviceError:
                self._life.state = DeviceState.FAULT
        elif event.kind == "quit":
            self._life.state = DeviceState.FAULT
        elif event.kind in ("press", "release") and event.slot in self._hand_of:
            side, is_down = self._hand_of[event.slot], float(event.kind == "press")
            t_ns = message.t_host_ns - round(event.age_s * NS_PER_S)
            for control, (hand, button) in enumerate(self._hands_and_parts):
                if button == event.button and hand in ("any", side):
                    changes.append((t_ns, message.t_host_ns, control, is_down))

    def _take_axes(self, changes: list[Change]) -> None:
        slots = " ".join(str(slot) for slot in self._hand_of)
        exchange = self._transport.request((b"axes", slots.encode()), CALL_TIMEOUT_S)
        if exchange.frames[0] or len(exchange.frames) < 2:
            return
        try:
            hand_axes = [
                (self._hand_of.get(slot), {p: float(axes[n]) for p, n in AXES.items()})
                for slot, axes in msgpack.unpackb(exchange.frames[1])
                if axes is not None
            ]
        except UNREADABLE:
            self._malformed += 1
            return
        for control, (hand, part) in enumerate(self._hands_and_parts):
            levels = [
                axes[part]
                for side, axes in hand_axes
                if part in AXES and hand in ("any", side) and math.isfinite(axes[part])
            ]
            if levels:
                level = max(levels, key=abs)
                level = (level + 1.0) / 2.0 if part in TWO_SIDED else level
                level = min(max(level, 0.0), 1.0)
                if self._levels.changed(control, level, axis=True):
                    changes.append((exchange.t_receive_ns, exchange.t_receive_ns, control, level))

    def _ask_rays(self) -> int:
        exchange = self._transport.request((b"poses",), CALL_TIMEOUT_S)
        if exchange.frames[0] or len(exchange.frames) < 2:
            return 0
        poses = codec.decode_poses(exchange.frames[1])
        rays: list[Ray] = [None, None]
        for slot, side in self._hand_of.items():
            if side in SIDES and slot < len(poses):
                rays[SIDES.index(side)] = codec.decode_pose(poses[slot])
        return self._tell_rays(exchange.t_receive_ns, exchange.t_receive_ns, rays)
