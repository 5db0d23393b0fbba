"""Small textures of cloth that repeat every `cloth_places.TILE_M`."""

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

_SIZE = 256


def fabric(
    pattern: str, colour: Vector, second: Vector, rng: np.random.Generator
) -> tuple[Vector, npt.NDArray[np.uint8]]:
    """Return the vertices' colour (3,) and the texture (h, w, 3) that multiplies it."""
    tone = np.maximum(colour, second) if pattern in ("stripe", "check") else colour
    share = _share_of_second(pattern)
    tint = (1 - share) * (colour / tone) + share * (second / tone)
    image = np.clip(_weave(pattern, rng)[..., None] * tint, 0, 1)
    return tone, np.round(255 * image).astype(np.uint8)


def _weave(pattern: str, rng: np.random.Generator) -> Vector:
    """Return how light the threads are (h, w)."""
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] / _SIZE
    grain = rng.normal(0, 1, (_SIZE, _SIZE))
    grain = (grain + np.roll(grain, 1, 0) + np.roll(grain, 1, 1)) / 1.7
    light: Vector = 0.93 + 0.03 * grain
    if pattern == "knit":
        column = x * 16 % 1
        stitch = np.cos(2 * np.pi * (y * 20 + np.abs(column - 0.5) * 1.2))
        gap = np.exp(-((column / 0.10) ** 2)) + np.exp(-(((column - 1) / 0.10) ** 2))
        light = 0.84 + 0.11 * stitch - 0.16 * gap + 0.03 * grain
    elif pattern == "denim":
        slub = rng.normal(0, 1, (1, _SIZE))
        light = 0.86 + 0.08 * np.sin(2 * np.pi * (x + y) * 40) + 0.035 * slub + 0.05 * grain
    elif pattern == "twill":
        light = 0.92 + 0.04 * np.sin(2 * np.pi * (x + y) * 48) + 0.025 * grain
    elif pattern == "rib":
        light = 0.84 + 0.12 * np.cos(2 * np.pi * x * 14) + 0.02 * grain
    return light


def _share_of_second(pattern: str) -> Vector:
    """Return how much of the second colour shows (h, w, 1)."""
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] / _SIZE
    share = np.zeros_like(x)
    if pattern == "stripe":
        share = ((x * 6) % 1 < 0.28).astype(float)
    elif pattern == "check":
        column, row = (x * 2) % 1, (y * 2) % 1
        fine = ((column > 0.72) & (column < 0.77)) | ((row > 0.72) & (row < 0.77))
        share = 0.32 * (column < 0.5) + 0.32 * (row < 0.5) + 0.3 * fine
    result: Vector = share[..., None]
    return result
