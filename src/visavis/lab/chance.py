"""Random numbers from a seed. Each purpose has its own generator, independent of all others."""

from collections.abc import Sequence

import numpy as np


def generator(seed: int | Sequence[int], *purpose: int) -> np.random.Generator:
    """Return the generator for a purpose (one or more numbers) under a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=purpose))
