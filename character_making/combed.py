"""Hair combed close over the head, from a whorl to its tips or from the hairline to a tie: sheets
one upon the other that end unevenly.
"""

from dataclasses import dataclass, replace

import numpy as np

from character_making.figure import Figure
from character_making.hairline import hairline_field
from character_making.mantle import Head, Sheet, outwards, upon
from character_making.noise import noise
from character_making.pieces import Piece
from visavis.lab.geometry import Vector, unit

_GUIDES = 67
_LAYERS = ((0.45, -0.007), (0.8, -0.003), (1.0, 0.002))
"""For each sheet the share of the lift, and by how much longer than the others it is, in metres."""
_WHORL_RAD = 0.42
"""How far behind the top of the head hair turns round."""
_STEP_RAD = 0.012


@dataclass(frozen=True)
class Combing:
    """How hair lies over the head: lifted `lift_m` off it on top, by the share `side` of that at
    the temples; it reaches `beyond_m` over the hairline, in front `fringe_m` farther; `sweep_rad`
    is how far it is brushed aside in front, `rough_m` the depth of its locks, `ragged_m` by how
    much its ends in front differ. Of tied hair `ragged_m` is where its roots begin. `loose` locks
    lie upon it, `at_edge` more over its edge.
    """

    lift_m: float
    side: float
    beyond_m: float = 0.004
    fringe_m: float = 0.0
    sweep_rad: float = 0.0
    rough_m: float = 0.0020
    ragged_m: float = 0.010
    loose: int = 40
    at_edge: int = 90
    rows: int = 11


def combed(
    figure: Figure,
    body: Piece,
    colour: Vector,
    combing: Combing,
    receding: float,
    tie_m: Vector | None,
    seed: int,
    grey: float = 0.0,
) -> tuple[list[Sheet], Vector, Vector]:
    """Return the sheets, innermost first, and lines (n, rows, 3) with outward directions of loose
    locks upon them. Without a tie at `tie_m` hair turns round a whorl and falls from there.
    """
    head = Head(figure, body, [], ears=False)
    rng = np.random.default_rng(seed + 3000)
    turning = np.array([0.0, np.cos(_WHORL_RAD), np.sin(_WHORL_RAD)])
    pole = turning if tie_m is None else unit(tie_m - head.centre)
    # In front of the pole, azimuth is 0; it grows towards +x.
    ahead = unit(np.array([0.0, 0.0, -1.0]) + pole[2] * pole)
    aside = np.cross(ahead, pole)
    aside *= np.sign(aside[0])
    azimuth = np.linspace(-np.pi, np.pi, _GUIDES)
    in_front = np.clip((np.cos(azimuth) - 0.45) / 0.35, 0, 1)

    def towards(polar: Vector, turned: Vector) -> Vector:
        flat = np.cos(turned)[..., None] * ahead + np.sin(turned)[..., None] * aside
        directions: Vector = np.cos(polar)[..., None] * pole + np.sin(polar)[..., None] * flat
        return directions

    def swept(polar: Vector, around: Vector, front: Vector) -> Vector:
        whirl = 0.9 * np.exp(-polar / 0.25) if tie_m is None else 0.0
        return around + whirl + combing.sweep_rad * front * np.clip(polar / 0.9, 0, 1) ** 2

    steps = np.arange(1, 240) * _STEP_RAD
    grid = np.broadcast_to(steps, (_GUIDES, len(steps)))
    turned = swept(grid, azimuth[:, None], in_front[:, None])
    on_skin = head.on_scalp(towards(grid, turned).reshape(-1, 3), 0.0)
    outside = hairline_field(figure, on_skin, receding).reshape(grid.shape)
    ends = (outside > 0).argmax(axis=1)
    if not (outside.max(axis=1) > 0).all():
        raise ValueError(f"{figure.shape}: hair reaches no hairline within {steps[-1]:.1f} rad")
    radius = np.linalg.norm(on_skin.reshape(*grid.shape, 3) - head.centre, axis=-1)
    end = steps[ends]
    around_m = radius[np.arange(_GUIDES), ends]
    end = _beside(end)

    sheets = []
    even = 1 - (1 - np.linspace(0, 1, combing.rows)) ** 1.8
    for lifted, longer_m in _LAYERS:
        knots = rng.uniform(-1, 1, _GUIDES)
        knots[-1] = knots[0]
        locks = _beside(_beside(knots)) * 1.6
        # Brushed aside, a fringe is longer where it is brushed to.
        slant = 1 + 0.4 * np.sign(combing.sweep_rad) * np.sin(azimuth)
        beyond = combing.beyond_m + longer_m + combing.fringe_m * in_front * slant
        beyond = beyond + 0.18 * combing.ragged_m * locks * (tie_m is None)
        first = 0.0 if tie_m is None else 0.10
        polar = first + even[None, :] * (end + beyond / around_m - first)[:, None]
        front = np.broadcast_to(in_front[:, None], polar.shape)
        direction = towards(polar, swept(polar, azimuth[:, None], front))
        skin = head.on_scalp(direction.reshape(-1, 3), 0.0).reshape(direction.shape)
        to_edge_m = (end[:, None] - polar) * around_m[:, None]
        on_top = np.interp(direction[..., 1], [0.05, 0.65], [combing.side, 1.0])
        least = 0.45 * min(combing.fringe_m / 0.02, 1.0) * front
        rise = np.maximum(np.clip(to_edge_m / 0.030, 0, 1) ** 0.7, least)
        if tie_m is not None:
            rise = rise * np.interp(polar, [0.10, 0.5], [0.55, 1.0])
        high = lifted * combing.lift_m * on_top * rise + 0.0012 * (1 + lifted)
        lock = noise(direction.reshape(-1, 3), 7.0, seed + 11).reshape(high.shape)
        strand = np.interp(np.arange(_GUIDES), np.arange(0, _GUIDES, 2), knots[::2])
        high = high + combing.rough_m * np.sqrt(rise) * (lock + 0.6 * strand[:, None])
        line = skin + high[..., None] * direction
        clear = head.outside(line.reshape(-1, 3), np.full(high.size, 0.0010))
        # Ears would push it aside.
        push = np.clip(np.sum((clear.reshape(line.shape) - line) * direction, axis=-1), 0, 0.002)
        line = line + push[..., None] * direction
        out = outwards(head, line)
        out[:, 0] = pole
        if tie_m is not None:
            line, out = line[:, ::-1], out[:, ::-1]
        tone = 1 + 0.05 * knots + 0.06 * (lifted - 0.8)
        tones = np.tile(colour, (_GUIDES, 1))
        greyed = 0.25 * grey * (1 + rng.uniform(-1, 1, (_GUIDES, 1)))
        tones = (1 - greyed) * tones + greyed * np.array([0.80, 0.79, 0.78])
        tones = tones * tone[:, None]
        tones[-1] = tones[0]
        sheet = Sheet(line, out, tones, strands=15 / (_GUIDES - 1))
        if tie_m is None:
            # Beside and behind it is cut shorter and shorter.
            faded_m = combing.ragged_m + (_FADED_M - combing.ragged_m) * (1 - in_front)
            sheets.append(replace(sheet, tips_m=faded_m))
        else:
            sheets.append(replace(sheet, roots_m=combing.ragged_m))
    # Each lock shows a part of the way only: some break up the outline, some the edge.
    n, n_edge = combing.loose, combing.at_edge
    begins = np.concatenate([rng.uniform(0.05, 0.55, n), rng.uniform(0.50, 0.72, n_edge)])
    stops = np.concatenate([rng.uniform(0.80, 0.98, n), rng.uniform(0.90, 1.0, n_edge)])
    most_m = 0.0022
    stand_m = np.concatenate([rng.uniform(0.0012, most_m, n), rng.uniform(0.0008, 0.0016, n_edge)])
    sizes = n + n_edge
    along = np.linspace(0, 1, 7)
    guide = rng.uniform(0, _GUIDES - 1, sizes)[:, None] + rng.normal(0, 0.5, (sizes, 1)) * along**2
    line, out = upon(
        sheets[-1], guide % (_GUIDES - 1), begins[:, None] + along * (stops - begins)[:, None]
    )
    # Tied at one end and rooted at the other, it stands off in between alone.
    off = 0.8 + 0.4 * along if tie_m is None else 0.4 + 0.6 * np.sin(np.pi * along)
    return sheets, line + (stand_m[:, None] * off)[..., None] * out, out


_FADED_M = 0.034
"""Within how much hair thins out beside and behind, where it is not tied."""


def _beside(values: Vector) -> Vector:
    """Return values round a closed ring (g,), whose last is its first, smoothed."""
    closed = np.concatenate([values[-2:-1], values, values[1:2]])
    smooth: Vector = 0.25 * closed[:-2] + 0.5 * closed[1:-1] + 0.25 * closed[2:]
    return smooth
