"""Turn what FoveClient's getters return into gaze samples; pure, never raises on bad bytes.

Source: the vendor's FoveAPI.h of FOVE SDK 1 for names, types, codes and units. Straight ahead is
(0, 0, 1) there, so its frame is taken as left-handed, y up; z is negated. Lengths are metres and
pupils radii. The signs still wait for a real unit.
"""

import math
import struct
from collections.abc import Mapping

from visavis.devices.drivers.streaming.gaze_rays import (
    NO_VECTOR,
    Eye,
    Sample,
    gaze_row,
    unit_triple,
)
from visavis.devices.drivers.streaming.screen import NAN, Triple

EYE_FRAME = struct.Struct("<QQ" + 2 * "i3fiiif" + "i3f3f")
"""One fetched eye frame: id, µs; per eye (left, right) code and vector, code and state, code and
radius; code, origin and direction of the combined ray."""

OK, NOT_CONNECTED, NOT_REGISTERED, TIMED_OUT = 0, 7, 104, 130
RUNTIME_TOO_OLD, CLIENT_TOO_OLD = 4, 6
NO_UPDATE, UNCALIBRATED, UNRELIABLE, LOW_ACCURACY, HARDWARE_GONE = 1003, 1004, 1006, 1007, 2006
VALUE_COMES_WITH = frozenset({OK, UNRELIABLE, LOW_ACCURACY})
"""Codes with which a value is filled in. The header calls data of a tracker that is not calibrated
invalid, so they are missing."""
VALID_WITH = frozenset({OK, LOW_ACCURACY})
DISCONNECTED_WITH = frozenset({NOT_CONNECTED, HARDWARE_GONE})

EYE_OPEN = 1

ERROR_TEXTS: Mapping[int, str] = {
    RUNTIME_TOO_OLD: "the FOVE runtime is too old for this FoveClient library",
    CLIENT_TOO_OLD: "this FoveClient library is too old for the FOVE runtime",
    NOT_CONNECTED: "the FOVE runtime service does not answer",
    NOT_REGISTERED: "a needed capability was not registered",
    TIMED_OUT: "no eye frame came in time",
    NO_UPDATE: "the runtime has no eye data yet",
    UNCALIBRATED: "the eye tracker is not calibrated",
    UNRELIABLE: "the runtime has lost the eyes and calls its data unreliable",
    LOW_ACCURACY: "the runtime calls its data of low accuracy",
    HARDWARE_GONE: "the headset is not connected to this computer",
    12000: "this feature needs a FOVE licence",
}

CALIBRATION_STATES = (
    "not started",
    "adjust the headset",
    "waiting for the wearer",
    "collecting",
    "processing",
    "succeeded, high quality",
    "succeeded, medium quality",
    "succeeded, low quality",
)
SUCCESS_STATES = frozenset({5, 6, 7})
FIRST_FAILED = 8


def error_text(code: int) -> str:
    """Name an error code."""
    return f"{ERROR_TEXTS.get(code, 'an error that this driver does not know')} (code {code})"


def calibration_text(state: int) -> str:
    """Name a calibration state."""
    if 0 <= state < len(CALIBRATION_STATES):
        return CALIBRATION_STATES[state]
    return f"failed (state {state})"


def decode_eye_frame(payload: bytes, eye_distance_m: float) -> tuple[Sample, frozenset[int]] | None:
    """Return a sample and the codes that came with it; None when malformed."""
    if len(payload) != EYE_FRAME.size:
        return None
    v = EYE_FRAME.unpack(payload)
    frame_id, stamp_us = v[0], v[1]
    if frame_id >= 2**63 or stamp_us >= 2**63 // 1000:
        return None
    left = _eye(v[2:10], -eye_distance_m / 2)
    right = _eye(v[10:18], eye_distance_m / 2)
    code = v[18]
    ray: Triple | None = None
    origin: Triple | None = None
    valid: bool | None = None
    if code in VALUE_COMES_WITH:
        ray = unit_triple(v[22], v[23], -v[24])
        origin = (v[19], v[20], -v[21]) if all(map(math.isfinite, v[19:22])) else NO_VECTOR
        valid = code in VALID_WITH and (left.valid or right.valid)
        if ray[0] != ray[0]:
            ray = origin = valid = None
    row = gaze_row(left, right, ray=ray, origin=origin, valid=valid)
    codes = frozenset({v[2], v[6], v[8], v[10], v[14], v[16], code} - {OK})
    return Sample(stamp_us * 1000, frame_id, row), codes


def _eye(v: tuple[float, ...], x_m: float) -> Eye:
    code, x, y, z, state_code, state, radius_code, radius_m = v
    has_gaze = code in VALUE_COMES_WITH and state_code in VALUE_COMES_WITH and state != 0
    ray = unit_triple(x, y, -z) if has_gaze else NO_VECTOR
    valid = code in VALID_WITH and state == EYE_OPEN and ray[0] == ray[0]
    has_pupil = radius_code in VALUE_COMES_WITH and 0.0 < radius_m < 0.01
    return Eye(ray, (x_m, 0.0, 0.0), valid, 2e3 * radius_m if has_pupil else NAN)
