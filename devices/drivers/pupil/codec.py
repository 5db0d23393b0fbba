"""Translate between Pupil Capture's messages and gaze samples; pure, never raises on bad bytes.

Sources: Pupil Labs' developer notes on network API and gaze data, and the conventions of its
public clients. 3-D fields are in millimetres in the scene camera's frame (x right, y down, z
forward; after an HMD calibration its origin lies between the eyes); eye 0 is the right eye.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import msgpack

from visavis.devices.contracts import GAZE
from visavis.devices.drivers.streaming.gaze_rays import diameter_mm
from visavis.devices.plausible import is_place
from visavis.lab.geometry import Vector

GAZE_TOPIC = b"gaze.3d."
NOTIFY_TOPIC = b"notify."
CONFIDENCE_THRESHOLD_01 = 0.6
"""Samples below this should be discarded, by the vendor's notes on data quality."""

_SCALAR_CODES = {"f4": "f", "f8": "d", "?": "?", "u1": "B", "u2": "H", "i8": "q"}
_ROW = struct.Struct(
    "<" + "".join(_SCALAR_CODES[f.dtype] * math.prod(f.shape) for f in GAZE.fields)
)
_MALFORMED = (ValueError, TypeError, KeyError, IndexError, OverflowError, struct.error)
_NAN = math.nan
_NO_VECTOR = (_NAN, _NAN, _NAN)
_EYE_0_KEYS: tuple[Any, ...] = (b"0", 0)
_EYE_1_KEYS: tuple[Any, ...] = (b"1", 1)

Triple = tuple[float, float, float]


def decode_gaze(payload: bytes, threshold_01: float) -> tuple[int, bytes] | None:
    """Return device time (ns) and one packed row of `GAZE.dtype`; None when malformed.

    `gaze_rays.rows_to_values` reads joined rows. An eye is valid when its own confidence
    reaches the threshold; the combined ray is the mean of the valid eyes' lines, or of both
    (flagged invalid) when neither is.
    """
    try:
        datum = msgpack.unpackb(payload, raw=True, strict_map_key=False)
        stamp_ns = round(datum[b"timestamp"] * 1e9)
        if not -(2**63) <= stamp_ns < 2**63:
            return None
        # Confidence and pupil of each eye, then its ray; eye 0 is the right one.
        confidence = float(datum[b"confidence"])
        left_sure = right_sure = 0.0
        left_mm = right_mm = _NAN
        for pupil in datum.get(b"base_data", ()):
            diameter = pupil.get(b"diameter_3d")
            if pupil[b"id"] == 0:
                right_sure = pupil[b"confidence"]
                right_mm = _NAN if diameter is None else diameter_mm(diameter)
            else:
                left_sure = pupil[b"confidence"]
                left_mm = _NAN if diameter is None else diameter_mm(diameter)
        normals = datum.get(b"gaze_normals_3d")
        if normals is not None:
            centers = datum[b"eye_centers_3d"]
            right, right_at = _of_eye(normals, centers, _EYE_0_KEYS)
            left, left_at = _of_eye(normals, centers, _EYE_1_KEYS)
        else:
            direction = _direction(datum[b"gaze_normal_3d"])
            at = _position(datum[b"eye_center_3d"])
            right = left = right_at = left_at = _NO_VECTOR
            if _single_eye(datum) == 0:
                right, right_at = direction, at
            else:
                left, left_at = direction, at
        # NaN is not equal to itself, so these ask whether an eye has a ray.
        left_seen, right_seen = left[0] == left[0], right[0] == right[0]
        left_valid = left_seen and left_sure >= threshold_01
        right_valid = right_seen and right_sure >= threshold_01
        # Combine the valid eyes, or both if neither is valid.
        if left_valid == right_valid and left_seen and right_seen:
            lx, ly, lz = left
            rx, ry, rz = right
            x, y, z = lx + rx, ly + ry, lz + rz
            length = math.sqrt(x * x + y * y + z * z)
            ray = (x / length, y / length, z / length) if length > 1e-6 else _NO_VECTOR
            ax, ay, az = left_at
            bx, by, bz = right_at
            at, used_eyes = ((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2), 3
        elif left_valid or (left_seen and not right_valid):
            ray, at, used_eyes = left, left_at, 1
        elif right_seen:
            ray, at, used_eyes = right, right_at, 2
        else:
            ray, at, used_eyes = _NO_VECTOR, _NO_VECTOR, 0
        valid = confidence >= threshold_01 and (left_valid or right_valid) and ray[0] == ray[0]
        if at[0] == at[0] and not is_place(*at):
            at, valid = _NO_VECTOR, False
        row = _ROW.pack(
            *ray,
            *at,
            valid,
            used_eyes,
            confidence,
            *left,
            left_valid,
            left_mm,
            *right,
            right_valid,
            right_mm,
        )
    except _MALFORMED:
        return None
    except msgpack.UnpackException:
        return None
    except AttributeError:  # a list or number where a map belongs
        return None
    return stamp_ns, row


def decode_notification(payload: bytes) -> Mapping[str, Any] | None:
    """Return a notification's fields; None when malformed."""
    try:
        notification = msgpack.unpackb(payload, strict_map_key=False)
    except (*_MALFORMED, msgpack.UnpackException):
        return None
    if not isinstance(notification, dict) or not isinstance(notification.get("subject"), str):
        return None
    return notification


def encode_notification(subject: str, **fields: Any) -> tuple[bytes, bytes]:
    """Return the two frames of a notification."""
    payload: bytes = msgpack.packb({"subject": subject, **fields}, use_bin_type=True)
    return f"notify.{subject}".encode(), payload


def encode_annotation(text: str, device_ns: int) -> tuple[bytes, bytes]:
    """Return the two frames of an annotation of no duration at a device time."""
    annotation = {
        "topic": "annotation",
        "label": text,
        "timestamp": device_ns / 1e9,
        "duration": 0.0,
    }
    payload: bytes = msgpack.packb(annotation, use_bin_type=True)
    return b"annotation", payload


def encode_reference(direction_head: Vector, device_ns: int, distance_m: float) -> dict[str, Any]:
    """Return one calibration target: a direction in the head frame, in mm, y up and z forward.

    Capture flips y by itself: this is its only field that is not in the camera's frame.
    """
    x, y, z = (float(v) * distance_m * 1e3 for v in direction_head)
    return {"mm_pos": [x, y, -z], "timestamp": device_ns / 1e9}


def decode_time(frames: Sequence[bytes]) -> int | None:
    """Return the device time (ns) in an answer to `t`; None if it is not a finite number."""
    try:
        seconds = float(frames[0])
    except (ValueError, IndexError):
        return None
    return round(seconds * 1e9) if math.isfinite(seconds) and abs(seconds) < 9e9 else None


def decode_version(text: str) -> tuple[int, ...] | None:
    """Return the leading numbers of a version such as "v3.5.1"; None when there are none."""
    numbers: list[int] = []
    for part in text.strip().lstrip("v").split("."):
        digits = part[: len(part) - len(part.lstrip("0123456789"))]
        if not digits:
            break
        numbers.append(int(digits))
    return tuple(numbers) or None


def _of_eye(normals: Any, centers: Any, keys: tuple[Any, ...]) -> tuple[Triple, Triple]:
    text_key, number_key = keys
    normal = normals.get(text_key)
    if normal is not None:
        return _direction(normal), _position(centers[text_key])
    normal = normals.get(number_key)
    if normal is not None:
        return _direction(normal), _position(centers[number_key])
    return _NO_VECTOR, _NO_VECTOR


def _direction(camera: Any) -> Triple:
    """Turn a camera-frame direction into a unit vector in the head frame; NaN for none."""
    x, y, z = camera
    length = math.sqrt(x * x + y * y + z * z)
    if not 1e-6 < length < math.inf:
        return _NO_VECTOR
    return x / length, -y / length, -z / length


def _position(camera_mm: Any) -> Triple:
    x, y, z = camera_mm
    return x * 1e-3, y * -1e-3, z * -1e-3


def _single_eye(datum: Mapping[bytes, Any]) -> int:
    topic = datum.get(b"topic", b"")
    if topic.endswith((b".0.", b".1.")):
        return int(topic[-2:-1])
    return int(datum[b"base_data"][0][b"id"])
