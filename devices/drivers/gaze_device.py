"""The life every eye tracker's driver shares: polling, gaps, clocks, reconnecting, commands.

A driver adds a codec and says how to connect, what a message holds and which verbs it has. All
wires are `devices.transports.MessageTransport`s, so each can be teed to a `.wire` log and replayed.
"""

import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NoAnswerInTime
from dataclasses import dataclass, field, replace

import numpy as np

from devices.contracts import (
    GAZE,
    CalibrationOutcome,
    ClockPair,
    DeviceInfo,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.gaze_clock import OneWayClock
from devices.drivers.gaze_rays import Sample, rows_to_values
from devices.drivers.pupil_faults import EYES_LOST_BELOW_01, FEWEST_SAMPLES, SeenEyes
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
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
RECENT_EXCHANGES = 60
PAIR_JUMP_NS = 20 * NS_PER_MS
ANSWERS_MISSED_NS = 3 * NS_PER_S
EVERYTHING = (b"",)


@dataclass(frozen=True)
class Make:
    """What is known of a tracker before it is open; `remedy` is said when it is not there."""

    driver: str
    vendor: str
    model: str
    remedy: str
    capabilities: frozenset[str]


@dataclass
class Counts:
    """What a driver noticed since start; `notes` are faults that hold until removed."""

    malformed: int = 0
    lost: int = 0
    clock_jumps_ms: list[float] = field(default_factory=list)
    notes: dict[str, Fault] = field(default_factory=dict)


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
        make: Make,
        *,
        rate_hz: float,
        lost_after_s: float = 2.0,
        exchange_interval_s: float | None = None,
    ) -> None:
        self._transport = transport
        self._clock = clock
        self._make = make
        self._life = Lifecycle(role)
        self._schema = StreamSchema(GAZE.name, GAZE.fields, rate_hz, GAZE.version)
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._interval_ns = (
            None if exchange_interval_s is None else round(exchange_interval_s * NS_PER_S)
        )
        self._sink: Sink | None = None
        self._counts = Counts()
        self._calibration: CalibrationOutcome | None = None
        self._pairs: list[ClockPair] = []
        self._pairs_since_jump = 0
        self._polling_thread: int | None = None
        self._asked_ns: int | None = None
        self._counter: int | None = None
        self._next_exchange_ns = self._heard_ns = self._attempt_ns = 0
        self._mailbox: deque[tuple[Callable[[], None], Future[None]]] = deque()
        self.info = DeviceInfo(
            role=role,
            driver=make.driver,
            driver_version="1",
            vendor=make.vendor,
            model=make.model,
            serial="",
            transport=transport.kind,
            is_simulated=transport.is_simulated,
            capabilities=make.capabilities,
        )
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
        self._pairs = []
        self._pairs_since_jump = 0
        self._counts = Counts()
        try:
            self._transport.open(deadline_s)
            self._transport.subscribe(0, EVERYTHING)
            self.info = replace(self.info, transport=self._transport.kind)
            self._connect(deadline_ns)
        except DeviceError as problem:
            self._transport.close()
            raise self._named(problem) from problem
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
            self._polling_thread = threading.get_ident()
            self._run_mailbox()
            return self._reconnect(timeout_s)
        self._polling_thread = threading.get_ident()
        if self._mailbox:
            self._run_mailbox()
        try:
            messages = self._transport.receive(timeout_s)
        except DeviceDisconnected as gone:
            self._lose()
            raise self._named(gone) from gone
        delivered = self._take(messages) if messages else 0
        now_ns = self._clock.now_ns()
        if now_ns - self._heard_ns > self._lost_after_ns:
            self._lose()
            quiet_s = (now_ns - self._heard_ns) / NS_PER_S
            raise DeviceDisconnected(
                f"nothing came for {quiet_s:.1f} s", role=self.info.role, remedy=self._make.remedy
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
        self._polling_thread = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._sink = None
        self._polling_thread = None
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report deliveries and the clock fit: exchanges, else the lower envelope of arrivals."""
        health = self._meter.health(self.state, self._clock.now_ns())
        pairs = self._recent_pairs()
        fit = fit_clock(pairs) if pairs else self._one_way.fit()
        if fit is None:
            return health
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name everything odd about stream, clock and tracker since start."""
        role, counts, meter = self.info.role, self._counts, self._meter
        faults = [*counts.notes.values(), *self._own_faults()]

        def warn(message: str, remedy: str) -> None:
            faults.append(Fault(role, "warning", message, remedy))

        if counts.malformed:
            text = f"{counts.malformed} messages could not be read"
            warn(text, "keep the .wire log and report it")
        if counts.lost:
            warn(f"{counts.lost} samples were lost on the way", "check cable, network and load")
        jumps_ms = counts.clock_jumps_ms if self._pairs else self._one_way.jumps_ms
        if jumps_ms:
            text = (
                f"the tracker's clock jumped {len(jumps_ms)} times, last by {jumps_ms[-1]:.0f} ms"
            )
            warn(text, "stop other programs that set the tracker's clock")
        for count, what in ((meter.repeated, "repeated"), (meter.backward, "backward")):
            if count:
                warn(f"{count} {what} time stamps", "restart the tracker if they go on")
        if self._asked_ns is not None:
            waited_ns = self._clock.now_ns() - self._asked_ns
            if waited_ns > ANSWERS_MISSED_NS:
                text = f"no answer to time requests for {waited_ns / NS_PER_S:.0f} s"
                warn(text, self._make.remedy)
        return (*faults, *self._lost_eyes())

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return every time exchange since open; empty for a one-way device."""
        return tuple(self._pairs)

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
                "nobody answered in time", role=self.info.role, remedy=self._make.remedy
            ) from cause

    def _add_pair(self, pair: ClockPair) -> None:
        self._asked_ns = None
        if self._pairs:
            moved_ns = abs(_offset(pair) - _offset(self._pairs[-1]))
            if moved_ns > PAIR_JUMP_NS + pair.host_receive_ns - pair.host_send_ns:
                self._counts.clock_jumps_ms.append(moved_ns / NS_PER_MS)
                self._pairs_since_jump = len(self._pairs)
        self._pairs.append(pair)

    def _to_device_ns(self, t_host_ns: int) -> int:
        """Map a host time to the device's clock; the time itself while nothing is known."""
        pairs = self._recent_pairs()
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

    def _on_wire(self, command: Callable[[], None]) -> None:
        """Run in the thread that polls: a wire is not shared between threads."""
        if not self._polls_elsewhere():
            command()
            return
        done: Future[None] = Future()
        self._mailbox.append((command, done))
        try:
            done.result(timeout=COMMAND_TIMEOUT_S)
        except NoAnswerInTime as cause:
            raise DeviceTimeout(
                "the device thread did not take a command",
                role=self.info.role,
                remedy=self._make.remedy,
            ) from cause

    def _wait_until(self, reached: Callable[[], bool], deadline_ns: int, what: str) -> None:
        """Keep polling until something is reached; raises DeviceTimeout at the deadline."""
        while not reached():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout(
                    f"no {what} in time", role=self.info.role, remedy=self._make.remedy
                )
            if self._polls_elsewhere():
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
        self._seq = -1
        self._counter = None
        self._most_lost = round(10 * self._schema.nominal_rate_hz)
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
                seqs.append(self._next_seq(sample.counter))
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

    def _next_seq(self, counter: int | None) -> int:
        step = 1
        if counter is not None:
            if self._counter is not None:
                ahead = counter - self._counter
                if 1 < ahead <= self._most_lost:
                    step = ahead
                    self._counts.lost += ahead - 1
            if self._counter is None or not -self._most_lost < counter - self._counter <= 0:
                self._counter = counter
        self._seq += step
        return self._seq

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
        self._counter = None
        self._heard_ns = self._clock.now_ns()
        delivered = self._take(messages)
        self._life.state = DeviceState.STREAMING
        self._next_exchange_ns = now_ns
        return delivered

    def _pause(self, timeout_s: float) -> None:
        if timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))

    def _recent_pairs(self) -> list[ClockPair]:
        return self._pairs[max(self._pairs_since_jump, len(self._pairs) - RECENT_EXCHANGES) :]

    def _named(self, problem: DeviceError) -> DeviceError:
        if problem.role:
            return problem
        message = str(problem).removesuffix(f"; {problem.remedy}")
        remedy = problem.remedy or self._make.remedy
        return type(problem)(message, role=self.info.role, remedy=remedy)

    def _lost_eyes(self) -> list[Fault]:
        recent = self._recent
        if recent.samples < FEWEST_SAMPLES:
            return []
        counts = {"left": recent.left, "right": recent.right}
        lost = [eye for eye, n in counts.items() if n / recent.samples < EYES_LOST_BELOW_01]
        remedy = "adjust the tracker and its wearer, then calibrate again"
        if len(lost) == len(counts):
            return [self._blocking("neither eye is seen", remedy)]
        return [self._warning(f"the {eye} eye is not seen", remedy) for eye in lost]

    def _polls_elsewhere(self) -> bool:
        return self._polling_thread not in (None, threading.get_ident())

    def _run_mailbox(self) -> None:
        while self._mailbox:
            command, done = self._mailbox.popleft()
            try:
                command()
            except DeviceError as problem:
                done.set_exception(problem)
            else:
                done.set_result(None)


def _offset(pair: ClockPair) -> int:
    return (pair.host_send_ns + pair.host_receive_ns) // 2 - pair.device_ns
