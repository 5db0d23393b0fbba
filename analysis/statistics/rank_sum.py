"""Mann-Whitney's U of two independent groups: exact, also given ties, or normal."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import ConstantResponse, UnknownMethod
from visavis.analysis.statistics.inputs import is_constant, sample
from visavis.analysis.statistics.rank_biserial import groups_rank_biserial
from visavis.analysis.statistics.ranks import average_ranks, tie_sizes
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    number,
    p_text,
)

RankSumMethod: TypeAlias = Literal["auto", "exact", "normal"]
EXACT_BELOW = 50
"""Size of a group from which "auto" takes the normal approximation."""


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

    "exact" counts all ways to deal the ranks at hand, ties included, to the groups; "auto" does so
    for groups below 50 and takes the normal approximation above. The effect is the rank-biserial
    correlation 2U/(n1·n2) − 1 with a score interval.
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
    ranks = average_ranks(every)
    U = float(ranks[:m].sum() - m * (m + 1) / 2)
    variance = m * n / 12 * (N + 1 - (ties**3 - ties).sum() / (N * (N - 1)))
    off = U - m * n / 2
    z = float(off / np.sqrt(variance))
    if method == "exact" or (method == "auto" and max(m, n) < EXACT_BELOW):
        label = "exact, given the ties" if has_ties else "exact"
        p = _exact_p(ranks, m)
    else:
        label = "normal, continuity-corrected" if continuity else "normal"
        continuous = off - np.sign(off) * 0.5 if continuity else off
        p = float(min(1.0, 2 * special.ndtr(-abs(continuous) / np.sqrt(variance))))
    return RankSum(
        U,
        z,
        p,
        m,
        n,
        has_ties,
        label,
        groups_rank_biserial(first, second, level=level),
        Provenance("Mann-Whitney", N, error_term=f"p {label}", notes=(f"groups of {m} and {n}",)),
    )


def _exact_p(ranks: Array, m: int) -> float:
    """Return the share of all choices of m ranks whose sum is at least as far from its mean.

    Counts of subsets by size and sum of doubled ranks, which are whole numbers.
    """
    double_ranks = np.round(2 * ranks).astype(np.intp)
    smaller = min(m, ranks.size - m)  # both groups' sums lie equally far from their means
    counts = np.zeros((smaller + 1, int(np.sort(double_ranks)[::-1][:smaller].sum()) + 1))
    counts[0, 0] = 1.0
    for rank in double_ranks:
        counts[1:, rank:] += counts[:-1, : counts.shape[1] - rank].copy()
    of_size = counts[smaller]
    mean = smaller * double_ranks.sum() / double_ranks.size
    part = double_ranks[:m] if smaller == m else double_ranks[m:]
    away = np.abs(np.arange(of_size.size) - mean)
    is_as_extreme = away >= abs(part.sum() - mean) - 1e-9
    return float(min(1.0, of_size[is_as_extreme].sum() / of_size.sum()))
