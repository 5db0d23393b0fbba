"""How much of the light from all round reaches each place of a clothed person."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from character_making.cutting import neighbours
from character_making.makehuman import Indices
from character_making.pieces import Piece, vertex_normals
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX

_CELL_M = 0.004
_REACH_M = 0.14
"""What is farther away hides nothing: lamps and walls are all round."""
_RAYS = 48
_START_CELLS = 2.5


@compiled
def _filled(grid: Indices, corners: Vector, low: Vector, cell_m: float) -> None:
    for t in range(len(corners)):
        longest = 0.0
        for k in range(3):
            d = 0.0
            for axis in range(3):
                d += (corners[t, k, axis] - corners[t, (k + 1) % 3, axis]) ** 2
            longest = max(longest, d)
        n = int(np.sqrt(longest) / (0.7 * cell_m)) + 1
        for i in range(n + 1):
            for j in range(n + 1 - i):
                a, b = i / n, j / n
                at = [0, 0, 0]
                for axis in range(3):
                    p = (1 - a - b) * corners[t, 0, axis]
                    p += a * corners[t, 1, axis] + b * corners[t, 2, axis]
                    at[axis] = int((p - low[axis]) / cell_m)
                grid[at[0], at[1], at[2]] = 1


@compiled
def _open_share(
    grid: Indices,
    points: Vector,
    normals: Vector,
    rays: Vector,
    low: Vector,
    cell_m: float,
    start: float,
    steps: int,
) -> Vector:
    share = np.ones(len(points))
    for i in range(len(points)):
        seen, total = 0.0, 0.0
        for r in range(len(rays)):
            cosine = 0.0
            for k in range(3):
                cosine += rays[r, k] * normals[i, k]
            if cosine <= 0.05:
                continue
            total += cosine
            hidden = 0.0
            for s in range(steps):
                away = start + s
                x = int((points[i, 0] - low[0]) / cell_m + start * normals[i, 0] + s * rays[r, 0])
                y = int((points[i, 1] - low[1]) / cell_m + start * normals[i, 1] + s * rays[r, 1])
                z = int((points[i, 2] - low[2]) / cell_m + start * normals[i, 2] + s * rays[r, 2])
                if x < 0 or y < 0 or z < 0:
                    break
                if x >= grid.shape[0] or y >= grid.shape[1] or z >= grid.shape[2]:
                    break
                if grid[x, y, z]:
                    hidden = 1.0 - away / (steps + start)
                    break
            seen += cosine * (1.0 - hidden)
        if total > 0:
            share[i] = seen / total
    return share


def open_shares(pieces: Sequence[Piece], hiding: Sequence[Piece]) -> list[Vector]:
    """Return for each piece how open its vertices (v,) are, 0 to 1, when all `hiding` stand about.

    Nearer things hide more: their share falls to nothing `_REACH_M` away.
    """
    corners = np.concatenate([p.vertices_m[p.triangles] for p in hiding])
    low = corners.min(axis=(0, 1)) - 2 * _CELL_M
    high = corners.max(axis=(0, 1)) + 2 * _CELL_M
    grid = np.zeros(np.ceil((high - low) / _CELL_M).astype(np.int64) + 1, dtype=np.uint8)
    _filled(grid, corners, low, _CELL_M)
    # Directions spread evenly over the sphere, along a spiral.
    i = np.arange(_RAYS) + 0.5
    up, turn = 1 - 2 * i / _RAYS, i * np.pi * (1 + np.sqrt(5))
    flat = np.sqrt(1 - up**2)
    rays = np.stack([flat * np.cos(turn), up, flat * np.sin(turn)], axis=1)
    steps = round(_REACH_M / _CELL_M)
    return [
        _open_share(
            grid,
            p.vertices_m,
            vertex_normals(p.vertices_m, p.triangles) if p.normals is None else p.normals,
            rays,
            low,
            _CELL_M,
            _START_CELLS,
            steps,
        )
        for p in pieces
    ]


def shaded(pieces: Sequence[Piece], hair: Sequence[Piece]) -> list[Piece]:
    """Return pieces of somebody with colours darker where other pieces hide them; what has no
    share in it, such as eyes and buttons, as it is. Hair hides skin alone: on cloth it moves.
    """
    under_hair = open_shares(pieces, [*pieces, *hair])
    plain = open_shares(pieces, pieces)
    result = []
    for piece, bare, haired in zip(pieces, plain, under_hair, strict=True):
        is_button = piece.material == "shoe" and (piece.part == PART_INDEX["torso"]).all()
        if piece.material not in _LEAST or is_button:
            result.append(piece)
            continue
        is_skin = piece.material == "skin"
        share = (bare + haired) / 2 if is_skin else bare
        average = neighbours(piece.triangles, len(share))
        for _ in range(_SMOOTH_ROUNDS):
            share = 0.5 * share + 0.5 * (average @ share)
        least = _LEAST[piece.material]
        light = least + (1 - least) * np.clip(share / _OPEN, 0, 1)
        # Light that skin hands on from fold to fold is redder.
        powers = np.array([0.75, 1.0, 1.05]) if is_skin else np.ones(3)
        result.append(replace(piece, colour=piece.colour * light[:, None] ** powers))
    return result


_OPEN = 0.9
"""Share of light that reaches what counts as open: a plain surface is not quite."""
_LEAST = {"skin": 0.5, "top": 0.45, "bottom": 0.45, "under": 0.5, "shoe": 0.6}
_SMOOTH_ROUNDS = 3
