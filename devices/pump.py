"""Keep one device delivering: drive its `poll`, watch for silence, reconnect, count drops.

On a real clock a thread polls the device and `step` hands over what it brought; on a virtual
clock, and for what is simulated in this process, `step` polls by itself. Either way the sink
runs in the caller's thread, once per frame. A device that knows when its wire brings something
next (`Foreseeing`) is left alone until then on a virtual clock.
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

from visavis.devices.contracts import Device, DeviceState, Fault, Health, Sink
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected
from visavis.lab.schema import SampleBatch

QUEUE_BATCHES = 4096
SILENCE_PERIODS = 3
SILENCE_AT_LEAST_NS = 100 * NS_PER_MS
STALLED_NS = NS_PER_S
FIRST_BACK_OFF_NS = NS_PER_S // 2
LAST_BACK_OFF_NS = 8 * NS_PER_S
THREAD_POLL_S = 0.02
IN_PROCESS_TRANSPORTS = frozenset({"memory", "none", "openvr", "openxr"})

EventKind = Literal[
    "silent", "stalled", "resumed", "disconnected", "reconnected", "failed", "dropped"
]


@dataclass(frozen=True)
class PumpEvent:
    """Something that happened to a device's delivery, for the event log.

    `gap_ms` is how long nothing came: set on "resumed" and "reconnected", None otherwise.
    """

    t_ns: int
    role: str
    kind: EventKind
    severity: Literal["info", "warning", "blocking"]
    message: str
    remedy: str = ""
    gap_ms: float | None = None


@runtime_checkable
class Foreseeing(Protocol):
    """A device that knows until when polling it would do nothing."""

    def due_ns(self) -> int:
        """Return a session time before which `poll` has nothing to do; 0 where unknown.

        It is valid until the next command to the device, which may make it earlier.
        """
        ...


@runtime_checkable
class Pausing(Protocol):
    """A device that now and then sends nothing on purpose."""

    @property
    def is_paused(self) -> bool:
        """Tell whether silence is meant now."""
        ...


@runtime_checkable
class Postponing(Protocol):
    """A device whose polling can be put off: it delivers the same later, with the same times."""

    def put_off(self) -> bool:
        """Do everything that is due except delivery; False if `poll` must be called now.

        Until delivery nobody may ask the device for anything computed from its samples.
        """
        ...

    def put_off_until_ns(self) -> int:
        """Return a session time before which `put_off` has nothing to do and returns True.

        It holds until the next command to the device; 0 where unknown.
        """
        ...


class Pump:
    """Own the delivery of one open device from `start` to `stop`.

    The owner of the sink must call `step` once per frame. It never raises because of the device;
    look at `faults` and `take_events`.
    """

    def __init__(self, device: Device, sink: Sink, clock: Clock) -> None:
        self.device = device
        self._sink = sink
        self._clock = clock
        self.tap: Sink | None = None
        """Called with every batch when it arrives, in the thread that polls the device."""
        self._queue: deque[SampleBatch] = deque()
        self._events: deque[PumpEvent] = deque()
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._running = False
        self._role = device.info.role
        self._due_ns: Callable[[], int] = _always
        if clock.is_virtual and isinstance(device, Foreseeing):
            self._due_ns = device.due_ns
        self._put_off: Callable[[], bool] = _never
        self._put_off_until_ns: Callable[[], int] = _always
        if clock.is_virtual and isinstance(device, Postponing):
            self._put_off = device.put_off
            self._put_off_until_ns = device.put_off_until_ns
        self.is_put_off = False
        self._pausing = device if isinstance(device, Pausing) else None
        """Whether the last `step` postponed the device's delivery."""
        self._silence_ns: int | None = None
        self._quiet: Literal["", "silent", "stalled"] = ""
        self._last_ns = 0
        self._dropped_count = 0
        self._reported_count = 0
        self._reconnects = 0
        self._back_off_ns = 0
        self._retry_ns = 0
        self._lost_ns: int | None = None
        self._failure: Fault | None = None

    def start(self, *, in_thread: bool | None = None) -> None:
        """Start the device and, on a real clock, its thread.

        A device that paces the session (it has `wait_frame`) gets none: its poses must be there
        in the same frame. Nor does one simulated in this process: the body it measures belongs
        to the session's thread. `in_thread` overrides these rules.
        """
        if self._running:
            raise RuntimeError(f"pump of {self._role}: start() while already running")
        rates = [schema.nominal_rate_hz for schema in self.device.describe()]
        fastest = max(rates, default=0.0)
        self._silence_ns = None
        if fastest > 0:
            period_ns = round(SILENCE_PERIODS * NS_PER_S / fastest)
            self._silence_ns = max(SILENCE_AT_LEAST_NS, period_ns)
        self._quiet = ""
        self._failure = None
        self._lost_ns = None
        self._last_ns = self._clock.now_ns()
        self._stopping.clear()
        self.device.start(self._take)
        self._running = True
        if in_thread is None:
            info = self.device.info
            lives_here = info.is_simulated and info.transport in IN_PROCESS_TRANSPORTS
            paces = hasattr(self.device, "wait_frame")
            in_thread = not (self._clock.is_virtual or paces or lives_here)
        if in_thread:
            self._thread = threading.Thread(
                target=self._run, name=f"device-{self._role}", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        """Stop polling and the device; hand over what is left. Idempotent."""
        if not self._running:
            return
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._hand_over()
        self._running = False
        if self.device.state is not DeviceState.CLOSED:
            self.device.stop()
            self._hand_over()

    def step(self, *, may_wait: bool = False) -> int:
        """Hand everything that arrived to the sink; return the number of samples.

        With `may_wait` a device that allows it is polled in a later step; then `is_put_off` is
        True.
        """
        self.is_put_off = may_wait and self._running and not self._queue and self._put_off()
        if self.is_put_off:
            return 0
        if self._running and self._thread is None and self._due_ns() <= self._clock.now_ns():
            self._poll(0.0)
        sample_count = self._hand_over() if self._queue else 0
        if self._running and self._silence_ns is not None:
            self._watch(self._clock.now_ns())
        return sample_count

    def put_off_until_ns(self) -> int:
        """Return a session time before which a `step` that may wait does nothing; 0 if unknown."""
        return self._put_off_until_ns() if self._running and not self._queue else 0

    def idle_until_ns(self) -> int:
        """Return a session time before which `step` would do nothing; 0 if unknown."""
        # each step looks whether a device that streams has fallen silent
        if self._silence_ns is not None or self._queue or self._thread is not None:
            return 0
        return self._due_ns() if self._running else 0

    def faults(self) -> tuple[Fault, ...]:
        """Return what is wrong now: the pump's findings, then the device's own."""
        faults: list[Fault] = []
        if self._failure is not None:
            faults.append(self._failure)
        elif self._lost_ns is not None:
            faults.append(
                Fault(self._role, "blocking", "disconnected; reconnecting", _RECONNECT_REMEDY)
            )
        elif self._quiet:
            quiet_ms = (self._clock.now_ns() - self._last_ns) / NS_PER_MS
            severity: Literal["warning", "blocking"] = (
                "blocking" if self._quiet == "stalled" else "warning"
            )
            faults.append(
                Fault(self._role, severity, f"no data for {quiet_ms:.0f} ms", _SILENCE_REMEDY)
            )
        if self._dropped_count:
            faults.append(
                Fault(
                    self._role,
                    "warning",
                    f"{self._dropped_count} samples dropped because the session did not take them",
                    "close other programs on this computer",
                )
            )
        return (*faults, *self.device.check())

    def take_events(self) -> tuple[PumpEvent, ...]:
        """Return the events since the last call, oldest first."""
        events = []
        while self._events:
            events.append(self._events.popleft())
        return tuple(events)

    def health(self) -> Health:
        """Return the device's health with this pump's reconnects and drops."""
        health = self.device.health()
        return replace(health, reconnects=self._reconnects, dropped=self._dropped_count)

    @property
    def is_threaded(self) -> bool:
        """Tell whether a thread of its own polls the device."""
        return self._thread is not None

    def _take(self, batch: SampleBatch) -> None:
        if self.tap is not None:
            self.tap(batch)
        if len(self._queue) >= QUEUE_BATCHES:
            self._dropped_count += len(batch)
            return
        self._queue.append(batch)

    def _hand_over(self) -> int:
        sample_count = 0
        queue, sink = self._queue, self._sink
        while queue:
            batch = queue.popleft()
            sink(batch)
            sample_count += batch.seq.shape[0]
        if self._dropped_count > self._reported_count:
            count, self._reported_count = (
                self._dropped_count - self._reported_count,
                self._dropped_count,
            )
            self._tell("dropped", "warning", f"{count} samples dropped: the session was too slow")
        return sample_count

    def _run(self) -> None:
        while not self._stopping.is_set() and self._failure is None:
            waiting = self._lost_ns is not None and self._clock.now_ns() < self._retry_ns
            if waiting:
                self._stopping.wait(THREAD_POLL_S)
            else:
                self._poll(THREAD_POLL_S)

    def _poll(self, timeout_s: float) -> None:
        if self._failure is not None:
            return
        if self._lost_ns is not None and self._clock.now_ns() < self._retry_ns:
            return
        try:
            sample_count = self.device.poll(timeout_s)
        except DeviceDisconnected as disconnection:
            self._lose(disconnection)
            return
        except Exception as failure:  # top of a thread: the operator must see any error
            self._failure = Fault(
                self._role,
                "blocking",
                f"driver failed: {type(failure).__name__}: {failure}",
                "stop the session, send the .wire log with the report, restart the device",
            )
            self._tell("failed", "blocking", self._failure.message, self._failure.remedy)
            return
        if self._lost_ns is not None and self.device.state is DeviceState.STREAMING:
            self._recover()
        if sample_count:
            self._last_ns = self._clock.now_ns()

    def _lose(self, disconnection: DeviceDisconnected) -> None:
        now_ns = self._clock.now_ns()
        if self._lost_ns is None:
            self._lost_ns = self._last_ns
            self._back_off_ns = FIRST_BACK_OFF_NS
            self._tell("disconnected", "blocking", str(disconnection), disconnection.remedy)
        else:
            self._back_off_ns = min(2 * self._back_off_ns, LAST_BACK_OFF_NS)
        self._retry_ns = now_ns + self._back_off_ns

    def _recover(self) -> None:
        now_ns = self._clock.now_ns()
        since_ns = self._lost_ns if self._lost_ns is not None else now_ns
        gap_ms = (now_ns - since_ns) / NS_PER_MS
        self._lost_ns = None
        self._quiet = ""
        self._last_ns = now_ns
        self._reconnects += 1
        self._tell("reconnected", "info", f"back after {gap_ms:.0f} ms", gap_ms=gap_ms)

    def _watch(self, now_ns: int) -> None:
        if self._silence_ns is None:
            return
        if self._pausing is not None and self._pausing.is_paused:
            self._last_ns = now_ns
        quiet_ns = now_ns - self._last_ns
        if quiet_ns < self._silence_ns and not self._quiet:
            return
        if self._lost_ns is not None or self._failure is not None:
            return
        if quiet_ns >= STALLED_NS:
            if self._quiet != "stalled":
                self._quiet = "stalled"
                message = f"no data for {quiet_ns / NS_PER_S:.0f} s"
                self._tell("stalled", "blocking", message, _SILENCE_REMEDY)
        elif quiet_ns >= self._silence_ns:
            if not self._quiet:
                self._quiet = "silent"
                message = f"no data for {self._silence_ns / NS_PER_MS:.0f} ms"
                self._tell("silent", "warning", message, _SILENCE_REMEDY)
        elif self._quiet:
            self._quiet = ""
            self._tell("resumed", "info", "data again")

    def _tell(
        self,
        kind: EventKind,
        severity: Literal["info", "warning", "blocking"],
        message: str,
        remedy: str = "",
        gap_ms: float | None = None,
    ) -> None:
        self._events.append(
            PumpEvent(self._clock.now_ns(), self._role, kind, severity, message, remedy, gap_ms)
        )


def _always() -> int:
    return 0


def _never() -> bool:
    return False


_SILENCE_REMEDY = "look at the device and its program; the session goes on when data come back"
_RECONNECT_REMEDY = "check cable and program; the session goes on when it is back"
