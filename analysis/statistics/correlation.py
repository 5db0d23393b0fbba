"""Correlate two columns: Spearman with exact small-sample p, Pearson."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.effects import jackknife_error
from visavis.analysis.statistics.errors import ConstantResponse, StatisticsError, UnknownMethod
from visavis.analysis.statistics.inputs import is_constant, paired
from visavis.analysis.statistics.ranks import JACKKNIFE_UP_TO, average_ranks, ranks_without_each
from visavis.analysis.statistics.results import (
    MINUS,
    Array,
    Interval,
    Provenance,
    Result,
    Row,
    p_text,
    percent,
)
from visavis.analysis.statistics.t_tests import two_sided_t

SpearmanMethod: TypeAlias = Literal["auto", "exact", "t", "edgeworth"]

PERMUTED_UP_TO = 9
Z_LIMIT = 0.9999
"""Correlation at which the z of a jackknife sample is cut off."""


@dataclass(frozen=True)
class Correlation(Result):
    """A correlation with its two-sided p; `interval` is on Fisher's z, None below four pairs.

    The interval is wider than the textbook's where the pairs at hand say so, see `_interval`.
    """

    symbol: str
    r: float
    p: float
    n: int
    has_ties: bool
    method: str
    interval: Interval | None
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        text = f"{self.symbol}({self.n - 2}) = {_r_text(self.r)}, {p_text(self.p)} ({self.method})"
        if self.interval is None:
            return text
        low, high = _r_text(self.interval.low), _r_text(self.interval.high)
        return f"{text}, {percent(self.interval.level)} CI [{low}, {high}], n = {self.n}"

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "r": self.r,
            "p": self.p,
            "ci_low": None if self.interval is None else self.interval.low,
            "ci_high": None if self.interval is None else self.interval.high,
            **self.provenance.row(),
        }


def spearman(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    method: SpearmanMethod = "auto",
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
) -> Correlation:
    """Correlate ranks.

    p: "exact" counts all orders (n ≤ 9, ties allowed), "t" uses t with n − 2 df, "auto" takes
    exact where it can. "edgeworth" is the series of Best and Roberts (AS 89, 1975) that R prints
    as exact for n > 9. The interval uses the standard error of Bonett and Wright (2000).
    """
    if method not in get_args(SpearmanMethod):
        raise UnknownMethod(
            f"no method {method!r}; use one of {', '.join(get_args(SpearmanMethod))}"
        )
    first, second = _varying(x, y, names)
    a, b = average_ranks(first), average_ranks(second)
    n = int(a.size)
    rho = _pearson_r(a, b)
    has_ties = np.unique(a).size < n or np.unique(b).size < n
    if method == "auto":
        method = "exact" if n <= PERMUTED_UP_TO else "t"
    if method == "exact":
        if n > PERMUTED_UP_TO:
            raise StatisticsError(
                f"{n} pairs have too many orders to count; use method 't' above {PERMUTED_UP_TO}"
            )
        p = _permutation_p(a, b)
    elif method == "edgeworth":
        p = _edgeworth_p(a, b)
    else:
        p = spearman_p(rho, n)
    return Correlation(
        "rs",
        rho,
        p,
        n,
        has_ties,
        method,
        _interval(rho, n, np.sqrt(1 + rho**2 / 2), _without_each(a, b, are_ranks=True), level),
        Provenance("Spearman correlation", n, unit="pairs", error_term=f"p {method}"),
    )


def spearman_p(rho: float, n: int) -> float:
    """Return the two-sided p of a Spearman correlation by t with n − 2 df."""
    return two_sided_t(_t_of_r(rho, n), n - 2)


def pearson(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
) -> Correlation:
    """Correlate two columns linearly; interval on Fisher's z."""
    first, second = _varying(x, y, names)
    n = int(first.size)
    r = _pearson_r(first, second)
    return Correlation(
        "r",
        r,
        two_sided_t(_t_of_r(r, n), n - 2),
        n,
        False,
        "t",
        _interval(r, n, 1.0, _without_each(first, second), level),
        Provenance("Pearson correlation", n, unit="pairs", error_term="p t"),
    )


def _varying(x: npt.ArrayLike, y: npt.ArrayLike, names: tuple[str, str]) -> tuple[Array, Array]:
    first, second = paired(x, y, names=names)
    for column, name in ((first, names[0]), (second, names[1])):
        if is_constant(column):
            raise ConstantResponse(
                f"{name} is {column[0]:g} in all {column.size} rows; it correlates with nothing"
            )
    return first, second


def _pearson_r(x: Array, y: Array) -> float:
    a, b = x - x.mean(), y - y.mean()
    return float(np.clip((a @ b) / np.sqrt((a @ a) * (b @ b)), -1.0, 1.0))


def _t_of_r(r: float, n: int) -> float:
    if abs(r) >= 1:
        return float(np.copysign(np.inf, r))
    return float(r * np.sqrt((n - 2) / (1 - r * r)))


def _without_each(a: Array, b: Array, *, are_ranks: bool = False) -> Array:
    """Return the correlation without each pair, (n,); ranks are counted anew.

    Empty above `JACKKNIFE_UP_TO` pairs.
    """
    n = a.size
    if n > JACKKNIFE_UP_TO:
        return np.empty(0)
    stays = 1 - np.eye(n)
    columns = []
    for values in (a, b):
        samples = ranks_without_each(values) if are_ranks else np.tile(values, (n, 1))
        samples = (samples - (samples * stays).sum(axis=1, keepdims=True) / (n - 1)) * stays
        columns.append(samples)
    x, y = columns
    with np.errstate(invalid="ignore", divide="ignore"):
        r: Array = (x * y).sum(axis=1) / np.sqrt((x**2).sum(axis=1) * (y**2).sum(axis=1))
    return r[np.isfinite(r)]


def _interval(
    r: float, n: int, factor: float, without_each: Array, level: float
) -> Interval | None:
    """Return the interval on Fisher's z, by t with n − 2 df.

    Its error is that of normal pairs, `factor` / √(n − 3) (for ranks Bonett and Wright's), or the
    jackknife's over pairs where that is larger (twice as large at most): skewed and long-tailed
    pairs, and ranks of them, scatter more than the textbook's.
    """
    if n < 4:
        return None
    if abs(r) >= 1:
        return Interval(r, r, level)
    error = float(factor) / np.sqrt(n - 3)
    z_of_each = np.arctanh(np.clip(without_each, -Z_LIMIT, Z_LIMIT))
    own = jackknife_error(z_of_each)
    reach = float(special.stdtrit(n - 2, 0.5 + level / 2)) * max(error, min(own, 2 * error))
    z = np.arctanh(r)
    return Interval(float(np.tanh(z - reach)), float(np.tanh(z + reach)), level)


@lru_cache(maxsize=PERMUTED_UP_TO)
def _orders(n: int) -> npt.NDArray[np.int8]:
    return np.array(list(permutations(range(n))), dtype=np.int8)


def _permutation_p(a: Array, b: Array) -> float:
    a_about_mean = a - a.mean()
    products = (b - b.mean())[_orders(a.size)] @ a_about_mean
    observed = float((b - b.mean()) @ a_about_mean)
    return float(np.mean(np.abs(products) >= abs(observed) - 1e-9))


def _edgeworth_p(a: Array, b: Array) -> float:
    """Return twice the smaller tail of S = Σ(rank difference)², Best and Roberts (1975)."""
    n = a.size
    s = float(np.rint(((a - b) ** 2).sum()))
    upper = s > (n**3 - n) / 6
    even = s if upper else s + 2  # P(S < s + 2) is one minus the upper tail at s + 2
    x = (6.0 * (even - 1) / n / (n**2 - 1.0) - 1.0) * np.sqrt(n - 1.0)
    y, i = x * x, 1.0 / n
    inner = 0.0072 - 0.0831 * i + y * i * (0.0131 - 4.6e-4 * y)
    u = x * i * (
        0.2274
        + i * (0.2531 + 0.1745 * i)
        + y * (-0.0758 + i * (0.1033 + 0.3932 * i) - y * i * (0.0879 + 0.0151 * i - y * inner))
    )  # fmt: skip
    tail = u / np.exp(y / 2) + special.ndtr(-x)
    return float(np.clip(2 * (tail if upper else 1 - tail), 0.0, 1.0))


def _r_text(value: float) -> str:
    """Format a correlation without the leading zero."""
    return f"{value:.2f}".replace("-", MINUS).replace("0.", ".")
