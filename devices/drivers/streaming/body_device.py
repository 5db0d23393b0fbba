"""The life that body trackers on a message wire share: polling, order, clock, reconnecting.

A driver adds a codec: how to connect, what a message holds, what keeps the stream alive. Samples
that arrive after a later one are left out and counted; a hole in `seq` is a lost sample.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from devices.contracts import (
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
    body_schema,
)
from devices.drivers.streaming.one_way_clock import OneWayClock
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.segment_watch import SegmentWatch
from devices.spec import AnySpec
from devices.transports import Message, MessageTransport
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.errors import DeviceDisconnected, DeviceError
from lab.geometry import Vector
from lab.schema import SampleBatch, StreamSchema

Severity = Literal["warning", "blocking"]
Flags = npt.NDArray[np.bool_]

ATTEMPT_EVERY_NS = 500 * NS_PER_MS
ATTEMPT_S = 0.4
RESTART_AFTER_S = 10.0
"""A counter further off than this much of the stream is a stream that began anew."""


@dataclass(frozen=True, eq=False)
class BodySample:
    """One sample: positions (n, 3), orientations (n, 4) (w, x, y, z), flags (n,), all in world.

    Rows that are not valid are NaN. `counter` is the device's own; None where it has none.
    """

    counter: int | None
    t_device_ns: int
    position_m: Vector
    orientation_wxyz: Vector
    valid: Flags


class BodyDevice(ABC):
    """Follow the `BodyTracker` contract over a message transport.

    The peer counts as lost when nothing came for `lost_after_s`; the driver then tries again
    twice a second by itself.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        *,
        segments: Sequence[str],
        rate_hz: float,
        lost_after_s: float = 2.0,
    ) -> None:
        self._transport = transport
        self._clock = clock
        self._spec = spec
        self._life = Lifecycle(role)
        self.segments = tuple(segments)
        self._schema = body_schema(self.segments, rate_hz)
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._sink: Sink | None = None
        self._notes: dict[str, Fault] = {}
        self.info = spec.info(role, transport)
        self._reset(clock.now_ns())

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _connect(self, deadline_ns: int) -> None:
        """Say hello on the open wire and learn who is there; raises DeviceError."""

    @abstractmethod
    def _decode(self, message: Message) -> Iterable[BodySample]:
        """Return the samples a message completes; count what cannot be read in `_malformed`."""

    def _resume(self) -> None:
        """Ask for the stream again after the wire was opened anew; must not wait."""
        return

    def _tick(self, now_ns: int) -> None:
        """Do what is due while streaming, such as keeping the stream alive; must not wait."""
        return

    # ---- the contract -----------------------------------------------------------------------

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the peer is gone."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Open the wire and say hello; raises DeviceError with a remedy."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._notes = {}
        try:
            self._transport.open(deadline_s)
            self._transport.subscribe(0, (b"",))
            self.info = replace(
                self.info,
                transport=self._transport.kind,
                is_simulated=self._transport.is_simulated,
            )
            self._connect(deadline_ns)
        except DeviceError as problem:
            self._transport.close()
            if problem.role:
                raise
            message = str(problem).removesuffix(f"; {problem.remedy}")
            remedy = problem.remedy or self._spec.remedy
            raise type(problem)(message, role=self.info.role, remedy=remedy) from problem
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the body stream."""
        return (self._schema,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; what came before is thrown away."""
        self._life.require("start", DeviceState.OPEN)
        self._transport.receive(0.0)
        self._sink = sink
        self._reset(self._clock.now_ns())
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Decode what came; see the contract. While the peer is gone, try again."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            return self._reconnect(timeout_s)
        messages = self._transport.receive(timeout_s)
        delivered = self._take(messages) if messages else 0
        now_ns = self._clock.now_ns()
        if now_ns - self._heard_ns > self._lost_after_ns:
            self._life.state = DeviceState.FAULT
            quiet_s = (now_ns - self._heard_ns) / NS_PER_S
            raise DeviceDisconnected(
                f"nothing came for {quiet_s:.1f} s", role=self.info.role, remedy=self._spec.remedy
            )
        self._tick(now_ns)
        return delivered

    def stop(self) -> None:
        """Stop delivering; the wire stays open."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._sink = None
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report deliveries and the lower-envelope fit of arrivals over device times."""
        health = self._meter.health(self.state, self._clock.now_ns())
        fit = self._one_way.fit()
        if fit is None:
            return health
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name everything odd about stream, clock and segments since start."""
        role = self.info.role
        faults = list(self._notes.values())
        jumps_ms = self._one_way.jumps_ms
        for count, text, remedy in (
            (self._malformed, "messages could not be read", "keep the .wire log and report it"),
            (self._lost, "samples were lost on the way", "use a cable; check network and load"),
            (self._late, "samples came late or twice and were left out", "check the network"),
            (self._restarts, "times the stream began anew", "stop other recordings of this body"),
            (len(jumps_ms), "jumps of the tracker's clock", "let nobody set its clock"),
        ):
            if count:
                faults.append(Fault(role, "warning", f"{count} {text}", remedy))
        if self._seen is not None and not self._seen.all():
            lost = [s for s, seen in zip(self.segments, self._seen, strict=True) if not seen]
            text = f"not tracked now: {', '.join(lost)}"
            remedy = "check markers, sensors and line of sight"
            severity: Severity = "blocking" if len(lost) == len(self.segments) else "warning"
            faults.append(Fault(role, severity, text, remedy))
        frozen = self._watch.fault(role)
        if frozen is not None:
            faults.append(frozen)
        return tuple(faults)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: the stream goes one way; see `health` for the fit of its arrivals."""
        return ()

    # ---- inside -----------------------------------------------------------------------------

    def _note(self, key: str, message: str, remedy: str) -> None:
        self._notes[key] = Fault(self.info.role, "warning", message, remedy)

    def _reset(self, now_ns: int) -> None:
        self._meter = StreamMeter(self._schema.nominal_rate_hz)
        self._one_way = OneWayClock()
        self._far = round(RESTART_AFTER_S * self._schema.nominal_rate_hz)
        self._malformed = self._lost = self._late = self._restarts = 0
        self._seq = -1
        self._counter: int | None = None
        self._last_device_ns: int | None = None
        self._seen: Flags | None = None
        self._watch = SegmentWatch(self.segments)
        self._looked_ns: int | None = None
        self._heard_ns = now_ns
        self._attempt_ns = now_ns

    def _take(self, messages: Sequence[Message]) -> int:
        samples: list[BodySample] = []
        seqs: list[int] = []
        arrivals: list[int] = []
        for message in messages:
            for sample in self._decode(message):
                if self._in_order(sample):
                    samples.append(sample)
                    seqs.append(self._seq)
                    arrivals.append(message.t_host_ns)
        self._heard_ns = max(self._heard_ns, messages[-1].t_host_ns)
        sink = self._sink
        if not samples or sink is None:
            return 0
        stamps = [sample.t_device_ns for sample in samples]
        values = np.empty(len(samples), self._schema.dtype)
        for i, sample in enumerate(samples):
            row = values[i]
            row["position_m"] = sample.position_m
            row["orientation_wxyz"] = sample.orientation_wxyz
            row["valid"] = sample.valid
            since_ns = 0 if self._looked_ns is None else sample.t_device_ns - self._looked_ns
            self._watch.look(sample.position_m, sample.orientation_wxyz, max(since_ns, 0))
            self._looked_ns = sample.t_device_ns
        self._seen = samples[-1].valid
        self._meter.update(stamps, arrivals[-1])
        self._one_way.add(stamps, arrivals)
        sink(
            SampleBatch(
                self._schema,
                np.array(seqs, np.int64),
                np.array(stamps, np.int64),
                np.array(arrivals, np.int64),
                values,
            )
        )
        return len(samples)

    def _in_order(self, sample: BodySample) -> bool:
        """Number the sample; False when it is older than one that was delivered."""
        counter, before = sample.counter, self._counter
        if counter is None:
            self._seq += 1
            return True
        step = 1
        if before is not None:
            ahead = counter - before
            if -self._far < ahead <= 0:
                self._late += 1
                return False
            if 0 < ahead <= self._far:
                step = ahead
                self._lost += ahead - 1
            else:
                self._restarts += 1
        self._counter = counter
        self._seq += step
        return True

    def _reconnect(self, timeout_s: float) -> int:
        now_ns = self._clock.now_ns()
        if now_ns >= self._attempt_ns:
            self._attempt_ns = now_ns + ATTEMPT_EVERY_NS
            try:
                self._transport.close()
                self._transport.open(ATTEMPT_S)
                self._transport.subscribe(0, (b"",))
                self._resume()
            except DeviceError as problem:
                self._transport.close()
                self._note("reconnect", f"still away: {problem}", self._spec.remedy)
                return 0
        messages = self._transport.receive(timeout_s)
        if not messages:
            return 0
        delivered = self._take(messages)
        if delivered:
            self._notes.pop("reconnect", None)
            self._life.state = DeviceState.STREAMING
        return delivered
