"""Hair that falls: sheets combed from a parting over the head and down, one upon the other."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from character_making.figure import Figure
from character_making.hair_texture import SHEETS_DOWN
from character_making.noise import noise
from character_making.pieces import Piece, vertex_normals
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.body_parts import PART_INDEX

_EQUATOR = np.radians(97.0)
_GUIDES = 57
_ROOTS_M = 0.012
_LOOSE, _LOOSE_WAY = 56, 0.6


@dataclass(frozen=True)
class Fall:
    """How hair falls: `length_m` from the parting, parted at `part_m` right of the middle, lifted
    off the head by `lift_m`; `inward` is how much it closes in below the jaw, `behind_m` how far
    it goes back over the shoulders; `wave_m` the depth of locks. Tips end within `tips_m`; sheets
    reach `front_deg` round from the back of the head, to the temples.
    """

    length_m: float
    part_m: float
    lift_m: float
    inward: float = 0.1
    behind_m: float = 0.06
    wave_m: float = 0.004
    rows: int = 16
    tips_m: float = 0.060
    front_deg: float = 121.0


@dataclass(frozen=True, eq=False)
class Sheet:
    """Guides (g, rows, 3) side by side from root to tip, with colours (g, 3). Roots begin within
    `roots_m`, tips end within `tips_m`, from strand to strand, for all guides alike or (g,); from
    guide to guide lies the share `strands` of the picture of hair. In the full level every
    `guides`-th is drawn.
    """

    line: Vector
    out: Vector
    colour: Vector
    roots_m: float = 0.0
    tips_m: float | Vector = 0.0
    strands: float = 0.14
    guides: int = 1


class Head:
    """The surface of a head and of what is below it, to keep hair outside; without `ears` the
    scalp goes on where they stand.
    """

    def __init__(
        self, figure: Figure, body: Piece, worn: list[Piece], *, ears: bool = True
    ) -> None:
        self.scale = figure.stature_m / 1.72
        self.eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
        self.centre = self.eye + self.scale * np.array([0.0, 0.030, 0.097])
        on_head = body.weights[:, figure.rig.skeleton.index("head")] > 0.5
        high = body.vertices_m[on_head & (body.vertices_m[:, 1] > self.eye[1] - 0.13)]
        q = (high - self.eye) / self.scale
        on_ear = (np.abs(q[:, 0]) > 0.077) & (q[:, 1] < 0.035) & (q[:, 2] < 0.15)
        high = high if ears else high[~on_ear]
        self._radius = np.linalg.norm(high - self.centre, axis=1)
        self._towards = cKDTree(unit(high - self.centre))
        pieces = [body, *worn]
        self._points = np.concatenate([p.vertices_m for p in pieces])
        self._normals = np.concatenate([vertex_normals(p.vertices_m, p.triangles) for p in pieces])
        self._tree = cKDTree(self._points)

    def on_scalp(self, towards: Vector, lift_m: float) -> Vector:
        """Return points (n, 3) of the lifted scalp in unit directions from its centre."""
        away, index = self._towards.query(towards, k=14)
        share = np.exp(-((away / 0.10) ** 2))
        radius = (share * self._radius[index]).sum(axis=1) / share.sum(axis=1)
        points: Vector = self.centre + (radius + lift_m)[:, None] * towards
        return points

    def outside(self, points: Vector, least_m: Vector) -> Vector:
        """Push points (n, 3) out to at least `least_m` (n,) from skin and clothes."""
        _, index = self._tree.query(points, k=3)
        normal = unit(self._normals[index].mean(axis=1) + 1e-9)
        high = np.sum((points - self._points[index].mean(axis=1)) * normal, axis=1)
        push = np.clip(least_m - high, 0, 0.03)
        moved: Vector = points + push[:, None] * normal
        return moved


def _directions(polar: Vector, azimuth: Vector) -> Vector:
    """Return unit vectors: polar from the crown, azimuth from the back towards +x."""
    s = np.sin(polar)
    return np.stack([s * np.sin(azimuth), np.cos(polar), s * np.cos(azimuth)], axis=-1)


def _guides(head: Head, fall: Fall, lift_m: float, length_m: Vector) -> Vector:
    """Return guides (g, rows, 3) from the parting over the head and straight down."""
    front = np.radians(fall.front_deg)
    azimuth = np.linspace(-front, front, _GUIDES)
    side = np.where(azimuth < 0, -1.0, 1.0)
    share = np.abs(azimuth) / front
    # The parting runs from the crown (share 0) to the hairline in front (share 1).
    polar = np.interp(share, [0.0, 0.25, 1.0], [-0.55, -0.10, 1.10])
    x = head.scale * (fall.part_m + 0.004 * side)
    start = np.stack([x / 0.1, np.cos(polar), -np.sin(polar)], axis=-1)
    start = unit(start)
    end = _directions(np.full(_GUIDES, _EQUATOR), azimuth)
    steps = np.linspace(0, 1, 13)
    angle = np.arccos(np.clip(np.sum(start * end, axis=1), -1, 1))[:, None]
    over = [
        unit((np.sin((1 - t) * angle) * start + np.sin(t * angle) * end) / np.sin(angle))
        for t in steps
    ]
    rise = np.interp(steps, [0, 0.15, 1], [0.35, 1.0, 1.0])
    path = [head.on_scalp(d, float(r) * lift_m) for d, r in zip(over, rise, strict=True)]
    equator = path[-1]
    flat = (equator - head.centre) * np.array([1.0, 0.0, 1.0])
    for depth in np.linspace(0.012, 0.55, 46):
        closing = 1 - fall.inward * np.clip((depth - 0.07) / 0.08, 0, 1)
        wide = 1 + 0.06 * np.sin(np.clip(depth / 0.08, 0, 1) * np.pi)
        place = head.centre + flat * np.array([closing * wide, 0.0, wide])
        place[:, 1] = equator[:, 1] - depth
        beside = np.clip((share - 0.35) / 0.3, 0, 1)
        low = np.clip((depth - 0.07) / 0.10, 0, 1)
        place[:, 2] += fall.behind_m * head.scale * beside * low * low * (3 - 2 * low)
        path.append(place)
    whole = np.stack(path, axis=1)
    reach = np.linalg.norm(np.diff(whole, axis=1), axis=-1).cumsum(axis=1)
    reach = np.concatenate([np.zeros((_GUIDES, 1)), reach], axis=1)
    length_m = _to_one_level(whole[..., 1], reach, length_m)
    # Over the head it bends the most.
    at = np.linspace(0, 1, fall.rows) ** 1.25
    lines = np.empty((_GUIDES, fall.rows, 3))
    for g in range(_GUIDES):
        for k in range(3):
            lines[g, :, k] = np.interp(at * length_m[g], reach[g], whole[g, :, k])
    return lines


_LEVEL = 0.8


def _to_one_level(height_m: Vector, reach_m: Vector, length_m: Vector) -> Vector:
    """Return lengths (g,) mostly cut so that hair ends at one height all round: cut to one length
    it would end in a point behind.
    """
    ends = [np.interp(v, r, y) for v, r, y in zip(length_m, reach_m, height_m, strict=True)]
    level = np.median(ends)
    falling = height_m[:, ::-1], reach_m[:, ::-1]
    to_level = [np.interp(level, y, r) for y, r in zip(*falling, strict=True)]
    uneven = length_m - np.median(length_m)
    return (1 - _LEVEL) * length_m + _LEVEL * (np.array(to_level) + uneven)


def _relaxed(head: Head, lines: Vector, least_m: float) -> Vector:
    """Smooth guides against each other and keep them outside of head, neck and shoulders."""
    first = lines[:, 0].copy()
    row = np.linspace(0, 1, lines.shape[1])
    least = np.tile(least_m * np.interp(row, [0, 0.1, 1], [0.35, 1, 0.8]), len(lines))
    for _ in range(9):
        beside = lines.copy()
        beside[1:-1] = 0.5 * lines[1:-1] + 0.25 * (lines[:-2] + lines[2:])
        beside[:, 1:-1] = 0.6 * beside[:, 1:-1] + 0.2 * (beside[:, :-2] + beside[:, 2:])
        push = head.outside(beside.reshape(-1, 3), least).reshape(lines.shape) - beside
        above_jaw = beside[..., 1:2] > head.eye[1] - 0.09 * head.scale
        lines = beside + np.where(above_jaw, _spread_out(push), push)
        lines[:, 0] = first
    return lines


def _spread_out(push: Vector) -> Vector:
    """Return pushes (g, rows, 3) of which half reaches those beside: above ears hair bulges, and
    would have corners.
    """
    for axis in (0, 1):
        last = push.shape[axis] - 1
        before, after = (
            0.5 * push.take(np.clip(np.arange(last + 1) + step, 0, last), axis) for step in (-1, 1)
        )
        pushes = np.stack([push, before, after])
        largest = np.linalg.norm(pushes, axis=-1, keepdims=True).argmax(axis=0)
        push = np.take_along_axis(pushes, largest[None], axis=0)[0]
    return push


def mantle(
    figure: Figure,
    body: Piece,
    worn: list[Piece],
    colour: Vector,
    fall: Fall,
    seed: int,
    grey: float = 0.0,
) -> tuple[list[Sheet], Vector, Vector]:
    """Return the sheets, innermost first, and lines (n, rows, 3) with outward directions of loose
    locks upon them.
    """
    head = Head(figure, body, worn)
    rng = np.random.default_rng(seed + 2000)
    sheets = []
    guide = np.arange(_GUIDES)
    for layer, (lift, reach) in enumerate(((0.35, 0.90), (0.8, 0.97), (1.2, 1.0))):
        knots = rng.uniform(-1, 1, (3, _GUIDES))
        uneven = np.interp(guide, np.arange(0, _GUIDES, 3), knots[0, ::3])
        length = fall.length_m * head.scale * reach * (1 + 0.05 * uneven)
        lines = _guides(head, fall, lift * fall.lift_m, length)
        lines = _relaxed(head, lines, 0.0025 + 0.6 * lift * fall.lift_m)
        out = outwards(head, lines)
        deep = np.interp(np.linspace(0, 1, fall.rows), [0, 0.25, 0.6, 1], [0.1, 0.5, 1.0, 1.0])
        phase = rng.uniform(0, 2 * np.pi)
        clumps = np.sin(guide * (0.85 + 0.2 * layer) + 1.5 * uneven + phase)
        bend = np.sin(np.linspace(0, 9.0, fall.rows)[None, :] + 2.2 * uneven[:, None] + phase)
        depth = fall.wave_m * deep * (0.55 * clumps[:, None] + 0.6 * bend)
        lines = lines + depth[..., None] * out
        tone = 1 + 0.07 * clumps + 0.05 * knots[1] + 0.05 * (layer - 1)
        tones = np.tile(colour, (_GUIDES, 1))
        grey_of_guide = 0.15 * grey * (1 + rng.uniform(-1, 1, (_GUIDES, 1)))
        tones = (1 - grey_of_guide) * tones + grey_of_guide * np.array([0.80, 0.79, 0.78])
        sheet = Sheet(lines, outwards(head, lines), tones * tone[:, None], _ROOTS_M, fall.tips_m)
        # Of the innermost little but its ends is seen.
        sheets.append(replace(sheet, guides=1 if layer else 2))
    line, out = loose_upon(sheets[-1], _LOOSE, rng)
    return sheets, line, out


def loose_upon(sheet: Sheet, n: int, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Return lines (n, rows, 3) and outward directions of locks that lie upon a sheet, each on a
    part of the way, half of them along its two edges.
    """
    n_guides, n_edge = len(sheet.line), n // 2
    aside = 0.7 + np.abs(rng.normal(0, 2.5, n_edge))
    edge = np.where(rng.random(n_edge) < 0.5, aside, n_guides - 1 - aside)
    guide = np.concatenate([rng.uniform(0, n_guides - 1, n - n_edge), edge])
    # With rows elsewhere than the sheet's, they would dip below it in between.
    n_rows = sheet.line.shape[1]
    n_along = round(_LOOSE_WAY * (n_rows - 1))
    first = rng.integers(1, n_rows - n_along, (n, 1))
    along = np.linspace(0, 1, n_along + 1)
    down = (first + np.arange(n_along + 1)) / (n_rows - 1)
    line, out = upon(sheet, guide[:, None] + rng.normal(0, 0.9, (n, 1)) * along**2, down)
    stand = rng.uniform(0.0012, 0.0020, (n, 1)) * (0.6 + 0.4 * np.sin(np.pi * along))
    return line + stand[..., None] * out, out


def upon(sheet: Sheet, guide: Vector, down: Vector) -> tuple[Vector, Vector]:
    """Return places (n, rows, 3) and outward directions on a sheet: at guides (n, rows), as shares
    `down` of the rows from root to tip.
    """
    n_guides, n_rows, _ = sheet.line.shape
    guide = np.clip(guide, 0, n_guides - 1.001)
    at = np.clip(down, 0, 1) * (n_rows - 1.001)
    g, r = np.floor(guide).astype(np.int64), np.floor(at).astype(np.int64)
    s, t = (guide - g)[..., None], (at - r)[..., None]

    def mixed(values: Vector) -> Vector:
        one = (1 - t) * values[g, r] + t * values[g, r + 1]
        other = (1 - t) * values[g + 1, r] + t * values[g + 1, r + 1]
        both: Vector = (1 - s) * one + s * other
        return both

    return mixed(sheet.line), unit(mixed(sheet.out))


def outwards(head: Head, lines: Vector) -> Vector:
    """Return unit normals (g, rows, 3) of a sheet, away from the head."""
    along = np.gradient(lines, axis=1)
    across = np.gradient(lines, axis=0)
    normal = unit(np.cross(along, across) + 1e-12)
    axis = head.centre * np.array([1.0, 0.0, 1.0])
    away = lines * np.array([1.0, 0.0, 1.0]) - axis
    away[..., 1] = np.maximum(lines[..., 1] - head.centre[1], 0)
    turned: Vector = np.where(np.sum(normal * away, axis=-1, keepdims=True) < 0, -normal, normal)
    return turned


def sheet_piece(
    figure: Figure, sheet: Sheet, weights: Vector, guides: int, rows: int, first: int = 0
) -> Piece:
    """Return a sheet as a surface of every `guides`-th guide, from the `first` on, and `rows`-th
    row; the outermost are always there.

    `weights` (g, rows, joints) of all its points.
    """
    n_g, n_r, _ = sheet.line.shape
    g = np.unique([0, *range(first % guides, n_g, guides), n_g - 1])
    r = np.unique([*range(0, n_r, rows), n_r - 1])
    line = sheet.line[g][:, r]
    index = np.arange(len(g) * len(r)).reshape(len(g), len(r))
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[:-1, 1:], index[1:, 1:]
    triangles = np.concatenate(
        [np.stack([a, c, d], axis=-1).reshape(-1, 3), np.stack([a, d, b], axis=-1).reshape(-1, 3)]
    )
    vertices = line.reshape(-1, 3)
    normals = vertex_normals(vertices, triangles)
    out = sheet.out[g][:, r].reshape(-1, 3)
    if np.sum(normals * out) < 0:
        triangles, normals = triangles[:, ::-1].copy(), -normals
    share = np.broadcast_to(r / (n_r - 1), (len(g), len(r)))
    shade = np.interp(share, [0, 0.12, 0.4, 1], [0.80, 0.95, 1.0, 1.06])
    colour = shade[..., None] * sheet.colour[g][:, None]
    u = np.broadcast_to(g[:, None] * sheet.strands, share.shape)
    uv = np.stack([u, down_the_picture(sheet)[g][:, r]], axis=-1).reshape(-1, 2)
    piece = Piece(
        vertices_m=vertices,
        triangles=triangles,
        weights=weights[g][:, r].reshape(len(vertices), -1),
        colour=np.clip(colour.reshape(-1, 3), 0, 1),
        part=np.full(len(triangles), PART_INDEX["scalp"]),
        material="hair",
        corner_uv=uv[triangles],
        normals=unit(normals + 1e-9),
    )
    return replace(piece, normals=_softened(piece, line, out))


_BEGIN, _BEGUN, _ENDS, _ENDED = 0.02, 0.15, 0.62, 0.98
"""Where in the picture of hair the first strands begin, all have begun, the first end, all have."""


def down_the_picture(sheet: Sheet) -> Vector:
    """Return the place (g, rows) down the picture of hair, from roots to tips."""
    step = np.linalg.norm(np.diff(sheet.line, axis=1), axis=-1)
    reach_m = np.concatenate([np.zeros((len(step), 1)), step.cumsum(axis=1)], axis=1)
    whole_m = reach_m[:, -1:]
    rooted = np.clip(reach_m / sheet.roots_m, 0, 1) if sheet.roots_m else np.ones_like(reach_m)
    tipped = np.zeros_like(reach_m)
    if np.any(sheet.tips_m):
        tips_m = np.broadcast_to(sheet.tips_m, len(step))[:, None]
        tipped = np.clip(1 - (whole_m - reach_m) / tips_m, 0, 1)
    middle = (_ENDS - _BEGUN) * reach_m / whole_m
    places: Vector = (
        _BEGIN + (_BEGUN - _BEGIN) * rooted + middle * (1 - tipped) + (_ENDED - _BEGUN) * tipped
    )
    return SHEETS_DOWN * places


def _softened(piece: Piece, line: Vector, out: Vector) -> Vector:
    """Vary the normals a little from strand to strand, so that sheen breaks up."""
    if piece.normals is None:
        return out
    across = unit(np.gradient(line, axis=0).reshape(-1, 3) + 1e-9)
    lean = 0.22 * noise(line.reshape(-1, 3), [140.0, 14.0, 140.0], 9)
    result: Vector = unit(piece.normals + lean[:, None] * across)
    return result
