"""A closed body mesh built round the capsules of a person, posed by the joints it hangs on."""

from dataclasses import dataclass
from functools import cache
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from analysis.collisions import ClosedMesh, capsule, union
from lab.compiled import compiled
from lab.geometry import Vector
from stimuli.contact.body import capsule_body
from stimuli.contact.figures import crowd_figures

Detail: TypeAlias = Literal["fine", "light"]

ROUNDNESS: Final[dict[Detail, tuple[int, int]]] = {"fine": (28, 7), "light": (14, 3)}
"""Segments round and rings per half: about 15,000 triangles, or 3,000 for quick looks."""


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Vertices (n, 3) in their joint's frame at rest for a stature of 1 m, the joint column (n,)
    of each in `BODY_JOINTS`, and faces (m, 3).
    """

    vertices_m: Vector
    column: npt.NDArray[np.int64]
    faces: npt.NDArray[np.int32]

    def posed(self, position_m: Vector, orientation_wxyz: Vector, stature_m: float) -> ClosedMesh:
        """Return the mesh at joints (22, 3) and (22, 4) of a person of this stature."""
        vertices = np.empty_like(self.vertices_m)
        _pose(self.vertices_m, self.column, position_m, orientation_wxyz, stature_m, vertices)
        return ClosedMesh(vertices, self.faces)


@cache
def body_mesh(detail: Detail = "fine", figure: int | None = None) -> BodyMesh:
    """Return the mesh of a person; overlapping parts count once, as a surface winds.

    Without `figure` it is the participant's at a stature of 1 m; `figure` is a row of
    `crowd_figures`, in that person's own size.
    """
    if figure is None:
        body = capsule_body(1.0)
        columns, starts, ends, radii = body.columns, body.start_m, body.end_m, body.radius_m
    else:
        own = crowd_figures()
        columns, starts, ends, radii = (
            own.columns, own.start_m[figure], own.end_m[figure], own.radius_m[figure]
        )  # fmt: skip
    segments, rings = ROUNDNESS[detail]
    parts = [
        capsule(start, end, radius, segments=segments, rings=rings)
        for start, end, radius in zip(starts, ends, radii, strict=True)
    ]
    whole = union(parts)
    column = np.repeat(columns, [len(p.vertices_m) for p in parts])
    return BodyMesh(np.ascontiguousarray(whole.vertices_m), column, whole.faces)


@compiled
def _pose(
    rest: Vector,
    column: npt.NDArray[np.int64],
    position: Vector,
    world: Vector,
    scale: float,
    out: Vector,
) -> None:
    for i in range(rest.shape[0]):
        j = column[i]
        w, x, y, z = world[j, 0], world[j, 1], world[j, 2], world[j, 3]
        vx, vy, vz = scale * rest[i, 0], scale * rest[i, 1], scale * rest[i, 2]
        tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
        out[i, 0] = position[j, 0] + vx + w * tx + y * tz - z * ty
        out[i, 1] = position[j, 1] + vy + w * ty + z * tx - x * tz
        out[i, 2] = position[j, 2] + vz + w * tz + x * ty - y * tx
