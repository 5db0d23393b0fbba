"""Test every effect of a complete design against its own subject-by-effect error."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.errors import ConstantResponse
from visavis.analysis.statistics.linear import model_matrix
from visavis.analysis.statistics.results import Array

FLOAT_NOISE = 1e-25
"""Sums of squares below this share of the sum of squared values are rounding, hence zero."""
COLLINEAR = 1e-9
"""A covariate of which less than this share is its own follows from the columns before it."""


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


@lru_cache(maxsize=256)
def orthonormal_contrasts(levels: tuple[int, ...], is_inside: tuple[bool, ...]) -> Array:
    """Return orthonormal contrasts (cells, q) over cells of factors, the last one's side by side.

    Factors that are not inside are averaged, times √k, so that sums of squares come out per row.
    """
    of_cells: Array = np.ones((1, 1))
    for k, inside in zip(levels, is_inside, strict=True):
        of_levels = helmert(k) if inside else np.full((k, 1), 1 / np.sqrt(k))
        of_cells = np.asarray(np.kron(of_cells, of_levels), dtype=np.float64)
    of_cells.flags.writeable = False
    return of_cells


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
        # Covariates are columns beside the groups: centred, so that groups compare at their mean.
        for j, (name, values) in enumerate(design.covariates.items()):
            self._place[(len(between) + j,)] = slice(X.shape[1], X.shape[1] + 1)
            column = values - values.mean()
            rest = column - X @ np.linalg.lstsq(X, column, rcond=None)[0]
            if np.linalg.norm(rest) < COLLINEAR * np.linalg.norm(column):
                others = [*(f.name for f in between), *list(design.covariates)[:j]]
                raise ConstantResponse(
                    f"{name} follows from {', '.join(others)}: beside them it explains nothing; "
                    "leave one of them out"
                )
            X = np.hstack([X, column[:, None]])
        self._inverse = np.linalg.inv(X.T @ X)
        self._fit = self._inverse @ X.T
        self._precisions: dict[tuple[int, ...], Array] = {}
        self._X = X
        self._columns = X.shape[1]
        self._between = [*(f.name for f in between), *design.covariates]
        self._within = [f.name for f in design.within]
        self._design = design
        self._subject = subject

    def scores(self, table: Array, term: Sequence[str]) -> Array:
        """Return orthonormal contrast scores (n, q) of the within factors of a term.

        `table` has shape (subjects, levels of within 1, …); factors outside the term are averaged.
        """
        inside = tuple(name in term for name in self._within)
        scores: Array = table.reshape(len(table), -1) @ orthonormal_contrasts(
            table.shape[1:], inside
        )
        return scores

    def test(self, table: Array, term: Sequence[str]) -> Stratum:
        """Return the sums of squares (type III) of a term for a response table."""
        Z = self.scores(table, term)
        beta = self._fit @ Z
        errors = Z - self._X @ beta
        of_term = tuple(i for i, n in enumerate(self._between) if n in term)
        part = beta[self._place[of_term]]
        inside = [n for n in self._within if n in term]
        q, df = Z.shape[1], Z.shape[0] - self._columns
        noise = FLOAT_NOISE * float(np.vdot(table, table))
        ss = float(np.vdot(part, self._precision(of_term) @ part))
        ss_error = float(np.vdot(errors, errors))
        return Stratum(
            term=tuple(term),
            error_term=":".join([self._subject, *inside]),
            df1=part.shape[0] * q,
            df2=df * q,
            ss=ss if ss > noise else 0.0,
            ss_error=ss_error if ss_error > noise else 0.0,
            errors=errors,
            n_groups=self._columns,
        )

    def _precision(self, of_term: tuple[int, ...]) -> Array:
        """Return the inverse of the coefficients' covariance of a between term, made once."""
        if of_term not in self._precisions:
            columns = self._place[of_term]
            self._precisions[of_term] = np.linalg.inv(self._inverse[columns, columns])
        return self._precisions[of_term]

    def residuals(self, Z: Array) -> Array:
        """Return how far people's values (n, columns) lie from the means of their groups."""
        away: Array = Z - self._X @ (self._fit @ Z)
        return away

    @property
    def df(self) -> int:
        """People minus the columns of the model of groups and covariates."""
        return self._design.n - int(self._columns)

    def _of_groups(self) -> Array:
        """Return the row of the model of every group at the covariates' means, (groups, p)."""
        sizes = [f.k for f in self._design.between]
        codes = np.unravel_index(np.arange(int(np.prod(sizes, dtype=int))), sizes or (1,))
        rows, _ = model_matrix(codes[: len(sizes)], sizes, int(np.prod(sizes, dtype=int)))
        at_mean = np.zeros((len(rows), len(self._design.covariates)))
        return np.hstack([rows, at_mean])

    def group_means(self, values: Array) -> Array:
        """Return the mean of every cell of the between factors, (k1, k2, …, *columns).

        With covariates it is the one expected at their means.
        """
        shape = tuple(f.k for f in self._design.between)
        flat = values.reshape(values.shape[0], -1)
        means: Array = self._of_groups() @ (self._fit @ flat)
        return means.reshape(*shape, *values.shape[1:])

    @property
    def group_covariance(self) -> Array:
        """Return the covariance of groups' means of values of variance 1, (groups, groups)."""
        rows = self._of_groups()
        covariance: Array = rows @ self._inverse @ rows.T
        return covariance

    def pooled_within_error(self, table: Array) -> tuple[float, int]:
        """Return the error sum of squares of all within effects together, and its df."""
        flat = table.reshape(table.shape[0], -1)
        residual = flat - self._X @ (self._fit @ flat)
        ss = float((residual**2).sum() - (residual.sum(axis=1) ** 2).sum() / flat.shape[1])
        return ss, (flat.shape[1] - 1) * (flat.shape[0] - self._columns)
