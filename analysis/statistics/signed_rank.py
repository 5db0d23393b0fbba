"""Wilcoxon's signed-rank test: exact with ties and zeros, normal, Pratt."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import ConstantResponse, UnknownMethod
from visavis.analysis.statistics.inputs import differences, paired
from visavis.analysis.statistics.rank_biserial import matched_rank_biserial
from visavis.analysis.statistics.ranks import average_ranks
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    number,
    p_text,
)

SignedRankMethod: TypeAlias = Literal["auto", "exact", "normal", "r"]
ZeroRule: TypeAlias = Literal["wilcoxon", "pratt"]

EXACT_UP_TO = 100
"""Pairs up to which "auto" is exact; beyond, the normal approximation is good to three digits."""


@dataclass(frozen=True)
class SignedRank(Result):
    """Outcome of Wilcoxon's signed-rank test of x − y.

    `V` is the sum of the ranks of the positive differences, `T` the smaller of the two sums, `z`
    the standardised V without continuity correction. `method` says which p this is: "exact"
    (conditional on the ties), "normal" or "normal, continuity-corrected". `r_pairs` and
    `r_nonzero` are |z|/√N with all pairs or the non-zero ones.
    """

    V: float
    T: float
    z: float
    p: float
    n_pairs: int
    n_nonzero: int
    has_ties: bool
    method: str
    zeros: ZeroRule
    effect: Effect
    r_pairs: float
    r_nonzero: float
    median_difference: float
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        n_zero = self.n_pairs - self.n_nonzero
        zeros = f" ({n_zero} zero)" if n_zero else ""
        return (
            f"V = {number(self.V, 1)}, z = {number(self.z)}, {p_text(self.p)} ({self.method}), "
            f"{self.effect}, n = {self.n_pairs}{zeros}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "V": self.V,
            "T": self.T,
            "z": self.z,
            "p": self.p,
            "n_nonzero": self.n_nonzero,
            "estimate": self.median_difference,
            **self.effect.row(),
            **self.provenance.row(),
        }


def wilcoxon_signed_rank(
    x: npt.ArrayLike,
    y: npt.ArrayLike | None = None,
    *,
    method: SignedRankMethod = "auto",
    zeros: ZeroRule = "wilcoxon",
    continuity: bool = False,
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
    allow_equal: bool = False,
) -> SignedRank:
    """Test whether differences x − y are symmetric about zero; x alone may be the differences.

    "auto" is exact up to 100 non-zero pairs, then normal. "exact" is conditional on the ties
    present; "r" is what R's `wilcox.test` does by itself: exact below 50 pairs without ties or
    zeros, otherwise normal with continuity correction. `zeros` "wilcoxon" drops zero differences
    before ranking, "pratt" after it. Samples that are equal throughout are refused, or with
    `allow_equal`, for one of several comparisons, have p = 1 and an effect of 0 without interval.
    """
    first, second = paired(x, np.zeros(len(np.asarray(x))) if y is None else y, names=names)
    d = differences(first, second)
    if not d.any() and not allow_equal:
        raise ConstantResponse(
            f"{names[0]} and {names[1]} are equal in all {d.size} pairs; there is nothing to rank"
        )
    signs, ranks = _signed_ranks(d, zeros)
    positive, negative = float(ranks[signs > 0].sum()), float(ranks[signs < 0].sum())
    has_ties = bool(np.unique(np.abs(d[d != 0])).size < np.count_nonzero(d))
    exact, with_continuity, label = _decide(method, len(ranks), d.size, has_ties, continuity)
    z = _z(positive, ranks, with_continuity=False)
    if exact:
        p = _exact_p(positive, ranks)
    else:
        p = float(
            min(1.0, 2 * special.ndtr(-abs(_z(positive, ranks, with_continuity=with_continuity))))
        )
    return SignedRank(
        V=positive,
        T=min(positive, negative),
        z=z,
        p=p,
        n_pairs=int(d.size),
        n_nonzero=len(ranks),
        has_ties=has_ties,
        method=label,
        zeros=zeros,
        effect=signed_rank_effect(d, level=level),
        r_pairs=abs(z) / float(np.sqrt(d.size)),
        r_nonzero=abs(z) / float(np.sqrt(max(len(ranks), 1))),
        median_difference=float(np.median(d)),
        provenance=Provenance(
            "Wilcoxon signed-rank",
            int(d.size),
            error_term=f"p {label}",
            dropped=(f"{d.size - len(ranks)} zero differences",) if len(ranks) < d.size else (),
            notes=(f"zero differences: {zeros}",) if len(ranks) < d.size else (),
        ),
    )


def signed_rank_effect(d: Array, *, level: float = 0.95) -> Effect:
    """Return the matched rank-biserial correlation of differences; 0 where all of them are."""
    return matched_rank_biserial(d[d != 0], level=level) if d.any() else Effect("r_rb", 0.0)


def _signed_ranks(d: Array, zeros: ZeroRule) -> tuple[Array, Array]:
    """Return signs and ranks of the non-zero differences."""
    if zeros not in get_args(ZeroRule):
        raise UnknownMethod(f"no zero rule {zeros!r}; use 'wilcoxon' or 'pratt'")
    nonzero = d != 0
    if zeros == "pratt":
        return np.sign(d[nonzero]), average_ranks(np.abs(d))[nonzero]
    return np.sign(d[nonzero]), average_ranks(np.abs(d[nonzero]))


def _decide(
    method: SignedRankMethod, n_nonzero: int, n: int, has_ties: bool, continuity: bool
) -> tuple[bool, bool, str]:
    if method not in get_args(SignedRankMethod):
        raise UnknownMethod(
            f"no method {method!r}; use one of {', '.join(get_args(SignedRankMethod))}"
        )
    if method == "r":
        exact = n < 50 and not has_ties and n_nonzero == n
        continuity = True
    else:
        exact = method == "exact" or (method == "auto" and n_nonzero <= EXACT_UP_TO)
    if exact:
        return True, False, "exact"
    return False, continuity, "normal, continuity-corrected" if continuity else "normal"


def _z(positive: float, ranks: Array, *, with_continuity: bool) -> float:
    if ranks.size == 0:
        return 0.0
    off = positive - ranks.sum() / 2
    if with_continuity:
        off -= np.sign(off) * 0.5
    return float(off / np.sqrt((ranks**2).sum() / 4))


def _exact_p(positive: float, ranks: Array) -> float:
    """Return the two-sided p over all sign patterns, by adding one pair at a time.

    Ranks are doubled so that average ranks are whole numbers.
    """
    double_ranks = np.rint(2 * ranks).astype(np.int64)
    total = int(double_ranks.sum())
    mass = np.zeros(total + 1)
    mass[0] = 1.0
    largest_sum = 0
    for rank in double_ranks:
        before = mass[: largest_sum + 1].copy()
        mass[rank : largest_sum + rank + 1] += before
        mass[: largest_sum + rank + 1] /= 2
        largest_sum += int(rank)
    place = round(2 * positive)
    return float(min(1.0, 2 * min(mass[: place + 1].sum(), mass[place:].sum())))
