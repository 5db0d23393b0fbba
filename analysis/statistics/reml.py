"""The restricted likelihood of a random-intercept model, through group sums only."""

from collections.abc import Callable

import numpy as np

from visavis.analysis.statistics.design import Codes
from visavis.analysis.statistics.results import Array

MAX_LOG_RATIO = 20.0
"""Logarithm of the largest ratio of variances looked at; data without noise end up here."""
_GOLDEN = (np.sqrt(5.0) - 1) / 2


def group_sums(X: Array, groups: Codes) -> tuple[Array, Array]:
    """Return column sums per group (m, p) and group sizes (m,)."""
    m = int(groups.max()) + 1
    sums = np.zeros((m, X.shape[1]))
    np.add.at(sums, groups, X)
    return sums, np.bincount(groups, minlength=m).astype(np.float64)


class Moments:
    """Cross products of a fixed data set, from which every ratio is solved in p × p."""

    def __init__(self, X: Array, y: Array, groups: Codes) -> None:
        self._n, self._p = X.shape
        both = np.column_stack((X, y))
        self._cross = both.T @ both
        self._sums, self._sizes = group_sums(both, groups)

    def solve(self, ratio: float) -> tuple[Array, float, float]:
        """Return β, the residual sum of squares and log|V/σ²| + log|X'V⁻¹X·σ²|."""
        weight = ratio / (1 + ratio * self._sizes)
        cross = self._cross - self._sums.T @ (weight[:, None] * self._sums)
        XX, Xy, yy = cross[:-1, :-1], cross[:-1, -1], cross[-1, -1]
        beta: Array = np.asarray(np.linalg.solve(XX, Xy), dtype=np.float64)
        log_det = float(np.log1p(ratio * self._sizes).sum()) + float(np.linalg.slogdet(XX)[1])
        return beta, max(float(yy - Xy @ beta), 0.0), log_det

    def profile(self, ratio: float) -> float:
        """Return −2 log REML at its best residual variance, up to a constant."""
        _, rss, log_det = self.solve(ratio)
        return float(log_det + (self._n - self._p) * np.log(max(rss, 1e-300)))

    def deviance(self, sd_ratio: float, sd: float) -> float:
        """Return −2 log REML at (√ratio, residual SD), up to a constant."""
        _, rss, log_det = self.solve(sd_ratio**2)
        return float(log_det + (self._n - self._p) * 2 * np.log(sd) + rss / sd**2)

    def covariance(self, ratio: float, residual: float) -> Array:
        """Return the covariance of β, (p, p)."""
        weight = ratio / (1 + ratio * self._sizes)
        S = self._sums[:, :-1]
        XX = self._cross[:-1, :-1] - S.T @ (weight[:, None] * S)
        inverse: Array = np.asarray(np.linalg.inv(XX) * residual, dtype=np.float64)
        return inverse

    def best_ratio(self) -> float:
        """Return the variance ratio of the REML estimate: a grid on its logarithm, then golden
        section; zero when nothing beats it.
        """
        grid = np.linspace(-14.0, MAX_LOG_RATIO, 52)
        values = [self.profile(float(np.exp(v))) for v in grid]
        best = int(np.argmin(values))
        low, high = float(grid[max(0, best - 1)]), float(grid[min(len(grid) - 1, best + 1)])
        ratio = float(np.exp(minimum(lambda v: self.profile(float(np.exp(v))), low, high)))
        return 0.0 if self.profile(0.0) <= self.profile(ratio) + 1e-9 else ratio


def minimum(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the place of the minimum in [low, high] by golden section, to 1e-8."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    fa, fb = function(a), function(b)
    while high - low > 1e-8:
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - _GOLDEN * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + _GOLDEN * (high - low)
            fb = function(b)
    return (low + high) / 2
