"""Drive an eye tracker of HID usage page 0x12, from any maker.

Codec: `hid_gaze.codec`. Transport: `hid_gaze.reports`. A screen-based
tracker: one ray, in the head frame of `streaming.gaze_rays.Screen`; no pupils, no per-eye
directions. Its clock cannot be asked, and the unit of its stamps is estimated from the rate.
"""

from collections.abc import Iterable
from dataclasses import replace

from visavis.devices.drivers.hid_gaze import codec
from visavis.devices.drivers.hid_gaze.spec import HID_GAZE
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.plausible import SCREEN_SIDE_MM
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import ProtocolViolation

STEPS_FOR_UNIT = 12
MODE_GAZE_AND_EYES = 2


class HidGaze(GazeDevice):
    """Follow the `EyeTracker` contract over HID reports.

    `time_unit_us` is microseconds per tick of the stamps; 0 estimates it from the rate. A screen
    size that the tracker reports replaces that of `screen`.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
        screen: Screen | None = None,
        time_unit_us: float = 0.0,
        eye_distance_mm: float = 64.0,
    ) -> None:
        self._screen = screen or Screen()
        self._time_unit_us = time_unit_us
        self._tick_ns = round(time_unit_us * 1e3) or 1000
        self._eye_distance_mm = eye_distance_mm
        self._layout: codec.TrackingLayout | None = None
        self._ticks: list[int] = []
        super().__init__(
            role, transport, clock, HID_GAZE, rate_hz=rate_hz, lost_after_s=lost_after_s
        )

    def _connect(self, deadline_ns: int) -> None:
        self._layout = None
        self._ticks = []
        raw = self._ask((b"descriptor",), deadline_ns).frames[1]
        reports = codec.walk_descriptor(raw)
        layout = codec.tracking_layout(reports)
        if layout is None:
            raise ProtocolViolation(
                "the device describes no gaze point with a time stamp",
                role=self.info.role,
                remedy="choose a tracker of HID usage page 0x12 that reports gaze",
            )
        names = self._ask((b"identity",), deadline_ns).frames[1].decode("utf-8", "replace")
        product, _, serial = names.partition("\n")
        self.info = replace(self.info, model=product or self.info.model, serial=serial)
        self._take_configuration(reports, deadline_ns)
        self._layout = layout
        control = reports.get((codec.FEATURE, codec.CONTROL))
        if control is not None:
            body = bytearray(control.size)
            body[0] = codec.CONTROL
            place = next(iter(control.places.values()), None)
            if place is not None:
                body[place.at] = MODE_GAZE_AND_EYES
            self._transport.post((b"set", bytes(body)))
        self._wait_until(lambda: len(self._ticks) > STEPS_FOR_UNIT, deadline_ns, "report")
        steps = [b - a for a, b in zip(self._ticks, self._ticks[1:], strict=False)]
        unit_us = self._time_unit_us or codec.unit_from_rate(steps, self._schema.nominal_rate_hz)
        self._tick_ns = max(1, round(unit_us * 1e3))

    def _decode(self, message: Message) -> Iterable[Sample]:
        layout = self._layout
        if layout is None or message.t_sent_ns is not None:
            return
        report = codec.decode_report(message.frames[0], layout, self._screen, self._eye_distance_mm)
        if report is None or report[0] * self._tick_ns >= 2**62:
            self._malformed += 1
            return
        ticks, row = report
        if len(self._ticks) <= STEPS_FOR_UNIT:
            self._ticks.append(ticks)
        yield Sample(ticks * self._tick_ns, None, row)

    def _take_configuration(
        self, reports: dict[tuple[str, int], codec.ReportLayout], deadline_ns: int
    ) -> None:
        def value(report: int, usage: int) -> int | None:
            layout = reports.get((codec.FEATURE, report))
            if layout is None:
                return None
            raw = self._ask((f"feature:{report:02x}".encode(),), deadline_ns).frames[1]
            return codec.feature_value(raw, layout, usage)

        width_um = value(codec.CONFIGURATION, codec.SCREEN_WIDTH)
        height_um = value(codec.CONFIGURATION, codec.SCREEN_HEIGHT)
        if width_um and height_um:
            self._take_size(width_um * 1e-3, height_um * 1e-3)
        told_hz = value(codec.STATUS, codec.SAMPLING_FREQUENCY)
        given_hz = self._schema.nominal_rate_hz
        rate = self._warning(
            f"the tracker says that it measures {told_hz} times a second, lab_config.yaml says "
            f"{given_hz:g}",
            f"write rate_hz: {told_hz}, from which the unit of its time stamps is told",
        )
        self._note("rate", rate if told_hz and abs(told_hz - given_hz) > 0.1 * given_hz else None)
        state = value(codec.STATUS, codec.CONFIGURATION_STATUS)
        text = codec.STATUS_TEXTS.get(state or 0)
        self._note("status", None if text is None else self._blocking(text, HID_GAZE.remedy))

    def _take_size(self, width_mm: float, height_mm: float) -> None:
        """Take the size of the screen that the tracker states, if there is such a screen."""
        sides = (("width", width_mm), ("height", height_mm))
        wrong = [(side, mm) for side, mm in sides if not SCREEN_SIDE_MM.admit(mm)]
        if not wrong:
            self._screen = replace(self._screen, width_mm=width_mm, height_mm=height_mm)
        texts = [SCREEN_SIDE_MM.sentence(f"the screen's {side}", mm) for side, mm in wrong]
        fault = self._blocking(
            f"{'; '.join(texts)}: the size in lab_config.yaml is used",
            "set the screen up in the tracker's own program",
        )
        self._note("screen", fault if wrong else None)
