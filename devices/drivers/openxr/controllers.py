"""Take buttons, triggers and rays of the controllers of an OpenXR runtime; let them buzz.

The state of both hands is asked for at a steady rate; a press has the time of the answer in which
it was first seen. A controller that is off or out of sight points nowhere.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgpack

from visavis.devices.contracts import DeviceState, Fault
from visavis.devices.drivers.openvr.trackers import PolledPoses
from visavis.devices.drivers.openxr.actions import BUTTON_STATES, BUTTONS, HAND, HANDS
from visavis.devices.drivers.openxr.packing import INSTANT, pose_of
from visavis.devices.drivers.openxr.spec import OPENXR_CONTROLLERS
from visavis.devices.drivers.runtimes.controllers import Change, Ray, RuntimeControllers
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, ProtocolViolation

TRIGGER_AXIS = "trigger axis"
RATE_HZ = 90.0
SILENT_NS = NS_PER_S

_PER_HAND = struct.Struct("<" + (BUTTON_STATES.format + HAND.format).replace("<", ""))


class OpenXrControllers(RuntimeControllers):
    """Follow the `ResponseInput` contract over the controllers of an OpenXR session."""

    max_pulse_us = 1_000_000
    parts = (*BUTTONS, TRIGGER_AXIS)
    usual_controls: Mapping[str, str] = {
        "select": "any select",
        "menu": "any menu",
        "grip": "any grip",
    }

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        controls: Mapping[str, str] | None = None,
    ) -> None:
        poller = PolledPoses(transport, clock, RATE_HZ, ask=b"hands")
        self._is_there = (False, False)
        super().__init__(role, poller, clock, OPENXR_CONTROLLERS, controls=controls, rays=True)

    def poll(self, timeout_s: float) -> int:
        """Deliver what changed and where both hands point."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            self._try_again("still away")
            self._last_ns = self._clock.now_ns()
        row_count = sum(self._take(message) for message in self._transport.receive(timeout_s))
        if self._clock.now_ns() - self._last_ns > SILENT_NS:
            self._life.state = DeviceState.FAULT
            text = "the OpenXR session gives no state of the hands"
            raise DeviceDisconnected(text, role=self.info.role, remedy=self._spec.remedy)
        return row_count

    def check(self) -> tuple[Fault, ...]:
        """Report missing controllers and a lost session."""
        remedy = self._spec.remedy
        if self.state is DeviceState.FAULT:
            return (self._blocking("lost the OpenXR session", remedy),)
        if self.state is DeviceState.STREAMING and not any(self._is_there):
            return (self._warning("no controller is on, or none is in sight", remedy),)
        return ()

    # ---- private --------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        """Ask for the name of the runtime; the session opens without a controller too."""
        frames = self._transport.request((b"runtime",), 1.0).frames
        if frames[0] or len(frames) < 2:
            raise ProtocolViolation("the OpenXR runtime does not answer")
        name = msgpack.unpackb(frames[1])[0]
        self.info = replace(self.info, model=f"OpenXR controllers ({name})")

    def _begin_stream(self, earlier: Sequence[Message]) -> None:
        """Let buttons that are held down now count as pressed earlier."""
        for message in earlier:
            self._take(message)

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._last_ns = now_ns

    def _buzz(self, hand: str, duration_us: int) -> None:
        for number, side in enumerate(HANDS):
            if hand in ("any", side):
                self._transport.post((b"buzz", f"{number} {duration_us}".encode()))

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
            rays.append(pose_of(int(numbers[5]), numbers[6:], fully_tracked=False))
        self._is_there = (rays[0] is not None, rays[1] is not None)
        changes: list[Change] = []
        for control, (wanted_hand, part) in enumerate(self._hands_and_parts):
            sides = zip(HANDS, states, strict=True)
            level = max(state[part] for side, state in sides if wanted_hand in ("any", side))
            level = min(level, 1.0)
            if level >= 0.0 and self._levels.changed(control, level, axis=part == TRIGGER_AXIS):
                changes.append((message.t_host_ns, message.t_host_ns, control, level))
        if self._sink is None:
            return 0
        return self._tell(changes) + self._tell_rays(now, message.t_host_ns, rays)
