"""Weights are those of the example at an example, and always shares of one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.errors import DataError
from visavis.stimuli.motion.synthesis.style_weights import b_spline, fit_weights


@given(st.integers(0, 2**31), st.integers(6, 20), st.integers(1, 4))
def test_at_an_example_its_own_weight_is_one(seed: int, n: int, d: int) -> None:
    fitted = fit_weights(np.random.default_rng(seed).uniform(size=(n, d)))
    own = np.eye(n)
    tolerance = 1e-12 * max(fitted.condition, 100.0)
    assert np.abs(fitted.raw(fitted.examples) - own).max() < tolerance
    points = np.random.default_rng(seed + 1).uniform(size=(30, d))
    weights = fitted.at(points)
    assert np.allclose(1.0, weights.sum(axis=-1))
    assert (weights >= 0).all()


def test_spline_is_as_defined_and_even() -> None:
    assert [2 / 3, 1 / 6, 0.0, 0.0] == pytest.approx(b_spline(np.array([0, 1, 2, 7])).tolist())
    x = np.linspace(-3, 3, 61)
    assert np.allclose(b_spline(x), b_spline(-x))


@pytest.mark.parametrize(("n", "is_spare"), [(11, False), (10, True)])
def test_fewer_than_four_examples_beyond_the_dimensions_are_told(n: int, is_spare: bool) -> None:
    examples = np.random.default_rng(0).uniform(size=(n, 7))
    assert is_spare == fit_weights(examples).is_spare


def test_examples_that_cannot_be_fitted_are_named() -> None:
    with pytest.raises(DataError, match="example 2"):
        fit_weights(np.array([[0.0], [1.0], [1.0]]))
    with pytest.raises(DataError, match="at least two"):
        fit_weights(np.array([[0.0]]))
    with pytest.raises(DataError, match="finite"):
        fit_weights(np.array([[0.0], [np.nan]]))
    with pytest.raises(DataError, match="not a number"):
        fit_weights(np.array([[0.0], [1.0], [5.0]])).at(np.full((1, 1), np.nan))


def test_where_no_example_has_weight_the_nearest_has_all_of_it() -> None:
    fitted = fit_weights(np.array([[0.0], [1.0], [2.0], [5.0], [9.0]]))
    none = replace(fitted, linear=np.full_like(fitted.linear, -1.0))
    assert none.at(np.array([[4.0], [8.0]])).tolist() == np.eye(5)[[3, 4]].tolist()
