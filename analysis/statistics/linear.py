"""Sum-to-zero coding and general linear hypotheses, on plain arrays."""

from collections.abc import Sequence
from itertools import combinations
from typing import Protocol

import numpy as np

from visavis.analysis.statistics.design import Codes
from visavis.analysis.statistics.results import Array


class FittedModel(Protocol):
    """A fitted model with the sum-coded fixed effects of a design, as contrasts need it."""

    @property
    def beta(self) -> Array:
        """Fixed effects, (p,)."""

    @property
    def covariance(self) -> Array:
        """Their covariance, (p, p)."""

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of Lβ = 0."""


class FittedMixedModel(FittedModel, Protocol):
    """A fitted model that knows how far single responses lie apart."""

    @property
    def total_sd(self) -> float:
        """SD of a single response from all sources, people and residual together."""


def sum_coding(k: int) -> Array:
    """Return the sum-to-zero code of k levels, (k, k − 1); the last level is −1 throughout."""
    return np.vstack([np.eye(k - 1), -np.ones((1, k - 1))])


def model_matrix(
    codes: Sequence[Codes], levels: Sequence[int], n: int
) -> tuple[Array, dict[tuple[int, ...], slice]]:
    """Return the full-factorial sum-coded matrix and the columns of every term.

    Terms are tuples of factor positions; () is the intercept. `n` is the number of rows, needed
    when there is no factor.
    """
    coded_factors = [sum_coding(k)[c] for c, k in zip(codes, levels, strict=True)]
    blocks: list[Array] = [np.ones((n, 1))]
    place: dict[tuple[int, ...], slice] = {(): slice(0, 1)}
    at = 1
    for size in range(1, len(coded_factors) + 1):
        for term in combinations(range(len(coded_factors)), size):
            block = coded_factors[term[0]]
            for other in term[1:]:
                block = (block[:, :, None] * coded_factors[other][:, None, :]).reshape(n, -1)
            blocks.append(block)
            place[term] = slice(at, at + block.shape[1])
            at += block.shape[1]
    return np.hstack(blocks), place


def residual_ss(X: Array, y: Array) -> float:
    """Return the residual sum of squares of a least-squares fit."""
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    return float(((y - X @ beta) ** 2).sum())
