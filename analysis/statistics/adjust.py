"""Adjust p values and thresholds for the number of tests."""

from collections.abc import Mapping
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import StatisticsError, UnknownMethod
from visavis.analysis.statistics.results import Array

Adjustment: TypeAlias = Literal["none", "bonferroni", "holm", "bh"]

ADJUSTMENT_NAME: Mapping[str, str] = {
    "none": "none",
    "bonferroni": "Bonferroni",
    "holm": "Holm",
    "bh": "Benjamini-Hochberg",
}
"""Name of an adjustment in text."""


def adjust_p(p: npt.ArrayLike, method: Adjustment = "holm", *, n_tests: int | None = None) -> Array:
    """Return adjusted p values in the order given, shape (m,).

    `n_tests` is the size of the family when it is larger than the values at hand. "bh" is
    Benjamini and Hochberg (1995), "holm" Holm (1979). An undefined p raises `StatisticsError`.
    """
    values = np.atleast_1d(np.asarray(p, dtype=np.float64))
    m = values.size if n_tests is None else n_tests
    if values.ndim != 1 or np.isnan(values).any() or ((values < 0) | (values > 1)).any():
        raise StatisticsError(f"p values must be numbers from 0 to 1 in one list, got {values!r}")
    if m < values.size:
        raise StatisticsError(f"{values.size} p values cannot come from a family of {m} tests")
    if method == "none":
        return values.copy()
    if method == "bonferroni":
        return np.minimum(1.0, values * m)
    order = np.argsort(values, kind="stable")
    rising = values[order]
    place = np.arange(values.size)
    if method == "holm":
        monotone = np.maximum.accumulate(rising * (m - place))
    elif method == "bh":
        monotone = np.minimum.accumulate((rising * m / (place + 1))[::-1])[::-1]
    else:
        raise UnknownMethod(
            f"no adjustment {method!r}; use one of {', '.join(get_args(Adjustment))}"
        )
    in_given_order = np.empty_like(values)
    in_given_order[order] = np.minimum(1.0, monotone)
    return in_given_order


def bonferroni_thresholds(alpha: float, n_tests: int) -> tuple[float, float, float]:
    """Return the thresholds of one, two and three stars: alpha, alpha/5 and alpha/50 over n.

    With alpha .05 these are .05, .01 and .001 divided by the number of tests.
    """
    if n_tests < 1:
        raise StatisticsError(f"a family has at least one test, got {n_tests}")
    return alpha / n_tests, alpha / 5 / n_tests, alpha / 50 / n_tests


def stars(p: float, *, alpha: float = 0.05, n_tests: int = 1) -> str:
    """Return '', '*', '**' or '***' after Bonferroni over `n_tests`."""
    return "*" * sum(p < t for t in bonferroni_thresholds(alpha, n_tests))
