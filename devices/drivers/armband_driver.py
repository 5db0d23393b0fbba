"""Drive an armband over any byte link in any dialect: commands, answers, keep-alive, silence.

Commands leave at once, in the thread that gives them; answers are taken in `poll`. A refresh
twenty times a second repeats what should hold, so that neither a lost nor a falsely accepted
frame lasts; it goes on only while the experiment loop says that it lives (`keep_alive`).
"""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from devices.byte_links import ByteLink, Chunk
from devices.contracts import (
    BAND,
    BAND_EVENTS,
    HAPTICS,
    PATTERN_NAMES,
    ClockPair,
    DeviceInfo,
    DeviceState,
    Fault,
    Health,
    Sink,
    VibrationPattern,
)
from devices.drivers import armband_codec as codec
from devices.drivers.armband_dialect import Answer, Dialect, Drive
from devices.drivers.armband_ledger import (
    KEEP_ALIVE,
    PATTERN,
    SET,
    SILENCE,
    BandRow,
    Command,
    DeviceMicros,
    band_batch,
    command_batch,
)
from devices.drivers.armband_status import BandStatus
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.clock_fit import fit_clock
from lab.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceTimeout,
    ProtocolViolation,
)
from lab.schema import StreamSchema

REFRESH_NS = 50 * NS_PER_MS
STALL_NS = 150 * NS_PER_MS
TRY_NS = 50 * NS_PER_MS
STOP_TRIES = 3
GIVE_UP_NS = 250 * NS_PER_MS
LOST_NS = NS_PER_S
GREETING_NS = 250 * NS_PER_MS
PATTERN_TAIL_NS = 200 * NS_PER_MS
OPENING_PINGS = 8
LONGEST_MS = 2000
"""Longest pattern; a set may live up to LONGEST_TTL_MS."""
LONGEST_TTL_MS = 10_000
RECENT_EXCHANGES = 200
MOST_PAIRS = 20_000

REMEDY = "check that the band is switched on, charged and plugged in or paired"


@dataclass(slots=True)
class _Asked:
    """A command outside the account that somebody waits for."""

    seq: int
    t_write_ns: int = 0
    tries: int = 0
    answered: bool = False


class ArmbandDriver:
    """Follow the `Armband` contract; see the module.

    At most `max_rate_hz` settings leave per second: a sooner one waits, and a newer one takes
    its place. `armed` bands run motors between `start` and `stop` only.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        dialect: Dialect,
        clock: Clock,
        *,
        driver: str = "serial_armband",
        vendor: str = "Visavis",
        model: str = "armband",
        max_rate_hz: float = 100.0,
    ) -> None:
        self._role = role
        self._link = link
        self._dialect = dialect
        self._clock = clock
        self._spacing_ns = round(NS_PER_S / max_rate_hz)
        self._life = Lifecycle(role)
        self._wire = threading.RLock()  # a signal handler may silence in the midst of a command
        self.rate_range_hz: tuple[float, float] = (math.nan, math.nan)
        self.info = DeviceInfo(
            role=role,
            driver=driver,
            driver_version="1",
            vendor=vendor,
            model=model,
            serial="",
            transport=link.kind,
            is_simulated=link.is_simulated,
            capabilities=frozenset({"haptics", "rate", "patterns"}),
        )
        self._sink: Sink | None = None
        self._pairs: list[ClockPair] = []
        self._seq = 0
        self._greeted = False
        self._micros = DeviceMicros()
        self._band = BandStatus(role, has_dead_man=dialect.has_dead_man)
        self._reset()

    def _reset(self) -> None:
        now_ns = self._clock.now_ns()
        self._meter = StreamMeter(0.0)
        self._under_way: dict[int, Command] = {}
        self._finished: list[Command] = []
        self._band_rows: list[BandRow] = []
        self._waiting: tuple[Command, Drive, int] | None = None
        self._drive: Drive | None = None
        self._running_seq: int | None = None
        self._runs_until_ns = 0
        self._number = self._row_seq = self._band_seq = 0
        self._latest_ns = -(2**63)
        self._alive_ns = self._heard_ns = now_ns
        self._spoke_ns = self._set_ns = now_ns - NS_PER_S
        self._next_report_ns = now_ns
        self._write_failure: DeviceError | None = None
        self._asked: _Asked | None = None
        self._attempt_ends_ns: int | None = None

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the band is gone."""
        return self._life.state

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self._dialect.motor_count

    # ---- life -------------------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Connect, greet the band and exchange times with it."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._pairs = []
        self._band = BandStatus(self._role, has_dead_man=self._dialect.has_dead_man)
        self._reset()
        try:
            self._link.open(deadline_s)
            self._restart_wire()
            if self._dialect.greeting(0):
                self._await(self._greet, lambda: self._greeted, GREETING_NS, deadline_ns)
            if self._dialect.acknowledges:
                for _ in range(OPENING_PINGS):
                    self._confirm(self._ping_bytes, deadline_ns)
        except DeviceError:
            self._link.close()
            raise
        self.info = replace(self.info, transport=self._link.kind)
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the commands' stream and the band's own."""
        return (HAPTICS, BAND)

    def start(self, sink: Sink) -> None:
        """Arm the band and begin to deliver rows."""
        self._life.require("start", DeviceState.OPEN)
        self._reset()
        self._sink = sink
        self._arm(armed=True)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Take answers, refresh what should hold, give up what was lost, deliver rows."""
        life = self._life
        if life.state is DeviceState.FAULT:
            return self._reconnect(timeout_s)
        life.require("poll", DeviceState.STREAMING)
        try:
            for chunk in self._link.read(timeout_s):
                self._take(chunk)
            self._keep_up(self._clock.now_ns())
        except DeviceDisconnected as gone:
            self._lose()
            self._deliver()
            raise DeviceDisconnected(str(gone), role=self._role, remedy=REMEDY) from gone
        return self._deliver()

    def stop(self) -> None:
        """Silence and disarm; the connection stays."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        if self._life.state is DeviceState.STREAMING:
            self._quiet_down()
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Silence, disarm and release the link; idempotent."""
        if self._life.state in (DeviceState.STREAMING, DeviceState.OPEN):
            self._quiet_down()
        self._sink = None
        self._link.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report rows delivered, clock fit of the recent exchanges and battery."""
        health = self._meter.health(self.state, self._clock.now_ns())
        health = replace(health, battery_01=self._band.battery_01)
        pairs = self._pairs[-RECENT_EXCHANGES:]
        if not pairs:
            return health
        fit = fit_clock(pairs)
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name what is wrong with band, link and loop."""
        return self._band.faults(self._dialect.damaged)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return the time exchanges since open: every acknowledged command is one."""
        return tuple(self._pairs)

    # ---- commands ---------------------------------------------------------------------------

    def set_amplitudes(
        self,
        amplitudes_01: Sequence[float],
        ttl_ms: int,
        rates_hz: Sequence[float] | None = None,
    ) -> int:
        """Drive every motor; see the contract."""
        self._life.require("set_amplitudes", DeviceState.STREAMING, DeviceState.FAULT)
        self._check_amplitudes(amplitudes_01)
        if not 1 <= ttl_ms <= LONGEST_TTL_MS:
            raise self._wrong(f"ttl_ms is 1 to {LONGEST_TTL_MS}, not {ttl_ms}")
        if rates_hz is not None:
            if len(rates_hz) != self.motor_count:
                raise self._wrong(f"{len(rates_hz)} rates for {self.motor_count} motors")
            for rate in rates_hz:
                self._check_rate(rate)
        now_ns = self._clock.now_ns()
        drive = Drive(tuple(amplitudes_01), None if rates_hz is None else tuple(rates_hz))
        with self._wire:
            self._alive_ns = now_ns
            command = self._new(
                SET,
                now_ns,
                amplitudes_01=drive.amplitudes_01,
                rates_hz=drive.rates_hz,
                duration_ms=float(ttl_ms),
            )
            self._drop_waiting(now_ns)
            self._waiting = (command, drive, now_ns + ttl_ms * NS_PER_MS)
            self._send_waiting(now_ns)
        return command.number

    def play(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float = 1.0
    ) -> int:
        """Start a pattern; never sent twice, so that nobody feels it twice."""
        self._life.require("play", DeviceState.STREAMING, DeviceState.FAULT)
        self._check_pattern(pattern, motors, amplitude_01)
        now_ns = self._clock.now_ns()
        with self._wire:
            self._alive_ns = now_ns
            self._drop_waiting(now_ns)
            seq = self._next_seq()
            data = self._dialect.pattern(seq, pattern, motors, amplitude_01)
            if data is None:
                raise self._wrong(f"this band cannot play {pattern.name!r} by itself")
            chosen = [motor in motors for motor in range(self.motor_count)]
            command = self._new(
                PATTERN,
                now_ns,
                amplitudes_01=[amplitude_01 if on else 0.0 for on in chosen],
                rates_hz=[pattern.high_hz if on else math.nan for on in chosen],
                duration_ms=float(pattern.duration_ms),
                pattern=PATTERN_NAMES.index(pattern.name),
                low_hz=pattern.low_hz,
                modulation_hz=pattern.modulation_hz,
            )
            command.seq, command.data = seq, data
            self._drive = None
            self._running_seq = seq
            self._runs_until_ns = now_ns + pattern.duration_ms * NS_PER_MS + PATTERN_TAIL_NS
            self._send(command)
        return command.number

    def keep_alive(self) -> None:
        """Take the experiment loop's word that it runs."""
        self._alive_ns = self._clock.now_ns()
        self._band.loop_stalled = False

    def silence(self) -> int:
        """Stop every motor now, whatever state this is in; see the contract."""
        if self._life.state is DeviceState.CLOSED:
            return -1
        with self._wire:
            now_ns = self._clock.now_ns()
            self._drop_waiting(now_ns)
            self._drive = self._running_seq = None
            command = self._new(
                SILENCE, now_ns, amplitudes_01=(0.0,) * self.motor_count, duration_ms=math.nan
            )
            command.seq = self._next_seq()
            command.data = self._dialect.stop(command.seq)
            self._send(command)
        return command.number

    # ---- sending ----------------------------------------------------------------------------

    def _new(
        self, kind: int, t_ns: int, *, amplitudes_01: Sequence[float], duration_ms: float,
        rates_hz: Sequence[float] | None = None, pattern: int = 255, low_hz: float = math.nan,
        modulation_hz: float = math.nan,
    ) -> Command:  # fmt: skip
        number = self._number
        self._number += 1
        return Command(
            number, kind, 0, b"", t_ns, amplitudes_01, rates_hz, duration_ms, pattern, low_hz,
            modulation_hz,
        )  # fmt: skip

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % 256
        return self._seq

    def _send(self, command: Command) -> None:
        """Write a command; what cannot be written is given up, and `poll` finds the band gone."""
        with self._wire:
            command.tries += 1
            command.t_write_ns = self._clock.now_ns()
            if self._life.state is DeviceState.FAULT:
                self._finish(command, command.t_write_ns)
                return
            previous = self._under_way.pop(command.seq, None)
            if previous is not None and previous is not command:
                self._finish(previous, command.t_write_ns)
            try:
                command.t_sent_ns = self._link.write(command.data)
            except (DeviceDisconnected, DeviceTimeout) as problem:
                self._write_failure = problem
                self._finish(command, self._clock.now_ns())
                return
            self._spoke_ns = command.t_sent_ns
            if self._dialect.acknowledges:
                self._under_way[command.seq] = command
            else:
                self._finish(command, command.t_sent_ns)

    def _send_waiting(self, now_ns: int) -> None:
        if self._waiting is None or now_ns - self._set_ns < self._spacing_ns:
            return
        command, drive, expires_ns = self._waiting
        self._waiting = None
        ttl_ms = math.ceil((expires_ns - now_ns) / NS_PER_MS)
        if ttl_ms < 1:
            self._finish(command, now_ns)
            return
        self._set_ns = now_ns
        command.seq = self._next_seq()
        command.data = self._dialect.set(command.seq, drive, ttl_ms)
        self._drive = None if drive.is_silent else drive
        self._running_seq = None if drive.is_silent else command.seq
        self._runs_until_ns = expires_ns
        self._send(command)

    def _drop_waiting(self, now_ns: int) -> None:
        if self._waiting is not None:
            self._finish(self._waiting[0], now_ns)
            self._waiting = None

    def _keep_up(self, now_ns: int) -> None:
        """Send what is due: the waiting setting, silence for a stalled loop, refresh, retries."""
        with self._wire:
            if self._write_failure is not None:
                raise DeviceDisconnected(str(self._write_failure))
            if self._running_seq is not None and now_ns - self._alive_ns > STALL_NS:
                self._band.loop_stalled = True
                self.silence()
            self._send_waiting(now_ns)
            if now_ns - self._spoke_ns >= REFRESH_NS:
                self._refresh(now_ns)
            for command in list(self._under_way.values()):
                waited_ns = now_ns - command.t_sent_ns
                if command.kind == SILENCE and command.tries < STOP_TRIES and waited_ns >= TRY_NS:
                    self._send(command)
                elif waited_ns >= GIVE_UP_NS:
                    del self._under_way[command.seq]
                    self._band.unanswered += 1
                    self._finish(command, now_ns)
            if self._dialect.acknowledges and now_ns - self._heard_ns > LOST_NS:
                raise DeviceDisconnected(f"no answer for {(now_ns - self._heard_ns) / 1e9:.1f} s")

    def _refresh(self, now_ns: int) -> None:
        if self._running_seq is not None and now_ns >= self._runs_until_ns:
            self._drive = self._running_seq = None
        drive = self._drive
        amplitudes = (0.0,) * self.motor_count if drive is None else drive.amplitudes_01
        rates = None if drive is None else drive.rates_hz
        command = self._new(
            KEEP_ALIVE, now_ns, amplitudes_01=amplitudes, rates_hz=rates, duration_ms=math.nan
        )
        command.seq = self._next_seq()
        if drive is not None:
            ttl_ms = math.ceil((self._runs_until_ns - now_ns) / NS_PER_MS)
            command.data = self._dialect.set(command.seq, drive, ttl_ms)
            command.duration_ms = float(ttl_ms)
            self._running_seq = command.seq
        else:
            if self._running_seq is not None:  # a pattern: the band knows how far it is
                command.amplitudes_01 = (math.nan,) * self.motor_count
            command.data = self._dialect.ping(command.seq, self._running_seq)
        if not command.data:
            self._number -= 1
            self._spoke_ns = now_ns
            return
        self._send(command)

    def _quiet_down(self) -> None:
        self.silence()
        if not self._dialect.acknowledges:
            return
        try:
            self._confirm(self._dialect.stop, self._clock.now_ns() + STOP_TRIES * TRY_NS)
            self._arm(armed=False)
        except DeviceError:
            return  # close never raises; a band that hears nothing silences itself

    # ---- receiving --------------------------------------------------------------------------

    def _take(self, chunk: Chunk) -> None:
        for answer in self._dialect.feed(chunk.data):
            with self._wire:
                self._take_answer(answer, chunk.t_host_ns)

    def _take_answer(self, answer: Answer, t_host_ns: int) -> None:
        self._heard_ns = t_host_ns
        device_ns = self._micros.unwrap_ns(answer.device_us)
        if isinstance(answer, codec.Welcome):
            self._take_welcome(answer)
            return
        if isinstance(answer, codec.BandEvent):
            self._band.take_event(answer)
            if answer.code < len(BAND_EVENTS):
                self._tell_band(answer.code, t_host_ns, device_ns)
            if BAND_EVENTS[1] == "boot" and answer.code == 1 and self._sink is not None:
                self._write_failure = DeviceDisconnected("the band started anew")
            return
        if answer.battery_mv is not None or answer.temperature_c is not None:
            self._band.take_report(answer)
            if t_host_ns >= self._next_report_ns:
                self._next_report_ns = t_host_ns + NS_PER_S
                self._tell_band(0, t_host_ns, device_ns)
        asked = self._asked
        if asked is not None and answer.seq == asked.seq:
            asked.answered = True
            if asked.tries == 1:
                self._add_pair(ClockPair(asked.t_write_ns, device_ns, t_host_ns))
            self._asked = None
            return
        command = self._under_way.pop(answer.seq, None)
        if command is None:
            return
        if command.tries == 1:  # after a second try nobody knows which one was answered
            self._add_pair(ClockPair(command.t_write_ns, device_ns, t_host_ns))
        command.acknowledged = answer.status == codec.OK
        if not command.acknowledged:
            self._band.refused(answer.status)
        command.t_device_ns = device_ns
        self._finish(command, t_host_ns)

    def _take_welcome(self, welcome: codec.Welcome) -> None:
        if welcome.version != codec.VERSION:
            raise ProtocolViolation(
                f"the band speaks version {welcome.version} of the protocol, this driver "
                f"{codec.VERSION}",
                role=self._role,
                remedy="flash the firmware that came with this version of Visavis",
            )
        if welcome.motor_count != self.motor_count:
            raise ProtocolViolation(
                f"the band has {welcome.motor_count} motors, this driver drives {self.motor_count}",
                role=self._role,
                remedy="name the driver that fits this band in lab_config.yaml",
            )
        major, minor = welcome.firmware
        self.info = replace(
            self.info,
            model=f"armband (firmware {major}.{minor})",
            serial=welcome.serial,
            transport=self._link.kind,
        )
        self.rate_range_hz = welcome.rate_range_hz
        self._greeted = True

    def _add_pair(self, pair: ClockPair) -> None:
        self._pairs.append(pair)
        if len(self._pairs) > MOST_PAIRS:
            del self._pairs[: MOST_PAIRS // 2]

    def _tell_band(self, event: int, t_host_ns: int, device_ns: int) -> None:
        battery = math.nan if self._band.battery_01 is None else self._band.battery_01
        heat = math.nan if self._band.temperature_c is None else self._band.temperature_c
        self._band_rows.append(BandRow(t_host_ns, device_ns, event, battery, heat))

    def _finish(self, command: Command, t_host_ns: int) -> None:
        self._latest_ns = max(self._latest_ns, t_host_ns)
        command.t_host_ns = self._latest_ns
        self._finished.append(command)

    def _deliver(self) -> int:
        with self._wire:
            rows, self._finished = self._finished, []
            told, self._band_rows = self._band_rows, []
        sink = self._sink
        if sink is None:
            return 0
        if rows:
            self._meter.update([row.t_device_ns for row in rows], rows[-1].t_host_ns)
            sink(command_batch(rows, self._row_seq))
            self._row_seq += len(rows)
        if told:
            self._meter.update([row.t_device_ns for row in told], told[-1].t_host_ns)
            sink(band_batch(told, self._band_seq))
            self._band_seq += len(told)
        return len(rows) + len(told)

    # ---- connection -------------------------------------------------------------------------

    def _restart_wire(self) -> None:
        self._dialect.reset()
        self._micros = DeviceMicros()
        self._under_way.clear()
        self._write_failure = None
        self._greeted = False
        self._seq = 0

    def _greet(self) -> None:
        self._link.write(self._dialect.greeting(self._next_seq()))

    def _ping_bytes(self, seq: int) -> bytes:
        return self._dialect.ping(seq, None)

    def _arm(self, *, armed: bool) -> None:
        data = self._dialect.arming(0, armed)
        if data and self._dialect.acknowledges:
            deadline_ns = self._clock.now_ns() + 2 * GIVE_UP_NS
            self._confirm(lambda seq: self._dialect.arming(seq, armed), deadline_ns)
        elif data:
            self._link.write(data)

    def _confirm(self, encode: Callable[[int], bytes], deadline_ns: int) -> None:
        """Send one command outside the account, again and again, until it is answered."""
        with self._wire:
            seq = self._next_seq()
            data = encode(seq)
            self._asked = _Asked(seq)
        asked = self._asked

        def send() -> None:
            asked.tries += 1
            asked.t_write_ns = self._clock.now_ns()
            self._link.write(data)

        self._await(send, lambda: asked.answered, TRY_NS, deadline_ns)

    def _await(
        self,
        send: Callable[[], None],
        is_done: Callable[[], bool],
        every_ns: int,
        deadline_ns: int,
    ) -> None:
        again_ns = self._clock.now_ns()
        while not is_done():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout("the band does not answer", role=self._role, remedy=REMEDY)
            if now_ns >= again_ns:
                send()
                again_ns = now_ns + every_ns
            wait_ns = max(0, min(again_ns, deadline_ns) - now_ns)
            for chunk in self._link.read(wait_ns / NS_PER_S):
                self._take(chunk)

    def _lose(self) -> None:
        with self._wire:
            now_ns = self._clock.now_ns()
            self._drop_waiting(now_ns)
            for command in self._under_way.values():
                self._finish(command, now_ns)
            self._under_way.clear()
            self._drive = self._running_seq = None
            self._life.state = DeviceState.FAULT
        self._link.close()

    def _reconnect(self, timeout_s: float) -> int:
        """Go on with an attempt to come back; never blocks longer than `timeout_s`.

        Raises nothing: that the band is gone was told once.
        """
        now_ns = self._clock.now_ns()
        try:
            if self._attempt_ends_ns is None:
                self._attempt_ends_ns = now_ns + GREETING_NS
                self._link.open(timeout_s)
                self._restart_wire()
                if self._dialect.greeting(0):
                    self._greet()
                else:
                    self._greeted = True
            for chunk in self._link.read(timeout_s):
                self._take(chunk)
            if self._greeted:
                self._arm(armed=True)
                self._heard_ns = self._alive_ns = self._clock.now_ns()
                self._life.state = DeviceState.STREAMING
                self._attempt_ends_ns = None
                self._band.reconnects += 1
        except (DeviceDisconnected, DeviceTimeout, DeviceError):
            self._link.close()
        if self._attempt_ends_ns is not None and self._clock.now_ns() >= self._attempt_ends_ns:
            self._link.close()
            self._attempt_ends_ns = None
        return self._deliver()

    # ---- what may be asked ------------------------------------------------------------------

    def _check_amplitudes(self, amplitudes_01: Sequence[float]) -> None:
        if len(amplitudes_01) != self.motor_count:
            raise self._wrong(f"{len(amplitudes_01)} amplitudes for {self.motor_count} motors")
        for amplitude in amplitudes_01:
            if not 0 <= amplitude <= 1:
                raise self._wrong(f"an amplitude is 0 to 1, not {amplitude}")

    def _check_rate(self, rate_hz: float) -> None:
        low, high = self.rate_range_hz
        if rate_hz < low or rate_hz > high or not math.isfinite(rate_hz):
            raise self._wrong(f"this band vibrates at {low:g} to {high:g} Hz, not {rate_hz:g}")

    def _check_pattern(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float
    ) -> None:
        self._check_amplitudes([amplitude_01] * self.motor_count)
        for motor in motors:
            if not 0 <= motor < self.motor_count:
                raise self._wrong(f"motors are 0 to {self.motor_count - 1}, not {motor}")
        if not 1 <= pattern.duration_ms <= LONGEST_MS:
            raise self._wrong(f"a pattern lasts 1 to {LONGEST_MS} ms, not {pattern.duration_ms}")
        self._check_rate(pattern.low_hz)
        self._check_rate(pattern.high_hz)
        if pattern.low_hz > pattern.high_hz or not 0 < pattern.modulation_hz <= 50:
            raise self._wrong("a pattern has low_hz <= high_hz and modulation_hz up to 50")

    def _wrong(self, text: str) -> DeviceError:
        return DeviceError(text, role=self._role, remedy="correct the command in the experiment")
