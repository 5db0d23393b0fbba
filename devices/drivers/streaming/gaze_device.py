"""The common part of eye trackers' drivers: time exchanges, tracked eyes, commands, refusals.

A driver adds a codec: how to connect, how to read a message, which commands it has. All wires are
`visavis.devices.transports.MessageTransport`s, so each can be copied to a `.wire` log and replayed.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import GAZE, CalibrationOutcome, ClockPair, DeviceState, Fault
from visavis.devices.drivers.streaming.exchange_log import ExchangeLog
from visavis.devices.drivers.streaming.gaze_findings import (
    SeenEyes,
    eye_faults,
    recent_samples,
    stream_faults,
)
from visavis.devices.drivers.streaming.gaze_rays import Sample, rows_to_values
from visavis.devices.drivers.streaming.stream_device import StreamDevice
from visavis.devices.drivers.streaming.wire_thread import WireThread
from visavis.devices.spec import AnySpec
from visavis.devices.transports import MemoryTransport, MessageTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.clock_fit import ClockFit, fit_clock, offset_ns
from visavis.lab.errors import DeviceError, DeviceTimeout
from visavis.lab.geometry import Vector

COMMAND_TIMEOUT_S = 2.0


class SampleNumbers:
    """Turn a counter, which may restart or be missing, into `seq`; `lost_count` counts the holes.

    A step of more than `most_lost` is a restarted counter, not a loss.
    """

    def __init__(self, most_lost: int) -> None:
        self._most_lost = most_lost
        self._seq = -1
        self._counter: int | None = None
        self.lost_count = 0

    def forget_counter(self) -> None:
        """Accept any next counter: samples missed meanwhile are a gap, not a loss."""
        self._counter = None

    def following(self, counter: int | None) -> int:
        """Return the number of the next sample; `counter` is None where the device has none."""
        step, most, before = 1, self._most_lost, self._counter
        if counter is not None:
            if before is not None and 1 < counter - before <= most:
                step = counter - before
                self.lost_count += step - 1
            if before is None or not -most < counter - before <= 0:
                self._counter = counter
        self._seq += step
        return self._seq


class GazeDevice(StreamDevice[Sample]):
    """Follow the `EyeTracker` contract over a message transport.

    `seq` follows the device's own counter where it has one: a hole is a lost sample. With
    `exchange_interval_s` a time exchange is asked for that often.
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
        self._interval_ns = (
            None if exchange_interval_s is None else round(exchange_interval_s * NS_PER_S)
        )
        self._calibration: CalibrationOutcome | None = None
        self._exchanges = ExchangeLog()
        self._offset_of: tuple[int, int] | None = None
        self._jumps_ms: list[float] = []
        self._asked_ns: int | None = None
        self._wire = WireThread(role, remedy=spec.remedy, timeout_s=COMMAND_TIMEOUT_S)
        self._memory = transport if isinstance(transport, MemoryTransport) else None
        schema = replace(GAZE, nominal_rate_hz=rate_hz)
        super().__init__(role, transport, clock, spec, schema, lost_after_s=lost_after_s)

    # ---- what a driver adds -----------------------------------------------------------------

    def _ask_time(self, now_ns: int) -> None:
        """Begin a time exchange; must not wait. Its answer goes to `_add_pair`."""
        return

    def _own_faults(self) -> Iterable[Fault]:
        """Return the faults that only this device has."""
        return ()

    # ---- the contract -----------------------------------------------------------------------

    def poll(self, timeout_s: float) -> int:
        """Take the wire for this thread and decode new messages; see the contract."""
        if self._life.state in (DeviceState.STREAMING, DeviceState.FAULT):
            self._wire.claim()
        return super().poll(timeout_s)

    def put_off(self) -> bool:
        """Tell whether delivery can wait for a later poll (`visavis.devices.pump.Postponing`).

        Time exchanges go on meanwhile: they are asked for and their answers are read.
        """
        if self._memory is None or self._life.state is not DeviceState.STREAMING:
            return False
        if not self._memory.put_off():
            return False
        answers = self._memory.answers()
        if answers:
            self._take(answers)
        self._tick(self._clock.now_ns())
        return True

    def put_off_until_ns(self) -> int:
        """Return a session time before which `put_off` has nothing to do and returns True."""
        if self._memory is None or self._life.state is not DeviceState.STREAMING:
            return 0
        until_ns = self._memory.put_off_until_ns()
        return until_ns if self._interval_ns is None else min(until_ns, self._next_exchange_ns)

    def stop(self) -> None:
        """Stop delivering; the wire stays open."""
        super().stop()
        self._wire.release()

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._wire.release()
        super().close()

    def check(self) -> tuple[Fault, ...]:
        """Return the faults of stream, clock and tracker since start."""
        waited_ns = 0 if self._asked_ns is None else self._clock.now_ns() - self._asked_ns
        one_way = not self._exchanges.pairs
        return (
            *self._notes.values(),
            *self._own_faults(),
            *stream_faults(
                self.info.role,
                self._meter,
                malformed=self._malformed,
                lost_count=self._numbers.lost_count,
                jumps_ms=self._one_way.jumps_ms if one_way else self._jumps_ms,
                unanswered_s=waited_ns / NS_PER_S,
                remedy=self._spec.remedy,
            ),
            *eye_faults(self.info.role, self._recent),
        )

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return the latest time exchanges since open; empty for a one-way device."""
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
        """Refuse: this tracker has no recording that could be annotated."""
        raise self._refusal("annotated", "the marker stands in Visavis' own recording")

    @property
    def calibration(self) -> CalibrationOutcome | None:
        """The verdict of the last calibration since open, with its final quality."""
        return self._calibration

    # ---- for drivers ------------------------------------------------------------------------

    def _add_pair(self, pair: ClockPair) -> None:
        self._asked_ns = None
        jump_ms = self._exchanges.add(pair)
        if jump_ms is not None:
            self._jumps_ms.append(jump_ms)

    def _to_device_ns(self, t_host_ns: int) -> int:
        """Map a host time to the device's clock; the same time while no offset is known."""
        count, cache = len(self._exchanges), self._offset_of
        if not count:
            fit = self._one_way.fit()
            return t_host_ns if fit is None else t_host_ns - fit.offset_ns
        if cache is None or cache[0] != count:
            cache = self._offset_of = (count, offset_ns(self._exchanges.recent))
        return t_host_ns - cache[1]

    def _wait_until(
        self, is_reached: Callable[[], bool], deadline_ns: int, what: str, remedy: str = ""
    ) -> None:
        """Keep polling until something is reached; raises DeviceTimeout at the deadline."""
        while not is_reached():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                remedy = remedy or self._spec.remedy
                raise DeviceTimeout(f"no {what} in time", role=self.info.role, remedy=remedy)
            if self._wire.is_elsewhere:
                self._clock.sleep_until_ns(now_ns + 5 * NS_PER_MS)
            elif self._life.state is DeviceState.STREAMING:
                self.poll(0.02)
            else:
                for message in self._transport.receive(0.02):
                    tuple(self._decode(message))

    def _mark(self, send: Callable[[], None]) -> None:
        """Send a marker from the thread that polls; a frame never waits for it."""
        self._wire.later(send, self._mark_failed)

    def _mark_failed(self, problem: DeviceError) -> None:
        remedy = "the markers stand in Visavis' own recording, with the time exchanges"
        self._note(
            "marks", self._warning(f"a marker did not reach its recording: {problem}", remedy)
        )

    def _refusal(self, what: str, remedy: str) -> DeviceError:
        return DeviceError(
            f"a {self.info.driver} tracker cannot be {what}", role=self.info.role, remedy=remedy
        )

    # ---- inside -----------------------------------------------------------------------------

    def _prepare(self) -> None:
        super()._prepare()
        self._exchanges.clear()
        self._offset_of = None
        self._jumps_ms = []

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._jumps_ms = []
        self._recent = SeenEyes(recent_samples(self._schema.nominal_rate_hz))
        self._numbers = SampleNumbers(round(10 * self._schema.nominal_rate_hz))
        self._asked_ns = None
        self._next_exchange_ns = now_ns

    def _clock_fit(self) -> ClockFit | None:
        """Return the fit of the exchanges, or else of the lower envelope of arrivals."""
        pairs = self._exchanges.recent
        return fit_clock(pairs) if pairs else super()._clock_fit()

    def _number(self, sample: Sample) -> int:
        return self._numbers.following(sample.counter)

    def _values(self, samples: Sequence[Sample]) -> npt.NDArray[np.void]:
        values = rows_to_values(sample.row for sample in samples)
        left, right = values["left_valid"], values["right_valid"]
        if not left.any() and not right.any():  # a tracker of combined gaze alone
            left = right = values["valid"]
        self._recent.add(len(values), int(left.sum()), int(right.sum()))
        return values

    def _tick(self, now_ns: int) -> None:
        if self._interval_ns is not None and now_ns >= self._next_exchange_ns:
            self._next_exchange_ns = now_ns + self._interval_ns
            if self._asked_ns is None:
                self._asked_ns = now_ns
            self._ask_time(now_ns)

    def _came_back(self) -> None:
        self._numbers.forget_counter()
        self._next_exchange_ns = self._clock.now_ns()


class CalibratesByItself(GazeDevice):
    """An eye tracker whose runtime shows its own targets and gives the verdict."""

    def finish_calibration(self) -> None:
        """Do nothing: the runtime ends its own procedure and gives the verdict when asked."""
        self._life.require("finish_calibration", DeviceState.STREAMING)

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Wait for the runtime's verdict; its quality is kept as the message."""
        self.finish_calibration()
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._wait_until(lambda: self._calibration is not None, deadline_ns, "calibration result")
        outcome = self.calibration_verdict()
        assert outcome is not None  # noqa: S101 - awaited above
        return outcome

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return the runtime's verdict; None until it came."""
        return self._calibration
