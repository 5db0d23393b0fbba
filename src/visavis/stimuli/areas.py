"""Areas of interest in a picture: polygons, ellipses and painted pixels, and which is hit.

Coordinates are pixels of the upright picture, right and down from its top left corner: pixel k
reaches from k to k + 1. In a film areas may move from one key frame to the next.
"""

import base64
import json
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.geometry import (
    Pose,
    Vector,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    quat_multiply,
    rotate,
    yaw_pitch_deg_of,
)
from visavis.lab.screen import PlacedScreen
from visavis.stimuli import room_areas
from visavis.stimuli.room_areas import RoomAreas, RoomShape
from visavis.stimuli.view_turns import ViewTurns

NOWHERE: Final = -1
"""No area is here."""
MAX_PAIRS: Final = 4_000_000
"""Points times edges whose distances are computed together."""
CORNERS_OF_ELLIPSE: Final = 256
ELSEWHERE: Final = (0.2, 0.5, 0.8)
"""Places across and down a picture where people look for no reason that is known."""
AROUND: Final = 8
DOWN_AROUND: Final = (0.4, 0.55)
"""Such places in a panorama: so many around, a little above and below the horizon."""
FAR_M: Final = 20.0
"""How far eyes are set that look at a panorama."""
Values = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]
Is = npt.NDArray[np.bool_]
Outline: TypeAlias = tuple[tuple[float, float], ...]
Ellipse: TypeAlias = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class KeyFrame:
    """What an area is at `t_s` of a film: an `outline` or an `ellipse`; with neither it is gone."""

    t_s: float
    outline: Outline = ()
    ellipse: Ellipse | None = None

    @property
    def is_gone(self) -> bool:
        """Whether the area is not there from this time on."""
        return not self.outline and self.ellipse is None


@dataclass(frozen=True)
class Area:
    """A named area of a picture: an `outline` of corners, an `ellipse` (x and y of its middle,
    width, height, degrees by which it is turned clockwise), or `pixels` (see `pack_runs`).

    In a film it may have `keys` instead, all of one kind and in order of time: between two of them
    every number changes evenly, before the first and after the last it is not there, and up to a
    key at which it is gone it stays as it was.
    `salience` says how much it attracts simulated people; None: as its size does.
    """

    name: str
    outline: Outline = ()
    ellipse: Ellipse | None = None
    pixels: str = ""
    salience: float | None = None
    keys: tuple[KeyFrame, ...] = ()

    @property
    def is_ellipse(self) -> bool:
        """Whether it is an ellipse, if need be at every time."""
        return self.ellipse is not None or any(key.ellipse is not None for key in self.keys)

    def at(self, t_s: float) -> "Area | None":
        """Return it as it is at a time of its film, without key frames; None where it is not."""
        if not self.keys:
            return self
        (numbers,) = self._numbers(np.array([t_s])).tolist()
        if np.isnan(numbers[0]):
            return None
        if self.is_ellipse:
            return replace(self, ellipse=tuple(numbers), keys=())
        outline = tuple(zip(numbers[::2], numbers[1::2], strict=True))
        return replace(self, outline=outline, keys=())

    def first(self) -> "Area":
        """Return it as it is at its first key frame at which it is there."""
        there = next((self.at(key.t_s) for key in self.keys if not key.is_gone), None)
        return there or self

    def _numbers(self, t_s: Values) -> Values:
        """Return the numbers (m,) that describe an outline or ellipse; with key frames those of
        each time (n, m), NaN where it is not there.
        """
        if not self.keys:
            return np.ravel(np.array(self.ellipse or self.outline, np.float64))
        shapes = [np.ravel(key.ellipse or key.outline) for key in self.keys]
        is_gone = np.array([key.is_gone for key in self.keys])
        times = np.array([key.t_s for key in self.keys])
        missing = np.full(max(map(len, shapes)), np.nan)
        numbers = np.array([d if len(d) else missing for d in shapes], np.float64)
        before = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, None)
        after = np.minimum(before + 1, len(times) - 1)
        after = np.where(is_gone[after], before, after)
        lasts_s = np.where(after > before, times[after] - times[before], 1.0)
        share = ((t_s - times[before]) / lasts_s)[:, None]
        now: Values = numbers[before] + share * (numbers[after] - numbers[before])
        now[(t_s < times[0]) | (t_s > times[-1])] = np.nan
        return now

    def holds(self, x: Values, y: Values, t_s: Values | float = 0.0) -> Is:
        """Tell which points (n,) lie within, at a time of its film or at one each (n,); NaN does
        not.
        """
        t_s = np.broadcast_to(t_s, x.shape)
        if self.is_ellipse:
            mid_x, mid_y, wide, high, turn_deg = self._numbers(t_s).T
            c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
            along, across = (x - mid_x) * c + (y - mid_y) * s, (y - mid_y) * c - (x - mid_x) * s
            return np.asarray((2 * along / wide) ** 2 + (2 * across / high) ** 2 <= 1.0)
        if self.pixels:
            return _in_runs(unpack_runs(self.pixels), x, y)
        return _in_polygon(_corners_of(self._numbers(t_s)), x, y)

    def middle(self) -> tuple[float, float]:
        """Return the centre of the area."""
        if self.ellipse is not None:
            return self.ellipse[:2]
        if self.pixels:
            row, first, end = unpack_runs(self.pixels).astype(np.float64).T
            count = end - first
            x, y = (count * (first + end) / 2).sum(), (count * (row + 0.5)).sum()
            return float(x / count.sum()), float(y / count.sum())
        (x0, y0), (x1, y1) = _edges(np.array(self.outline))
        cross = x0 * y1 - x1 * y0
        x, y = ((x0 + x1) * cross).sum(), ((y0 + y1) * cross).sum()
        return float(x / (3 * cross.sum())), float(y / (3 * cross.sum()))

    def size_px2(self) -> float:
        """Return its size in square pixels."""
        if self.ellipse is not None:
            return float(np.pi / 4 * self.ellipse[2] * self.ellipse[3])
        if self.pixels:
            runs = unpack_runs(self.pixels)
            return float((runs[:, 2] - runs[:, 1]).sum())
        return abs(signed_size_px2(np.array(self.outline)))

    def corners(self, t_s: Values | None = None) -> Values:
        """Return the corners (k, 2) of a polygon, or of one that is as good as the ellipse; of one
        with key frames those at each time (n, k, 2).
        """
        numbers = self._numbers(np.zeros(1) if t_s is None else t_s)
        if not self.is_ellipse:
            return _corners_of(numbers)
        mid_x, mid_y, wide, high, turn_deg = (numbers[..., i, None] for i in range(5))
        at = np.arange(CORNERS_OF_ELLIPSE) / CORNERS_OF_ELLIPSE * 2 * np.pi
        along, across = wide / 2 * np.cos(at), high / 2 * np.sin(at)
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        return np.stack([mid_x + along * c - across * s, mid_y + along * s + across * c], axis=-1)

    def distances(
        self,
        x: Values,
        y: Values,
        unit_px: tuple[float, float] | Values,
        t_s: Values | float = 0.0,
    ) -> Values:
        """Return how far points (n,) outside lie from it, inf where it is not there; a pixel counts
        `unit_px` each way, which may differ from point to point (n, 2), as may the time.
        """
        points, times = np.stack([x, y], axis=1), np.broadcast_to(t_s, x.shape)
        units = np.broadcast_to(np.asarray(unit_px, np.float64), points.shape)
        if self.pixels:
            row, first, end = unpack_runs(self.pixels).astype(np.float64).T
            low, high = np.stack([first, row], axis=1), np.stack([end, row + 1], axis=1)
            return _nearest(points, units, len(low), lambda _: (low, high), _to_boxes)

        def edges(some: slice) -> tuple[Values, Values]:
            corners = self.corners(times[some])
            return corners, np.roll(corners, -1, axis=-2)

        count = self.corners(times[:1]).shape[-2]
        return _nearest(points, units, count, edges, _to_lines)


def signed_size_px2(corners: Values) -> float:
    """Return the size of an outline (k, 2), below 0 where its corners go round the other way."""
    (x0, y0), (x1, y1) = _edges(corners)
    return float((x0 * y1 - x1 * y0).sum() / 2)


def areas_at(
    areas: Sequence[Area],
    x: Values,
    y: Values,
    *,
    pad: float = 0.0,
    unit_px: tuple[float, float] | Values = (1.0, 1.0),
    around_px: float = 0.0,
    t_s: Values | float = 0.0,
) -> npt.NDArray[np.int16]:
    """Return the index (n,) of the area at each point, the last of several; else `NOWHERE`.

    A point in no area counts for the nearest one that is not farther than `pad`, where a pixel
    counts `unit_px` to the right and downwards, everywhere or at each point (n, 2). A picture that
    goes all around comes again after `around_px` to the right. `t_s` is the time in a film, of all
    points or of each (n,).
    """
    t_s = np.broadcast_to(t_s, x.shape)
    at = np.full(x.shape, NOWHERE, np.int16)
    places = (x, x - around_px, x + around_px) if around_px else (x,)
    for index, area in enumerate(areas):
        for place in places:
            at[area.holds(place, y, t_s)] = index
    rest = np.flatnonzero((at == NOWHERE) & np.isfinite(x) & np.isfinite(y))
    if pad > 0 and len(rest) and areas:
        units = np.broadcast_to(np.asarray(unit_px, np.float64), (len(x), 2))[rest]
        away = np.stack(
            [
                np.min([area.distances(p[rest], y[rest], units, t_s[rest]) for p in places], axis=0)
                for area in areas
            ]
        )
        nearest = away.argmin(axis=0)
        is_near = away.min(axis=0) <= pad
        at[rest[is_near]] = nearest[is_near]
    return at


def _film_s(t_ns: Times, since_ns: int, end_s: float) -> Values:
    """Return the time in a film at times of the session; after its end its last picture stays."""
    return np.clip((t_ns - since_ns) / NS_PER_S, 0.0, end_s)


@dataclass(frozen=True, eq=False)
class PlacedAreas:
    """The areas of a stimulus of `size_px` that stood at `pose`, upright and `size_m` large.

    A film has run since `since_ns`; after `end_s` its last picture stays.
    """

    pose: Pose
    size_m: tuple[float, float]
    size_px: tuple[int, int]
    areas: tuple[Area, ...]
    since_ns: int = 0
    end_s: float = 0.0

    def areas_now(self, t_ns: int) -> tuple[Area | None, ...]:
        """Return each of its areas as it is at a time of the session; None where it is not."""
        t_s = float(_film_s(np.array(t_ns), self.since_ns, self.end_s))
        return tuple(area.at(t_s) for area in self.areas)

    def areas_met(
        self, origin_m: Vector, direction: Vector, t_ns: Times | None, pad_deg: float
    ) -> npt.NDArray[np.int16]:
        """Return the index (n,) of the area that each ray (n, 3) in world meets, else `NOWHERE`."""
        x, y = self.pixels_met(origin_m, direction)
        eyes_m = origin_m[np.isfinite(origin_m).all(axis=1)]
        unit_px = self.degrees_px(eyes_m[0]) if len(eyes_m) else (1.0, 1.0)
        t_s = 0.0 if t_ns is None else _film_s(t_ns, self.since_ns, self.end_s)
        return areas_at(self.areas, x, y, pad=pad_deg, unit_px=unit_px, t_s=t_s)

    def pixels_met(self, origin_m: Vector, direction: Vector) -> tuple[Values, Values]:
        """Return x and y (n,) in its pixels of rays (n, 3) in world; NaN where they do not meet."""
        back = quat_conjugate(self.pose.orientation_wxyz)
        turn = np.stack([rotate(back, axis) for axis in np.eye(3)])
        at, along = (origin_m - self.pose.position_m) @ turn, direction @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(along[:, 2] < 0, -at[:, 2] / along[:, 2], np.nan)
            hit_m = at + reach[:, None] * along
        hit_m[~(reach > 0)] = np.nan
        x = (hit_m[:, 0] / self.size_m[0] + 0.5) * self.size_px[0]
        y = (0.5 - hit_m[:, 1] / self.size_m[1]) * self.size_px[1]
        return x, y

    def place_m(self, x: float, y: float) -> Vector:
        """Return where a pixel is in the world."""
        return self.places_m(np.array([x, y]), 0)

    def places_m(self, corners: Values, t_ns: int) -> Vector:
        """Return where places (…, 2) in its pixels are in the world (…, 3), at any time."""
        right_m = (corners[..., 0] / self.size_px[0] - 0.5) * self.size_m[0]
        up_m = (0.5 - corners[..., 1] / self.size_px[1]) * self.size_m[1]
        own_m = np.stack([right_m, up_m, np.zeros_like(up_m)], axis=-1)
        places: Vector = self.pose.position_m + rotate(self.pose.orientation_wxyz, own_m)
        return places

    def degrees_px(self, origin_m: Vector) -> tuple[float, float]:
        """Return how many degrees a pixel is wide and high from an eye, in the middle."""
        far_m = max(float(np.linalg.norm(self.pose.position_m - origin_m)), 1e-3)
        wide, high = (m / px for m, px in zip(self.size_m, self.size_px, strict=True))
        return float(np.degrees(wide / far_m)), float(np.degrees(high / far_m))

    def size_deg2(self, area: Area, origin_m: Vector) -> float:
        """Return the size of one of them from an eye, in square degrees."""
        wide, high = self.degrees_px(origin_m)
        return area.size_px2() * wide * high

    def spots(self, origin_m: Vector) -> tuple[list[Vector], float]:
        """Return places all over it, and the angle around each where people look for no reason."""
        width, height = self.size_px
        places = [self.place_m(x * width, y * height) for x in ELSEWHERE for y in ELSEWHERE]
        return places, float(np.radians(self.degrees_px(origin_m)[0] * width / 3))


@dataclass(frozen=True, eq=False)
class SurroundingAreas:
    """The areas of a panorama, of which an eye sees `size_px`, around somebody.

    `pose` is where the head was at the onset, upright and facing what was straight ahead then:
    `yaw_deg` to the right of the picture's middle. Before a monitor the view `turns` since, and
    only what the `screen` shows is seen. A film has run since `since_ns`; after `end_s` its last
    picture stays.
    """

    pose: Pose
    yaw_deg: float
    size_px: tuple[int, int]
    areas: tuple[Area, ...]
    turns: ViewTurns = field(default_factory=lambda: ViewTurns(1))
    since_ns: int = 0
    end_s: float = 0.0
    screen: PlacedScreen | None = None

    def is_shown(self, origin_m: Vector, direction: Vector) -> Is:
        """Tell which rays (n, 3) in world meet the screen, if there is one that shows a part."""
        if self.screen is None:
            return np.ones(len(direction), np.bool_)
        flat, back = self.screen.flat, quat_conjugate(self.screen.place.orientation_wxyz)
        at_m = rotate(back, origin_m - self.screen.place.position_m)
        return flat.is_on(flat.meets_m(at_m, rotate(back, direction)))

    def areas_met(
        self, origin_m: Vector, direction: Vector, t_ns: Times | None, pad_deg: float
    ) -> npt.NDArray[np.int16]:
        """Return the index (n,) of the area that each ray (n, 3) in world meets, else `NOWHERE`.

        With `t_ns` (n,) a view that turns is the one of that moment, else the first.
        """
        x, y = self.pixels_met(direction, t_ns)
        high = 180.0 / self.size_px[1]
        wide = high * np.cos(np.radians(90.0 - y * high))
        unit_px = np.stack([wide, np.full(len(y), high)], axis=1)
        around_px = float(self.size_px[0])
        t_s = 0.0 if t_ns is None else _film_s(t_ns, self.since_ns, self.end_s)
        at = areas_at(self.areas, x, y, pad=pad_deg, unit_px=unit_px, around_px=around_px, t_s=t_s)
        at[~self.is_shown(origin_m, direction)] = NOWHERE
        return at

    def areas_now(self, t_ns: int) -> tuple[Area | None, ...]:
        """Return each of its areas as it is at a time of the session; None where it is not."""
        t_s = float(_film_s(np.array(t_ns), self.since_ns, self.end_s))
        return tuple(area.at(t_s) for area in self.areas)

    def pixels_met(self, direction: Vector, t_ns: Times | None) -> tuple[Values, Values]:
        """Return x and y (n,) in its pixels of directions (n, 3) in world."""
        own = rotate(quat_conjugate(self.pose.orientation_wxyz), direction)
        turns_deg = np.zeros((len(own), 2)) if t_ns is None else self.turns.course(t_ns)
        right = np.radians(turns_deg[:, 0] + self.yaw_deg) / 2
        up = np.radians(turns_deg[:, 1]) / 2
        zero = np.zeros(len(own))
        to_right = np.stack([np.cos(right), zero, -np.sin(right), zero], axis=1)
        upwards = np.stack([np.cos(up), np.sin(up), zero, zero], axis=1)
        yaw_deg, pitch_deg = yaw_pitch_deg_of(rotate(quat_multiply(to_right, upwards), own))
        width, height = self.size_px
        return (0.5 - yaw_deg / 360.0) * width, (0.5 - pitch_deg / 180.0) * height

    def orientation_at(self, turned_deg: tuple[float, float]) -> Vector:
        """Return the rotation (4,) from the picture's own directions to world, as the view is
        turned to the right and upwards.
        """
        view = quat_from_yaw_pitch_deg(-(self.yaw_deg + turned_deg[0]), turned_deg[1])
        return quat_multiply(self.pose.orientation_wxyz, quat_conjugate(view))

    def place_m(self, x: float, y: float, turned_deg: tuple[float, float] = (0.0, 0.0)) -> Vector:
        """Return where a pixel is in the world, on a sphere of `FAR_M` around the head."""
        return self._places_m(np.array([x, y]), turned_deg)

    def places_m(self, corners: Values, t_ns: int) -> Vector:
        """Return where places (…, 2) in its pixels are (…, 3), as the view is turned at a time."""
        return self._places_m(corners, self.turns.at(t_ns))

    def _places_m(self, corners: Values, turned_deg: tuple[float, float]) -> Vector:
        width, height = self.size_px
        yaw_deg = (0.5 - corners[..., 0] / width) * 360.0
        pitch_deg = (0.5 - corners[..., 1] / height) * 180.0
        towards = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)
        places: Vector = self.pose.position_m + FAR_M * rotate(
            self.orientation_at(turned_deg), towards
        )
        return places

    def size_deg2(self, area: Area, origin_m: Vector) -> float:
        """Return about the size of one of them, in square degrees."""
        high = 180.0 / self.size_px[1]
        return float(area.size_px2() * high**2 * np.sin(np.radians(area.middle()[1] * high)))

    def spots(self, origin_m: Vector) -> tuple[list[Vector], float]:
        """Return places all around, and the angle around each where people look for no reason."""
        width, height = self.size_px
        across, down = np.arange(AROUND) / AROUND * width, np.array(DOWN_AROUND) * height
        places = [self.place_m(float(x), float(y)) for x in across for y in down]
        return places, float(np.pi / AROUND)


PictureAreas: TypeAlias = PlacedAreas | SurroundingAreas
"""The areas of a picture, where it stands or around somebody."""
Areas: TypeAlias = PictureAreas | RoomAreas
"""The areas of one stimulus, where it stands, or the things in a room."""


def areas_under(
    sheets: Sequence[Areas],
    names: Sequence[str],
    origin_m: Vector,
    direction: Vector,
    pad_deg: float = 0.0,
    t_ns: Times | None = None,
) -> npt.NDArray[np.int16]:
    """Return for each ray (n, 3) in world, at its time (n,), the place of its area's name among
    `names`, of several the one in front; else `NOWHERE`.

    Names that are not asked for count as nowhere, but still stand before others.
    """
    under = np.full(len(direction), NOWHERE, np.int16)
    for one in sheets:
        at = one.areas_met(origin_m, direction, t_ns, pad_deg)
        places = [names.index(a.name) if a.name in names else NOWHERE for a in one.areas]
        hit = at != NOWHERE
        under[hit] = np.array([*places, NOWHERE], np.int16)[at[hit]]
    return under


def areas_text(sheets: Iterable[Areas]) -> str:
    """Return placed areas as the text by which an event describes them."""
    return json.dumps([_as_json(one) for one in sheets], separators=(",", ":"), default=vars)


def rooms_in(text: str) -> frozenset[str]:
    """Return the SHA-256 of the rooms whose meshes are areas in the text of an event."""
    return frozenset(one["sha256"] for one in json.loads(text) if "room" in one)


def read_areas_text(text: str, shapes: Mapping[str, RoomShape] | None = None) -> tuple[Areas, ...]:
    """Return placed areas from the text of an event; `shapes` are the meshes of rooms by the
    SHA-256 of their file.

    Raises:
        DataError: it is no such text.
    """
    return _read_areas(text, tuple((shapes or {}).values()))


@lru_cache(maxsize=64)
def _read_areas(text: str, shapes: tuple[RoomShape, ...]) -> tuple[Areas, ...]:
    by_sha256 = {shape.sha256: shape for shape in shapes}
    try:
        return tuple(
            room_areas.from_json(one, by_sha256) if "room" in one else _from_json(one)
            for one in json.loads(text)
        )
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"no areas are described by {text[:60]!r}") from error


def _as_json(one: Areas) -> dict[str, Any]:
    if isinstance(one, RoomAreas):
        return room_areas.as_json(one)
    if isinstance(one, PlacedAreas):
        place: dict[str, Any] = {"size_m": list(one.size_m)}
    else:
        place = {"yaw_deg": one.yaw_deg}
    if any(area.keys for area in one.areas):
        place |= {"since_ns": one.since_ns, "end_s": one.end_s}
    return {
        "position_m": one.pose.position_m.tolist(),
        "orientation_wxyz": one.pose.orientation_wxyz.tolist(),
        **place,
        "size_px": list(one.size_px),
        "areas": [
            {k: v for k, v in vars(area).items() if v not in ((), None, "")} for area in one.areas
        ],
    }


def _from_json(raw: Mapping[str, Any]) -> PictureAreas:
    areas = []
    for of in raw["areas"]:
        keys = tuple(KeyFrame(float(key["t_s"]), *_shape_of(key)) for key in of.get("keys", ()))
        outline, ellipse = _shape_of(of)
        pixels, salience = of.get("pixels", ""), of.get("salience")
        areas.append(Area(of["name"], outline, ellipse, pixels, salience, keys))
    pose = Pose(np.array(raw["position_m"]), np.array(raw["orientation_wxyz"]))
    wide, high = raw["size_px"]
    since_ns, end_s = int(raw.get("since_ns", 0)), float(raw.get("end_s", 0.0))
    if "yaw_deg" in raw:
        around = SurroundingAreas(pose, float(raw["yaw_deg"]), (wide, high), tuple(areas))
        return replace(around, since_ns=since_ns, end_s=end_s)
    wide_m, high_m = raw["size_m"]
    return PlacedAreas(pose, (wide_m, high_m), (wide, high), tuple(areas), since_ns, end_s)


def _shape_of(raw: Mapping[str, Any]) -> tuple[Outline, Ellipse | None]:
    """Return the outline and the ellipse of an area, or of one of its key frames."""
    outline = tuple((float(x), float(y)) for x, y in raw.get("outline", ()))
    ellipse = raw.get("ellipse")
    return outline, None if ellipse is None else (*map(float, ellipse),)  # type: ignore[return-value]


def pack_runs(is_inside: Is) -> str:
    """Return the pixels of a mask (height, width) as text: row, first and end of every run in it,
    as compressed int32.
    """
    with_edges = np.pad(is_inside.astype(np.int8), ((0, 0), (1, 1)))
    step = np.diff(with_edges, axis=1)
    row, first = np.nonzero(step == 1)
    end = np.nonzero(step == -1)[1]
    runs = np.stack([row, first, end], axis=1).astype("<i4")
    return base64.b64encode(zlib.compress(runs.tobytes(), 9)).decode("ascii")


@lru_cache(maxsize=256)
def unpack_runs(text: str) -> npt.NDArray[np.int32]:
    """Return row, first and end (k, 3) of the runs of pixels, from `pack_runs`."""
    raw = zlib.decompress(base64.b64decode(text))
    return np.frombuffer(raw, "<i4").reshape(-1, 3)


def _corners_of(numbers: Values) -> Values:
    """Return the corners (…, k, 2) of outlines from their numbers (…, 2 k)."""
    return numbers.reshape(*numbers.shape[:-1], -1, 2)


def _edges(corners: Values) -> tuple[tuple[Values, Values], tuple[Values, Values]]:
    """Return x and y (k,) where the edges of an outline (k, 2) begin, and where they end; of an
    outline for each point (n, k, 2) they are (k, n).
    """
    nexts = np.roll(corners, -1, axis=-2)
    return (corners[..., 0].T, corners[..., 1].T), (nexts[..., 0].T, nexts[..., 1].T)


def _in_polygon(corners: Values, x: Values, y: Values) -> Is:
    """Tell which points lie within: a line to the right crosses the outline an odd time."""
    inside = np.zeros(x.shape, np.bool_)
    begins, ends = _edges(corners)
    for x0, y0, x1, y1 in zip(*begins, *ends, strict=True):
        # on which side of the edge, seen upwards; a division would be rounded
        left = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
        crosses = ((y0 <= y) != (y1 <= y)) & ((left > 0) == (y1 > y0))
        inside ^= crosses
    return inside & np.isfinite(x) & np.isfinite(y)


def _in_runs(runs: npt.NDArray[np.int32], x: Values, y: Values) -> Is:
    inside = np.zeros(x.shape, np.bool_)
    inner = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    column, row = np.floor(x[inner]), np.floor(y[inner])
    wide = int(runs[:, 2].max()) + 1
    # runs come row by row: the last that begins at or before a pixel is the one that may hold it
    key = runs[:, 0].astype(np.int64) * wide + runs[:, 1]
    here = (column >= 0) & (column < wide) & (row >= 0) & (row <= runs[-1, 0])
    inner, column, row = inner[here], column[here].astype(np.int64), row[here].astype(np.int64)
    k = np.searchsorted(key, row * wide + column, side="right") - 1
    holds = (k >= 0) & (runs[k, 0] == row) & (column < runs[k, 2])
    inside[inner[holds]] = True
    return inside


def _nearest(
    points: Values,
    units: Values,
    count: int,
    edges_of: Callable[[slice], tuple[Values, Values]],
    of: Any,
) -> Values:
    """Return the distance of each point (n, 2) to the nearest of `count` lines or boxes, in units
    of the point (n, 2), inf where they are NaN. `edges_of` tells of some points where these begin
    and end, for all (k, 2) or for each (n, k, 2); `of` measures the distance from the point.
    """
    least = np.empty(len(points))
    step = max(1, MAX_PAIRS // max(1, count))
    for i in range(0, len(points), step):
        some = slice(i, i + step)
        here, unit = points[some, None], units[some, None]
        begins, ends = edges_of(some)
        least[some] = of((begins - here) * unit, (ends - here) * unit).min(axis=1)
    return np.where(np.isnan(least), np.inf, least)


def _to_lines(begins: Values, ends: Values) -> Values:
    along = ends - begins
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    share = np.clip(-(begins * along).sum(axis=-1) / square, 0.0, 1.0)
    away: Values = np.linalg.norm(begins + share[..., None] * along, axis=-1)
    return away


def _to_boxes(low: Values, high: Values) -> Values:
    beyond = np.maximum(np.maximum(low, -high), 0.0)
    away: Values = np.linalg.norm(beyond, axis=-1)
    return away
