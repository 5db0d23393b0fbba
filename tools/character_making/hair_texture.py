"""The texture of hair: strands with roots and tips."""

import numpy as np
import numpy.typing as npt


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
    begins = (0.09 * rng.uniform(0, 1, strands) ** 1.5)[strand]
    ends = (1.0 - 0.16 * clump - 0.14 * rng.uniform(0, 1, strands))[strand]
    whole = np.minimum((v - begins) / 0.05, (ends - v) / 0.16)
    alpha = np.clip((whole * 1.6 - across) / 0.35 + 0.5, 0, 1)
    tone = np.repeat(grey[..., None], 3, axis=2)
    return np.round(255 * np.concatenate([tone, alpha[..., None]], axis=2)).astype(np.uint8)
