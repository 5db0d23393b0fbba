"""The life every eye tracker's driver shares: polling, gaps, clocks, reconnecting, commands.

A driver adds a codec and says how to connect, what a message holds and which verbs it has. All
wires are `devices.transports.MessageTransport`s, so each can be teed to a `.wire` log and replayed.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from devices.contracts import (
    GAZE,
    CalibrationOutcome,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.pupil.findings import SeenEyes
from devices.drivers.streaming.exchange_log import ExchangeLog
from devices.drivers.streaming.gaze_findings import Counts, eye_faults, named, stream_faults
from devices.drivers.streaming.gaze_rays import Sample, rows_to_values
from devices.drivers.streaming.one_way_clock import OneWayClock
from devices.drivers.streaming.sample_numbers import SampleNumbers
from devices.drivers.streaming.wire_thread import WireThread
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.spec import AnySpec
from devices.transports import Exchange, Frames, Message, MessageTransport
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.clock_fit import fit_clock, offset_ns
from lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout
from lab.geometry import Vector
from lab.schema import SampleBatch, StreamSchema

ATTEMPT_EVERY_NS = 500 * NS_PER_MS
ATTEMPT_S = 0.4
COMMAND_TIMEOUT_S = 2.0
RECENT_BATCHES = 90
EVERYTHING = (b"",)


class GazeDevice(ABC):
    """Follow the `EyeTracker` contract over a message transport.

    The peer counts as lost when nothing came for `lost_after_s`; the driver then tries again
    twice a second by itself. `seq` follows the device's own counter where it has one: a hole is a
    lost sample. With `exchange_interval_s` a time exchange is asked for that often.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        *,
        rate_hz: float,
        lost_after_s: float = 2.0,
        exchange_interval_s: float | None = None,
    ) -> None:
        self._transport = transport
        self._clock = clock
        self._spec = spec
        self._life = Lifecycle(role)
        self._schema = StreamSchema(GAZE.name, GAZE.fields, rate_hz, GAZE.version)
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._interval_ns = (
            None if exchange_interval_s is None else round(exchange_interval_s * NS_PER_S)
        )
        self._sink: Sink | None = None
        self._counts = Counts()
        self._calibration: CalibrationOutcome | None = None
        self._exchanges = ExchangeLog()
        self._wire = WireThread(role, remedy=spec.remedy, timeout_s=COMMAND_TIMEOUT_S)
        self._asked_ns: int | None = None
        self._next_exchange_ns = self._heard_ns = self._attempt_ns = 0
        self.info = spec.info(role, transport)
        self._reset(clock.now_ns())

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _connect(self, deadline_ns: int) -> None:
        """Say hello on the open wire: identity, version, streams. Raises DeviceError."""

    @abstractmethod
    def _decode(self, message: Message) -> Iterable[Sample]:
        """Return the samples a message completes; count what cannot be read."""

    def _resume(self) -> None:
        """Ask for the stream again after the wire was opened anew; must not wait."""
        return

    def _ask_time(self, now_ns: int) -> None:
        """Begin a time exchange; must not wait. Its answer goes to `_add_pair`."""
        return

    def _begin_stream(self) -> None:
        """Prepare for `start`; must not wait long."""
        return

    def _own_faults(self) -> Iterable[Fault]:
        """Return what this device alone can find."""
        return ()

    # ---- the contract -----------------------------------------------------------------------

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the peer is gone."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Open the wire and say hello; raises DeviceError with a remedy."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._exchanges.clear()
        self._counts = Counts()
        try:
            self._transport.open(deadline_s)
            self._transport.subscribe(0, EVERYTHING)
            self.info = replace(self.info, transport=self._transport.kind)
            self._connect(deadline_ns)
        except DeviceError as problem:
            self._transport.close()
            raise named(problem, self.info.role, self._spec.remedy) from problem
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the gaze stream at this tracker's rate."""
        return (self._schema,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; what came before is thrown away."""
        self._life.require("start", DeviceState.OPEN)
        self._transport.receive(0.0)
        self._begin_stream()
        self._sink = sink
        self._reset(self._clock.now_ns())
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Decode what came; see the contract. While the peer is gone, try again."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            self._wire.claim()
            return self._reconnect(timeout_s)
        self._wire.claim()
        try:
            messages = self._transport.receive(timeout_s)
        except DeviceDisconnected as gone:
            self._lose()
            raise named(gone, self.info.role, self._spec.remedy) from gone
        delivered = self._take(messages) if messages else 0
        now_ns = self._clock.now_ns()
        if now_ns - self._heard_ns > self._lost_after_ns:
            self._lose()
            quiet_s = (now_ns - self._heard_ns) / NS_PER_S
            raise DeviceDisconnected(
                f"nothing came for {quiet_s:.1f} s", role=self.info.role, remedy=self._spec.remedy
            )
        if self._interval_ns is not None and now_ns >= self._next_exchange_ns:
            self._next_exchange_ns = now_ns + self._interval_ns
            if self._asked_ns is None:
                self._asked_ns = now_ns
            self._ask_time(now_ns)
        return delivered

    def stop(self) -> None:
        """Stop delivering; the wire stays open."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._wire.release()
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._sink = None
        self._wire.release()
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report deliveries and the clock fit: exchanges, else the lower envelope of arrivals."""
        health = self._meter.health(self.state, self._clock.now_ns())
        pairs = self._exchanges.recent
        fit = fit_clock(pairs) if pairs else self._one_way.fit()
        if fit is None:
            return health
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name everything odd about stream, clock and tracker since start."""
        waited_ns = 0 if self._asked_ns is None else self._clock.now_ns() - self._asked_ns
        one_way = not self._exchanges.pairs
        return (
            *self._counts.notes.values(),
            *self._own_faults(),
            *stream_faults(
                self.info.role,
                self._counts,
                self._meter,
                lost=self._numbers.lost,
                jumps_ms=self._one_way.jumps_ms if one_way else self._counts.clock_jumps_ms,
                unanswered_s=waited_ns / NS_PER_S,
                remedy=self._spec.remedy,
            ),
            *eye_faults(self.info.role, self._recent),
        )

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return every time exchange since open; empty for a one-way device."""
        return tuple(self._exchanges.pairs)

    def begin_calibration(self) -> None:
        """Refuse: this tracker is not calibrated from here."""
        raise self._refusal("calibrated from here", "calibrate it in its own program")

    def add_reference(self, direction_head: Vector, t_host_ns: int) -> None:
        """Accept and ignore: this tracker takes no reference targets from outside."""
        return

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Refuse: this tracker is not calibrated from here."""
        raise self._refusal("calibrated from here", "calibrate it in its own program")

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Refuse: this tracker keeps no recording that could be annotated."""
        raise self._refusal("annotated", "the marker stands in Visavis' own recording")

    @property
    def calibration(self) -> CalibrationOutcome | None:
        """The verdict of the last calibration since open, with its final quality."""
        return self._calibration

    # ---- for drivers ------------------------------------------------------------------------

    def _ask(self, frames: Frames, deadline_ns: int) -> Exchange:
        """Send a request and wait; raises DeviceTimeout with the remedy."""
        left_s = max(0.001, (deadline_ns - self._clock.now_ns()) / NS_PER_S)
        try:
            return self._transport.request(frames, left_s)
        except DeviceTimeout as cause:
            raise DeviceTimeout(
                "nobody answered in time", role=self.info.role, remedy=self._spec.remedy
            ) from cause

    def _add_pair(self, pair: ClockPair) -> None:
        self._asked_ns = None
        jump_ms = self._exchanges.add(pair)
        if jump_ms is not None:
            self._counts.clock_jumps_ms.append(jump_ms)

    def _to_device_ns(self, t_host_ns: int) -> int:
        """Map a host time to the device's clock; the time itself while nothing is known."""
        pairs = self._exchanges.recent
        if pairs:
            return t_host_ns - offset_ns(pairs)
        fit = self._one_way.fit()
        return t_host_ns if fit is None else t_host_ns - fit.offset_ns

    def _note(self, key: str, fault: Fault | None) -> None:
        """Set or remove a fault that holds until removed."""
        if fault is None:
            self._counts.notes.pop(key, None)
        else:
            self._counts.notes[key] = fault

    def _warning(self, message: str, remedy: str) -> Fault:
        return Fault(self.info.role, "warning", message, remedy)

    def _blocking(self, message: str, remedy: str) -> Fault:
        return Fault(self.info.role, "blocking", message, remedy)

    def _wait_until(self, reached: Callable[[], bool], deadline_ns: int, what: str) -> None:
        """Keep polling until something is reached; raises DeviceTimeout at the deadline."""
        while not reached():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout(
                    f"no {what} in time", role=self.info.role, remedy=self._spec.remedy
                )
            if self._wire.is_elsewhere:
                self._clock.sleep_until_ns(now_ns + 5 * NS_PER_MS)
            elif self._life.state is DeviceState.STREAMING:
                self.poll(0.02)
            else:
                for message in self._transport.receive(0.02):
                    tuple(self._decode(message))

    def _refusal(self, what: str, remedy: str) -> DeviceError:
        return DeviceError(
            f"a {self.info.driver} tracker cannot be {what}", role=self.info.role, remedy=remedy
        )

    # ---- inside -----------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        self._meter = StreamMeter(self._schema.nominal_rate_hz)
        self._counts = Counts(notes=self._counts.notes)
        self._one_way = OneWayClock()
        self._recent = SeenEyes(RECENT_BATCHES)
        self._numbers = SampleNumbers(round(10 * self._schema.nominal_rate_hz))
        self._heard_ns = now_ns
        self._asked_ns = None
        self._next_exchange_ns = now_ns
        self._attempt_ns = now_ns

    def _take(self, messages: Sequence[Message]) -> int:
        rows: list[bytes] = []
        stamps: list[int] = []
        arrivals: list[int] = []
        seqs: list[int] = []
        for message in messages:
            for sample in self._decode(message):
                seqs.append(self._numbers.following(sample.counter))
                stamps.append(sample.t_device_ns)
                arrivals.append(message.t_host_ns)
                rows.append(sample.row)
        self._heard_ns = max(self._heard_ns, messages[-1].t_host_ns)
        sink = self._sink
        if not rows or sink is None:
            return 0
        self._meter.update(stamps, arrivals[-1])
        self._one_way.add(stamps, arrivals)
        values = rows_to_values(rows)
        left, right = values["left_valid"], values["right_valid"]
        if not left.any() and not right.any():  # a tracker of combined gaze alone
            left = right = values["valid"]
        self._recent.add(len(rows), int(left.sum()), int(right.sum()))
        sink(
            SampleBatch(
                self._schema,
                np.array(seqs, np.int64),
                np.array(stamps, np.int64),
                np.array(arrivals, np.int64),
                values,
            )
        )
        return len(rows)

    def _lose(self) -> None:
        self._life.state = DeviceState.FAULT
        self._attempt_ns = self._clock.now_ns()

    def _reconnect(self, timeout_s: float) -> int:
        now_ns = self._clock.now_ns()
        if now_ns >= self._attempt_ns:
            self._attempt_ns = now_ns + ATTEMPT_EVERY_NS
            try:
                self._transport.close()
                self._transport.open(ATTEMPT_S)
                self._transport.subscribe(0, EVERYTHING)
                self._resume()
            except DeviceError:
                self._transport.close()
                self._pause(timeout_s)
                return 0  # told already; the next attempt follows by itself
        try:
            messages = self._transport.receive(timeout_s)
        except DeviceError:
            self._pause(timeout_s)
            return 0
        if not messages:
            return 0
        self._numbers.reconnected()
        self._heard_ns = self._clock.now_ns()
        delivered = self._take(messages)
        self._life.state = DeviceState.STREAMING
        self._next_exchange_ns = now_ns
        return delivered

    def _pause(self, timeout_s: float) -> None:
        if timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
