"""Turn Neon's gaze payloads into samples; pure, never raises on bad bytes.

Source: pupil-labs-realtime-api 1.9. Only the length of a payload tells its kind. Points
are scene-camera pixels, origin top left; eye positions and axes are in that camera's frame (x
right, y down, z forward), millimetres; pupils are diameters in mm, lids apertures in mm.
"""

import math
import struct
from dataclasses import dataclass

import numpy as np

from visavis.devices.drivers.streaming.gaze_rays import (
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
    unit_triple,
)
from visavis.devices.drivers.streaming.screen import NAN, Triple

STAMP = struct.Struct("<qH")
"""Before each payload: phone's Unix time in ns and the RTP packet's 16-bit number."""

MONO = struct.Struct("!ffB")
LAYOUTS = {
    9: "",
    17: "dual",
    25: "point dual",
    65: "point state",
    89: "point state lids",
    105: "point state lids dual",
}
"""Length of a payload -> what it holds beyond x, y and worn."""

WORN_CODE = 255
CLOSED_BELOW_MM = 1.0
"""A lid aperture below this counts as a closed eye; a choice of this driver."""

UNDISTORT_STEPS = 8
CALIBRATION_AT = struct.Struct("<B6s9d8d")
"""The beginning of a module's calibration: version, serial, scene camera matrix, distortion."""

Floats = tuple[float, ...]


@dataclass(frozen=True)
class SceneCamera:
    """A camera's focal lengths and centre (pixels), distortion (OpenCV's 8), and its pitch.

    `pitch_deg` is how far the camera looks up from the head's −z.
    """

    fx: float = 891.0
    fy: float = 891.0
    cx: float = 800.0
    cy: float = 600.0
    distortion: Floats = (0.0,) * 8
    pitch_deg: float = 0.0

    def ray(self, x: float, y: float) -> Triple:
        """Return the head-frame direction of a pixel; NaN for a missing one."""
        if not (abs(x) < 1e5 and abs(y) < 1e5):
            return NO_VECTOR
        u, v = self._undistort((x - self.cx) / self.fx, (y - self.cy) / self.fy)
        return self.to_head_direction(u, v, 1.0)

    def to_head_direction(self, x: float, y: float, z: float) -> Triple:
        """Return a camera-frame direction in the head frame, as a unit vector."""
        return unit_triple(*self.to_head_vector(x, y, z))

    def to_head_vector(self, x: float, y: float, z: float) -> Triple:
        """Return a camera-frame vector in the head frame."""
        c, s = math.cos(math.radians(self.pitch_deg)), math.sin(math.radians(self.pitch_deg))
        up, back = -y, -z
        return x, c * up - s * back, s * up + c * back

    def _undistort(self, u: float, v: float) -> tuple[float, float]:
        if not any(self.distortion):
            return u, v
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        x, y = u, v
        for _ in range(UNDISTORT_STEPS):
            r2 = min(x * x + y * y, 25.0)
            above = 1 + ((k6 * r2 + k5) * r2 + k4) * r2
            below = 1 + ((k3 * r2 + k2) * r2 + k1) * r2
            share = above / below if abs(below) > 1e-6 else 1.0
            x, y = (
                (u - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) * share,
                (v - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) * share,
            )
            if not (abs(x) < 1e3 and abs(y) < 1e3):
                return u, v
        return x, y


def decode_calibration(raw: bytes, pitch_deg: float) -> tuple[SceneCamera, str] | None:
    """Return the scene camera of a module's calibration and its serial; None when malformed."""
    if len(raw) < CALIBRATION_AT.size:
        return None
    _, serial, *numbers = CALIBRATION_AT.unpack_from(raw)
    matrix, distortion = numbers[:9], tuple(numbers[9:])
    fx, fy, cx, cy = matrix[0], matrix[4], matrix[2], matrix[5]
    if not (all(map(math.isfinite, numbers)) and 10 < fx < 1e5 and 10 < fy < 1e5):
        return None
    name = serial.rstrip(b"\0").decode("ascii", "replace")
    return SceneCamera(fx, fy, cx, cy, distortion, pitch_deg), name


def decode_gaze(stamp_ns: int, counter: int, payload: bytes, camera: SceneCamera) -> Sample | None:
    """Return the sample of a payload; None for an unknown length."""
    parts = LAYOUTS.get(len(payload))
    if parts is None:
        return None
    x, y, worn_code = MONO.unpack_from(payload)
    floats: Floats = struct.unpack_from(f"!{(len(payload) - 9) // 4}f", payload, 9)
    left_px = right_px = (NAN, NAN)
    state: Floats = ()
    lids: Floats = ()
    if "state" in parts:
        state, floats = floats[:14], floats[14:]
    if "lids" in parts:
        lids, floats = floats[:6], floats[6:]
    if parts == "dual":
        left_px, right_px = (x, y), (floats[0], floats[1])
    elif "dual" in parts:
        left_px, right_px = (floats[0], floats[1]), (floats[2], floats[3])
    is_worn = worn_code == WORN_CODE
    left = _eye(left_px, state[:7], lids[:3], camera, is_worn)
    right = _eye(right_px, state[7:], lids[3:], camera, is_worn)
    if parts == "dual":
        return Sample(stamp_ns, counter, gaze_row(left, right))
    open_left, open_right = _is_open(lids[:3]), _is_open(lids[3:])
    both = gaze_row(
        left,
        right,
        ray=camera.ray(x, y),
        origin=(0.0, 0.0, 0.0),
        valid=is_worn and (open_left or open_right),
        used_eyes=(open_left | open_right << 1) if is_worn else 0,
    )
    return Sample(stamp_ns, counter, both)


def unwrapped(number: int, last: int | None) -> int:
    """Return a 16-bit packet number without its wraps, near the last one."""
    if last is None:
        return number
    step = (number - last) & 0xFFFF
    return last + (step if step < 0x8000 else step - 0x10000)


def _eye(
    pixel: tuple[float, float], state: Floats, lids: Floats, camera: SceneCamera, is_worn: bool
) -> Eye:
    ray = camera.ray(*pixel)
    at: Triple = (0.0, 0.0, 0.0)
    pupil = NAN
    if state:
        pupil = diameter_mm(state[0])
        if all(map(math.isfinite, state[1:4])):
            mx, my, mz = camera.to_head_vector(*state[1:4])
            at = (mx * 1e-3, my * 1e-3, mz * 1e-3)
    valid = is_worn and ray[0] == ray[0] and _is_open(lids)
    return Eye(ray, at, valid, pupil)


def _is_open(lids: Floats) -> bool:
    return not (len(lids) == 3 and np.isfinite(lids[2]) and lids[2] < CLOSED_BELOW_MM)
