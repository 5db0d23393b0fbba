"""Read and write the Open Gaze API's XML lines; pure, any chunking, never raises on bad bytes.

Source: "Open Gaze API by Gazepoint", revised March 11, 2025 (TCP 4242). Points of gaze are
shares of the screen from its top left; eye positions are metres from the camera (x right, y up, z
toward the viewer; the axes still wait for a real unit); `LPUPILD` is metres, `LPD` image pixels.
"""

import math
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple
from xml.sax.saxutils import escape, unescape

from visavis.devices.drivers.streaming.gaze_rays import (
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
    ray_between,
)
from visavis.devices.drivers.streaming.screen import NAN, Screen, Triple
from visavis.devices.plausible import TICKS_PER_S

MAX_LINE = 65_536
STREAMS = (
    "COUNTER",
    "TIME",
    "TIME_TICK",
    "POG_LEFT",
    "POG_RIGHT",
    "POG_BEST",
    "EYE_LEFT",
    "EYE_RIGHT",
    "USER_DATA",
    "DATA",
)
"""The streams to enable; `DATA` is last because it starts them."""

_TAG = re.compile(r"<(REC|ACK|NACK|CAL|UPDATE)\b([^<>]*?)/?>")
_ATTRIBUTE = re.compile(r'([A-Za-z_][A-Za-z0-9_]*)="([^"]*)"')
_QUOTES = {'"': "&quot;"}
_UNQUOTES = {"&quot;": '"', "&apos;": "'"}

Attributes = Mapping[str, str]


class Line(NamedTuple):
    """One tag: REC, ACK, NACK, CAL or UPDATE, with its attributes."""

    tag: str
    values: Attributes


@dataclass(frozen=True)
class Place:
    """Where the camera is, from the screen's centre (mm), and the eyes' distance (mm)."""

    screen: Screen
    camera_right_mm: float = 0.0
    camera_up_mm: float = -180.0
    camera_toward_mm: float = 0.0
    eye_distance_mm: float = 64.0

    def camera_m(self) -> Triple:
        """Return the camera's place in the head frame of the screen."""
        screen = self.screen
        return (
            (screen.center_right_mm + self.camera_right_mm) * 1e-3,
            (screen.center_up_mm + self.camera_up_mm) * 1e-3,
            (self.camera_toward_mm - screen.distance_mm) * 1e-3,
        )


class LineReader:
    """Cut a byte stream into tags; count lines without one."""

    def __init__(self) -> None:
        self.malformed = 0
        self._rest = b""

    def feed(self, chunk: bytes) -> list[Line]:
        """Return the tags that this chunk completes."""
        *whole, self._rest = (self._rest + chunk).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest = b""
            self.malformed += 1
        lines = []
        for raw in whole:
            line = parse_line(raw)
            if line is not None:
                lines.append(line)
            elif raw.strip():
                self.malformed += 1
        return lines


def parse_line(raw: bytes) -> Line | None:
    """Return a line's tag; None when it holds none or more than one."""
    text = raw.decode("utf-8", "replace").strip()
    match = _TAG.fullmatch(text)
    if match is None:
        return None
    values = dict(_ATTRIBUTE.findall(match[2]))
    if "&" in text:
        values = {key: unescape(value, _UNQUOTES) for key, value in values.items()}
    return Line(match[1], values)


def set_line(name: str, **values: str) -> bytes:
    """Return a SET command."""
    pairs = "".join(f' {key}="{escape(value, _QUOTES)}"' for key, value in values.items())
    return f'<SET ID="{name}"{pairs} />\r\n'.encode()


def get_line(name: str) -> bytes:
    """Return a GET command."""
    return f'<GET ID="{name}" />\r\n'.encode()


def number(values: Attributes, key: str) -> float:
    """Return a number; NaN when it is missing, malformed or infinite."""
    try:
        value = float(values[key])
    except (KeyError, ValueError):
        return NAN
    return value if math.isfinite(value) else NAN


def tick_frequency(text: str) -> float | None:
    """Return the ticks per second in the answer FREQ; None when it is not plausible.

    The vendor's document calls it a long long, and its own example (4704405731611246592) is the bit
    pattern of the double 3330093.0; both ways of writing it are read.
    """
    if not (text.isascii() and text.isdigit() and len(text) <= 20):
        return None
    bits = int(text)
    if TICKS_PER_S.admit(bits):
        return float(bits)
    if bits >= 2**64:
        return None
    (as_double,) = struct.unpack("<d", bits.to_bytes(8, "little"))
    return float(as_double) if TICKS_PER_S.admit(as_double) else None


def device_ns(values: Attributes, ticks_per_s: float) -> int | None:
    """Return the time of a record: its tick count if there is one, else its seconds.

    With `ticks_per_s` 0 ticks are not used.
    """
    tick = values.get("TIME_TICK", "")
    if tick.isascii() and tick.isdigit() and ticks_per_s > 0:
        whole, part = float(ticks_per_s).as_integer_ratio()
        stamp = int(tick[:25]) * 1_000_000_000 * part // whole
        return stamp if stamp < 2**62 else None
    seconds = number(values, "TIME")
    return round(seconds * 1e9) if abs(seconds) < 4e9 else None


def decode_record(values: Attributes, place: Place, ticks_per_s: float) -> Sample | None:
    """Return the sample in a REC line; None when it bears no time."""
    stamp = device_ns(values, ticks_per_s)
    if stamp is None:
        return None
    count = values.get("CNT", "")
    counter = int(count[:18]) if count.isascii() and count.isdigit() else None
    left = _eye(values, "L", -1.0, place)
    right = _eye(values, "R", 1.0, place)
    if left is None and right is None:  # a tracker that sends only its best point
        return Sample(stamp, counter, _best_only(values, place))
    return Sample(stamp, counter, gaze_row(left or Eye(), right or Eye()))


def calibration_errors_deg(values: Attributes, screen: Screen) -> tuple[list[float], int]:
    """Return the error of each eye at each valid point, and the number of points."""
    errors: list[float] = []
    points = 0
    while f"CALX{points + 1}" in values:
        points += 1
        target = screen.point_m(number(values, f"CALX{points}"), number(values, f"CALY{points}"))
        for eye in "LR":
            if values.get(f"{eye}V{points}") != "1":
                continue
            gaze_point = screen.point_m(
                number(values, f"{eye}X{points}"), number(values, f"{eye}Y{points}")
            )
            a, b = ray_between((0.0, 0.0, 0.0), target), ray_between((0.0, 0.0, 0.0), gaze_point)
            chord = math.dist(a, b)
            if chord == chord:
                errors.append(math.degrees(2 * math.asin(min(1.0, chord / 2))))
    return errors, points


def _eye(values: Attributes, eye: str, side: float, place: Place) -> Eye | None:
    if f"{eye}POGX" not in values:
        return None
    at = _eye_place(values, eye, side, place)
    x, y = number(values, f"{eye}POGX"), number(values, f"{eye}POGY")
    is_valid = values.get(f"{eye}POGV") == "1"
    ray = ray_between(at, place.screen.point_m(x, y)) if is_valid else NO_VECTOR
    pupil = number(values, f"{eye}PUPILD") if values.get(f"{eye}PUPILV") != "0" else NAN
    return Eye(ray, at, ray[0] == ray[0], diameter_mm(pupil * 1e3))


def _eye_place(values: Attributes, eye: str, side: float, place: Place) -> Triple:
    x, y, z = (number(values, f"{eye}EYE{axis}") for axis in "XYZ")
    if not 0.05 < z < 5.0 or x != x or y != y:
        return (side * place.eye_distance_mm / 2e3, 0.0, 0.0)
    cx, cy, cz = place.camera_m()
    return cx + x, cy + y, cz + z


def _best_only(values: Attributes, place: Place) -> bytes:
    for prefix in ("BPOG", "FPOG"):
        if f"{prefix}X" in values:
            x, y = number(values, f"{prefix}X"), number(values, f"{prefix}Y")
            is_valid = values.get(f"{prefix}V") == "1"
            origin = (0.0, 0.0, 0.0)
            ray = ray_between(origin, place.screen.point_m(x, y)) if is_valid else NO_VECTOR
            return gaze_row(
                Eye(), Eye(), ray=ray, origin=origin, valid=is_valid, used_eyes=3 if is_valid else 0
            )
    return gaze_row(Eye(), Eye())
