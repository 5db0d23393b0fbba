"""Contrasts between means: estimate, error, t, and p adjusted for the family."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations
from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy import special

from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME, adjust_p
from visavis.analysis.statistics.errors import UnknownMethod
from visavis.analysis.statistics.largest_t import largest_t_quantile, largest_t_sf
from visavis.analysis.statistics.results import (
    MINUS,
    Array,
    Effect,
    Interval,
    Provenance,
    Result,
    Row,
    degrees,
    number,
    p_text,
)
from visavis.analysis.statistics.studentized import studentized_range_quantile, studentized_range_sf

ContrastAdjustment: TypeAlias = Literal["tukey", "mvt", "holm", "bonferroni", "bh", "none"]
"""Tukey's range of k means; multivariate t, exact for any family of contrasts of one model; or an
adjustment of the p alone."""
LevelPairs: TypeAlias = tuple[tuple[str, str], ...]
"""What a contrast compares: one pair of levels, or one per factor of a double difference."""

WAY_NAME = {"tukey": "Tukey", "mvt": "multivariate t", **ADJUSTMENT_NAME}


@dataclass(frozen=True)
class Contrast(Result):
    """One contrast; `pairs` has one pair of levels, or one per factor of a double difference.

    Other sums of means have a `name` and no pairs. `interval` is simultaneous over the family for
    Tukey, multivariate t and Bonferroni, of one contrast otherwise.
    `estimate` is the mean of the first level minus that of the second (for double differences
    the difference of these over the second factor's pair).
    """

    pairs: LevelPairs
    estimate: float
    se: float
    df: float
    t: float
    p: float
    p_adjusted: float
    adjustment: ContrastAdjustment
    interval: Interval | None = None
    effect: Effect | None = None
    name: str = ""

    @property
    def label(self) -> str:
        """The contrast as text: 'left − right', or its name."""
        return self.name or pairs_text(self.pairs)

    def sentence(self) -> str:
        """Return the contrast as an APA sentence."""
        effect = self.effect or "no effect size"
        adjustment_text = ""
        if self.adjustment != "none":
            adjustment_text = f" ({WAY_NAME[self.adjustment]})"
        return (
            f"{self.label}: estimate {number(self.estimate, 3)}, SE {number(self.se, 3)}, "
            f"t({degrees(self.df)}) = {number(self.t)}, {p_text(self.p_adjusted)}"
            f"{adjustment_text}, {effect}"
        )

    def row(self) -> Row:
        """Return the contrast as one flat table row."""
        return {
            "contrast": self.label,
            "estimate": self.estimate,
            "se": self.se,
            "df": self.df,
            "t": self.t,
            "p": self.p,
            "p_adjusted": self.p_adjusted,
            "adjustment": self.adjustment,
            "ci_low": None if self.interval is None else self.interval.low,
            "ci_high": None if self.interval is None else self.interval.high,
            **({"effect_size": None} if self.effect is None else self.effect.row()),
        }


@dataclass(frozen=True)
class Contrasts(Result):
    """A family of contrasts of one term; `k` is the number of means compared.

    `correlation` (m, m) is that of the estimates, None where it is not known.
    """

    term: tuple[str, ...]
    contrasts: tuple[Contrast, ...]
    k: int
    provenance: Provenance
    level: float = 0.95
    correlation: Array | None = field(default=None, repr=False, compare=False)

    def with_adjustment(self, adjustment: ContrastAdjustment) -> "Contrasts":
        """Return the same contrasts with p and intervals adjusted another way."""
        if adjustment not in get_args(ContrastAdjustment):
            names = ", ".join(get_args(ContrastAdjustment))
            raise UnknownMethod(f"no adjustment {adjustment!r}; use one of {names}")
        if adjustment == "tukey" and any(len(c.pairs) != 1 for c in self.contrasts):
            raise UnknownMethod("Tukey compares means, not double differences; use mvt or holm")
        if adjustment == "mvt" and self.correlation is None:
            raise UnknownMethod(
                f"the estimates of {self.provenance.test} have no common model, so that mvt cannot "
                "adjust them; use holm"
            )
        p = _adjust_family(self, adjustment)
        m = len(self.contrasts)
        reach: dict[float, float] = {}
        contrasts = []
        for contrast, p_adjusted in zip(self.contrasts, p.tolist(), strict=True):
            if contrast.df not in reach:
                reach[contrast.df] = _reach(contrast.df, self, adjustment)
            half = reach[contrast.df] * contrast.se
            contrasts.append(
                replace(
                    contrast,
                    p_adjusted=p_adjusted,
                    adjustment=adjustment,
                    interval=Interval(
                        contrast.estimate - half, contrast.estimate + half, self.level
                    ),
                )
            )
        name = WAY_NAME[adjustment]
        return replace(
            self,
            contrasts=tuple(contrasts),
            provenance=replace(self.provenance, correction=f"{name}, {m} contrasts"),
        )

    def contrast(self, first: str, second: str) -> Contrast:
        """Return the contrast of two levels, turned so that `first` comes first."""
        for c in self.contrasts:
            if c.pairs == ((first, second),):
                return c
            if c.pairs == ((second, first),):
                return reverse(c)
        raise UnknownMethod(f"no contrast of {first!r} and {second!r} in {':'.join(self.term)}")

    def sentence(self) -> str:
        """Return all contrasts, one sentence each."""
        head = f"{self.provenance.test} of {' × '.join(self.term)} ({self.provenance.error_term})"
        return "\n".join([head + ".", *(c.sentence() + "." for c in self.contrasts)])

    def rows(self) -> tuple[Row, ...]:
        """Return one flat table row per contrast."""
        return tuple({**c.row(), **self.provenance.row()} for c in self.contrasts)

    def row(self) -> Row:
        """Return the first contrast's row; `rows` has them all."""
        return self.rows()[0]


def contrast_family(
    term: Sequence[str],
    contrasts: Sequence[LevelPairs | str],
    estimates: Array,
    ses: Array,
    dfs: Array,
    *,
    k: int,
    provenance: Provenance,
    adjustment: ContrastAdjustment,
    effects: Sequence[Effect | None] | None = None,
    correlation: Array | None = None,
) -> Contrasts:
    """Assemble contrasts (pairs of levels, or names) from estimates, errors and df, each (m,)."""
    t = estimates / ses
    p = 2 * special.stdtr(dfs, -np.abs(t))
    raw = tuple(
        Contrast(
            () if isinstance(one, str) else one,
            float(e),
            float(s),
            float(d),
            float(ti),
            float(pi),
            float(pi),
            "none",
            name=one if isinstance(one, str) else "",
        )
        for one, e, s, d, ti, pi in zip(contrasts, estimates, ses, dfs, t, p, strict=True)
    )
    if effects is not None:
        raw = tuple(replace(c, effect=e) for c, e in zip(raw, effects, strict=True))
    return Contrasts(tuple(term), raw, k, provenance, correlation=correlation).with_adjustment(
        adjustment
    )


def pair_matrix(k: int) -> Array:
    """Return all pairwise differences of k means as rows (k(k−1)/2, k), first minus second."""
    rows = list(combinations(range(k), 2))
    L = np.zeros((len(rows), k))
    for i, (a, b) in enumerate(rows):
        L[i, a], L[i, b] = 1.0, -1.0
    return L


def pairs_text(pairs: Sequence[tuple[str, str]]) -> str:
    """Return pairs of levels as text: 'left − right', one pair per factor."""
    return ", ".join(f"{a} {MINUS} {b}" for a, b in pairs)


def pair_labels(labels: Sequence[str]) -> list[LevelPairs | str]:
    """Return the level pairs of `pair_matrix` rows."""
    return [(pair,) for pair in combinations(labels, 2)]


def reverse(contrast: Contrast) -> Contrast:
    """Turn the sign of a contrast round."""
    interval = contrast.interval
    effect = contrast.effect
    if interval is not None:
        interval = Interval(-interval.high, -interval.low, interval.level)
    if effect is not None and effect.interval is not None:
        inner = effect.interval
        if effect.name.endswith(("ratio", "odds")):
            flipped_interval = Interval(1 / inner.high, 1 / inner.low, inner.level)
            effect = Effect(effect.name, 1 / effect.value, flipped_interval)
        else:
            flipped_interval = Interval(-inner.high, -inner.low, inner.level)
            effect = Effect(effect.name, -effect.value, flipped_interval)
    first, *rest = contrast.pairs
    return replace(
        contrast,
        pairs=((first[1], first[0]), *rest),
        estimate=-contrast.estimate,
        t=-contrast.t,
        interval=interval,
        effect=effect,
    )


def _adjust_family(family: Contrasts, adjustment: ContrastAdjustment) -> Array:
    p = np.array([c.p for c in family.contrasts])
    if adjustment != "tukey" and adjustment != "mvt":  # mypy narrows it so
        return adjust_p(p, adjustment)
    t = np.array([abs(c.t) for c in family.contrasts])
    df = np.round([c.df for c in family.contrasts], 8)
    result = np.empty(p.size)
    for one in np.unique(df):
        same = df == one
        if adjustment == "mvt":
            assert family.correlation is not None  # noqa: S101  # with_adjustment asked
            result[same] = largest_t_sf(t[same], family.correlation, float(one))
        else:
            result[same] = studentized_range_sf(t[same] * np.sqrt(2), family.k, float(one))
    return result


@lru_cache(maxsize=256)
def _tukey_reach(df: float, k: int, level: float) -> float:
    return studentized_range_quantile(level, k, df) / float(np.sqrt(2))


def _reach(df: float, family: Contrasts, adjustment: ContrastAdjustment) -> float:
    """Return the half-width of a confidence interval in standard errors."""
    if adjustment == "tukey":
        return _tukey_reach(round(df, 8), family.k, family.level)
    if adjustment == "mvt" and family.correlation is not None:
        return largest_t_quantile(family.level, family.correlation, df)
    m = len(family.contrasts)
    tail = (1 - family.level) / (m if adjustment == "bonferroni" else 1)
    return float(special.stdtrit(df, 1 - tail / 2))
