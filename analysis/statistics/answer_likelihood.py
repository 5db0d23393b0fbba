"""Likelihood of answers whose log odds vary normally between people, on plain arrays.

A row's answer depends on η = xβ + zLu, u ~ N(0, I) per person, and on parameters of the kind of
answer (thresholds, ties). The integral over u is taken by adaptive Gauss-Hermite quadrature around
each person's mode (Liu and Pierce 1994); one node is Laplace's approximation, whose gradient here
is exact, with mode and curvature moving.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Protocol, Self

import numpy as np
from scipy import special

from visavis.analysis.statistics.design import Codes
from visavis.analysis.statistics.errors import NotConverged
from visavis.analysis.statistics.results import Array

N_NODES = 21
"""Nodes for one random effect; ten give log-likelihoods to 1e-5, these to 1e-9 in the references.
"""
MAX_QUADRATURE = 3
"""Most random effects that quadrature can take: its nodes multiply with every further one."""
MAX_MODE_STEPS = 60
MODE_TOLERANCE = 1e-11
MAX_POLISH_STEPS = 8
GRADIENT_TOLERANCE = 1e-7
HESSIAN_STEP = 1e-4
MAX_GRADIENT = 1e-4
FLAT_CURVATURE = 1e-7
MAX_FLAT_SHARE = 1e-3
"""Part of a flat direction outside the people's spread from which an estimate counts as infinite.
"""
SINGULAR_VARIANCE_RATIO = 1e-4
"""Smallest over largest variance of people's effects below which a fit counts as singular."""
START_SPREAD = (1.0, 0.5)
"""SDs of the first and of all other random effects that the search begins with."""


@dataclass(frozen=True)
class RowTerms:
    """Log-likelihood of rows at η, (rows,) or (rows, nodes), and its derivatives.

    `slope` is its derivative in η, `bend` minus the second, `turn` the derivative of bend. `own`
    holds for every part of the answer's own parameters the derivatives of log_p, slope and bend;
    without `is_curved` bend, turn and the last two are not computed.
    """

    log_p: Array
    slope: Array
    bend: Array
    turn: Array
    own: tuple[tuple[Array, Array, Array], ...]


class AnswerRows(Protocol):
    """A kind of answer, one per row, with parameters of its own."""

    @property
    def n_own(self) -> int:
        """Number of own parameters."""

    def start(self) -> Array:
        """Return own parameters (n_own,) to begin with."""

    def in_order(self, order: Codes) -> Self:
        """Return the rows in another order."""

    def terms(self, own: Array, eta: Array, *, is_curved: bool) -> RowTerms:
        """Return log-likelihoods with derivatives."""

    def by_parameter(self, own: Array, parts: tuple[Array, ...]) -> Array:
        """Return derivatives in the own parameters (rows, n_own) from those in parts (rows,)."""


@dataclass(frozen=True)
class AnswerFit:
    """Maximum-likelihood estimates.

    `own` and `beta` are parameters, `spread` (q, q) is the covariance of people's random effects,
    `is_singular` tells that it has a direction without a spread of its own. `covariance` is that of
    (own, beta) from the observed information, `influence` (subjects, own and beta) the shift of the
    estimates by each person's score, so that influenceᵀ · influence is the robust covariance.
    """

    own: Array
    beta: Array
    spread: Array
    log_likelihood: float
    covariance: Array
    influence: Array
    is_singular: bool


class AnswerLikelihood:
    """Log-likelihood and gradient of (own parameters, beta, entries of L row by row).

    `Z` (rows, q) are the columns of the random effects; with `is_alike` all have one SD and no
    covariances. `nodes` per random effect, 1 for Laplace.
    """

    def __init__(
        self,
        answers: AnswerRows,
        X: Array,
        subject: Codes,
        Z: Array,
        *,
        nodes: int = 1,
        is_alike: bool = False,
    ) -> None:
        order = np.argsort(subject, kind="stable")
        self.answers, self.X, self.Z = answers.in_order(order), X[order], Z[order]
        self.subject, self.n = subject[order], int(subject.max()) + 1
        self.q = int(Z.shape[1])
        self._is_alike = is_alike
        self._entries = [(a, b) for a in range(self.q) for b in range(a + 1)]
        self.nodes = nodes if self.q else 1
        at, weights = np.polynomial.hermite.hermgauss(self.nodes)
        grid = list(product(range(self.nodes), repeat=self.q))
        places = np.array(grid, dtype=np.intp).reshape(len(grid), self.q)
        self._nodes = np.sqrt(2) * at[places]
        self._log_weights = (np.log(weights) + at**2)[places].sum(axis=1)
        self._modes = np.zeros((self.n, self.q))

    @property
    def n_fixed(self) -> int:
        """Number of own parameters and of beta."""
        return self.answers.n_own + int(self.X.shape[1])

    def start(self) -> Array:
        """Return own parameters to begin with, no effects, and people who differ a little."""
        first, others = START_SPREAD
        spread = [(first if a == 0 else others) if a == b else 0.0 for a, b in self._entries]
        if self._is_alike:
            spread = spread[:1]
        return np.concatenate([self.answers.start(), np.zeros(self.X.shape[1]), spread])

    def parts(self, theta: Array) -> tuple[Array, Array, Array]:
        """Return own parameters, beta and L (q, q)."""
        own, beta, entries = np.split(theta, [self.answers.n_own, self.n_fixed])
        if self._is_alike:
            return own, beta, np.eye(self.q) * entries
        L = np.zeros((self.q, self.q))
        for (a, b), value in zip(self._entries, entries, strict=True):
            L[a, b] = value
        return own, beta, L

    def by_subject(self, theta: Array) -> tuple[Array, Array]:
        """Return each person's log-likelihood (n,) and its gradient (n, parameters)."""
        own, beta, L = self.parts(theta)
        fixed_part, G = self.X @ beta, self.Z @ L
        modes, H = self._find_modes(own, fixed_part, G)
        of_nodes = self._laplace if self.nodes == 1 else self._quadrature
        total, parts, at_eta, at_L = of_nodes(own, fixed_part, G, modes, H)
        columns = [self.answers.by_parameter(own, parts), at_eta[:, None] * self.X]
        if self._is_alike and self.q:
            columns.append(np.trace(at_L, axis1=1, axis2=2)[:, None])
        else:
            columns += [at_L[:, a, b, None] for a, b in self._entries]
        return total, self._sum_by_subject(np.hstack(columns))

    def _laplace(
        self, own: Array, fixed_part: Array, G: Array, modes: Array, H: Array
    ) -> tuple[Array, tuple[Array, ...], Array, Array]:
        """Return log-likelihoods of people, and of rows the slopes in parts, η and L."""
        u = modes[self.subject]
        terms = self.answers.terms(own, fixed_part + (G * u).sum(axis=1), is_curved=True)
        total = self._sum_by_subject(terms.log_p) - (modes**2).sum(axis=1) / 2
        total = total - np.linalg.slogdet(H)[1] / 2
        H_inverse_G = np.linalg.solve(H[self.subject], G[:, :, None])[:, :, 0]
        leverage = (G * H_inverse_G).sum(axis=1)
        pull = self._sum_by_subject((terms.turn * leverage)[:, None] * G)
        mode_shift = np.linalg.solve(H, pull[:, :, None])[:, :, 0][self.subject]
        along = (G * mode_shift).sum(axis=1)
        at_eta = terms.slope - terms.turn * leverage / 2 + terms.bend * along / 2
        parts = tuple(
            dl - (dbend * leverage + dslope * along) / 2 for dl, dslope, dbend in terms.own
        )
        at_L = (
            self.Z[:, :, None]
            * (
                u * at_eta[:, None]
                - terms.bend[:, None] * H_inverse_G
                - terms.slope[:, None] * mode_shift / 2
            )[:, None, :]
        )
        return total, parts, at_eta, at_L

    def _quadrature(
        self, own: Array, fixed_part: Array, G: Array, modes: Array, H: Array
    ) -> tuple[Array, tuple[Array, ...], Array, Array]:
        """Return the same as `_laplace`, weighted over nodes, whose places count as fixed."""
        root = np.linalg.cholesky(np.linalg.inv(H))
        u = modes[:, None, :] + self._nodes @ root.transpose(0, 2, 1)
        at = u[self.subject]
        eta = fixed_part[:, None] + (at @ G[:, :, None])[:, :, 0]
        terms = self.answers.terms(own, eta, is_curved=False)
        joint = self._sum_by_subject(terms.log_p) - (u**2).sum(axis=2) / 2 + self._log_weights
        joint = joint + np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)[:, None]
        total = special.logsumexp(joint, axis=1)
        share = np.exp(joint - total[:, None])[self.subject]
        slope = share * terms.slope
        parts = tuple((share * dl).sum(axis=1) for dl, _, _ in terms.own)
        at_L = self.Z[:, :, None] * (slope[:, None, :] @ at)
        return total - self.q * np.log(np.pi) / 2, parts, slope.sum(axis=1), at_L

    def loss(self, theta: Array) -> tuple[float, Array]:
        """Return minus log-likelihood and its gradient."""
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                total, gradient = self.by_subject(theta)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros(theta.size)
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

    def peak(self) -> Array:
        """Return the parameters at which BFGS ends."""
        from scipy import optimize  # late: other tests need not pay for it

        start = self.start()
        if not start.size:
            return start
        optimum = optimize.minimize(
            self.loss,
            start,
            jac=True,
            method="BFGS",
            options={"gtol": 1e-5, "maxiter": 500},
        )
        return np.asarray(optimum.x, dtype=np.float64)

    def fit(self, *, no_peak: str, is_far: Callable[[Array, Array], bool]) -> AnswerFit:
        """Fit by maximum likelihood.

        Raises:
            NotConverged: with `no_peak`, where estimates are `is_far` of own parameters and beta,
                on their way to infinity, or the likelihood has no peak.
        """
        theta = self.peak()
        H = self.hessian(theta)
        values, vectors = np.linalg.eigh(H)
        is_flat = values <= FLAT_CURVATURE * values[-1]
        if np.abs(vectors[: self.n_fixed, is_flat]).max(initial=0) > MAX_FLAT_SHARE:
            raise NotConverged(no_peak)
        with_curvature = vectors[:, ~is_flat]
        covariance = with_curvature @ (with_curvature / values[~is_flat]).T
        for _ in range(MAX_POLISH_STEPS):
            gradient = self.loss(theta)[1]
            if np.abs(gradient).max() < GRADIENT_TOLERANCE:
                break
            theta = theta - covariance @ gradient
        loss, gradient = self.loss(theta)
        own, beta, L = self.parts(theta)
        if is_far(own, beta) or np.abs(gradient).max() > MAX_GRADIENT:
            raise NotConverged(no_peak)
        scores = self.by_subject(theta)[1]
        at = slice(0, self.n_fixed)
        return AnswerFit(
            own,
            beta,
            L @ L.T,
            -loss,
            covariance[at, at],
            scores @ covariance[:, at],
            bool(is_flat.any()) or _is_singular(L),
        )

    def _find_modes(self, own: Array, fixed_part: Array, G: Array) -> tuple[Array, Array]:
        """Return modes of u (n, q) and the curvature there, by Newton's method from the last."""
        H = np.broadcast_to(np.eye(self.q), (self.n, self.q, self.q))
        if not self.q:
            return self._modes, H
        u = self._modes
        for _ in range(MAX_MODE_STEPS):
            eta = fixed_part + (G * u[self.subject]).sum(axis=1)
            terms = self.answers.terms(own, eta, is_curved=True)
            slope = self._sum_by_subject(terms.slope[:, None] * G) - u
            H = np.eye(self.q) + self._sum_by_subject(
                terms.bend[:, None, None] * G[:, :, None] * G[:, None, :]
            )
            step = np.clip(np.linalg.solve(H, slope[:, :, None])[:, :, 0], -2, 2)
            u = u + step
            if np.abs(step).max() < MODE_TOLERANCE:
                break
        if np.isfinite(u).all():
            self._modes = u
        return u, H

    def _sum_by_subject(self, rows: Array) -> Array:
        starts = np.searchsorted(self.subject, np.arange(self.n))
        return np.asarray(np.add.reduceat(rows, starts, axis=0), dtype=np.float64)


def _is_singular(L: Array) -> bool:
    """Tell whether the smallest variance is next to nothing beside the largest."""
    if L.shape[0] < 2:
        return False
    variances = np.linalg.eigvalsh(L @ L.T)
    return bool(variances[0] < SINGULAR_VARIANCE_RATIO * variances[-1])
