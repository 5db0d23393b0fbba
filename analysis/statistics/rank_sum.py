"""Mann-Whitney's U of two independent groups: exact without ties, normal."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from analysis.statistics.errors import ConstantResponse, StatisticsError, UnknownMethod
from analysis.statistics.inputs import is_constant, sample
from analysis.statistics.ranks import average_ranks, tie_sizes
from analysis.statistics.results import (
    Array,
    Effect,
    Interval,
    Provenance,
    Result,
    Row,
    number,
    p_text,
)

RankSumMethod: TypeAlias = Literal["auto", "exact", "normal"]


@dataclass(frozen=True)
class RankSum(Result):
    """Outcome of the Mann-Whitney test; `U` counts pairs where the first group is larger."""

    U: float
    z: float
    p: float
    n_1: int
    n_2: int
    has_ties: bool
    method: str
    effect: Effect
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return (
            f"U = {number(self.U, 1)}, z = {number(self.z)}, {p_text(self.p)} ({self.method}), "
            f"{self.effect}, n = {self.n_1} and {self.n_2}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        numbers = {"U": self.U, "z": self.z, "p": self.p}
        return {**numbers, **self.effect.row(), **self.provenance.row()}


def mann_whitney(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    method: RankSumMethod = "auto",
    continuity: bool = False,
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
) -> RankSum:
    """Test whether values of one group tend to be larger.

    "auto" is exact for groups below 50 without ties, else normal; "exact" refuses ties. The
    effect is the rank-biserial correlation 2U/(n1·n2) − 1 with a Fisher z interval.
    """
    if method not in get_args(RankSumMethod):
        raise UnknownMethod(
            f"no method {method!r}; use one of {', '.join(get_args(RankSumMethod))}"
        )
    first, second = (sample(v, name=n, vary=False) for v, n in zip((x, y), names, strict=True))
    every = np.concatenate((first, second))
    if is_constant(every):
        raise ConstantResponse(f"{names[0]} and {names[1]} hold one and the same value throughout")
    m, n = int(first.size), int(second.size)
    N = m + n
    ties = tie_sizes(every)
    has_ties = bool((ties > 1).any())
    U = float(average_ranks(every)[:m].sum() - m * (m + 1) / 2)
    variance = m * n / 12 * (N + 1 - (ties**3 - ties).sum() / (N * (N - 1)))
    off = U - m * n / 2
    z = float(off / np.sqrt(variance))
    if method == "exact" and has_ties:
        raise StatisticsError("the exact rank-sum test needs untied values; use method='normal'")
    if method == "exact" or (method == "auto" and not has_ties and max(m, n) < 50):
        label, p = "exact", _exact_p(U, m, n)
    else:
        label = "normal, continuity-corrected" if continuity else "normal"
        corrected = off - np.sign(off) * 0.5 if continuity else off
        p = float(min(1.0, 2 * special.ndtr(-abs(corrected) / np.sqrt(variance))))
    value = 2 * U / (m * n) - 1
    return RankSum(
        U, z, p, m, n, has_ties, label,
        Effect("r_rb", value, _interval(value, m, n, level)),
        Provenance("Mann-Whitney", N, error_term=f"p {label}", notes=(f"groups of {m} and {n}",)),
    )  # fmt: skip


def _interval(value: float, m: int, n: int, level: float) -> Interval:
    half_step = 1.0 / (m * n)
    z = np.arctanh(np.clip(value, -1 + half_step, 1 - half_step))
    reach = float(special.ndtri(0.5 + level / 2)) * np.sqrt((m + n + 1) / (3 * m * n))
    low, high = float(np.tanh(z - reach)), float(np.tanh(z + reach))
    return Interval(min(low, value), max(high, value), level)


def _exact_p(U: float, m: int, n: int) -> float:
    """Return twice the smaller tail of U over all arrangements of untied values."""
    rows: list[Array] = [np.ones(1) for _ in range(n + 1)]  # P(U) of 0 against 0..n values
    for i in range(1, m + 1):
        current = [np.ones(1)]
        for j in range(1, n + 1):  # the largest value is one of the i, or one of the j
            mass = np.zeros(i * j + 1)
            mass[j:] = rows[j] * (i / (i + j))
            mass[: i * (j - 1) + 1] += current[j - 1] * (j / (i + j))
            current.append(mass)
        rows = current
    mass = rows[n]
    place = round(U)
    return float(min(1.0, 2 * min(mass[: place + 1].sum(), mass[place:].sum())))
