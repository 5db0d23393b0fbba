"""Surfaces of a room as small tiling textures computed from a seed: wood, tiles, plaster, cloth."""

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Material, MaterialKind
from visavis.stimuli.text_font import font_for

SIZE: Final = 256
"""Pixels along a tiling texture."""

Texture = npt.NDArray[np.uint8]


def _noise(rng: np.random.Generator, cells_y: int, cells_x: int, size: int = SIZE) -> Vector:
    """Return smooth tiling noise (size, size) of about zero mean and unit range."""
    grid = rng.uniform(-1, 1, (cells_y, cells_x))
    y, x = np.arange(size) * cells_y / size, np.arange(size) * cells_x / size
    y0, x0 = y.astype(int), x.astype(int)
    fy, fx = y - y0, x - x0
    fy, fx = fy * fy * (3 - 2 * fy), fx * fx * (3 - 2 * fx)
    rows = (
        grid[y0 % cells_y] * (1 - fy)[:, None] + grid[(y0 + 1) % cells_y] * fy[:, None]
    )  # (size, cells_x)
    across: Vector = rows[:, x0 % cells_x] * (1 - fx) + rows[:, (x0 + 1) % cells_x] * fx
    return across


def _grain(rng: np.random.Generator, size: int = SIZE) -> Vector:
    return sum(
        (_noise(rng, 2**k, 2**k, size) / 1.6 ** (k - 2) for k in range(2, 8)),
        start=np.zeros((size, size)),
    )


def _texture(brightness: Vector, tint: Vector | None = None) -> Texture:
    """Return (h, w, 3) bytes from a factor (h, w) around 1 and a tint (h, w, 3) around 1."""
    colour = brightness[..., None] * np.ones(3) if tint is None else brightness[..., None] * tint
    return np.asarray(np.clip(255 * colour, 0, 255), dtype=np.uint8)


@lru_cache(maxsize=8)
def planks(seed: int, boards: int = 5) -> Texture:
    """Return boards along the texture's height, each with its own tone, grain and ends."""
    rng = np.random.default_rng(seed)
    brightness = np.ones((SIZE, SIZE))
    tint = np.ones((SIZE, SIZE, 3))
    edges = np.linspace(0, SIZE, boards + 1).astype(int)
    fine, broad = _noise(rng, 4, 128), _noise(rng, 3, 24)
    for left, right in itertools.pairwise(edges):
        tone = rng.uniform(0.82, 0.98)
        shift = int(rng.integers(SIZE))
        board = slice(left, right)
        brightness[:, board] = tone + 0.05 * np.roll(fine, shift, 0)[:, board]
        brightness[:, board] += 0.05 * np.roll(broad, shift, 1)[:, board]
        tint[:, board, 2] *= rng.uniform(0.93, 1.0)
        brightness[:, left] *= 0.45
        end = int(rng.integers(SIZE))
        brightness[end, board] *= 0.5
    return _texture(brightness, tint)


@lru_cache(maxsize=8)
def tiles(seed: int, across: int = 4, *, joint: float = 0.7, mottling: float = 0.05) -> Texture:
    """Return square tiles with darker joints; `joint` is the brightness of the joints."""
    rng = np.random.default_rng(seed)
    brightness = 0.93 + mottling * _grain(rng) * 0.6
    edges = np.linspace(0, SIZE, across + 1).astype(int)
    for top, bottom in itertools.pairwise(edges):
        for left, right in itertools.pairwise(edges):
            brightness[top:bottom, left:right] *= rng.uniform(1 - mottling, 1.0)
    brightness[edges[:-1]] *= joint
    brightness[:, edges[:-1]] *= joint
    brightness[edges[:-1] + 1] *= (1 + joint) / 2
    brightness[:, edges[:-1] + 1] *= (1 + joint) / 2
    return _texture(brightness)


@lru_cache(maxsize=8)
def marble(seed: int) -> Texture:
    """Return slabs with soft veins."""
    rng = np.random.default_rng(seed)
    flow = _grain(rng)
    veins = np.exp(-((np.abs(flow) / 0.07) ** 1.2))
    brightness = 0.93 + 0.05 * _grain(rng) - 0.13 * veins
    return _texture(brightness)


@lru_cache(maxsize=8)
def plaster(seed: int) -> Texture:
    """Return a painted wall: nearly even, slightly mottled."""
    rng = np.random.default_rng(seed)
    return _texture(0.95 + 0.007 * _grain(rng))


@lru_cache(maxsize=8)
def carpet(seed: int) -> Texture:
    """Return short loops of yarn."""
    rng = np.random.default_rng(seed)
    brightness = 0.86 + 0.09 * rng.standard_normal((SIZE, SIZE)).clip(-2, 2) / 2
    return _texture(brightness + 0.03 * _noise(rng, 6, 6))


@lru_cache(maxsize=8)
def weave(seed: int) -> Texture:
    """Return cloth woven of two yarns."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    over = ((x // 4 + y // 4) % 2).astype(float)
    brightness = 0.86 + 0.07 * over + 0.03 * rng.standard_normal((SIZE, SIZE)).clip(-2, 2)
    return _texture(brightness)


@lru_cache(maxsize=2)
def slats(count: int) -> Texture:
    """Return a closed blind of `count` slats, each lighter above, darker where the next begins."""
    down = (np.arange(SIZE) + 0.5) * count / SIZE % 1.0
    brightness = 0.97 - 0.13 * down - 0.28 * np.exp(-(((down - 0.97) / 0.05) ** 2))
    return _texture(np.tile(brightness[:, None], (1, SIZE)))


@lru_cache(maxsize=2)
def outside(seed: int) -> Texture:
    """Return what is far off behind panes: a sky that pales towards hazy trees, out of focus."""
    rng = np.random.default_rng(seed)
    y = np.linspace(0.0, 1.0, SIZE)[:, None]
    x = np.arange(SIZE)
    crowns = 0.66 + 0.035 * _noise(rng, 1, 8)[0] + 0.015 * _noise(rng, 1, 24)[0]
    far = 1.0 / (1.0 + np.exp(-(y - crowns[x] + 0.07) / 0.03))
    near = 1.0 / (1.0 + np.exp(-(y - np.roll(crowns, 90)[x] - 0.05) / 0.03))
    sky = np.array([0.80, 0.89, 1.0]) + y[..., None] * np.array([0.24, 0.13, 0.0])
    tint = sky * (1 - far[..., None]) + far[..., None] * np.array([0.76, 0.83, 0.80])
    tint = tint * (1 - near[..., None]) + near[..., None] * np.array([0.62, 0.72, 0.61])
    return _texture(np.full((SIZE, SIZE), 0.98), tint)


def surface(
    name: str,
    texture: Texture | None = None,
    *,
    roughness_01: float = 0.8,
    kind: MaterialKind = "other",
    double_sided: bool = False,
) -> Material:
    """Return a material of a room."""
    return Material(name, kind, roughness_01, texture, double_sided)


def lettering(
    lines: Sequence[tuple[str, int, tuple[int, int, int]]],
    size_px: tuple[int, int],
    background_srgb: tuple[int, int, int],
    *,
    margin_px: int = 24,
) -> Texture:
    """Draw lines of text (text, height in pixels, colour) from the top left of a board."""
    image = Image.new("RGB", size_px, background_srgb)
    draw = ImageDraw.Draw(image)
    y = margin_px
    for text, height, colour in lines:
        draw.text((margin_px, y), text, fill=colour, font=font_for(text, height))
        y += round(1.35 * height)
    return np.asarray(image, dtype=np.uint8)
