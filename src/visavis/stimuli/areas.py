"""Areas of interest in a flat stimulus: polygons, ellipses and painted pixels, and which is hit.

Coordinates are pixels of the upright picture, right and down from its top left corner: pixel k
reaches from k to k + 1.
"""

import base64
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate

NOWHERE: Final = -1
"""No area is here."""
MAX_PAIRS: Final = 4_000_000
"""Points times edges whose distances are computed together."""
CORNERS_OF_ELLIPSE: Final = 256
Values = npt.NDArray[np.float64]
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

    def distances(self, x: Values, y: Values, unit_px: tuple[float, float]) -> Values:
        """Return how far points (n,) outside lie from it; a pixel counts `unit_px` each way."""
        points = np.stack([x * unit_px[0], y * unit_px[1]], axis=1)
        if self.pixels:
            row, first, end = unpack_runs(self.pixels).astype(np.float64).T
            low = np.stack([first * unit_px[0], row * unit_px[1]], axis=1)
            high = np.stack([end * unit_px[0], (row + 1) * unit_px[1]], axis=1)
            return _nearest(points, low, high, _to_boxes)
        corners = self.corners() * unit_px
        return _nearest(points, corners, np.roll(corners, -1, axis=0), _to_lines)


def areas_at(
    areas: Sequence[Area],
    x: Values,
    y: Values,
    *,
    pad: float = 0.0,
    unit_px: tuple[float, float] = (1.0, 1.0),
) -> npt.NDArray[np.int16]:
    """Return the index (n,) of the area at each point, the last of several; else `NOWHERE`.

    A point in no area counts for the nearest one that is not farther than `pad`, where a pixel
    counts `unit_px` to the right and downwards.
    """
    at = np.full(x.shape, NOWHERE, np.int16)
    for index, area in enumerate(areas):
        at[area.holds(x, y)] = index
    rest = np.flatnonzero((at == NOWHERE) & np.isfinite(x) & np.isfinite(y))
    if pad > 0 and len(rest) and areas:
        away = np.stack([area.distances(x[rest], y[rest], unit_px) for area in areas])
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


def areas_under(
    sheets: Sequence[PlacedAreas],
    names: Sequence[str],
    origin_m: Vector,
    direction: Vector,
    pad_deg: float = 0.0,
) -> npt.NDArray[np.int16]:
    """Return for each ray (n, 3) in world the place of its area's name among `names`, of several
    the one in front; else `NOWHERE`.

    Names that are not asked for count as nowhere, but still stand before others.
    """
    under = np.full(len(direction), NOWHERE, np.int16)
    for one in sheets:
        x, y = one.pixels_met(origin_m, direction)
        eyes_m = origin_m[np.isfinite(origin_m).all(axis=1)]
        unit_px = one.degrees_px(eyes_m[0]) if len(eyes_m) else (1.0, 1.0)
        at = areas_at(one.areas, x, y, pad=pad_deg, unit_px=unit_px)
        places = [names.index(a.name) if a.name in names else NOWHERE for a in one.areas]
        hit = at != NOWHERE
        under[hit] = np.array([*places, NOWHERE], np.int16)[at[hit]]
    return under


def areas_text(sheets: Iterable[PlacedAreas]) -> str:
    """Return placed areas as the text by which an event describes them."""
    return json.dumps([_as_json(one) for one in sheets], separators=(",", ":"))


@lru_cache(maxsize=64)
def read_areas_text(text: str) -> tuple[PlacedAreas, ...]:
    """Return placed areas from the text of an event.

    Raises:
        DataError: it is no such text.
    """
    try:
        return tuple(_from_json(one) for one in json.loads(text))
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"no areas are described by {text[:60]!r}") from error


def _as_json(one: PlacedAreas) -> dict[str, Any]:
    return {
        "position_m": one.pose.position_m.tolist(),
        "orientation_wxyz": one.pose.orientation_wxyz.tolist(),
        "size_m": list(one.size_m),
        "size_px": list(one.size_px),
        "areas": [
            {k: v for k, v in vars(area).items() if v not in ((), None, "")} for area in one.areas
        ],
    }


def _from_json(raw: Mapping[str, Any]) -> PlacedAreas:
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
    (wide_m, high_m), (wide, high) = raw["size_m"], raw["size_px"]
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


def _nearest(points: Values, begins: Values, ends: Values, distance: Any) -> Values:
    """Return the distance of each point (n, 2) to the nearest of k lines or boxes."""
    least = np.empty(len(points))
    step = max(1, MAX_PAIRS // max(1, len(begins)))
    for i in range(0, len(points), step):
        least[i : i + step] = distance(points[i : i + step, None], begins, ends).min(axis=1)
    return least


def _to_lines(points: Values, begins: Values, ends: Values) -> Values:
    along = ends - begins
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    share = np.clip(((points - begins) * along).sum(axis=-1) / square, 0.0, 1.0)
    away: Values = np.linalg.norm(points - begins - share[..., None] * along, axis=-1)
    return away


def _to_boxes(points: Values, low: Values, high: Values) -> Values:
    beyond = np.maximum(np.maximum(low - points, points - high), 0.0)
    away: Values = np.linalg.norm(beyond, axis=-1)
    return away
