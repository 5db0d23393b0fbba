"""Carry gaze out of the Tobii Pro SDK through TittaPy, on an optional extra.

The SDK's own wire is private, so TittaPy's functions serve as the wire: what they return becomes
messages in the form of TittaLSL's stream (`visavis.devices.drivers.lsl.gaze_codec`), which can be
copied to a `.wire` log and replayed without the SDK. The maker's own wheel, tobii-research, exists
up to Python 3.10 only. Source: dcnieho/Titta, SDK_wrapper/TittaPy/TittaPy.cpp.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from visavis.devices.drivers.lsl.inlet import OFFSET
from visavis.devices.libraries import TITTA
from visavis.devices.one_of_a_kind import the_only
from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceNotFound, DeviceTimeout

NS_PER_US = 1000
LOOK_AGAIN_NS = NS_PER_MS
MAX_SAMPLES = 4096
STREAMS = ("gaze", "time_sync", "notification")
EXCHANGE = ("system_request_time_stamp", "device_time_stamp", "system_response_time_stamp")
AREA = "position_on_display_area.gaze_point"
POINT, ORIGIN = (f"position_in_user_coordinates.gaze_{part}" for part in ("point", "origin"))
PARTS = (
    *((f"gaze_point_on_display_area_{a}", f"{a}.{AREA}") for a in "xy"),
    *((f"gaze_point_in_user_coordinates_{a}", f"{a}.{POINT}") for a in "xyz"),
    ("gaze_point_valid", "valid.gaze_point"),
    *((f"gaze_origin_in_user_coordinates_{a}", f"{a}.{ORIGIN}") for a in "xyz"),
    ("gaze_origin_valid", "valid.gaze_origin"),
    ("pupil_diameter", "diameter.pupil"),
    ("pupil_valid", "valid.pupil"),
)
COLUMNS = tuple(
    (f"{eye}_{key}", f"{label}.{eye}_eye") for eye in ("left", "right") for key, label in PARTS
)
"""What TittaPy calls each number of a sample, and what TittaLSL does."""


class TobiiSdk(NoTopics):
    """Offer the gaze of one tracker, by serial number or the only one.

    `library` replaces TittaPy in tests. The SDK exchanges times with the tracker by itself; a
    request `time` answers with its last exchange, put on the session's clock.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        serial: str = "",
        rate_hz: float = 120.0,
        library: Any = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._clock = clock
        self._serial = serial
        self._rate_hz = rate_hz
        self._injected_library = library
        self._library: Any = None
        self._tracker: Any = None
        self._is_asked = False

    @property
    def kind(self) -> str:
        """Name the tracker."""
        return f"tobii pro sdk {self._serial}".strip()

    def open(self, deadline_s: float) -> None:
        """Find the tracker, set its rate and begin to listen.

        Raises:
            DeviceNotFound: there is none, or more than one, or it does not stream.
            ConfigError: it has not got that rate.
        """
        self.close()
        library = self._injected_library
        self._library = TITTA.imported() if library is None else library
        trackers = [dict(one) for one in self._library.find_all_eye_trackers()]
        if self._serial:
            trackers = [one for one in trackers if one["serial_number"] == self._serial]
        if not trackers:
            of_serial = f" with the serial number {self._serial}" if self._serial else ""
            raise DeviceNotFound(f"the Tobii Pro SDK finds no eye tracker{of_serial}")
        remedy = "give serial in lab_config.yaml"
        chosen = the_only(trackers, lambda one: one["serial_number"], "Tobii eye trackers", remedy)
        try:
            tracker = self._library.EyeTracker(chosen["address"])
            self._set_rate(tracker)
            for stream in STREAMS:
                if not tracker.start(stream):
                    raise DeviceNotFound(f"the tracker does not start its stream {stream!r}")
        except RuntimeError as cause:
            raise DeviceNotFound(f"the Tobii Pro SDK refused: {cause}") from cause
        self._tracker = tracker

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Answer (info,) with the channels' names, (time,) with the SDK's last exchange."""
        self._must_be_there()
        sent_ns = self._clock.now_ns()
        if frames[0] == b"info":
            return Exchange((b"info", self._description()), sent_ns, self._clock.now_ns())
        deadline_ns = sent_ns + round(timeout_s * NS_PER_S)
        while (exchange := self._new_exchange()) is None:
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout("the SDK has exchanged no times with the tracker yet")
            self._clock.sleep_until_ns(min(now_ns + LOOK_AGAIN_NS, deadline_ns))
        return exchange

    def post(self, frames: Frames) -> None:
        """Take a question for the time, which `receive` answers."""
        self._is_asked = True

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the samples in the SDK's buffer; waits in steps of a millisecond."""
        self._must_be_there()
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while True:
            messages = [*self._answers(), *self._drain()]
            now_ns = self._clock.now_ns()
            if messages or now_ns >= deadline_ns:
                return messages
            self._clock.sleep_until_ns(min(now_ns + LOOK_AGAIN_NS, deadline_ns))
            self._must_be_there()

    def send(self, port: int, frames: Frames) -> None:
        """Do nothing: the tracker keeps no file to write into."""

    def close(self) -> None:
        """Stop listening; idempotent."""
        tracker, self._tracker = self._tracker, None
        self._is_asked = False
        if tracker is None:
            return
        for stream in STREAMS:
            try:
                tracker.stop(stream)
            except RuntimeError:
                return  # it is gone, and its streams with it

    # ---- inside -----------------------------------------------------------------------------

    def _set_rate(self, tracker: Any) -> None:
        rates = [float(rate) for rate in tracker.supported_frequencies]
        if self._rate_hz not in rates:
            rates_text = ", ".join(f"{rate:g}" for rate in sorted(rates))
            raise ConfigError(
                f"rate_hz: this tracker measures {rates_text} times a second, not {self._rate_hz:g}"
            )
        if float(tracker.frequency) != self._rate_hz:
            tracker.frequency = self._rate_hz

    def _must_be_there(self) -> None:
        if self._tracker is None:
            raise DeviceDisconnected("the Tobii eye tracker is not connected")
        notes = self._tracker.consume_N("notification", MAX_SAMPLES)
        names = [getattr(kind, "name", str(kind)) for kind in notes.get("notification_type", ())]
        states = [name for name in names if name in ("connection_lost", "connection_restored")]
        if states[-1:] == ["connection_lost"]:
            raise DeviceDisconnected("the Tobii Pro SDK lost the eye tracker")

    def _description(self) -> bytes:
        tracker = self._tracker
        root = Element("info")
        for tag, text in (
            ("name", f"{tracker.model} (firmware {tracker.firmware_version})"),
            ("source_id", str(tracker.serial_number)),
            ("channel_count", str(len(COLUMNS))),
            ("nominal_srate", str(float(tracker.frequency))),
        ):
            SubElement(root, tag).text = text
        channels = SubElement(SubElement(root, "desc"), "channels")
        for _, label in COLUMNS:
            SubElement(SubElement(channels, "channel"), "label").text = label
        return tostring(root)

    def _new_exchange(self) -> Exchange | None:
        """Return the SDK's last exchange of times with the tracker; None without a new one."""
        rows = self._tracker.consume_N("time_sync", MAX_SAMPLES)
        if not len(rows.get("device_time_stamp", ())):
            return None
        asked_us, device_us, answered_us = (int(rows[name][-1]) for name in EXCHANGE)
        sdk_late_ns = self._clock.now_ns() - int(self._library.get_system_timestamp()) * NS_PER_US
        sent_ns, received_ns = (us * NS_PER_US + sdk_late_ns for us in (asked_us, answered_us))
        offset_ns = (sent_ns + received_ns) // 2 - device_us * NS_PER_US
        answer = OFFSET.pack(offset_ns / NS_PER_S, (received_ns - sent_ns) / NS_PER_S)
        return Exchange((b"time", answer), sent_ns, received_ns)

    def _answers(self) -> list[Message]:
        exchange = self._new_exchange() if self._is_asked else None
        if exchange is None:
            return []
        self._is_asked = False
        return [Message(exchange.t_receive_ns, exchange.frames, exchange.t_send_ns)]

    def _drain(self) -> list[Message]:
        rows: Mapping[str, Any] = self._tracker.consume_N("gaze", MAX_SAMPLES)
        now_ns = self._clock.now_ns()
        columns = [rows[key] for key, _ in COLUMNS]
        return [
            Message(now_ns, (b"sample", _packed(stamp_us, [column[i] for column in columns])))
            for i, stamp_us in enumerate(rows["device_time_stamp"])
        ]


def _packed(stamp_us: Any, numbers: Sequence[Any]) -> bytes:
    return struct.pack(f"<{1 + len(numbers)}d", int(stamp_us) / 1e6, *map(float, numbers))
