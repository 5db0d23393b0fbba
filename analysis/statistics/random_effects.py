"""Linear mixed models whose covariance is linear in its parameters, V = Σ θ_i G_i, by REML."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from visavis.analysis.statistics.design import Codes, Design
from visavis.analysis.statistics.errors import (
    RANKS_NEED_NO_ERROR,
    ConstantResponse,
    NotConverged,
)
from visavis.analysis.statistics.kenward_roger import kenward_roger_covariance, kenward_roger_df
from visavis.analysis.statistics.results import Array

MAX_SCORING_STEPS = 200
SCORE_TOLERANCE = 1e-10
"""Gain of the restricted log-likelihood that the next step promises, below which a fit stops."""
MIN_RESIDUAL_SHARE = 1e-10
"""Share of the response's variance below which the residual counts as none at all."""

Derivatives = Callable[[Codes], Array]
"""Rows of one subject (m,) → the matrices G_i of that subject, (r, m, m)."""


@dataclass(frozen=True)
class _Batch:
    """Subjects with the same number of rows: X (s, m, p), y (s, m), G (s, r, m, m)."""

    X: Array
    y: Array
    G: Array


@dataclass(frozen=True)
class _State:
    """Estimates, score and information at one value of θ."""

    beta: Array
    cov: Array
    log_likelihood: float
    score: Array
    information: Array
    P: list[Array]
    Q: list[list[Array]]


class SubjectBlocks:
    """The rows of every subject with the derivatives of their covariance, solved for any θ."""

    def __init__(self, X: Array, y: Array, subjects: Codes, derivatives: Derivatives) -> None:
        order = np.argsort(subjects, kind="stable")
        rows = np.split(order, np.flatnonzero(np.diff(subjects[order])) + 1)
        by_size: dict[int, list[Codes]] = {}
        for one in rows:
            by_size.setdefault(one.size, []).append(one)
        self._batches = [
            _Batch(
                np.stack([X[r] for r in same]),
                np.stack([y[r] for r in same]),
                np.stack([derivatives(r) for r in same]),
            )
            for same in by_size.values()
        ]
        self.n, self.p = X.shape
        self.r = self._batches[0].G.shape[1]

    def log_likelihood(self, theta: Array) -> float:
        """Return the restricted log-likelihood, −∞ where V is not positive definite."""
        solution = self._solve(theta)
        return -np.inf if solution is None else solution[2]

    @cached_property
    def mean_diagonal(self) -> Array:
        """The mean of the diagonal of every G_i over all rows, (r,)."""
        sums = [np.einsum("sraa->r", batch.G) for batch in self._batches]
        mean: Array = np.sum(sums, axis=0) / self.n
        return mean

    def _solve(self, theta: Array) -> tuple[Array, Array, float, list[Array]] | None:
        XX, Xy, yy = np.zeros((self.p, self.p)), np.zeros(self.p), 0.0
        log_det, inverses = 0.0, []
        for batch in self._batches:
            V = np.einsum("r,srab->sab", theta, batch.G)
            try:
                root = np.linalg.cholesky(V)
                inverse = np.linalg.inv(V)
            except np.linalg.LinAlgError:
                return None
            log_det += 2 * float(np.log(np.diagonal(root, axis1=1, axis2=2)).sum())
            inverses.append(inverse)
            VX = inverse @ batch.X
            XX += np.einsum("sap,saq->pq", batch.X, VX)
            Xy += np.einsum("sap,sa->p", VX, batch.y)
            yy += float(np.einsum("sa,sab,sb->", batch.y, inverse, batch.y))
        cov: Array = np.asarray(np.linalg.inv(XX), dtype=np.float64)
        beta = cov @ Xy
        log_det += float(np.linalg.slogdet(XX)[1])
        constant = (self.n - self.p) * np.log(2 * np.pi)
        log_likelihood = -0.5 * float(constant + log_det + yy - Xy @ beta)
        return beta, cov, log_likelihood, inverses

    def state(self, theta: Array) -> _State:
        """Return estimates, score and expected information at θ."""
        solution = self._solve(theta)
        if solution is None:
            raise NotConverged("the covariance of the random effects is not positive definite")
        beta, cov, log_likelihood, inverses = solution
        r = self.r
        P = np.zeros((r, self.p, self.p))
        Q = np.zeros((r, r, self.p, self.p))
        trace, pair_trace, quadratic = np.zeros(r), np.zeros((r, r)), np.zeros(r)
        for batch, inverse in zip(self._batches, inverses, strict=True):
            A = inverse @ batch.X
            residual = np.einsum("sab,sb->sa", inverse, batch.y - batch.X @ beta)
            B = np.einsum("sab,srbc->srac", inverse, batch.G)
            GA = np.einsum("srab,sbp->srap", batch.G, A)
            P -= np.einsum("sap,sraq->rpq", A, GA)
            Q += np.einsum("srap,sab,stbq->rtpq", GA, inverse, GA, optimize=True)
            trace += np.einsum("sraa->r", B)
            pair_trace += np.einsum("srab,stba->rt", B, B, optimize=True)
            quadratic += np.einsum("sa,srab,sb->r", residual, batch.G, residual, optimize=True)
        cP = cov @ P
        score = -0.5 * (trace + np.einsum("rpp->r", cP) - quadratic)
        information = 0.5 * (
            pair_trace
            - 2 * np.einsum("pq,rtqp->rt", cov, Q)
            + np.einsum("rpq,tqp->rt", cP, cP, optimize=True)
        )
        return _State(
            beta, cov, log_likelihood, score, information, list(P), [list(row) for row in Q]
        )


@dataclass(frozen=True)
class LinearMixedModel:
    """A fitted model: the parameters θ (r,) of V by name, and all that follows from them."""

    blocks: SubjectBlocks
    names: tuple[str, ...]
    theta: Array
    state: _State

    @property
    def beta(self) -> Array:
        """The fixed effects, (p,)."""
        return self.state.beta

    @property
    def parameters(self) -> dict[str, float]:
        """Variance (or covariance) by name; the residual is called 'residual'."""
        return dict(zip(self.names, self.theta.tolist(), strict=True))

    def negative_variance_notes(self, subject: str) -> list[str]:
        """Return a note on every variance component below zero, which `fit_components` allows."""
        return [
            f"the variance of {subject} × {name} came out below zero: people differ less in {name} "
            "than chance makes them"
            for name, value in self.parameters.items()
            if value < 0
        ]

    @property
    def log_likelihood(self) -> float:
        """The restricted log-likelihood."""
        return self.state.log_likelihood

    @cached_property
    def total_sd(self) -> float:
        """SD of a response about its cell's mean from all sources, people and residual alike.

        The root of the mean variance of a row, where slopes make rows differ in it.
        """
        return float(np.sqrt(self.theta @ self.blocks.mean_diagonal))

    @cached_property
    def _parameter_covariance(self) -> Array:
        return np.asarray(np.linalg.inv(self.state.information), dtype=np.float64)

    @cached_property
    def covariance(self) -> Array:
        """Kenward and Roger's covariance of β, (p, p)."""
        s = self.state
        return kenward_roger_covariance(s.cov, s.P, s.Q, self._parameter_covariance)

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of the hypothesis Lβ = 0; L has full row rank (q, p)."""
        estimate = L @ self.beta
        F = float(estimate @ np.linalg.solve(L @ self.covariance @ L.T, estimate)) / L.shape[0]
        df, scale = kenward_roger_df(L, self.state.cov, self.state.P, self._parameter_covariance)
        return F * scale, df


def slope_terms(design: Design) -> tuple[tuple[str, ...], ...]:
    """Return the within effects in which differences between people can be estimated.

    All of them where some subject has several rows in a cell; otherwise the interaction of all
    within factors is left out, because it is the residual.
    """
    names = [f.name for f in design.within]
    terms = [t for size in range(1, len(names) + 1) for t in combinations(names, size)]
    return tuple(terms if design.is_repeated else terms[:-1])


def component_derivatives(design: Design, terms: Sequence[tuple[str, ...]]) -> Derivatives:
    """Return G of one variance per term: 1 where two rows of a subject share the term's cell.

    The intercept comes first, the residual last.
    """
    codes = []
    for term in terms:
        code = np.zeros(design.y.size, dtype=np.intp)
        for name in term:
            code = code * design.factor(name).k + design.factor(name).codes
        codes.append(code)

    def derivatives(rows: Codes) -> Array:
        m = rows.size
        same_cell = [code[rows][:, None] == code[rows][None, :] for code in codes]
        return np.stack([np.ones((m, m)), *(s.astype(np.float64) for s in same_cell), np.eye(m)])

    return derivatives


def fit_components(design: Design, X: Array, y: Array) -> LinearMixedModel:
    """Fit one variance per within effect and subject, the design's random slopes, by REML.

    A variance may come out below zero, as a sum-of-squares estimate may: it says that people
    differ less in an effect than chance makes them, and keeps complete data equal to the
    repeated-measures ANOVA. Raises `NotConverged`, or `ConstantResponse` for no error at all.
    """
    terms = slope_terms(design)
    names = ("intercept", *(":".join(t) for t in terms), "residual")
    unit = float(y.std())
    if unit == 0:
        raise ConstantResponse(f"{design.dv} does not vary; there is nothing to test")
    centre = float(y.mean())
    derivatives = component_derivatives(design, terms)
    blocks = SubjectBlocks(X, (y - centre) / unit, design.subject, derivatives)
    theta = _maximise_by_scoring(blocks, np.full(blocks.r, 1.0 / blocks.r))
    if theta[-1] < MIN_RESIDUAL_SHARE:
        raise ConstantResponse(
            f"{design.dv} does not vary within subjects beyond the effects, so F is not defined; "
            f"{RANKS_NEED_NO_ERROR}"
        )
    return model_at(X, y, design.subject, derivatives, names, theta * unit**2)


def model_at(
    X: Array,
    y: Array,
    subjects: Codes,
    derivatives: Derivatives,
    names: Sequence[str],
    theta: Array,
) -> LinearMixedModel:
    """Return the model with parameters found elsewhere."""
    centre = float(y.mean())  # keeps digits in the cross products; the intercept takes it back
    blocks = SubjectBlocks(X, y - centre, subjects, derivatives)
    state = blocks.state(theta)
    beta = state.beta.copy()
    beta[0] += centre
    whole = _State(
        beta, state.cov, state.log_likelihood, state.score, state.information, state.P, state.Q
    )
    return LinearMixedModel(blocks, tuple(names), theta, whole)


def _maximise_by_scoring(blocks: SubjectBlocks, theta: Array) -> Array:
    """Return the maximum of the restricted likelihood by Fisher scoring with halved steps."""
    for _ in range(MAX_SCORING_STEPS):
        state = blocks.state(theta)
        step = np.linalg.lstsq(state.information, state.score, rcond=1e-12)[0]
        expected_gain = float(step @ state.score)
        if expected_gain < SCORE_TOLERANCE:
            return theta
        share = 1.0
        while blocks.log_likelihood(theta + share * step) <= state.log_likelihood:
            share /= 2
            if share < 1e-12:
                return theta
        theta = theta + share * step
    raise NotConverged("the variances of the random effects were not found; take fewer of them")
