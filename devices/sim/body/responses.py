"""Buttons and axes pressed by a simulated body.

Not modelled: contact bounce, polling intervals of the controller, radio latency. Faults:
late_start and disconnect (away), silence (nothing arrives), loss, duplicate (`amount` is the share
of presses and releases), burst (held back, all arrive when the window ends).
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from visavis.devices.body_contract import foresees_presses
from visavis.devices.contracts import (
    RESPONSES,
    Body,
    DeviceState,
    Fault,
    ForeseeableHand,
    Health,
    Sink,
)
from visavis.devices.faults import FaultSchedule
from visavis.devices.lifecycle import Lifecycle, OnSessionClock
from visavis.devices.meter import StreamMeter
from visavis.devices.sim.body.spec import SIMULATED_RESPONSES, SimulatedResponsesOptions
from visavis.devices.sim.wire_noise import WireNoise
from visavis.lab.clock import NEVER_NS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, ProtocolViolation
from visavis.lab.schema import SampleBatch, StreamSchema

AWAY = "the simulated response device is away"
REMEDY = "look at its batteries and its connection"
Press: TypeAlias = tuple[int, str, float]
"""Session time, control, value from 0 to 1."""


class SimulatedResponses(OnSessionClock):
    """Follow the `ResponseInput` contract over a simulated body's presses."""

    def __init__(
        self,
        role: str,
        body: Body,
        clock: Clock,
        *,
        controls: Sequence[str] = SimulatedResponsesOptions.controls,
        faults: FaultSchedule | None = None,
        seed: int = 0,
    ) -> None:
        self.controls = tuple(controls)
        self._body = body
        self._clock = clock
        self._life = Lifecycle(role)
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._sink: Sink | None = None
        self._seq = 0
        self._faults = faults if faults is not None else FaultSchedule()
        self._origin_ns = clock.now_ns()
        self._noise = WireNoise(seed, body)
        self._held_presses: list[Press] = []
        self._hand = (
            body if isinstance(body, ForeseeableHand) and foresees_presses(type(body)) else None
        )
        self.info = SIMULATED_RESPONSES.info(role, None)

    def open(self, deadline_s: float) -> None:
        """Become ready; there is nothing to connect to, but it may be away."""
        self._life.require("open", DeviceState.CLOSED)
        if self._is_away():
            raise DeviceNotFound(AWAY, role=self.info.role, remedy=REMEDY)
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the response stream."""
        return (RESPONSES,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; presses made before are gone."""
        self._life.require("start", DeviceState.OPEN)
        for _ in self._body.presses(self._clock.now_ns()):
            pass
        self._held_presses = []
        self._sink = sink
        self._seq = 0
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Deliver the body's presses; without any it waits `timeout_s` on the clock."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING)
        rows = self._take_arrived()
        if not rows and timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
            rows = self._take_arrived()
        if not rows or self._sink is None:
            return 0
        values = np.empty(len(rows), RESPONSES.dtype)
        values["control"] = [self._index(control) for _, control, _ in rows]
        values["value_01"] = [value for _, _, value in rows]
        stamps = np.array([t_ns for t_ns, _, _ in rows], np.int64)
        seq = np.arange(self._seq, self._seq + len(rows))
        self._seq += len(rows)
        self._meter.update(stamps.tolist(), int(stamps[-1]))
        self._sink(SampleBatch(RESPONSES, seq, stamps, stamps, values))
        return len(rows)

    def due_ns(self) -> int:
        """Return until when nothing is pressed; 0 if the body cannot tell or faults are scheduled.

        See `visavis.devices.pump.Foreseeing`.
        """
        if self._hand is None or self._faults.faults:
            return 0
        press_ns = self._hand.next_press_ns()
        return NEVER_NS if press_ns is None else press_ns

    def health(self) -> Health:
        """Report the presses so far."""
        return self._meter.health(self.state, self._clock.now_ns())

    def check(self) -> tuple[Fault, ...]:
        """Find nothing: there is no hardware."""
        return ()

    def _is_away(self) -> bool:
        since_ns = self._clock.now_ns() - self._origin_ns
        return any(self._faults.active(kind, since_ns) for kind in ("late_start", "disconnect"))

    def _take_arrived(self) -> list[Press]:
        """Return the presses that have arrived; raises DeviceDisconnected while it is away."""
        rows = list(self._body.presses(self._clock.now_ns()))
        if not self._faults.faults:
            return rows
        if self._is_away():
            self._held_presses = []
            raise DeviceDisconnected(AWAY, role=self.info.role, remedy=REMEDY)
        since_ns = self._clock.now_ns() - self._origin_ns
        rows = [press for row in rows for press in self._spoil(row)]
        if self._faults.active("burst", since_ns):
            self._held_presses += rows
            return []
        rows, self._held_presses = [*self._held_presses, *rows], []
        return rows

    def _spoil(self, press: Press) -> list[Press]:
        since_ns = press[0] - self._origin_ns
        if self._faults.active("silence", since_ns):
            return []
        for kind, copies in (("loss", 0), ("duplicate", 2)):
            fault = self._faults.active(kind, since_ns)
            if fault is not None and self._noise.rng().random() < fault.amount:
                return [press] * copies
        return [press]

    def _index(self, control: str) -> int:
        if control not in self.controls:
            raise ProtocolViolation(
                f"the body pressed {control!r}, which is not one of {', '.join(self.controls)}",
                role=self.info.role,
                remedy="name this control in the configuration",
            )
        return self.controls.index(control)
