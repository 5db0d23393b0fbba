"""The Neon Companion app as seen from the network, without its sockets.

Written from pupil-labs-realtime-api 1.9. Not modelled: video, blinks, fixations, IMU, templates,
mDNS, files of recordings. A lost or closed eye only changes the lid apertures: the gaze point goes
on.
"""

import json
import math
import struct
from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np

from visavis.devices.contracts import Body
from visavis.devices.drivers.streaming.screen import Triple
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_MS

STAMP = struct.Struct("<qH")
ECHO = struct.Struct("!Q")
FOCAL_PX, CENTER_X_PX, CENTER_Y_PX = 891.0, 800.0, 600.0
OPEN_MM = 9.0
SERIAL = b"123456"
PAYLOAD_SIZES = (9, 17, 25, 65, 89, 105)
EPOCH_NS = 1_700_000_000_000_000_000


class NeonSimulator(GazePeer):
    """Send gaze payloads of one length and answer status, calibration and time echo.

    The text of a "version" fault is the number of extra bytes in each payload, as a newer app would
    send. `battery_level` is a percentage. `refusal` is why the app begins no recording.
    """

    driver = "neon"
    usual_rate_hz = 200.0
    usual_epoch_ns = EPOCH_NS
    is_calibrated_before = True

    def __init__(
        self,
        body: Body,
        *,
        payload_size: int = 105,
        battery_level: int = 80,
        distortion: tuple[float, ...] = (0.0,) * 8,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.events: list[tuple[str, int]] = []
        self.recording_id: str | None = None
        self.recordings: list[str] = []
        self.refusal = ""
        self.battery_level = battery_level
        self.has_glasses = True
        self._size = payload_size
        self._distortion = distortion

    def to_message(self, shot: Shot) -> Frames:
        """Return one gaze datum with its stamp and packet number."""
        payload = shot.garbage if shot.garbage is not None else self.payload(shot)
        return b"gaze", STAMP.pack(shot.t_device_ns, shot.number & 0xFFFF), payload

    def payload(self, shot: Shot) -> bytes:
        """Return the bytes of one RTP packet."""
        lx, ly = self._pixel(shot.left)
        rx, ry = self._pixel(shot.right)
        bx, by = self._pixel(_mean(shot.left, shot.right))
        state: list[float] = []
        lids: list[float] = []
        eyes = ((-EYE_X_M, shot.left, shot.left_seen), (EYE_X_M, shot.right, shot.right_seen))
        for x_m, ray, is_seen in eyes:
            state += [
                shot.pupil_mm if is_seen else 0.0,
                x_m * 1e3,
                0.0,
                0.0,
                ray[0],
                -ray[1],
                -ray[2],
            ]
            lids += [0.3, -0.3, OPEN_MM * shot.openness_01 if is_seen else 0.0]
        dual = [lx, ly, rx, ry]
        first = (lx, ly) if self._size == 17 else (bx, by)
        parts = {9: [], 17: [rx, ry], 25: dual, 65: state, 89: state + lids}
        floats = parts.get(self._size, state + lids + dual)
        raw = struct.pack("!ffB", *first, 255) + struct.pack(f"!{len(floats)}f", *floats)
        fault = self.source.faults.active("version", shot.t_ns - self.source.origin_ns)
        return raw if fault is None else raw + bytes(int(fault.text))

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as app and transport do together."""
        kind = frames[0]
        if kind == b"status":
            return b"status", json.dumps(self.status()).encode()
        if kind == b"calibration":
            return b"calibration", self.calibration()
        if kind == b"time":
            return b"time", ECHO.pack(self.source.device_ns(t_ns) // NS_PER_MS)
        if kind in (b"record", b"save"):
            return kind, self.command_recording(kind.decode()).encode()
        if kind == b"event" and len(frames) == 3:
            self.events.append((frames[1].decode(), int(frames[2])))
            self.push(t_ns + self.leg_ns(), (b"event", (self.recording_id or "").encode()))
        return None

    def command_recording(self, command: str) -> str:
        """Begin ("record") or save a recording; return the app's reason where it refuses."""
        is_beginning = command == "record"
        if is_beginning == (self.recording_id is not None):
            return "Recording already running" if is_beginning else "Recording not running"
        if is_beginning and self.refusal:
            return self.refusal
        if self.recording_id is not None:
            self.recordings.append(self.recording_id)
        self.recording_id = f"recording-{len(self.recordings)}" if is_beginning else None
        return ""

    def status(self, *, address: str = "127.0.0.1", rtsp: int = 8086, echo: int = 0) -> list[Any]:
        """Return the components of a status."""
        low = "LOW" if self.battery_level < 20 else "OK"
        recording = [] if self.recording_id is None else [self._recording_part("START")]
        return [
            *recording,
            _part(
                "Phone",
                battery_level=self.battery_level,
                battery_state=low,
                device_id="sim",
                device_name="Simulated",
                ip=address,
                memory=10**10,
                memory_state="OK",
                time_echo_port=echo,
            ),
            _part(
                "Hardware",
                version="2.0",
                glasses_serial="unknown",
                world_camera_serial="unknown",
                module_serial=SERIAL.decode(),
            ),
            _part(
                "Sensor",
                sensor="gaze",
                conn_type="DIRECT",
                connected=self.has_glasses,
                ip=address,
                params="camera=gaze",
                port=rtsp,
                protocol="rtsp",
                stream_error=False,
            ),
        ]

    def _recording_part(self, action: str) -> Mapping[str, Any]:
        return _part(
            "Recording", action=action, id=self.recording_id, message="", rec_duration_ns=10**9
        )

    def calibration(self) -> bytes:
        """Return the module's calibration file: scene camera, then two eye cameras."""
        matrix = (FOCAL_PX, 0.0, CENTER_X_PX, 0.0, FOCAL_PX, CENTER_Y_PX, 0.0, 0.0, 1.0)
        still = np.eye(4).ravel()
        camera = struct.pack("<9d8d16d", *matrix, *self._distortion, *still)
        return struct.pack("<B6s", 1, SERIAL) + 3 * camera + struct.pack("<I", 0)

    def _pixel(self, ray: Triple) -> tuple[float, float]:
        ahead = max(-ray[2], 0.05)
        x, y = ray[0] / ahead, -ray[1] / ahead
        k1, k2, p1, p2, k3, k4, k5, k6 = self._distortion
        r2 = x * x + y * y
        share = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        u = x * share + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * share + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return FOCAL_PX * u + CENTER_X_PX, FOCAL_PX * v + CENTER_Y_PX


def _part(model: str, **data: Any) -> Mapping[str, Any]:
    return {"model": model, "data": data}


def _mean(a: Triple, b: Triple) -> Triple:
    x, y, z = (p + q for p, q in zip(a, b, strict=True))
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length
