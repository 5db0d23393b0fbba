"""The meshes of a laboratory's own room as areas of interest: which one a ray meets first."""

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector, quat_conjugate, quat_from_yaw_pitch_deg, rotate
from visavis.lab.screen import PlacedScreen
from visavis.stimuli.surfaces import meet_triangles

NOWHERE: Final = -1
ROOM_SHAPE: Final = "room_shape"
"""The event that describes the meshes of a room, once in every part of a session."""
POINTS_OF_TRIANGLE: Final = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6.0
"""Points of a triangle that stand for it, in shares of its corners."""
TRIANGLES_LOOKED_AT: Final = 25
"""Of a mesh with more triangles, so many of the largest tell where it is seen."""
VIEW_DEG: Final = (60.0, 35.0)
"""How far aside, and up and down, things attract who looks ahead, where no screen ends the view."""
MARGIN_M: Final = 1e-4
DEG2_PER_SR: Final = float(np.degrees(1.0) ** 2)


@dataclass(frozen=True, eq=False)
class RoomMesh:
    """A mesh as its file has it: `vertices_m` (v, 3), `triangles` (t, 3); without a name it only
    hides what is behind.
    """

    name: str
    vertices_m: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class RoomShape:
    """The meshes of a room's file, of which no two have one name."""

    file: str
    sha256: str
    meshes: tuple[RoomMesh, ...]

    @cached_property
    def event(self) -> Mapping[str, str]:
        """What the event `ROOM_SHAPE` says of it."""
        meshes = [[m.name, _text_of(m.vertices_m), _text_of(m.triangles)] for m in self.meshes]
        text = json.dumps(meshes, separators=(",", ":"))
        return {"file": self.file, "sha256": self.sha256, "meshes": text}


@lru_cache(maxsize=4)
def read_shape_text(file: str, sha256: str, text: str) -> RoomShape:
    """Return a room's meshes from the text of an event.

    Raises:
        DataError: it is no such text.
    """
    try:
        meshes = tuple(
            RoomMesh(
                name,
                _array_of(vertices, np.dtype("<f4")).astype(np.float32),
                _array_of(triangles, np.dtype("<i4")).astype(np.int32),
            )
            for name, vertices, triangles in json.loads(text)
        )
    except (ValueError, TypeError, zlib.error) as error:
        raise DataError(f"no meshes of {file} are described by {text[:60]!r}") from error
    return RoomShape(file, sha256, meshes)


def _text_of(rows: npt.NDArray[Any]) -> str:
    kind = "<f4" if rows.dtype.kind == "f" else "<i4"
    return base64.b64encode(zlib.compress(rows.astype(kind).tobytes(), 6)).decode("ascii")


def _array_of(text: str, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind).reshape(-1, 3)


@dataclass(frozen=True)
class RoomObject:
    """A mesh to look at, by its name."""

    name: str


@dataclass(frozen=True)
class SeenObject:
    """A thing from an eye: which of the areas it is, a place on it that is seen, and its size."""

    area: int
    place_m: Vector
    size_deg2: float

    @property
    def radius_rad(self) -> float:
        """How far from its middle a disc of its size reaches."""
        return float(np.radians(np.sqrt(self.size_deg2 / np.pi)))


@dataclass(frozen=True, eq=False)
class RoomAreas:
    """The meshes of a room around somebody who stands at `stand_m` of its file and faces its −z,
    turned by `yaw_deg` to the right.
    """

    shape: RoomShape
    stand_m: tuple[float, float, float]
    yaw_deg: float

    @cached_property
    def areas(self) -> tuple[RoomObject, ...]:
        """The meshes that have a name."""
        return tuple(RoomObject(mesh.name) for mesh in self.shape.meshes if mesh.name)

    @cached_property
    def _in_world(
        self,
    ) -> tuple[tuple[int, npt.NDArray[np.float32], npt.NDArray[np.int32]], ...]:
        """Area, vertices and triangles of each mesh in world."""
        names = [area.name for area in self.areas]
        areas = []
        for mesh in self.shape.meshes:
            vertices = to_world(mesh.vertices_m, self.stand_m, self.yaw_deg)
            area = names.index(mesh.name) if mesh.name else NOWHERE
            areas.append((area, vertices, mesh.triangles))
        return tuple(areas)

    @cached_property
    def _boxes(self) -> npt.NDArray[np.float64]:
        """The box (k, 2, 3) of each of them."""
        low_high = [[v.min(axis=0), v.max(axis=0)] for _, v, _ in self._in_world]
        return np.array(low_high, np.float64).reshape(-1, 2, 3)

    def areas_met(
        self,
        origin_m: Vector,
        direction: Vector,
        t_ns: npt.NDArray[np.int64] | None = None,
        pad_deg: float = 0.0,
    ) -> npt.NDArray[np.int16]:
        """Return the index (n,) of the mesh that each ray (n, 3) in world meets first, else
        `NOWHERE`. Meshes are as large as they are drawn: `pad_deg` widens none.
        """
        return self._first(origin_m, direction)[1].astype(np.int16)

    def distance_m(self, origin_m: Vector, direction: Vector) -> Vector:
        """Return how far each ray (n, 3) of unit length in world goes to a mesh; inf to none."""
        return self._first(origin_m, direction)[0]

    def _first(self, origin_m: Vector, direction: Vector) -> tuple[Vector, npt.NDArray[np.int64]]:
        """Return how far each ray goes, in lengths of its direction, and the area that ends it."""
        origin = np.ascontiguousarray(origin_m, np.float64)
        along = np.ascontiguousarray(direction, np.float64)
        distance_m, mesh = np.full(len(along), np.inf), np.full(len(along), NOWHERE)
        meets = _meets_boxes(self._boxes, origin, along)
        for k in np.flatnonzero(meets.any(axis=0)).tolist():
            area, vertices, triangles = self._in_world[k]
            near = np.flatnonzero(meets[:, k])
            if len(near):
                some_m, some_met = distance_m[near], mesh[near]
                meet_triangles(
                    origin[near], along[near], vertices, triangles, area, some_m, some_met
                )
                distance_m[near], mesh[near] = some_m, some_met
        return distance_m, mesh

    def seen_from(self, eye_m: Vector, screen: PlacedScreen | None) -> list[SeenObject]:
        """Return the things that are seen from an eye that looks ahead or through a screen."""
        objects = []
        for area, vertices, triangles in self._in_world:
            if area == NOWHERE:
                continue
            corners = vertices[triangles].astype(np.float64)
            across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
            large = np.argsort(-np.linalg.norm(across, axis=1), kind="stable")
            large = large[:TRIANGLES_LOOKED_AT]
            points = np.einsum("pk,tkc->tpc", POINTS_OF_TRIANGLE, corners[large]).reshape(-1, 3)
            offset = points - eye_m
            far_m = np.maximum(np.linalg.norm(offset, axis=1), 1e-3)
            size_sr = np.abs(np.einsum("nc,nc->n", np.repeat(across[large], 4, axis=0), offset))
            size_sr /= 4 * far_m**3
            eyes_m = np.broadcast_to(eye_m, offset.shape)
            reach, mesh = self._first(eyes_m, offset)
            is_seen = _in_view(eye_m, offset, screen) & (mesh == area) & (reach > 0.999)
            if not is_seen.any() or not size_sr[is_seen].sum() > 0:
                continue
            towards = offset[is_seen] / far_m[is_seen, None]
            middle = (size_sr[is_seen, None] * towards).sum(axis=0)
            best = int(np.argmax(towards @ middle))
            size_deg2 = float(size_sr[is_seen].sum()) * DEG2_PER_SR
            objects.append(SeenObject(area, points[is_seen][best], size_deg2))
        return objects


def to_world(
    vertices_m: npt.NDArray[np.float32], stand_m: Sequence[float], yaw_deg: float
) -> npt.NDArray[np.float32]:
    """Return vertices (v, 3) of a room's file in world, for who stands and faces there."""
    turn = quat_from_yaw_pitch_deg(yaw_deg)
    from_stand_m = vertices_m.astype(np.float64) - np.array(stand_m, np.float64)
    turned_m: npt.NDArray[np.float32] = rotate(turn, from_stand_m).astype(np.float32)
    return np.ascontiguousarray(turned_m)


def as_json(one: RoomAreas) -> dict[str, Any]:
    """Return what an event says of them; the meshes are described once in a session."""
    return {
        "room": one.shape.file,
        "sha256": one.shape.sha256,
        "stand_m": list(one.stand_m),
        "yaw_deg": one.yaw_deg,
        "areas": [area.name for area in one.areas],
    }


def from_json(raw: Mapping[str, Any], shapes: Mapping[str, RoomShape]) -> RoomAreas:
    """Return the areas that an event describes, of meshes by the SHA-256 of their file.

    Raises:
        DataError: their meshes are not described.
    """
    shape = shapes.get(raw["sha256"])
    if shape is None:
        raise DataError(f"the meshes of the room {raw['room']} are not in the recording")
    x, y, z = map(float, raw["stand_m"])
    return RoomAreas(shape, (x, y, z), float(raw["yaw_deg"]))


def _meets_boxes(boxes: Vector, origin: Vector, along: Vector) -> npt.NDArray[np.bool_]:
    """Tell which rays (n, 3) meet which boxes (k, 2, 3), made a little larger: (n, k)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        per_m = 1.0 / along[:, None]
        a = (boxes[:, 0] - MARGIN_M - origin[:, None]) * per_m
        b = (boxes[:, 1] + MARGIN_M - origin[:, None]) * per_m
    enter = np.fmax.reduce(np.fmin(a, b), axis=2)
    leave = np.fmin.reduce(np.fmax(a, b), axis=2)
    meets: npt.NDArray[np.bool_] = (enter <= leave) & (leave > 0)
    return meets


def _in_view(eye_m: Vector, offset: Vector, screen: PlacedScreen | None) -> npt.NDArray[np.bool_]:
    """Tell which offsets (n, 3) from an eye are before it, or within a screen."""
    if screen is None:
        right = np.degrees(np.arctan2(offset[:, 0], -offset[:, 2]))
        up = np.degrees(np.arctan2(offset[:, 1], np.hypot(offset[:, 0], offset[:, 2])))
        return np.asarray((np.abs(right) <= VIEW_DEG[0]) & (np.abs(up) <= VIEW_DEG[1]))
    back = quat_conjugate(screen.place.orientation_wxyz)
    at = np.broadcast_to(rotate(back, eye_m - screen.place.position_m), offset.shape)
    return screen.flat.is_on(screen.flat.meets_m(at, rotate(back, offset)))
