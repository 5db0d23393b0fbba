"""Drive a band that neither acknowledges nor falls silent by itself, in any `BandLanguage`.

The host does everything that our own firmware would do: end a time to live, run the course of a
pattern, silence the motors when the experiment loop stands still. Rows of `HAPTICS` have
`acknowledged` False and no device time. A separate thread watches running motors besides `poll`, so
that no motor stays on when the pump dies; when the computer itself dies, only the band can help.
"""

import atexit
import contextlib
import math
import threading
import weakref
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import (
    BAND,
    BAND_EVENTS,
    HAPTICS,
    NO_DEVICE_TIME,
    DeviceState,
    Fault,
    Health,
    Sink,
    VibrationPattern,
)
from visavis.devices.drivers.armband.ledger import (
    BandRow,
    band_batch,
    command_batch,
)
from visavis.devices.drivers.bands.language import BandLanguage, Condition, Notice, Ready, Refusal
from visavis.devices.drivers.bands.limits import MAX_TTL_MS, Limits
from visavis.devices.drivers.bands.traffic import BandTraffic
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout, ProtocolViolation
from visavis.lab.schema import StreamSchema

OPENING_AGAIN_NS = NS_PER_S
RETRY_NS = 250 * NS_PER_MS
WATCH_S = 0.05
WATCH_GRACE_NS = 50 * NS_PER_MS
LOW_BATTERY_01 = 0.2
REPORT_EVENT, EXPIRED_EVENT = BAND_EVENTS.index("report"), BAND_EVENTS.index("expired")
REMEDY = "check that the band is switched on, charged and plugged in or paired"

HOST_SIDE_ONLY = "host_side_safety_only"
"""Capability of a band that goes on vibrating when this computer fails; see `check`."""

open_bands: "weakref.WeakSet[Any]" = weakref.WeakSet()
"""Bands that are open now."""


def silence_every_open_band() -> None:
    """Silence every open band; registered to run when the interpreter exits."""
    for band in list(open_bands):
        band.silence()


atexit.register(silence_every_open_band)


class HostTimedBand(HasLife):
    """Follow the `Armband` contract; see the module.

    At most `max_rate_hz` settings leave per second: a sooner one waits, and a newer one takes
    its place. A silence never waits, and is sent three times because nobody confirms it.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        language: BandLanguage,
        clock: Clock,
        *,
        spec: AnySpec,
        max_rate_hz: float = 50.0,
    ) -> None:
        self._role = role
        self._link = link
        self._language = language
        self._clock = clock
        self._life = Lifecycle(role)
        self._traffic = BandTraffic(link, language, clock, max_rate_hz)
        self._sink: Sink | None = None
        self._watcher: threading.Thread | None = None
        self._watch_ends = threading.Event()
        self.rate_range_hz = language.rate_range_hz
        takes_rates = not math.isnan(language.rate_range_hz[0])
        self._limits = Limits(role, language.motor_count, language.rate_range_hz, takes_rates)
        abilities = {"haptics", "patterns_on_host"}
        if language.lasts_ms(MAX_TTL_MS) is None:
            abilities.add(HOST_SIDE_ONLY)
        if takes_rates:
            abilities.add("rate")
        self.info = replace(spec.info(role, link), capabilities=frozenset(abilities))
        self._condition = Condition()
        self._refusals: dict[str, str] = {}
        self._reset()

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self._language.motor_count

    # ---- life -------------------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Connect, send the opening, wait for its answer if there is one, silence the motors."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._condition = Condition()
        self._refusals = {}
        self._reset()
        try:
            self._link.open(deadline_s)
            self._greet()
            while not self._ready:
                self._await_ready(deadline_ns)
            self._traffic.write(self._language.silence())
        except DeviceError as problem:
            self._link.close()
            if problem.role:
                raise
            message = str(problem).removesuffix(f"; {problem.remedy}")
            raise type(problem)(message, role=self._role, remedy=problem.remedy) from problem
        self.info = replace(self.info, transport=self._link.kind)
        self._life.state = DeviceState.OPEN
        open_bands.add(self)

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the commands' stream and the band's own."""
        return (HAPTICS, BAND)

    def start(self, sink: Sink) -> None:
        """Begin to deliver rows; commands are taken from now on."""
        self._life.require("start", DeviceState.OPEN)
        self._reset()
        self._ready = True
        self._sink = sink
        self._life.state = DeviceState.STREAMING
        if not self._clock.is_virtual:
            self._watch_ends = threading.Event()
            self._watcher = threading.Thread(
                target=self._watch, args=(self._watch_ends,), name=f"band-{self._role}", daemon=True
            )
            self._watcher.start()

    def poll(self, timeout_s: float) -> int:
        """Take what the band says, send what is due, deliver rows."""
        if self._life.state is DeviceState.FAULT:
            return self._reconnect(timeout_s)
        self._life.require("poll", DeviceState.STREAMING)
        try:
            if self._traffic.failure is not None:
                raise DeviceDisconnected(str(self._traffic.failure))
            for chunk in self._link.read(self._traffic.patience_s(timeout_s)):
                self._take(chunk.data, chunk.t_host_ns)
            self._traffic.keep_up(self._clock.now_ns())
        except (DeviceDisconnected, DeviceTimeout) as problem:
            self._lose()
            self._deliver()
            raise DeviceDisconnected(str(problem), role=self._role, remedy=REMEDY) from problem
        return self._deliver()

    def stop(self) -> None:
        """Silence; the connection stays."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._end_watch()
        self.silence()
        self._deliver()
        self._sink = None
        is_away = self._traffic.failure is not None or self._life.state is DeviceState.FAULT
        self._life.state = DeviceState.OPEN
        if is_away:
            self._link.close()

    def close(self) -> None:
        """Silence, give the band back to its wearer and release the link; idempotent."""
        self._end_watch()
        if self._life.state in (DeviceState.STREAMING, DeviceState.OPEN):
            self.silence()
            with contextlib.suppress(DeviceError):  # gone already: nothing is left to say
                self._traffic.write(self._language.closing())
        self._sink = None
        self._link.close()
        self._life.state = DeviceState.CLOSED
        open_bands.discard(self)

    def health(self) -> Health:
        """Report rows delivered, and the battery where the band reports it."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, battery_01=self._condition.battery_01)

    def check(self) -> tuple[Fault, ...]:
        """Name what is wrong with the band, and what it cannot promise."""
        role, faults = self._role, []
        if HOST_SIDE_ONLY in self.info.capabilities:
            text = "this band goes on vibrating when the computer or the link fails"
            faults.append(Fault(role, "warning", text, "stay near its switch"))
        battery = self._condition.battery_01
        if battery is not None and battery < LOW_BATTERY_01:
            text = f"battery low ({battery:.0%})"
            faults.append(Fault(role, "warning", text, "charge it at the break"))
        if self._condition.is_worn is False:
            faults.append(
                Fault(role, "blocking", "its program does not see the band", "switch it on, pair")
            )
        if self._traffic.loop_stalled:
            text = "silenced because the experiment loop stood still"
            faults.append(Fault(role, "warning", text, "close other programs on this computer"))
        for text, remedy in self._refusals.items():
            faults.append(Fault(role, "warning", text, remedy))
        if self._language.unreadable_count:
            text = f"{self._language.unreadable_count} messages could not be read"
            faults.append(Fault(role, "warning", text, "keep the .wire log and report it"))
        return tuple(faults)

    # ---- commands ---------------------------------------------------------------------------

    def set_amplitudes(
        self,
        amplitudes_01: Sequence[float],
        ttl_ms: int,
        rates_hz: Sequence[float] | None = None,
    ) -> int:
        """Drive every motor; see the contract."""
        self._life.require("set_amplitudes", DeviceState.STREAMING, DeviceState.FAULT)
        self._limits.check_setting(amplitudes_01, ttl_ms, rates_hz)
        return self._traffic.set(amplitudes_01, ttl_ms, rates_hz)

    def play(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float = 1.0
    ) -> int:
        """Play a pattern from the host: the course of its rate becomes one of amplitude.

        Such a band has no rate to follow; the amplitude is the share of `high_hz`. Every
        step is a row of its own (`kind` 3).
        """
        self._life.require("play", DeviceState.STREAMING, DeviceState.FAULT)
        self._limits.check_pattern(pattern, motors, amplitude_01)
        return self._traffic.play(pattern, motors, amplitude_01)

    def keep_alive(self) -> None:
        """Note that the experiment loop is alive."""
        self._traffic.keep_alive()

    def silence(self) -> int:
        """Stop every motor now, in any state; see the contract."""
        return -1 if self._life.state is DeviceState.CLOSED else self._traffic.silence()

    # ---- watching ---------------------------------------------------------------------------

    def _reset(self) -> None:
        self._traffic.reset()
        self._meter = StreamMeter(0.0)
        self._band_rows: list[BandRow] = []
        self._row_seq = self._band_seq = 0
        self._ready = False
        self._greeted_ns: int | None = None
        self._retry_ns = self._clock.now_ns()

    def _watch(self, ends: threading.Event) -> None:
        while not ends.wait(WATCH_S):
            self._traffic.end_if_due(self._clock.now_ns(), WATCH_GRACE_NS)

    def _end_watch(self) -> None:
        watcher, self._watcher = self._watcher, None
        self._watch_ends.set()
        if watcher is not None and watcher is not threading.current_thread():
            watcher.join()

    # ---- receiving --------------------------------------------------------------------------

    def _take(self, data: bytes, t_host_ns: int) -> None:
        for notice in self._language.feed(data):
            self._take_notice(notice, t_host_ns)

    def _take_notice(self, notice: Notice, t_host_ns: int) -> None:
        if isinstance(notice, Ready):
            self._ready = True
            self.info = replace(
                self.info,
                model=notice.model or self.info.model,
                serial=notice.serial or self.info.serial,
            )
        elif isinstance(notice, Refusal):
            if not self._ready:
                raise ProtocolViolation(notice.message, role=self._role, remedy=notice.remedy)
            self._refusals[notice.message] = notice.remedy
        else:
            previous = self._condition
            self._condition = Condition(
                previous.battery_01 if notice.battery_01 is None else notice.battery_01,
                previous.temperature_c if notice.temperature_c is None else notice.temperature_c,
                previous.is_worn if notice.is_worn is None else notice.is_worn,
            )
            if notice.battery_01 is not None or notice.temperature_c is not None:
                self._tell_band(REPORT_EVENT, t_host_ns)

    def _tell_band(self, event: int, t_host_ns: int) -> None:
        condition = self._condition
        battery = math.nan if condition.battery_01 is None else condition.battery_01
        heat = math.nan if condition.temperature_c is None else condition.temperature_c
        if self._band_rows:
            t_host_ns = max(t_host_ns, self._band_rows[-1].t_host_ns)
        self._band_rows.append(BandRow(t_host_ns, NO_DEVICE_TIME, event, battery, heat))

    def _deliver(self) -> int:
        rows = self._traffic.take_rows()
        while self._traffic.expired_ns:
            self._tell_band(EXPIRED_EVENT, self._traffic.expired_ns.pop(0))
        band_rows, self._band_rows = self._band_rows, []
        sink = self._sink
        if sink is None:
            return 0
        if rows:
            self._meter.update([], rows[-1].t_host_ns)
            sink(command_batch(rows, self._row_seq))
            self._row_seq += len(rows)
        if band_rows:
            sink(band_batch(band_rows, self._band_seq))
            self._band_seq += len(band_rows)
        self._meter.sample_count += len(rows) + len(band_rows)
        return len(rows) + len(band_rows)

    # ---- connection -------------------------------------------------------------------------

    def _greet(self) -> None:
        self._language.reset()
        self._ready = not self._language.answers
        self._greeted_ns = self._traffic.write(self._language.opening())

    def _await_ready(self, deadline_ns: int) -> None:
        now_ns = self._clock.now_ns()
        if now_ns >= deadline_ns:
            raise DeviceTimeout("the band does not answer", role=self._role, remedy=REMEDY)
        again_ns = (self._greeted_ns or now_ns) + OPENING_AGAIN_NS
        if now_ns >= again_ns:
            self._greet()
            again_ns = now_ns + OPENING_AGAIN_NS
        wait_ns = min(again_ns, deadline_ns) - now_ns
        for chunk in self._link.read(wait_ns / NS_PER_S):
            self._take(chunk.data, chunk.t_host_ns)

    def _lose(self) -> None:
        self._traffic.lose()
        self._greeted_ns = None
        self._retry_ns = self._clock.now_ns()
        self._life.state = DeviceState.FAULT
        self._link.close()

    def _reconnect(self, timeout_s: float) -> int:
        """Continue the attempt to reconnect; the loss has been reported already."""
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_ns:
            if timeout_s > 0:
                wait_ns = min(round(timeout_s * NS_PER_S), self._retry_ns - now_ns)
                self._clock.sleep_until_ns(now_ns + wait_ns)
            return self._deliver()
        try:
            if self._greeted_ns is None:
                self._link.open(timeout_s)
                self._greet()
            elif now_ns - self._greeted_ns > OPENING_AGAIN_NS:
                raise DeviceTimeout("no answer to the opening", role=self._role)
            for chunk in self._link.read(timeout_s if not self._ready else 0.0):
                self._take(chunk.data, chunk.t_host_ns)
            if self._ready:
                self._traffic.write(self._language.silence())
                self._traffic.regain()
                self._life.state = DeviceState.STREAMING
        except DeviceError:
            self._greeted_ns = None
            self._retry_ns = self._clock.now_ns() + RETRY_NS
            self._link.close()
        return self._deliver()
