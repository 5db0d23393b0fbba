"""Test every effect of a complete design against its own subject-by-effect error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

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


@lru_cache(maxsize=64)
def contrasts_of_all_strata(
    levels: tuple[int, ...],
) -> tuple[Array, Array, Mapping[tuple[bool, ...], int]]:
    """Return the orthonormal contrasts (cells, cells) of all strata beside each other.

    The second array (cells, strata) is 1 where a contrast belongs to a stratum; the mapping says
    which stratum lies within which factors.
    """
    place = {inside: i for i, inside in enumerate(product((False, True), repeat=len(levels)))}
    blocks = [orthonormal_contrasts(levels, is_inside) for is_inside in place]
    contrasts = np.hstack(blocks)
    of_stratum = np.repeat(np.eye(len(blocks)), [block.shape[1] for block in blocks], axis=0)
    contrasts.flags.writeable = of_stratum.flags.writeable = False
    return contrasts, of_stratum, place


@dataclass(frozen=True)
class GroupModel:
    """The model matrix X (people, p) of groups and covariates, where its terms' columns stand, and
    what is made of it once: (XᵀX)⁻¹, the fit (p, people) and `precisions` of the terms asked for.
    """

    X: Array
    place: Mapping[tuple[int, ...], slice]
    inverse: Array
    fit: Array
    precisions: dict[tuple[int, ...], Array]

    @classmethod
    def of(cls, X: Array, place: Mapping[tuple[int, ...], slice]) -> "GroupModel":
        """Return the model of a matrix."""
        inverse: Array = np.asarray(np.linalg.inv(X.T @ X), dtype=np.float64)
        fit: Array = inverse @ X.T
        for array in (X, inverse, fit):
            array.flags.writeable = False
        return cls(X, place, inverse, fit, {})

    def precision(self, of_term: tuple[int, ...]) -> Array:
        """Return the inverse of the coefficients' covariance of a between term, made once."""
        if of_term not in self.precisions:
            columns = self.place[of_term]
            precision = np.linalg.inv(self.inverse[columns, columns])
            self.precisions[of_term] = np.asarray(precision, dtype=np.float64)
        return self.precisions[of_term]


@lru_cache(maxsize=64)
def _model_of_groups(codes: tuple[bytes, ...], levels: tuple[int, ...], n: int) -> GroupModel:
    """Return the model of people in groups, once for all responses of one layout."""
    of_people = [np.frombuffer(of_factor, np.intp) for of_factor in codes]
    return GroupModel.of(*model_matrix(of_people, levels, n))


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
        model = _model_of_groups(
            tuple(codes.astype(np.intp).tobytes() for codes in design.group_of_subject),
            tuple(f.k for f in between),
            design.n,
        )
        if design.covariates:
            model = _with_covariates(model, design)
        self._model = model
        self._columns = model.X.shape[1]
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
        beta = self._model.fit @ Z
        errors = Z - self._model.X @ beta
        of_term = tuple(i for i, n in enumerate(self._between) if n in term)
        part = beta[self._model.place[of_term]]
        inside = [n for n in self._within if n in term]
        q, df = Z.shape[1], Z.shape[0] - self._columns
        noise = FLOAT_NOISE * float(np.vdot(table, table))
        ss = float(np.vdot(part, self._model.precision(of_term) @ part))
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

    def f_of_terms(self, tables: Sequence[Array]) -> Array:
        """Return F of every term of the design for several response tables, (terms, tables).

        F is 0 for no effect at all and infinity for an effect without error.
        """
        responses = np.stack(tables, axis=1)
        n, count = responses.shape[:2]
        contrasts, of_stratum, place = contrasts_of_all_strata(responses.shape[2:])
        Z = (responses.reshape(n * count, -1) @ contrasts).reshape(n, -1)
        beta = self._model.fit @ Z
        errors = Z - self._model.X @ beta
        ss_error = np.einsum("ij,ij->j", errors, errors).reshape(count, -1) @ of_stratum
        noise = np.array([[FLOAT_NOISE * float(np.vdot(table, table))] for table in tables])
        of_groups: dict[tuple[int, ...], Array] = {}
        F = np.empty((len(self._design.terms), count))
        for i, term in enumerate(self._design.terms):
            of_term = tuple(j for j, name in enumerate(self._between) if name in term)
            if of_term not in of_groups:
                part = beta[self._model.place[of_term]]
                ss_of_columns = np.einsum("ij,ij->j", part, self._model.precision(of_term) @ part)
                ss = ss_of_columns.reshape(count, -1) @ of_stratum
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = ss / ss_error * (self.df / part.shape[0])
                ratio[ss_error <= noise] = np.inf
                ratio[ss <= noise] = 0.0
                of_groups[of_term] = ratio
            F[i] = of_groups[of_term][:, place[tuple(name in term for name in self._within)]]
        return F

    def residuals(self, Z: Array) -> Array:
        """Return how far people's values (n, columns) lie from the means of their groups."""
        away: Array = Z - self._model.X @ (self._model.fit @ Z)
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
        means: Array = self._of_groups() @ (self._model.fit @ flat)
        return means.reshape(*shape, *values.shape[1:])

    @property
    def group_covariance(self) -> Array:
        """Return the covariance of groups' means of values of variance 1, (groups, groups)."""
        rows = self._of_groups()
        covariance: Array = rows @ self._model.inverse @ rows.T
        return covariance

    def pooled_within_error(self, table: Array) -> tuple[float, int]:
        """Return the error sum of squares of all within effects together, and its df."""
        flat = table.reshape(table.shape[0], -1)
        residual = flat - self._model.X @ (self._model.fit @ flat)
        ss = float((residual**2).sum() - (residual.sum(axis=1) ** 2).sum() / flat.shape[1])
        return ss, (flat.shape[1] - 1) * (flat.shape[0] - self._columns)


def _with_covariates(groups: GroupModel, design: Design) -> GroupModel:
    """Return the model with covariates as columns beside the groups.

    They are centred, so that groups compare at their mean.
    """
    between, X = design.between, groups.X
    place = dict(groups.place)
    for j, (name, values) in enumerate(design.covariates.items()):
        place[(len(between) + j,)] = slice(X.shape[1], X.shape[1] + 1)
        column = values - values.mean()
        rest = column - X @ np.linalg.lstsq(X, column, rcond=None)[0]
        if np.linalg.norm(rest) < COLLINEAR * np.linalg.norm(column):
            others = [*(f.name for f in between), *list(design.covariates)[:j]]
            raise ConstantResponse(
                f"{name} follows from {', '.join(others)}: beside them it explains nothing; "
                "leave one of them out"
            )
        X = np.hstack([X, column[:, None]])
    return GroupModel.of(X, place)
