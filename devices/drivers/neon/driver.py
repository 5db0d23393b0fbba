"""Drive a Pupil Labs Neon through the Companion app's network API.

Codec: `visavis.devices.drivers.neon.codec`. Transport:
`visavis.devices.drivers.neon.network.NeonNetwork` (HTTP, WebSocket, RTSP and time echo by
pupil-labs-realtime-api), or its simulator in memory. The phone's clock counts whole milliseconds
when asked, so single exchanges are good to half of one.
"""

import contextlib
import json
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import ClockPair, DeviceState, Fault, Health, SessionName
from visavis.devices.drivers.neon import codec
from visavis.devices.drivers.neon.spec import NEON
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.transports import Frames, Message, MessageTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError, DeviceNotFound
from visavis.lab.geometry import Vector

ECHO = struct.Struct("!Q")
HALF_MS_NS = NS_PER_MS // 2
RECORD_WITHIN_NS = 5 * NS_PER_S
RAYS = ("direction_head", "origin_m", "left_direction_head", "right_direction_head")
"""Columns that turn with the camera."""
NEWER_APP = "update Visavis; until then choose fewer gaze data in the Companion app"
PINHOLE: Final = codec.SceneCamera()


class Neon(GazeDevice):
    """Follow the `EyeTracker` contract over the Companion app.

    With `starts_recording` the phone records from the beginning of a session to its end, unless it
    records already. Neon is not calibrated; the session fits how its camera sits on the head
    (`turn_to_head`).

    Directions use the module's own camera calibration when the app gives it, else `camera`. Per-eye
    rays and pupils are there when the app computes them.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 200.0,
        lost_after_s: float = 2.0,
        exchange_interval_s: float = 1.0,
        opening_exchanges: int = 20,
        camera: codec.SceneCamera = PINHOLE,
        starts_recording: bool = False,
    ) -> None:
        self._camera, self._pitch_deg = camera, camera.pitch_deg
        self._opening_exchanges = opening_exchanges
        self._packet: int | None = None
        self._unknown: dict[int, int] = {}
        self._battery_01: float | None = None
        self._turn: Vector | None = None
        self._starts_recording = starts_recording
        self._is_recording = self._is_own_recording = False
        self._unrecorded_count = 0
        super().__init__(
            role,
            transport,
            clock,
            NEON,
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
            exchange_interval_s=exchange_interval_s,
        )

    def health(self) -> Health:
        """Report deliveries, the clock fit and the phone's battery."""
        return replace(super().health(), battery_01=self._battery_01)

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Send an event with a stamp of the phone's clock; the phone records it."""
        self._life.require("annotate", DeviceState.OPEN, DeviceState.STREAMING)
        frames: Frames = (b"event", text.encode(), str(self._to_device_ns(t_host_ns)).encode())
        self._mark(lambda: self._transport.send(0, frames))

    def begin_recording(self, name: SessionName, folder: Path) -> None:
        """Let the phone record, if it is to and does not yet; the recording stays on it.

        Its first event is the session's name.
        """
        self._life.require("begin_recording", DeviceState.OPEN)
        if not self._starts_recording or self._is_recording:
            return
        deadline_ns = self._clock.now_ns() + RECORD_WITHIN_NS
        reason = self._ask((b"record",), deadline_ns).frames[-1].decode("utf-8", "replace")
        if reason:
            raise DeviceError(
                f"the phone does not record: {reason}",
                role=self.info.role,
                remedy="look at the Companion app: wearer, workspace, template, battery, memory",
            )
        self._is_recording = self._is_own_recording = True
        self._note_recording()
        part = f"{name.study}_{name.participant}_{name.session:03d}_{name.part:02d}"
        self.annotate(part, self._clock.now_ns())

    def close(self) -> None:
        """Save the recording that was begun from here, and close the wire; idempotent."""
        if self._is_own_recording:
            self._is_own_recording = self._is_recording = False
            self._wire.release()
            with contextlib.suppress(DeviceError):  # it is away: it must be ended on the phone
                self._ask((b"save",), self._clock.now_ns() + RECORD_WITHIN_NS)
        super().close()

    def turn_to_head(self, matrix: Vector) -> None:
        """Turn gaze by this rotation from now on, on top of the rotation so far."""
        self._turn = matrix if self._turn is None else matrix @ self._turn

    def _values(self, samples: Sequence[Sample]) -> npt.NDArray[np.void]:
        values = super()._values(samples)
        turn = self._turn
        if turn is not None:
            values = values.copy()
            for name in RAYS:
                values[name] = values[name] @ turn.T
        return values

    def _prepare(self) -> None:
        super()._prepare()
        self._turn = None

    def _connect(self, deadline_ns: int) -> None:
        self._packet = None
        self._is_recording = False
        status = self._ask((b"status",), deadline_ns).frames
        self._take_status(status)
        self._note_recording()
        raw = self._ask((b"calibration",), deadline_ns).frames[1]
        calibration = codec.decode_calibration(raw, self._pitch_deg)
        if calibration is None:
            fault = self._warning(
                "the module's camera calibration is not known; rays are a pinhole's",
                "update the Companion app, or set focal_length_px and the centre",
            )
            self._note("camera", fault)
        else:
            self._camera, serial = calibration
            self.info = replace(self.info, serial=serial)
        for _ in range(self._opening_exchanges):
            exchange = self._ask((b"time",), deadline_ns)
            self._take_echo(exchange.frames, exchange.t_send_ns, exchange.t_receive_ns)
        if not self._exchanges.pairs and self._opening_exchanges:
            raise DeviceError(
                "the phone did not answer a time echo", role=self.info.role, remedy=NEON.remedy
            )

    def _resume(self) -> None:
        self._packet = None

    def _begin_stream(self, earlier: Sequence[Message]) -> None:
        self._unknown = {}
        self._unrecorded_count = 0

    def _ask_time(self, now_ns: int) -> None:
        self._transport.post((b"time",))

    def _decode(self, message: Message) -> Iterable[Sample]:
        frames = message.frames
        kind = frames[0]
        if kind == b"gaze" and len(frames) == 3 and len(frames[1]) == codec.STAMP.size:
            stamp_ns, number = codec.STAMP.unpack(frames[1])
            self._packet = codec.unwrapped(number, self._packet)
            sample = codec.decode_gaze(stamp_ns, self._packet, frames[2], self._camera)
            if sample is None:
                self._malformed += 1
                size = len(frames[2])
                self._unknown[size] = self._unknown.get(size, 0) + 1
            else:
                yield sample
        elif kind == b"time" and message.t_sent_ns is not None:
            self._take_echo(frames, message.t_sent_ns, message.t_host_ns)
        elif kind == b"status":
            self._take_status(frames)
        elif kind == b"event" and len(frames) == 2:
            self._unrecorded_count += not frames[1]
        else:
            self._malformed += 1

    def _take_echo(self, frames: Frames, sent_ns: int, received_ns: int) -> None:
        if len(frames) != 2 or len(frames[1]) != ECHO.size:
            self._malformed += 1
            return
        (phone_ms,) = ECHO.unpack(frames[1])
        if phone_ms < 2**43:  # take the middle of that millisecond
            device_ns = phone_ms * NS_PER_MS + HALF_MS_NS
            self._add_pair(ClockPair(sent_ns, device_ns, received_ns))

    def _take_status(self, frames: Frames) -> None:
        try:
            parts = json.loads(frames[1])
            rows = [(str(part["model"]), dict(part["data"])) for part in parts]
        except (ValueError, TypeError, KeyError, IndexError):
            self._malformed += 1
            return
        for model, data in rows:
            if model == "Phone":
                self._take_phone(data)
            elif model == "Hardware" and data.get("module_serial", "unknown") != "unknown":
                self.info = replace(self.info, serial=str(data["module_serial"]))
            elif model == "Recording":
                self._is_recording = data.get("action") == "START"
                self._note_recording()
            elif model == "Sensor" and data.get("sensor") == "gaze":
                is_disconnected = not data.get("connected") and data.get("conn_type") == "DIRECT"
                if is_disconnected and self._life.state is DeviceState.CLOSED:
                    raise DeviceNotFound(
                        "the phone sees no gaze sensor",
                        role=self.info.role,
                        remedy="connect the glasses to the phone and wait for the gaze circle",
                    )
                fault = self._blocking("the glasses are not connected", "check their cable")
                self._note("sensor", fault if is_disconnected else None)

    def _take_phone(self, data: Mapping[str, Any]) -> None:
        level = data.get("battery_level")
        if isinstance(level, int | float) and 0 <= level <= 100:
            self._battery_01 = level / 100
        low = data.get("battery_state") in ("LOW", "CRITICAL")
        fault = self._warning("the phone's battery is low", "charge the phone")
        self._note("battery", fault if low else None)
        full = data.get("memory_state") in ("LOW", "CRITICAL")
        fault = self._warning("the phone's memory is nearly full", "delete old recordings")
        self._note("memory", fault if full else None)

    def _note_recording(self) -> None:
        fault = self._warning(
            "the phone does not record: markers and its video will be lost",
            "begin a recording in the Companion app, or write starts_recording: true",
        )
        is_missing = not (self._is_recording or self._starts_recording)
        self._note("recording", fault if is_missing else None)

    def _own_faults(self) -> Iterable[Fault]:
        if self._unrecorded_count:
            yield self._warning(
                f"{self._unrecorded_count} markers reached no recording of the phone",
                "they stand in Visavis' own recording, with the time exchanges",
            )
        for size, count in sorted(self._unknown.items()):
            text = f"{count} gaze payloads of unknown length {size}"
            yield self._warning(text, NEWER_APP)
