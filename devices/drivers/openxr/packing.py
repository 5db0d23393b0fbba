"""How answers of an OpenXR runtime are packed for the wire and its log."""

import struct
from collections.abc import Iterable
from typing import Any

import msgpack

LOCATED = struct.Struct("<qqqQ7f")
"""Host ns and XrTime of one instant, XrTime of the sample (0: unknown), location flags, position,
quaternion (x, y, z, w)."""

INSTANT = struct.Struct("<qq")
"""Host ns and XrTime of one instant; what comes before the hands."""

FRAME = struct.Struct("<qqqqQ7f")
"""Host ns and XrTime of one instant, predicted display XrTime, period ns, flags, head pose."""


def numbers(pose: Any) -> tuple[float, ...]:
    """Return a pose as position and quaternion (x, y, z, w)."""
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def number(value: Any) -> Any:
    """Return the number of a time, whichever way the package wraps it."""
    return value.value if hasattr(value, "value") else value


def packed_views(views: Iterable[Any]) -> bytes:
    """Return what the eyes see: pose, then angles (rad) left, right, down, up, row by row."""
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
    packed: bytes = msgpack.packb([[float(x) for x in row] for row in rows])
    return packed
