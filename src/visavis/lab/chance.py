"""Chance from a seed: every purpose has a generator of its own, whatever was drawn before."""

from collections.abc import Sequence

import numpy as np


def generator(seed: int | Sequence[int], *purpose: int) -> np.random.Generator:
    """Return the generator of a purpose, one or more numbers, under a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=purpose))
