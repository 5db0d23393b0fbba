"""Draw a skinned body into a small identity buffer on the CPU: skin, project, z-buffer, light.

Buffers hold inverse depth (1/m, larger is nearer, 0 is nothing). A pixel belongs to the nearest
surface at its centre; equal depths go to the larger part number, so the order of triangles does
not matter.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import Triple, write_matrix

Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int32]
Floats = npt.NDArray[np.float64]

NEAR_M: Final = 0.05
EYE: Final = 19
"""Length of a packed camera: position 3, rows of world-to-camera 9, tangents 4, spare 3."""
BOTH_SIDES: Final = 128
"""Added to the label of a triangle that is seen from behind as well."""
LAMP: Final = 9
"""Length of a packed lamp: intensity, position 3, direction 3, cosine of half angle, falls off."""


class Skin(NamedTuple):
    """Vertices at `rest` (v, 3), each moved by up to four `joints` with their `weights` (v, 4)."""

    rest: Floats
    joints: Bytes
    weights: Floats


class Faces(NamedTuple):
    """Triangles (t, 3) of a body and the label of each (t,): a part, perhaps with `BOTH_SIDES`."""

    triangles: Ints
    labels: Bytes


class Moving(NamedTuple):
    """What of a body moves when some joints turn: vertices by number and faces; `is_still` (t,)
    tells which of all its faces do not.
    """

    vertices: npt.NDArray[np.int64]
    faces: Faces
    is_still: npt.NDArray[np.bool_]


class Posed(NamedTuple):
    """A body in a pose: points (v, 3), on the screen (v, 3), and those faces that show there
    unless something is before them, `which` by number.
    """

    points: Floats
    screen: Floats
    faces: Faces
    which: npt.NDArray[np.int64]


class Ground(NamedTuple):
    """What poses share, drawn into ids and nearness (h, w) but for the faces `missing` (t,)."""

    ids: Bytes
    nearness: Floats
    missing: npt.NDArray[np.bool_]


class Lighting(NamedTuple):
    """The light in a view: ambient, k packed lamps (k, LAMP) with square shadow maps of inverse
    depth (k, s, s) and the cameras (k, EYE) that drew those; below `least_light` nothing is seen.
    """

    ambient: float
    lamps: Floats
    maps: Floats
    map_eyes: Floats
    least_light: float


@compiled
def skin_some(which: npt.NDArray[np.int64], skin: Skin, matrices: Floats, out: Floats) -> None:
    """Place some of the rest vertices (v, 3) as `skin_points` places all."""
    rest, joints, weights = skin
    for n in range(which.shape[0]):
        i = which[n]
        x, y, z = rest[i, 0], rest[i, 1], rest[i, 2]
        px = py = pz = 0.0
        for k in range(4):
            w = weights[i, k]
            # Linear blend skinning by up to four joints.
            if w == 0.0:
                continue
            m = matrices[joints[i, k]]
            px += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            py += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            pz += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        out[i, 0], out[i, 1], out[i, 2] = px, py, pz


@compiled
def project_some(
    which: npt.NDArray[np.int64],
    points: Floats,
    eye: Floats,
    width: int,
    height: int,
    screen: Floats,
) -> None:
    """Project some of the points (v, 3) to screen (v, 3): column, row, inverse depth.

    The inverse depth is 0 nearer than `NEAR_M` and behind the eye.
    """
    left, right, bottom, top = eye[12], eye[13], eye[14], eye[15]
    across, down = width / (right - left), height / (top - bottom)
    for n in range(which.shape[0]):
        i = which[n]
        dx, dy, dz = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        # `eye` holds place, axes in rows (right, up, back) and tangents of the view's borders.
        depth = -(eye[9] * dx + eye[10] * dy + eye[11] * dz)
        if depth < NEAR_M:
            screen[i, 2] = 0.0
            continue
        inverse = 1.0 / depth
        screen[i, 0] = ((eye[3] * dx + eye[4] * dy + eye[5] * dz) * inverse - left) * across
        screen[i, 1] = (top - (eye[6] * dx + eye[7] * dy + eye[8] * dz) * inverse) * down
        screen[i, 2] = inverse


@compiled
def skin_points(skin: Skin, matrices: Floats, out: Floats) -> None:
    """Place rest vertices (v, 3) by joint matrices (j, 3, 4) into out (v, 3)."""
    skin_some(np.arange(skin.rest.shape[0]), skin, matrices, out)


@compiled
def project_points(points: Floats, eye: Floats, width: int, height: int, screen: Floats) -> None:
    """Project points (v, 3) to screen (v, 3) as `project_some` does."""
    project_some(np.arange(points.shape[0]), points, eye, width, height, screen)


@compiled
def _illumination(a: Triple, b: Triple, c: Triple, lighting: Lighting) -> float:
    """Return the luminance a white surface in this triangle's place would have."""
    ambient, lamps, maps, map_eyes, _ = lighting
    ax, ay, az = a
    bx, by, bz = b
    cx, cy, cz = c
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return ambient
    # Lit at the middle of the triangle, which is small against the distance of any lamp.
    mx, my, mz = (ax + bx + cx) / 3, (ay + by + cy) / 3, (az + bz + cz) / 3
    light = ambient
    for k in range(lamps.shape[0]):
        lx, ly, lz = lamps[k, 1] - mx, lamps[k, 2] - my, lamps[k, 3] - mz
        square = lx * lx + ly * ly + lz * lz
        far = np.sqrt(square)
        facing = (nx * lx + ny * ly + nz * lz) / (length * far)
        if facing <= 0.0:
            continue
        # Outside the lamp's cone.
        if -(lamps[k, 4] * lx + lamps[k, 5] * ly + lamps[k, 6] * lz) < lamps[k, 7] * far:
            continue
        eye, size = map_eyes[k], maps.shape[1]
        depth = -(eye[9] * (mx - eye[0]) + eye[10] * (my - eye[1]) + eye[11] * (mz - eye[2]))
        if depth > NEAR_M:
            column = (
                (eye[3] * (mx - eye[0]) + eye[4] * (my - eye[1]) + eye[5] * (mz - eye[2])) / depth
                - eye[12]
            ) * size / (eye[13] - eye[12])  # fmt: skip
            row = (
                eye[15]
                - (eye[6] * (mx - eye[0]) + eye[7] * (my - eye[1]) + eye[8] * (mz - eye[2])) / depth
            ) * size / (eye[15] - eye[14])  # fmt: skip
            inside = 0 <= column < size and 0 <= row < size
            # Shadow map: nearer surfaces have a greater inverse depth; 0.1 % against self-
            # shadowing.
            if inside and maps[k, int(row), int(column)] * depth > 1.001:
                continue
        light += lamps[k, 0] * facing / (square if lamps[k, 8] > 0 else 1.0)
    return light


@compiled
def pixels_of(
    xa: float, ya: float, xb: float, yb: float, xc: float, yc: float, width: int, height: int
) -> tuple[int, int, int, int]:
    """Return the first and last column and row whose pixels' centres may lie in a triangle."""
    # Pixel centres are at halves; the lowest column whose centre may lie inside.
    return (
        max(0, int(np.ceil(min(xa, xb, xc) - 0.5))),
        min(width - 1, int(np.floor(max(xa, xb, xc) - 0.5))),
        max(0, int(np.ceil(min(ya, yb, yc) - 0.5))),
        min(height - 1, int(np.floor(max(ya, yb, yc) - 0.5))),
    )


@compiled
def draw(
    points: Floats,
    screen: Floats,
    faces: Faces,
    ids: Bytes,
    nearness: Floats,
    lighting: Lighting,
) -> tuple[int, int, int, int]:
    """Draw faces of points (v, 3), projected to `screen` (v, 3), over what `ids` and `nearness`
    (h, w) hold; return the first and last column and row that may have changed.

    A triangle in too little light hides what is behind it and counts as nobody (0). Faces seen
    from behind are left out unless their label has `BOTH_SIDES`.
    """
    triangles, labels = faces
    height, width = ids.shape
    left, right, top, bottom = width, -1, height, -1
    for t in range(triangles.shape[0]):
        ia, ib, ic = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        wa, wb, wc = screen[ia, 2], screen[ib, 2], screen[ic, 2]
        # A corner behind the eye has no place on the screen; surroundings are cut there before.
        if wa == 0.0 or wb == 0.0 or wc == 0.0:
            continue
        xa, ya, xb, yb = screen[ia, 0], screen[ia, 1], screen[ib, 0], screen[ib, 1]
        xc, yc = screen[ic, 0], screen[ic, 1]
        area = (xc - xa) * (yb - ya) - (xb - xa) * (yc - ya)
        if area == 0.0:
            continue
        # Below 0 the triangle is seen from behind; turned round, it is drawn like any other.
        if area < 0.0:
            if labels[t] < BOTH_SIDES:
                continue
            ib, ic = ic, ib
            xb, yb, wb, xc, yc, wc = xc, yc, wc, xb, yb, wb
            area = -area
        c0, c1, r0, r1 = pixels_of(xa, ya, xb, yb, xc, yc, width, height)
        if c0 > c1 or r0 > r1:
            continue
        left, right, top, bottom = min(left, c0), max(right, c1), min(top, r0), max(bottom, r1)
        label = np.uint8(labels[t] & (BOTH_SIDES - 1))
        lit = -1
        for r in range(r0, r1 + 1):
            y = r + 0.5
            is_inside = False
            for c in range(c0, c1 + 1):
                x = c + 0.5
                # Edge functions: the pixel's centre is inside where none of them is above 0. They
                # also weigh the corners' inverse depth, which is linear on the screen.
                ea = (xc - xb) * (y - yb) - (yc - yb) * (x - xb)
                eb = (xa - xc) * (y - yc) - (ya - yc) * (x - xc)
                ec = (xb - xa) * (y - ya) - (yb - ya) * (x - xa)
                if ea > 0.0 or eb > 0.0 or ec > 0.0:
                    # Each of them only grows or only falls along a row, rounding included.
                    if is_inside:
                        break
                    continue
                is_inside = True
                near = -(ea * wa + eb * wb + ec * wc) / area
                if near < nearness[r, c]:
                    continue
                # Light is found once for a triangle, and only when a pixel of it shows.
                if lit < 0:
                    lit = 1
                    if lighting.lamps.shape[0] > 0 and label > 0:
                        light = _illumination(
                            (points[ia, 0], points[ia, 1], points[ia, 2]),
                            (points[ib, 0], points[ib, 1], points[ib, 2]),
                            (points[ic, 0], points[ic, 1], points[ic, 2]),
                            lighting,
                        )
                        lit = 1 if light >= lighting.least_light else 0
                tag = label if lit == 1 else np.uint8(0)
                if near > nearness[r, c] or tag > ids[r, c]:
                    nearness[r, c] = near
                    ids[r, c] = tag
    return left, right, top, bottom


@compiled
def pose_first(
    skin: Skin, faces: Faces, matrices: Floats, eye: Floats, height: int, width: int
) -> Posed:
    """Return a body in a pose (j, 3, 4) as a view of this size sees it."""
    points, screen = np.empty_like(skin.rest), np.empty_like(skin.rest)
    skin_points(skin, matrices, points)
    project_points(points, eye, width, height, screen)
    which, n = np.empty(len(faces.labels), np.int64), 0
    for t in range(len(faces.labels)):
        ia, ib, ic = faces.triangles[t, 0], faces.triangles[t, 1], faces.triangles[t, 2]
        if screen[ia, 2] == 0.0 or screen[ib, 2] == 0.0 or screen[ic, 2] == 0.0:
            continue
        xa, ya, xb, yb = screen[ia, 0], screen[ia, 1], screen[ib, 0], screen[ib, 1]
        xc, yc = screen[ic, 0], screen[ic, 1]
        area = (xc - xa) * (yb - ya) - (xb - xa) * (yc - ya)
        if area == 0.0 or (area < 0.0 and faces.labels[t] < BOTH_SIDES):
            continue
        c0, c1, r0, r1 = pixels_of(xa, ya, xb, yb, xc, yc, width, height)
        if c0 <= c1 and r0 <= r1:
            which[n] = t
            n += 1
    return Posed(points, screen, faces, which[:n])


@compiled
def _chosen_faces(first: Posed, is_chosen: npt.NDArray[np.bool_]) -> Faces:
    """Return those of some faces (t,) that show."""
    triangles = np.empty((len(first.which), 3), np.int32)
    labels, n = np.empty(len(first.which), np.uint8), 0
    for t in first.which:
        if is_chosen[t]:
            triangles[n], labels[n] = first.faces.triangles[t], first.faces.labels[t]
            n += 1
    return Faces(triangles[:n], labels[:n])


@compiled
def _hide(ids: Bytes, nearness: Floats, before: Floats, visible: Bytes) -> None:
    """Fill `visible` (h, w) with what `ids` (h, w) shows that nothing nearer is before."""
    for r in range(ids.shape[0]):
        for c in range(ids.shape[1]):
            visible[r, c] = ids[r, c] if nearness[r, c] >= before[r, c] else 0


@compiled
def perceive(
    skin: Skin,
    moving: Moving,
    first: Posed,
    ground: Ground,
    matrices: Floats,
    rows: npt.NDArray[np.int64],
    eye: Floats,
    lighting: Lighting,
    ids: Bytes,
    before: Floats,
    visible: Bytes,
) -> None:
    """Fill some rows of ids (n, h, w) with the perceived parts of a body in poses (n, j, 3, 4).

    All these poses differ from the pose `first` at most in what is `moving`; the other faces are
    drawn once, what of them is missing into `ground`. `visible` (n, h, w) is filled with what is
    seen when what has the inverse depth `before` (h, w) stands before the body, too; empty arrays
    leave that out.
    """
    still_ids, still_near, missing = ground
    height, width = still_near.shape
    has_visible = visible.shape[0] > 0
    points, screen = first.points.copy(), first.screen.copy()
    draw(points, screen, _chosen_faces(first, missing), still_ids, still_near, lighting)
    nearness = still_near.copy()
    for k in rows:
        ids[k][:] = still_ids
        c0, c1, r0, r1 = width, -1, height, -1
        if moving.faces.triangles.shape[0] > 0:
            skin_some(moving.vertices, skin, matrices[k], points)
            project_some(moving.vertices, points, eye, width, height, screen)
            c0, c1, r0, r1 = draw(points, screen, moving.faces, ids[k], nearness, lighting)
        if has_visible:
            _hide(ids[k], nearness, before, visible[k])
        # What was drawn over the still rest is taken away again.
        for r in range(r0, r1 + 1):
            nearness[r, c0 : c1 + 1] = still_near[r, c0 : c1 + 1]


@compiled
def _where_anybody(ids: Bytes, columns: Bytes) -> tuple[int, int, int, int]:
    """Return the first and last column and row of ids (h, w) that show any part; `columns` (w,) is
    work space.
    """
    height, width = ids.shape
    left, right, top, bottom = width, -1, height, -1
    columns[:] = 0
    for r in range(height):
        ids_of_row = np.uint8(0)
        for c in range(width):
            ids_of_row |= ids[r, c]
        if ids_of_row != 0:
            top, bottom = min(top, r), r
            for c in range(width):
                columns[c] |= ids[r, c]
    for c in range(width):
        if columns[c] != 0:
            left, right = min(left, c), c
    return left, right, top, bottom


@compiled
def measure(ids: Bytes, masks: npt.NDArray[np.bool_], out: Floats) -> None:
    """Measure masks of parts (f, 256) in ids (n, h, w) into out (n, f, 3); no mask holds 0, nobody.

    Coverage (share of all pixels), horizontal and vertical extension (share of width, height).
    """
    n, height, width = ids.shape
    pixels, box = np.empty(masks.shape[1], np.int64), np.empty((masks.shape[1], 4), np.int64)
    columns = np.empty(width, np.uint8)
    for k in range(n):
        pixels[:] = 0
        box[:, 0], box[:, 1], box[:, 2], box[:, 3] = width, -1, height, -1
        # Every part once, by the stretches of a row that show it: most of a view is one part.
        left, right, top, bottom = _where_anybody(ids[k], columns)
        for r in range(top, bottom + 1):
            c = left
            while c <= right:
                part, begin = ids[k, r, c], c
                while c <= right and ids[k, r, c] == part:
                    c += 1
                pixels[part] += c - begin
                own = box[part]
                own[0], own[1] = min(own[0], begin), max(own[1], c - 1)
                own[2], own[3] = min(own[2], r), max(own[3], r)
        for f in range(masks.shape[0]):
            count, c0, c1, r0, r1 = 0, width, -1, height, -1
            for part in range(masks.shape[1]):
                if masks[f, part]:
                    count += pixels[part]
                    c0, c1 = min(c0, box[part, 0]), max(c1, box[part, 1])
                    r0, r1 = min(r0, box[part, 2]), max(r1, box[part, 3])
            out[k, f, 0] = count / (height * width)
            out[k, f, 1] = (c1 - c0 + 1) / width if count else 0.0
            out[k, f, 2] = (r1 - r0 + 1) / height if count else 0.0


@compiled
def fine_extension(
    ids: Bytes, mask: npt.NDArray[np.bool_], across: bool, least: float, out: Floats
) -> None:
    """Measure the extension of a mask of parts (256,), 0 not among them, in ids (n, h, w) into out
    (n,), in pixels.

    From where `least` pixels of the mask lie to one side to where as many lie to the other, within
    a line in proportion: it moves by fractions of a pixel. NaN where there are fewer than twice
    `least`. `across` counts columns instead of rows.
    """
    n, height, width = ids.shape
    lines = width if across else height
    profile, columns = np.empty(lines, dtype=np.int64), np.empty(width, np.uint8)
    for k in range(n):
        profile[:] = 0
        left, right, top, bottom = _where_anybody(ids[k], columns)
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                if mask[ids[k, r, c]]:
                    profile[c if across else r] += 1
        if profile.sum() < 2 * least:
            out[k] = np.nan
            continue
        # Whole pixels would make slopes 0 or infinite; the border is interpolated within its line.
        first, last, met = 0.0, 0.0, 0
        for i in range(lines):
            if met + profile[i] >= least:
                first = i + (least - met) / profile[i]
                break
            met += profile[i]
        met = 0
        for i in range(lines - 1, -1, -1):
            if met + profile[i] >= least:
                last = i + 1 - (least - met) / profile[i]
                break
            met += profile[i]
        out[k] = last - first


@compiled
def measure_change(ids: Bytes, before: Bytes, masks: npt.NDArray[np.bool_], out: Floats) -> None:
    """Measure the share of pixels that changed since `before` (n, h, w) and bear a wanted part
    before or after: masks (f, 256), ids (n, h, w), out (n, f).
    """
    n, height, width = ids.shape
    for k in range(n):
        for f in range(masks.shape[0]):
            count = 0
            for r in range(height):
                for c in range(width):
                    now, then = ids[k, r, c], before[k, r, c]
                    if now != then and (masks[f, now] or masks[f, then]):
                        count += 1
            out[k, f] = count / (height * width)


@compiled
def joint_matrices(
    parents: npt.NDArray[np.int64],
    offsets: Vector,
    rest: Vector,
    roots: Vector,
    local: Vector,
    out: Floats,
) -> None:
    """Chain turns (n, j, 4) from roots (n, 3) into matrices (n, j, 3, 4) that move rest points."""
    position, world = np.empty((len(parents), 3)), np.empty((len(parents), 4))
    for r in range(local.shape[0]):
        for j in range(len(parents)):
            p = parents[j]
            bw, bx, by, bz = local[r, j, 0], local[r, j, 1], local[r, j, 2], local[r, j, 3]
            if p < 0:
                position[j] = roots[r]
                w, x, y, z = bw, bx, by, bz
            else:
                aw, ax, ay, az = world[p, 0], world[p, 1], world[p, 2], world[p, 3]
                vx, vy, vz = offsets[j, 0], offsets[j, 1], offsets[j, 2]
                # Rotate by a unit quaternion: v + w t + q × t with t = 2 q × v.
                tx, ty, tz = (
                    2 * (ay * vz - az * vy),
                    2 * (az * vx - ax * vz),
                    2 * (ax * vy - ay * vx),
                )
                position[j, 0] = position[p, 0] + vx + aw * tx + ay * tz - az * ty
                position[j, 1] = position[p, 1] + vy + aw * ty + az * tx - ax * tz
                position[j, 2] = position[p, 2] + vz + aw * tz + ax * ty - ay * tx
                w = aw * bw - ax * bx - ay * by - az * bz
                x = aw * bx + ax * bw + ay * bz - az * by
                y = aw * by - ax * bz + ay * bw + az * bx
                z = aw * bz + ax * by - ay * bx + az * bw
            world[j, 0], world[j, 1], world[j, 2], world[j, 3] = w, x, y, z
            m = out[r, j]
            write_matrix((w, x, y, z), m)
            for a in range(3):
                # Translation that takes the rest place to the place now.
                m[a, 3] = position[j, a] - (
                    m[a, 0] * rest[j, 0] + m[a, 1] * rest[j, 1] + m[a, 2] * rest[j, 2]
                )
