"""Collisions: the common volume of bodies given as closed triangle meshes, and its time course.

Every result says by which rule it was measured: `volume` (the true common volume, the default),
`centres` or `published` (two ways of counting 1 cm cubes). Surfaces are read by winding number,
so a skinned person who overlaps himself at the joints counts once.
"""

from visavis.analysis.collisions.errors import (
    CollisionError,
    MalformedMesh,
    MalformedSeries,
    NonFiniteMesh,
    NotOrientable,
    OpenMesh,
    TooLargeForVoxels,
)
from visavis.analysis.collisions.meshes import (
    ClosedMesh,
    closed_mesh,
    enclosed_volume_m3,
    mesh_in_pose,
)
from visavis.analysis.collisions.series import Collision, find_collisions, nearest_part, speed_at
from visavis.analysis.collisions.shapes import box, capsule, inside_out, sphere, union
from visavis.analysis.collisions.volume import (
    CommonVolume,
    Rule,
    Settings,
    common_volume,
)

__all__ = [
    "ClosedMesh",
    "Collision",
    "CollisionError",
    "CommonVolume",
    "MalformedMesh",
    "MalformedSeries",
    "NonFiniteMesh",
    "NotOrientable",
    "OpenMesh",
    "Rule",
    "Settings",
    "TooLargeForVoxels",
    "box",
    "capsule",
    "closed_mesh",
    "common_volume",
    "enclosed_volume_m3",
    "find_collisions",
    "inside_out",
    "mesh_in_pose",
    "nearest_part",
    "speed_at",
    "sphere",
    "union",
]
