"""Drive a Gazepoint eye tracker through its Open Gaze server.

Codec: `visavis.devices.drivers.gazepoint.codec`. Transport: a TCP stream. A screen-based tracker:
rays are in the head frame of `streaming.gaze_rays.Screen`. The server's clock cannot be asked; on
one computer its ticks are the host's own performance counter.
"""

from collections.abc import Iterable
from dataclasses import replace

from visavis.devices.contracts import CalibrationOutcome, DeviceState
from visavis.devices.drivers.gazepoint import codec
from visavis.devices.drivers.gazepoint.spec import GAZEPOINT
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.plausible import TICKS_PER_S
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError, ProtocolViolation

OLDEST_API = 2.0
MIN_POINTS_SHARE = 0.5


class Gazepoint(GazeDevice):
    """Follow the `EyeTracker` contract over Open Gaze; `seq` follows the server's CNT.

    Lengths are millimetres: the screen as seen from the viewing place, the camera from the
    screen's centre.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 60.0,
        lost_after_s: float = 2.0,
        screen: Screen | None = None,
        camera_right_mm: float = 0.0,
        camera_up_mm: float = -180.0,
        camera_toward_mm: float = 0.0,
        eye_distance_mm: float = 64.0,
    ) -> None:
        self._place = codec.Place(
            screen or Screen(), camera_right_mm, camera_up_mm, camera_toward_mm, eye_distance_mm
        )
        self._reader = codec.LineReader()
        self._answers: dict[str, codec.Line] = {}
        self._ticks_per_s = 0.0
        super().__init__(
            role, transport, clock, GAZEPOINT, rate_hz=rate_hz, lost_after_s=lost_after_s
        )

    def begin_calibration(self) -> None:
        """Let the server show its own targets; `add_reference` is not needed."""
        self._life.require("begin_calibration", DeviceState.STREAMING)
        self._calibration = None
        self._post(codec.set_line("CALIBRATE_SHOW", STATE="1"))
        self._post(codec.set_line("CALIBRATE_START", STATE="1"))

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Wait for the server's result; its mean error is the vendor's accuracy."""
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self.finish_calibration()
        self._wait_until(lambda: self._calibration is not None, deadline_ns, "calibration result")
        outcome = self.calibration_verdict()
        assert outcome is not None  # noqa: S101 - awaited above
        return outcome

    def finish_calibration(self) -> None:
        """Do nothing: the server ends its own procedure and sends the result."""
        self._life.require("finish_calibration", DeviceState.STREAMING)

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return the server's result, None until it came; its display is then taken away."""
        if self._calibration is not None:
            self._post(codec.set_line("CALIBRATE_SHOW", STATE="0"))
        return self._calibration

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Write USER_DATA for one record: the next one, whatever the time of the marker."""
        self._life.require("annotate", DeviceState.OPEN, DeviceState.STREAMING)
        self._post(codec.set_line("USER_DATA", VALUE=text, DUR="1"))

    def _connect(self, deadline_ns: int) -> None:
        self._reader = codec.LineReader()
        self._answers = {}
        for name in ("API_ID", "PRODUCT_ID", "SERIAL_ID", "TIME_TICK_FREQUENCY", "TRACKER_ID"):
            self._transport.post((codec.get_line(name),))
        self._resume()
        self._wait_until(
            lambda: "ENABLE_SEND_DATA" in self._answers, deadline_ns, "answer from the server"
        )
        self._take_identity()

    def _resume(self) -> None:
        self._reader = codec.LineReader()
        for name in codec.STREAMS:
            line = codec.set_line(f"ENABLE_SEND_{name}", STATE="1")
            self._transport.post((line,))

    def _decode(self, message: Message) -> Iterable[Sample]:
        reader = self._reader
        before = reader.malformed
        lines = reader.feed(b"".join(message.frames))
        self._malformed += reader.malformed - before
        for tag, values in lines:
            if tag == "REC":
                sample = codec.decode_record(values, self._place, self._ticks_per_s)
                if sample is None:
                    self._malformed += 1
                else:
                    yield sample
            elif tag == "UPDATE":
                self._take_switch(values)
            elif tag == "CAL":
                self._take_calibration(values)
            else:
                self._answers[values.get("ID", "")] = codec.Line(tag, values)

    def _take_identity(self) -> None:
        api = self._answer("API_ID", "VALUE") or self._answer("API_ID", "VER_ID")
        version = codec.number({"v": api}, "v")
        if version < OLDEST_API:
            raise ProtocolViolation(
                f"the server speaks Open Gaze {api!r}; this driver needs {OLDEST_API} or newer",
                role=self.info.role,
                remedy="install a current Gazepoint Control",
            )
        self._take_frequency(self._answer("TIME_TICK_FREQUENCY", "FREQ"))
        self._compare_rate(codec.number({"v": self._answer("PRODUCT_ID", "RATE")}, "v"))
        count, search = self._answer("TRACKER_ID", "MAX_ID"), self._answer("TRACKER_ID", "SEARCH")
        if codec.number({"v": count}, "v") > 1 and search != "NONE":
            raise DeviceError(
                f"the server has {count} trackers and switches between them by itself ({search})",
                role=self.info.role,
                remedy="turn the search for trackers off in Gazepoint Control, or unplug one",
            )
        model = self._answer("PRODUCT_ID", "VALUE") or "Gazepoint"
        self.info = replace(self.info, model=model, serial=self._answer("SERIAL_ID", "VALUE"))

    def _take_frequency(self, text: str) -> None:
        """Take the ticks per second; without a plausible one the records' seconds count."""
        self._ticks_per_s = codec.tick_frequency(text) or 0.0
        fault = None
        if text and not self._ticks_per_s:
            bounds = f"{TICKS_PER_S.lowest:g} to {TICKS_PER_S.highest:g}"
            fault = self._warning(
                f"the server says that its clock counts {text} ticks a second, which can only be "
                f"{bounds}; the records' seconds are used, which count to 0.01 ms",
                "report the answer TIME_TICK_FREQUENCY in the .wire log",
            )
        self._note("ticks", fault)

    def _take_switch(self, values: codec.Attributes) -> None:
        number, count = values.get("ACTIVE_ID", "?"), values.get("MAX_ID", "?")
        fault = self._blocking(
            f"the server went over to tracker {number} of {count} while this one was measured",
            "unplug the other tracker, or give it a computer of its own",
        )
        self._note("switch", fault)

    def _compare_rate(self, told_hz: float) -> None:
        given_hz = self._schema.nominal_rate_hz
        fault = self._warning(
            f"the tracker measures {told_hz:g} times a second, lab_config.yaml says {given_hz:g}",
            f"write rate_hz: {told_hz:g}",
        )
        self._note("rate", fault if abs(told_hz - given_hz) > 0.1 * given_hz else None)

    def _answer(self, name: str, key: str) -> str:
        line = self._answers.get(name)
        return line.values.get(key, "") if line is not None and line.tag == "ACK" else ""

    def _take_calibration(self, values: codec.Attributes) -> None:
        if values.get("ID") != "CALIB_RESULT":
            return
        errors, points = codec.calibration_errors_deg(values, self._place.screen)
        enough = points > 0 and len(errors) >= 2 * points * MIN_POINTS_SHARE
        mean_deg = sum(errors) / len(errors) if errors else None
        text = f"{len(errors)} of {2 * points} targets counted (two eyes)"
        self._calibration = CalibrationOutcome(enough, text, mean_deg)

    def _post(self, line: bytes) -> None:
        self._wire.do(lambda: self._transport.post((line,)))
