"""Light at vertices on the processor: Lambert's law of the shader `lighting`, without shine.

Processors that draw have no shader units to spare: compiled loops move every vertex once, whatever
the number of eyes, pick the triangles that show, and light and encode the vertices of those.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.stage.card.lamps import KIND_NUMBERS, lamp_axis, lamp_place
from visavis.stimuli.picture import Room

Floats = npt.NDArray[np.float32]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Triple: TypeAlias = tuple[np.float32, np.float32, np.float32]
EYE_KIND = 1
"""Kind of the vertices whose light pixels compute: they get their normal instead."""
MIN_DEPTH_M = 0.02
"""Things nearer to an eye than this always count as visible."""
NEAR_PX = 0.03
"""How finely a driver may place corners between pixels."""
_ROOT_STEPS = 1024
_roots = np.arange(4 * _ROOT_STEPS) / _ROOT_STEPS
_linear = np.minimum(_roots, 1.0) ** 2
CODES_OF_ROOT: Floats = np.where(
    _linear <= 0.0031308, 12.92 * _linear, 1.055 * np.maximum(_linear, 1e-5) ** (1 / 2.4) - 0.055
).astype(np.float32)
"""The display's codes (0 to 1) by the square root of the light, in steps of 1/1024."""
FACTORS_OF_ROOT: Floats = (_roots ** (2 / 2.2)).astype(np.float32)
"""What light does to a texture's codes, by the square root of the light, in steps of 1/1024."""


class PeopleRows(NamedTuple):
    """Which rows belong to whom, of n people seen from near, then of the same from far (2 n,).

    `model_of` (2 n,) is their model, `vertices_of` (2 n, 2) its stretch of the model arrays,
    `slot_of` (2 n,) the first row that is written; `plain_of` (2 n,) says whose textures are left
    out.
    """

    model_of: Counts
    vertices_of: Counts
    slot_of: Counts
    plain_of: Flags


class VertexShapes(NamedTuple):
    """How the vertices of all models are moved; see `models.Model`."""

    rest: Floats
    normal: Floats
    column: npt.NDArray[np.int32]
    weight: Floats
    morph: npt.NDArray[np.int32]
    deltas: Floats


class VertexLooks(NamedTuple):
    """How the vertices of all models are lit; see `models.Model`."""

    albedo: Floats
    plain_albedo: Floats
    wrap: Floats
    kind: npt.NDArray[np.uint8]
    has_picture: Flags


class GroupedTriangles(NamedTuple):
    """Triangles (t, 3) by the groups in which they are drawn.

    `stretches` (models, groups, 2) are rows of `triangles`; `single_sided` (groups,); `group_of`
    (2 n, groups) says in which group a person's are drawn. Group g is written from row `first[g]`
    on; the last of `first` is where all end.
    """

    triangles: npt.NDArray[np.int32]
    stretches: Counts
    single_sided: Flags
    group_of: Counts
    first: Counts


class Views(NamedTuple):
    """What e eyes at `eyes_m` (e, 3) see: pictures whose sizes are `size_px` (e, 2).

    With no eyes every triangle faces one; with no pictures every triangle falls on a pixel. Those
    between the middles of pixels fall on none where `between` says so.
    """

    eyes_m: Floats
    size_px: Floats
    between: bool


def lamp_rows(room: Room) -> tuple[Floats, Floats]:
    """Return the lamps (k, 12): kind, place, axis, cosine of the half angle and where it is full
    inside, colour at one metre; and the ambient light (2, 3) from above and below.
    """
    rows = np.zeros((len(room.lights), 12), np.float32)
    for row, light in zip(rows, room.lights, strict=True):
        cosine = float(np.cos(np.radians(light.half_angle_deg)))
        row[0] = KIND_NUMBERS[light.kind]
        row[1:4], row[4:7] = lamp_place(light), lamp_axis(light)
        row[7], row[8] = cosine, 1.0 / (0.3 * max(1.0 - cosine, 1e-6))
        row[9:12] = light.intensity
    return rows, np.array([room.sky, room.ground], np.float32)


@compiled
def _lit(
    place: Triple,
    normal: Triple,
    bleeding: Triple,
    spread: Triple,
    lamps: Floats,
    ambient: Floats,
) -> Triple:
    """Return the light that a surface gives back, before its own colour; it bleeds round edges
    and is spread by one number a colour.
    """
    px, py, pz = place
    nx, ny, nz = normal
    wr, wg, wb = bleeding
    sr, sg, sb = spread
    # Ambient light: between the ground's and the sky's by how far the surface faces up.
    up = np.float32(0.5) + np.float32(0.5) * ny
    r = ambient[1, 0] + (ambient[0, 0] - ambient[1, 0]) * up
    g = ambient[1, 1] + (ambient[0, 1] - ambient[1, 1]) * up
    b = ambient[1, 2] + (ambient[0, 2] - ambient[1, 2]) * up
    one = np.float32(1.0)
    for i in range(lamps.shape[0]):
        share = one
        # Kind 0 is a sun (only a direction), 1 a spot, 2 a point; the last two fall off with
        # distance².
        if lamps[i, 0] == 0:
            tx, ty, tz = -lamps[i, 4], -lamps[i, 5], -lamps[i, 6]
        else:
            tx, ty, tz = lamps[i, 1] - px, lamps[i, 2] - py, lamps[i, 3] - pz
            # Not nearer than 0.2 m: in the lamp itself light would be infinite.
            squared_m2 = max(tx * tx + ty * ty + tz * tz, np.float32(0.04))
            share = one / squared_m2
            near = np.sqrt(share)
            tx, ty, tz = tx * near, ty * near, tz * near
            if lamps[i, 0] == 1:
                along = -(tx * lamps[i, 4] + ty * lamps[i, 5] + tz * lamps[i, 6])
                t = min(max((along - lamps[i, 7]) * lamps[i, 8], np.float32(0.0)), one)
                share *= t * t * (np.float32(3.0) - np.float32(2.0) * t)
        cosine = nx * tx + ny * ty + nz * tz
        # Wrapped diffuse light: (cos + w) s lets light bleed round edges of skin, per colour.
        r += lamps[i, 9] * share * max((cosine + wr) * sr, np.float32(0.0))
        g += lamps[i, 10] * share * max((cosine + wg) * sg, np.float32(0.0))
        b += lamps[i, 11] * share * max((cosine + wb) * sb, np.float32(0.0))
    return r, g, b


@compiled
def looked_up(table: Floats, linear: np.float32) -> np.float32:
    """Return a table's entry for light; the last for light beyond it or that is not a number."""
    last = table.shape[0] - 1
    root = np.sqrt(max(linear, np.float32(0.0))) * np.float32(1024.0)
    # Compared before it is made an index: light that is not a number stays inside the table, too.
    at = np.int64(root + np.float32(0.5)) if root < np.float32(last) else last
    value: np.float32 = table[at]
    return value


@compiled
def _falling(x: np.float32) -> np.float32:
    half = np.float32(0.5)
    decay: np.float32 = np.exp(-max(x - half, np.float32(0.0)) / half)
    return half - half * decay


@compiled
def _in_codes(
    r: np.float32, g: np.float32, b: np.float32, has_picture: bool, codes: Floats, factors: Floats
) -> Triple:
    """Return light as pixels that work in codes want it: see `in_codes` in its shader."""
    # A picture's own codes are multiplied by it later; all else is the code itself.
    if has_picture:
        return looked_up(factors, r), looked_up(factors, g), looked_up(factors, b)
    most = max(r, max(g, b))
    half = np.float32(0.5)
    if most > half:
        gain = (half + _falling(most)) / most
        own, mean_share = np.float32(0.3), np.float32(0.7)
        r = own * (min(r, half) + _falling(r)) + mean_share * gain * r
        g = own * (min(g, half) + _falling(g)) + mean_share * gain * g
        b = own * (min(b, half) + _falling(b)) + mean_share * gain * b
    return looked_up(codes, r), looked_up(codes, g), looked_up(codes, b)


@compiled
def light_points(
    place: Floats,
    normal: Floats,
    albedo: Floats,
    emission: Floats,
    has_picture: npt.NDArray[np.bool_],
    lamps: Floats,
    ambient: Floats,
    codes: Floats,
    factors: Floats,
    out: Floats,
) -> None:
    """Write what still points (n, 3) of these colours look like, in codes at full brightness."""
    # Rooms are of hard stuff: light neither bleeds round their edges nor is it spread.
    none, one = np.float32(0.0), np.float32(1.0)
    bleeding, spread = (none, none, none), (one, one, one)
    for v in range(place.shape[0]):
        nx, ny, nz = normal[v, 0], normal[v, 1], normal[v, 2]
        share = np.float32(1.0) / np.sqrt(max(nx * nx + ny * ny + nz * nz, np.float32(1e-12)))
        at = place[v, 0], place[v, 1], place[v, 2]
        facing = nx * share, ny * share, nz * share
        r, g, b = _lit(at, facing, bleeding, spread, lamps, ambient)
        # What glows adds to reflected light without ever exceeding white: r + (1 − r) × emission.
        own = emission[v]
        r = albedo[v, 0] * (r + (np.float32(1.0) - r) * own)
        g = albedo[v, 1] * (g + (np.float32(1.0) - g) * own)
        b = albedo[v, 2] * (b + (np.float32(1.0) - b) * own)
        out[v, 0], out[v, 1], out[v, 2] = _in_codes(r, g, b, has_picture[v], codes, factors)


@compiled
def pose(
    people: Counts,
    own_rows: PeopleRows,
    joint_rows: Floats,
    shapes: VertexShapes,
    pixels_from_world: Floats,
    out: Floats,
    pixel: Floats,
) -> None:
    """Write place and normal (slot, 6) of everyone in `people`, and the pixel (slot, e, 2) of each
    of e pictures it falls on; what lies beside or behind an eye falls on none, NaN.

    `joint_rows` (n, …) are those of `JointRows`. Pixels times depth, and depth, are
    `pixels_from_world` (e, 3, 4) times places.
    """
    _, vertices_of, slot_of, _ = own_rows
    rest, normal, column, weight, morph, deltas = shapes
    face = joint_rows.shape[1] - 2
    one = np.float32(1.0)
    for person in people:
        row, slot = joint_rows[person % joint_rows.shape[0]], slot_of[person]
        for v in range(vertices_of[person, 0], vertices_of[person, 1]):
            x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
            m = morph[v]
            # Shapes of the face, their weights packed behind the joints' rows.
            if m >= 0:
                for k in range(deltas.shape[1]):
                    w = row[face + k // 4, k % 4]
                    if w != 0:
                        x += w * deltas[m, k, 0]
                        y += w * deltas[m, k, 1]
                        z += w * deltas[m, k, 2]
            # Linear blend skinning: the bones' matrices are summed first, then used for place and
            # normal.
            w, c = weight[v, 0], column[v, 0]
            a00, a01, a02, a03 = w * row[c, 0], w * row[c, 1], w * row[c, 2], w * row[c, 3]
            c += 1
            a10, a11, a12, a13 = w * row[c, 0], w * row[c, 1], w * row[c, 2], w * row[c, 3]
            c += 1
            a20, a21, a22, a23 = w * row[c, 0], w * row[c, 1], w * row[c, 2], w * row[c, 3]
            for k in range(1, 4):
                w = weight[v, k]
                if w == 0:
                    break
                c = column[v, k]
                a00 += w * row[c, 0]
                a01 += w * row[c, 1]
                a02 += w * row[c, 2]
                a03 += w * row[c, 3]
                a10 += w * row[c + 1, 0]
                a11 += w * row[c + 1, 1]
                a12 += w * row[c + 1, 2]
                a13 += w * row[c + 1, 3]
                a20 += w * row[c + 2, 0]
                a21 += w * row[c + 2, 1]
                a22 += w * row[c + 2, 2]
                a23 += w * row[c + 2, 3]
            px, py = a00 * x + a01 * y + a02 * z + a03, a10 * x + a11 * y + a12 * z + a13
            pz = a20 * x + a21 * y + a22 * z + a23
            nx, ny, nz = normal[v, 0], normal[v, 1], normal[v, 2]
            nx, ny, nz = (
                a00 * nx + a01 * ny + a02 * nz,
                a10 * nx + a11 * ny + a12 * nz,
                a20 * nx + a21 * ny + a22 * nz,
            )
            share = one / np.sqrt(max(nx * nx + ny * ny + nz * nz, np.float32(1e-12)))
            nx, ny, nz = nx * share, ny * share, nz * share
            out[slot, 0], out[slot, 1], out[slot, 2] = px, py, pz
            out[slot, 3], out[slot, 4], out[slot, 5] = nx, ny, nz
            for e in range(pixels_from_world.shape[0]):
                m = pixels_from_world[e]
                # Perspective division; what is not in front of the eye has no pixel.
                deep = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
                if deep > MIN_DEPTH_M:
                    share = one / deep
                    across = m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]
                    up = m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]
                    pixel[slot, e, 0], pixel[slot, e, 1] = across * share, up * share
                else:
                    pixel[slot, e, 0] = pixel[slot, e, 1] = np.nan
            slot += 1


@compiled
def light_drawn(
    people: Counts,
    own_rows: PeopleRows,
    looks: VertexLooks,
    lamps: Floats,
    ambient: Floats,
    codes: Floats,
    factors: Floats,
    encode: bool,
    is_drawn: Flags,
    out: Floats,
) -> None:
    """Write light over normals in `out` (slot, 6), as linear light or in codes, where `is_drawn`
    (slot,) says so, which it then says no more. Normals of eyes, which pixels light, stay.
    """
    _, vertices_of, slot_of, plain_of = own_rows
    albedo, plain_albedo, wrap, kind, has_picture = looks
    for person in people:
        slot, plain = slot_of[person], plain_of[person]
        own = plain_albedo if plain else albedo
        for v in range(vertices_of[person, 0], vertices_of[person, 1]):
            # Each vertex once, however many triangles share it.
            if is_drawn[slot]:
                is_drawn[slot] = False
                if kind[v] != EYE_KIND:
                    place = out[slot, 0], out[slot, 1], out[slot, 2]
                    normal = out[slot, 3], out[slot, 4], out[slot, 5]
                    bleeding, spread = (
                        (wrap[v, 0], wrap[v, 1], wrap[v, 2]),
                        (wrap[v, 3], wrap[v, 4], wrap[v, 5]),
                    )
                    r, g, b = _lit(place, normal, bleeding, spread, lamps, ambient)
                    r, g, b = r * own[v, 0], g * own[v, 1], b * own[v, 2]
                    if encode:
                        r, g, b = _in_codes(r, g, b, has_picture[v] and not plain, codes, factors)
                    out[slot, 3], out[slot, 4], out[slot, 5] = r, g, b
            slot += 1


@compiled
def _falls_on_pixel(
    a: np.uint64,
    b: np.uint64,
    c: np.uint64,
    pixel: Floats,
    size_px: Floats,
    between: bool,
    two_sided: bool,
) -> bool:
    """Tell whether a triangle may show in one of the pictures, unless it is seen from behind."""
    near, half = np.float32(NEAR_PX), np.float32(0.5)
    for e in range(size_px.shape[0]):
        ax, ay = pixel[a, e, 0], pixel[a, e, 1]
        bx, by = pixel[b, e, 0], pixel[b, e, 1]
        cx, cy = pixel[c, e, 0], pixel[c, e, 1]
        # A corner behind the eye: the card clips such a triangle, so that it is kept.
        if np.isnan(ax + bx + cx):
            return True
        left, right = min(ax, min(bx, cx)) - near, max(ax, max(bx, cx)) + near
        # Twice the signed area in pixels: negative is seen from behind. `near` allows for rounding.
        double_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not two_sided and double_area < -near * (right - left):
            continue
        if right < 0 or left > size_px[e, 0]:
            continue
        # No pixel's middle lies within: without several samples nothing would be drawn.
        if between and np.floor(right - half) < np.ceil(left - half):
            continue
        low, high = min(ay, min(by, cy)) - near, max(ay, max(by, cy)) + near
        if high < 0 or low > size_px[e, 1]:
            continue
        if between and np.floor(high - half) < np.ceil(low - half):
            continue
        return True
    return False


@compiled
def _faces_an_eye(
    a: np.uint64, b: np.uint64, c: np.uint64, position: Floats, eyes_m: Floats
) -> bool:
    """Tell whether a triangle faces an eye, by its normal in space."""
    # Without pixels every eye is asked; what faces one of them may be seen by it.
    ax, ay, az = position[a, 0], position[a, 1], position[a, 2]
    ux, uy, uz = position[b, 0] - ax, position[b, 1] - ay, position[b, 2] - az
    wx, wy, wz = position[c, 0] - ax, position[c, 1] - ay, position[c, 2] - az
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    for e in range(eyes_m.shape[0]):
        towards = nx * (eyes_m[e, 0] - ax) + ny * (eyes_m[e, 1] - ay) + nz * (eyes_m[e, 2] - az)
        if towards > 0:
            return True
    return False


@compiled
def gather_front(
    people: Counts,
    own_rows: PeopleRows,
    grouped: GroupedTriangles,
    position: Floats,
    pixel: Floats,
    views: Views,
    is_drawn: Flags,
    count: Counts,
    out: npt.NDArray[np.int32],
) -> None:
    """Write the triangles that face an eye and fall on a pixel, person after person as listed,
    group by group; `is_drawn` (slot,) becomes true where they have a corner.

    `position` (slot, 6) and `pixel` (slot, e, 2) are as `pose` writes them. `count` (groups,) is
    how many rows of `out` each group has from its first on. Of plain people sheets have one side,
    too.
    """
    model_of, _, slot_of, plain_of = own_rows
    triangles, stretches, single_sided, group_of, first = grouped
    eyes_m, size_px, between = views
    count[:] = 0
    has_pictures = size_px.shape[0] > 0
    for person in people:
        model, shift = model_of[person], slot_of[person]
        for g in range(stretches.shape[1]):
            target = group_of[person, g]
            at = first[target] + count[target]
            two_sided = eyes_m.shape[0] == 0 or not (single_sided[g] or plain_of[person])
            for t in range(stretches[model, g, 0], stretches[model, g, 1]):
                # Unsigned indices spare numba the check for negative ones, which count from the
                # end.
                a, b, c = (
                    np.uint64(triangles[t, 0] + shift),
                    np.uint64(triangles[t, 1] + shift),
                    np.uint64(triangles[t, 2] + shift),
                )
                # Pictures decide by pixels which side shows, and leave out what is too small.
                if has_pictures:
                    is_kept = _falls_on_pixel(a, b, c, pixel, size_px, between, two_sided)
                else:
                    is_kept = two_sided or _faces_an_eye(a, b, c, position, eyes_m)
                if is_kept:
                    is_drawn[a] = is_drawn[b] = is_drawn[c] = True
                    out[at, 0], out[at, 1], out[at, 2] = a, b, c
                    at += 1
            count[target] = at - first[target]
