"""Test every effect of a complete design against its own subject-by-effect error."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.linear import model_matrix
from visavis.analysis.statistics.results import Array

FLOAT_NOISE = 1e-25
"""Sums of squares below this share of the sum of squared values are rounding, hence zero."""


@lru_cache(maxsize=64)
def helmert(k: int) -> Array:
    """Return orthonormal contrasts of k levels, (k, k − 1)."""
    columns = np.zeros((k, k - 1))
    for j in range(1, k):
        columns[:j, j - 1] = 1.0
        columns[j, j - 1] = -j
        columns[:, j - 1] /= np.sqrt(j * (j + 1))
    columns.flags.writeable = False
    return columns


@dataclass(frozen=True)
class Stratum:
    """Sums of squares of one effect and of its error; `errors` (n, q) are the error scores."""

    term: tuple[str, ...]
    error_term: str
    df1: int
    df2: int
    ss: float
    ss_error: float
    errors: Array
    n_groups: int


class Strata:
    """The between-subject model of a complete design, fitted once, applied to many responses."""

    def __init__(self, design: Design, subject: str) -> None:
        between = design.between
        X, self._place = model_matrix(design.group_of_subject, [f.k for f in between], design.n)
        self._inverse = np.linalg.inv(X.T @ X)
        self._fit = self._inverse @ X.T
        self._X = X
        self._groups = X.shape[1]
        self._between = [f.name for f in between]
        self._within = [f.name for f in design.within]
        self._design = design
        self._subject = subject

    def scores(self, table: Array, term: Sequence[str]) -> Array:
        """Return orthonormal contrast scores (n, q) of the within factors of a term.

        `table` has shape (subjects, levels of within 1, …); factors outside the term are averaged
        (times √k, so that sums of squares come out per row).
        """
        scores = table
        for axis, name in enumerate(self._within, start=1):
            k = table.shape[axis]
            if name in term:
                scores = np.moveaxis(np.moveaxis(scores, axis, -1) @ helmert(k), -1, axis)
            else:
                scores = scores.sum(axis=axis, keepdims=True) / np.sqrt(k)
        return scores.reshape(table.shape[0], -1)

    def test(self, table: Array, term: Sequence[str]) -> Stratum:
        """Return the sums of squares (type III) of a term for a response table."""
        Z = self.scores(table, term)
        beta = self._fit @ Z
        errors = Z - self._X @ beta
        columns = self._place[tuple(i for i, n in enumerate(self._between) if n in term)]
        part = beta[columns]
        hypothesis = part.T @ np.linalg.solve(self._inverse[columns, columns], part)
        inside = [n for n in self._within if n in term]
        q, df = Z.shape[1], Z.shape[0] - self._groups
        noise = FLOAT_NOISE * float((table**2).sum())
        ss, ss_error = float(np.trace(hypothesis)), float((errors**2).sum())
        return Stratum(
            term=tuple(term),
            error_term=":".join([self._subject, *inside]),
            df1=part.shape[0] * q,
            df2=df * q,
            ss=ss if ss > noise else 0.0,
            ss_error=ss_error if ss_error > noise else 0.0,
            errors=errors,
            n_groups=self._groups,
        )

    def residuals(self, Z: Array) -> Array:
        """Return how far people's values (n, columns) lie from the means of their groups."""
        away: Array = Z - self._X @ (self._fit @ Z)
        return away

    def group_means(self, values: Array) -> Array:
        """Return the mean of every cell of the between factors, (k1, k2, …, *columns)."""
        shape = tuple(f.k for f in self._design.between)
        codes = np.zeros(self._design.n, dtype=np.intp)
        if shape:
            codes = np.ravel_multi_index(self._design.group_of_subject, shape)
        sums = np.zeros((int(np.prod(shape, dtype=int)), *values.shape[1:]))
        np.add.at(sums, codes, values)
        counts = self._design.group_sizes.reshape(-1, *([1] * (values.ndim - 1)))
        means: Array = (sums / counts).reshape(*shape, *values.shape[1:])
        return means

    def pooled_within_error(self, table: Array) -> tuple[float, int]:
        """Return the error sum of squares of all within effects together, and its df."""
        flat = table.reshape(table.shape[0], -1)
        residual = flat - self._X @ (self._fit @ flat)
        ss = float((residual**2).sum() - (residual.sum(axis=1) ** 2).sum() / flat.shape[1])
        return ss, (flat.shape[1] - 1) * (flat.shape[0] - self._groups)
