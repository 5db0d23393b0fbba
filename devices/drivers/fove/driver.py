"""Drive a FOVE headset's eye tracker through the vendor's FoveClient library.

Codec: `visavis.devices.drivers.fove.codec`. Transport:
`visavis.devices.drivers.fove.library.FoveLibrary`, or its simulator in memory. The device's clock
has an unspecified epoch and cannot be asked: the offset comes from the least delayed arrivals.
Calibration is the runtime's own, drawn by it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from visavis.devices.contracts import CalibrationOutcome, DeviceState, Fault
from visavis.devices.drivers.fove import codec
from visavis.devices.drivers.fove.library import ANSWER, SERVICE_REMEDY
from visavis.devices.drivers.fove.spec import FOVE
from visavis.devices.drivers.streaming.gaze_device import CalibratesByItself
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.transports import Frames, Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError, DeviceNotFound, ProtocolViolation

STATE_EVERY_NS = NS_PER_S // 10
PROBE_EVERY_NS = NS_PER_S
STATE_QUESTIONS = (b"calibrated", b"hardware")


class Fove(CalibratesByItself):
    """Follow the `EyeTracker` contract over FoveClient; `seq` follows its frame numbers."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
        eye_distance_mm: float = 64.0,
    ) -> None:
        self._eye_distance_m = eye_distance_mm * 1e-3
        self._error_counts: dict[int, int] = {}
        self._calibration_state = 0
        self._calibrating = False
        self._state_asked_ns = 0
        super().__init__(role, transport, clock, FOVE, rate_hz=rate_hz, lost_after_s=lost_after_s)

    def begin_calibration(self) -> None:
        """Let the runtime show its own targets; `add_reference` is not needed."""
        self._life.require("begin_calibration", DeviceState.STREAMING)
        self._calibration = None
        self._calibration_state = 0

        def begin() -> None:
            self._must_be_ok(b"start_calibration", "start its calibration")
            self._calibrating = True

        self._wire.do(begin)

    def _connect(self, deadline_ns: int) -> None:
        versions = self._ask((b"versions",), deadline_ns).frames
        code, _ = ANSWER.unpack(versions[1])
        text = versions[2].decode("utf-8", "replace")
        if code in (4, 6):
            raise ProtocolViolation(
                f"{codec.error_text(code)}: {text}",
                role=self.info.role,
                remedy="install runtime and library of one version",
            )
        code, is_connected = ANSWER.unpack(self._ask((b"hardware",), deadline_ns).frames[1])
        if code != codec.OK or not is_connected:
            reason = codec.error_text(code if code != codec.OK else codec.HARDWARE_GONE)
            raise DeviceNotFound(reason, role=self.info.role, remedy=SERVICE_REMEDY)
        self.info = replace(self.info, model=f"FOVE headset ({text})")
        code, is_calibrated = ANSWER.unpack(self._ask((b"calibrated",), deadline_ns).frames[1])
        self._note_calibrated(code == codec.OK and bool(is_calibrated))

    def _begin_stream(self, earlier: Sequence[Message]) -> None:
        self._error_counts = {}
        self._state_asked_ns = self._clock.now_ns()

    def poll(self, timeout_s: float) -> int:
        """Decode new messages, and ask for the states at intervals; see the contract."""
        sample_count = super().poll(timeout_s)
        now_ns = self._clock.now_ns()
        every_ns = STATE_EVERY_NS if self._calibrating else PROBE_EVERY_NS
        if self._life.state is DeviceState.STREAMING and now_ns - self._state_asked_ns >= every_ns:
            self._state_asked_ns = now_ns
            if self._calibrating:
                self._transport.post((b"calibration_state",))
            else:
                for question in STATE_QUESTIONS:
                    self._transport.post((question,))
        return sample_count

    def _decode(self, message: Message) -> Iterable[Sample]:
        if message.t_sent_ns is not None:
            self._take_answer(message.frames)
            return
        eye_frame = codec.decode_eye_frame(message.frames[0], self._eye_distance_m)
        if eye_frame is None:
            self._malformed += 1
            return
        sample, codes = eye_frame
        for code in codes:
            self._error_counts[code] = self._error_counts.get(code, 0) + 1
        yield sample

    def _take_answer(self, frames: Frames) -> None:
        if len(frames) < 2 or len(frames[1]) != ANSWER.size:
            self._malformed += 1
            return
        question, (code, value) = frames[0], ANSWER.unpack(frames[1])
        if question == b"calibration_state":
            self._take_state(code, value)
        elif question == b"calibrated":
            self._note_calibrated(code == codec.OK and bool(value))
        elif question == b"hardware":
            is_missing = code in codec.DISCONNECTED_WITH or (code == codec.OK and not value)
            fault = self._blocking("the headset is not connected", SERVICE_REMEDY)
            self._note("hardware", fault if is_missing else None)

    def _take_state(self, code: int, state: int) -> None:
        if code != codec.OK or not self._calibrating:
            return
        self._calibration_state = state
        is_success = state in codec.SUCCESS_STATES
        if is_success or state >= codec.FIRST_FAILED:
            self._calibrating = False
            self._calibration = CalibrationOutcome(is_success, codec.calibration_text(state))
            if is_success:
                self._note_calibrated(True)

    def _note_calibrated(self, calibrated: bool) -> None:
        fault = self._uncalibrated("not calibrated", "calibrate")
        self._note("calibrated", None if calibrated else fault)

    def _own_faults(self) -> Iterable[Fault]:
        for code, count in sorted(self._error_counts.items()):
            if code != codec.UNCALIBRATED and count > self._meter.sample_count // 10:
                text = f"{codec.error_text(code)} in {count} of {self._meter.sample_count} samples"
                yield self._warning(text, "adjust the headset, then calibrate again")

    def _must_be_ok(self, question: bytes, what: str) -> None:
        deadline_ns = self._clock.now_ns() + NS_PER_S
        code, _ = ANSWER.unpack(self._ask((question,), deadline_ns).frames[1])
        if code != codec.OK:
            raise DeviceError(
                f"the FOVE runtime does not {what}: {codec.error_text(code)}",
                role=self.info.role,
                remedy=SERVICE_REMEDY,
            )
