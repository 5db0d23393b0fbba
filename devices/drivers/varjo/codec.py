"""Turn Varjo's `varjo_Gaze` and `varjo_EyeMeasurements` into gaze samples; pure, never raises.

Source: the vendor's headers Varjo_types.h (2019-2023, of native SDK 4) and Varjo.h for members,
types, units and codes; its GazeTracking example; for the axes of gaze its plug-in for Unity, which
calls them left-handed and relative to the head: x right, y up, z forward. So z is negated. Lengths
are metres, pupils diameters in millimetres, stamps nanoseconds of `varjo_GetCurrentTime`.
"""

import math
import struct
from typing import NamedTuple

from visavis.devices.drivers.streaming.gaze_rays import (
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
    unit_triple,
)
from visavis.devices.drivers.streaming.screen import NAN, Triple

GAZE = struct.Struct("<18d2dq4q2d")
"""Left, right and combined ray (origin, forward), focus distance, stability; capture time, states
of both eyes and of the tracker, frame number; sizes of pupils, given up by the vendor."""
MEASUREMENTS = struct.Struct("<2q9f4x")
"""Frame number, capture time; distance between pupils, two ratios of pupil to iris, diameters of
pupils and irises (left, right), openness (left, right)."""
DATUM_BYTES = GAZE.size + MEASUREMENTS.size

INVALID, VISIBLE, COMPENSATED, TRACKED = range(4)
"""States of an eye: not tracked; seen but not reliably; tracked, of less quality; tracked."""
TRACKER_VALID = 2

STATE = struct.Struct("<6i")
"""Gaze allowed, headset connected, calibrating, calibrated, quality of left and right eye."""
QUALITIES = ("no calibration", "low quality", "medium quality", "high quality")
MAX_NS = 2**62


class TrackerState(NamedTuple):
    """What the system says of its eye tracker; qualities are 0 to 3."""

    is_allowed: bool
    is_connected: bool
    is_calibrating: bool
    is_calibrated: bool
    left_quality: int
    right_quality: int

    @property
    def quality_text(self) -> str:
        """The worse eye's quality in words."""
        worse = min(self.left_quality, self.right_quality)
        return QUALITIES[worse] if 0 <= worse < len(QUALITIES) else f"quality {worse}"


def decode_state(payload: bytes) -> TrackerState | None:
    """Return the tracker's state; None when the bytes are malformed."""
    if len(payload) != STATE.size:
        return None
    allowed, connected, calibrating, calibrated, left, right = STATE.unpack(payload)
    flags = bool(allowed), bool(connected), bool(calibrating), bool(calibrated)
    return TrackerState(*flags, left, right)


def decode_datum(payload: bytes) -> Sample | None:
    """Return a sample with the openness of both eyes.

    None when the bytes are malformed, also when gaze and measurements are not of one frame: a
    library of another version puts its members elsewhere.
    """
    if len(payload) != DATUM_BYTES:
        return None
    v = GAZE.unpack_from(payload)
    m = MEASUREMENTS.unpack_from(payload, GAZE.size)
    captured_ns, left_state, right_state, state, frame = v[20:25]
    if (frame, captured_ns) != (m[0], m[1]) or not 0 <= frame < MAX_NS:
        return None
    if not 0 <= captured_ns < MAX_NS:
        return None
    eyes = (
        _eye(v[0:6], left_state, m[5], is_on=state == TRACKER_VALID),
        _eye(v[6:12], right_state, m[6], is_on=state == TRACKER_VALID),
    )
    ray, at = _ray(v[12:18])
    has_both = state == TRACKER_VALID and ray[0] == ray[0]
    row = gaze_row(*eyes, ray=ray if has_both else None, origin=at if has_both else None)
    return Sample(captured_ns, frame, row, (_openness(m[9]), _openness(m[10])))


def _eye(v: tuple[float, ...], state: int, pupil_mm: float, *, is_on: bool) -> Eye:
    has_gaze = is_on and VISIBLE <= state <= TRACKED
    ray, at = _ray(v) if has_gaze else (NO_VECTOR, NO_VECTOR)
    valid = state >= COMPENSATED and ray[0] == ray[0]
    return Eye(ray, at, valid, diameter_mm(pupil_mm) if has_gaze else NAN)


def _ray(v: tuple[float, ...]) -> tuple[Triple, Triple]:
    at = (v[0], v[1], -v[2]) if all(map(math.isfinite, v[:3])) else NO_VECTOR
    return unit_triple(v[3], v[4], -v[5]), at


def _openness(openness_01: float) -> float:
    return openness_01 if 0 <= openness_01 <= 1 else NAN
