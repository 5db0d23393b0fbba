"""Drive the eye tracker of a Varjo headset: per-eye rays, pupils, openness, calibration.

Codec: `visavis.devices.drivers.varjo.codec`. Transport: `visavis.devices.drivers.varjo.library`.
`seq` follows the vendor's frame numbers. Its clock is asked for every second. Calibration is the
vendor's own, drawn by it in the headset; openness is a second stream, `openness`.
"""

from collections.abc import Iterable
from dataclasses import replace

from visavis.devices.contracts import CalibrationOutcome, ClockPair, DeviceState, Fault
from visavis.devices.drivers.streaming.gaze_device import CalibratesByItself
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.openness import GazeAndOpenness
from visavis.devices.drivers.varjo import codec
from visavis.devices.drivers.varjo.library import RUNTIME_REMEDY, TIME
from visavis.devices.drivers.varjo.spec import VARJO
from visavis.devices.transports import Frames, Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError, DeviceNotFound

STATE_EVERY_NS = NS_PER_S // 4
BEGINS_WITHIN_NS = 5 * NS_PER_S
"""How long the system may take to bring up its calibration."""


class Varjo(CalibratesByItself, GazeAndOpenness):
    """Follow the `EyeTracker` contract over Varjo's native library."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 200.0,
        lost_after_s: float = 2.0,
        exchange_interval_s: float = 1.0,
    ) -> None:
        self._state_asked_ns = 0
        self._requested_ns: int | None = None
        self._has_begun = False
        super().__init__(
            role,
            transport,
            clock,
            VARJO,
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
            exchange_interval_s=exchange_interval_s,
        )

    def begin_calibration(self) -> None:
        """Let the system show its own targets; `add_reference` is not needed."""
        self._life.require("begin_calibration", DeviceState.STREAMING)
        self._calibration = None

        def begin() -> None:
            deadline_ns = self._clock.now_ns() + NS_PER_S
            (error,) = TIME.unpack(self._ask((b"calibrate",), deadline_ns).frames[1])
            if error:
                raise DeviceError(
                    f"Varjo does not begin its calibration (error {error})",
                    role=self.info.role,
                    remedy=RUNTIME_REMEDY,
                )
            self._requested_ns, self._has_begun = self._clock.now_ns(), False

        self._wire.do(begin)

    def poll(self, timeout_s: float) -> int:
        """Decode new data, and ask for the state at intervals; see the contract."""
        sample_count = super().poll(timeout_s)
        now_ns = self._clock.now_ns()
        is_due = now_ns - self._state_asked_ns >= STATE_EVERY_NS
        if self._life.state is DeviceState.STREAMING and is_due:
            self._state_asked_ns = now_ns
            self._transport.post((b"state",))
        return sample_count

    def _connect(self, deadline_ns: int) -> None:
        version = self._ask((b"start",), deadline_ns).frames[1].decode("utf-8", "replace")
        state = codec.decode_state(self._ask((b"state",), deadline_ns).frames[1])
        if state is None or not state.is_connected:
            raise DeviceNotFound(
                "no Varjo headset is connected", role=self.info.role, remedy=RUNTIME_REMEDY
            )
        self.info = replace(self.info, model=f"Varjo headset (runtime {version})")
        self._requested_ns = None
        self._take_state(state)
        time = self._ask((b"time",), deadline_ns)
        self._take_answer(time.frames, time.t_send_ns, time.t_receive_ns)

    def _ask_time(self, now_ns: int) -> None:
        self._transport.post((b"time",))

    def _decode(self, message: Message) -> Iterable[Sample]:
        if message.t_sent_ns is not None:
            self._take_answer(message.frames, message.t_sent_ns, message.t_host_ns)
            return
        sample = codec.decode_datum(message.frames[0])
        if sample is None:
            self._malformed += 1
        else:
            yield sample

    def _take_answer(self, frames: Frames, sent_ns: int, received_ns: int) -> None:
        question, answer = frames[0], frames[-1]
        if question == b"time" and len(answer) == TIME.size:
            self._add_pair(ClockPair(sent_ns, TIME.unpack(answer)[0], received_ns))
        elif question == b"state" and (state := codec.decode_state(answer)) is not None:
            self._take_state(state)
        else:
            self._malformed += 1

    def _take_state(self, state: codec.TrackerState) -> None:
        fault = self._uncalibrated("not calibrated", "calibrate")
        self._note("calibrated", None if state.is_calibrated else fault)
        gone = self._blocking("the headset is not connected", RUNTIME_REMEDY)
        self._note("connected", None if state.is_connected else gone)
        forbidden = self._blocking("eye tracking is no longer allowed", RUNTIME_REMEDY)
        self._note("allowed", None if state.is_allowed else forbidden)
        if self._requested_ns is None:
            return
        self._has_begun = self._has_begun or state.is_calibrating
        is_late = self._clock.now_ns() - self._requested_ns > BEGINS_WITHIN_NS
        if self._has_begun and not state.is_calibrating:
            self._requested_ns = None
            text = state.quality_text
            self._calibration = CalibrationOutcome(state.is_calibrated, text)
        elif not self._has_begun and is_late:
            self._requested_ns = None
            text = "Varjo did not begin its calibration"
            self._calibration = CalibrationOutcome(False, text)

    def _own_faults(self) -> Iterable[Fault]:
        if self._malformed and not self._meter.sample_count:
            yield self._blocking(
                "gaze and measurements of the eyes do not belong together: this VarjoLib has "
                "another layout",
                "use the VarjoLib.dll of native SDK 4",
            )
