"""Read eye trackers of HID usage page 0x12: the report descriptor first, then its reports; pure.

Sources: USB-IF's HID usage tables (review request 74) and Microsoft's MIT-licensed driver and
shims for it. Positions are 32-bit micrometres from the calibrated screen's top left (x right, y
down, z toward the viewer); the largest value means unavailable. Never raises on bad bytes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from visavis.devices.drivers.streaming.gaze_rays import NO_EYE, NO_VECTOR, gaze_row, ray_between
from visavis.devices.drivers.streaming.screen import Screen, Triple

USAGE_PAGE = 0x12
EYE_TRACKER = 0x01
TRACKING, CONFIGURATION, STATUS, CONTROL = 0x10, 0x12, 0x13, 0x14
TIMESTAMP, X, Y, Z = 0x20, 0x21, 0x22, 0x23
GAZE_POINT, LEFT_EYE, RIGHT_EYE = 0x24, 0x25, 0x26
SCREEN_WIDTH, SCREEN_HEIGHT = 0x204, 0x205
SAMPLING_FREQUENCY, CONFIGURATION_STATUS, MODE_REQUEST = 0x300, 0x301, 0x400
INPUT, FEATURE = "input", "feature"
UNAVAILABLE = 2**31 - 1
READY = 1
STATUS_TEXTS = {
    2: "the tracker is being configured",
    3: "the tracker's screen is not set up",
    4: "the tracker needs its user calibrated",
}
MAX_BITS = 8 * 4096

_INPUT_ITEM, _FEATURE_ITEM, _OUTPUT_ITEM = 0x80, 0xB0, 0x90
_COLLECTION, _END_COLLECTION = 0xA0, 0xC0
_USAGE_PAGE, _REPORT_SIZE, _REPORT_ID, _REPORT_COUNT = 0x04, 0x74, 0x84, 0x94
_USAGE, _USAGE_MIN, _USAGE_MAX = 0x08, 0x18, 0x28


@dataclass(frozen=True)
class Place:
    """Where a value lies in a report: bytes from its beginning, the report's number included."""

    at: int
    size: int


@dataclass(frozen=True)
class ReportLayout:
    """A report's size in bytes, its number included, and its values by collection and usage."""

    size: int
    places: Mapping[tuple[int, int], Place]


@dataclass(frozen=True)
class TrackingLayout:
    """Where a tracking report holds time, gaze point and eyes; None for what it lacks."""

    size: int
    timestamp: Place
    gaze: tuple[Place, Place]
    left: tuple[Place, Place, Place] | None
    right: tuple[Place, Place, Place] | None


def walk_descriptor(raw: bytes) -> dict[tuple[str, int], ReportLayout]:
    """Return the layouts of usage page 0x12 by kind and report number; {} if it is malformed.

    A field of 8-bit items with a single usage is one value made of all its bytes.
    """
    at = 0
    page = size = count = number = 0
    usages: list[int] = []
    usage_min = 0
    collections: list[int] = []
    bits: dict[tuple[str, int], int] = {}
    field_places: dict[tuple[str, int], dict[tuple[int, int], Place]] = {}
    while at < len(raw):
        head = raw[at]
        length = (0, 1, 2, 4)[head & 3]
        data = int.from_bytes(raw[at + 1 : at + 1 + length], "little")
        at += 1 + length
        if at > len(raw) or head == 0xFE:
            return {}
        item = head & 0xFC
        if item == _USAGE_PAGE:
            page = data
        elif item == _REPORT_SIZE:
            size = data
        elif item == _REPORT_COUNT:
            count = data
        elif item == _REPORT_ID:
            number = data
        elif item == _USAGE:
            usages.append(data & 0xFFFF)
        elif item == _USAGE_MIN:
            usage_min = data & 0xFFFF
        elif item == _USAGE_MAX:
            usages += range(usage_min, min(data & 0xFFFF, usage_min + 255) + 1)
        elif item == _COLLECTION:
            collections.append(usages[-1] if usages and page == USAGE_PAGE else 0)
            usages = []
        elif item == _END_COLLECTION:
            if collections:
                collections.pop()
            usages = []
        elif item in (_INPUT_ITEM, _FEATURE_ITEM, _OUTPUT_ITEM):
            kind = {_INPUT_ITEM: INPUT, _FEATURE_ITEM: FEATURE}.get(item, "output")
            start = bits.setdefault((kind, number), 8)
            if size * count > MAX_BITS or start + size * count > MAX_BITS:
                return {}
            if not data & 1 and page == USAGE_PAGE:
                places = field_places.setdefault((kind, number), {})
                _place(places, collections[-1] if collections else 0, usages, start, size, count)
            bits[kind, number] = start + size * count
            usages = []
    return {
        key: ReportLayout((end + 7) // 8, field_places.get(key, {}))
        for key, end in bits.items()
        if key[0] in (INPUT, FEATURE)
    }


def tracking_layout(reports: Mapping[tuple[str, int], ReportLayout]) -> TrackingLayout | None:
    """Return the layout of the report with time and gaze point; None without one."""
    for (kind, _), report in reports.items():
        places = report.places
        stamp = next((p for (_, usage), p in places.items() if usage == TIMESTAMP), None)
        gaze = _triple(places, GAZE_POINT, (X, Y))
        if kind == INPUT and stamp is not None and gaze is not None:
            left = _triple(places, LEFT_EYE, (X, Y, Z))
            right = _triple(places, RIGHT_EYE, (X, Y, Z))
            return TrackingLayout(
                report.size,
                stamp,
                (gaze[0], gaze[1]),
                None if left is None else (left[0], left[1], left[2]),
                None if right is None else (right[0], right[1], right[2]),
            )
    return None


def feature_value(raw: bytes, layout: ReportLayout | None, usage: int) -> int | None:
    """Return an unsigned value of a feature report; None when it is not there."""
    if layout is None or len(raw) < layout.size:
        return None
    place = next((p for (_, place_usage), p in layout.places.items() if place_usage == usage), None)
    return (
        None if place is None else int.from_bytes(raw[place.at : place.at + place.size], "little")
    )


def decode_report(
    raw: bytes, layout: TrackingLayout, screen: Screen, eye_distance_mm: float
) -> tuple[int, bytes] | None:
    """Return time stamp (ticks) and a row; None when the size is not the report's.

    One gaze point serves both eyes, so there is one ray, which starts between the tracked eyes;
    per-eye directions are missing.
    """
    if len(raw) != layout.size:
        return None
    ticks = _unsigned_int(raw, layout.timestamp)
    eyes = [
        None if places is None else _eye_m(raw, places, screen)
        for places in (layout.left, layout.right)
    ]
    half_m = eye_distance_mm * 5e-4
    eye_places = [at for at in eyes if at is not None]
    used_eyes = (1 if eyes[0] is not None else 0) | (2 if eyes[1] is not None else 0)
    if len(eye_places) == 2:
        origin = tuple((a + b) / 2 for a, b in zip(*eye_places, strict=True))
    elif eyes[0] is not None:
        origin = (eyes[0][0] + half_m, *eyes[0][1:])
    elif eyes[1] is not None:
        origin = (eyes[1][0] - half_m, *eyes[1][1:])
    else:
        origin = (0.0, 0.0, 0.0)
    gx, gy = (_signed_int(raw, place) for place in layout.gaze)
    ray: Triple = NO_VECTOR
    if gx != UNAVAILABLE and gy != UNAVAILABLE:
        x, y, z = origin
        ray = ray_between((x, y, z), screen.from_top_left_m(gx * 1e-6, gy * 1e-6))
    has_gaze = ray[0] == ray[0]
    blind = layout.left is None and layout.right is None
    row = gaze_row(
        NO_EYE,
        NO_EYE,
        ray=ray,
        origin=(origin[0], origin[1], origin[2]),
        valid=has_gaze and (used_eyes > 0 or blind),
        used_eyes=3 if has_gaze and blind else used_eyes if has_gaze else 0,
    )
    return ticks, row


def unit_from_rate(steps: list[int], rate_hz: float) -> float:
    """Return microseconds per tick: the power of ten that fits the median step best."""
    rising = sorted(step for step in steps if step > 0)
    if not rising:
        return 1.0
    period_us = 1e6 / rate_hz
    median = rising[len(rising) // 2]
    units = (0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
    return min(units, key=lambda unit: abs(median * unit - period_us))


def _place(
    places: dict[tuple[int, int], Place],
    collection: int,
    usages: list[int],
    start: int,
    size: int,
    count: int,
) -> None:
    if start % 8 or size % 8 or not usages or not size:
        return
    if len(usages) == 1 and count > 1:
        places.setdefault((collection, usages[0]), Place(start // 8, size * count // 8))
        return
    for i in range(min(count, len(usages))):
        places.setdefault((collection, usages[i]), Place((start + i * size) // 8, size // 8))


def _triple(
    places: Mapping[tuple[int, int], Place], collection: int, axes: tuple[int, ...]
) -> tuple[Place, ...] | None:
    candidates = [places.get((collection, axis)) for axis in axes]
    axis_places = tuple(place for place in candidates if place is not None and place.size == 4)
    return axis_places if len(axis_places) == len(axes) else None


def _eye_m(raw: bytes, places: tuple[Place, Place, Place], screen: Screen) -> Triple | None:
    x, y, z = (_signed_int(raw, place) for place in places)
    if UNAVAILABLE in (x, y, z):
        return None
    return screen.from_top_left_m(x * 1e-6, y * 1e-6, z * 1e-6)


def _signed_int(raw: bytes, place: Place) -> int:
    return int.from_bytes(raw[place.at : place.at + place.size], "little", signed=True)


def _unsigned_int(raw: bytes, place: Place) -> int:
    return int.from_bytes(raw[place.at : place.at + place.size], "little")
