"""Areas of interest in a picture: polygons, ellipses and painted pixels, and which is hit.

Coordinates are pixels of the upright picture, right and down from its top left corner: pixel k
reaches from k to k + 1.
"""

import base64
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

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


@dataclass(frozen=True)
class Area:
    """A named area of a picture: an `outline` of corners, an `ellipse` (x and y of its middle,
    width, height, degrees by which it is turned clockwise), or `pixels` (see `pack_runs`).

    `salience` says how much it attracts simulated people; None: as its size does.
    """

    name: str
    outline: tuple[tuple[float, float], ...] = ()
    ellipse: tuple[float, float, float, float, float] | None = None
    pixels: str = ""
    salience: float | None = None

    def holds(self, x: Values, y: Values) -> Is:
        """Tell which points (n,) lie within; NaN does not."""
        if self.ellipse is not None:
            mid_x, mid_y, wide, high, turn_deg = self.ellipse
            c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
            along, across = (x - mid_x) * c + (y - mid_y) * s, (y - mid_y) * c - (x - mid_x) * s
            return np.asarray((2 * along / wide) ** 2 + (2 * across / high) ** 2 <= 1.0)
        if self.pixels:
            return _in_runs(unpack_runs(self.pixels), x, y)
        return _in_polygon(np.array(self.outline), x, y)

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
        (x0, y0), (x1, y1) = _edges(np.array(self.outline))
        return float(abs((x0 * y1 - x1 * y0).sum()) / 2)

    def corners(self) -> Values:
        """Return the corners (k, 2) of a polygon, or of one that is as good as the ellipse."""
        if self.ellipse is None:
            return np.array(self.outline, np.float64).reshape(-1, 2)
        mid_x, mid_y, wide, high, turn_deg = self.ellipse
        at = np.arange(CORNERS_OF_ELLIPSE) / CORNERS_OF_ELLIPSE * 2 * np.pi
        along, across = wide / 2 * np.cos(at), high / 2 * np.sin(at)
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        return np.stack([mid_x + along * c - across * s, mid_y + along * s + across * c], axis=1)

    def distances(self, x: Values, y: Values, unit_px: tuple[float, float] | Values) -> Values:
        """Return how far points (n,) outside lie from it; a pixel counts `unit_px` each way, which
        may differ from point to point (n, 2).
        """
        points = np.stack([x, y], axis=1)
        units = np.broadcast_to(np.asarray(unit_px, np.float64), points.shape)
        if self.pixels:
            row, first, end = unpack_runs(self.pixels).astype(np.float64).T
            low, high = np.stack([first, row], axis=1), np.stack([end, row + 1], axis=1)
            return _nearest(points, units, low, high, _to_boxes)
        corners = self.corners()
        return _nearest(points, units, corners, np.roll(corners, -1, axis=0), _to_lines)


def areas_at(
    areas: Sequence[Area],
    x: Values,
    y: Values,
    *,
    pad: float = 0.0,
    unit_px: tuple[float, float] | Values = (1.0, 1.0),
    around_px: float = 0.0,
) -> npt.NDArray[np.int16]:
    """Return the index (n,) of the area at each point, the last of several; else `NOWHERE`.

    A point in no area counts for the nearest one that is not farther than `pad`, where a pixel
    counts `unit_px` to the right and downwards, everywhere or at each point (n, 2). A picture that
    goes all around comes again after `around_px` to the right.
    """
    at = np.full(x.shape, NOWHERE, np.int16)
    places = (x, x - around_px, x + around_px) if around_px else (x,)
    for index, area in enumerate(areas):
        for place in places:
            at[area.holds(place, y)] = index
    rest = np.flatnonzero((at == NOWHERE) & np.isfinite(x) & np.isfinite(y))
    if pad > 0 and len(rest) and areas:
        units = np.broadcast_to(np.asarray(unit_px, np.float64), (len(x), 2))[rest]
        away = np.stack(
            [
                np.min([area.distances(p[rest], y[rest], units) for p in places], axis=0)
                for area in areas
            ]
        )
        nearest = away.argmin(axis=0)
        is_near = away.min(axis=0) <= pad
        at[rest[is_near]] = nearest[is_near]
    return at


@dataclass(frozen=True, eq=False)
class PlacedAreas:
    """The areas of a stimulus of `size_px` that stood at `pose`, upright and `size_m` large."""

    pose: Pose
    size_m: tuple[float, float]
    size_px: tuple[int, int]
    areas: tuple[Area, ...]

    def areas_met(
        self, origin_m: Vector, direction: Vector, t_ns: Times | None, pad_deg: float
    ) -> npt.NDArray[np.int16]:
        """Return the index (n,) of the area that each ray (n, 3) in world meets, else `NOWHERE`."""
        x, y = self.pixels_met(origin_m, direction)
        eyes_m = origin_m[np.isfinite(origin_m).all(axis=1)]
        unit_px = self.degrees_px(eyes_m[0]) if len(eyes_m) else (1.0, 1.0)
        return areas_at(self.areas, x, y, pad=pad_deg, unit_px=unit_px)

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
        right_m = (x / self.size_px[0] - 0.5) * self.size_m[0]
        up_m = (0.5 - y / self.size_px[1]) * self.size_m[1]
        offset_m = rotate(self.pose.orientation_wxyz, np.array([right_m, up_m, 0.0]))
        place: Vector = self.pose.position_m + offset_m
        return place

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
    `yaw_deg` to the right of the picture's middle. Before a monitor the view `turns` since.
    """

    pose: Pose
    yaw_deg: float
    size_px: tuple[int, int]
    areas: tuple[Area, ...]
    turns: ViewTurns = field(default_factory=lambda: ViewTurns(1))

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
        return areas_at(self.areas, x, y, pad=pad_deg, unit_px=unit_px, around_px=around_px)

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
        width, height = self.size_px
        yaw_deg, pitch_deg = (0.5 - x / width) * 360.0, (0.5 - y / height) * 180.0
        towards = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)
        place: Vector = self.pose.position_m + FAR_M * rotate(
            self.orientation_at(turned_deg), towards
        )
        return place

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
    return json.dumps([_as_json(one) for one in sheets], separators=(",", ":"))


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
        ellipse = of.get("ellipse")
        areas.append(
            Area(
                of["name"],
                tuple((float(x), float(y)) for x, y in of.get("outline", ())),
                None if ellipse is None else (*map(float, ellipse),),  # type: ignore[arg-type]
                of.get("pixels", ""),
                of.get("salience"),
            )
        )
    pose = Pose(np.array(raw["position_m"]), np.array(raw["orientation_wxyz"]))
    wide, high = raw["size_px"]
    if "yaw_deg" in raw:
        return SurroundingAreas(pose, float(raw["yaw_deg"]), (wide, high), tuple(areas))
    wide_m, high_m = raw["size_m"]
    return PlacedAreas(pose, (wide_m, high_m), (wide, high), tuple(areas))


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


def _edges(corners: Values) -> tuple[tuple[Values, Values], tuple[Values, Values]]:
    nexts = np.roll(corners, -1, axis=0)
    return (corners[:, 0], corners[:, 1]), (nexts[:, 0], nexts[:, 1])


def _in_polygon(corners: Values, x: Values, y: Values) -> Is:
    """Tell which points lie within: a line to the right crosses the outline an odd time."""
    inside = np.zeros(x.shape, np.bool_)
    begins, ends = _edges(corners)
    for x0, y0, x1, y1 in zip(*begins, *ends, strict=True):
        if y0 == y1:
            continue
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


def _nearest(points: Values, units: Values, begins: Values, ends: Values, of: Any) -> Values:
    """Return the distance of each point (n, 2) to the nearest of k lines or boxes, in units of the
    point (n, 2); `of` measures it from the point.
    """
    least = np.empty(len(points))
    step = max(1, MAX_PAIRS // max(1, len(begins)))
    for i in range(0, len(points), step):
        here, unit = points[i : i + step, None], units[i : i + step, None]
        away = of((begins - here) * unit, (ends - here) * unit)
        least[i : i + step] = away.min(axis=1)
    return least


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
