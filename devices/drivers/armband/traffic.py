"""Talk with an armband over a byte link: number commands, match answers, refresh, retry, give up.

The states of a device are the business of `visavis.devices.drivers.armband.driver`. Commands may
come from any thread, even from a signal handler in the middle of another command.
"""

import math
import threading
from collections.abc import Callable

from visavis.devices.byte_links import ByteLink, ForeseeingPeer
from visavis.devices.contracts import BAND_EVENTS, PATTERN_NAMES, ClockPair, VibrationPattern
from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.codec import Answer
from visavis.devices.drivers.armband.dialect import Drive, FramedDialect
from visavis.devices.drivers.armband.ledger import (
    KEEP_ALIVE,
    PATTERN,
    SET,
    SILENCE,
    BandRow,
    Command,
    DeviceMicros,
    PendingRequest,
)
from visavis.devices.drivers.armband.status import BandStatus
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout

REFRESH_NS = 50 * NS_PER_MS
IDLE_REFRESH_NS = 200 * NS_PER_MS
"""While nothing runs; below the band's dead man, which ends a falsely accepted command sooner."""

STALL_NS = 150 * NS_PER_MS
TRY_NS = 50 * NS_PER_MS
STOP_TRIES = 3
GIVE_UP_NS = 250 * NS_PER_MS
LOST_NS = NS_PER_S
LOST_AFTER_WRITES = 3
PATTERN_TAIL_NS = 200 * NS_PER_MS
REPORT_NS = NS_PER_S
MAX_PAIRS = 1_000
BOOT = BAND_EVENTS.index("boot")


class Traffic:
    """Everything that goes to one band and comes from it, from one connection to the next.

    `running_seq` numbers the command that drives the motors (None: silent), `drive` is what a
    setting asked for; both hold until `runs_until_ns`. Before `due_ns` there is nothing to read
    or to send unless a command comes; 0 where that is unknown.
    """

    def __init__(
        self,
        link: ByteLink,
        dialect: FramedDialect,
        clock: Clock,
        band: BandStatus,
        *,
        spacing_ns: int,
    ) -> None:
        self._link = link
        self._dialect = dialect
        self._clock = clock
        self._spacing_ns = spacing_ns
        self._foresees = link if isinstance(link, ForeseeingPeer) else None
        self._wire = threading.RLock()
        self._seq = 0
        self._micros = DeviceMicros()
        self.band = band
        self.pairs: list[ClockPair] = []
        self.welcome: codec.Welcome | None = None
        self.restart()

    def restart(self) -> None:
        """Begin new rows; the connection and its sequence numbers go on."""
        now_ns = self._clock.now_ns()
        self._under_way: dict[int, Command] = {}
        self._finished: list[Command] = []
        self._band_rows: list[BandRow] = []
        self._waiting: tuple[Command, Drive, int] | None = None
        self._drive: Drive | None = None
        self._running_seq: int | None = None
        self._runs_until_ns = 0
        self.due_ns = 0
        self._number = 0
        self._latest_ns = -(2**63)
        self._alive_ns = now_ns
        self._spoke_ns = self._set_ns = now_ns - NS_PER_S
        self._next_report_ns = now_ns
        self._failure: DeviceError | None = None
        self._pending_request: PendingRequest | None = None
        self._reset_silence()
        self.is_away = False

    def reset_connection(self) -> None:
        """Start again with a band that has lost its state; the rows go on."""
        with self._wire:
            self._dialect.reset()
            self._micros = DeviceMicros()
            self._under_way.clear()
            self._failure = None
            self._seq = 0
            self.welcome = None
            self._reset_silence()

    # ---- commands ---------------------------------------------------------------------------

    def set(self, drive: Drive, ttl_ms: int) -> int:
        """Send a setting, or let it wait its turn; a newer one takes the place of one waiting."""
        now_ns = self._clock.now_ns()
        self.due_ns = 0
        with self._wire:
            self._alive_ns = now_ns
            command = self._new(SET, now_ns, drive)
            command.duration_ms = float(ttl_ms)
            self._drop_waiting(now_ns)
            self._waiting = (command, drive, now_ns + ttl_ms * NS_PER_MS)
            self._send_waiting(now_ns)
        return command.number

    def play(self, pattern: VibrationPattern, drive: Drive, motors: tuple[int, ...]) -> int:
        """Send a pattern once; `drive` is what its row records."""
        now_ns = self._clock.now_ns()
        with self._wire:
            self._alive_ns = now_ns
            self._drop_waiting(now_ns)
            command = self._new(PATTERN, now_ns, drive)
            command.duration_ms = float(pattern.duration_ms)
            command.pattern = PATTERN_NAMES.index(pattern.name)
            command.low_hz = pattern.low_hz
            command.modulation_hz = pattern.modulation_hz
            amplitude_01 = max(drive.amplitudes_01)
            command.data = self._dialect.pattern(command.seq, pattern, motors, amplitude_01)
            self._drive = None
            self._running_seq = command.seq
            self._runs_until_ns = now_ns + pattern.duration_ms * NS_PER_MS + PATTERN_TAIL_NS
            self._send(command)
        return command.number

    def silence(self) -> int:
        """Send STOP; it is sent again until it is answered, three times in all."""
        now_ns = self._clock.now_ns()
        with self._wire:
            self._drop_waiting(now_ns)
            self._drive = self._running_seq = None
            command = self._new(SILENCE, now_ns, self._silent())
            command.data = self._dialect.stop(command.seq)
            self._send(command)
        return command.number

    def keep_alive(self) -> None:
        """Note that the experiment loop is alive."""
        self._alive_ns = self._clock.now_ns()
        self.band.loop_stalled = False

    # ---- what is due ------------------------------------------------------------------------

    def keep_up(self) -> None:
        """Send what is due: a waiting setting, silence for a stalled loop, refresh, retries.

        Raises DeviceDisconnected when the band is gone or has restarted.
        """
        now_ns = self._clock.now_ns()
        with self._wire:
            if self._failure is not None:
                raise DeviceDisconnected(str(self._failure))
            if self._running_seq is not None and now_ns - self._alive_ns > STALL_NS:
                self.band.loop_stalled = True
                self.silence()
            self._send_waiting(now_ns)
            every_ns = IDLE_REFRESH_NS if self._running_seq is None else REFRESH_NS
            if now_ns >= _following(self._spoke_ns, every_ns):
                self._refresh(now_ns)
            for command in list(self._under_way.values()):
                waited_ns = now_ns - command.t_sent_ns
                if command.kind == SILENCE and command.tries < STOP_TRIES and waited_ns >= TRY_NS:
                    self._send(command)
                elif waited_ns >= GIVE_UP_NS:
                    del self._under_way[command.seq]
                    self.band.unanswered_count += 1
                    self._finish(command, now_ns)
            quiet_ns = now_ns - self._unheard_since_ns
            if self._unheard_writes >= LOST_AFTER_WRITES and quiet_ns > LOST_NS:
                raise DeviceDisconnected(f"no answer for {quiet_ns / NS_PER_S:.1f} s")
            self.due_ns = self._foreseen_ns(now_ns)

    def _foreseen_ns(self, now_ns: int) -> int:
        if self._foresees is None or self._under_way or self._waiting or self._unheard_writes:
            return 0
        if self._running_seq is not None:
            return 0
        return min(
            _following(self._spoke_ns, IDLE_REFRESH_NS), self._foresees.quiet_until_ns(now_ns)
        )

    def lose(self) -> None:
        """Give up everything under way: the band is gone."""
        now_ns = self._clock.now_ns()
        self.due_ns = 0
        with self._wire:
            self.is_away = True
            self._drop_waiting(now_ns)
            for command in self._under_way.values():
                self._finish(command, now_ns)
            self._under_way.clear()
            self._drive = self._running_seq = None

    def return_from_away(self) -> None:
        """Take commands again."""
        self._failure = None
        self._alive_ns = self._clock.now_ns()
        self._reset_silence()
        self.is_away = False

    def collect(self) -> tuple[list[Command], list[BandRow]]:
        """Return the finished commands and the band's reports, once, in order of arrival."""
        with self._wire:
            commands, self._finished = self._finished, []
            band_rows, self._band_rows = self._band_rows, []
        return commands, band_rows

    def read(self, timeout_s: float) -> None:
        """Take what came; see `ByteLink.read`."""
        for chunk in self._link.read(timeout_s):
            for answer in self._dialect.feed(chunk.data):
                with self._wire:
                    self._take(answer, chunk.t_host_ns)

    # ---- commands without rows --------------------------------------------------------------

    def greet(self) -> None:
        """Send HELLO; the answer turns up as `welcome`."""
        self._link.write(self._dialect.greeting(self._next_seq()))

    def confirm(self, encode: Callable[[int], bytes], deadline_ns: int) -> None:
        """Send one command again and again until it is answered; raises DeviceTimeout."""
        with self._wire:
            request = self._pending_request = PendingRequest(self._next_seq())
        data = encode(request.seq)

        def send() -> None:
            request.tries += 1
            request.t_write_ns = self._clock.now_ns()
            self._link.write(data)

        self.wait(send, lambda: request.is_answered, TRY_NS, deadline_ns)

    def wait(
        self,
        send: Callable[[], None],
        is_done: Callable[[], bool],
        every_ns: int,
        deadline_ns: int,
    ) -> None:
        """Send every so often until it is done; raises DeviceTimeout at the deadline."""
        again_ns = self._clock.now_ns()
        while not is_done():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout("the band does not answer")
            if now_ns >= again_ns:
                send()
                again_ns = now_ns + every_ns
            self.read(max(0, min(again_ns, deadline_ns) - now_ns) / NS_PER_S)

    # ---- sending ----------------------------------------------------------------------------

    def _new(self, kind: int, now_ns: int, drive: Drive) -> Command:
        number = self._number
        self._number += 1
        return Command(
            number, kind, self._next_seq(), b"", now_ns, drive.amplitudes_01, drive.rates_hz
        )

    def _silent(self) -> Drive:
        return Drive((0.0,) * self._dialect.motor_count)

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % 256
        return self._seq

    def _send(self, command: Command) -> None:
        """Write a command; what cannot be written is given up, and `keep_up` raises."""
        self.due_ns = 0
        command.tries += 1
        command.t_write_ns = self._clock.now_ns()
        if self.is_away:
            self._finish(command, command.t_write_ns)
            return
        previous = self._under_way.pop(command.seq, None)
        if previous is not None and previous is not command:
            self._finish(previous, command.t_write_ns)
        try:
            command.t_sent_ns = self._link.write(command.data)
        except (DeviceDisconnected, DeviceTimeout) as problem:
            self._failure = problem
            self._finish(command, self._clock.now_ns())
            return
        self._spoke_ns = command.t_sent_ns
        if not self._unheard_writes:
            self._unheard_since_ns = command.t_sent_ns
        self._unheard_writes += 1
        self._under_way[command.seq] = command

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
        command.data = self._dialect.set(command.seq, drive, ttl_ms)
        self._drive = None if drive.is_silent else drive
        self._running_seq = None if drive.is_silent else command.seq
        self._runs_until_ns = expires_ns
        self._send(command)

    def _drop_waiting(self, now_ns: int) -> None:
        if self._waiting is not None:
            self._finish(self._waiting[0], now_ns)
            self._waiting = None

    def _refresh(self, now_ns: int) -> None:
        """Repeat the current setting with the rest of its time, or send a PING."""
        if self._running_seq is not None and now_ns >= self._runs_until_ns:
            self._drive = self._running_seq = None
        drive = self._drive
        command = self._new(KEEP_ALIVE, now_ns, self._silent() if drive is None else drive)
        if drive is not None:
            ttl_ms = math.ceil((self._runs_until_ns - now_ns) / NS_PER_MS)
            command.duration_ms = float(ttl_ms)
            command.data = self._dialect.set(command.seq, drive, ttl_ms)
            self._running_seq = command.seq
        else:
            if self._running_seq is not None:  # a pattern: the band knows how far it is
                command.amplitudes_01 = (math.nan,) * self._dialect.motor_count
            command.data = self._dialect.ping(command.seq, self._running_seq)
        self._send(command)

    def _finish(self, command: Command, t_host_ns: int) -> None:
        self._latest_ns = max(self._latest_ns, t_host_ns)
        command.t_host_ns = self._latest_ns
        self._finished.append(command)

    # ---- receiving --------------------------------------------------------------------------

    def _reset_silence(self) -> None:
        self._unheard_writes = 0
        self._unheard_since_ns = self._clock.now_ns()

    def _take(self, answer: Answer, t_host_ns: int) -> None:
        self._reset_silence()
        if isinstance(answer, codec.Welcome):
            self.welcome = answer
            self.band.tells_skin = bool(answer.capabilities & codec.SKIN_IS_TOLD)
            return
        device_ns = self._micros.unwrap_ns(answer.device_us)
        if isinstance(answer, codec.BandEvent):
            self.band.take_event(answer)
            if answer.code < len(BAND_EVENTS):
                self._tell(answer.code, t_host_ns, device_ns)
            if answer.code == BOOT:
                self._failure = DeviceDisconnected("the band started anew")
            return
        self.band.take_report(answer)
        if t_host_ns >= self._next_report_ns:
            self._next_report_ns = t_host_ns + REPORT_NS
            self._tell(0, t_host_ns, device_ns)
        request = self._pending_request
        if request is not None and answer.seq == request.seq:
            request.is_answered = True
            self._pending_request = None
            if request.tries == 1:
                self._add_pair(request.t_write_ns, device_ns, t_host_ns)
            return
        command = self._under_way.pop(answer.seq, None)
        if command is None:
            return
        if command.tries == 1:  # after a second try it is unknown which one was answered
            self._add_pair(command.t_write_ns, device_ns, t_host_ns)
        command.is_acknowledged = answer.status == codec.OK
        if not command.is_acknowledged:
            self.band.count_refusal(answer.status)
        if answer.status == codec.NOT_ARMED:
            self._failure = DeviceDisconnected("the band is no longer armed")
        command.t_device_ns = device_ns
        self._finish(command, t_host_ns)

    def _tell(self, event: int, t_host_ns: int, device_ns: int) -> None:
        battery = math.nan if self.band.battery_01 is None else self.band.battery_01
        reported_c = math.nan if self.band.temperature_c is None else self.band.temperature_c
        heat_c = (math.nan, reported_c) if self.band.tells_skin else (reported_c, math.nan)
        self._band_rows.append(BandRow(t_host_ns, device_ns, event, battery, *heat_c))

    def _add_pair(self, send_ns: int, device_ns: int, receive_ns: int) -> None:
        if send_ns <= receive_ns:  # an answer cannot come before its question
            self.pairs.append(ClockPair(send_ns, device_ns, receive_ns))
        if len(self.pairs) > MAX_PAIRS:
            del self.pairs[: MAX_PAIRS // 2]


def _following(t_ns: int, every_ns: int) -> int:
    """Return the first multiple of a period after `t_ns`.

    Refreshes keep to multiples on the session clock. The traffic that a trial's commands meet
    then depends on the trial, not on when the last command before it was sent.
    """
    return (t_ns // every_ns + 1) * every_ns
