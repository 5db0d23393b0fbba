"""The life that all devices with buttons share: a byte link, a codec, rows of `RESPONSES`."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from visavis.devices.byte_links import ByteLink, Chunk, MemoryLink
from visavis.devices.contracts import (
    NO_DEVICE_TIME,
    RESPONSES,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceError
from visavis.lab.schema import SampleBatch, StreamSchema

AGAIN_S = 0.5
RECONNECT_S = 0.2


class Press(NamedTuple):
    """One change of a button or axis: its name, its value, and the device's time if it has one."""

    button: str
    value_01: float
    t_device_ns: int | None = None


class ButtonDevice(HasLife):
    """Follow the `ResponseInput` contract over a byte link; a driver says what bytes mean.

    `buttons` are the device's own names; `keys` gives some of them the names that studies use
    ({"space": "trigger"}). `check` reports a pressed button whose name is in neither.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        clock: Clock,
        spec: AnySpec,
        *,
        buttons: Sequence[str],
        keys: Mapping[str, str],
    ) -> None:
        self._link = link
        self._clock = clock
        self._spec = spec
        self._keys = dict(keys)
        self._role = role
        self._life = Lifecycle(role)
        self._sink: Sink | None = None
        self._unknown: set[str] = set()
        self._reconnects = 0
        self._retry_ns = self._from_ns = 0
        self._name(buttons)
        self._begin()
        self.info = spec.info(role, link)

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _read(self, data: bytes) -> Iterable[Press]:
        """Return what these bytes complete; counts what cannot be read in `unreadable_count`."""

    @abstractmethod
    def _fresh(self) -> None:
        """Discard a message that is only partly received: the wire was opened again."""

    @property
    @abstractmethod
    def unreadable_count(self) -> int:
        """How much could not be read since the start."""

    def _greet(self, deadline_ns: int) -> None:
        """Identify the device; raises DeviceError. Most devices with buttons say nothing."""

    # ---- the contract -----------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Connect, and identify the device if it answers."""
        self._life.require("open", DeviceState.CLOSED)
        self._connect(deadline_s)
        self.info = replace(self.info, transport=self._link.kind)
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the response stream."""
        return (RESPONSES,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; earlier presses are ignored."""
        self._life.require("start", DeviceState.OPEN)
        self._begin()
        self._from_ns = self._clock.now_ns()
        self._sink = sink
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Deliver presses and releases; see the contract."""
        self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        if self._life.state is DeviceState.FAULT:
            return self._reconnect(timeout_s)
        try:
            chunks = self._link.read(timeout_s)
        except DeviceDisconnected as disconnection:
            self._link.close()
            self._life.state = DeviceState.FAULT
            self._retry_ns = self._clock.now_ns()
            what = str(disconnection).removesuffix(f"; {disconnection.remedy}")
            raise DeviceDisconnected(
                what, role=self.info.role, remedy=self._spec.remedy
            ) from disconnection
        return self._deliver(chunks)

    def due_ns(self) -> int:
        """Return until when nothing can arrive; see `visavis.devices.pump.Foreseeing`."""
        if self._life.state is not DeviceState.STREAMING or not isinstance(self._link, MemoryLink):
            return 0
        return self._link.quiet_until_ns(self._clock.now_ns())

    def close(self) -> None:
        """Release the link; idempotent."""
        self._sink = None
        self._link.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report presses and releases so far."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, reconnects=self._reconnects)

    def check(self) -> tuple[Fault, ...]:
        """Report messages that could not be read, and buttons without a name."""
        faults = []
        if self.unreadable_count:
            text = f"{self.unreadable_count} messages could not be read"
            faults.append(Fault(self.info.role, "warning", text, self._spec.remedy))
        if self._unknown:
            text = f"pressed, but unknown here: {', '.join(sorted(self._unknown))}"
            faults.append(Fault(self.info.role, "warning", text, "name them under keys"))
        return tuple(faults)

    # ---- for drivers ------------------------------------------------------------------------

    def _name(self, buttons: Sequence[str]) -> None:
        """Take the device's buttons; raises ConfigError for a name given to none of them."""
        unknown = [button for button in self._keys if button not in buttons]
        if unknown:
            raise ConfigError(
                f"{self._role}: keys names {', '.join(unknown)}, but the device has "
                f"{', '.join(buttons)}"
            )
        control_names = [self._keys.get(button, button) for button in buttons]
        self.controls = tuple(dict.fromkeys(control_names))
        self._index = {
            b: self.controls.index(c) for b, c in zip(buttons, control_names, strict=True)
        }

    # ---- inside -----------------------------------------------------------------------------

    def _begin(self) -> None:
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._seq = 0
        self._fresh()

    def _connect(self, deadline_s: float) -> None:
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        try:
            self._link.open(deadline_s)
            self._fresh()
            self._greet(deadline_ns)
        except DeviceError:
            self._link.close()
            raise

    def _deliver(self, chunks: Sequence[Chunk]) -> int:
        rows = [(c.t_host_ns, p) for c in chunks for p in self._read(c.data)]
        rows = [(t_ns, p) for t_ns, p in rows if t_ns >= self._from_ns]
        self._unknown |= {p.button for _, p in rows if p.button not in self._index}
        rows = [(t_ns, p) for t_ns, p in rows if p.button in self._index]
        if not rows or self._sink is None:
            return 0
        values = np.zeros(len(rows), RESPONSES.dtype)
        values["control"] = [self._index[p.button] for _, p in rows]
        values["value_01"] = [p.value_01 for _, p in rows]
        host = np.array([t_ns for t_ns, _ in rows], np.int64)
        device_times_ns = [p.t_device_ns for _, p in rows]
        device = np.array([NO_DEVICE_TIME if t is None else t for t in device_times_ns], np.int64)
        seq = np.arange(self._seq, self._seq + len(rows))
        self._seq += len(rows)
        self._meter.update((host if None in device_times_ns else device).tolist(), int(host[-1]))
        self._sink(SampleBatch(RESPONSES, seq, device, host, values))
        return len(rows)

    def _reconnect(self, timeout_s: float) -> int:
        now_ns = self._clock.now_ns()
        if now_ns >= self._retry_ns:
            self._retry_ns = now_ns + round(AGAIN_S * NS_PER_S)
            try:
                self._connect(RECONNECT_S)
            except DeviceError:
                self._link.close()
            else:
                self._reconnects += 1
                self._life.state = DeviceState.STREAMING
                return 0
        if timeout_s > 0:
            self._clock.sleep_until_ns(now_ns + round(timeout_s * NS_PER_S))
        return 0
