"""Integrate the common volume of two surfaces exactly, up to rounding.

Between neighbouring places along x where a vertex lies or two faces' edges pierce each other, the
common cross-section is a polygon whose corners move on straight lines: its area is quadratic in x
and two Gauss points integrate it exactly. Within a cross-section the common length of a column is
linear between neighbouring corners, and its middle integrates it exactly.
"""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.columns import bounds, faces_near, sides_of
from visavis.analysis.collisions.contact import edges_through
from visavis.analysis.collisions.meshes import Faces
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_GAUSS = 0.5 / np.sqrt(3.0)
_ROUNDING_M3 = 1e-18
"""Rounding errors sum to less; a millionth of a cubic millimetre is a thousand times as much."""


@compiled
def exact_volume(
    vertices_a: Vector, faces_a: Faces, vertices_b: Vector, faces_b: Faces
) -> tuple[float, Vector]:
    """Return the common volume and its centre (3,), NaN where nothing is common."""
    box_a, box_b = bounds(vertices_a), bounds(vertices_b)
    low, high = np.maximum(box_a[0], box_b[0]), np.minimum(box_a[1], box_b[1])
    moment = np.zeros(3)
    if low[0] >= high[0] or low[1] >= high[1] or low[2] >= high[2]:
        return 0.0, moment * np.nan
    low[1] = -np.inf  # columns run along y and must meet all that lies below
    near_a = faces_near(faces_a, sides_of(vertices_a, low, high))
    near_b = faces_near(faces_b, sides_of(vertices_b, low, high))
    n_a, n = near_a.size, near_a.size + near_b.size
    corners = np.empty((n, 3, 3))
    for i in range(n_a):
        for k in range(3):
            corners[i, k] = vertices_a[faces_a[near_a[i], k]]
    for i in range(n_a, n):
        for k in range(3):
            corners[i, k] = vertices_b[faces_b[near_b[i - n_a], k]]
    events = _events(corners, low[0], high[0])
    begins, ends = np.empty(n), np.empty(n)
    for i in range(n):
        begins[i] = min(corners[i, 0, 0], corners[i, 1, 0], corners[i, 2, 0])
        ends[i] = max(corners[i, 0, 0], corners[i, 1, 0], corners[i, 2, 0])
    # Sweep along x: `active` are the faces that reach across the slab between two events.
    order = np.argsort(begins)
    active = np.empty(n, np.int64)
    n_active, following = 0, 0
    volume = 0.0
    for e in range(events.size - 1):
        width = events[e + 1] - events[e]
        middle = (events[e] + events[e + 1]) / 2
        if width <= 0.0:
            continue
        while following < n and begins[order[following]] < middle:
            active[n_active] = order[following]
            n_active += 1
            following += 1
        n_kept = 0
        for i in range(n_active):
            if ends[active[i]] > middle:
                active[n_kept] = active[i]
                n_kept += 1
        n_active = n_kept
        # The area is quadratic within a slab, so two Gauss points integrate it exactly.
        for side in (-_GAUSS, _GAUSS):
            x = middle + side * width
            area, area_z, area_y = _section(corners, active[:n_active], n_a, x, low[2], high[2])
            volume += width / 2 * area
            moment[0] += width / 2 * area * x
            moment[1] += width / 2 * area_y
            moment[2] += width / 2 * area_z
    if volume <= _ROUNDING_M3:
        return 0.0, moment * np.nan
    return volume, moment / volume


@compiled
def _events(corners: Vector, low_x: float, high_x: float) -> Vector:
    """Return sorted places along x where the cross-section changes its shape."""
    n = corners.shape[0]
    places = np.empty(3 * n + 1024)
    places[0], places[1] = low_x, high_x
    n_places = 2
    vertices = corners.reshape((3 * n, 3))
    faces = np.arange(3 * n).astype(np.int32).reshape((n, 3))
    boxes = np.empty((n, 6))
    for i in range(n):
        for k in range(3):
            p, q, r = corners[i, 0, k], corners[i, 1, k], corners[i, 2, k]
            boxes[i, k], boxes[i, k + 3] = min(p, q, r), max(p, q, r)
            if low_x < corners[i, k, 0] < high_x:
                places[n_places] = corners[i, k, 0]
                n_places += 1
    # Faces in order of their lowest x, so that a face is compared only with those that overlap it.
    order = np.argsort(boxes[:, 0])
    span = np.empty((2, 3))
    for one in range(n):
        i = order[one]
        for two in range(one + 1, n):
            j = order[two]
            if boxes[j, 0] > boxes[i, 3]:
                break
            if (
                boxes[i, 1] > boxes[j, 4]
                or boxes[j, 1] > boxes[i, 4]
                or boxes[i, 2] > boxes[j, 5]
                or boxes[j, 2] > boxes[i, 5]
            ):
                continue
            span[0], span[1] = np.inf, -np.inf
            n_meetings = edges_through(vertices, faces, i, vertices, faces, j, span)
            n_meetings += edges_through(vertices, faces, j, vertices, faces, i, span)
            if n_meetings == 0:
                continue
            # Two crossing faces share a segment; the cross-section changes at both of its ends.
            if n_places + 2 > places.size:
                places = np.append(places, np.empty(places.size))
            places[n_places], places[n_places + 1] = span[0, 0], span[1, 0]
            n_places += 2
    events = np.sort(places[:n_places])
    return events[(events >= low_x) & (events <= high_x)]


@compiled
def _section(
    corners: Vector, active: npt.NDArray[np.int64], n_a: int, x: float, low_z: float, high_z: float
) -> tuple[float, float, float]:
    """Return the common area at x and its moments along z and y."""
    n = active.size
    ends = np.empty((n, 4))  # z, y of the left end and of the right end
    step = np.empty(n, np.int8)
    places = np.empty(2 * n + 66)
    places[0], places[1] = low_z, high_z
    n_places = 2
    k = 0
    for m in range(n):
        f = active[m]
        # The face cuts the plane in a segment; its direction says on which side of it inside lies.
        z_up = z_down = y_up = y_down = 0.0
        for c in range(3):
            p, q = corners[f, c], corners[f, (c + 1) % 3]
            if (p[0] <= x) == (q[0] <= x):
                continue
            if p[0] <= x:
                t = (x - p[0]) / (q[0] - p[0])
                z_up, y_up = p[2] + t * (q[2] - p[2]), p[1] + t * (q[1] - p[1])
            else:
                t = (x - q[0]) / (p[0] - q[0])
                z_down, y_down = q[2] + t * (p[2] - q[2]), q[1] + t * (p[1] - q[1])
        if z_up == z_down:
            continue
        if z_down < z_up:
            ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3] = z_down, y_down, z_up, y_up
            step[k] = -1
        else:
            ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3] = z_up, y_up, z_down, y_down
            step[k] = 1
        if f >= n_a:
            step[k] *= 2
        places[n_places], places[n_places + 1] = ends[k, 0], ends[k, 2]
        n_places += 2
        k += 1
    # Where two segments cross, the order of heights changes: another place along z.
    order = np.argsort(ends[:k, 0])
    for one in range(k):
        i = order[one]
        for two in range(one + 1, k):
            j = order[two]
            if ends[j, 0] >= ends[i, 2]:
                break
            slope_i = (ends[i, 3] - ends[i, 1]) / (ends[i, 2] - ends[i, 0])
            slope_j = (ends[j, 3] - ends[j, 1]) / (ends[j, 2] - ends[j, 0])
            if slope_i == slope_j:
                continue
            gap = ends[j, 1] - (ends[i, 1] + (ends[j, 0] - ends[i, 0]) * slope_i)
            z = ends[j, 0] + gap / (slope_i - slope_j)
            if ends[j, 0] < z < min(ends[i, 2], ends[j, 2]):
                if n_places == places.size:
                    places = np.append(places, np.empty(places.size))
                places[n_places] = z
                n_places += 1
    places = np.sort(places[:n_places])
    # Sweep along z. Heights are kept sorted by insertion: the order hardly changes between places.
    area = area_z = area_y = 0.0
    active_here = np.empty(k, np.int64)
    heights = np.empty(k)
    steps = np.empty(k, np.int8)
    n_here, following = 0, 0
    for e in range(places.size - 1):
        width = places[e + 1] - places[e]
        z = (places[e] + places[e + 1]) / 2
        if width <= 0.0 or z < low_z or z > high_z:
            continue
        while following < k and ends[order[following], 0] < z:
            active_here[n_here] = order[following]
            n_here += 1
            following += 1
        n_kept = 0
        for i in range(n_here):
            s = active_here[i]
            if ends[s, 2] <= z:
                continue
            active_here[n_kept] = s
            t = (z - ends[s, 0]) / (ends[s, 2] - ends[s, 0])
            y = ends[s, 1] + t * (ends[s, 3] - ends[s, 1])
            j = n_kept - 1
            while j >= 0 and heights[j] > y:
                heights[j + 1], steps[j + 1] = heights[j], steps[j]
                j -= 1
            heights[j + 1], steps[j + 1] = y, step[s]
            n_kept += 1
        n_here = n_kept
        # Upwards along y the winding numbers tell which stretches lie inside both bodies.
        in_a = in_b = 0
        for i in range(n_here - 1):
            if steps[i] == 1 or steps[i] == -1:
                in_a += steps[i]
            else:
                in_b += steps[i] // 2
            if in_a > 0 and in_b > 0:
                length = heights[i + 1] - heights[i]
                area += width * length
                area_z += width * length * z
                area_y += width * length * (heights[i + 1] + heights[i]) / 2
    return area, area_z, area_y
