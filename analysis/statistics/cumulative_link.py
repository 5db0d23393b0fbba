"""Cumulative links: P(y ≤ j) = logistic(θ_j − η), with people who differ, on plain arrays."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from visavis.analysis.statistics.answer_likelihood import (
    N_NODES,
    AnswerFit,
    AnswerLikelihood,
    RowTerms,
)
from visavis.analysis.statistics.design import Codes
from visavis.analysis.statistics.results import Array

NO_PEAK = (
    "the cumulative link model has no finite estimate: some condition parts the categories "
    "completely, or too few answers stand in one"
)
MAX_LOG_ODDS = 25.0
"""Larger estimates diverge: a condition separates the categories completely."""


@dataclass(frozen=True)
class CumulativeRows:
    """Answers 0..k−1; own parameters are the first threshold and the log steps to the next."""

    category: Codes
    k: int

    @property
    def n_own(self) -> int:
        """Number of thresholds."""
        return self.k - 1

    def start(self) -> Array:
        """Return the thresholds of the pooled answers."""
        counts = np.bincount(self.category, minlength=self.k)
        thresholds = special.logit(np.cumsum(counts)[:-1] / counts.sum())
        return np.concatenate([thresholds[:1], np.log(np.diff(thresholds))])

    def in_order(self, order: Codes) -> "CumulativeRows":
        """Return the rows in another order."""
        return replace(self, category=self.category[order])

    def thresholds(self, own: Array) -> Array:
        """Return the thresholds (k − 1,), rising."""
        return np.asarray(own[0] + np.concatenate([[0.0], np.cumsum(np.exp(own[1:]))]))

    def terms(self, own: Array, eta: Array, *, is_curved: bool) -> RowTerms:
        """Return log-likelihoods with derivatives; parts are the bounds above and below."""
        bounds = np.concatenate([[-np.inf], self.thresholds(own), [np.inf]])
        ends = (slice(None),) + (None,) * (eta.ndim - 1)
        upper, lower = bounds[self.category + 1][ends], bounds[self.category][ends]
        c, d, gap = upper - eta, lower - eta, upper - lower
        log_p = special.log_expit(c) + special.log_expit(-d) + np.log(-np.expm1(-gap))
        high, low, odds = special.expit(c), special.expit(d), 1 / np.expm1(gap)
        slopes = special.expit(-c) + odds, -(low + odds)
        nothing = np.zeros(0)
        if not is_curved:
            own_terms = tuple((slope, nothing, nothing) for slope in slopes)
            return RowTerms(log_p, high + low - 1, nothing, nothing, own_terms)
        bends = high * (1 - high), low * (1 - low)
        turns = bends[0] * (1 - 2 * high), bends[1] * (1 - 2 * low)
        own_terms = tuple(zip(slopes, bends, turns, strict=True))
        return RowTerms(log_p, high + low - 1, bends[0] + bends[1], -turns[0] - turns[1], own_terms)

    def by_parameter(self, own: Array, parts: tuple[Array, ...]) -> Array:
        """Return derivatives in the first threshold and the log steps."""
        at_upper, at_lower = parts
        by_threshold = np.zeros((self.category.size, self.k + 1))
        every = np.arange(self.category.size)
        by_threshold[every, self.category + 1] = at_upper
        by_threshold[every, self.category] = at_lower
        later = np.cumsum(by_threshold[:, self.k - 1 : 0 : -1], axis=1)[:, ::-1]
        return np.asarray(np.hstack([later[:, :1], later[:, 1:] * np.exp(own[1:])]))


@dataclass(frozen=True)
class CumulativeFit:
    """Maximum-likelihood estimates.

    `thresholds` (k − 1,), `beta` (p,), `spread` (q, q) the covariance of people's random effects
    (the thresholds' shift first; empty without any), singular where `is_singular`. `covariance`
    (p, p) of beta is that of the observed information, `robust` that of people's scores.
    """

    thresholds: Array
    beta: Array
    spread: Array
    log_likelihood: float
    covariance: Array
    robust: Array
    is_singular: bool

    @property
    def sigma(self) -> float:
        """SD of the random intercept; 0 without one."""
        return float(np.sqrt(self.spread[0, 0])) if self.spread.size else 0.0


def fit_cumulative(
    category: Codes, X: Array, subject: Codes, Z: Array, *, nodes: int = 0
) -> CumulativeFit:
    """Fit by maximum likelihood; category 0..k−1, X (rows, p) without a constant.

    `Z` (rows, q) are the columns of people's random effects. Without `nodes` one of them is
    integrated by quadrature, several by Laplace's approximation.

    Raises:
        NotConverged: estimates run to infinity, or the likelihood has no peak.
    """
    likelihood = _likelihood(category, X, subject, Z, nodes)
    fit = likelihood.fit(
        no_peak=NO_PEAK, is_far=lambda own, beta: np.abs(beta).max(initial=0) > MAX_LOG_ODDS
    )
    return _fit_of(likelihood, fit)


def log_likelihood(category: Codes, X: Array, subject: Codes, Z: Array, *, nodes: int = 0) -> float:
    """Return the highest log-likelihood alone, in a third of the time."""
    likelihood = _likelihood(category, X, subject, Z, nodes)
    return -likelihood.loss(likelihood.peak())[0]


def _likelihood(
    category: Codes, X: Array, subject: Codes, Z: Array, nodes: int
) -> AnswerLikelihood:
    rows = CumulativeRows(category, int(category.max()) + 1)
    usual = N_NODES if Z.shape[1] == 1 else 1
    return AnswerLikelihood(rows, X, subject, Z, nodes=nodes or usual)


def _fit_of(likelihood: AnswerLikelihood, fit: AnswerFit) -> CumulativeFit:
    own = likelihood.answers.n_own
    influence = fit.influence[:, own:]
    return CumulativeFit(
        CumulativeRows(np.zeros(0, dtype=np.intp), own + 1).thresholds(fit.own),
        fit.beta,
        fit.spread,
        fit.log_likelihood,
        fit.covariance[own:, own:],
        influence.T @ influence,
        fit.is_singular,
    )
