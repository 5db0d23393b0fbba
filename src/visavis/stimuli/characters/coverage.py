"""Visible area of each body part from afar, which a lighter mesh must preserve."""

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX, PARTS
from visavis.stimuli.characters.character import SkinnedMesh

SIDE_DEG: Final = 40.0


@compiled
def _draw(
    x: Vector,
    y: Vector,
    depth: Vector,
    triangles: npt.NDArray[np.int32],
    tags: npt.NDArray[np.uint8],
    nearest: Vector,
    tag_image: npt.NDArray[np.uint8],
) -> None:
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
        if area == 0:
            continue
        low_x = max(int(np.ceil(min(x[a], x[b], x[c]))), 0)
        high_x = min(int(np.floor(max(x[a], x[b], x[c]))), tag_image.shape[1] - 1)
        low_y = max(int(np.ceil(min(y[a], y[b], y[c]))), 0)
        high_y = min(int(np.floor(max(y[a], y[b], y[c]))), tag_image.shape[0] - 1)
        for row in range(low_y, high_y + 1):
            for column in range(low_x, high_x + 1):
                # Barycentric coordinates of the pixel's middle; all ≥ 0 inside.
                v = ((column - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (row - y[a])) / area
                w = ((x[b] - x[a]) * (row - y[a]) - (column - x[a]) * (y[b] - y[a])) / area
                if v >= 0 and w >= 0 and v + w <= 1:
                    z = depth[a] + v * (depth[b] - depth[a]) + w * (depth[c] - depth[a])
                    if z < nearest[row, column]:
                        nearest[row, column] = z
                        tag_image[row, column] = tags[t]


def view_from(yaw_deg: float, down_deg: float = 0.0) -> Vector:
    """Return the axes (3, 3) of an observer, rows right, up and away from it, who stands in front
    (−z) or `yaw_deg` towards the person's left of that and looks down so far.
    """
    s, c = np.sin(np.radians(yaw_deg)), np.cos(np.radians(yaw_deg))
    low, level = np.sin(np.radians(down_deg)), np.cos(np.radians(down_deg))
    axes: Vector = np.array([[c, 0, -s], [s * low, level, c * low], [s * level, -low, c * level]])
    return axes


def seen_tags(
    vertices_m: Vector,
    triangles: npt.NDArray[np.int32],
    tags: npt.NDArray[np.uint8],
    view: Vector,
    step_m: float,
    within_m: npt.NDArray[np.float32] | None = None,
) -> npt.NDArray[np.uint8]:
    """Return the tags (rows, columns) of the triangles that parallel rays `step_m` apart meet
    first, 0 where they meet none; rows go up.

    `tags` (t,) are the triangles'; `view` (3, 3) is as of `view_from`. Rays pass where the points
    `within_m` (n, 3) lie, everywhere when None.
    """
    across, up, depth = view @ vertices_m.T
    frame = (view @ (vertices_m if within_m is None else within_m).T)[:2]
    low, high = frame.min(axis=1), frame.max(axis=1)
    x, y = (across - low[0]) / step_m + 1.3, (up - low[1]) / step_m + 1.3
    shape = (int((high[1] - low[1]) / step_m) + 4, int((high[0] - low[0]) / step_m) + 4)
    tag_image = np.zeros(shape, dtype=np.uint8)
    _draw(x, y, depth, triangles, tags, np.full(shape, np.inf), tag_image)
    return tag_image


def visible_area_m2(
    mesh: SkinnedMesh,
    vertices_m: npt.NDArray[np.float32] | None = None,
    yaw_deg: float = 0.0,
    step_m: float = 0.002,
    within_m: npt.NDArray[np.float32] | None = None,
) -> dict[str, float]:
    """Return the square metres of each part seen from far away, by parallel rays `step_m` apart.

    `vertices_m` are posed vertices; at rest when None. The observer stands in front (−z), or
    `yaw_deg` towards the person's left of that. Rays pass where the points `within_m` (n, 3)
    lie, everywhere when None.
    """
    vertices = np.asarray(mesh.vertices_m if vertices_m is None else vertices_m, dtype=np.float64)
    view = view_from(yaw_deg)
    tag_image = seen_tags(vertices, mesh.triangles, mesh.triangle_part, view, step_m, within_m)
    count = np.bincount(tag_image.ravel(), minlength=len(PARTS))
    return {part: float(count[i]) * step_m**2 for i, part in enumerate(PARTS) if i}


def seen_areas_m2(
    mesh: SkinnedMesh, vertices_m: npt.NDArray[np.float32] | None = None, step_m: float = 0.002
) -> Vector:
    """Return the areas (parts,) in the order of `PARTS`, as the mean of views from the front and
    from `SIDE_DEG` to either side.
    """
    views = [visible_area_m2(mesh, vertices_m, yaw, step_m) for yaw in (-SIDE_DEG, 0.0, SIDE_DEG)]
    areas = np.array([np.mean([view.get(part, 0.0) for view in views]) for part in PARTS])
    # Eyes are small: they are seen again, alone with what may hide them, by finer rays.
    points = mesh.vertices_m if vertices_m is None else vertices_m
    eyes = np.isin(mesh.triangle_part, (PART_INDEX["left_eye"], PART_INDEX["right_eye"]))
    if not eyes.any():
        return areas
    corners = points[mesh.triangles]
    low, high = (f(corners[eyes], axis=(0, 1)) for f in (np.min, np.max))
    reach = (high[0] - low[0]) * np.array([0.4, 0.15, 4.0])
    near = ((corners.max(axis=1) > low - reach) & (corners.min(axis=1) < high + reach)).all(axis=1)
    part = replace(mesh, triangles=mesh.triangles[near], triangle_part=mesh.triangle_part[near])
    vertex_numbers, index = np.unique(part.triangles, return_inverse=True)
    part = replace(part, triangles=index.reshape(-1, 3).astype(np.int32))
    ball = points[np.unique(mesh.triangles[eyes])]
    views = [
        visible_area_m2(part, points[vertex_numbers], yaw, step_m / 5, ball)
        for yaw in (-SIDE_DEG, 0.0, SIDE_DEG)
    ]
    for eye in ("left_eye", "right_eye"):
        areas[PART_INDEX[eye]] = np.mean([view[eye] for view in views])
    return areas
