"""How much of each body part is seen from afar: what a lighter mesh must not change."""

from typing import Final

import numpy as np
import numpy.typing as npt

from lab.compiled import compiled
from lab.geometry import Vector
from stimuli.characters.body_parts import PARTS
from stimuli.characters.character import SkinnedMesh

SIDE_DEG: Final = 40.0


@compiled
def _draw(
    x: Vector, y: Vector, depth: Vector, triangles: npt.NDArray[np.int32],
    tags: npt.NDArray[np.uint8], nearest: Vector, seen: npt.NDArray[np.uint8],
) -> None:  # fmt: skip
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
        if area == 0:
            continue
        low_x = max(int(np.ceil(min(x[a], x[b], x[c]))), 0)
        high_x = min(int(np.floor(max(x[a], x[b], x[c]))), seen.shape[1] - 1)
        low_y = max(int(np.ceil(min(y[a], y[b], y[c]))), 0)
        high_y = min(int(np.floor(max(y[a], y[b], y[c]))), seen.shape[0] - 1)
        for row in range(low_y, high_y + 1):
            for column in range(low_x, high_x + 1):
                v = ((column - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (row - y[a])) / area
                w = ((x[b] - x[a]) * (row - y[a]) - (column - x[a]) * (y[b] - y[a])) / area
                if v >= 0 and w >= 0 and v + w <= 1:
                    z = depth[a] + v * (depth[b] - depth[a]) + w * (depth[c] - depth[a])
                    if z < nearest[row, column]:
                        nearest[row, column] = z
                        seen[row, column] = tags[t]


def visible_area_m2(
    mesh: SkinnedMesh,
    vertices_m: npt.NDArray[np.float32] | None = None,
    yaw_deg: float = 0.0,
    step_m: float = 0.002,
) -> dict[str, float]:
    """Return the square metres of each part seen from far away, by parallel rays `step_m` apart.

    `vertices_m` are posed vertices; at rest when None. The observer stands in front (−z), or
    `yaw_deg` towards the person's left of that.
    """
    vertices = np.asarray(mesh.vertices_m if vertices_m is None else vertices_m, dtype=np.float64)
    s, c = np.sin(np.radians(yaw_deg)), np.cos(np.radians(yaw_deg))
    across = c * vertices[:, 0] - s * vertices[:, 2]
    depth = c * vertices[:, 2] + s * vertices[:, 0]
    x = (across - across.min()) / step_m + 1.3
    y = (vertices[:, 1] - vertices[:, 1].min()) / step_m + 1.3
    shape = (int(y.max()) + 3, int(x.max()) + 3)
    seen = np.zeros(shape, dtype=np.uint8)
    nearest = np.full(shape, np.inf)
    _draw(x, y, depth, mesh.triangles, mesh.triangle_part, nearest, seen)
    count = np.bincount(seen.ravel(), minlength=len(PARTS))
    return {part: float(count[i]) * step_m**2 for i, part in enumerate(PARTS) if i}


def seen_areas_m2(
    mesh: SkinnedMesh, vertices_m: npt.NDArray[np.float32] | None = None, step_m: float = 0.002
) -> Vector:
    """Return the areas (parts,) in the order of `PARTS`, as the mean of views from the front and
    from `SIDE_DEG` to either side.
    """
    views = [visible_area_m2(mesh, vertices_m, yaw, step_m) for yaw in (-SIDE_DEG, 0.0, SIDE_DEG)]
    return np.array([np.mean([view.get(part, 0.0) for view in views]) for part in PARTS])
