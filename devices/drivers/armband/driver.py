"""Drive our armband over any byte link: commands leave at once, `poll` reads the answers.

Every way out silences the motors. A refresh twenty times a second repeats the current setting, so
that a lost or falsely accepted frame has no lasting effect. Running motors are refreshed only while
the experiment loop reports that it is alive.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import (
    BAND,
    HAPTICS,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
    VibrationPattern,
)
from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.dialect import Drive, FramedDialect
from visavis.devices.drivers.armband.ledger import band_batch, command_batch
from visavis.devices.drivers.armband.spec import SERIAL_ARMBAND
from visavis.devices.drivers.armband.status import BandStatus
from visavis.devices.drivers.armband.traffic import GIVE_UP_NS, STOP_TRIES, TRY_NS, Traffic
from visavis.devices.drivers.bands.limits import Limits
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.plausible import VIBRATION_HZ
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.clock_fit import fit_clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout, ProtocolViolation
from visavis.lab.schema import StreamSchema

GREETING_NS = 250 * NS_PER_MS
START_NS = 2 * NS_PER_S
"""Limit for the start of a session, which can wait for a slow answer; later commands cannot."""
RECONNECT_S = 2.0
OPENING_PINGS = 8
RECENT_EXCHANGES = 200
UNKNOWN_RANGE_HZ = (math.nan, math.nan)

REMEDY = "check that the band is switched on, charged and plugged in or paired"


class ArmbandDriver(HasLife):
    """Follow the `Armband` contract; see the module.

    At most `max_rate_hz` settings leave per second: a sooner one waits, and a newer one takes
    its place. The band is armed between `start` and `stop` only.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        dialect: FramedDialect,
        clock: Clock,
        *,
        spec: AnySpec = SERIAL_ARMBAND,
        max_rate_hz: float = 150.0,
    ) -> None:
        self._role = role
        self._link = link
        self._dialect = dialect
        self._clock = clock
        self._life = Lifecycle(role)
        self._limits = Limits(role, dialect.motor_count, UNKNOWN_RANGE_HZ, plays_patterns=True)
        self.info = spec.info(role, link)
        self._traffic = Traffic(
            link, dialect, clock, BandStatus(role), spacing_ns=round(NS_PER_S / max_rate_hz)
        )
        self._sink: Sink | None = None
        self._attempt_ends_ns: int | None = None
        self._begin_account()

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self._dialect.motor_count

    @property
    def rate_range_hz(self) -> tuple[float, float]:
        """Lowest and highest rate, as the band said; NaN before it did."""
        return self._limits.rate_range_hz

    # ---- life -------------------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Connect, greet the band and exchange times with it."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        traffic = self._traffic
        traffic.pairs = []
        traffic.band = BandStatus(self._role)
        traffic.restart()
        try:
            self._link.open(deadline_s)
            traffic.reset_connection()
            traffic.wait(traffic.greet, self._is_welcome, GREETING_NS, deadline_ns)
            for _ in range(OPENING_PINGS):
                traffic.confirm(lambda seq: self._dialect.ping(seq, None), deadline_ns)
        except DeviceTimeout as silent:
            self._link.close()
            raise DeviceTimeout(str(silent), role=self._role, remedy=REMEDY) from silent
        except DeviceError:
            self._link.close()
            raise
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the commands' stream and the band's own."""
        return (HAPTICS, BAND)

    def start(self, sink: Sink) -> None:
        """Arm the band and begin to deliver rows."""
        self._life.require("start", DeviceState.OPEN)
        self._traffic.restart()
        self._begin_account()
        try:
            self._arm(armed=True, within_ns=START_NS)
        except DeviceTimeout as silent:
            raise DeviceTimeout(str(silent), role=self._role, remedy=REMEDY) from silent
        self._sink = sink
        self._life.state = DeviceState.STREAMING

    def due_ns(self) -> int:
        """Return when there is something to read or to send (`visavis.devices.pump.Foreseeing`)."""
        return self._traffic.due_ns if self._life.state is DeviceState.STREAMING else 0

    def poll(self, timeout_s: float) -> int:
        """Take answers, refresh the current setting, give up lost commands, deliver rows."""
        life = self._life
        if life.state is DeviceState.FAULT:
            return self._reconnect(timeout_s)
        if life.state is not DeviceState.STREAMING:
            life.require("poll", DeviceState.STREAMING)
        try:
            self._traffic.read(timeout_s)
            self._traffic.keep_up()
        except DeviceDisconnected as disconnection:
            life.state = DeviceState.FAULT
            self._traffic.lose()
            self._link.close()
            self._deliver()
            raise DeviceDisconnected(
                str(disconnection), role=self._role, remedy=REMEDY
            ) from disconnection
        return self._deliver()

    def stop(self) -> None:
        """Silence and disarm; the connection stays."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._quiet_down()
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Silence, disarm and release the link; idempotent."""
        if self._life.state is not DeviceState.CLOSED:
            self._quiet_down()
        self._sink = None
        self._link.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report rows delivered, clock fit of the recent exchanges and battery."""
        health = self._meter.health(self.state, self._clock.now_ns())
        health = replace(health, battery_01=self._traffic.band.battery_01)
        pairs = self._traffic.pairs[-RECENT_EXCHANGES:]
        if not pairs:
            return health
        fit = fit_clock(pairs)
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name what is wrong with band, link and loop."""
        return self._traffic.band.faults(self._dialect.unreadable_count)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return the time exchanges since open: every command that was answered is one."""
        return tuple(self._traffic.pairs)

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
        rates = None if rates_hz is None else tuple(rates_hz)
        return self._traffic.set(Drive(tuple(amplitudes_01), rates), ttl_ms)

    def play(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float = 1.0
    ) -> int:
        """Start a pattern; never sent twice, so that nobody feels it twice."""
        self._life.require("play", DeviceState.STREAMING, DeviceState.FAULT)
        self._limits.check_pattern(pattern, motors, amplitude_01)
        motor_mask = [motor in motors for motor in range(self.motor_count)]
        drive = Drive(
            tuple(amplitude_01 if on else 0.0 for on in motor_mask),
            tuple(pattern.high_hz if on else math.nan for on in motor_mask),
        )
        return self._traffic.play(pattern, drive, tuple(motors))

    def keep_alive(self) -> None:
        """Note that the experiment loop is alive."""
        self._traffic.keep_alive()

    def silence(self) -> int:
        """Stop every motor now, in any state; see the contract."""
        if self._life.state is DeviceState.CLOSED:
            return -1
        return self._traffic.silence()

    # ---- connection -------------------------------------------------------------------------

    def _begin_account(self) -> None:
        self._meter = StreamMeter(0.0)
        self._row_seq = self._band_seq = 0
        self._attempt_ends_ns = None

    def _is_welcome(self) -> bool:
        """Tell whether the band has answered HELLO; raises ProtocolViolation if it does not fit."""
        welcome = self._traffic.welcome
        if welcome is None:
            return False
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
        low_hz, high_hz = welcome.rate_range_hz
        if not (VIBRATION_HZ.admit(low_hz) and VIBRATION_HZ.admit(high_hz) and low_hz < high_hz):
            wrong_hz = high_hz if VIBRATION_HZ.admit(low_hz) else low_hz
            raise ProtocolViolation(
                f"{VIBRATION_HZ.sentence('a limit of its vibration', wrong_hz)}, the lower first "
                f"(told: {low_hz:g} to {high_hz:g} Hz)",
                role=self._role,
                remedy="flash the firmware that came with this version of Visavis",
            )
        major, minor = welcome.firmware
        self.info = replace(
            self.info,
            model=f"armband (firmware {major}.{minor})",
            serial=welcome.serial,
            transport=self._link.kind,
        )
        self._limits = replace(self._limits, rate_range_hz=welcome.rate_range_hz)
        return True

    def _arm(self, *, armed: bool, within_ns: int = 2 * GIVE_UP_NS) -> None:
        deadline_ns = self._clock.now_ns() + within_ns
        self._traffic.confirm(lambda seq: self._dialect.arming(seq, armed), deadline_ns)

    def _quiet_down(self) -> None:
        """Send STOP until it is answered, and disarm; a band that is away silences itself."""
        if self._traffic.is_away:
            return
        self._traffic.silence()
        try:
            self._traffic.confirm(self._dialect.stop, self._clock.now_ns() + STOP_TRIES * TRY_NS)
            self._arm(armed=False)
        except DeviceError:
            return  # stop and close go on: without a host the band's dead man acts

    def _reconnect(self, timeout_s: float) -> int:
        """Continue the attempt to reconnect; the loss has been reported already.

        Blocks at most `timeout_s`, except that a link may take `RECONNECT_S` to connect and a
        band which answers a few exchanges to be armed.
        """
        traffic = self._traffic
        try:
            if self._attempt_ends_ns is None:
                self._attempt_ends_ns = self._clock.now_ns() + GREETING_NS
                self._link.open(RECONNECT_S)
                self._attempt_ends_ns = self._clock.now_ns() + GREETING_NS
                traffic.reset_connection()
                traffic.greet()
            traffic.read(timeout_s)
            if self._is_welcome():
                self._arm(armed=True)
                traffic.return_from_away()
                self._attempt_ends_ns = None
                self._life.state = DeviceState.STREAMING
        except DeviceError:
            self._link.close()  # not there yet; the next attempt opens it again
        ends_ns = self._attempt_ends_ns
        if ends_ns is not None and self._clock.now_ns() >= ends_ns:
            self._link.close()
            self._attempt_ends_ns = None
        return self._deliver()

    def _deliver(self) -> int:
        rows, band_rows = self._traffic.collect()
        sink = self._sink
        if sink is None or not (rows or band_rows):
            return 0
        if rows:
            self._meter.update([row.t_device_ns for row in rows], rows[-1].t_host_ns)
            sink(command_batch(rows, self._row_seq))
            self._row_seq += len(rows)
        if band_rows:
            self._meter.update([row.t_device_ns for row in band_rows], band_rows[-1].t_host_ns)
            sink(band_batch(band_rows, self._band_seq))
            self._band_seq += len(band_rows)
        return len(rows) + len(band_rows)
