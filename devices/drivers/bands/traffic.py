"""Send settings, pattern steps, repetitions and silence to a band that the host drives."""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import PATTERN_NAMES, VibrationPattern
from visavis.devices.drivers.armband.ledger import (
    KEEP_ALIVE,
    NO_PATTERN,
    PATTERN,
    SET,
    SILENCE,
    Command,
)
from visavis.devices.drivers.bands.language import BandLanguage
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError

STALL_NS = 150 * NS_PER_MS
REFRESH_NS = 100 * NS_PER_MS
SILENCE_AGAIN_NS = 50 * NS_PER_MS
SILENCE_TIMES = 3
INQUIRY_NS = 10 * NS_PER_S


@dataclass(slots=True)
class Course:
    """A running course: amplitudes as a function of ns since `start_ns`, until `until_ns`."""

    start_ns: int
    until_ns: int
    amplitudes_at: Callable[[int], tuple[float, ...]]
    rates_hz: tuple[float, ...] | None
    changes: bool


def share_01(pattern: VibrationPattern, since_s: float) -> float:
    """Return a pattern's rate at a time as a share of its highest; 0 where `square` is off."""
    low_01 = pattern.low_hz / pattern.high_hz
    if pattern.name == "steady":
        return 1.0
    if pattern.name == "square":
        return 1.0 if (since_s * pattern.modulation_hz) % 1.0 < 0.5 else 0.0
    if pattern.name == "ramp":
        return low_01 + (1 - low_01) * min(1.0, since_s * 1000 / pattern.duration_ms)
    swing = math.sin(2 * math.pi * pattern.modulation_hz * since_s)
    return (1 + low_01) / 2 + (1 - low_01) / 2 * swing


class BandTraffic:
    """Send to one band, from any thread; `take_rows` returns the commands sent or given up.

    Nothing here raises because the band is away, except `write` and `keep_up`; `is_up` false
    keeps commands from the link. `expired_ns` collects ends of times to live.
    """

    def __init__(
        self, link: ByteLink, language: BandLanguage, clock: Clock, max_rate_hz: float
    ) -> None:
        self.lock = threading.RLock()  # a signal handler may silence in the middle of a command
        self._link = link
        self._language = language
        self._clock = clock
        self._spacing_ns = round(NS_PER_S / max_rate_hz)
        self._running: Course | None = None
        self._waiting: tuple[Command, Course] | None = None
        self.failure: DeviceError | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything, with a band that is silent and there."""
        now_ns = self._clock.now_ns()
        self._finished: list[Command] = []
        self._number = 0
        self._running = self._waiting = None
        self._silences_left = 0
        self._set_ns = now_ns - NS_PER_S
        self._spoke_ns = self._latest_ns = self._alive_ns = now_ns
        self._next_inquiry_ns = now_ns
        self.failure = None
        self.is_up = True
        self.loop_stalled = False
        self.expired_ns: list[int] = []

    def lose(self) -> None:
        """Give up the waiting and the running command: the band is gone."""
        with self.lock:
            self._drop_waiting(self._clock.now_ns())
            self._running = None
            self._silences_left = 0
            self.is_up = False

    def regain(self) -> None:
        """Go on with a band that is back and silent."""
        with self.lock:
            self.failure = None
            self.is_up = True
            self._alive_ns = self._clock.now_ns()

    def take_rows(self) -> list[Command]:
        """Return the commands finished since the last call."""
        with self.lock:
            rows, self._finished = self._finished, []
        return rows

    # ---- commands ---------------------------------------------------------------------------

    def set(
        self,
        amplitudes_01: Sequence[float],
        ttl_ms: int,
        rates_hz: Sequence[float] | None,
    ) -> int:
        """Drive every motor; return the command's number."""
        rates = None if rates_hz is None else tuple(rates_hz)
        now_ns, amplitudes = self._clock.now_ns(), tuple(amplitudes_01)
        command = self._new(SET, now_ns, amplitudes, rates, duration_ms=float(ttl_ms))
        until_ns = now_ns + ttl_ms * NS_PER_MS
        return self._begin(
            command, Course(now_ns, until_ns, lambda _: amplitudes, rates, changes=False)
        )

    def play(self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float) -> int:
        """Play a pattern step by step; return the command's number."""
        now_ns = self._clock.now_ns()
        peaks_01 = tuple(
            amplitude_01 if m in motors else 0.0 for m in range(self._language.motor_count)
        )

        def amplitudes_at(since_ns: int) -> tuple[float, ...]:
            share = share_01(pattern, since_ns / NS_PER_S)
            return tuple(share * amplitude for amplitude in peaks_01)

        until_ns = now_ns + pattern.duration_ms * NS_PER_MS
        command = self._new(PATTERN, now_ns, peaks_01, None, duration_ms=float(pattern.duration_ms))
        command.pattern = PATTERN_NAMES.index(pattern.name)
        command.low_hz, command.modulation_hz = pattern.low_hz, pattern.modulation_hz
        changes = pattern.name != "steady"
        return self._begin(command, Course(now_ns, until_ns, amplitudes_at, None, changes))

    def keep_alive(self) -> None:
        """Note that the experiment loop is alive."""
        self._alive_ns = self._clock.now_ns()
        self.loop_stalled = False

    def silence(self) -> int:
        """Stop every motor now; return the command's number."""
        with self.lock:
            now_ns = self._clock.now_ns()
            self._drop_waiting(now_ns)
            self._running = None
            self._silences_left = SILENCE_TIMES - 1
            zeros = (0.0,) * self._language.motor_count
            command = self._new(SILENCE, now_ns, zeros, None, duration_ms=math.nan)
            self._send(command, self._language.silence())
        return command.number

    # ---- sending ----------------------------------------------------------------------------

    def _new(
        self,
        kind: int,
        t_ns: int,
        amplitudes_01: tuple[float, ...],
        rates_hz: tuple[float, ...] | None,
        *,
        duration_ms: float,
    ) -> Command:
        with self.lock:
            number = self._number
            self._number += 1
        return Command(number, kind, 0, b"", t_ns, amplitudes_01, rates_hz, duration_ms, NO_PATTERN)

    def _begin(self, command: Command, course: Course) -> int:
        with self.lock:
            now_ns = self._clock.now_ns()
            self._alive_ns = now_ns
            self.loop_stalled = False
            self._drop_waiting(now_ns)
            self._waiting = (command, course)
            self._send_waiting(now_ns)
        return command.number

    def _send_waiting(self, now_ns: int) -> None:
        if self._waiting is None or now_ns - self._set_ns < self._spacing_ns:
            return
        command, course = self._waiting
        self._waiting = None
        if now_ns >= course.until_ns:
            self._finish(command, now_ns)
            return
        self._silences_left = 0
        self._running = course
        if command.kind == PATTERN:
            course.until_ns += now_ns - course.start_ns
            course.start_ns = now_ns
        self._set_ns = now_ns
        self._send(command, self._messages(course, now_ns))

    def _messages(self, course: Course, now_ns: int) -> Sequence[bytes]:
        amplitudes = course.amplitudes_at(now_ns - course.start_ns)
        if not any(amplitudes):
            return self._language.silence()
        ttl_ms = max(1, math.ceil((course.until_ns - now_ns) / NS_PER_MS))
        return self._language.drive(amplitudes, ttl_ms, course.rates_hz)

    def _drop_waiting(self, now_ns: int) -> None:
        if self._waiting is not None:
            self._finish(self._waiting[0], now_ns)
            self._waiting = None

    def _send(self, command: Command, messages: Sequence[bytes]) -> None:
        """Write a command; what cannot be written is given up, and `poll` finds the band gone."""
        with self.lock:
            now_ns = self._clock.now_ns()
            if self.is_up and self.failure is None:
                try:
                    command.t_sent_ns = self.write(messages)
                except DeviceError as problem:
                    self.failure = problem
                else:
                    self._spoke_ns = now_ns = command.t_sent_ns
            self._finish(command, now_ns)

    def write(self, messages: Sequence[bytes]) -> int:
        """Write messages as they are; return when the last was taken. Raises DeviceError."""
        with self.lock:
            sent_ns = self._clock.now_ns()
            for message in messages:
                sent_ns = self._link.write(message)
            return sent_ns

    def _finish(self, command: Command, t_host_ns: int) -> None:
        with self.lock:
            self._latest_ns = max(self._latest_ns, t_host_ns)
            command.t_host_ns = self._latest_ns
            self._finished.append(command)

    def keep_up(self, now_ns: int) -> None:
        """Send what is due: silence at an end, a waiting setting, a step, a repetition."""
        with self.lock:
            self.end_if_due(now_ns, 0)
            self._send_waiting(now_ns)
            course = self._running
            if course is not None and self._is_refresh_due(course, now_ns):
                amplitudes = course.amplitudes_at(now_ns - course.start_ns)
                left_ms = float(math.ceil((course.until_ns - now_ns) / NS_PER_MS))
                command = self._new(
                    KEEP_ALIVE, now_ns, amplitudes, course.rates_hz, duration_ms=left_ms
                )
                self._set_ns = now_ns
                self._send(command, self._messages(course, now_ns))
            if self._silences_left and now_ns - self._spoke_ns >= SILENCE_AGAIN_NS:
                self._silences_left -= 1
                self._spoke_ns = self.write(self._language.silence())
            if now_ns >= self._next_inquiry_ns:
                self._next_inquiry_ns = now_ns + INQUIRY_NS
                self.write(self._language.inquiry())
            if self.failure is not None:
                raise DeviceDisconnected(str(self.failure))

    def _is_refresh_due(self, course: Course, now_ns: int) -> bool:
        waited_ns = now_ns - self._spoke_ns
        if waited_ns < self._spacing_ns:
            return False
        if course.changes:
            return True
        left_ms = math.ceil((course.until_ns - self._spoke_ns) / NS_PER_MS)
        lasts_ms = self._language.lasts_ms(left_ms)
        if lasts_ms is None:
            return waited_ns >= REFRESH_NS
        return lasts_ms < left_ms and waited_ns >= lasts_ms * NS_PER_MS // 2

    def end_if_due(self, now_ns: int, grace_ns: int) -> None:
        """Silence a course that has ended, or that runs although the loop stands still."""
        with self.lock:
            course = self._running
            if course is None:
                return
            if now_ns - self._alive_ns > STALL_NS + grace_ns:
                self.loop_stalled = True
                self.silence()
            elif now_ns >= course.until_ns + grace_ns:
                waiting, self._waiting = self._waiting, None
                self.silence()
                self._waiting = waiting
                self.expired_ns.append(now_ns)

    def patience_s(self, timeout_s: float) -> float:
        """Return how long `read` may wait so that what is due is not late."""
        if timeout_s <= 0 or (self._running is None and self._waiting is None):
            return timeout_s
        now_ns = self._clock.now_ns()
        due_ns = [now_ns + round(timeout_s * NS_PER_S)]
        if self._waiting is not None:
            due_ns.append(self._set_ns + self._spacing_ns)
        if self._running is not None:
            due_ns.append(self._running.until_ns)
            if self._running.changes:
                due_ns.append(self._spoke_ns + self._spacing_ns)
        return max(0.0, (min(due_ns) - now_ns) / NS_PER_S)
