"""Turn SRanipal's `EyeData_v2` into gaze samples; pure, never raises on bad bytes.

Sources: the vendor's public header SRanipal_EyeDataType.h (structures, bits of validity, units),
and public clients for the axes: right-handed, x left, y up, z forward, seen by the wearer. So x
and z are negated. Lengths are millimetres, pupils diameters, stamps the tracker's milliseconds.
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
from visavis.lab.clock import NS_PER_MS

EYE = "Q3f3fff2f"
EYE_DATA = struct.Struct(f"<?3xii4x{EYE}{EYE}{EYE}?3xfi10i4x6f")
"""no_user, frame, ms; left, right and combined eye, each validity, origin, direction, pupil,
openness, place on the sensor; convergence; advice on tracking; three expressions per eye."""
EYE_VALUES = 11
ORIGIN, DIRECTION, PUPIL, OPENNESS = 1, 2, 4, 8
"""Bits of an eye's validity."""


class EyeFrame(NamedTuple):
    """One frame: gaze with the openness of both eyes (NaN if unknown), and if it is worn."""

    sample: Sample
    is_worn: bool


def decode_eye_data(payload: bytes) -> EyeFrame | None:
    """Return a frame; None when the bytes are malformed."""
    if len(payload) != EYE_DATA.size:
        return None
    no_user, frame, stamp_ms, *values = EYE_DATA.unpack(payload)
    if frame < 0 or stamp_ms < 0:
        return None
    left, right, both = (values[i * EYE_VALUES : (i + 1) * EYE_VALUES] for i in range(3))
    eyes = _eye(left), _eye(right)
    middle = _eye(both)
    row = gaze_row(
        *eyes,
        ray=middle.ray if middle.valid else None,
        origin=middle.at if middle.valid else None,
    )
    openness = _openness(left), _openness(right)
    return EyeFrame(Sample(stamp_ms * NS_PER_MS, frame, row, openness), not no_user)


def _eye(v: list[float]) -> Eye:
    valid = int(v[0])
    ray: Triple = unit_triple(-v[4], v[5], -v[6]) if valid & DIRECTION else NO_VECTOR
    at: Triple = NO_VECTOR
    if valid & ORIGIN and all(map(math.isfinite, v[1:4])):
        at = (-v[1] * 1e-3, v[2] * 1e-3, -v[3] * 1e-3)
    pupil_mm = diameter_mm(v[7]) if valid & PUPIL else NAN
    return Eye(ray, at, ray[0] == ray[0], pupil_mm)


def _openness(v: list[float]) -> float:
    return v[8] if int(v[0]) & OPENNESS and 0 <= v[8] <= 1 else NAN
