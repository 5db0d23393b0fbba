"""The picture of hair: above what sheets and scalps bear, below bunches of hairs for cards.

Every hair is drawn by itself, with a tone of its own, and thins out to both ends, so that edges
are soft and hairlines and ends are not cut with a knife.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.geometry import Vector

Pixels = npt.NDArray[np.uint8]

SHEETS_DOWN = 0.5
"""Down to where the picture shows what sheets bear; below are bunches, side by side."""
BUNCHES = 4
HALF_BEGUN, HALF_ENDED = 0.08, 0.80
"""Where down the upper part half of the hairs have begun, and half have ended."""
_SIDE_PX, _FINER = 256, 4
_HAIRS, _TUFTS = 210, 19
_WHOLE = (0.15, 0.60)
"""Between where down the upper part sheets hide what is below."""
_ALONG = np.linspace(0, 1, 25)


@dataclass(frozen=True, eq=False)
class _Hairs:
    """Lines (n, 25) across and down, in shares of a part, with tones (n,); as wide as `wide` (n,)
    pixels, and where they thin out to their ends less by the share `taper` (n, 25).
    """

    across: Vector
    down: Vector
    wide_px: Vector
    taper: Vector
    tone: Vector


def streaks(rng: np.random.Generator) -> Pixels:
    """Return the picture (h, w, 4) of hair that lies side by side, roots above, tips below."""
    n = _HAIRS
    tuft = np.sort(rng.uniform(0, 1, _TUFTS))
    root = (np.arange(n) + rng.uniform(-0.6, 0.6, n)) / n
    gap = (tuft[None, :] - root[:, None] + 0.5) % 1.0 - 0.5
    mine = np.abs(gap).argmin(axis=1)
    to_tuft = gap[np.arange(n), mine]
    # Tips of a tuft end near one another; even so ends spread over all of the lower third.
    ends = 0.66 + 0.31 * np.clip(
        0.5 * rng.uniform(0, 1, _TUFTS)[mine] + 0.5 * _spread(rng, n), 0, 1
    )
    begins = 0.13 * _spread(rng, n) ** 1.2
    down = begins[:, None] + (ends - begins)[:, None] * _ALONG
    late = np.clip((down - 0.5) / 0.48, 0, 1) ** 1.9
    early = np.clip(1 - down / 0.2, 0, 1)
    lean = rng.normal(0, 0.014, (n, 1)) * late + rng.normal(0, 0.006, (n, 1)) * early
    wave = 0.004 * np.sin(2 * np.pi * (down + rng.uniform(0, 1, (n, 1))))
    across = root[:, None] + 0.6 * to_tuft[:, None] * late + lean + wave
    thin = np.minimum((down - begins[:, None]) / 0.09, (ends[:, None] - down) / 0.24)
    tone = 0.83 + 0.05 * rng.uniform(-1, 1, _TUFTS)[mine] + rng.normal(0, 0.085, n)
    hairs = _Hairs(across, down, rng.uniform(2.0, 3.4, n), np.clip(thin, 0, 1), tone)
    upper = _draw(hairs, rng, _WHOLE)
    return _join(upper, [_bunch(rng) for _ in range(BUNCHES)])


def coils(rng: np.random.Generator) -> Pixels:
    """Return the picture (h, w, 4) of tightly curled hair: above coils in all directions, one upon
    the other, the first of them along the upper edge; below bunches of curls that grow downwards.
    """
    n = _SIDE_PX
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
    upper = np.concatenate([np.repeat(grey[..., :1], 3, axis=2), grey[..., 1:]], axis=2)
    return _join(upper, [_curls(rng) for _ in range(BUNCHES)])


def _bunch(rng: np.random.Generator) -> _Hairs:
    """Return hairs that lie beside one another, come together to a point, and a few astray."""
    n = 26
    root = rng.uniform(0.16, 0.84, n)
    aim = 0.5 + rng.uniform(-0.12, 0.12)
    begins = 0.42 * rng.uniform(0, 1, n) ** 1.5
    ends = rng.uniform(0.68, 0.99, n)
    down = begins[:, None] + (ends - begins)[:, None] * _ALONG
    astray = rng.random(n) < 0.18
    towards = np.where(astray, rng.uniform(0.06, 0.94, n), 0.35 * root + 0.65 * aim)
    late = down**1.7
    bend = rng.normal(0, 0.05, (n, 1)) * np.sin(np.pi * down)
    across = (1 - late) * root[:, None] + late * towards[:, None] + bend
    thin = np.minimum((down - begins[:, None]) / 0.3, (ends[:, None] - down) / 0.42)
    wide_px = np.where(astray, 1.2, rng.uniform(3.2, 6.0, n))
    tone = 0.85 + rng.normal(0, 0.10, n)
    return _Hairs(across, down, wide_px, np.clip(thin, 0, 1), tone)


def _curls(rng: np.random.Generator) -> _Hairs:
    """Return curls that grow side by side and wind about their way."""
    n = 30
    root = rng.uniform(0.2, 0.8, n)
    begins = 0.20 * rng.uniform(0, 1, n)
    ends = rng.uniform(0.55, 0.97, n)
    down = begins[:, None] + (ends - begins)[:, None] * _ALONG
    turn = 2 * np.pi * (rng.uniform(2.2, 5.0, (n, 1)) * down + rng.uniform(0, 1, (n, 1)))
    spread = (root[:, None] - 0.5) * (1 + 0.25 * down) + rng.normal(0, 0.10, (n, 1)) * down
    across = 0.5 + spread + rng.uniform(0.03, 0.09, (n, 1)) * np.sin(turn)
    wound = down + rng.uniform(0.008, 0.022, (n, 1)) * np.cos(turn)
    thin = np.minimum((down - begins[:, None]) / 0.05, (ends[:, None] - down) / 0.25)
    # The near side of a turn lies in the light.
    tone = rng.uniform(0.36, 0.80, n)
    return _Hairs(across, wound, rng.uniform(2.4, 3.8, n), np.clip(thin, 0, 1), tone)


def _join(upper: Pixels, bunches: list[_Hairs]) -> Pixels:
    cells = [_draw(hairs, None, None, _SIDE_PX // BUNCHES) for hairs in bunches]
    return np.concatenate([upper, np.concatenate(cells, axis=1)], axis=0)


def _draw(
    hairs: _Hairs,
    rng: np.random.Generator | None,
    whole: tuple[float, float] | None,
    wide_px: int = _SIDE_PX,
) -> Pixels:
    """Return hairs drawn (256, w, 4), one upon the other; `whole` is between where nothing shows
    through. Those of a part that repeats go on at its other side.
    """
    wide, high = wide_px * _FINER, _SIDE_PX * _FINER
    middle = float(np.mean(hairs.tone))
    tones = Image.new("L", (wide, high), round(255 * middle))
    covers = Image.new("L", (wide, high), 0)
    paint, cover = ImageDraw.Draw(tones), ImageDraw.Draw(covers)
    if whole is not None:
        cover.rectangle((0, whole[0] * high, wide, whole[1] * high), fill=255)
    order = np.arange(len(hairs.tone)) if rng is None else rng.permutation(len(hairs.tone))
    for i in order.tolist():
        half = 0.5 * _FINER * np.maximum(hairs.wide_px[i] * hairs.taper[i], 0.15)
        x, y = hairs.across[i] * wide, hairs.down[i] * high
        outline = np.concatenate(
            [np.stack([x - half, y], axis=1), np.stack([x + half, y], axis=1)[::-1]]
        )
        code = round(255 * float(np.clip(hairs.tone[i], 0.2, 1)))
        for aside in (-wide, 0, wide) if whole is not None else (0,):
            points = [(px + aside, py) for px, py in outline.tolist()]
            paint.polygon(points, fill=code)
            cover.polygon(points, fill=255)
    tone, alpha = (np.asarray(image.reduce(_FINER)) for image in (tones, covers))
    return np.stack([tone, tone, tone, alpha], axis=2)


def _spread(rng: np.random.Generator, n: int) -> Vector:
    """Return shares (n,) from 0 to 1, each as often as any other, no neighbours alike."""
    bits = int(np.ceil(np.log2(n)))
    # Halves of the range in turn, then quarters, and so on.
    order = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(1 << bits)]
    shares: Vector = np.argsort(np.argsort(order[:n])) / (n - 1)
    return np.clip(shares + rng.uniform(-0.06, 0.06, n), 0, 1)
