"""A place from a drawing of its floor: an outline, holes in it, walls all along."""

from collections.abc import Sequence

import numpy as np
import shapely

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.picture import Prop, Room, StaticMesh
from visavis.stimuli.rooms import furniture
from visavis.stimuli.rooms.solids import flat, join_meshes

Outline = Sequence[Sequence[float]]
FLOOR = (170, 166, 158)
WALL = (210, 206, 198)


def outlined_room(name: str, outline_m: Outline, holes_m: Sequence[Outline], wall_m: float) -> Room:
    """Return a place whose floor (x, z at height 0) has an outline and holes, walls on every side.

    Raises:
        DesignError: the outline crosses itself, or a hole lies outside it.
    """
    area = shapely.Polygon(outline_m, holes_m)
    if not area.is_valid or area.area <= 0 or wall_m <= 0:
        why = shapely.is_valid_reason(area)
        raise DesignError(f"{name}: no floor with walls of {wall_m} m has this outline: {why}")
    rings = [np.array(r.coords)[:-1] for r in (area.exterior, *area.interiors)]
    walls = join_meshes(
        *(
            flat((a[0], 0.0, a[1]), (b[0] - a[0], 0.0, b[1] - a[1]), (0.0, wall_m, 0.0), WALL)
            for ring in rings
            for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)
        )
    )
    return Room(
        name=name,
        props=(_floor(area), furniture.place_prop("walls", walls, (0, 0, 0), 0.0)),
        lights=(),
        sky=np.full(3, 0.7),
        ground=np.full(3, 0.5),
    )


def _floor(area: shapely.Polygon) -> Prop:
    parts = shapely.constrained_delaunay_triangles(area).geoms
    corners: Vector = np.array([np.array(p.exterior.coords)[:3] for p in parts])
    a, b, c = corners.transpose(1, 0, 2)
    down = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) > (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    corners[down] = corners[down][:, ::-1]
    flat_xz = corners.reshape(-1, 2)
    n = len(flat_xz)
    mesh = StaticMesh(
        np.stack([flat_xz[:, 0], np.zeros(n), flat_xz[:, 1]], 1).astype(np.float32),
        np.tile(np.array([0, 1, 0], dtype=np.float32), (n, 1)),
        np.tile(np.array(FLOOR, dtype=np.uint8), (n, 1)),
        np.arange(n, dtype=np.int32).reshape(-1, 3),
    )
    return furniture.place_prop("floor", mesh, (0, 0, 0), 0.0)
