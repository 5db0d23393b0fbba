"""Between-subject designs: one-way ANOVA and its relatives, and their post-hocs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import special

from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME, Adjustment, adjust_p
from visavis.analysis.statistics.anova import between_anova
from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    contrast_family,
    pair_labels,
    pair_matrix,
)
from visavis.analysis.statistics.design import Frame, read_design
from visavis.analysis.statistics.effects import Tails, partial_eta_squared, rank_effect, tails_of
from visavis.analysis.statistics.errors import ConstantResponse
from visavis.analysis.statistics.inputs import AT_LEAST, is_constant
from visavis.analysis.statistics.marginal import posthoc
from visavis.analysis.statistics.rank_sum import mann_whitney
from visavis.analysis.statistics.ranks import (
    JACKKNIFE_UP_TO,
    average_ranks,
    ranks_without_each,
    tie_sizes,
)
from visavis.analysis.statistics.results import (
    MINUS,
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    f_text,
    number,
    p_text,
)
from visavis.analysis.statistics.t_tests import independent_t


@dataclass(frozen=True)
class GroupSummary:
    """Size, mean and standard deviation of each group."""

    levels: tuple[str, ...]
    ns: tuple[int, ...]
    means: tuple[float, ...]
    sds: tuple[float, ...]


@dataclass(frozen=True)
class OneWay(Result):
    """A one-way test between groups.

    `omega2` and `cohen_f` belong to the classic ANOVA and are None otherwise; so are the sums of
    squares.
    """

    F: float
    df1: float
    df2: float
    p: float
    groups: GroupSummary
    provenance: Provenance
    ss: float | None = None
    ss_error: float | None = None
    eta: Effect | None = None
    omega2: float | None = None
    cohen_f: float | None = None

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        effect = "" if self.eta is None else f", {self.eta}"
        return f"{self.provenance.test}: {f_text(self.F, self.df1, self.df2)}, {p_text(self.p)}" + (
            effect
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        effect = {} if self.eta is None else self.eta.row()
        numbers = {"F": self.F, "df1": self.df1, "df2": self.df2, "p": self.p}
        return {**numbers, **effect, **self.provenance.row()}


@dataclass(frozen=True)
class KruskalWallis(Result):
    """Outcome of the Kruskal-Wallis test, H corrected for ties; `effect` is epsilon squared."""

    H: float
    df: int
    p: float
    effect: Effect
    levels: tuple[str, ...]
    mean_ranks: tuple[float, ...]
    provenance: Provenance

    @property
    def epsilon2(self) -> float:
        """Epsilon squared, H over its greatest value."""
        return self.effect.value

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return f"H({self.df}) = {self.H:.2f}, {p_text(self.p)}, {self.effect}"

    def row(self) -> Row:
        """Return the result as one flat table row."""
        numbers = {"H": self.H, "df": self.df, "p": self.p, "epsilon2": self.epsilon2}
        return {**numbers, **self.effect.row(), **self.provenance.row()}


@dataclass(frozen=True)
class DunnPair(Result):
    """Two groups compared by their mean ranks among all groups; `estimate` is the difference."""

    level_1: str
    level_2: str
    estimate: float
    se: float
    z: float
    p: float
    p_adjusted: float
    adjustment: Adjustment
    effect: Effect | None = None
    """Rank-biserial correlation of the two groups alone."""

    def sentence(self) -> str:
        """Return the comparison as an APA sentence."""
        effect = "" if self.effect is None else f", {self.effect}"
        return (
            f"{self.level_1} {MINUS} {self.level_2}: mean ranks differ by {number(self.estimate)}, "
            f"z = {number(self.z)}, {p_text(self.p_adjusted, 'adjusted p')} "
            f"({ADJUSTMENT_NAME[self.adjustment]}){effect}"
        )

    def row(self) -> Row:
        """Return the comparison as one flat table row."""
        return {
            "level_1": self.level_1,
            "level_2": self.level_2,
            "estimate": self.estimate,
            "se": self.se,
            "z": self.z,
            "p": self.p,
            "p_adjusted": self.p_adjusted,
            "adjustment": self.adjustment,
            **({} if self.effect is None else self.effect.row()),
        }


@dataclass(frozen=True)
class GroupMeans:
    """Regression on one factor, first level as baseline, one entry per coefficient."""

    coefficients: tuple[str, ...]
    estimate: Array
    se: Array
    t: Array
    p: Array
    r2: float
    levels: tuple[str, ...]
    means: Array


def oneway_anova(
    frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None
) -> OneWay:
    """Test whether independent groups differ in their mean (equal variances)."""
    names, groups = _groups(frame, dv, factor, levels)
    N, k = sum(g.size for g in groups), len(groups)
    grand = float(np.concatenate(groups).mean())
    ss = float(sum(g.size * (g.mean() - grand) ** 2 for g in groups))
    ss_error = _within_ss(groups, dv)
    mse = ss_error / (N - k)
    F = ss / (k - 1) / mse
    eta2 = ss / (ss + ss_error)
    return OneWay(
        F=F,
        df1=k - 1,
        df2=N - k,
        p=float(special.fdtrc(k - 1, N - k, F)),
        groups=_summary_of_groups(names, groups),
        provenance=Provenance("One-way ANOVA", N, unit="rows", error_term="within groups"),
        ss=ss,
        ss_error=ss_error,
        eta=replace(partial_eta_squared(F, k - 1, N - k, tails=_tails(groups)), name="η²"),
        omega2=(ss - (k - 1) * mse) / (ss + ss_error + mse),
        cohen_f=float(np.sqrt(eta2 / (1 - eta2))),
    )


def welch_anova(
    frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None
) -> OneWay:
    """Test whether independent groups differ in their mean without equal variances (Welch 1951)."""
    names, groups = _groups(frame, dv, factor, levels)
    k = len(groups)
    for name, group in zip(names, groups, strict=True):
        if np.ptp(group) == 0:
            raise ConstantResponse(f"{dv} does not vary in the group {name}; Welch needs it to")
    weight = np.array([g.size / g.var(ddof=1) for g in groups])
    means = np.array([g.mean() for g in groups])
    centre = (weight * means).sum() / weight.sum()
    share = 1 - weight / weight.sum()
    tail = (share**2 / np.array([g.size - 1 for g in groups])).sum()
    F = (weight * (means - centre) ** 2).sum() / (k - 1)
    F /= 1 + 2 * (k - 2) / (k**2 - 1) * tail
    df2 = (k**2 - 1) / (3 * tail)
    return OneWay(
        F=float(F),
        df1=k - 1,
        df2=float(df2),
        p=float(special.fdtrc(k - 1, df2, F)),
        groups=_summary_of_groups(names, groups),
        provenance=Provenance(
            "Welch's ANOVA",
            sum(g.size for g in groups),
            unit="rows",
            error_term="separate variances",
        ),
        eta=partial_eta_squared(float(F), k - 1, float(df2), tails=_tails(groups, by_spread=True)),
    )


def _tails(groups: Sequence[Array], *, by_spread: bool = False) -> Tails:
    """Return the tails of groups around their means, each by its own spread where asked."""
    away = [(g - g.mean()) / (g.std() if by_spread else 1.0) for g in groups]
    return tails_of(np.concatenate(away))


def games_howell(
    frame: Frame,
    dv: str,
    *,
    factor: str,
    levels: Sequence[object] | None = None,
    adjust: ContrastAdjustment = "tukey",
) -> Contrasts:
    """Compare all pairs of groups by Welch's t (Games and Howell 1976 with Tukey's p)."""
    names, groups = _groups(frame, dv, factor, levels)
    L = pair_matrix(len(groups))
    shares = np.array([g.var(ddof=1) / g.size for g in groups])
    inside = np.abs(L)
    variance = inside @ shares
    if (variance <= 0).any():
        raise ConstantResponse(f"{dv} does not vary in two groups; Welch's t is not defined")
    dfs = variance**2 / (inside @ (shares**2 / np.array([g.size - 1 for g in groups])))
    return contrast_family(
        (factor,),
        pair_labels(names),
        L @ np.array([g.mean() for g in groups]),
        np.sqrt(variance),
        dfs,
        k=len(groups),
        adjustment=adjust,
        provenance=Provenance(
            "Games-Howell" if adjust == "tukey" else "pairwise Welch t",
            sum(g.size for g in groups),
            unit="rows",
            error_term="separate variances",
        ),
        effects=_differences(groups),
    )


def _differences(groups: Sequence[Array]) -> list[Effect | None]:
    """Return Cohen's d of every pair, each by its own two groups.

    None where neither varies, or where one has two people: the pair is compared all the same.
    """
    return [
        None
        if (is_constant(x) and is_constant(y)) or _is_small(x, y)
        else independent_t(x, y).effect
        for x, y in combinations(groups, 2)
    ]


def _is_small(x: Array, y: Array) -> bool:
    """Tell whether a group is too small for an effect size of two samples by themselves."""
    return min(x.size, y.size) < AT_LEAST


def _rank_difference(x: Array, y: Array) -> Effect | None:
    if is_constant(np.concatenate([x, y])) or _is_small(x, y):
        return None
    return mann_whitney(x, y, method="normal").effect


def dunn(
    frame: Frame,
    dv: str,
    *,
    factor: str,
    levels: Sequence[object] | None = None,
    adjust: Adjustment = "holm",
) -> tuple[DunnPair, ...]:
    """Compare all pairs of groups by mean ranks among all rows, corrected for ties (Dunn 1964)."""
    names, groups = _groups(frame, dv, factor, levels)
    every = np.concatenate(groups)
    N = every.size
    ranks = np.split(average_ranks(every), np.cumsum([g.size for g in groups])[:-1])
    ties = tie_sizes(every)
    spread = N * (N + 1) / 12 - float((ties**3 - ties).sum()) / (12 * (N - 1))
    pairs = list(combinations(range(len(groups)), 2))
    off = np.array([ranks[a].mean() - ranks[b].mean() for a, b in pairs])
    ses = np.sqrt([spread * (1 / ranks[a].size + 1 / ranks[b].size) for a, b in pairs])
    z = off / ses
    p = 2 * special.ndtr(-np.abs(z))
    p_adjusted = adjust_p(p, adjust)
    return tuple(
        DunnPair(
            names[a],
            names[b],
            float(off[i]),
            float(ses[i]),
            float(z[i]),
            float(p[i]),
            float(p_adjusted[i]),
            adjust,
            _rank_difference(groups[a], groups[b]),
        )
        for i, (a, b) in enumerate(pairs)
    )


def levene(frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None) -> OneWay:
    """Test equality of variances on distances from the group median (Brown-Forsythe)."""
    names, groups = _groups(frame, dv, factor, levels)
    distances = {
        "group": np.repeat(np.arange(len(groups)), [g.size for g in groups]),
        "distance": np.concatenate([np.abs(g - np.median(g)) for g in groups]),
    }
    test = oneway_anova(distances, "distance", factor="group")
    provenance = replace(test.provenance, test="Levene's test (median)")
    return replace(test, groups=_summary_of_groups(names, groups), provenance=provenance)


def kruskal_wallis(
    frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None
) -> KruskalWallis:
    """Test whether independent groups differ in rank, corrected for ties."""
    names, groups = _groups(frame, dv, factor, levels)
    every = np.concatenate(groups)
    N, k = every.size, len(groups)
    ranks = np.split(average_ranks(every), np.cumsum([g.size for g in groups])[:-1])
    H = 12 / (N * (N + 1)) * sum(r.sum() ** 2 / r.size for r in ranks) - 3 * (N + 1)
    ties = tie_sizes(every)
    H = float(H / (1 - (ties**3 - ties).sum() / (N**3 - N)))
    return KruskalWallis(
        H,
        k - 1,
        float(special.chdtrc(k - 1, H)),
        rank_effect("ε²", H / (N - 1), (k - 1, N - k), _without_each(ranks)),
        names,
        tuple(float(r.mean()) for r in ranks),
        Provenance("Kruskal-Wallis", N, unit="rows", error_term="ranks, corrected for ties"),
    )


def _without_each(ranks: Sequence[Array]) -> Array:
    """Return ε² without each row, (N,), ranks counted anew."""
    every = np.concatenate(ranks)
    if every.size > JACKKNIFE_UP_TO:
        return np.empty(0)
    group = np.repeat(np.eye(len(ranks)), [r.size for r in ranks], axis=0)
    stays = 1 - np.eye(every.size)
    anew = (ranks_without_each(every) - every.size / 2) * stays
    between = ((anew @ group) ** 2 / (stays @ group)).sum(axis=1)
    total = (anew**2).sum(axis=1)
    return np.asarray(between / np.where(total > 0, total, np.inf), dtype=np.float64)


def tukey_hsd(
    frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None
) -> Contrasts:
    """Compare all pairs of independent groups (Tukey; Tukey-Kramer when sizes differ).

    These are the contrasts of the one-way ANOVA, `posthoc(between_anova(…), factor)`.
    """
    order = None if levels is None else {factor: levels}
    table = between_anova(frame, dv, between=(factor,), levels=order)
    contrasts = posthoc(table, factor, adjust="tukey")
    return replace(contrasts, provenance=replace(contrasts.provenance, test="Tukey HSD"))


def group_means(
    frame: Frame, dv: str, *, factor: str, levels: Sequence[object] | None = None
) -> GroupMeans:
    """Regress on one factor with its first level as baseline."""
    names, groups = _groups(frame, dv, factor, levels)
    ns = np.array([g.size for g in groups])
    means = np.array([g.mean() for g in groups])
    df = int(ns.sum()) - len(groups)
    ss_error = _within_ss(groups, dv)
    mse = ss_error / df
    estimate = np.concatenate(([means[0]], means[1:] - means[0]))
    se = np.sqrt(mse * np.concatenate(([1 / ns[0]], 1 / ns[1:] + 1 / ns[0])))
    t = estimate / se
    every = np.concatenate(groups)
    r2 = 1 - ss_error / float(((every - every.mean()) ** 2).sum())
    return GroupMeans(
        ("(Intercept)", *names[1:]),
        estimate,
        se,
        t,
        2 * special.stdtr(df, -np.abs(t)),
        r2,
        names,
        means,
    )


def _groups(
    frame: Frame, dv: str, factor: str, levels: Sequence[object] | None
) -> tuple[tuple[str, ...], list[Array]]:
    order = None if levels is None else {factor: levels}
    design = read_design(frame, dv, subject=None, between=(factor,), levels=order)
    the = design.factors[0]
    return tuple(str(v) for v in the.levels), [design.y[the.codes == i] for i in range(the.k)]


def _within_ss(groups: list[Array], dv: str) -> float:
    ss = float(sum(((g - g.mean()) ** 2).sum() for g in groups))
    largest = max(float(np.abs(g).max()) for g in groups)
    if ss <= 1e-24 * largest**2:
        raise ConstantResponse(f"{dv} does not vary inside any group; F is not defined")
    return ss


def _summary_of_groups(names: tuple[str, ...], groups: list[Array]) -> GroupSummary:
    return GroupSummary(
        names,
        tuple(int(g.size) for g in groups),
        tuple(float(g.mean()) for g in groups),
        tuple(float(g.std(ddof=1)) for g in groups),
    )
