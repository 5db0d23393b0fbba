"""Put the session's marks as codes on lines: parallel port, serial box, LabJack, LSL.

A mark is written at once, from the thread that makes it. The end of its pulse, and marks that have
to wait for it, are written while the device is polled. Every pulse is a row of its stream.
"""

import contextlib
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import NO_DEVICE_TIME, DeviceState, Fault, Health, Sink
from visavis.devices.drivers.triggers.labjack_codec import AnswerReader, lines_out, set_lines
from visavis.devices.drivers.triggers.pulses import Pulse, PulseTrain, Step
from visavis.devices.drivers.triggers.xid_commands import pulse_width, raise_lines
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout
from visavis.lab.schema import Field, SampleBatch, StreamSchema

AGAIN_NS = NS_PER_S // 2
ANSWER_S = 0.5

PULSES = (
    Field("code", "u2", "", description="what stood on the lines"),
    Field("t_commanded_ns", "i8", "ns", description="frame time of the mark"),
    Field("t_before_ns", "i8", "ns", description="before it was written; NO_DEVICE_TIME: never"),
    Field("t_after_ns", "i8", "ns", description="when the wire had taken it"),
    Field("t_released_ns", "i8", "ns", description="when the end of the pulse was taken"),
)
"""A row is stamped (`t_host_ns`) when its code was taken. The code rose between `t_before_ns` and
`t_after_ns`, plus any delay of the device itself."""


class TriggerOut(HasLife):
    """Follow the `Device` and `TriggerOutput` contracts on a wire where a byte sets the lines.

    `codes` gives the code, 1 to 255, of every mark to send; other marks are not sent.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        clock: Clock,
        *,
        spec: AnySpec,
        codes: Mapping[str, int],
        width_ms: float,
        settle_ms: float,
        hello: bytes = b"",
        encode: Callable[[int], bytes] = lambda code: bytes((code,)),
        answers: bool = False,
    ) -> None:
        self._spec = spec
        self._link = link
        self._clock = clock
        self._codes = dict(codes)
        self._times = (width_ms, settle_ms)
        self._hello = hello or encode(0)
        self._encode = encode
        self._answers = answers
        self._life = Lifecycle(role)
        self._schema = StreamSchema(role, PULSES, 0.0)
        self._lock = threading.RLock()
        self._wake = threading.Event()
        self._sink: Sink | None = None
        self._loss: DeviceError | None = None
        self._begin()
        self.info = spec.info(role, link)

    def open(self, deadline_s: float) -> None:
        """Open the wire and bring every line low."""
        self._life.require("open", DeviceState.CLOSED)
        try:
            self._connect(deadline_s)
        except DeviceError:
            self._link.close()
            raise
        self.info = replace(
            self.info, transport=self._link.kind, is_simulated=self._link.is_simulated
        )
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the stream of pulses."""
        return (self._schema,)

    def start(self, sink: Sink) -> None:
        """Begin sending marks."""
        self._life.require("start", DeviceState.OPEN)
        with self._lock:
            self._begin()
            self._sink = sink
            self._life.state = DeviceState.STREAMING

    def trigger(self, mark: str, t_ns: int) -> bool:
        """Send the code of a mark, if it has one; return whether it has. Never raises."""
        code = self._codes.get(mark)
        if code is None or self._life.state not in (DeviceState.STREAMING, DeviceState.FAULT):
            return False
        with self._lock:
            self._train.ask(code, t_ns)
            if self._life.state is DeviceState.FAULT:
                self._drop()
            else:
                self._write_what_is_due()
        self._wake.set()
        return True

    def poll(self, timeout_s: float) -> int:
        """End pulses that are due, and deliver the ended ones; see the contract."""
        self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        if self._life.state is DeviceState.FAULT and self._loss is None:
            self._reconnect(timeout_s)
        else:
            self._wait(timeout_s)
        with self._lock:
            if self._life.state is DeviceState.STREAMING:
                self._write_what_is_due()
                self._hear()
            row_count = self._deliver()
            problem, self._loss = self._loss, None
        if problem is not None:
            raise DeviceDisconnected(
                str(problem), role=self.info.role, remedy=self._spec.remedy
            ) from problem
        return row_count

    def stop(self) -> None:
        """Bring the lines low and stop sending; the wire stays open."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        with self._lock:
            self._rest()
            self._deliver()
            self._sink = None
            self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Bring the lines low and close the wire; idempotent."""
        with self._lock:
            if self._life.state is not DeviceState.CLOSED:
                self._rest()
            self._sink = None
            self._link.close()
            self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report the pulses delivered."""
        return self._meter.health(self.state, self._clock.now_ns())

    def check(self) -> tuple[Fault, ...]:
        """Report marks that never reached the lines, and answers with errors."""
        faults = []
        for count, text in (
            (self._lost_count, "marks never reached the lines"),
            (self._refused_count, "codes were refused by the device"),
            (self._reader.unreadable_count, "bytes of answers could not be read"),
        ):
            if count:
                fault = Fault(self.info.role, "warning", f"{count} {text}", self._spec.remedy)
                faults.append(fault)
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _begin(self) -> None:
        self._train = PulseTrain(*self._times)
        self._meter = StreamMeter(0.0)
        self._reader = AnswerReader()
        self._begin_times_ns: dict[int, tuple[int, int]] = {}
        self._rows: list[tuple[int, ...]] = []
        self._seq = self._lost_count = self._refused_count = self._retry_ns = 0
        self._loss = None

    def _connect(self, deadline_s: float) -> None:
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._link.open(deadline_s)
        self._link.write(self._hello)
        reader = AnswerReader()
        while self._answers:
            left_s = (deadline_ns - self._clock.now_ns()) / NS_PER_S
            if left_s <= 0:
                text = "the device does not answer"
                raise DeviceTimeout(text, role=self.info.role, remedy=self._spec.remedy)
            for chunk in self._link.read(min(left_s, ANSWER_S)):
                for error in reader.feed(chunk.data):
                    if error:
                        text = f"the device refuses to set its lines (error {error})"
                        raise DeviceError(text, role=self.info.role, remedy=self._spec.remedy)
                    return

    def _wait(self, timeout_s: float) -> None:
        """Wait until the lines have to change, or a mark comes; 0 does not wait."""
        due_ns = self._train.due_ns()
        now_ns = self._clock.now_ns()
        if due_ns is not None:
            timeout_s = min(timeout_s, (due_ns - now_ns) / NS_PER_S)
        if timeout_s <= 0:
            return
        if due_ns is None and not self._clock.is_virtual:
            self._wake.wait(timeout_s)
            self._wake.clear()
        else:
            self._clock.sleep_until_ns(now_ns + round(timeout_s * NS_PER_S))

    def _write_what_is_due(self) -> None:
        while (step := self._train.step(self._clock.now_ns())) is not None:
            before_ns = self._clock.now_ns()
            try:
                after_ns = self._link.write(self._encode(step.pulse.code if step.begins else 0))
            except DeviceError as problem:
                self._lose(problem)
                return
            self._train.note_written(step, after_ns)
            self._note(step, before_ns, after_ns)

    def _note(self, step: Step, before_ns: int, after_ns: int) -> None:
        if step.begins:
            self._begin_times_ns[step.pulse.number] = (before_ns, after_ns)
        else:
            self._row(step.pulse, *self._begin_times_ns.pop(step.pulse.number), after_ns)

    def _row(self, pulse: Pulse, before_ns: int, after_ns: int, released_ns: int) -> None:
        row = (pulse.number, pulse.code, pulse.t_commanded_ns, before_ns, after_ns, released_ns)
        self._rows.append(row)

    def _hear(self) -> None:
        if not self._answers:
            return
        try:
            for chunk in self._link.read(0.0):
                self._refused_count += sum(error != 0 for error in self._reader.feed(chunk.data))
        except DeviceError as problem:
            self._lose(problem)

    def _lose(self, problem: DeviceError) -> None:
        self._link.close()
        self._life.state = DeviceState.FAULT
        self._loss = problem
        self._retry_ns = self._clock.now_ns() + AGAIN_NS
        self._drop()

    def _drop(self, released_ns: int = NO_DEVICE_TIME) -> None:
        """Record the pulse on the lines, and the waiting marks as never sent."""
        active_pulse, never = self._train.forget()
        if active_pulse is not None:
            self._row(active_pulse, *self._begin_times_ns.pop(active_pulse.number), released_ns)
        for pulse in never:
            self._lost_count += 1
            self._row(pulse, NO_DEVICE_TIME, NO_DEVICE_TIME, NO_DEVICE_TIME)

    def _reconnect(self, timeout_s: float) -> None:
        now_ns = self._clock.now_ns()
        if now_ns >= self._retry_ns:
            try:
                self._connect(max(timeout_s, 0.05))
            except DeviceError:
                self._link.close()
                self._retry_ns = now_ns + AGAIN_NS
            else:
                self._life.state = DeviceState.STREAMING
                return
        if timeout_s > 0:
            self._clock.sleep_until_ns(now_ns + round(timeout_s * NS_PER_S))

    def _rest(self) -> None:
        """Bring the lines low, and end a pulse on them."""
        released_ns = NO_DEVICE_TIME
        if self._life.state is not DeviceState.FAULT:
            with contextlib.suppress(DeviceError):  # it is gone, and so are its lines
                released_ns = self._link.write(self._encode(0))
        self._drop(released_ns)

    def _deliver(self) -> int:
        if not self._rows or self._sink is None:
            return 0
        rows, self._rows = self._rows, []
        values = np.array([row[1:] for row in rows], np.int64)
        pulse_rows = np.zeros(len(rows), self._schema.dtype)
        for column, field in zip(values.T, self._schema.fields, strict=True):
            pulse_rows[field.name] = column
        now_ns = self._clock.now_ns()
        numbers = np.arange(self._seq, self._seq + len(rows))
        self._seq += len(rows)
        nothing = np.full(len(rows), NO_DEVICE_TIME)
        self._meter.update(values[:, 3].tolist(), now_ns)
        host = np.where(values[:, 3] == NO_DEVICE_TIME, now_ns, values[:, 3])  # t_after_ns
        self._sink(SampleBatch(self._schema, numbers, nothing, host, pulse_rows))
        return len(rows)


def labjack(
    role: str, link: ByteLink, clock: Clock, spec: AnySpec, **options: object
) -> TriggerOut:
    """Return triggers on the lines EIO0-7 of a LabJack."""
    return TriggerOut(
        role,
        link,
        clock,
        spec=spec,
        hello=lines_out(),
        encode=set_lines,
        answers=True,
        **options,  # type: ignore[arg-type]  # they were checked by the option model
    )


def xid_lines(
    role: str, link: ByteLink, clock: Clock, spec: AnySpec, *, width_ms: float, **options: object
) -> TriggerOut:
    """Return triggers on the output lines of a Cedrus c-pod, m-pod or StimTracker.

    The unit ends a pulse by itself after `width_ms`, by its own clock; the end that is written to
    it then changes nothing. Its time is whole milliseconds.
    """
    return TriggerOut(
        role,
        link,
        clock,
        spec=spec,
        width_ms=width_ms,
        hello=pulse_width(max(1, round(width_ms))) + raise_lines(0),
        encode=raise_lines,
        **options,  # type: ignore[arg-type]  # they were checked by the option model
    )
