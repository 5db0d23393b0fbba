"""Find gaze among the channels of an LSL stream and turn its numbers into samples; pure.

Sources: the XDF wiki's gaze meta-data (type, eye, unit, coordinate_system of each channel), which
our own outlets follow, and TittaLSL's `Sender::start` and `pushSample` for Tobii trackers
(dcnieho/Titta, src/TittaLSL.cpp; it sends one channel more than it describes). Missing stays NaN;
nothing is interpolated or dejittered.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.etree import ElementTree as ET

from visavis.devices.drivers.streaming.gaze_rays import (
    NO_EYE,
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
    ray_between,
    unit_triple,
)
from visavis.devices.drivers.streaming.screen import NAN, Screen, Triple
from visavis.devices.plausible import SAMPLES_PER_S
from visavis.lab.errors import ProtocolViolation

METRES = {"meters": 1.0, "m": 1.0, "metres": 1.0, "millimeters": 1e-3, "mm": 1e-3}
MILLIMETRES = {"millimeters": 1.0, "mm": 1.0, "meters": 1e3, "m": 1e3}
HEAD = ("head-space", "head")
EYES = ("left", "right", "both")
TITTA_ENDING = ".position_on_display_area.gaze_point.left_eye"

DIRECTION, PLACE, SCREEN, POINT = "direction", "place", "screen", "point"
PUPIL, VALID, CONFIDENCE = "pupil", "valid", "confidence"
PLACE_VALID, PUPIL_VALID = "place valid", "pupil valid"
AXES = {DIRECTION: 3, PLACE: 3, POINT: 3, SCREEN: 2, PUPIL: 1, VALID: 1, CONFIDENCE: 1}
TITTA_LABELS = {
    SCREEN: [f"{axis}.position_on_display_area.gaze_point" for axis in "xy"],
    POINT: [f"{axis}.position_in_user_coordinates.gaze_point" for axis in "xyz"],
    VALID: ["valid.gaze_point"],
    PLACE: [f"{axis}.position_in_user_coordinates.gaze_origin" for axis in "xyz"],
    PLACE_VALID: ["valid.gaze_origin"],
    PUPIL: ["diameter.pupil"],
    PUPIL_VALID: ["valid.pupil"],
}
"""What each means of an eye; `.left_eye` or `.right_eye` follows."""


class StreamInfo(NamedTuple):
    """A stream's description of itself."""

    name: str
    source_id: str
    rate_hz: float
    n_channels: int
    channels: tuple[Mapping[str, str], ...]
    is_text: bool = False


@dataclass(frozen=True)
class GazeLayout:
    """Indices of channels by (eye, what) and a factor to metres, millimetres or shares each."""

    count: int
    places: Mapping[tuple[str, str], tuple[int, ...]]
    factors: Mapping[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)
    states_frame: bool = True

    @property
    def per_eye(self) -> bool:
        """Tell whether there is a ray for either eye."""
        kinds = (DIRECTION, SCREEN, POINT)
        return any((eye, kind) in self.places for eye in ("left", "right") for kind in kinds)

    @property
    def on_screen(self) -> bool:
        """Tell whether gaze is given by points on a screen."""
        return not any(kind == DIRECTION for _, kind in self.places)


def parse_info(xml: bytes) -> StreamInfo | None:
    """Return what a stream's XML says; None when it is no such document."""
    try:
        root = ET.fromstring(xml)  # noqa: S314 - liblsl's own document, no entities of others
        rate_hz = float(root.findtext("nominal_srate") or 0.0)
        count = int(root.findtext("channel_count") or 0)
    except (ET.ParseError, ValueError):
        return None
    rows = tuple(
        {part.tag: (part.text or "").strip() for part in channel}
        for channel in root.findall("./desc/channels/channel")
    )
    texts = (root.findtext("name") or "", root.findtext("source_id") or "")
    is_text = root.findtext("channel_format") == "string"
    return StreamInfo(*texts, rate_hz, count, rows, is_text)


def require_rate(info: StreamInfo) -> None:
    """Raise ProtocolViolation for an implausible nominal rate; 0 is an irregular stream's."""
    if info.rate_hz and not SAMPLES_PER_S.admit(info.rate_hz):
        raise ProtocolViolation(
            SAMPLES_PER_S.sentence(f"the rate of the stream {info.name!r}", info.rate_hz),
            remedy="correct the nominal rate in the program that sends the stream",
        )


def layout_of(info: StreamInfo, screen_px: tuple[int, int] = (1920, 1080)) -> GazeLayout | None:
    """Return the places of gaze among the channels; None when none is named as gaze."""
    labels = [row.get("label", "") for row in info.channels]
    if any(label.endswith(TITTA_ENDING) for label in labels):
        return _titta(labels, info.n_channels)
    return _xdf(info.channels, screen_px) if len(labels) == info.n_channels else None


def decode_sample(raw: bytes, layout: GazeLayout, screen: Screen, half_m: float) -> Sample | None:
    """Return the sample in a stamp (s) and numbers, all doubles; None when malformed."""
    if len(raw) != 8 * (layout.count + 1):
        return None
    stamp_s, *values = struct.unpack(f"<{layout.count + 1}d", raw)
    if not abs(stamp_s) < 4e9:
        return None
    reading = _Reading(values, layout, screen)
    left, right = reading.eye("left", -half_m), reading.eye("right", half_m)
    ray, origin = reading.ray("both", 0.0)
    confidence = reading.one("both", CONFIDENCE)
    validity = reading.one("both", VALID)
    stamp_ns = round(stamp_s * 1e9)
    if ray[0] == ray[0]:
        valid = (
            validity > 0
            if validity == validity
            else (left.valid or right.valid or not layout.per_eye)
        )
        used_eyes = None if left.valid or right.valid else 3 if valid else 0
        row = gaze_row(
            left,
            right,
            ray=ray,
            origin=origin,
            valid=valid,
            used_eyes=used_eyes,
            confidence_01=confidence,
        )
    else:
        row = gaze_row(left, right, confidence_01=confidence)
    return Sample(stamp_ns, None, row)


class _Reading:
    """One sample's numbers, by eye and kind."""

    def __init__(self, values: Sequence[float], layout: GazeLayout, screen: Screen) -> None:
        self._values = values
        self._layout = layout
        self._screen = screen

    def many(self, eye: str, kind: str) -> tuple[float, ...] | None:
        at = self._layout.places.get((eye, kind))
        if at is None:
            return None
        factors = self._layout.factors.get((eye, kind), (1.0,) * len(at))
        numbers = tuple(self._values[i] * f for i, f in zip(at, factors, strict=True))
        return numbers if all(abs(v) < 1e9 for v in numbers) else None

    def one(self, eye: str, kind: str) -> float:
        numbers = self.many(eye, kind)
        return NAN if numbers is None else numbers[0]

    def ray(self, eye: str, x_m: float) -> tuple[Triple, Triple]:
        place = self.many(eye, PLACE) if self.is_set(eye, PLACE_VALID) else None
        screen = self._screen
        at: Triple = (x_m, 0.0, 0.0)
        direction, point = self.many(eye, DIRECTION), self.many(eye, POINT)
        shares = self.many(eye, SCREEN)
        if place is not None and not any(place):
            place = None
        if place is not None:
            at = (place[0], place[1], place[2])
            if self._layout.on_screen:
                at = _on_screen(at, point, shares, screen)
        if direction is not None:
            return unit_triple(*direction), at
        if point is not None and place is not None:
            return ray_between((place[0], place[1], place[2]), (point[0], point[1], point[2])), at
        if shares is not None:
            return ray_between(at, screen.point_m(*shares)), at
        return NO_VECTOR, at

    def is_set(self, eye: str, flag: str) -> bool:
        """Tell whether a flag is set, or not sent."""
        return (eye, flag) not in self._layout.places or self.one(eye, flag) > 0

    def eye(self, eye: str, x_m: float) -> Eye:
        ray, at = self.ray(eye, x_m)
        has_ray = ray[0] == ray[0]
        pupil = diameter_mm(self.one(eye, PUPIL)) if self.is_set(eye, PUPIL_VALID) else NAN
        if not has_ray and pupil != pupil:
            return NO_EYE
        return Eye(ray, at, has_ray and self.is_set(eye, VALID), pupil)


def _on_screen(
    at: Triple, point: Sequence[float] | None, shares: Sequence[float] | None, screen: Screen
) -> Triple:
    """Return an eye's place in the head frame of the screen from one in the tracker's own.

    The tracker's origin is at its front (Tobii) and not known here. The point that is looked at is
    told in both frames, and the eye is as far from it in either; without one the tracker's origin
    is taken for the screen's centre.
    """
    known = (0.0, 0.0, 0.0) if point is None or shares is None else point
    sx, sy, sz = screen.point_m(*((0.5, 0.5) if point is None or shares is None else shares))
    return at[0] - known[0] + sx, at[1] - known[1] + sy, at[2] - known[2] + sz


def _xdf(rows: Sequence[Mapping[str, str]], screen_px: tuple[int, int]) -> GazeLayout | None:
    kinds = {"Direction": DIRECTION, "Position": PLACE, "Screen": SCREEN, "Intersection": POINT}
    singles = {
        "PupilDiameter": PUPIL,
        "Diameter": PUPIL,
        "PupilRadius": PUPIL,
        "Radius": PUPIL,
        "Valid": VALID,
        "Confidence": CONFIDENCE,
    }
    places: dict[tuple[str, str], list[int]] = {}
    factors: dict[tuple[str, str], list[float]] = {}
    states_frame = True
    for i, row in enumerate(rows):
        text, unit = row.get("type", ""), row.get("unit", "").lower()
        eye = row.get("eye", "both") or "both"
        kind = kinds.get(text[:-1]) if text[-1:] in ("X", "Y", "Z") else singles.get(text)
        if kind is None or eye not in EYES:
            continue
        if kind == SCREEN:
            size = screen_px[0] if text.endswith("X") else screen_px[1]
            factor = 1.0 / size if unit.startswith("pixel") else 1.0
        elif kind in (PLACE, POINT):
            factor = METRES.get(unit, 1.0)
        elif kind == PUPIL:
            factor = MILLIMETRES.get(unit, NAN) * (2.0 if "Radius" in text else 1.0)
        else:
            factor = 1.0
        if kind == DIRECTION and row.get("coordinate_system", "") not in HEAD:
            states_frame = False
        places.setdefault((eye, kind), []).append(i)
        factors.setdefault((eye, kind), []).append(factor)
    whole = {key: tuple(at) for key, at in places.items() if len(at) == AXES[key[1]]}
    if not any(kind in (DIRECTION, SCREEN, POINT) for _, kind in whole):
        return None
    whole_factors = {key: tuple(factors[key]) for key in whole}
    return GazeLayout(len(rows), whole, whole_factors, states_frame)


def _titta(labels: Sequence[str], n_channels: int) -> GazeLayout | None:
    """Return the places of TittaLSL's channels; the device's own time follows, undescribed."""
    if not 0 <= n_channels - len(labels) <= 1:
        return None
    places: dict[tuple[str, str], tuple[int, ...]] = {}
    factors: dict[tuple[str, str], tuple[float, ...]] = {}
    for eye in ("left", "right"):
        for kind, names in TITTA_LABELS.items():
            channel_labels = [f"{name}.{eye}_eye" for name in names]
            if all(label in labels for label in channel_labels):
                places[eye, kind] = tuple(labels.index(label) for label in channel_labels)
                if kind in (PLACE, POINT):
                    factors[eye, kind] = (1e-3,) * 3
    if not any(kind in (SCREEN, POINT) for _, kind in places):
        return None
    return GazeLayout(n_channels, places, factors)
