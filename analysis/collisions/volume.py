"""Measure the common volume of two bodies by a named rule."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from visavis.analysis.collisions.errors import CollisionError, TooLargeForVoxels
from visavis.analysis.collisions.exact import exact_volume
from visavis.analysis.collisions.meshes import ClosedMesh
from visavis.analysis.collisions.pair import measure_pair
from visavis.analysis.collisions.voxels import (
    cubes_centred_in,
    cubes_touching,
    lattice_of_common_box,
)
from visavis.lab.geometry import Vector

Rule: TypeAlias = Literal["volume", "centres", "published"]
Method: TypeAlias = Literal["columns", "exact", "cubes"]

MAX_CUBES = 200_000_000


@dataclass(frozen=True)
class Settings:
    """Say how a volume is measured; every field appears in a report's provenance.

    `cell_m` is the distance of columns, or the side of cubes. Under rule `volume`, results
    below `refine_below_m3` (zero included) are measured again with about `fine_columns` columns
    where the surfaces cross, and two meshes of together at most `exact_faces` faces are
    integrated exactly instead; `always_exact` does so for any mesh, in seconds rather than
    milliseconds. Under rule `published`, `require_contact` reports nothing for bodies that touch
    common cubes but not each other.
    """

    cell_m: float = 0.01
    refine_below_m3: float = 3e-4
    fine_columns: int = 1000
    exact_faces: int = 200
    always_exact: bool = False
    require_contact: bool = True


@dataclass(frozen=True)
class CommonVolume:
    """The common volume of two bodies.

    `volume_m3` by `rule`; `centre_m` (3,) its centroid, NaN where there is none; `cell_m` the
    distance of columns or side of cubes that gave it, 0 where it was integrated exactly;
    `n_cells` the cubes counted, or the stretches of column measured. `contact` tells whether the
    bodies truly share volume; None where `require_contact` is off.
    """

    volume_m3: float
    rule: Rule
    method: Method
    cell_m: float
    n_cells: int
    centre_m: Vector
    contact: bool | None


DEFAULT = Settings()


def common_volume(
    a: ClosedMesh, b: ClosedMesh, rule: Rule = "volume", *, settings: Settings = DEFAULT
) -> CommonVolume:
    """Measure what two bodies have in common.

    - `volume`: the true common volume, exact along columns, midpoint rule across them.
    - `centres`: cubes of the lattice through the origin whose centre lies in both, times their
      volume; unbiased, and blind to bodies thinner than a cube.
    - `published`: cubes that touch both bodies, as voxel counting in the literature does;
      larger than the volume by about surface times side, so about twice it for people.

    A body is where its surface winds round a point more than zero times. Raises
    TooLargeForVoxels when the common box holds more than 2e8 cubes.
    """
    if rule == "volume":
        return _true_volume(a, b, settings)
    if rule not in ("centres", "published"):
        raise CollisionError(f"unknown rule {rule!r}; use 'volume', 'centres' or 'published'")
    cell = settings.cell_m
    contact: bool | None = None
    if rule == "published" and settings.require_contact:
        contact = _true_volume(a, b, settings).volume_m3 > 0
    first, shape = lattice_of_common_box(a.vertices_m, b.vertices_m, cell)
    n_cubes = float(np.prod(shape.astype(float)))
    if n_cubes > MAX_CUBES:
        raise TooLargeForVoxels(
            f"the common box of the two meshes holds {n_cubes:.1e} cubes of {cell} m; "
            "use rule 'volume', or larger cubes (cell_m)"
        )
    count, total = 0, np.zeros(3)
    if n_cubes > 0 and contact is not False:
        measure = cubes_centred_in if rule == "centres" else cubes_touching
        count, total = measure(a.vertices_m, a.faces, b.vertices_m, b.faces, first, shape, cell)
    centre = total / count if count else np.full(3, np.nan)
    return CommonVolume(count * cell**3, rule, "cubes", cell, count, centre, contact)


def _true_volume(a: ClosedMesh, b: ClosedMesh, settings: Settings) -> CommonVolume:
    meshes = a.vertices_m, a.faces, b.vertices_m, b.faces
    if settings.always_exact or len(a.faces) + len(b.faces) <= settings.exact_faces:
        volume, centre = exact_volume(*meshes)
        return CommonVolume(volume, "volume", "exact", 0.0, 0, centre, volume > 0)
    volume, centre, cell, n, _ = measure_pair(
        *meshes, settings.cell_m, settings.refine_below_m3, settings.fine_columns
    )
    return CommonVolume(volume, "volume", "columns", cell, n, centre, volume > 0)
