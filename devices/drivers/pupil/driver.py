"""Drive a Pupil Labs Core eye tracker through Pupil Capture's network API.

Codec: `devices.drivers.pupil.codec`. Transport: any `devices.transports.MessageTransport`.
Capture's clock is never set: offsets come from repeated `t` requests, all of them kept. Its
stream has no sample counter, so `seq` counts what arrived and loss shows in the stamps alone.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from devices.contracts import (
    GAZE,
    CalibrationOutcome,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.pupil import codec
from devices.drivers.pupil.answers import ROW_BYTES, check_version, eyes_seen, read_port
from devices.drivers.pupil.calibration import HmdCalibration
from devices.drivers.pupil.findings import Findings, SeenEyes, describe
from devices.drivers.pupil.layout import GazeDecoder
from devices.drivers.pupil.spec import PUPIL_CORE, REMEDY
from devices.drivers.streaming.exchange_log import ExchangeLog
from devices.drivers.streaming.wire_thread import WireThread
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.transports import Frames, Message, MessageTransport
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.clock_fit import fit_clock, offset_ns
from lab.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceNotFound,
    DeviceTimeout,
    ProtocolViolation,
)
from lab.geometry import Vector
from lab.schema import SampleBatch, StreamSchema

TOPICS = (codec.GAZE_TOPIC, codec.NOTIFY_TOPIC)
RECONNECT_WINDOW_NS = 250 * NS_PER_MS
POSTS_BEFORE_LOST = 3
COMMAND_TIMEOUT_S = 1.0
RECENT_BATCHES = 90


class PupilCore:
    """Follow the `EyeTracker` contract over Pupil Capture.

    `rate_hz` is what the eye cameras are set to; `eye_distance_mm` and `reference_distance_m`
    go into the headset calibration. A time exchange is made every `exchange_interval_s` while
    polling; the peer counts as lost when nothing came for `lost_after_s`.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        confidence_threshold_01: float = codec.CONFIDENCE_THRESHOLD_01,
        exchange_interval_s: float = 0.5,
        opening_exchanges: int = 20,
        lost_after_s: float = 2.0,
        eye_distance_mm: float = 64.0,
        reference_distance_m: float = 1.0,
    ) -> None:
        self._transport = transport
        self._clock = clock
        self._decode = GazeDecoder(confidence_threshold_01).decode
        self._interval_ns = round(exchange_interval_s * NS_PER_S)
        self._opening_exchanges = opening_exchanges
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._calibration = HmdCalibration(self._notify, eye_distance_mm, reference_distance_m)
        self._life = Lifecycle(role)
        self._schema = StreamSchema(GAZE.name, GAZE.fields, rate_hz, GAZE.version)
        self._sink: Sink | None = None
        self._publish_port = 0
        self._exchanges = ExchangeLog()
        self._offset_of: tuple[int, int] | None = None
        self._wire = WireThread(role, remedy=REMEDY, timeout_s=2 * COMMAND_TIMEOUT_S)
        self._attempt_ends_ns: int | None = None
        self.info = PUPIL_CORE.info(role, transport)
        self._reset(clock.now_ns())

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the peer is gone."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Ask for version and ports, and take the first time exchanges."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._exchanges.clear()
        self._offset_of = None
        self._findings = Findings()
        try:
            self._transport.open(deadline_s)
            version = self._ask(b"v", deadline_ns)
            check_version(version, role=self.info.role)
            self.info = replace(
                self.info, model=f"Core (Capture {version})", transport=self._transport.kind
            )
            subscribe_port = self._port("SUB_PORT", deadline_ns)
            self._publish_port = self._port("PUB_PORT", deadline_ns)
            for _ in range(max(1, self._opening_exchanges)):
                self._request_time(deadline_ns)
            self._transport.subscribe(subscribe_port, TOPICS)
        except DeviceError:
            self._transport.close()
            raise
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the gaze stream at the eye cameras' rate."""
        return (self._schema,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; what was published before is thrown away."""
        self._life.require("start", DeviceState.OPEN)
        self._transport.receive(0.0)
        self._sink = sink
        self._reset(self._clock.now_ns())
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Decode what came and keep the clock pairs coming; see the contract."""
        life = self._life
        if life.state is not DeviceState.STREAMING:
            life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
            return self._reconnect(timeout_s)
        self._wire.claim()
        messages = self._transport.receive(timeout_s)
        delivered = self._take(messages) if messages else 0
        now_ns = self._clock.now_ns()
        if now_ns >= self._next_exchange_ns:
            self._post_time(now_ns)
        return delivered

    def stop(self) -> None:
        """Stop delivering; the connection stays."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._wire.release()
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Close the connection; idempotent."""
        self._sink = None
        self._wire.release()
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report deliveries and the clock fit of the recent exchanges."""
        health = self._meter.health(self.state, self._clock.now_ns())
        pairs = self._exchanges.recent
        if not pairs:
            return health
        fit = fit_clock(pairs)
        return replace(
            health, clock_offset_ms=fit.offset_ns / NS_PER_MS, clock_drift_ppm=fit.drift_ppm
        )

    def check(self) -> tuple[Fault, ...]:
        """Name everything odd about stream, clock and tracker since start."""
        waited_ns = self._clock.now_ns() - self._answered_ns
        return describe(
            self.info.role,
            self._findings,
            self._meter,
            recent=self._recent,
            unanswered_s=waited_ns / NS_PER_S if self._posts_unanswered else 0.0,
        )

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return every time exchange since open; stamps before a clock jump included."""
        return tuple(self._exchanges.pairs)

    def begin_calibration(self) -> None:
        """Start the 3-D headset calibration; targets follow by `add_reference`."""
        self._life.require("begin_calibration", DeviceState.STREAMING)
        self._calibration.begin()

    def add_reference(self, direction_head: Vector, t_host_ns: int) -> None:
        """Keep a target; it is placed at `reference_distance_m` and sent at the end."""
        self._life.require("add_reference", DeviceState.STREAMING)
        self._calibration.add(direction_head, t_host_ns - self._offset_ns())

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Send the targets and wait for Capture's verdict; samples go on meanwhile.

        Raises DeviceTimeout when no verdict comes.
        """
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self.finish_calibration()
        while (outcome := self.calibration_verdict()) is None:
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout(
                    f"no calibration result within {deadline_s:g} s",
                    role=self.info.role,
                    remedy="look at Pupil Capture's log, then calibrate again",
                )
            if self._wire.is_elsewhere:
                self._clock.sleep_until_ns(now_ns + 5 * NS_PER_MS)
            else:
                self.poll(0.02)
        return outcome

    def finish_calibration(self) -> None:
        """Send the targets; Capture's verdict comes by `poll`."""
        self._life.require("finish_calibration", DeviceState.STREAMING)
        self._calibration.finish()

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return Capture's verdict; None until it came."""
        return self._calibration.outcome

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Publish an annotation stamped on Capture's clock."""
        self._life.require("annotate", DeviceState.OPEN, DeviceState.STREAMING)
        device_ns = t_host_ns - self._offset_ns()
        frames = codec.encode_annotation(text, device_ns)
        self._wire.do(lambda: self._transport.send(self._publish_port, frames))

    # ---- receiving ------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        self._meter = StreamMeter(self._schema.nominal_rate_hz)
        self._findings = Findings(calibrated=getattr(self, "_findings", Findings()).calibrated)
        self._recent = SeenEyes(RECENT_BATCHES)
        self._seq = 0
        self._heard_ns = now_ns
        self._answered_ns = now_ns
        self._posts_unheard = 0
        self._posts_unanswered = 0
        self._next_exchange_ns = now_ns + self._interval_ns
        self._attempt_ends_ns = None

    def _take(self, messages: Sequence[Message]) -> int:
        most = len(messages)
        rows = np.empty(most * ROW_BYTES, np.uint8)
        stamps = np.empty(most, np.int64)
        seqs: list[int] = []
        arrivals: list[int] = []
        decode = self._decode
        seq = self._seq
        n = 0
        for message in messages:
            frames = message.frames
            if message.t_sent_ns is not None:
                self._take_answer(message)
            elif len(frames) != 2:
                self._findings.malformed += 1
            elif frames[0].startswith(codec.GAZE_TOPIC):
                if decode(frames[1], rows, stamps, n):
                    seqs.append(seq)
                    arrivals.append(message.t_host_ns)
                    n += 1
                else:
                    self._findings.malformed += 1
                seq += 1
            else:
                self._take_notification(frames[1])
        self._seq = seq
        self._heard_ns = messages[-1].t_host_ns
        self._posts_unheard = 0
        sink = self._sink
        if not n or sink is None:
            return 0
        data = rows[: n * ROW_BYTES].tobytes()
        self._meter.update(stamps[:n].tolist(), arrivals[-1])
        self._recent.add(n, *eyes_seen(data))
        sink(
            SampleBatch(
                self._schema,
                np.array(seqs, np.int64),
                stamps[:n],
                np.array(arrivals, np.int64),
                np.frombuffer(data, GAZE.dtype),
            )
        )
        return n

    def _take_answer(self, message: Message) -> None:
        self._answered_ns = message.t_host_ns
        self._posts_unanswered = 0
        device_ns = codec.decode_time(message.frames)
        if device_ns is None or message.t_sent_ns is None:
            self._findings.malformed += 1
        elif b"." in message.frames[0]:  # otherwise a late answer to SUB_PORT
            self._add_pair(ClockPair(message.t_sent_ns, device_ns, message.t_host_ns))

    def _take_notification(self, payload: bytes) -> None:
        found = codec.decode_notification(payload)
        if found is None:
            self._findings.malformed += 1
            return
        if self._calibration.take(found):
            self._findings.calibrated |= self._calibration.has_succeeded
        else:
            self._findings.note(found["subject"], found.get("eye_id"))

    # ---- connection and clock --------------------------------------------------------------

    def _post_time(self, now_ns: int) -> None:
        if (
            self._posts_unheard >= POSTS_BEFORE_LOST
            and now_ns - self._heard_ns > self._lost_after_ns
        ):
            self._life.state = DeviceState.FAULT
            quiet_s = (now_ns - self._heard_ns) / NS_PER_S
            raise DeviceDisconnected(
                f"neither data nor answers for {quiet_s:.1f} s",
                role=self.info.role,
                remedy=REMEDY,
            )
        self._next_exchange_ns = now_ns + self._interval_ns
        self._posts_unheard += 1
        self._posts_unanswered += 1
        self._transport.post((b"t",))

    def _reconnect(self, timeout_s: float) -> int:
        """Ask for the port; back as soon as anything comes, DeviceDisconnected after a while."""
        now_ns = self._clock.now_ns()
        if self._attempt_ends_ns is None:
            self._attempt_ends_ns = now_ns + RECONNECT_WINDOW_NS
            self._transport.post((b"SUB_PORT",))
        messages = self._transport.receive(timeout_s)
        if messages:
            for message in messages:
                answer = message.frames[0]
                if message.t_sent_ns is not None and answer.isdigit():
                    self._transport.subscribe(int(answer), TOPICS)
            self._attempt_ends_ns = None
            self._next_exchange_ns = now_ns
            self._life.state = DeviceState.STREAMING
            return self._take(messages)
        if now_ns >= self._attempt_ends_ns:
            self._attempt_ends_ns = None
            raise DeviceDisconnected("still not there", role=self.info.role, remedy=REMEDY)
        return 0

    def _add_pair(self, pair: ClockPair) -> None:
        jump_ms = self._exchanges.add(pair)
        if jump_ms is not None:
            self._findings.clock_jumps_ms.append(jump_ms)

    def _offset_ns(self) -> int:
        """Return the host-minus-device offset, worked out once per time exchange."""
        known = self._offset_of
        if known is None or known[0] != len(self._exchanges):
            known = self._offset_of = (len(self._exchanges), offset_ns(self._exchanges.recent))
        return known[1]

    def _request_time(self, deadline_ns: int) -> None:
        exchange = self._transport.request((b"t",), self._left_s(deadline_ns))
        device_ns = codec.decode_time(exchange.frames)
        if device_ns is None:
            raise ProtocolViolation(
                f"answered {exchange.frames[0][:40]!r} when asked for its time",
                role=self.info.role,
                remedy=REMEDY,
            )
        self._add_pair(ClockPair(exchange.t_send_ns, device_ns, exchange.t_receive_ns))

    def _ask(self, command: bytes, deadline_ns: int) -> str:
        try:
            exchange = self._transport.request((command,), self._left_s(deadline_ns))
        except DeviceTimeout as cause:
            raise DeviceTimeout(
                "nobody answered in time", role=self.info.role, remedy=REMEDY
            ) from cause
        except DeviceNotFound as cause:
            raise DeviceNotFound(str(cause), role=self.info.role, remedy=REMEDY) from cause
        return exchange.frames[0].decode("utf-8", "replace")

    def _port(self, name: str, deadline_ns: int) -> int:
        answer = self._ask(name.encode(), deadline_ns)
        return read_port(answer, name, role=self.info.role, remedy=REMEDY)

    def _left_s(self, deadline_ns: int) -> float:
        return max(0.001, (deadline_ns - self._clock.now_ns()) / NS_PER_S)

    # ---- commands ---------------------------------------------------------------------------

    def _notify(self, subject: str, **fields: Any) -> None:
        frames: Frames = codec.encode_notification(subject, **fields)

        def send() -> None:
            answer = self._transport.request(frames, COMMAND_TIMEOUT_S).frames[0]
            if answer.startswith(b"Unknown"):
                raise ProtocolViolation(
                    f"refused {subject!r}: {answer[:80]!r}",
                    role=self.info.role,
                    remedy=REMEDY,
                )

        self._wire.do(send)
