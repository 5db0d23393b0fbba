"""Hair: a close shell over the scalp, sheets that are combed and fall, and tapering locks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from character_making.combed import Combing, combed
from character_making.cutting import clipped
from character_making.figure import Figure
from character_making.hair_texture import BUNCHES, HALF_BEGUN, HALF_ENDED, SHEETS_DOWN
from character_making.hairline import hairline_field
from character_making.mantle import Fall, Head, Sheet, down_the_picture, mantle, sheet_piece
from character_making.noise import noise
from character_making.pieces import Piece, vertex_normals
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX


@dataclass(frozen=True)
class Style:
    """A haircut: one that falls, one that is combed close, or `locks` curls of `length_m` that
    stand out from a shell `lift_m` off the scalp, with a radius of `curl_m`. `tie` is none, bun or
    tail, `framing` how many locks hang loose before either ear.
    """

    length_m: float = 0.0
    locks: int = 0
    width_m: float = 0.007
    lift_m: float = 0.003
    curl_m: float = 0.0
    receding: float = 0.0
    tie: str = "none"
    framing: int = 0
    rows: int = 9
    fall: Fall | None = None
    combing: Combing | None = None


STYLES = {
    "long": Style(
        lift_m=0.006, fall=Fall(0.592, 0.012, 0.0125, 0.16, 0.085, 0.0045, 24, 0.06, 122.0)
    ),
    "shoulder": Style(lift_m=0.0065, fall=Fall(0.472, -0.022, 0.013, 0.14, 0.07, 0.005, 22)),
    "bob": Style(lift_m=0.007, fall=Fall(0.324, 0.020, 0.0155, 0.22, 0.02, 0.003, 17, 0.03, 119.0)),
    "bun": Style(tie="bun", combing=Combing(0.012, 0.6, beyond_m=0.004, ragged_m=0.020, at_edge=0)),
    "ponytail": Style(
        tie="tail",
        framing=6,
        combing=Combing(0.018, 0.6, beyond_m=0.004, ragged_m=0.020, loose=60, at_edge=0, rows=11),
    ),
    "curly": Style(0.037, 820, 0.024, 0.042, 0.004, rows=6),
    "afro": Style(0.013, 1000, 0.013, 0.013, 0.002, rows=4),
    "short": Style(
        receding=0.12,
        combing=Combing(0.016, 0.45, beyond_m=0.007, sweep_rad=0.25, ragged_m=0.026),
    ),
    "fringe": Style(
        combing=Combing(0.015, 0.55, 0.007, fringe_m=0.023, sweep_rad=0.20, ragged_m=0.018)
    ),
    "crop": Style(
        combing=Combing(0.018, 0.45, 0.007, fringe_m=0.012, sweep_rad=-0.25, ragged_m=0.024)
    ),
    "receding": Style(
        receding=0.8,
        combing=Combing(0.007, 0.8, sweep_rad=0.2, ragged_m=0.026, loose=20, at_edge=16),
    ),
}


_DENSE_FROM_M, _ROOTS_M, _COILS_M = 0.003, 0.10, 0.20
"""How far within the hairline hair is dense; what the whole picture of hair, with its uneven roots,
spans of a scalp, and that of coils."""


def shell(figure: Figure, body: Piece, colour: Vector, style: Style, seed: int) -> Piece:
    """Return the haired scalp, lifted off the head."""
    outside = hairline_field(figure, body.vertices_m, style.receding)
    normals = vertex_normals(body.vertices_m, body.triangles)
    on_head = body.weights[:, figure.rig.skeleton.index("head")] > 0.5
    outside = np.where(on_head, outside, 0.2)
    lift = style.lift_m * _rise(outside)
    if style.curl_m:
        lift = lift * (1 + 0.22 * noise(body.vertices_m, 60, seed))
    place = body.vertices_m + lift[:, None] * normals
    shade = 0.72 + (0.22 if style.curl_m else 0.08) * noise(
        place, 150 if style.curl_m else 60, seed + 3
    )
    piece = replace(
        body,
        vertices_m=place,
        colour=shade[:, None] * colour,
        material="hair",
        morphs={},
        corner_uv=None,
    )
    # Below sheets it ends where hair is dense; else it thins out into single hairs.
    piece = clipped(piece, outside + (_DENSE_FROM_M if style.fall else 0.0))
    crown = figure.body_m[figure.body_m[:, 1].argmax()] + np.array([0.0, -0.03, 0.02])
    d = piece.vertices_m - crown
    around = np.arctan2(d[:, 0], -d[:, 2])[piece.triangles]
    around = around[:, :1] + (around - around[:, :1] + np.pi) % (2 * np.pi) - np.pi
    inside = -hairline_field(figure, piece.vertices_m, style.receding)[piece.triangles]
    # Roots are thin along the hairline; farther up the cap is whole.
    turns, down = (
        (6, np.clip(inside / _COILS_M, 0, 0.98))
        if style.curl_m
        else (20 if style.fall else 12, np.clip(inside / _ROOTS_M, 0, 0.5))
    )
    uv = np.stack([around / (2 * np.pi) * turns, SHEETS_DOWN * down], axis=-1)
    part = np.full(len(piece.triangles), PART_INDEX["scalp"])
    return replace(piece, part=part, corner_uv=uv)


def _roots(
    figure: Figure, body: Piece, style: Style, rng: np.random.Generator
) -> tuple[Vector, Vector]:
    """Return points spread evenly over the haired scalp, and the normals there."""
    outside = hairline_field(figure, body.vertices_m, style.receding)
    head = body.weights[:, figure.rig.skeleton.index("head")] > 0.5
    haired = (outside < -0.003) & head
    triangles = body.triangles[haired[body.triangles].all(axis=1)]
    a, b, c = (body.vertices_m[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    n = style.locks * 6
    pick = rng.choice(len(triangles), n, p=area / area.sum())
    u, v = rng.random(n), rng.random(n)
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = a[pick] + u[:, None] * (b - a)[pick] + v[:, None] * (c - a)[pick]
    normals = vertex_normals(body.vertices_m, body.triangles)[triangles[pick]].mean(axis=1)
    # Of many candidates keep those that are far from the ones kept before.
    gap = np.sqrt(area.sum() / 2 / style.locks) * 0.75
    near = cKDTree(points).query_ball_point(points, gap)
    free = np.ones(n, dtype=bool)
    kept = []
    for i in range(n):
        if free[i]:
            kept.append(i)
            free[near[i]] = False
    chosen = np.array(kept[: style.locks * 2])
    return points[chosen], unit(normals[chosen])


_TIED_OFF_M = 0.004
"""How far above the hair on the head the middle of a tie is."""


def _tie_point(figure: Figure, style: Style) -> Vector:
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    k = figure.stature_m / 1.72
    up = 0.055 if style.tie == "bun" else 0.065
    level_m = eye[1] + k * up
    body = figure.body_m
    here = (np.abs(body[:, 0]) < 0.03) & (np.abs(body[:, 1] - level_m) < 0.02)
    return np.array([0.0, level_m, body[here, 2].max() + style.lift_m + _TIED_OFF_M])


def _grown(
    figure: Figure, style: Style, roots: Vector, normals: Vector, rng: np.random.Generator
) -> tuple[Vector, Vector]:
    """Return lines (n, rows, 3) of curls and the outward direction at each point."""
    n = len(roots)
    from_edge = -hairline_field(figure, roots, style.receding)
    # Along the hairline curls are short, and begin where the shell does.
    length = style.length_m * rng.uniform(0.85, 1.08, n) * np.interp(from_edge, [0, 0.03], [0.4, 1])
    at = roots + (0.9 * style.lift_m * _rise(-from_edge))[:, None] * normals
    loose = np.cross(normals, unit(rng.normal(size=(n, 3))))
    along = np.linspace(0, 1, style.rows)
    way = unit(0.55 * normals + loose)
    line = at[:, None] + (along[None, :] * length[:, None])[..., None] * way[:, None]
    outs = np.broadcast_to(normals[:, None], line.shape)
    turn = rng.uniform(0, 2 * np.pi, n)[:, None] + along * 2 * np.pi * 1.15
    across, other = _frames(line, outs)
    radius = style.curl_m * np.clip(along * 2.5, 0, 1)
    line = line + radius[None, :, None] * (
        np.cos(turn)[..., None] * across + np.sin(turn)[..., None] * other
    )
    return line, outs


def _rise(outside_m: Vector) -> Vector:
    """Return the share of its lift that hair has by how far it grows outside the hairline."""
    share: Vector = np.clip(-outside_m / 0.035, 0.02, 1)
    return share


def _framing(
    figure: Figure, style: Style, body: Piece, rng: np.random.Generator
) -> tuple[Vector, Vector]:
    """Return lines (n, rows, 3) of locks that hang loose from temples before ears, and outward
    directions.
    """
    k = figure.stature_m / 1.72
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    knots = k * np.array(
        [
            [0.046, 0.070, 0.016],
            [0.070, 0.044, 0.020],
            [0.074, 0.004, 0.040],
            [0.068, -0.030, 0.046],
        ]
    )
    t = np.linspace(0, 1, style.rows)
    bell = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    lines = []
    for sign in (-1.0, 1.0):
        n = style.framing
        spread = rng.normal(size=(n, 4, 3)) * np.array([0.002, 0.003, 0.005, 0.008])[:, None]
        # Roots stand in a row along the hairline.
        row = rng.uniform(0, 1, (n, 1)) * np.array([0.012, -0.014, 0.020])
        spread += np.array([1.0, 0.7, 0.5, 0.4])[:, None] * row[:, None]
        spread[:, 3, 1] += rng.uniform(-0.025, 0.025, n)
        lines.append(eye + (bell @ (knots + k * spread)) * np.array([sign, 1.0, 1.0]))
    line = np.concatenate(lines)
    clear = Head(figure, body, []).outside(line.reshape(-1, 3), np.full(line.size // 3, 0.003))
    facing = unit(np.sign(line[:, :, :1] - eye[0]) * np.array([1.0, 0.0, 0.0]) - [0.0, 0.0, 0.7])
    return clear.reshape(line.shape), facing


def _frames(line: Vector, out: Vector) -> tuple[Vector, Vector]:
    along = unit(np.gradient(line, axis=1))
    across = np.cross(along, out)
    across = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    return across, np.cross(across, along)


@dataclass(frozen=True)
class Thinning:
    """How locks are drawn at a level: every `locks`-th, every `rows`-th point, so much wider."""

    locks: int = 1
    rows: int = 1
    wider: float = 1.0


THINNINGS = (Thinning(), Thinning(3, 2, 1.7), Thinning(9, 3, 2.6))


@dataclass(frozen=True, eq=False)
class Locks:
    """Lines (n, rows, 3) of hair with outward directions, colours (n, 3), tints and widths (n,).
    They are as wide at their roots as the share `begins`, and lie upon sheets where they are loose.
    `roundness` is by how much their normals lean to either side.
    """

    line: Vector
    out: Vector
    colour: Vector
    tint: Vector
    width_m: Vector
    start: Vector
    begins: float = 0.7
    is_loose: bool = False
    roundness: float = 0.55


def locks(
    figure: Figure,
    body: Piece,
    worn: list[Piece],
    colour: Vector,
    style: Style,
    seed: int,
    grey: float = 0.0,
) -> list[Locks | Sheet]:
    """Return all locks and sheets, with what ties them."""
    rng = np.random.default_rng(seed + 1000)
    if style.fall is not None:
        sheets, line, out = mantle(figure, body, worn, colour, style.fall, seed, grey)
        loose = _coloured(line, out, style.width_m, colour, rng, grey)
        return [*sheets, replace(loose, is_loose=True, roundness=0.2)]
    groups: list[Locks | Sheet] = []
    if style.combing is not None:
        tie_m = None if style.tie == "none" else _tie_point(figure, style)
        sheets, line, out = combed(
            figure, body, colour, style.combing, style.receding, tie_m, seed, grey
        )
        # Of hair that is not grey all over, a lock that is would be a stripe.
        loose = _coloured(line, out, 0.012, colour, rng, grey if grey > 0.5 else 0.0)
        groups += [*sheets, replace(loose, begins=0.2, is_loose=True)]
    else:
        roots, normals = _roots(figure, body, style, rng)
        line, out = _grown(figure, style, roots, normals, rng)
        groups.append(_coloured(line, out, style.width_m, colour, rng, grey))
    if style.framing:
        line, out = _framing(figure, style, body, rng)
        groups.append(replace(_coloured(line, out, 0.0035, colour, rng, grey), begins=0.2))
    if style.tie == "bun":
        groups.append(_bun(figure, style, colour, rng, grey))
    if style.tie == "tail":
        groups.append(_tail(figure, style, colour, rng, grey))
    return groups


def seen_of(groups: list[Locks | Sheet]) -> Vector:
    """Return points (n, 3) all over where sheets are dense enough to hide what is below."""
    points = [np.zeros((0, 3))]
    for sheet in (group for group in groups if isinstance(group, Sheet)):
        finer = np.linspace(0, sheet.line.shape[1] - 1, 6 * sheet.line.shape[1])
        whole = np.arange(sheet.line.shape[1])
        down = down_the_picture(sheet)
        for beside in (0.0, 0.25, 0.5, 0.75):
            line = (1 - beside) * sheet.line[:-1] + beside * sheet.line[1:]
            at = (1 - beside) * down[:-1] + beside * down[1:]
            for guide, place in zip(line, at, strict=True):
                fine = np.stack([np.interp(finer, whole, x) for x in guide.T], axis=1)
                v = np.interp(finer, whole, place)
                points.append(fine[(v > HALF_BEGUN * SHEETS_DOWN) & (v < HALF_ENDED * SHEETS_DOWN)])
    return np.concatenate(points)


def _coloured(
    line: Vector, out: Vector, width_m: float, colour: Vector, rng: np.random.Generator, grey: float
) -> Locks:
    n = len(line)
    tones = np.tile(colour, (n, 1))
    greyed = rng.random(n) < 0.5 * grey
    tones[greyed] = tones[greyed] * 0.75 + 0.25 * np.array([0.72, 0.71, 0.70])
    width = 0.5 * width_m * rng.uniform(0.75, 1.25, n)
    start = rng.integers(0, BUNCHES, n) / BUNCHES
    return Locks(line, out, tones, rng.normal(1.0, 0.06, n), width, start)


def pieces_of(
    figure: Figure, groups: Sequence[Locks | Sheet], level: int, first: int = 0
) -> list[Piece]:
    """Return what of hair, sheets from within outwards, is drawn at a level of detail, by locks and
    guides of sheets from the `first` on. From afar one sees the outer sheets alone.
    """
    sheets = [group for group in groups if isinstance(group, Sheet)][level:]
    some = [g for g in groups if isinstance(g, Locks) and not (g.is_loose and level == _LIGHTEST)]
    return [
        *(_sheet_piece(figure, sheet, level, first) for sheet in sheets),
        *(ribbons(figure, group, THINNINGS[level], first) for group in some),
    ]


_LIGHTEST = 2


def _sheet_piece(figure: Figure, sheet: Sheet, level: int, first: int) -> Piece:
    weights = hair_weights(figure, sheet.line.reshape(-1, 3)).reshape(*sheet.line.shape[:2], -1)
    return sheet_piece(figure, sheet, weights, *((sheet.guides, 1), (3, 2), (4, 2))[level], first)


def ribbons(
    figure: Figure, group: Locks, thinning: Thinning = THINNINGS[0], first: int = 0
) -> Piece:
    """Lay cards with bunches of hairs along locks, rounded by their normals."""
    keep = slice(first, None, thinning.locks)
    all_rows = group.line.shape[1]
    at_rows = np.unique([*range(0, all_rows, thinning.rows), all_rows - 1])
    line, out = group.line[keep][:, at_rows], group.out[keep][:, at_rows]
    n, rows, _ = line.shape
    across, facing = _frames(line, out)
    facing = np.where(np.sum(facing * out, axis=-1, keepdims=True) < 0, -facing, facing)
    share = at_rows / (all_rows - 1)
    taper = np.interp(share, [0, 0.15, 0.7, 1], [0.5 * group.begins, 1.0, 0.9, 0.6])
    wide = thinning.wider * taper[None, :] * group.width_m[keep][:, None]
    edges = np.stack([line - wide[..., None] * across, line + wide[..., None] * across], axis=2)
    normals = unit(
        np.stack([facing - group.roundness * across, facing + group.roundness * across], axis=2)
    )
    base = np.arange(n * rows * 2).reshape(n, rows, 2)
    a, b, c, d = base[:, :-1, 0], base[:, :-1, 1], base[:, 1:, 0], base[:, 1:, 1]
    triangles = np.concatenate(
        [np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)]
    )
    tint = group.tint[keep][:, None] * (0.98 + 0.04 * share)
    tone = tint[:, :, None, None] * group.colour[keep][:, None, None, :] * np.ones((n, rows, 2, 1))
    start = group.start[keep][:, None, None]
    u = start + np.broadcast_to(np.array([0.0, 1.0 / BUNCHES]), (n, rows, 2))
    v = SHEETS_DOWN + (1 - SHEETS_DOWN) * (0.02 + 0.96 * share[None, :, None])
    v = np.broadcast_to(v, (n, rows, 2))
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    vertices = edges.reshape(-1, 3)
    return Piece(
        vertices_m=vertices,
        triangles=triangles,
        weights=hair_weights(figure, vertices),
        colour=np.clip(tone.reshape(-1, 3), 0, 1),
        part=np.full(len(triangles), PART_INDEX["scalp"]),
        material="hair",
        corner_uv=uv[triangles],
        normals=normals.reshape(-1, 3),
    )


def hair_weights(figure: Figure, points_m: Vector) -> Vector:
    """Return weights: hair turns with the head, its ends rest on neck and shoulders."""
    skeleton = figure.rig.skeleton
    weights = np.zeros((len(points_m), len(skeleton.names)))
    chin = figure.at("head")[1] - 0.02
    low = np.clip((chin - points_m[:, 1]) / 0.16, 0, 1)
    weights[:, skeleton.index("head")] = 1 - low
    weights[:, skeleton.index("neck")] = low * (1 - low)
    weights[:, skeleton.index("upper_chest")] = low * low
    return weights


def _bun(
    figure: Figure, style: Style, colour: Vector, rng: np.random.Generator, grey: float
) -> Locks:
    """Wind locks round a ball behind the head."""
    centre = _tie_point(figure, style) + np.array([0.0, 0.004, 0.012])
    n, rows = 44, 14
    t = np.linspace(0, 1, rows)
    tilt = rng.uniform(0, np.pi, n)
    turn = rng.uniform(0, 2 * np.pi, n)
    angle = turn[:, None] + t[None, :] * np.pi * 1.3
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    lean = np.stack(
        [
            circle[..., 0],
            circle[..., 1] * np.cos(tilt)[:, None],
            circle[..., 1] * np.sin(tilt)[:, None],
        ],
        axis=-1,
    )
    radius = 0.031 * rng.uniform(0.95, 1.05, n)
    line = centre + radius[:, None, None] * lean * np.array([1.1, 1.0, 0.8])
    return _coloured(line, unit(lean), 0.026, colour * 0.95, rng, grey)


def _tail(
    figure: Figure, style: Style, colour: Vector, rng: np.random.Generator, grey: float
) -> Locks:
    """Let a tail hang from the tie."""
    start = _tie_point(figure, style)
    n, rows = 90, 12
    t = np.linspace(0, 1, rows)
    spread = rng.normal(size=(n, 2)) * 0.5
    spread /= np.maximum(np.linalg.norm(spread, axis=1, keepdims=True), 1.0)
    thick = np.interp(t, [0, 0.12, 0.4, 0.8, 1], [0.009, 0.021, 0.027, 0.023, 0.013])
    # Locks turn round each other, and the whole sways to a side and back.
    turned = spread[:, :1] * np.cos(1.3 * t) - spread[:, 1:] * np.sin(1.3 * t)
    deep = spread[:, :1] * np.sin(1.3 * t) + spread[:, 1:] * np.cos(1.3 * t)
    phase, bends = rng.uniform(0, 2 * np.pi, (n, 1)), rng.uniform(1.5, 3.0, (n, 1))
    waves = 0.0035 * np.sin(phase + bends * np.pi * t) * np.clip(2 * t, 0, 1)
    x = turned * thick + waves + 0.012 * np.sin(1.5 * np.pi * t) * t
    z = 0.045 * np.sin(np.minimum(t * 4.2, np.pi / 2)) - 0.03 * t + deep * thick
    y = 0.02 * np.sin(t * np.pi * 1.2) * (t < 0.6) - 0.27 * t**1.15 * rng.uniform(0.72, 1.1, (n, 1))
    line = start + np.stack([x, y, z], axis=-1)
    out = unit(np.stack([turned, 0.15 + 0 * x, 0.35 + deep], axis=-1))
    return replace(
        _coloured(line, out, 0.018, colour, rng, grey),
        tint=np.clip(rng.normal(0.97, 0.13, n), 0.7, 1.25),
    )
