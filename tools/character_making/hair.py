"""Hair: a close shell over the scalp and hundreds of tapering locks that are combed and fall."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from lab.geometry import Vector, unit
from stimuli.characters.body_parts import PART_INDEX
from tools.character_making.cutting import clipped
from tools.character_making.figure import Figure
from tools.character_making.hairline import hairline_field
from tools.character_making.mantle import Fall, Sheet, mantle, sheet_piece
from tools.character_making.noise import noise
from tools.character_making.pieces import Piece, vertex_normals


@dataclass(frozen=True)
class Style:
    """A haircut. `length_m` at the crown, `side` share of it at the temples; `comb` says where
    locks go; `lift_m` how far the shell and the locks stand off; `part_m` where the parting is;
    `curl_m` radius of curls; `tie` is none, bun or tail; `tip` the share of their width that locks
    end with; from afar there are `fewer_afar` times fewer of them, so much wider.
    """

    comb: str
    length_m: float
    locks: int
    width_m: float = 0.011
    lift_m: float = 0.008
    side: float = 1.0
    part_m: float = 0.0
    curl_m: float = 0.0
    receding: float = 0.0
    tie: str = "none"
    rows: int = 9
    wave_m: float = 0.004
    tip: float = 0.12
    fewer_afar: float = 1.0
    fall: Fall | None = None


STYLES = {
    "long": Style(
        "fall", 0.50, 0, 0.007, 0.012, fall=Fall(0.58, 0.012, 0.013, 0.16, 0.085, 0.0045, 18)
    ),
    "shoulder": Style(
        "fall", 0.36, 0, 0.007, 0.013, fall=Fall(0.47, -0.022, 0.014, 0.14, 0.07, 0.005, 16)
    ),
    "bob": Style(
        "fall", 0.26, 0, 0.007, 0.014, fall=Fall(0.32, 0.020, 0.016, 0.22, 0.02, 0.003, 14)
    ),
    "bun": Style("back", 0.30, 420, 0.008, 0.006, tie="bun", wave_m=0.001, fewer_afar=1.6),
    "ponytail": Style("back", 0.30, 420, 0.008, 0.006, tie="tail", wave_m=0.001, fewer_afar=1.6),
    "curly": Style("out", 0.036, 640, 0.008, 0.042, curl_m=0.008, rows=7),
    "afro": Style("out", 0.010, 560, 0.006, 0.013, curl_m=0.004, rows=5),
    "short": Style(
        "short", 0.048, 620, 0.007, 0.009, 0.4, -0.03, receding=0.25, rows=5, fewer_afar=1.3
    ),
    "fringe": Style("forward", 0.06, 640, 0.008, 0.010, side=0.6, rows=6, tip=0.6, fewer_afar=1.4),
    "receding": Style(
        "short", 0.03, 560, 0.006, 0.005, 0.8, 0.03, receding=1.0, rows=5, fewer_afar=1.5
    ),
}


_DENSE_FROM_M, _ROOTS_M = 0.006, 0.10
"""How far within the hairline hair is dense; what the whole picture of hair, with its uneven roots,
spans of a scalp."""


def shell(figure: Figure, body: Piece, colour: Vector, style: Style, seed: int) -> Piece:
    """Return the haired scalp, lifted off the head."""
    outside = hairline_field(figure, body.vertices_m, style.receding)
    normals = vertex_normals(body.vertices_m, body.triangles)
    on_head = body.weights[:, figure.rig.skeleton.index("head")] > 0.5
    outside = np.where(on_head, outside, 0.2)
    # Sheets lie upon it, and nothing of it comes through them.
    lifted_m = style.lift_m * (0.5 if style.fall else 1.0)
    lift = lifted_m * np.clip(-outside / 0.035, 0.02, 1)
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
    uv = np.stack([around / (2 * np.pi) * 12, np.clip(inside / _ROOTS_M, 0, 0.5)], axis=-1)
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


def _wish(
    figure: Figure, style: Style, at: Vector, roots: Vector, share: float, lifted: Vector
) -> Vector:
    """Return where locks would go next: the comb's direction at points (n, 3)."""
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    q = at - eye
    down = np.array([0.0, -1.0, 0.0])
    aside = np.sign(roots[:, 0] - style.part_m)[:, None] * np.array([1.0, 0.0, 0.0])
    if style.comb == "fall":
        aside = aside * np.clip((0.15 - (roots[:, 2] - eye[2])) / 0.05, 0.05, 1)[:, None]
        in_front = np.clip((0.085 - (roots[:, 2] - eye[2])) / 0.06, 0, 1)[:, None]
        back = np.array([0.0, 0.0, 1.0])
        comb = aside * 0.9 + back * (0.15 + 0.75 * in_front) + 0.25 * down
        gravity = np.clip(share * style.length_m / 0.11, 0, 1)
        gravity = np.maximum(gravity, np.clip((lifted - 0.012) / 0.02, 0, 1))[:, None]
        aside = aside * np.clip(1 - lifted / 0.03, 0, 1)[:, None]
        return unit(comb * (1 - gravity) + down * gravity + 0.12 * back * in_front * gravity)
    if style.comb == "back":
        return unit(_tie_point(figure, style) - at)
    if style.comb == "forward":
        top = np.clip((q[:, 1] - 0.05) / 0.04, 0, 1)[:, None]
        front = np.array([0.0, -0.25, -1.0])
        return unit(top * (front + 0.15 * aside) + (1 - top) * (down + 0.25 * front))
    top = np.clip((q[:, 1] - 0.06) / 0.03, 0, 1)[:, None]
    front = np.clip((0.07 - q[:, 2]) / 0.05, 0, 1)[:, None]
    sweep = aside * 0.8 + np.array([0.0, 0.25, 0.35]) * front + np.array([0.0, 0.0, 0.35])
    return unit(top * sweep + (1 - top) * (down + np.array([0.0, 0.0, 0.35])))


def _grown(
    figure: Figure,
    style: Style,
    roots: Vector,
    normals: Vector,
    body: Piece,
    worn: list[Piece],
    rng: np.random.Generator,
) -> tuple[Vector, Vector]:
    """Return lines (n, rows, 3) of locks and the outward direction at each point."""
    surface = np.concatenate([p.vertices_m for p in (body, *worn)])
    outward = np.concatenate([vertex_normals(p.vertices_m, p.triangles) for p in (body, *worn)])
    tree = cKDTree(surface)
    n = len(roots)
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    sides = np.clip((0.08 - (roots[:, 1] - eye[1])) / 0.06, 0, 1)
    length = style.length_m * (1 - (1 - style.side) * sides)
    # A fringe is cut to one length; else its gaps are the teeth of a saw.
    length *= rng.uniform(0.96, 1.04, n) if style.comb == "forward" else rng.uniform(0.85, 1.08, n)
    if style.comb == "back":
        length = np.linalg.norm(_tie_point(figure, style) - roots, axis=1) * 1.12
    at = roots + (0.7 if style.comb == "out" else 0.4) * style.lift_m * normals
    lifted: Vector = np.zeros(n)
    loose = np.cross(normals, unit(rng.normal(size=(n, 3))))
    lines, outs = [at], [normals]
    phase = rng.uniform(0, 2 * np.pi, n)
    step = length / (style.rows - 1)
    for row in range(1, style.rows):
        share = row / (style.rows - 1)
        if style.comb == "out":
            wish = unit(0.55 * normals + loose)
        else:
            wish = _wish(figure, style, at, roots, share, lifted)
            near_normal = outs[-1]
            away = np.sum(wish * near_normal, axis=1, keepdims=True)
            held = np.clip(1.4 - lifted / 0.025, 0, 1)[:, None]
            wish = unit(wish - held * np.where(away > 0, 0.92, 1.0) * away * near_normal)
        at = at + step[:, None] * wish
        distance, index = tree.query(at)
        out = outward[index]
        high = np.sum((at - surface[index]) * out, axis=1)
        # Locks lie in layers: each keeps its own small distance from head and shoulders.
        layer = phase / (2 * np.pi)
        least = style.lift_m * (0.75 + 0.5 * layer) * (1 - 0.45 * share)
        if style.comb == "back":
            least = style.lift_m * (0.85 + 0.3 * layer)
        push = np.where(distance < 0.05, np.clip(least - high, 0, 0.03), 0)
        # Above the chin hair lies close; below it hangs free.
        above_chin = (at[:, 1] > eye[1] - 0.10) & (distance < 0.06)
        pull = np.where(above_chin, np.clip(high - 1.4 * least, 0, 0.03), 0)
        if style.comb != "out":
            push = push - 0.8 * pull
        lifted = np.maximum(high - pull, 0)
        at = at + push[:, None] * out
        lines.append(at)
        blend = np.clip(1 - distance / 0.06, 0, 1)[:, None]
        outs.append(unit(blend * out + (1 - blend) * outs[-1] + 1e-9))
    line, outs_all = np.stack(lines, axis=1), np.stack(outs, axis=1)
    along = np.linspace(0, 1, style.rows)
    if style.curl_m:
        turn = phase[:, None] + along * 2 * np.pi * 1.15
        across, other = _frames(line, outs_all)
        radius = style.curl_m * np.clip(along * 2.5, 0, 1)
        line = line + radius[None, :, None] * (
            np.cos(turn)[..., None] * across + np.sin(turn)[..., None] * other
        )
    elif style.wave_m:
        across, _ = _frames(line, outs_all)
        turn = phase[:, None] * 0.25 + along * style.length_m * 26
        line = line + (style.wave_m * along * np.sin(turn))[..., None] * across
    return line, outs_all


def _off_the_ears(figure: Figure, line: Vector, out: Vector) -> tuple[Vector, Vector]:
    """Leave out locks that an ear has pushed away from the head."""
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    q = (line - eye) / (figure.stature_m / 1.72)
    wide = (np.abs(q[..., 0]) > 0.083) & (q[..., 1] < 0.035) & (q[..., 2] < 0.15)
    # The tips of sideburns would stand off, combed to either side.
    tips = (q[:, 0, 1] < _SIDEBURN_TIP_M[0]) & (q[:, 0, 2] < _SIDEBURN_TIP_M[1])
    free = ~(wide.any(axis=1) | tips)
    return line[free], out[free]


_SIDEBURN_TIP_M = (0.022, 0.095)
"""Sideburns end in tips below and before this, from the eyes."""


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


THINNINGS = (Thinning(), Thinning(3, 2, 2.1), Thinning(9, 3, 4.2))


@dataclass(frozen=True, eq=False)
class Locks:
    """Lines (n, rows, 3) of hair with outward directions, colours (n, 3), tints and widths (n,)."""

    line: Vector
    out: Vector
    colour: Vector
    tint: Vector
    width_m: Vector
    start: Vector
    tip: float = 0.12
    fewer_afar: float = 1.0


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
        return [*sheets, loose]
    roots, normals = _roots(figure, body, style, rng)
    line, out = _grown(figure, style, roots, normals, body, worn, rng)
    if style.comb != "out":
        line, out = _off_the_ears(figure, line, out)
    combed = _coloured(line, out, style.width_m, colour, rng, grey)
    groups: list[Locks | Sheet] = [replace(combed, tip=style.tip, fewer_afar=style.fewer_afar)]
    if style.tie == "bun":
        groups.append(_bun(figure, style, colour, rng, grey))
    if style.tie == "tail":
        groups.append(_tail(figure, style, colour, rng, grey))
    return groups


def _coloured(
    line: Vector, out: Vector, width_m: float, colour: Vector, rng: np.random.Generator, grey: float
) -> Locks:
    n = len(line)
    tones = np.tile(colour, (n, 1))
    greyed = rng.random(n) < 0.5 * grey
    tones[greyed] = tones[greyed] * 0.75 + 0.25 * np.array([0.72, 0.71, 0.70])
    width = 0.5 * width_m * rng.uniform(0.75, 1.25, n)
    return Locks(line, out, tones, rng.normal(1.0, 0.06, n), width, rng.random(n))


def drawn(figure: Figure, group: Locks | Sheet, level: int, first: int = 0) -> Piece:
    """Return locks, from the `first` on, or a sheet as they are drawn at a level of detail."""
    if isinstance(group, Sheet):
        shape = group.line.shape[:2]
        weights = hair_weights(figure, group.line.reshape(-1, 3)).reshape(*shape, -1)
        return sheet_piece(figure, group, weights, *((1, 1), (3, 2), (6, 3))[level])
    thinning = THINNINGS[level]
    if level:
        some = round(thinning.locks * group.fewer_afar)
        thinning = replace(thinning, locks=some, wider=thinning.wider * some / thinning.locks)
    return ribbons(figure, group, thinning, first)


def ribbons(
    figure: Figure, group: Locks, thinning: Thinning = THINNINGS[0], first: int = 0
) -> Piece:
    """Lay tapering ribbons along locks, rounded by their normals."""
    keep = slice(first, None, thinning.locks)
    all_rows = group.line.shape[1]
    at_rows = np.unique([*range(0, all_rows, thinning.rows), all_rows - 1])
    line, out = group.line[keep][:, at_rows], group.out[keep][:, at_rows]
    n, rows, _ = line.shape
    across, facing = _frames(line, out)
    facing = np.where(np.sum(facing * out, axis=-1, keepdims=True) < 0, -facing, facing)
    share = at_rows / (all_rows - 1)
    taper = np.interp(
        share, [0, 0.15, 0.7, 1], [0.7, 1.0, 0.9 if group.tip > 0.5 else 0.8, group.tip]
    )
    wide = thinning.wider * taper[None, :] * group.width_m[keep][:, None]
    edges = np.stack([line - wide[..., None] * across, line + wide[..., None] * across], axis=2)
    normals = unit(np.stack([facing - 0.55 * across, facing + 0.55 * across], axis=2))
    base = np.arange(n * rows * 2).reshape(n, rows, 2)
    a, b, c, d = base[:, :-1, 0], base[:, :-1, 1], base[:, 1:, 0], base[:, 1:, 1]
    triangles = np.concatenate(
        [np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)]
    )
    tint = group.tint[keep][:, None] * (0.80 + 0.28 * share)
    tone = tint[:, :, None, None] * group.colour[keep][:, None, None, :] * np.ones((n, rows, 2, 1))
    start = group.start[keep][:, None, None]
    u = start + np.broadcast_to(np.array([0.0, 0.16 * thinning.wider]), (n, rows, 2))
    v = np.broadcast_to(0.02 + 0.96 * share[None, :, None], (n, rows, 2))
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
    return _coloured(line, unit(lean), 0.017, colour * 0.95, rng, grey)


def _tail(
    figure: Figure, style: Style, colour: Vector, rng: np.random.Generator, grey: float
) -> Locks:
    """Let a tail hang from the tie."""
    start = _tie_point(figure, style)
    n, rows = 90, 12
    t = np.linspace(0, 1, rows)
    spread = rng.normal(size=(n, 2)) * 0.5
    spread /= np.maximum(np.linalg.norm(spread, axis=1, keepdims=True), 1.0)
    thick = np.interp(t, [0, 0.12, 0.4, 0.8, 1], [0.010, 0.021, 0.026, 0.020, 0.006])
    x = spread[:, :1] * thick
    z = 0.045 * np.sin(np.minimum(t * 4.2, np.pi / 2)) - 0.03 * t + spread[:, 1:] * thick
    y = 0.02 * np.sin(t * np.pi * 1.2) * (t < 0.6) - 0.27 * t**1.15 * rng.uniform(0.85, 1.1, (n, 1))
    line = start + np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1)
    out = unit(
        np.stack([spread[:, :1] + 0 * t, 0.15 + 0 * x, 0.35 + spread[:, 1:] + 0 * t], axis=-1)
    )
    return _coloured(line, out, 0.012, colour, rng, grey)
