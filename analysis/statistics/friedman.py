"""Friedman's test with Kendall's W, and signed-rank post-hocs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME, Adjustment, adjust_p
from visavis.analysis.statistics.design import Design, Frame, Levels, read_design
from visavis.analysis.statistics.effects import rank_effect
from visavis.analysis.statistics.errors import ConstantResponse, TooFewLevels
from visavis.analysis.statistics.ranks import average_ranks, tie_sizes
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    f_text,
    number,
    p_text,
)
from visavis.analysis.statistics.signed_rank import (
    SignedRank,
    SignedRankMethod,
    ZeroRule,
    wilcoxon_signed_rank,
)


@dataclass(frozen=True)
class Friedman(Result):
    """Outcome of Friedman's test, corrected for ties; F and p_f are Iman and Davenport's."""

    chi2: float
    df: int
    p: float
    effect: Effect
    F: float
    F_df: tuple[int, int]
    p_f: float
    levels: tuple[str, ...]
    mean_ranks: tuple[float, ...]
    provenance: Provenance

    @property
    def kendall_w(self) -> float:
        """Kendall's coefficient of concordance."""
        return self.effect.value

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return (
            f"χ²({self.df}) = {number(self.chi2)}, {p_text(self.p)}, {self.effect}, "
            f"n = {self.provenance.n}{self._by_f()}"
        )

    def _by_f(self) -> str:
        """Return Iman and Davenport's test; nothing where all ranks agree and F has no bound."""
        if not math.isfinite(self.F):
            return ""
        return f" (Iman-Davenport {f_text(self.F, *self.F_df)}, {p_text(self.p_f)})"

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "chi2": self.chi2,
            "df": self.df,
            "p": self.p,
            "kendall_W": self.kendall_w,
            "iman_davenport_F": self.F,
            "iman_davenport_p": self.p_f,
            **self.effect.row(),
            **self.provenance.row(),
        }


@dataclass(frozen=True)
class SignedRankPair(Result):
    """One signed-rank comparison of a family."""

    level_1: str
    level_2: str
    test: SignedRank
    p_adjusted: float
    adjustment: Adjustment

    def sentence(self) -> str:
        """Return the comparison as an APA sentence."""
        how = ADJUSTMENT_NAME[self.adjustment]
        return (
            f"{self.level_1} − {self.level_2}: {self.test.sentence()}, "
            f"{p_text(self.p_adjusted, 'adjusted p')} ({how})"
        )

    def row(self) -> Row:
        """Return the comparison as one flat table row."""
        return {
            "level_1": self.level_1,
            "level_2": self.level_2,
            **self.test.row(),
            "p_adjusted": self.p_adjusted,
            "adjustment": self.adjustment,
        }


def friedman(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: str,
    levels: Sequence[object] | None = None,
) -> Friedman:
    """Test whether three or more conditions of the same subjects differ in rank."""
    design = _design(frame, dv, subject, within, levels)
    table = design.table(design.y)
    n, k = table.shape
    if k < 3:
        raise TooFewLevels(f"{within} has two levels; use wilcoxon_signed_rank")
    ranks = np.array([average_ranks(row) for row in table])
    ties = sum(float((t**3 - t).sum()) for t in map(tie_sizes, table))
    spread = n * k * (k + 1) - ties / (k - 1)
    if spread <= 0:
        raise ConstantResponse(f"{dv} is the same in all conditions of every subject")
    off = ranks.sum(axis=0) - n * (k + 1) / 2
    chi2 = float(12 * (off**2).sum() / spread)
    W = chi2 / (n * (k - 1))
    df = (k - 1, (k - 1) * (n - 1))
    F = float("inf") if 1 - W < 1e-12 else (n - 1) * chi2 / (n * (k - 1) - chi2)
    return Friedman(
        chi2,
        k - 1,
        float(special.chdtrc(k - 1, chi2)),
        rank_effect("Kendall's W", W, df, _without_each(ranks)),
        F,
        df,
        float(special.fdtrc(*df, F)),
        tuple(str(v) for v in design.factors[0].levels),
        tuple(ranks.mean(axis=0).tolist()),
        Provenance("Friedman", n, error_term="ranks within subjects, corrected for ties"),
    )


def _without_each(ranks: Array) -> Array:
    """Return Kendall's W without each of the people in rows, (n,)."""
    n, k = ranks.shape
    off = ranks - (k + 1) / 2
    of_person = (off**2).sum(axis=1)
    of_conditions = ((off.sum(axis=0) - off) ** 2).sum(axis=1) / (n - 1)
    total = of_person.sum() - of_person
    return np.asarray(of_conditions / np.where(total > 0, total, np.inf), dtype=np.float64)


def posthoc_signed_rank(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: str,
    levels: Sequence[object] | None = None,
    adjust: Adjustment = "holm",
    method: SignedRankMethod = "auto",
    zeros: ZeroRule = "wilcoxon",
    continuity: bool = False,
) -> tuple[SignedRankPair, ...]:
    """Compare all pairs of conditions by Wilcoxon's signed-rank test.

    Of conditions that are equal in everybody p is 1.
    """
    design = _design(frame, dv, subject, within, levels)
    table: Array = design.table(design.y)
    names = [str(v) for v in design.factors[0].levels]
    pairs = list(combinations(range(len(names)), 2))
    tests = [
        wilcoxon_signed_rank(
            table[:, i],
            table[:, j],
            method=method,
            zeros=zeros,
            continuity=continuity,
            names=(names[i], names[j]),
            allow_equal=True,
        )
        for i, j in pairs
    ]
    all_p_adjusted = adjust_p([t.p for t in tests], adjust).tolist()
    return tuple(
        SignedRankPair(names[i], names[j], test, p, adjust)
        for (i, j), test, p in zip(pairs, tests, all_p_adjusted, strict=True)
    )


def _design(
    frame: Frame, dv: str, subject: str, within: str, levels: Sequence[object] | None
) -> Design:
    order: Levels | None = None if levels is None else {within: levels}
    return read_design(frame, dv, subject=subject, within=(within,), levels=order)
