"""The texture of hair: strands with roots and tips."""

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.geometry import Vector


def streaks(rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the texture of hair (h, w, 4): strands side by side, roots above, tips below.

    Strands begin and end unevenly, so that hairlines and ends are not cut with a knife.
    """
    n, strands = 256, 48
    columns = np.zeros(n)
    for waves, share in ((5, 0.2), (17, 0.3), (47, 0.4), (101, 0.3)):
        knots = rng.uniform(-1, 1, waves)
        columns += share * np.interp(np.arange(n), np.linspace(0, n, waves + 1), [*knots, knots[0]])
    drift = (4 * np.sin(np.linspace(0, 2 * np.pi, n, endpoint=False))).astype(np.int64)
    rows = np.stack([np.roll(columns, d) for d in drift])
    grey = np.clip(0.84 + 0.22 * rows, 0, 1)
    v, u = np.mgrid[0:n, 0:n] / n
    strand = np.floor(u * strands).astype(np.int64)
    across = np.abs(u * strands - strand - 0.5) * 2
    clump = np.repeat(rng.uniform(0, 1, strands // 4), 4)
    begins = (0.12 * _spread_evenly(rng, strands))[strand]
    # Strands that end together are teeth; ends spread evenly thin out, whatever a pixel spans.
    ends = (1.0 - 0.04 * clump - 0.26 * _spread_evenly(rng, strands))[strand]
    whole = np.minimum((v - begins) / 0.04, (ends - v) / 0.10)
    alpha = np.clip((whole * 1.6 - across) / 0.35 + 0.5, 0, 1)
    tone = np.repeat(grey[..., None], 3, axis=2)
    return np.round(255 * np.concatenate([tone, alpha[..., None]], axis=2)).astype(np.uint8)


HALF_BEGUN, HALF_ENDED = 0.08, 0.80
"""Where down the picture of strands half of them have begun, and half have ended."""


def _spread_evenly(rng: np.random.Generator, n: int) -> Vector:
    """Return shares (n,) from 0 to 1, each as often as any other, no neighbours alike."""
    bits = int(np.ceil(np.log2(n)))
    # Halves of the range in turn, then quarters, and so on.
    order = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(1 << bits)]
    shares: Vector = np.argsort(np.argsort(order[:n])) / (n - 1)
    return np.clip(shares + rng.uniform(-0.06, 0.06, n), 0, 1)


def coils(rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the texture of tightly curled hair (h, w, 4): coils in all directions, one upon the
    other, the first of them along the upper edge.
    """
    n = 256
    picture = Image.new("LA", (n, n), (60, 0))
    draw = ImageDraw.Draw(picture)
    count = 2600
    # Below the uneven edge all is hair.
    below = (12 + 6 * rng.uniform(-1, 1, n // 4)).astype(np.int64)
    for k, top in enumerate(below.tolist()):
        draw.rectangle((4 * k, top, 4 * k + 3, n), fill=(95, 255))
    x, y = rng.uniform(0, n, count), rng.uniform(6, n, count)
    wide, high = rng.uniform(4, 8, count), rng.uniform(2.0, 3.6, count)
    start, tone = rng.uniform(0, 360, count), rng.uniform(90, 235, count)
    for i in range(count):
        for across in (-n, 0, n):
            box = (x[i] + across - wide[i], y[i] - high[i], x[i] + across + wide[i], y[i] + high[i])
            draw.arc(box, start[i], start[i] + 230, fill=(int(tone[i]), 255), width=2)
    grey = np.asarray(picture)
    return np.concatenate([np.repeat(grey[..., :1], 3, axis=2), grey[..., 1:]], axis=2)
