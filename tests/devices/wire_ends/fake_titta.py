"""A stand-in of the part of TittaPy that the Tobii driver calls, over its simulator.

Written from TittaPy.cpp: arrays by name for each stream, emptied as they are taken; errors as
RuntimeError. Not modelled: licences, images, calibration, faults and warnings of the device.
"""

import struct
from enum import Enum
from typing import Any

import numpy as np

from visavis.devices.sim.lsl.gaze import TittaSimulator, titta_rows
from visavis.lab.clock import NS_PER_S, Clock

SYSTEM_AHEAD_US = 77_000_000
"""How far ahead of the session's clock the SDK's own runs."""
EXCHANGE_EVERY_NS = NS_PER_S
LEG_US = 150
STREAMS = ("gaze", "eye_image", "external_signal", "time_sync", "positioning", "notification")
ADDRESS = "tet-tcp://169.254.10.20"


class Notification(Enum):
    """Some of the SDK's notifications."""

    connection_lost = 0
    connection_restored = 1
    calibration_changed = 4


class FakeTitta:
    """Stand in for the module `TittaPy_v2`, with one tracker or more."""

    def __init__(
        self, simulator: TittaSimulator, clock: Clock, serials: tuple[str, ...] = ("TPSP1",)
    ) -> None:
        self.simulator = simulator
        self.clock = clock
        self.serials = serials
        self.notifications: list[Notification] = []
        self.was_away = False

    def find_all_eye_trackers(self) -> list[dict[str, Any]]:
        """Return what is plugged in; nothing while it is away."""
        if self.simulator.source.is_away(self.clock.now_ns()):
            return []
        return [{"serial_number": serial, "address": ADDRESS} for serial in self.serials]

    def get_system_timestamp(self) -> int:
        """Return the SDK's clock in microseconds."""
        return self.clock.now_ns() // 1000 + SYSTEM_AHEAD_US

    def EyeTracker(self, address: str) -> "FakeTracker":  # noqa: N802 - the library's own name
        """Connect."""
        if address != ADDRESS or not self.find_all_eye_trackers():
            raise RuntimeError("Error code 4: TOBII_RESEARCH_STATUS_CONNECTION_FAILED")
        return FakeTracker(self)


class FakeTracker:
    """The properties and methods of TittaPy's EyeTracker that the transport calls."""

    model, firmware_version, serial_number = "Tobii Pro Spectrum", "2.6.1", "TPSP1"
    supported_frequencies = (60.0, 120.0, 150.0, 300.0)

    def __init__(self, library: FakeTitta) -> None:
        self._library = library
        self._frequency = 60.0
        self.streams: set[str] = set()
        self._exchanged_ns = library.clock.now_ns()

    @property
    def frequency(self) -> float:
        """How often it measures."""
        return self._frequency

    @frequency.setter
    def frequency(self, rate_hz: float) -> None:
        if rate_hz not in self.supported_frequencies:
            raise RuntimeError("Error code 10: TOBII_RESEARCH_STATUS_INVALID_PARAMETER")
        self._frequency = rate_hz

    def start(self, stream: str) -> bool:
        """Begin to fill a stream's buffer."""
        if stream not in STREAMS:
            raise RuntimeError(f'Titta::cpp: Requested stream "{stream}" is not recognized.')
        self.streams.add(stream)
        return True

    def stop(self, stream: str) -> bool:
        """Stop filling it."""
        self.streams.discard(stream)
        return True

    def consume_N(self, stream: str, count: int) -> dict[str, Any]:  # noqa: N802 - as above
        """Take the oldest rows of a stream."""
        if stream == "notification":
            return self._notifications()
        return self._times() if stream == "time_sync" else self._gaze()

    def _notifications(self) -> dict[str, Any]:
        library = self._library
        is_away = library.simulator.source.is_away(library.clock.now_ns())
        if is_away and not library.was_away:
            library.notifications.append(Notification.connection_lost)
        library.was_away = is_away
        found, library.notifications = library.notifications, []
        return {"notification_type": found}

    def _times(self) -> dict[str, Any]:
        library, now_ns = self._library, self._library.clock.now_ns()
        rows = []
        while "time_sync" in self.streams and self._exchanged_ns + EXCHANGE_EVERY_NS <= now_ns:
            self._exchanged_ns += EXCHANGE_EVERY_NS
            middle_us = self._exchanged_ns // 1000 + SYSTEM_AHEAD_US
            device_us = library.simulator.source.device_ns(self._exchanged_ns) // 1000
            rows.append((middle_us - LEG_US, device_us, middle_us + LEG_US))
        table = np.array(rows, np.int64).reshape(-1, 3)
        names = ("system_request_time_stamp", "device_time_stamp", "system_response_time_stamp")
        return dict(zip(names, table.T, strict=True))

    def _gaze(self) -> dict[str, Any]:
        library, now_ns = self._library, self._library.clock.now_ns()
        library.simulator.advance(now_ns)
        messages = library.simulator.outgoing(now_ns) if "gaze" in self.streams else []
        labels = [row["label"] for row in titta_rows()]
        raws = [m.frames[1] for m in messages if len(m.frames[1]) == 8 * (len(labels) + 2)]
        rows = np.array([struct.unpack(f"<{len(raw) // 8}d", raw) for raw in raws])
        table = rows.reshape(-1, len(labels) + 2)
        stamps_us = np.round(table[:, 0] * 1e6).astype(np.int64)
        found = {"device_time_stamp": stamps_us, "system_time_stamp": stamps_us + 5}
        for i, label in enumerate(labels):
            name, eye = label.rsplit(".", 1)
            column = table[:, 1 + i]
            found[f"{eye.removesuffix('_eye')}_{_key(name)}"] = (
                column > 0 if name.startswith(("valid", "available")) else column
            )
        return found


def _key(label: str) -> str:
    """Return TittaPy's name of what TittaLSL calls otherwise."""
    what, _, part = label.rpartition(".")
    if "position_" not in what:
        return f"{part}_{what}"
    axis, _, place = what.partition(".position_")
    return f"{part}_{place}_{axis}"
