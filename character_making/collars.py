"""Collars, plackets and buttons: what makes a top read as a shirt, a polo or a jacket."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from character_making.cloth_places import wrapped_uv
from character_making.clothes import Cut, cut_of
from character_making.cutting import border
from character_making.drape import Outside
from character_making.figure import Figure
from character_making.makehuman import Indices
from character_making.pieces import Piece, triangulated, vertex_normals
from character_making.recipes import Garment
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX


def collar(figure: Figure, cloth: Piece, garment: Garment, tone: Vector) -> list[Piece]:
    """Return what sits on the neckline and the front of a top."""
    ring = _neck_ring(figure, cloth)
    if garment.kind in ("tee", "jumper"):
        height_m, thick_m = _BANDS_M[garment.kind]
        band = _band(figure, cloth, ring, tone * 0.95, height_m, thick_m)
        return [replace(band, is_trim=True)]
    if garment.kind in ("shirt", "polo"):
        cut = cut_of(garment)
        fold = replace(_folded_collar(figure, cloth, ring, tone, cut.collar), is_trim=True)
        return [fold, *_closed_front(figure, cloth, tone, cut)]
    return _lapel_band(figure, cloth, tone, garment)


def _neck_ring(figure: Figure, cloth: Piece) -> Indices:
    """Return the vertices of the neckline in order round the neck, from the front."""
    rim = np.unique(border(cloth.triangles))
    p = cloth.vertices_m[rim]
    neck = figure.at("neck")
    near = np.linalg.norm((p - neck) * np.array([1.0, 0.7, 1.0]), axis=1) < 0.14
    arms = [figure.rig.skeleton.index(f"{s}_lower_arm") for s in ("left", "right")]
    near &= cloth.weights[rim][:, arms].sum(axis=1) < 0.1
    rim, p = rim[near], p[near]
    angle = np.arctan2(p[:, 0], -(p[:, 2] - neck[2]))
    order: Indices = rim[np.argsort(angle)]
    return order


def _resampled(figure: Figure, cloth: Piece, ring: Indices, n: int) -> tuple[Vector, Vector]:
    """Return n points (closed) and weights at even angles round the neck, smoothed."""
    p = cloth.vertices_m[ring]
    neck = figure.at("neck")
    angle = np.arctan2(p[:, 0], -(p[:, 2] - neck[2]))
    at = np.linspace(-np.pi, np.pi, n, endpoint=False)
    points = np.stack([np.interp(at, angle, p[:, k], period=2 * np.pi) for k in range(3)], axis=1)
    nearest = np.abs((at[:, None] - angle + np.pi) % (2 * np.pi) - np.pi).argmin(axis=1)
    for _ in range(4):
        points = 0.5 * points + 0.25 * (np.roll(points, 1, axis=0) + np.roll(points, -1, axis=0))
    return points, cloth.weights[ring[nearest]]


def _sheet(
    rows: list[Vector], weights: Vector, tone: Vector, material: str, *, closed: bool
) -> Piece:
    """Return a surface through rows of points; front side by the order of the rows."""
    n = len(rows[0])
    index = np.arange(len(rows) * n).reshape(len(rows), n)
    turn = np.roll(index, -1, axis=1)
    last = n if closed else n - 1
    a, b = index[:-1, :last], turn[:-1, :last]
    c, d = index[1:, :last], turn[1:, :last]
    triangles = np.concatenate(
        [np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)]
    )
    vertices = np.concatenate(rows)
    return Piece(
        vertices_m=vertices,
        triangles=triangles,
        weights=np.tile(weights, (len(rows), 1)),
        colour=np.tile(tone, (len(vertices), 1)),
        part=np.full(len(triangles), PART_INDEX["torso"]),
        material=material,
    )


def _outwards(piece: Piece, centre: Vector) -> Piece:
    """Turn triangles so that most face away from an axis through `centre`."""
    a, b, c = (piece.vertices_m[piece.triangles[:, k]] for k in range(3))
    away = ((a + b + c) / 3 - centre) * np.array([1.0, 0.0, 1.0])
    if np.sum(np.cross(b - a, c - a) * away) < 0:
        return replace(piece, triangles=piece.triangles[:, ::-1].copy())
    return piece


def _textured(figure: Figure, piece: Piece) -> Piece:
    return replace(piece, corner_uv=wrapped_uv(figure, piece))


def _band(
    figure: Figure, cloth: Piece, ring: Indices, tone: Vector, height_m: float, thick_m: float
) -> Piece:
    """Return the ribbed band of a jumper's or tee's neckline."""
    points, weights = _resampled(figure, cloth, ring, 48)
    centre = points.mean(axis=0)
    out = unit((points - centre) * np.array([1.0, 0.0, 1.0]))
    up = unit(np.array([0.0, 1.0, 0.0]) - 0.45 * out)
    on_cloth = []
    for down in (1.2, 0.8, 0.4):
        at = _on_surface(cloth, points + 0.0035 * out - down * height_m * up)
        on_cloth.append((at, _nearest_normals(cloth, at)))
    skin = Outside(figure.body_m, triangulated(figure.source.quads("body")))
    # It leaves the cloth and lies down on the skin, so that nothing is seen behind it.
    rows = [
        on_cloth[0][0] - 0.006 * on_cloth[0][1],
        *(at + thick_m * normal for at, normal in on_cloth),
        _at_least_off(cloth, points + 0.1 * height_m * up, thick_m),
        _at_least_off(
            cloth,
            skin.held(points + 0.002 * out + 0.5 * height_m * up, thick_m + 0.0025),
            0.66 * thick_m,
        ),
        skin.held(points + 0.001 * out + 0.8 * height_m * up, thick_m + 0.0005),
        # Its edge goes into the skin.
        skin.held(points + 0.9 * height_m * up, -0.002),
    ]
    sheet = _sheet(rows, weights, tone, cloth.material, closed=True)
    return _textured(figure, _outwards(sheet, centre))


_BANDS_M = {"jumper": (0.020, 0.003), "tee": (0.0095, 0.0016)}
"""How high and how thick the band of a neckline is: knitted, and of a tee."""


def _folded_collar(
    figure: Figure, cloth: Piece, ring: Indices, tone: Vector, size_01: float
) -> Piece:
    """Return a shirt collar, of full height or lower: a stand close round the neck and a fall that
    lies on the cloth and ends in two points.
    """
    points, weights = _resampled(figure, cloth, ring, _COLUMNS)
    even = np.linspace(-np.pi, np.pi, _COLUMNS, endpoint=False)
    scale = size_01 * figure.stature_m / 1.72

    def round_neck(gap: float) -> tuple[Vector, Vector]:
        """Return angles from the front towards +x, a gap open, and the neckline there."""
        at = np.linspace(gap, 2 * np.pi - gap, _COLUMNS)
        line = [np.interp(at, even, points[:, k], period=2 * np.pi) for k in range(3)]
        return at, np.stack(line, axis=1)

    _, seam = round_neck(_GAP_BELOW)
    angle, above_seam = round_neck(_GAP_ABOVE)
    front = np.exp(-(((np.minimum(angle, 2 * np.pi - angle) - _GAP_ABOVE) / 0.5) ** 2))
    height = scale * (_STAND_M - _LOWER_IN_FRONT_M * front)
    fold = _by_the_neck(figure, angle, above_seam[:, 1] + height, _OFF_SKIN_M)
    out = np.stack([np.sin(angle), np.zeros(_COLUMNS), -np.cos(angle)], axis=1)
    splayed = _SPLAY * front * np.where(angle < np.pi, 1.0, -1.0)
    reach = scale * (_FALL_M + _POINT_M * front**2)
    fall = _falling(cloth, fold, seam, out, splayed, reach)
    up = np.array([0.0, 1.0, 0.0])
    rows = [
        seam - 0.004 * up - 0.001 * out,
        seam,
        0.5 * (seam + fold),
        fold - 0.0008 * up,
        fold + 0.0015 * out + 0.0004 * up,
        *fall,
        # Its edge goes into the cloth, so that thinning opens no slits along it.
        fall[-1] - _EDGE_INTO_M * _nearest_normals(cloth, fall[-1]),
    ]
    sheet = _sheet(rows, weights, tone, cloth.material, closed=False)
    near = np.stack(
        [np.interp(angle, even, column, period=2 * np.pi) for column in weights.T], axis=1
    )
    _, below = cKDTree(cloth.vertices_m).query(fall[-1], k=4)
    lying = cloth.weights[below].mean(axis=1)
    shares = np.clip((np.arange(len(rows)) - 4) / len(fall), 0, 1)[:, None, None]
    mixed = ((1 - shares) * near + shares * lying).reshape(len(sheet.vertices_m), -1)
    return _textured(figure, replace(sheet, weights=mixed))


_COLUMNS = 80
_GAP_BELOW, _GAP_ABOVE = 0.03, 0.15
"""Half of what is open in front, in radians, of a stand: at its seam and at its fold."""
_STAND_M, _LOWER_IN_FRONT_M, _OFF_SKIN_M = 0.028, 0.012, 0.004
_FALL_M, _POINT_M, _SPLAY = 0.044, 0.022, 0.55
_EDGE_INTO_M = 0.007
_FALL_ROWS, _OFF_CLOTH_M, _EDGE_OFF_CLOTH_M, _OFF_STAND_M = 9, 0.0035, 0.0028, 0.003


def _falling(
    cloth: Piece, fold: Vector, seam: Vector, out: Vector, splayed: Vector, reach: Vector
) -> list[Vector]:
    """Return rows (c, 3) of a collar's fall: from its fold it goes down, outside of the stand,
    until it meets the cloth, and lies on it.
    """
    wish = 0.35 * out - np.array([0.0, 1.0, 0.0])
    wish[:, 0] += splayed
    wish = unit(wish)
    at, way, rows = fold + 0.003 * out, wish, []
    deep = np.maximum(fold[:, 1] - seam[:, 1], 1e-6)
    for off_m in np.linspace(_OFF_CLOTH_M, _EDGE_OFF_CLOTH_M, _FALL_ROWS):
        before = at
        at = at + (reach / _FALL_ROWS)[:, None] * unit(way + 0.6 * wish)
        # The stand leans from its seam to its fold.
        share = np.clip((fold[:, 1] - at[:, 1]) / deep, 0, 1)[:, None]
        stand = fold + share * (seam - fold)
        within = np.sum((at - stand) * out, axis=1)
        at = at + np.maximum(_OFF_STAND_M - within, 0)[:, None] * (share < 1) * out
        at[1:-1] = 0.5 * at[1:-1] + 0.25 * (at[:-2] + at[2:])
        at = _at_least_off(cloth, at, float(off_m))
        way = unit(at - before)
        rows.append(at)
    return rows


def _at_least_off(cloth: Piece, points: Vector, least_m: float) -> Vector:
    """Move points out of a cloth along its normals, until they are off it by so much."""
    normals = vertex_normals(cloth.vertices_m, cloth.triangles)
    distance, index = cKDTree(cloth.vertices_m).query(points, k=4)
    centre, normal = cloth.vertices_m[index].mean(axis=1), unit(normals[index].mean(axis=1))
    off = np.sum((points - centre) * normal, axis=1)
    near = np.asarray(distance)[:, 0] < 0.025
    moved: Vector = points + (near * np.clip(least_m - off, 0, 0.02))[:, None] * normal
    return moved


def _by_the_neck(figure: Figure, angle: Vector, heights: Vector, clearance_m: float) -> Vector:
    """Return points (n, 3) round the neck, at angles from the front towards +x, off its skin."""
    neck, head = figure.at("neck"), figure.at("head")

    def axis(y: Vector) -> Vector:
        up = np.clip((y - neck[1]) / (head[1] - neck[1]), -0.3, 1.0)
        line: Vector = neck + up[:, None] * (head - neck)
        return line

    body = figure.body_m
    body = body[np.abs(body[:, 1] - heights.mean()) < 0.12]
    d = body - axis(body[:, 1])
    radius = np.hypot(d[:, 0], d[:, 2])
    body, d, radius = body[radius < 0.12], d[radius < 0.12], radius[radius < 0.12]
    around = np.arctan2(d[:, 0], -d[:, 2])
    turn = (around[None] - angle[:, None] + np.pi) % (2 * np.pi) - np.pi
    near = (turn / 0.22) ** 2 + ((body[None, :, 1] - heights[:, None]) / 0.008) ** 2
    share = np.exp(-near) + 1e-9
    wide = (share * radius).sum(axis=1) / share.sum(axis=1) + clearance_m
    for _ in range(3):
        inner = 0.5 * wide[1:-1] + 0.25 * (wide[:-2] + wide[2:])
        wide = np.concatenate([wide[:1], inner, wide[-1:]])
    points = axis(heights)
    points[:, 0] += wide * np.sin(angle)
    points[:, 1] = heights
    points[:, 2] -= wide * np.cos(angle)
    return points


def _front_line(cloth: Piece, x: float, heights: Vector) -> tuple[Vector, Vector, Vector]:
    """Return points, normals and weights on the front of a cloth at x and given heights."""
    normals = vertex_normals(cloth.vertices_m, cloth.triangles)
    p = cloth.vertices_m
    front = np.flatnonzero((normals[:, 2] < -0.2) & (np.abs(p[:, 0] - x) < 0.05))
    points, outs, weights = [], [], []
    for y in heights:
        d = np.hypot((p[front, 0] - x) / 0.6, p[front, 1] - y)
        near = front[np.argsort(d)[:6]]
        w = 1 / (d[np.argsort(d)[:6]] + 0.002)
        w = (w / w.sum())[:, None]
        points.append([x, y, float((p[near] * w).sum(axis=0)[2])])
        outs.append((normals[near] * w).sum(axis=0))
        weights.append((cloth.weights[near] * w).sum(axis=0))
    return np.array(points), unit(np.array(outs)), np.array(weights)


_STRIP_M = 0.0022
"""How far a placket is off the cloth it is sewn to."""


def _closed_front(figure: Figure, cloth: Piece, tone: Vector, cut: Cut) -> list[Piece]:
    """Return the buttons down the front, and the strip they are on if there is one."""
    neck = figure.at("neck")
    rim = cloth.vertices_m[np.unique(border(cloth.triangles))]
    middle = rim[(np.abs(rim[:, 0]) < 0.02) & (rim[:, 2] < neck[2])]
    top_m = float(middle[:, 1].max()) - 0.002
    low_m = max(float(middle[:, 1].min()) + 0.004, top_m - cut.buttoned_m)
    points, out, weights = _front_line(cloth, 0.0, np.arange(top_m - 0.035, low_m + 0.02, -0.085))
    off_m = 0.0040 + _STRIP_M * cut.placket
    buttons = replace(_discs(points + off_m * out, out, weights, tone), material="shoe")
    if not cut.placket:
        return [buttons]
    return [_placket(figure, cloth, tone, np.linspace(top_m, low_m, 26)), buttons]


def _placket(figure: Figure, cloth: Piece, tone: Vector, heights_m: Vector) -> Piece:
    rows, weights = [], np.zeros(0)
    for x, lift_m in ((-0.0165, 0.0), (-0.016, _STRIP_M), (0.016, _STRIP_M), (0.0165, 0.0)):
        points, out, weights = _front_line(cloth, x, heights_m)
        for _ in range(6):
            points[1:-1] = 0.5 * points[1:-1] + 0.25 * (points[:-2] + points[2:])
        rows.append(points + (lift_m + 0.0026) * out)
    strip = _sheet(rows, weights, tone * 0.97, cloth.material, closed=False)
    behind = np.array([0.0, 0.0, 10.0])
    return _textured(figure, _outwards(strip, behind))


def _discs(points: Vector, out: Vector, weights: Vector, tone: Vector) -> Piece:
    """Return buttons: small twelve-sided discs with a rim."""
    n, k = len(points), 12
    around = 2 * np.pi * np.arange(k) / k
    x = unit(np.cross(out, np.array([0.0, 1.0, 0.0])))
    y = np.cross(x, out)
    ring = np.cos(around)[None, :, None] * x[:, None] + np.sin(around)[None, :, None] * y[:, None]
    rows = np.stack(
        [points[:, None] + 0.0055 * ring - 0.002 * out[:, None], points[:, None] + 0.0050 * ring],
        axis=1,
    )
    vertices = np.concatenate([rows.reshape(-1, 3), points])
    base = (2 * k * np.arange(n))[:, None] + np.arange(k)
    turn = np.roll(base, -1, axis=1)
    hub = np.broadcast_to((2 * k * n + np.arange(n))[:, None], base.shape)
    triangles = np.concatenate(
        [
            np.stack([base, turn, turn + k], axis=-1).reshape(-1, 3),
            np.stack([base, turn + k, base + k], axis=-1).reshape(-1, 3),
            np.stack([base + k, turn + k, hub], axis=-1).reshape(-1, 3),
        ]
    )
    shade = np.array([0.90, 0.88, 0.84]) if tone.mean() > 0.45 else np.array([0.16, 0.14, 0.13])
    return Piece(
        vertices_m=vertices,
        triangles=triangles,
        weights=np.concatenate([np.repeat(weights, 2 * k, axis=0), weights]),
        colour=np.tile(shade, (len(vertices), 1)),
        part=np.full(len(triangles), PART_INDEX["torso"]),
        material="shoe",
    )


def _lapel_band(figure: Figure, cloth: Piece, tone: Vector, garment: Garment) -> list[Piece]:
    """Return a band along the open front: ribbed for a cardigan, broad lapels for a jacket."""
    neck = figure.at("neck")
    rim = np.unique(border(cloth.triangles))
    p = cloth.vertices_m[rim]
    is_jacket = garment.kind == "jacket"
    bands, pieces = [], []
    for side in (-1.0, 1.0):
        mine = (side * p[:, 0] > -0.002) & (p[:, 2] < neck[2] + 0.10) & (np.abs(p[:, 0]) < 0.13)
        mine &= p[:, 1] > p[np.abs(p[:, 0]) < 0.05][:, 1].min() + 0.004
        line = rim[mine]
        q = cloth.vertices_m[line]
        # Up the front edge, then round the neck to its back.
        turn = np.arctan2(np.maximum(side * q[:, 0], 0), neck[2] - q[:, 2])
        front = (q[:, 2] < neck[2] - 0.02) | (q[:, 1] < neck[1] - 0.08)
        key = np.where(front, q[:, 1], 10 + turn)
        line = line[np.argsort(key)]
        q = cloth.vertices_m[line]
        step = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
        at = np.linspace(0, step[-1], 60)
        edge = np.stack([np.interp(at, step, q[:, k]) for k in range(3)], axis=1)
        for _ in range(5):
            edge[1:-1] = 0.5 * edge[1:-1] + 0.25 * (edge[:-2] + edge[2:])
        weights = cloth.weights[line[np.abs(step[None] - at[:, None]).argmin(axis=1)]]
        dip = neck[1] - (0.30 if is_jacket else 0.24)
        rise = np.clip((edge[:, 1] - dip) / 0.12, 0, 1)
        wide = np.where(
            is_jacket,
            0.010 + 0.045 * rise * np.clip((neck[1] - edge[:, 1]) / 0.02 + 1, 0.55, 1),
            0.024,
        )
        away = np.stack(
            [
                side * np.ones(60),
                0.15 * np.ones(60),
                np.clip((edge[:, 2] - neck[2] + 0.03) / 0.05, 0, 1) * 1.5,
            ],
            axis=1,
        )
        tangent = unit(np.gradient(edge, axis=0))
        away = unit(away - tangent * np.sum(away * tangent, axis=1, keepdims=True))
        near = _nearest_normals(cloth, edge + 0.02 * away)
        over = edge + wide[:, None] * away
        over = _on_surface(cloth, over)
        rows = [
            edge - 0.003 * near,
            edge + 0.003 * near,
            0.5 * (edge + over) + 0.0065 * near,
            over + 0.0045 * near,
            over - 0.001 * near,
        ]
        bands.append((rows, weights))
    for one, other in zip(bands[0][0], bands[1][0], strict=True):
        # Both bands meet in the middle of the back.
        one[-1] = other[-1] = 0.5 * (one[-1] + other[-1]) * np.array([0.0, 1.0, 1.0])
    for rows, weights in bands:
        sheet = _sheet(
            rows, weights, tone * (1.0 if is_jacket else 0.9), cloth.material, closed=False
        )
        pieces.append(_textured(figure, _outwards(sheet, np.array([0.0, 0.0, 0.3]))))
    return pieces


def _nearest_normals(cloth: Piece, points: Vector) -> Vector:
    normals = vertex_normals(cloth.vertices_m, cloth.triangles)
    _, index = cKDTree(cloth.vertices_m).query(points, k=4)
    return unit(normals[index].mean(axis=1))


def _on_surface(cloth: Piece, points: Vector) -> Vector:
    """Move points along the normal on to the plane of the cloth near them."""
    normals = vertex_normals(cloth.vertices_m, cloth.triangles)
    _, index = cKDTree(cloth.vertices_m).query(points, k=4)
    centre, normal = cloth.vertices_m[index].mean(axis=1), unit(normals[index].mean(axis=1))
    moved: Vector = points - normal * np.sum((points - centre) * normal, axis=1, keepdims=True)
    return moved
