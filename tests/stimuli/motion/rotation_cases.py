"""Random rotations for the motion tests."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from visavis.lab.geometry import quat_multiply
from visavis.stimuli.motion.rotations import quat_exp

Array = Any

seeds = st.integers(0, 2**32 - 1)


def random_quats(rng: np.random.Generator, *shape: int) -> Array:
    q = rng.normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def steps_of(rng: np.random.Generator, n: int, largest_deg: float, *joints: int) -> Array:
    """Return n keys each up to `largest_deg` from the one before, signs at random."""
    keys = [random_quats(rng, *joints)]
    for _ in range(n - 1):
        axis = rng.normal(size=(*joints, 3))
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        half = np.radians(rng.uniform(0.1, 1.0, (*joints, 1)) * largest_deg) / 2
        keys.append(quat_multiply(keys[-1], quat_exp(axis * half)))
    signs = rng.choice([-1.0, 1.0], (n, *joints, 1))
    return np.stack(keys) * signs


def apart_deg(a: Array, b: Array) -> Array:
    """Return the angle of the rotation from a to b, signs ignored."""
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return np.degrees(4 * np.arcsin(np.clip(chord / 2, 0, 1)))


def same(expected: Array, got: Array, tol: float = 1e-12) -> bool:
    """Tell whether rotations agree up to sign."""
    chord = np.minimum(np.abs(expected - got).max(-1), np.abs(expected + got).max(-1))
    return bool((chord <= tol).all())


def spin(axis: Sequence[float], angles_deg: Array) -> Array:
    """Return rotations (n, 4) about one axis."""
    n = np.asarray(axis, dtype=np.float64)
    n = n / np.linalg.norm(n)
    return quat_exp(np.radians(np.asarray(angles_deg))[..., None] / 2 * n)
