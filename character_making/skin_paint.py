"""Paint a person's skin: complexion, lips, brows, stubble, freckles, age, scalp."""

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from scipy.spatial import cKDTree

from character_making.cutting import neighbours
from character_making.figure import SIDES, Figure
from character_making.hair import Style
from character_making.hairline import hairline_field
from character_making.makehuman import Indices
from character_making.noise import noise
from character_making.pieces import Piece, vertex_normals
from character_making.recipes import Face
from character_making.skin_canvas import SIZE, SkinCanvas
from visavis.lab.geometry import Vector

HEADROOM = 0.82
"""Vertex colours are this much lighter than the skin, so that the texture can lighten too."""


def _mixed(colour: Vector, with_colour: npt.ArrayLike, share: Vector) -> Vector:
    amount = np.clip(share, 0, 1)[:, None]
    result: Vector = colour * (1 - amount) + np.asarray(with_colour) * amount
    return result


def _bump(d: Vector, width: float) -> Vector:
    bell: Vector = np.exp(-((d / width) ** 2))
    return bell


def hollows(body: Piece) -> Vector:
    """Return how hollow the surface is at every vertex: −1 ridge, 1 crease."""
    average = neighbours(body.triangles, len(body.vertices_m))
    normals = vertex_normals(body.vertices_m, body.triangles)
    depth = np.sum((average @ body.vertices_m - body.vertices_m) * normals, axis=1)
    step = np.linalg.norm(average @ body.vertices_m - body.vertices_m, axis=1)
    depth = depth + 0.35 * (average @ depth)
    curved: Vector = average @ np.tanh(depth / (0.0006 + 0.25 * step))
    return curved


def painted(
    figure: Figure,
    canvas: SkinCanvas,
    body: Piece,
    visible: npt.NDArray[np.bool_],
    face: Face,
    style: Style,
    seed: int,
    hair_m: Vector | None = None,
) -> npt.NDArray[np.uint8]:
    """Return the skin's texture (SIZE, SIZE, 3), to be multiplied with the base colour. Below
    hair at points `hair_m` (n, 3), and about its edge, it is darker.
    """
    pixels = canvas.pixels(visible)
    p = canvas.spread(body.vertices_m, pixels)
    k = figure.stature_m / 1.72
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    q = (p - eye) / k
    skin = np.array(face.skin) / 255
    is_dark = float(np.clip((0.62 - skin.mean()) / 0.3, 0, 1))
    colour = np.tile(skin, (len(p), 1))
    coarse, middle, fine = noise(p, 35, seed), noise(p, 160, seed + 1), noise(p, 700, seed + 2)
    colour *= (1 + 0.02 * coarse + 0.02 * middle + 0.022 * fine)[:, None]
    colour[:, 1:] *= (1 - 0.022 * middle - 0.020 * coarse)[:, None]
    # Where skin lies on bone it is yellower; where blood runs near, redder.
    bony = _bump(np.hypot(q[:, 0] * 0.8, q[:, 1] - 0.05), 0.035) * (q[:, 2] < 0.05)
    colour[:, 2] *= 1 - 0.035 * bony
    colour = _flushed(colour, q, face, coarse)
    hollow = canvas.spread(hollows(body), pixels)
    deep = np.clip(hollow, 0, 1) * (0.14 + 0.07 * face.lines) - 0.05 * np.clip(-hollow, 0, 1)
    colour *= 1 - deep[:, None] * np.array([0.75, 1.0, 1.05])
    colour = _aged(colour, q, face)
    colour = _mouth(colour, canvas, pixels, q, face)
    colour = _eye_region(colour, figure, p, q, face, is_dark)
    nails = canvas.mask("mpfb_fingernails", pixels)
    colour = _mixed(colour, skin * [1.06, 0.93, 0.92] + 0.05, 0.65 * nails)
    if face.freckles:
        colour = _freckled(colour, q, face, seed)
    if face.stubble:
        colour = _stubbled(colour, canvas, pixels, q, face, seed)
    colour = _scalp(colour, figure, p, q, face, style, seed)
    if hair_m is not None:
        colour = _below_hair(colour, p, q, hair_m, face, seed)
    colour = _browed(colour, figure, p, face, k, seed)
    image = np.full((SIZE * SIZE, 3), HEADROOM)
    image[pixels] = colour / base_colour(face)
    whole = image[canvas.filled.ravel()].reshape(SIZE, SIZE, 3)
    texture: npt.NDArray[np.uint8] = np.round(255 * np.clip(whole, 0, 1)).astype(np.uint8)
    return texture


def base_colour(face: Face) -> Vector:
    """Return the vertex colour of skin that the texture is painted for."""
    base: Vector = np.minimum(np.array(face.skin) / 255 / HEADROOM, 1.0)
    return base


def _flushed(colour: Vector, q: Vector, face: Face, coarse: Vector) -> Vector:
    x, y, z = np.abs(q[:, 0]), q[:, 1], q[:, 2]
    front = np.clip((0.06 - z) / 0.05, 0, 1)
    cheeks = _bump(np.hypot(x - 0.042, (y + 0.036) * 1.1), 0.026)
    nose = _bump(np.hypot(x, (y + 0.042) * 1.2), 0.016) * np.clip((-0.03 - z) / 0.01, 0, 1)
    chin = 0.5 * _bump(np.hypot(x, y + 0.108), 0.02)
    ears = 1.1 * np.clip((x - 0.070) / 0.008, 0, 1) * _bump(y + 0.012, 0.035)
    ears *= np.clip((z - 0.05) / 0.015, 0, 1) * (z < 0.14)
    hands = 0.5 * np.clip((np.abs(q[:, 0]) - 0.4) / 0.1, 0, 1)
    amount = face.flush * (front * (1.1 * cheeks + nose + chin) + ears + hands)
    amount = amount * (1 + 0.25 * coarse)
    result: Vector = colour * (1 - np.clip(amount, 0, 1)[:, None] * np.array([-0.01, 0.14, 0.13]))
    # The forehead is a little yellower, the jaw of men a little greyer: left to stubble.
    return result


def _aged(colour: Vector, q: Vector, face: Face) -> Vector:
    if not face.lines:
        return colour
    x, y, z = np.abs(q[:, 0]), q[:, 1], q[:, 2]
    front = np.clip((0.03 - z) / 0.03, 0, 1)
    wave = y + 0.0012 * np.sin(q[:, 0] * 70) + 0.0012 * noise(q, 45, 83)
    broken = np.clip(0.75 + 0.6 * noise(q, 55, 84), 0, 1)
    lines = np.zeros(len(q))
    for height in (0.047, 0.056, 0.065):
        lines += 0.6 * broken * _bump(wave - height, 0.0014) * np.clip((0.042 - x) / 0.015, 0, 1)
    for slope in (-0.45, 0.0, 0.42):
        away = y + 0.002 - slope * (x - 0.046)
        lines += 0.7 * _bump(away, 0.0009) * _bump(x - 0.056, 0.008)
    bags = 0.8 * _bump(np.hypot((x - 0.031) * 0.5, y + 0.017), 0.0055)
    amount = face.lines * front * (0.20 * lines + 0.13 * bags)
    result: Vector = colour * (1 - amount[:, None] * np.array([0.9, 1.1, 1.0]))
    return result


def _mouth(colour: Vector, canvas: SkinCanvas, pixels: Indices, q: Vector, face: Face) -> Vector:
    lips = canvas.mask("mpfb_lips", pixels)
    streaks = 1 + 0.06 * noise(q, [900, 120, 200], 71)
    tone = np.array(face.lips) / 255
    colour = _mixed(colour, tone * streaks[:, None], 0.85 * lips)
    inside = canvas.mask("mpfb_inside-mouth", pixels)
    return _mixed(colour, [0.34, 0.13, 0.12], 0.9 * inside)


def _eye_region(
    colour: Vector, figure: Figure, p: Vector, q: Vector, face: Face, is_dark: float
) -> Vector:
    x, y, z = np.abs(q[:, 0]), q[:, 1], q[:, 2]
    front = np.clip((0.02 - z) / 0.02, 0, 1)
    socket = _bump(np.hypot((x - 0.03) * 0.62, y + 0.004), 0.014) * front
    warm = np.array([0.10, 0.15, 0.12]) * (0.8 + 0.5 * is_dark + 0.3 * face.lines)
    colour = colour * (1 - 0.8 * socket[:, None] * warm)
    for side, _ in SIDES:
        away = np.linalg.norm(p - figure.at(f"{side}_eye"), axis=1) - figure.eye_radius_m
        margin = np.clip(1 - (away - 0.0006) / 0.0016, 0, 1)
        colour = _mixed(colour, np.array(face.skin) / 255 * [0.84, 0.68, 0.64], 0.75 * margin)
        upper = np.clip((p[:, 1] - figure.at(f"{side}_eye")[1] - 0.001) / 0.003, 0, 1)
        line = np.clip(1 - np.abs(away - 0.0016) / 0.0014, 0, 1) * upper
        colour = _mixed(colour, np.array(face.brow) / 255 * 0.5, line * (0.35 + 0.5 * face.make_up))
        shadow = _bump(away - 0.004, 0.003) * upper * face.make_up
        colour = colour * (1 - 0.35 * shadow[:, None] * np.array([0.8, 1.0, 0.9]))
    return colour


def _freckled(colour: Vector, q: Vector, face: Face, seed: int) -> Vector:
    dots = np.clip((noise(q, 330, seed + 31) - 0.52) / 0.2, 0, 1)
    dots += 0.7 * np.clip((noise(q, 560, seed + 32) - 0.55) / 0.2, 0, 1)
    x, y = np.abs(q[:, 0]), q[:, 1]
    where = 0.25 + _bump(np.hypot(x * 0.7, y + 0.03), 0.04)
    share = 0.45 * face.freckles * dots * where
    return _mixed(colour, np.array(face.skin) / 255 * [0.80, 0.64, 0.52], share)


def _stubbled(
    colour: Vector, canvas: SkinCanvas, pixels: Indices, q: Vector, face: Face, seed: int
) -> Vector:
    x, y, z = np.abs(q[:, 0]), q[:, 1], q[:, 2]
    ragged = 0.004 * noise(q, 160, seed + 41)
    # Upper lip, chin and jaw up to the ear; cheeks stay free above a sloping line.
    line, over_m = (np.interp(x, _BEARD_AT_M, some) for some in (_BEARD_FROM_M, _BEARD_GROWS_M))
    beard = np.clip((line - y + ragged) / over_m, 0, 1) * np.clip((0.08 - z) / 0.02, 0, 1)
    # Below the jaw it thins out, less far at the sides.
    chin_m = y[(x < 0.01) & (z < 0.0) & (y > -0.15)].min()
    jaw = chin_m + np.interp(x, _JAW_AT_M, _JAW_RISES_M)
    below = np.clip((jaw - y + ragged) / _BEARD_ENDS_M, 0, 1)
    beard *= 1 - below**2 * (3 - 2 * below)
    beard *= 1 - 0.3 * _bump(x, 0.003) * (y > -0.066)
    beard *= 1 - canvas.mask("mpfb_lips", pixels)
    hairs = 0.5 + 0.5 * noise(q, [1500, 600, 1500], seed + 42)
    full = np.clip(face.stubble - 0.6, 0, 1) / 0.4
    share = beard * (0.30 * face.stubble + (0.35 + 0.5 * full) * face.stubble * hairs)
    tone = np.array(face.brow) / 255 * 0.9 + 0.04 * (1 - full)
    return _mixed(colour, tone, share)


_BEARD_AT_M = [0.0, 0.012, 0.02, 0.03, 0.04, 0.055, 0.075]
_BEARD_FROM_M = [-0.0515, -0.052, -0.055, -0.062, -0.064, -0.053, -0.018]
_BEARD_GROWS_M = [0.006, 0.006, 0.008, 0.010, 0.015, 0.018, 0.018]
"""Below which height, at distances from the middle of the face, beards grow, and within how much
they become dense."""
_JAW_AT_M, _JAW_RISES_M = [0.0, 0.02, 0.04, 0.055, 0.065], [0.0, 0.002, 0.013, 0.029, 0.050]
_BEARD_ENDS_M = 0.034
"""How far below the jaw a beard ends."""


def _scalp(
    colour: Vector, figure: Figure, p: Vector, q: Vector, face: Face, style: Style, seed: int
) -> Vector:
    """Darken the skin among roots. Under hair that falls none of it shows, or it were a smudge."""
    outside = hairline_field(figure, p, style.receding) * 1.72 / figure.stature_m
    ragged = outside + 0.002 * noise(p, 160, seed + 7)
    ragged += 0.003 * noise(p, [900, 150, 900], seed + 8)
    edge = _FALLING_BARE_M if style.fall else 0.0
    on_head = (q[:, 1] > -0.13) & (np.abs(q[:, 0]) < 0.12)
    most = 0.25 if style.tie == "none" else 0.40
    share = np.clip(most - (ragged + edge) / 0.016, 0, 1) * on_head
    strands = 0.9 + 0.25 * noise(p, [900, 200, 900], seed + 9)
    return _mixed(colour, np.array(face.hair) / 255 * 0.75, 0.92 * share * strands)


_FALLING_BARE_M = 0.008


def _below_hair(
    colour: Vector, p: Vector, q: Vector, hair_m: Vector, face: Face, seed: int
) -> Vector:
    """Paint the shade that hair casts on the skin round its edge, and its finest hairs."""
    near = np.flatnonzero((q[:, 1] > -0.12) & (np.abs(q[:, 0]) < 0.12))
    away, _ = cKDTree(hair_m).query(p[near], distance_upper_bound=0.05)
    away = np.minimum(away, 0.05)
    share = np.zeros(len(p))
    share[near] = _SHADED * _bump(away, _SHADED_M)
    colour = colour * (1 - share[:, None] * np.array([0.75, 0.95, 1.0]))
    hairs = np.clip(noise(p, [1100, 130, 1100], seed + 61) + 0.15, 0, 1)
    hairs += np.clip(noise(p, [700, 90, 700], seed + 62) - 0.1, 0, 1)
    share[near] = _FINEST * _bump(away, _FINEST_M)
    return _mixed(colour, np.array(face.hair) / 255, share * hairs)


_SHADED, _SHADED_M = 0.40, 0.0085
_FINEST, _FINEST_M = 0.85, 0.0065
"""How dark the shade of hair and its finest hairs are where it ends, and how far they reach."""


def _browed(colour: Vector, figure: Figure, p: Vector, face: Face, k: float, seed: int) -> Vector:
    female = figure.shape.gender == "female"
    nose = (figure.at("left_eye")[0] + figure.at("right_eye")[0]) / 2
    for side, _ in SIDES:
        centre = figure.at(f"{side}_eye")
        sign = -1.0 if side == "left" else 1.0
        start_m = _BROW_FROM_M - sign * (centre[0] - nose) / k
        x = sign * (p[:, 0] - centre[0]) / k
        y = (p[:, 1] - centre[1]) / k - (_BROW_WOMEN_M if female else _BROW_MEN_M)
        near = np.flatnonzero(
            (x > start_m - 0.006)
            & (x < _BROW_TO_M + 0.006)
            & (np.abs(y) < 0.012)
            & (p[:, 2] < centre[2] + 0.03)
        )
        at = np.stack([x, y], axis=1)[near]
        rng = np.random.default_rng(seed)
        amount = _brow(at, start_m, _BROW_TO_M, face.brow_weight, rng)
        colour[near] = _mixed(colour[near], np.array(face.brow) / 255, amount)
    return colour


def _brow(at: Vector, start_m: float, end_m: float, weight: float, rng: Generator) -> Vector:
    """Return how much of brow covers places `at` (n, 2), metres outwards from the eye's middle and
    up from the brow's inner end: single hairs, fewer and finer towards both ends, over their shade.
    """
    share = np.linspace(0, 1, 41)
    line = np.interp(share, _BROW_AT, _BROW_RISES_M)
    line = np.convolve(np.pad(line, 4, mode="edge"), np.full(9, 1 / 9), "valid")
    broad = (0.75 + 0.4 * weight) * np.interp(share, _BROW_AT, _BROW_HALF_M)
    dense = np.interp(share, _BROW_AT, _BROW_DENSE)

    along = (at[:, 0] - start_m) / (end_m - start_m)
    off = (at[:, 1] - np.interp(along, share, line)) / np.interp(along, share, broad)
    within = np.interp(along, [-0.08, 0, 1, 1.05], [0, 1, 1, 0])
    shade = _BROW_SHADE * np.interp(along, share, dense) * within * _bump(off, 0.85)

    n = round(_HAIRS * (0.7 + 0.5 * weight))
    root = rng.choice(share, n, p=dense / dense.sum()) + rng.uniform(-0.5, 0.5, n) / 40
    across = rng.uniform(-1, 1, n)
    # Hairs lean outwards: upright near the nose, along the line farther out, and from above and
    # below the line towards it.
    lean = np.interp(root, [0, 0.15, 0.45, 1], [1.25, 0.85, 0.35, -0.25])
    lean = lean - 0.45 * across * np.interp(root, [0.1, 0.5], [0.2, 1]) + rng.normal(0, 0.12, n)
    long_m = np.interp(root, [0, 0.3, 0.8, 1], [0.0042, 0.0068, 0.0062, 0.0040])
    long_m = long_m * rng.uniform(0.7, 1.15, n)
    height = np.interp(root, share, line) + 0.9 * across * np.interp(root, share, broad)
    roots = np.stack([start_m + root * (end_m - start_m), height], axis=1)
    way = np.stack([np.cos(lean), np.sin(lean)], axis=1)
    # Half of a hair lies on each side of the place it is drawn for.
    roots = roots - 0.5 * long_m[:, None] * way
    bare = 1 - shade
    for k in range(n):
        from_root = at - roots[k]
        s = np.clip(from_root @ way[k] / long_m[k], 0, 1)
        away = np.linalg.norm(from_root - (s * long_m[k])[:, None] * way[k], axis=1)
        bare *= 1 - _HAIR_DARK * (1 - 0.7 * s) * _bump(away, _HAIR_M)
    amount: Vector = np.clip(1 - bare, 0, 1) * (0.62 + 0.3 * weight)
    return amount


_BROW_FROM_M, _BROW_TO_M = 0.0135, 0.0255
"""Brows begin so far from the middle of the face and end so far outwards from the eye's."""
_BROW_MEN_M, _BROW_WOMEN_M = 0.0172, 0.0190
"""How high above the eye's middle they begin."""
_BROW_AT = [0.0, 0.12, 0.3, 0.62, 0.82, 1.0]
_BROW_RISES_M = [0.0, 0.0004, 0.0013, 0.0026, 0.0022, 0.0002]
_BROW_HALF_M = [0.0018, 0.0024, 0.0027, 0.0021, 0.0013, 0.0005]
_BROW_DENSE = [0.12, 0.5, 0.95, 1.0, 0.75, 0.2]
"""A brow's line at rest, its half breadth and how dense it is, at shares of its length."""
_HAIRS, _HAIR_M, _HAIR_DARK, _BROW_SHADE = 210, 0.0003, 0.5, 0.42
