"""Drive a Pupil Labs Core eye tracker through Pupil Capture's network API.

Codec: `visavis.devices.drivers.pupil.codec`. Transport: any
`visavis.devices.transports.MessageTransport`. Capture's clock is never set: offsets come from
repeated `t` requests, all of them kept. Its stream has no sample counter, so `seq` counts the
samples that arrived, and loss shows only in the stamps.
"""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from visavis.devices.contracts import (
    GAZE,
    CalibrationOutcome,
    ClockPair,
    DeviceState,
    Fault,
    SessionName,
)
from visavis.devices.drivers.pupil import codec
from visavis.devices.drivers.pupil.calibration import HmdCalibration
from visavis.devices.drivers.pupil.layout import GazeDecoder
from visavis.devices.drivers.pupil.spec import PUPIL_CORE
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError, ProtocolViolation
from visavis.lab.geometry import Vector
from visavis.lab.schema import SampleBatch

TOPICS = (codec.GAZE_TOPIC, codec.NOTIFY_TOPIC)
COMMAND_TIMEOUT_S = 1.0
MIN_RUN = 4
"""With at least so many messages it is faster to decode gaze together."""

STOP_TEXTS = {
    "eye_process.stopped": "the eye camera's process stopped",
    "world_process.stopped": "Pupil Capture's main process stopped",
    "service_process.stopped": "Pupil Service stopped",
    "launcher_process.should_stop": "Pupil Capture is closing",
    "stop_plugin": "a plug-in of Pupil Capture stopped",
}
STARTED_AGAIN = {"eye_process.started": "eye_process.stopped"}
EYE_NAMES = {0: "right", 1: "left"}

OLDEST_VERSION = (2, 0)
"""The first version whose headset calibration takes 3-D references (HMD3DChoreographyPlugin)."""

ROW_BYTES = GAZE.dtype.itemsize
_GAZE_FIELDS: Mapping[str, Any] = GAZE.dtype.fields or {}
_LEFT_VALID_AT, _RIGHT_VALID_AT = (_GAZE_FIELDS[f"{eye}_valid"][1] for eye in ("left", "right"))


def check_version(text: str, *, role: str) -> None:
    """Raise ProtocolViolation unless this version of Capture can be driven."""
    version = codec.decode_version(text)
    if version is None or version < OLDEST_VERSION:
        oldest = ".".join(str(part) for part in OLDEST_VERSION)
        raise ProtocolViolation(
            f"Pupil Capture says it is version {text!r}; this driver needs {oldest} or newer",
            role=role,
            remedy="install a current Pupil Capture",
        )


def read_port(text: str, name: str, *, role: str, remedy: str) -> int:
    """Return the port that Capture answered when asked for `name`; raises ProtocolViolation."""
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 2**16:
        raise ProtocolViolation(
            f"answered {text[:40]!r} when asked for {name}", role=role, remedy=remedy
        )
    return int(text)


def eyes_seen(rows: bytes) -> tuple[int, int]:
    """Return the numbers of rows of `GAZE` with a valid left and a valid right eye."""
    return sum(rows[_LEFT_VALID_AT::ROW_BYTES]), sum(rows[_RIGHT_VALID_AT::ROW_BYTES])


@dataclass
class StoppedParts:
    """Parts that stopped since start and have not started again, by part and eye."""

    stop_texts: dict[str, str] = field(default_factory=dict)

    def note(self, subject: str, eye_id: object = None) -> None:
        """Remember a notification about a part that stopped, or started again."""
        eye = EYE_NAMES.get(eye_id, "") if isinstance(eye_id, int) else ""
        if subject in STOP_TEXTS:
            self.stop_texts[f"{subject} {eye}"] = (
                f"{STOP_TEXTS[subject]}{f' ({eye})' if eye else ''}"
            )
        elif subject in STARTED_AGAIN:
            self.stop_texts.pop(f"{STARTED_AGAIN[subject]} {eye}", None)


class PupilCore(GazeDevice):
    """Follow the `EyeTracker` contract over Pupil Capture.

    `rate_hz` is what the eye cameras are set to; `eye_distance_mm` and `reference_distance_m`
    are used by the headset calibration. A time exchange is made every `exchange_interval_s` while
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
        self._decoder = GazeDecoder(confidence_threshold_01)
        self._opening_exchanges = opening_exchanges
        self._procedure = HmdCalibration(self._notify, eye_distance_mm, reference_distance_m)
        self._is_calibrated = False
        self._is_recording = False
        self._publish_port = 0
        super().__init__(
            role,
            transport,
            clock,
            PUPIL_CORE,
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
            exchange_interval_s=exchange_interval_s,
        )

    def begin_calibration(self) -> None:
        """Start the 3-D headset calibration; targets follow by `add_reference`."""
        self._life.require("begin_calibration", DeviceState.STREAMING)
        self._procedure.begin()

    def add_reference(self, direction_head: Vector, t_host_ns: int) -> None:
        """Keep a target; it is placed at `reference_distance_m` and sent at the end."""
        self._life.require("add_reference", DeviceState.STREAMING)
        self._procedure.add(direction_head, self._to_device_ns(t_host_ns))

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Send the targets and wait for Capture's verdict; samples go on meanwhile.

        Raises DeviceTimeout when no verdict comes.
        """
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self.finish_calibration()
        remedy = "look at Pupil Capture's log, then calibrate again"
        has_come = lambda: self._procedure.outcome is not None  # noqa: E731 - the one question
        self._wait_until(has_come, deadline_ns, "calibration result", remedy)
        outcome = self._procedure.outcome
        assert outcome is not None  # noqa: S101 - awaited above
        return outcome

    def finish_calibration(self) -> None:
        """Send the targets; Capture's verdict comes by `poll`."""
        self._life.require("finish_calibration", DeviceState.STREAMING)
        self._procedure.finish()

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return Capture's verdict; None until it came."""
        return self._procedure.outcome

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Publish an annotation stamped on Capture's clock."""
        self._life.require("annotate", DeviceState.OPEN, DeviceState.STREAMING)
        frames = codec.encode_annotation(text, self._to_device_ns(t_host_ns))
        self._mark(lambda: self._transport.send(self._publish_port, frames))

    def begin_recording(self, name: SessionName, folder: Path) -> None:
        """Let Capture record, with the plug-in without which it ignores annotations.

        The recording stays on Capture's computer, under the session's name.
        """
        self._life.require("begin_recording", DeviceState.OPEN)
        self._notify("start_plugin", name="Annotation_Capture", args={})
        deadline_ns = self._clock.now_ns() + round(COMMAND_TIMEOUT_S * NS_PER_S)
        part = f"{name.study}_{name.participant}_{name.session:03d}_{name.part:02d}"
        answer = self._answer(f"R {part}".encode(), deadline_ns)
        if not answer.startswith("OK"):
            raise ProtocolViolation(
                f"does not record: {answer[:80]!r}", role=self.info.role, remedy=PUPIL_CORE.remedy
            )
        self._is_recording = True

    def close(self) -> None:
        """End Capture's recording, and close the wire; idempotent."""
        if self._is_recording:
            self._is_recording = False
            self._wire.release()
            with contextlib.suppress(DeviceError):  # it is away: the recording must be ended there
                self._answer(b"r", self._clock.now_ns() + round(COMMAND_TIMEOUT_S * NS_PER_S))
        super().close()

    # ---- connection -------------------------------------------------------------------------

    def _prepare(self) -> None:
        super()._prepare()
        self._is_calibrated = False

    def _subscribe(self) -> None:
        """Do nothing: the port is asked for first."""

    def _connect(self, deadline_ns: int) -> None:
        """Ask for version and ports, and take the first time exchanges."""
        version = self._answer(b"v", deadline_ns)
        check_version(version, role=self.info.role)
        self.info = replace(self.info, model=f"Core (Capture {version})")
        subscribe_port = self._port("SUB_PORT", deadline_ns)
        self._publish_port = self._port("PUB_PORT", deadline_ns)
        # A publisher drops messages until ZeroMQ has connected it: let it drop this, not a mark.
        self._transport.send(self._publish_port, codec.encode_notification("visavis.connected"))
        for _ in range(max(1, self._opening_exchanges)):
            exchange = self._ask((b"t",), deadline_ns)
            device_ns = codec.decode_time(exchange.frames)
            if device_ns is None:
                answer = exchange.frames[0][:40]
                raise ProtocolViolation(f"answered {answer!r} when asked for its time")
            self._add_pair(ClockPair(exchange.t_send_ns, device_ns, exchange.t_receive_ns))
        self._transport.subscribe(subscribe_port, TOPICS)

    def _resume(self) -> None:
        self._transport.post((b"SUB_PORT",))

    def _answer(self, command: bytes, deadline_ns: int) -> str:
        return self._ask((command,), deadline_ns).frames[0].decode("utf-8", "replace")

    def _port(self, name: str, deadline_ns: int) -> int:
        answer = self._answer(name.encode(), deadline_ns)
        return read_port(answer, name, role=self.info.role, remedy=PUPIL_CORE.remedy)

    def _ask_time(self, now_ns: int) -> None:
        self._transport.post((b"t",))

    def _notify(self, subject: str, **fields: Any) -> None:
        frames = codec.encode_notification(subject, **fields)

        def send() -> None:
            answer = self._transport.request(frames, COMMAND_TIMEOUT_S).frames[0]
            if answer.startswith(b"Unknown"):
                raise ProtocolViolation(
                    f"refused {subject!r}: {answer[:80]!r}",
                    role=self.info.role,
                    remedy=PUPIL_CORE.remedy,
                )

        self._wire.do(send)

    # ---- receiving --------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._parts = StoppedParts()
        self._seq = 0
        if self._interval_ns is not None:
            self._next_exchange_ns = now_ns + self._interval_ns

    def _own_faults(self) -> Iterable[Fault]:
        for text in self._parts.stop_texts.values():
            yield self._blocking(text, "look at Pupil Capture and start it again")
        if not self._is_calibrated:
            yield self._uncalibrated("not calibrated since it was opened", "calibrate")

    def _decode(self, message: Message) -> Iterable[Sample]:
        """Take one message; `_take` decodes gaze in batches."""
        self._take((message,))
        return ()

    def _take(self, messages: Sequence[Message]) -> int:
        most = len(messages)
        rows = np.empty(most * ROW_BYTES, np.uint8)
        stamps = np.empty(most, np.int64)
        seqs: list[int] = []
        arrivals: list[int] = []
        decode = self._decoder.decode
        seq = self._seq
        n = 0
        if most >= MIN_RUN:
            run = list(takewhile(_is_gaze, messages))
            n = self._decoder.decode_run([m.frames[1] for m in run], rows, stamps)
            seqs += range(seq, seq + n)
            arrivals += [m.t_host_ns for m in run[:n]]
            seq += n
        for message in messages[n:]:
            frames = message.frames
            if message.t_sent_ns is not None:
                self._take_answer(message)
            elif len(frames) != 2:
                self._malformed += 1
            elif frames[0].startswith(codec.GAZE_TOPIC):
                if decode(frames[1], rows, stamps, n):
                    seqs.append(seq)
                    arrivals.append(message.t_host_ns)
                    n += 1
                else:
                    self._malformed += 1
                seq += 1
            else:
                self._take_notification(frames[1])
        self._seq = seq
        self._heard_ns = max(self._heard_ns, messages[-1].t_host_ns)
        if not n or self._sink is None:
            return 0
        data = rows[: n * ROW_BYTES].tobytes()
        self._recent.add(n, *eyes_seen(data))
        return self._deliver(seqs, stamps[:n], arrivals, np.frombuffer(data, GAZE.dtype))

    def gaze_ahead(self, until_ns: int) -> SampleBatch | None:
        """Return coming samples (`visavis.devices.contracts.GazeAhead`)."""
        messages = None if self._memory is None else self._memory.arriving(until_ns)
        if messages is None or not all(_is_gaze(message) for message in messages):
            return None
        n = len(messages)
        rows, stamps = np.empty(n * ROW_BYTES, np.uint8), np.empty(n, np.int64)
        if self._decoder.decode_run([m.frames[1] for m in messages], rows, stamps) < n:
            return None
        arrivals = np.array([m.t_host_ns for m in messages], np.int64)
        values = np.frombuffer(rows.tobytes(), GAZE.dtype)
        return SampleBatch(self._schema, np.zeros(n, np.int64), stamps, arrivals, values)

    def _take_answer(self, message: Message) -> None:
        answer = message.frames[0]
        if answer.isdigit() and len(answer) < 6:  # the port that `_resume` asked for
            self._transport.subscribe(int(answer), TOPICS)
            return
        device_ns = codec.decode_time(message.frames)
        if device_ns is None or message.t_sent_ns is None:
            self._malformed += 1
        else:
            self._add_pair(ClockPair(message.t_sent_ns, device_ns, message.t_host_ns))

    def _take_notification(self, payload: bytes) -> None:
        notification = codec.decode_notification(payload)
        if notification is None:
            self._malformed += 1
        elif self._procedure.take(notification):
            self._calibration = self._procedure.outcome
            self._is_calibrated |= self._procedure.has_succeeded
        else:
            self._parts.note(notification["subject"], notification.get("eye_id"))


def _is_gaze(message: Message) -> bool:
    frames = message.frames
    is_published = message.t_sent_ns is None and len(frames) == 2
    return is_published and frames[0].startswith(codec.GAZE_TOPIC)
