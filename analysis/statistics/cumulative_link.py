"""Likelihood of a cumulative link model with a normal random intercept, on plain arrays.

P(y ≤ j) = logistic(θ_j − xβ − σu), u ~ N(0, 1) per subject. The integral over u is taken by
adaptive Gauss-Hermite quadrature (Liu and Pierce 1994): nodes lie around each subject's mode.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from analysis.statistics.design import Codes
from analysis.statistics.errors import NotConverged
from analysis.statistics.results import Array

N_NODES = 21
"""Quadrature nodes; ten give log-likelihoods to 1e-5, these to 1e-9 in the reference cases."""
MAX_MODE_STEPS = 60
MODE_TOLERANCE = 1e-11
MAX_POLISH_STEPS = 8
GRADIENT_TOLERANCE = 1e-7
HESSIAN_STEP = 1e-4
MAX_GRADIENT = 1e-4
FLAT_CURVATURE = 1e-7
NO_PEAK = (
    "the cumulative link model has no finite estimate: some condition parts the categories "
    "completely, or too few answers stand in one"
)
MAX_LOG_ODDS = 25.0
"""Estimates beyond are on their way to infinity: a condition parts the categories completely."""


@dataclass(frozen=True)
class CumulativeFit:
    """Maximum-likelihood estimates.

    `thresholds` (k − 1,), `beta` (p,), `sigma` the SD of the random intercept (0 without one),
    `covariance` (p, p) of beta from the observed information, `scores` (subjects, p) the gradient
    of each subject's log-likelihood in beta with the other parameters swept out, so that
    covariance · scoresᵀscores · covariance is the robust covariance.
    """

    thresholds: Array
    beta: Array
    sigma: float
    log_likelihood: float
    covariance: Array
    scores: Array


class _Likelihood:
    """Log-likelihood and gradient of (first threshold, log steps, beta, sigma)."""

    def __init__(self, category: Codes, X: Array, subject: Codes, *, has_intercept: bool) -> None:
        order = np.argsort(subject, kind="stable")
        self.category, self.X, self.subject = category[order], X[order], subject[order]
        self.k, self.n = int(category.max()) + 1, int(subject.max()) + 1
        self.has_intercept = has_intercept
        nodes, weights = np.polynomial.hermite.hermgauss(N_NODES if has_intercept else 1)
        self._nodes, self._log_weights = np.sqrt(2) * nodes, np.log(weights) + nodes**2
        self._modes = np.zeros(self.n)

    @property
    def n_parameters(self) -> int:
        return self.k - 1 + int(self.X.shape[1]) + int(self.has_intercept)

    def start(self) -> Array:
        """Return the thresholds of the pooled answers, no effects and σ = 1."""
        counts = np.bincount(self.category, minlength=self.k)
        thresholds = special.logit(np.cumsum(counts)[:-1] / counts.sum())
        steps = np.log(np.diff(thresholds))
        return np.concatenate(
            [thresholds[:1], steps, np.zeros(self.X.shape[1]), np.ones(int(self.has_intercept))]
        )

    def parts(self, theta: Array) -> tuple[Array, Array, float]:
        """Return thresholds, beta and sigma."""
        q = self.k - 1
        thresholds = theta[0] + np.concatenate([[0.0], np.cumsum(np.exp(theta[1:q]))])
        beta = theta[q : q + self.X.shape[1]]
        return thresholds, beta, float(theta[-1]) if self.has_intercept else 0.0

    def by_subject(self, theta: Array) -> tuple[Array, Array]:
        """Return each subject's log-likelihood (n,) and its gradient (n, parameters)."""
        thresholds, beta, sigma = self.parts(theta)
        bounds = np.concatenate([[-np.inf], thresholds, [np.inf]])
        fixed = self.X @ beta
        upper, lower = bounds[self.category + 1] - fixed, bounds[self.category] - fixed
        modes, curvature = self._find_modes(upper, lower, sigma)
        spread = 1 / np.sqrt(curvature)
        u = modes[:, None] + spread[:, None] * self._nodes
        shift = sigma * u[self.subject]
        c, d = upper[:, None] - shift, lower[:, None] - shift
        gap = (upper - lower)[:, None]
        log_p = special.log_expit(c) + special.log_expit(-d) + np.log(-np.expm1(-gap))
        joint = self._summed(log_p) - u**2 / 2 + self._log_weights + np.log(spread)[:, None]
        total = special.logsumexp(joint, axis=1) - np.log(np.pi) / 2
        share = np.exp(joint - total[:, None] - np.log(np.pi) / 2)[self.subject]
        odds = 1 / np.expm1(gap)
        at_upper = (share * (special.expit(-c) + odds)).sum(axis=1)
        at_lower = -(share * (special.expit(d) + odds)).sum(axis=1)
        at_rows = share * (special.expit(c) + special.expit(d) - 1)
        rows = np.zeros((self.category.size, self.n_parameters))
        by_threshold = np.zeros((self.category.size, self.k + 1))
        every = np.arange(self.category.size)
        by_threshold[every, self.category + 1] = at_upper
        by_threshold[every, self.category] = at_lower
        q = self.k - 1
        later = np.cumsum(by_threshold[:, q:0:-1], axis=1)[:, ::-1]
        rows[:, 0] = later[:, 0]
        rows[:, 1:q] = later[:, 1:] * np.exp(theta[1:q])
        rows[:, q : q + self.X.shape[1]] = at_rows.sum(axis=1)[:, None] * self.X
        if self.has_intercept:
            rows[:, -1] = (at_rows * u[self.subject]).sum(axis=1)
        return total, self._summed(rows)

    def loss(self, theta: Array) -> tuple[float, Array]:
        """Return minus log-likelihood and its gradient."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            total, gradient = self.by_subject(theta)
        if not np.isfinite(total).all():
            return 1e10, np.zeros(theta.size)
        return -float(total.sum()), -gradient.sum(axis=0)

    def hessian(self, theta: Array) -> Array:
        """Return the second derivatives of the loss, from differences of the gradient."""
        rows = [
            (self.loss(theta + unit)[1] - self.loss(theta - unit)[1]) / (2 * HESSIAN_STEP)
            for unit in np.eye(theta.size) * HESSIAN_STEP
        ]
        H = np.array(rows)
        return (H + H.T) / 2

    def _find_modes(self, upper: Array, lower: Array, sigma: float) -> tuple[Array, Array]:
        """Return modes of u (n,) and the curvature there, by Newton's method from the last."""
        if not self.has_intercept:
            return np.zeros(self.n), np.full(self.n, 1.0)
        u = self._modes
        for _ in range(MAX_MODE_STEPS):
            c, d = upper - sigma * u[self.subject], lower - sigma * u[self.subject]
            high, low = special.expit(c), special.expit(d)
            slope = self._summed(sigma * (high + low - 1)) - u
            bend = 1 + self._summed(sigma**2 * (high * (1 - high) + low * (1 - low)))
            step = np.clip(slope / bend, -2, 2)
            u = u + step
            if np.abs(step).max() < MODE_TOLERANCE:
                break
        if np.isfinite(u).all():
            self._modes = u
        return u, bend

    def _summed(self, rows: Array) -> Array:
        starts = np.searchsorted(self.subject, np.arange(self.n))
        return np.asarray(np.add.reduceat(rows, starts, axis=0), dtype=np.float64)


def fit_cumulative(
    category: Codes, X: Array, subject: Codes, *, has_intercept: bool
) -> CumulativeFit:
    """Fit by maximum likelihood; category 0..k−1, X (rows, p) without a constant.

    Raises:
        NotConverged: estimates run to infinity, or the likelihood has no peak.
    """
    likelihood = _Likelihood(category, X, subject, has_intercept=has_intercept)
    theta = _peak(likelihood)
    H = likelihood.hessian(theta)
    values, vectors = np.linalg.eigh(H)
    if values[0] <= FLAT_CURVATURE * values[-1]:
        raise NotConverged(NO_PEAK)
    covariance = vectors @ (vectors / values).T
    for _ in range(MAX_POLISH_STEPS):
        gradient = likelihood.loss(theta)[1]
        if np.abs(gradient).max() < GRADIENT_TOLERANCE:
            break
        theta = theta - covariance @ gradient
    loss, gradient = likelihood.loss(theta)
    thresholds, beta, sigma = likelihood.parts(theta)
    if np.abs(beta).max(initial=0) > MAX_LOG_ODDS or np.abs(gradient).max() > MAX_GRADIENT:
        raise NotConverged(NO_PEAK)
    at = slice(likelihood.k - 1, likelihood.k - 1 + X.shape[1])
    scores = likelihood.by_subject(theta)[1]
    inside = covariance[at, at]
    swept = np.linalg.solve(inside, covariance[at] @ scores.T).T
    return CumulativeFit(thresholds, beta, abs(sigma), -loss, inside, swept)


def log_likelihood(category: Codes, X: Array, subject: Codes, *, has_intercept: bool) -> float:
    """Return the highest log-likelihood alone, in a third of the time."""
    likelihood = _Likelihood(category, X, subject, has_intercept=has_intercept)
    return -likelihood.loss(_peak(likelihood))[0]


def _peak(likelihood: _Likelihood) -> Array:
    from scipy import optimize  # late: other tests need not pay for it

    found = optimize.minimize(
        likelihood.loss,
        likelihood.start(),
        jac=True,
        method="BFGS",
        options={"gtol": 1e-5, "maxiter": 500},
    )
    return np.asarray(found.x, dtype=np.float64)
