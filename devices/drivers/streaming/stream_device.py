"""The common part of eye and body trackers: polling, numbers, one-way clock, reconnecting."""

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import DeviceState, Fault, Health
from visavis.devices.drivers.streaming.message_device import (
    ATTEMPT_EVERY_NS,
    MessageDevice,
    with_role,
)
from visavis.devices.meter import StreamMeter
from visavis.devices.plausible import ClockPace
from visavis.devices.spec import AnySpec
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.clock_fit import ClockFit, fit_one_way
from visavis.lab.errors import DeviceDisconnected, DeviceError
from visavis.lab.schema import SampleBatch, StreamSchema

ATTEMPT_S = 0.4
ATTEMPT_PERIODS = 3
EVERYTHING = (b"",)

BUCKET_NS = 100 * NS_PER_MS
MAX_BUCKETS = 6000
JUMP_NS = 250 * NS_PER_MS


class OneWayClock:
    """Keep, per 100 ms of arrival, the sample with the least arrival − device time.

    A device stamp that steps further ahead than the arrivals do by more than 250 ms, or back by
    more, is a jump. All samples are then forgotten, because no single line fits both sides. The
    meter counts smaller steps as gaps, repeats and backward stamps.
    """

    def __init__(self) -> None:
        self.jumps_ms: list[float] = []
        self._best: list[tuple[int, int]] = []
        self._bucket = 0
        self._last: tuple[int, int] | None = None

    def add(self, t_device_ns: Sequence[int], t_host_ns: Sequence[int]) -> None:
        """Take a batch's stamps in arrival order."""
        for device, host in zip(t_device_ns, t_host_ns, strict=True):
            self._add(device, host)

    def restart(self) -> None:
        """Forget all samples, as after reconnecting to a device that was restarted."""
        self._best.clear()
        self._last = None

    def fit(self) -> ClockFit | None:
        """Return the lower-envelope fit; None while there are too few samples."""
        if len(self._best) < 2 or self._best[0][0] == self._best[-1][0]:
            return None
        table = np.array(self._best, np.int64)
        return fit_one_way(table[:, 0], table[:, 1])

    def _add(self, device: int, host: int) -> None:
        last, self._last = self._last, (device, host)
        if last is not None:
            step = device - last[0]
            if step - (host - last[1]) > JUMP_NS or step < -JUMP_NS:
                self.jumps_ms.append((step - (host - last[1])) / NS_PER_MS)
                self._best.clear()
        bucket = host // BUCKET_NS
        if not self._best or bucket != self._bucket:
            self._bucket = bucket
            self._best.append((device, host))
            if len(self._best) > MAX_BUCKETS:
                del self._best[: MAX_BUCKETS // 10]
        elif host - device < self._best[-1][1] - self._best[-1][0]:
            self._best[-1] = (device, host)


class StampedSample(Protocol):
    """A decoded sample with the device's own time (ns)."""

    @property
    def t_device_ns(self) -> int:
        """When it was taken."""
        ...


S = TypeVar("S", bound=StampedSample)


class StreamDevice(MessageDevice, Generic[S]):
    """Deliver one stream of samples that a peer sends by itself.

    The peer counts as lost when nothing came for `lost_after_s`. The driver then tries to connect
    twice a second by itself and goes on with the first new sample.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        schema: StreamSchema,
        *,
        lost_after_s: float,
    ) -> None:
        super().__init__(role, transport, clock, spec)
        self._schema = schema
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._notes: dict[str, Fault] = {}
        self._reset(clock.now_ns())

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _decode(self, message: Message) -> Iterable[S]:
        """Return the samples that a message completes; count unreadable messages."""

    @abstractmethod
    def _number(self, sample: S) -> int | None:
        """Return the sample's `seq`; None leaves it out."""

    @abstractmethod
    def _values(self, samples: Sequence[S]) -> npt.NDArray[np.void]:
        """Return the samples as rows of the schema."""

    def _prepare(self) -> None:
        self._notes = {}
        self._malformed = 0

    def _subscribe(self) -> None:
        self._transport.subscribe(0, EVERYTHING)

    def _resume(self) -> None:
        """Ask for the stream again after the wire was reopened; must not wait."""
        return

    def _came_back(self) -> None:
        """Note that a lost peer is back."""
        return

    def _tick(self, now_ns: int) -> None:
        """Do what is due while streaming, such as keeping the stream alive; must not wait."""
        return

    # ---- the contract -----------------------------------------------------------------------

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the stream at this tracker's rate."""
        return (self._schema,)

    def poll(self, timeout_s: float) -> int:
        """Decode new messages; see the contract. While the peer is lost, try to reconnect."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            return self._reconnect(timeout_s)
        try:
            messages = self._transport.receive(timeout_s)
        except DeviceDisconnected as disconnection:
            raise self._lose(disconnection) from disconnection
        row_count = self._take(messages) if messages else 0
        now_ns = self._clock.now_ns()
        if now_ns - self._heard_ns > self._lost_after_ns:
            quiet_s = (now_ns - self._heard_ns) / NS_PER_S
            raise self._lose(DeviceDisconnected(f"nothing came for {quiet_s:.1f} s"))
        self._tick(now_ns)
        return row_count

    def health(self) -> Health:
        """Report deliveries and the clock's fit."""
        health = self._meter.health(self.state, self._clock.now_ns())
        fit = self._clock_fit()
        if fit is None:
            return health
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    # ---- inside -----------------------------------------------------------------------------

    def _clock_fit(self) -> ClockFit | None:
        """Return the lower envelope of arrivals over device times."""
        return self._one_way.fit()

    def _pace_fault(self) -> Fault | None:
        pace = self._pace.wrong()
        if pace is None:
            return None
        text = f"its clock counts {pace:.3g} s in 1 s of this computer: its times cannot be used"
        return self._blocking(text, "report it with the .wire log: a unit or a rate is misread")

    def _note(self, key: str, fault: Fault | None) -> None:
        """Set or remove a fault that holds until removed."""
        if fault is None:
            self._notes.pop(key, None)
        else:
            self._notes[key] = fault

    def _reset(self, now_ns: int) -> None:
        rate_hz = self._schema.nominal_rate_hz
        self._meter = StreamMeter(rate_hz)
        if rate_hz:  # reopening loses data under way: leave time for a sample to come
            slow_ns = round(ATTEMPT_PERIODS * NS_PER_S / rate_hz)
            self._attempt_every_ns = max(ATTEMPT_EVERY_NS, slow_ns)
        self._one_way = OneWayClock()
        self._pace = ClockPace()
        self._malformed = 0
        self._heard_ns = self._attempt_ns = now_ns

    def _take(self, messages: Sequence[Message]) -> int:
        samples: list[S] = []
        seqs: list[int] = []
        arrivals: list[int] = []
        for message in messages:
            for sample in self._decode(message):
                seq = self._number(sample)
                if seq is not None:
                    samples.append(sample)
                    seqs.append(seq)
                    arrivals.append(message.t_host_ns)
        self._heard_ns = max(self._heard_ns, messages[-1].t_host_ns)
        if not samples or self._sink is None:
            return 0
        stamps = [sample.t_device_ns for sample in samples]
        self._one_way.add(stamps, arrivals)
        self._pace.add(stamps[-1], arrivals[-1])
        self._note("pace", self._pace_fault())
        return self._deliver(seqs, stamps, arrivals, self._values(samples))

    def _deliver(self, seqs: Any, stamps: Any, arrivals: Any, values: npt.NDArray[np.void]) -> int:
        if self._sink is None:
            return 0
        seq, device = np.asarray(seqs, np.int64), np.asarray(stamps, np.int64)
        host = np.asarray(arrivals, np.int64)
        self._meter.update(device.tolist(), int(host[-1]))
        self._sink(SampleBatch(self._schema, seq, device, host, values))
        return len(values)

    def _lose(self, problem: DeviceError) -> DeviceError:
        """Mark the peer as lost and return the error to raise."""
        self._life.state = DeviceState.FAULT
        self._attempt_ns = self._clock.now_ns()
        return with_role(problem, self.info.role, self._spec.remedy)

    def _reconnect(self, timeout_s: float) -> int:
        """Try to reach the peer; its loss has been reported, so a failed attempt raises nothing."""
        try:
            if self._attempt_is_due():
                self._transport.close()
                self._transport.open(ATTEMPT_S)
                self._subscribe()
                self._resume()
                if (
                    not self._schema.nominal_rate_hz
                ):  # it may be silent for long: an open wire is enough
                    self._back()
            messages = self._transport.receive(timeout_s)
        except DeviceError as problem:
            self._life.state = DeviceState.FAULT
            self._transport.close()
            self._note("away", self._warning(f"still away: {problem}", self._spec.remedy))
            if timeout_s > 0:
                self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
            return 0
        if not messages:
            return 0
        self._came_back()
        row_count = self._take(messages)
        if row_count:
            self._back()
        return row_count

    def _back(self) -> None:
        self._note("away", None)
        self._pace.restart()
        self._heard_ns = self._clock.now_ns()
        self._life.state = DeviceState.STREAMING
