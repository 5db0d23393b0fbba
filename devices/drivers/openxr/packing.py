"""How answers of an OpenXR runtime are packed for the wire and its log."""

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any

import msgpack

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]

VALID, TRACKED, ORIENTATION_TRACKED = 0b0011, 0b1100, 0b0100
"""Flags of a location: both valid, both tracked, orientation tracked."""

LOCATION = struct.Struct("<qqqQ7f")
"""Host ns and XrTime of one instant, XrTime of the sample (0: unknown), location flags, position,
quaternion (x, y, z, w)."""

INSTANT = struct.Struct("<qq")
"""Host ns and XrTime of one instant; what comes before the hands."""

FRAME = struct.Struct("<qqqqQ7f")
"""Host ns and XrTime of one instant, predicted display XrTime, period ns, flags, head pose."""

LATE = struct.Struct("<Q7f")
"""Flags and head pose: predicted once more for a frame that has begun, or tracked at the instant of
a `FRAME`."""


def numbers(pose: Any) -> tuple[float, ...]:
    """Return a pose as position and quaternion (x, y, z, w)."""
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def pose_of(
    flags: int, numbers: Sequence[float], *, fully_tracked: bool
) -> tuple[Triple, Quadruple] | None:
    """Return position and orientation (w, x, y, z) of a located space; None when it is not valid.

    A head must have both tracked. A hand needs only its orientation tracked, because its place may
    be inferred.
    """
    x, y, z, i, j, k, w = numbers
    tracking_flags = TRACKED if fully_tracked else ORIENTATION_TRACKED
    length = math.sqrt(w * w + i * i + j * j + k * k)
    if flags & VALID != VALID or flags & tracking_flags != tracking_flags or not 0.9 < length < 1.1:
        return None
    return (x, y, z), (w / length, i / length, j / length, k / length)


def turn_alone(flags: int, numbers: Sequence[float]) -> Quadruple | None:
    """Return the orientation (w, x, y, z) of a head whose place is inferred; None otherwise."""
    is_inferred = flags & TRACKED == ORIENTATION_TRACKED
    half = pose_of(flags, numbers, fully_tracked=False) if is_inferred else None
    return None if half is None else half[1]


def number(value: Any) -> Any:
    """Return the number of a time, whichever way the package wraps it."""
    return value.value if hasattr(value, "value") else value


def packed_views(views: Iterable[Any]) -> bytes:
    """Return the views, a row per eye: pose, then angles (rad) left, right, down, up."""
    rows = [
        [
            *numbers(v.pose),
            v.fov.angle_left,
            v.fov.angle_right,
            v.fov.angle_down,
            v.fov.angle_up,
        ]
        for v in views
    ]
    payload: bytes = msgpack.packb([[float(x) for x in row] for row in rows])
    return payload
