"""Closed, outward-facing triangle meshes, and how to build them from a file or a rig."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.errors import MalformedMesh, NonFiniteMesh
from visavis.analysis.collisions.repair import repaired_faces
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Faces = npt.NDArray[np.int32]

SMALL_HOLE_M = 0.10
"""Perimeter up to which a hole is closed by flat triangles; larger ones are refused."""


@dataclass(frozen=True)
class ClosedMesh:
    """A surface that encloses a body; it may overlap itself, as skinned people do at the joints.

    `vertices_m` (n, 3) float64, `faces` (m, 3) int32, counter-clockwise seen from outside. A point
    is inside where the surface winds round it more than zero times, so overlapping parts count
    once and a cavity (a part turned inside out within another) counts as outside. `repairs` says
    in words what `closed_mesh` changed. Build it with `closed_mesh`, move it with `mesh_in_pose`.
    """

    vertices_m: Vector
    faces: Faces
    repairs: tuple[str, ...] = ()


def closed_mesh(
    vertices_m: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    name: str = "mesh",
    largest_hole_m: float = SMALL_HOLE_M,
) -> ClosedMesh:
    """Check a mesh, and repair it where that cannot change the body.

    Vertices at equal places are joined, collapsed faces are dropped, a surface drawn from both
    sides keeps one of them, faces are turned to agree with their neighbours, parts that are inside
    out are turned (a cavity inside another part stays), and holes of a perimeter up to
    `largest_hole_m` are closed. Vertices keep their number and order, so a rig's skin still fits.
    Raises NonFiniteMesh, MalformedMesh (also when nothing is enclosed), OpenMesh or NotOrientable,
    each naming the mesh.
    """
    vertices = np.array(vertices_m, dtype=np.float64, order="C")
    triangles = np.array(faces)
    if vertices.ndim != 2 or vertices.shape[1:] != (3,):
        raise MalformedMesh(f"{name}: vertices have shape {vertices.shape}; give (n, 3)")
    if triangles.ndim != 2 or triangles.shape[1:] != (3,) or len(triangles) == 0:
        raise MalformedMesh(f"{name}: faces have shape {triangles.shape}; give (m, 3) triangles")
    if not np.issubdtype(triangles.dtype, np.integer):
        raise MalformedMesh(f"{name}: faces are {triangles.dtype}; give whole vertex numbers")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        row = int(np.argmax((triangles < 0).any(1) | (triangles >= len(vertices)).any(1)))
        raise MalformedMesh(
            f"{name}: face {row} names vertex {triangles[row].tolist()} of {len(vertices)}; "
            "export the mesh again"
        )
    require_finite(vertices, name)
    outward_faces, repairs = repaired_faces(
        vertices, triangles.astype(np.int32), name, largest_hole_m
    )
    return ClosedMesh(vertices, outward_faces, repairs)


def mesh_in_pose(mesh: ClosedMesh, vertices_m: npt.ArrayLike, *, name: str = "mesh") -> ClosedMesh:
    """Return the mesh with its vertices elsewhere; only their number and values are checked."""
    vertices = np.ascontiguousarray(vertices_m, dtype=np.float64)
    if vertices.shape != mesh.vertices_m.shape:
        raise MalformedMesh(
            f"{name}: the pose has vertices {vertices.shape} but the mesh {mesh.vertices_m.shape}; "
            "pose the mesh that was loaded"
        )
    require_finite(vertices, name)
    return ClosedMesh(vertices, mesh.faces, mesh.repairs)


def require_finite(vertices_m: Vector, name: str) -> None:
    """Raise NonFiniteMesh naming the first vertex that is NaN or infinite."""
    row = first_non_finite(vertices_m)
    if row >= 0:
        raise NonFiniteMesh(
            f"{name}: vertex {row} is {vertices_m[row].tolist()}; "
            "leave out the steps where tracking was lost"
        )


@compiled
def first_non_finite(vertices_m: Vector) -> int:
    """Return the first row that is not finite, -1 when all are."""
    total = 0.0
    for i in range(vertices_m.shape[0]):
        total += (vertices_m[i, 0] + vertices_m[i, 1] + vertices_m[i, 2]) * 0.0
    if total == 0.0:
        return -1
    for i in range(vertices_m.shape[0]):
        for k in range(3):
            if not np.isfinite(vertices_m[i, k]):
                return i
    return -1


def enclosed_volume_m3(mesh: ClosedMesh) -> float:
    """Return the signed volume by the divergence theorem; self-overlap counts twice here."""
    a, b, c = np.moveaxis(mesh.vertices_m[mesh.faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
