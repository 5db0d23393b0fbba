"""Varjo's native library for its caller, in memory.

Written from the vendor's headers. Not modelled: the compositor, the picture of the calibration,
the filter, events; a calibration takes 2 s and is judged by the wearer's open eyes alone.
"""

import struct
from typing import Unpack

from visavis.devices.contracts import Body
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_S

RAY = struct.Struct("<6d")
REST = struct.Struct("<2dqqqqq2d")
MEASURED = struct.Struct("<qq9f4x")
NOT_TRACKED, SEEN_AND_TRACKED, TRACKER_OFF, TRACKER_ON = 0, 3, 0, 2
CALIBRATION_NS = 2 * NS_PER_S
IRIS_MM = 11.8
EYES_APART_MM = 2e3 * EYE_X_M
HIGH = 3
VERSION = "4.7.0.11"


class VarjoSimulator(GazePeer):
    """Deliver data of a body's eyes and answer the calls that the driver makes.

    `is_allowed` and `is_connected` are what the system says.
    """

    driver = "varjo"
    usual_rate_hz = 200.0
    is_allowed = True
    is_connected = True

    def __init__(self, body: Body, *, quality: int = HIGH, **measuring: Unpack[Measuring]) -> None:
        super().__init__(body, **measuring)
        self._quality = quality
        self._started_ns: int | None = None
        self._open = self._closed = 0

    @property
    def is_busy(self) -> bool:
        """Tell whether it calibrates."""
        return self._started_ns is not None

    def to_message(self, shot: Shot) -> Frames:
        """Return gaze and measurements of one frame."""
        if self._started_ns is not None:
            self._open += shot.left_seen and shot.right_seen
            self._closed += not (shot.left_seen and shot.right_seen)
        return (datum(shot) if shot.garbage is None else shot.garbage,)

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as the library's functions return."""
        question = frames[0]
        if question == b"start":
            return question, self.source.claimed_version(t_ns, VERSION).encode()
        if question == b"time":
            return question, struct.pack("<q", self.source.device_ns(t_ns))
        if question == b"calibrate":
            self._started_ns, self._open, self._closed = t_ns, 0, 0
            return question, struct.pack("<q", 0)
        if question == b"state":
            return question, self._state(t_ns)
        return question, b""

    def _state(self, t_ns: int) -> bytes:
        started_ns = self._started_ns
        if started_ns is not None and t_ns - started_ns >= CALIBRATION_NS:
            self._started_ns = None
            has_seen = self._open > self._closed
            self.source.calibrated_fit = self.source.body.fit() if has_seen else None
        is_calibrated = self.source.calibrated_fit is not None
        quality = self._quality if is_calibrated else 0
        is_busy = self._started_ns is not None
        flags = (self.is_allowed, self.is_connected, is_busy, is_calibrated and not is_busy)
        return struct.pack("<6i", *flags, quality, quality)


def datum(shot: Shot) -> bytes:
    """Return `varjo_Gaze` and `varjo_EyeMeasurements` of a shot, member by member."""
    rays = _ray(shot.left, -EYE_X_M) + _ray(shot.right, EYE_X_M)
    mean = [(a + b) / 2 for a, b in zip(shot.left, shot.right, strict=True)]
    if shot.left_seen != shot.right_seen:
        mean = list(shot.left if shot.left_seen else shot.right)
    length = sum(v * v for v in mean) ** 0.5
    rays += _ray((mean[0] / length, mean[1] / length, mean[2] / length), 0.0)
    states = [
        SEEN_AND_TRACKED if seen else NOT_TRACKED for seen in (shot.left_seen, shot.right_seen)
    ]
    tracker = TRACKER_ON if any(states) else TRACKER_OFF
    rest = REST.pack(1.0, 1.0, shot.t_device_ns, *states, tracker, shot.number, 0.0, 0.0)
    pupils = [shot.pupil_mm if state else 0.0 for state in states]
    measured = MEASURED.pack(
        shot.number,
        shot.t_device_ns,
        EYES_APART_MM,
        *(pupil / IRIS_MM for pupil in pupils),
        *pupils,
        IRIS_MM,
        IRIS_MM,
        shot.openness_01,
        shot.openness_01,
    )
    return rays + rest + measured


def _ray(ray: tuple[float, ...], x_m: float) -> bytes:
    x, y, z = ray
    return RAY.pack(x_m, 0.0, 0.0, x, y, -z)
