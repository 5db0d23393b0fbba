"""Sphericity at the edges of numbers: nothing ends in an error of arithmetic."""

import math

import numpy as np
import pytest

from visavis.analysis.statistics.anova import rm_anova
from visavis.analysis.statistics.sphericity import sphericity


def contrasts_with(variances: list[float], n: int = 60) -> np.ndarray:
    """Return scores (n, q) whose covariance has these eigenvalues."""
    q = len(variances)
    scores = np.linalg.qr(np.random.default_rng(2).normal(size=(n, q)))[0]
    return scores * np.sqrt(np.array(variances) * (n - 1))


@pytest.mark.parametrize("variances", [[1.0, 1.0], [3.0, 2.0, 1.0]])
def test_epsilon_is_that_of_the_eigenvalues(variances: list[float]) -> None:
    result = sphericity(contrasts_with(variances), 59, 4.0, len(variances), n_cells=6)
    total, squares = sum(variances), sum(v * v for v in variances)
    assert pytest.approx(total**2 / (len(variances) * squares)) == result.gg


def test_w_that_rounds_to_nothing_has_p_zero() -> None:
    variances = [1.0, *[2e-12] * 39]
    result = sphericity(contrasts_with(variances), 59, 4.0, 40, n_cells=41)
    assert result.W == 0.0
    assert (0.0, 0.0) == (result.p, result.p_r)


def test_the_size_of_errors_changes_nothing() -> None:
    result = sphericity(contrasts_with([1e-200, 3e-200]), 59, 4.0, 2, n_cells=6)
    expected = sphericity(contrasts_with([1.0, 3.0]), 59, 4.0, 2, n_cells=6)
    assert pytest.approx(expected.gg) == result.gg
    assert pytest.approx(expected.W) == result.W


def test_errors_of_zero_have_no_epsilon() -> None:
    result = sphericity(np.zeros((60, 2)), 59, 4.0, 2, n_cells=6)
    assert math.isnan(result.gg)
    assert result.W is None


@pytest.mark.parametrize("factor", [1e-90, 1e-50, 1e50])
def test_the_unit_of_a_response_changes_nothing(factor: float) -> None:
    rng = np.random.default_rng(4)
    n, k = 12, 3
    y = rng.normal(size=(n, k)) + np.arange(k)
    columns = {"who": np.repeat(np.arange(n), k), "what": np.tile(list("abc"), n)}
    plain, scaled = (
        rm_anova({**columns, "y": (u * y).ravel()}, "y", subject="who", within=("what",))
        for u in (1.0, factor)
    )
    for one, other in zip(plain.effects, scaled.effects, strict=True):
        assert pytest.approx((one.F, one.p_used)) == (other.F, other.p_used)
        assert pytest.approx(one.eta.interval.low) == other.eta.interval.low
        assert pytest.approx(one.eta.interval.high) == other.eta.interval.high
