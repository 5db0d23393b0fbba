"""Buttons and axes pressed by a simulated body.

Not modelled: contact bounce, polling intervals of the controller, radio latency.
"""

from collections.abc import Sequence

import numpy as np

from devices.contracts import (
    RESPONSES,
    Body,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.sim.body.spec import SIMULATED_RESPONSES
from lab.clock import NS_PER_S, Clock
from lab.errors import ProtocolViolation
from lab.schema import SampleBatch, StreamSchema

DEFAULT_CONTROLS = ("trigger",)


class SimulatedResponses:
    """Follow the `ResponseInput` contract over a simulated body's presses."""

    def __init__(
        self,
        role: str,
        body: Body,
        clock: Clock,
        *,
        controls: Sequence[str] = DEFAULT_CONTROLS,
    ) -> None:
        self.controls = tuple(controls)
        self._body = body
        self._clock = clock
        self._life = Lifecycle(role)
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._sink: Sink | None = None
        self._seq = 0
        self.info = SIMULATED_RESPONSES.info(role, None)

    @property
    def state(self) -> DeviceState:
        """Where it is in its life."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Become ready; there is nothing to connect to."""
        self._life.require("open", DeviceState.CLOSED)
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the response stream."""
        return (RESPONSES,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; presses made before are gone."""
        self._life.require("start", DeviceState.OPEN)
        for _ in self._body.presses(self._clock.now_ns()):
            pass
        self._sink = sink
        self._seq = 0
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Deliver what the body pressed; waits `timeout_s` on the clock when it did not."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING)
        rows = list(self._body.presses(self._clock.now_ns()))
        if not rows and timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
            rows = list(self._body.presses(self._clock.now_ns()))
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

    def stop(self) -> None:
        """Stop delivering."""
        self._life.require("stop", DeviceState.STREAMING)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Release nothing; idempotent."""
        self._sink = None
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report the presses so far."""
        return self._meter.health(self.state, self._clock.now_ns())

    def check(self) -> tuple[Fault, ...]:
        """Find nothing: there is no hardware."""
        return ()

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: it runs on the session clock."""
        return ()

    def _index(self, control: str) -> int:
        if control not in self.controls:
            raise ProtocolViolation(
                f"the body pressed {control!r}, which is not one of {', '.join(self.controls)}",
                role=self.info.role,
                remedy="name this control in the configuration",
            )
        return self.controls.index(control)
