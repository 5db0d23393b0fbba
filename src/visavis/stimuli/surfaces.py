"""Where rays end in a picture: on people, things, boards, stimuli, walls and floor, as drawn."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Panel, Picture, PlacedProp, Room, Sheet

REACH_M: Final = 1.3
"""No part of a body is farther than this from its hips, arms stretched above the head included."""
FLESH_M: Final = 0.35
"""No part of a body is farther than this from all of its joints, hair and clothes included."""
PANEL_TRIANGLES: Final = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


@dataclass(frozen=True, eq=False)
class RayEnds:
    """Where n rays end: `distance_m` (n,), inf where nothing is met; `name` (n,) says on what, ""
    where nothing is met.
    """

    distance_m: Vector
    name: npt.NDArray[np.object_]


@compiled
def meet_triangles(
    origin_m: Vector,
    direction: Vector,
    vertices_m: npt.NDArray[np.float32],
    triangles: npt.NDArray[np.int32],
    thing: int,
    distance_m: Vector,
    met: npt.NDArray[np.int64],
) -> None:
    """Shorten rays to the first of these triangles that they meet, from either side.

    After Möller and Trumbore 1997, J Graph Tools 2:21; `direction` has unit length.
    """
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = vertices_m[a, 0], vertices_m[a, 1], vertices_m[a, 2]
        ux, uy, uz = vertices_m[b, 0] - ax, vertices_m[b, 1] - ay, vertices_m[b, 2] - az
        vx, vy, vz = vertices_m[c, 0] - ax, vertices_m[c, 1] - ay, vertices_m[c, 2] - az
        for i in range(origin_m.shape[0]):
            dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
            px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
            volume = ux * px + uy * py + uz * pz
            if volume == 0.0:
                continue
            sx, sy, sz = origin_m[i, 0] - ax, origin_m[i, 1] - ay, origin_m[i, 2] - az
            first = (sx * px + sy * py + sz * pz) / volume
            if not 0.0 <= first <= 1.0:
                continue
            qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
            second = (dx * qx + dy * qy + dz * qz) / volume
            if second < 0.0 or first + second > 1.0:
                continue
            far = (vx * qx + vy * qy + vz * qz) / volume
            if 0.0 < far < distance_m[i]:
                distance_m[i] = far
                met[i] = thing


class Surfaces:
    """The surfaces of pictures; the room's are laid out once while it stays the same."""

    def __init__(self, level: int = 0) -> None:
        """Meet people at one level of detail, or at their lightest where they have fewer."""
        self._level = level
        self._room: Room | None = None
        self._walls: list[tuple[str, npt.NDArray[np.float32], npt.NDArray[np.int32]]] = []

    def ends(self, picture: Picture, origin_m: Vector, direction: Vector) -> RayEnds:
        """Return where rays (n, 3) of unit direction end in a picture. People are called by their
        figures, things by their names in the room, flat stimuli "stimulus".
        """
        origin = np.ascontiguousarray(origin_m, np.float64)
        along = np.ascontiguousarray(direction, np.float64)
        distance_m, met = np.full(len(origin), np.inf), np.full(len(origin), -1)
        if picture.room is not self._room:
            self._room = picture.room
            self._walls = [
                (prop.name, prop.mesh.vertices_m, prop.mesh.triangles)
                for prop in picture.room.props
            ]
        rigid = [
            *self._walls,
            *((m.prop.name, _placed_m(m), m.prop.mesh.triangles) for m in picture.moving),
            *(("stimulus", _corners_m(sheet), PANEL_TRIANGLES) for sheet in picture.sheets),
            *(("board", _corners_m(panel), PANEL_TRIANGLES) for panel in picture.panels),
        ]
        for k, (_, vertices, triangles) in enumerate(rigid):
            meet_triangles(origin, along, vertices, triangles, k, distance_m, met)
        self._meet_people(picture, origin, along, len(rigid), distance_m, met)
        people = [character.name for character in picture.cast]
        every_name = np.array([*(name for name, _, _ in rigid), *people, ""], dtype=object)
        return RayEnds(distance_m, every_name[met])

    def end_m(self, picture: Picture, origin_m: Vector, direction: Vector) -> float:
        """Return how far one ray (3,) of unit direction goes in a picture; inf: for ever."""
        return float(self.ends(picture, origin_m[None], direction[None]).distance_m[0])

    def _meet_people(
        self,
        picture: Picture,
        origin: Vector,
        along: Vector,
        first: int,
        distance_m: Vector,
        met: npt.NDArray[np.int64],
    ) -> None:
        """Skin only those whom some ray passes closely, nearer than what it has met so far."""
        if not len(origin):
            return
        gone_m = np.linalg.norm(picture.people.root_m - origin[0], axis=1)
        near = _near(picture.people.root_m, origin, along, REACH_M, distance_m)
        order = np.argsort(gone_m)
        for k in order[np.any(near[:, order], axis=0)].tolist():
            character, root_m = picture.cast[k], picture.people.root_m[k]
            # What was met meanwhile may hide them.
            passes = _passes(root_m[None], origin, along, REACH_M, distance_m)
            if not passes.any():
                continue
            placement = forward(character.skeleton, root_m, picture.people.orientation_wxyz[k])
            passes &= _passes(placement.position_m, origin, along, FLESH_M, distance_m)
            if not passes.any():
                continue
            mesh = character.levels[min(self._level, len(character.levels) - 1)]
            vertices = skin_vertices(
                mesh, character.skeleton, placement, picture.people.morphs_01[k]
            )
            some_m, some_met = distance_m[passes], met[passes]
            meet_triangles(
                origin[passes], along[passes], vertices, mesh.triangles, first + k, some_m, some_met
            )
            distance_m[passes], met[passes] = some_m, some_met


def _passes(
    points_m: Vector, origin: Vector, along: Vector, within_m: float, distance_m: Vector
) -> npt.NDArray[np.bool_]:
    """Tell which rays (n,) pass some point (p, 3) closely before they end."""
    near = _near(points_m, origin, along, within_m, distance_m)
    passes: npt.NDArray[np.bool_] = np.any(near, axis=1)
    return passes


def _near(
    points_m: Vector, origin: Vector, along: Vector, within_m: float, distance_m: Vector
) -> npt.NDArray[np.bool_]:
    """Tell which rays pass which points closely before they end, (n, p)."""
    to = points_m - origin[:, None]
    ahead = np.einsum("npk,nk->np", to, along)
    aside2 = (to * to).sum(axis=-1) - ahead * ahead
    near: npt.NDArray[np.bool_] = (
        (aside2 < within_m**2) & (-within_m < ahead) & (ahead - within_m < distance_m[:, None])
    )
    return near


def _placed_m(thing: PlacedProp) -> npt.NDArray[np.float32]:
    own = thing.prop.mesh.vertices_m.astype(np.float64)
    return (thing.pose.position_m + rotate(thing.pose.orientation_wxyz, own)).astype(np.float32)


def _corners_m(panel: Panel | Sheet) -> npt.NDArray[np.float32]:
    half = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*panel.size_m, 0.0]
    corners: npt.NDArray[np.float32] = (
        panel.pose.position_m + rotate(panel.pose.orientation_wxyz, half)
    ).astype(np.float32)
    return corners
