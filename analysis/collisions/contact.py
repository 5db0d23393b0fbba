"""Find where two surfaces cross: the box around their crossing curves."""

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.meshes import Faces
from visavis.analysis.collisions.tiles import Crossings
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

_BUCKET_M = 0.03
_SLACK = 1e-12


@compiled
def crossing_box(
    vertices_a: Vector,
    faces_a: Faces,
    near_a: Crossings,
    vertices_b: Vector,
    faces_b: Faces,
    near_b: Crossings,
    low_m: Vector,
    high_m: Vector,
) -> tuple[int, Vector]:
    """Return how often an edge of one surface meets a face of the other, and the box (2, 3).

    Only faces that reach into the box `low_m`..`high_m` are looked at. Zero meetings mean that
    the surfaces are apart or one encloses the other.
    """
    # Divide the box into buckets of about 3 cm, so that a face is compared with near ones alone.
    size = np.empty(3)
    shape = np.empty(3, np.int64)
    for k in range(3):
        extent = max(high_m[k] - low_m[k], 1e-9)
        shape[k] = min(64, int(extent / _BUCKET_M) + 1)
        size[k] = extent / shape[k]
    boxes, spans = _boxes(vertices_b, faces_b, near_b, low_m, high_m, size, shape)
    mine, reach = _boxes(vertices_a, faces_a, near_a, low_m, high_m, size, shape)
    # Bit 1: surface b reaches the bucket, bit 2: a does. Without a common bucket nothing crosses.
    marks = np.zeros(shape[0] * shape[1] * shape[2], np.uint8)
    _mark(spans, shape, marks, 1)
    if not _mark(reach, shape, marks, 2):
        return 0, np.full((2, 3), np.nan)
    # Faces of b as linked lists, one for each bucket that both surfaces reach.
    head = np.full(marks.size, -1, np.int32)
    entries = _entries(spans, shape, marks)
    after = np.empty(entries, np.int32)
    owner = np.empty(entries, np.int32)
    n = 0
    for j in range(near_b.shape[0]):
        for x in range(spans[j, 0], spans[j, 3]):
            for y in range(spans[j, 1], spans[j, 4]):
                for z in range(spans[j, 2], spans[j, 5]):
                    bucket = (x * shape[1] + y) * shape[2] + z
                    if marks[bucket] != 3:
                        continue
                    after[n], owner[n] = head[bucket], j
                    head[bucket] = n
                    n += 1
    # A pair that shares several buckets is met in each; only zero or not matters to callers.
    box = np.empty((2, 3))
    box[0], box[1] = np.inf, -np.inf
    n_meetings = 0
    for i in range(near_a.shape[0]):
        for x in range(reach[i, 0], reach[i, 3]):
            for y in range(reach[i, 1], reach[i, 4]):
                for z in range(reach[i, 2], reach[i, 5]):
                    entry = head[(x * shape[1] + y) * shape[2] + z]
                    while entry >= 0:
                        j = owner[entry]
                        entry = after[entry]
                        if (
                            mine[i, 0] > boxes[j, 3]
                            or boxes[j, 0] > mine[i, 3]
                            or mine[i, 1] > boxes[j, 4]
                            or boxes[j, 1] > mine[i, 4]
                            or mine[i, 2] > boxes[j, 5]
                            or boxes[j, 2] > mine[i, 5]
                        ):
                            continue
                        f, g = near_a[i], near_b[j]
                        n_meetings += edges_through(
                            vertices_a, faces_a, f, vertices_b, faces_b, g, box
                        )
                        n_meetings += edges_through(
                            vertices_b, faces_b, g, vertices_a, faces_a, f, box
                        )
    return n_meetings, box


@compiled
def _mark(
    spans: Crossings, shape: npt.NDArray[np.int64], marks: npt.NDArray[np.uint8], bit: int
) -> bool:
    """Set a bit in all buckets reached; tell whether one of them had another bit already."""
    any_overlap = False
    for j in range(spans.shape[0]):
        for x in range(spans[j, 0], spans[j, 3]):
            for y in range(spans[j, 1], spans[j, 4]):
                for z in range(spans[j, 2], spans[j, 5]):
                    bucket = (x * shape[1] + y) * shape[2] + z
                    marks[bucket] |= bit
                    any_overlap |= marks[bucket] != bit
    return any_overlap


@compiled
def _entries(spans: Crossings, shape: npt.NDArray[np.int64], marks: npt.NDArray[np.uint8]) -> int:
    """Count the buckets that both surfaces reach, each as often as it is reached."""
    n = 0
    for j in range(spans.shape[0]):
        for x in range(spans[j, 0], spans[j, 3]):
            for y in range(spans[j, 1], spans[j, 4]):
                for z in range(spans[j, 2], spans[j, 5]):
                    n += marks[(x * shape[1] + y) * shape[2] + z] == 3
    return n


@compiled
def _boxes(
    vertices_m: Vector,
    faces: Faces,
    near: Crossings,
    low_m: Vector,
    high_m: Vector,
    size: Vector,
    shape: npt.NDArray[np.int64],
) -> tuple[Vector, Crossings]:
    """Return each face's box (k, 6) and the buckets (k, 6) it reaches."""
    boxes = np.empty((near.shape[0], 6))
    spans = np.zeros((near.shape[0], 6), np.int32)
    for i in range(near.shape[0]):
        f = np.uint32(near[i])
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        apart = False
        for k in range(3):
            p, q, r = vertices_m[a, k], vertices_m[b, k], vertices_m[c, k]
            least, most = min(p, q, r), max(p, q, r)
            boxes[i, k], boxes[i, k + 3] = least, most
            if most < low_m[k] or least > high_m[k]:
                apart = True
                break
            begin = int(min(max((least - low_m[k]) / size[k], 0.0), shape[k] - 1.0))
            end = int(min(max((most - low_m[k]) / size[k], 0.0), shape[k] - 1.0)) + 1
            spans[i, k], spans[i, k + 3] = begin, end
        if apart:
            # an empty range along x: the face reaches no bucket
            spans[i, 3] = spans[i, 0] = 0
    return boxes, spans


@compiled
def edges_through(
    vertices_a: Vector,
    faces_a: Faces,
    f: int,
    vertices_b: Vector,
    faces_b: Faces,
    g: int,
    box: Vector,
) -> int:
    """Count edges of face f that meet face g, touching included; widen `box` by the points."""
    # Coordinates from a corner of face g, which keeps digits far from the origin.
    g0, g1, g2 = faces_b[g, 0], faces_b[g, 1], faces_b[g, 2]
    ox, oy, oz = vertices_b[g0, 0], vertices_b[g0, 1], vertices_b[g0, 2]
    px, py, pz = vertices_b[g1, 0] - ox, vertices_b[g1, 1] - oy, vertices_b[g1, 2] - oz
    qx, qy, qz = vertices_b[g2, 0] - ox, vertices_b[g2, 1] - oy, vertices_b[g2, 2] - oz
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    area = nx * nx + ny * ny + nz * nz
    if area == 0.0:
        return 0
    n_meetings = 0
    for k in range(3):
        i, j = faces_a[f, k], faces_a[f, (k + 1) % 3]
        ax, ay, az = vertices_a[i, 0] - ox, vertices_a[i, 1] - oy, vertices_a[i, 2] - oz
        bx, by, bz = vertices_a[j, 0] - ox, vertices_a[j, 1] - oy, vertices_a[j, 2] - oz
        # Signed distances from the plane of g, times twice its area.
        da = nx * ax + ny * ay + nz * az
        db = nx * bx + ny * by + nz * bz
        if (da > 0.0 and db > 0.0) or (da < 0.0 and db < 0.0) or da == db:
            continue
        t = da / (da - db)
        x, y, z = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
        # Barycentric coordinates of the piercing point, times the squared normal.
        along_q = nx * (py * z - pz * y) + ny * (pz * x - px * z) + nz * (px * y - py * x)
        along_p = nx * (y * qz - z * qy) + ny * (z * qx - x * qz) + nz * (x * qy - y * qx)
        slack = _SLACK * area
        if along_q < -slack or along_p < -slack or along_q + along_p > area + slack:
            continue
        n_meetings += 1
        box[0, 0], box[1, 0] = min(box[0, 0], x + ox), max(box[1, 0], x + ox)
        box[0, 1], box[1, 1] = min(box[0, 1], y + oy), max(box[1, 1], y + oy)
        box[0, 2], box[1, 2] = min(box[0, 2], z + oz), max(box[1, 2], z + oz)
    return n_meetings
