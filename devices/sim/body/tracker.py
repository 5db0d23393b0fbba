"""A body tracker without a wire: measures the segments of a simulated body on the session clock.

Not modelled: drift, soft tissue, magnetic disturbance, latency. For the wire of a real suit use
its driver on its simulator. Faults: silence (no samples), frozen (poses stand still), part_lost
(a segment is NaN and not valid), part_frozen (a segment repeats its last pose), standby (all are
invalid), disconnect.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import (
    DeviceState,
    Fault,
    Health,
    MovingBody,
    Sink,
    body_schema,
)
from visavis.devices.faults import FaultSchedule
from visavis.devices.lifecycle import Lifecycle, OnSessionClock
from visavis.devices.meter import StreamMeter
from visavis.devices.segment_watch import SegmentWatch
from visavis.devices.sim.body.spec import SIMULATED_BODY
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected
from visavis.lab.schema import SampleBatch, StreamSchema, empty_values

MAX_BACKLOG_NS = NS_PER_S


class SimulatedBodyTracker(OnSessionClock):
    """Follow the `BodyTracker` contract over a simulated body."""

    segments = BODY_JOINTS

    def __init__(
        self,
        role: str,
        body: MovingBody,
        clock: Clock,
        *,
        rate_hz: float = 100.0,
        faults: FaultSchedule | None = None,
    ) -> None:
        self._body = body
        self._clock = clock
        self._faults = faults if faults is not None else FaultSchedule()
        self._origin_ns = clock.now_ns()
        self._life = Lifecycle(role)
        self._schema = body_schema(self.segments, rate_hz)
        self._period_ns = round(NS_PER_S / rate_hz)
        self._meter = StreamMeter(rate_hz)
        self._sink: Sink | None = None
        self._next = 0
        self._lost_segments: tuple[str, ...] = ()
        self._frozen = False
        self._watch = SegmentWatch(self.segments)
        self._looked_ns = -1
        self._last = empty_values(self._schema, 1)
        self.info = SIMULATED_BODY.info(role, None)

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the body stream."""
        return (self._schema,)

    def start(self, sink: Sink) -> None:
        """Begin to measure at the next multiple of the period."""
        self._life.require("start", DeviceState.OPEN)
        self._sink = sink
        self._next = self._clock.now_ns() // self._period_ns + 1
        self._first = self._next
        self._life.state = DeviceState.STREAMING

    def due_ns(self) -> int:
        """Return when the next sample is taken; see `visavis.devices.pump.Foreseeing`."""
        return 0 if self._faults.faults else self._next * self._period_ns

    def poll(self, timeout_s: float) -> int:
        """Measure every instant that has passed since the last call."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING)
        now_ns = self._clock.now_ns()
        faults = self._faults.faults
        last = now_ns // self._period_ns
        if faults and self._faults.active("disconnect", now_ns - self._origin_ns):
            self._next = last + 1
            raise DeviceDisconnected("the simulated body tracker is away", role=self.info.role)
        first = max(self._next, last - MAX_BACKLOG_NS // self._period_ns)
        n = last - first + 1
        if n <= 0 or self._sink is None:
            return 0
        self._next = last + 1
        numbers = np.arange(first, last + 1, dtype=np.int64)
        stamps, seq = numbers * self._period_ns, numbers - self._first
        values = np.empty(n, self._schema.dtype)
        position, orientation = self._body.segments(self.segments, stamps)
        values["position_m"], values["orientation_wxyz"] = position, orientation
        values["valid"] = True
        if faults:
            keep = self._spoil(values, stamps - self._origin_ns)
            if not keep.any():
                return 0
            stamps, seq, values = stamps[keep], seq[keep], values[keep]
            self._last = values[-1:].copy()
        self._meter.update(stamps.tolist(), last * self._period_ns)
        self._sink(SampleBatch(self._schema, seq, stamps, stamps, values))
        return len(values)

    def health(self) -> Health:
        """Report samples delivered."""
        return replace(self._meter.health(self.state, self._clock.now_ns()))

    def check(self) -> tuple[Fault, ...]:
        """Report segments that are not tracked and frozen poses."""
        role = self.info.role
        faults = []
        if self._lost_segments:
            text = f"not tracked now: {', '.join(self._lost_segments)}"
            remedy = "check markers, sensors and line of sight"
            everything = len(self._lost_segments) == len(self.segments)
            faults.append(Fault(role, "blocking" if everything else "warning", text, remedy))
        if self._frozen:
            remedy = "look at the tracker's program; restart its stream"
            faults.append(Fault(role, "warning", "the poses stand perfectly still", remedy))
        frozen = self._watch.fault(role)
        if frozen is not None:
            faults.append(frozen)
        return tuple(faults)

    def _spoil(
        self, values: npt.NDArray[np.void], since_ns: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.bool_]:
        keep = np.ones(len(values), bool)
        self._lost_segments, self._frozen = (), False
        for i, t_ns in enumerate(since_ns.tolist()):
            if self._faults.active("silence", t_ns):
                keep[i] = False
            if self._faults.active("frozen", t_ns):
                values[i] = self._last[0] if i == 0 else values[i - 1]
                self._frozen = True
            for fault in self._faults.of_kind("part_frozen"):
                before = self._last[0] if i == 0 else values[i - 1]
                s = self.segments.index(fault.text)
                if fault.start_ns <= t_ns < fault.end_ns and before["valid"][s]:
                    for name in ("position_m", "orientation_wxyz"):
                        values[name][i, s] = before[name][s]
            part = self._faults.active("part_lost", t_ns)
            standby = self._faults.active("standby", t_ns)
            if part or standby:
                self._lost_segments = self.segments if part is None else (part.text,)
                lost_segments = [self.segments.index(name) for name in self._lost_segments]
                for name in ("position_m", "orientation_wxyz"):
                    values[name][i, lost_segments] = np.nan
                values["valid"][i, lost_segments] = False
            if keep[i]:
                self._watch.look(
                    values["position_m"][i],
                    values["orientation_wxyz"][i],
                    t_ns - self._looked_ns if self._looked_ns >= 0 else 0,
                )
                self._looked_ns = t_ns
        return keep
