"""The common part of both runtimes' controllers: mapping of controls, rows, pulses."""

import math
import struct
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from visavis.devices.contracts import POINTER, RESPONSES, DeviceState, Health
from visavis.devices.drivers.streaming.message_device import MessageDevice, legible
from visavis.devices.meter import StreamMeter
from visavis.devices.plausible import is_place
from visavis.devices.spec import AnySpec
from visavis.devices.transports import MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceError
from visavis.lab.schema import SampleBatch, StreamSchema

SIDES = ("left", "right")
ATTEMPT_S = 0.2
MIN_STEP_01 = 0.01
"""An axis is reported when it has moved by this much, or has reached an end."""

Ray = tuple[Sequence[float], Sequence[float]] | None
"""Position and orientation (w, x, y, z); None: not tracked."""
Change = tuple[int, int, int, float]
"""Time of the event, time of its arrival (ns), control, value."""

_RAY_ROW = struct.Struct("<B3f4f?")


class Levels:
    """Remember the value of every control, and find changes."""

    def __init__(self) -> None:
        self._reported_01: dict[int, float] = {}

    def changed(self, control: int, value_01: float, *, axis: bool) -> bool:
        """Tell whether a value differs enough to be reported; if so, remember it."""
        before = self._reported_01.get(control, 0.0)
        change = abs(value_01 - before)
        at_end = axis and value_01 in (0.0, 1.0) and change > 0.0
        if change < MIN_STEP_01 and not at_end:
            return False
        self._reported_01[control] = value_01
        return True


def response_batch(seq: int, rows: Sequence[Change]) -> SampleBatch:
    """Return rows of `RESPONSES` from `seq` on."""
    event_times_ns, arrival_times_ns, controls, levels = zip(*rows, strict=True)
    values = np.empty(len(rows), RESPONSES.dtype)
    values["control"], values["value_01"] = controls, levels
    return SampleBatch(
        RESPONSES,
        np.arange(seq, seq + len(rows)),
        np.array(event_times_ns, np.int64),
        np.array(arrival_times_ns, np.int64),
        values,
    )


def ray_batch(seq: int, t_device_ns: int, t_host_ns: int, rays: Sequence[Ray]) -> SampleBatch:
    """Return rows of `POINTER` from `seq` on, one per hand, left first."""
    row_bytes = []
    for hand, ray in enumerate(rays):
        pose = ray if ray is not None and is_place(*ray[0]) else None
        numbers = [math.nan] * 7 if pose is None else [*pose[0], *pose[1]]
        row_bytes.append(_RAY_ROW.pack(hand, *numbers, pose is not None))
    n = len(row_bytes)
    return SampleBatch(
        POINTER,
        np.arange(seq, seq + n),
        np.full(n, t_device_ns, np.int64),
        np.full(n, t_host_ns, np.int64),
        np.frombuffer(b"".join(row_bytes), POINTER.dtype),
    )


class RuntimeControllers(MessageDevice):
    """Follow the `ResponseInput` contract over the controllers of a runtime.

    `controls` maps the experiment's names to a hand and a button or axis: "left grip", "any
    trigger", "right trigger axis". With `rays` there is a second stream, `POINTER`.
    """

    max_pulse_us = 0
    parts: Sequence[str] = ()
    usual_controls: Mapping[str, str] = {}

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        *,
        controls: Mapping[str, str] | None,
        rays: bool,
    ) -> None:
        control_map = dict(controls or self.usual_controls)
        self.controls = tuple(control_map)
        self._hands_and_parts = [
            self._parsed(role, name, text) for name, text in control_map.items()
        ]
        super().__init__(role, transport, clock, spec)
        self._rays = rays
        self._reset(clock.now_ns())

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _buzz(self, hand: str, duration_us: int) -> None:
        """Let the controllers of a hand, or of any, vibrate."""

    # ---- the contract -----------------------------------------------------------------------

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the responses and, where wanted, the rays."""
        return (RESPONSES, POINTER) if self._rays else (RESPONSES,)

    def health(self) -> Health:
        """Report the rows of both streams so far."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, received=self._seq + self._ray_seq)

    def pulse(self, hand: str, duration_us: int) -> None:
        """Buzz the controller of a hand ("left", "right", "any") for up to `max_pulse_us`."""
        self._life.require("pulse", DeviceState.OPEN, DeviceState.STREAMING)
        if hand not in (*SIDES, "any") or not 0 < duration_us <= self.max_pulse_us:
            raise ConfigError(
                f"{self.info.role}: a pulse needs left, right or any and 1 to {self.max_pulse_us} "
                f"µs, not {hand!r} and {duration_us}"
            )
        self._buzz(hand, duration_us)

    # ---- for drivers ------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        self._levels = Levels()
        self._meter = StreamMeter(0.0)
        self._seq = self._ray_seq = self._malformed = 0

    def _tell(self, changes: Sequence[Change]) -> int:
        """Deliver the changes; return the number of rows."""
        if changes and self._sink is not None:
            self._meter.update([change[0] for change in changes], changes[-1][1])
            self._sink(response_batch(self._seq, changes))
            self._seq += len(changes)
        return len(changes)

    def _tell_rays(self, t_device_ns: int, t_host_ns: int, rays: Sequence[Ray]) -> int:
        """Deliver the rays of both hands; return the number of rows."""
        if self._sink is None:
            return 0
        self._sink(ray_batch(self._ray_seq, t_device_ns, t_host_ns, rays))
        self._ray_seq += len(rays)
        return len(rays)

    def _try_again(self, what: str) -> None:
        """Try at intervals to reach a lost runtime; raises DeviceDisconnected until it is back."""
        if not self._attempt_is_due():
            raise DeviceDisconnected(what, role=self.info.role, remedy=self._spec.remedy)
        try:
            self._transport.open(ATTEMPT_S)
            with legible("what it answered when it came back", self._spec.remedy):
                self._connect(self._clock.now_ns())
        except DeviceError as problem:
            raise DeviceDisconnected(
                f"still away: {problem}", role=self.info.role, remedy=self._spec.remedy
            ) from problem
        self._life.state = DeviceState.STREAMING

    def _parsed(self, role: str, name: str, text: str) -> tuple[str, str]:
        hand, _, part = text.partition(" ")
        if hand not in (*SIDES, "any") or part not in self.parts:
            raise ConfigError(
                f"{role}: control {name!r} is {text!r}; say left, right or any and one "
                f"of {', '.join(self.parts)}"
            )
        return hand, part
