"""How far raters agree: intraclass correlation, Krippendorff's alpha and Cohen's kappa.

All take a table with one row per thing rated and one column per rater.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.effects import at_least_jackknife, jackknife_error
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    MissingValue,
    TooFewLevels,
    TooFewSubjects,
    UnknownMethod,
)
from visavis.analysis.statistics.inputs import rows_text
from visavis.analysis.statistics.results import (
    Array,
    Interval,
    Provenance,
    Result,
    Row,
    f_text,
    number,
    p_text,
)

Scale: TypeAlias = Literal["nominal", "ordinal", "interval", "ratio"]
ICC_KINDS = ("ICC1", "ICC2", "ICC3", "ICC1k", "ICC2k", "ICC3k")
NEARLY_ONE = 1 - 1e-9
"""The largest coefficient that Fisher's z is taken of."""


@dataclass(frozen=True)
class Icc(Result):
    """One of Shrout and Fleiss' (1979) intraclass correlations, as `kind` names it.

    ICC1: every thing has raters of its own; ICC2: the raters stand for others, and their levels
    count as disagreement; ICC3: these raters alone, without their levels. With k: of the raters'
    mean. `by_f` is the interval of normal ratings, `interval` wider where the jackknife says so.
    """

    kind: str
    value: float
    interval: Interval
    by_f: Interval
    F: float
    df1: int
    df2: int
    p: float
    provenance: Provenance
    above: float = 0.0
    p_above: float = float("nan")

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        text = (
            f"{self.kind} = {number(self.value)}, {self.interval}, "
            f"{f_text(self.F, self.df1, self.df2)}, {p_text(self.p)}"
        )
        return f"{text}{_above_text(self.above, self.p_above)}" if self.above else text

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "kind": self.kind,
            "agreement": self.value,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            "F": self.F,
            "df1": self.df1,
            "df2": self.df2,
            "p": self.p,
            "above": self.above,
            "p_above": self.p_above,
            **self.provenance.row(),
        }


def icc(ratings: npt.ArrayLike, *, level: float = 0.95, above: float = 0.0) -> tuple[Icc, ...]:
    """Return ICC1, ICC2, ICC3 and ICC1k, ICC2k, ICC3k of complete ratings (things, raters).

    Estimates, F tests and the intervals `by_f` are those of Shrout and Fleiss (1979) and McGraw and
    Wong (1996), as is `p_above`, the p of a correlation of at most `above`; the `interval` is at
    least that of the jackknife over things, as ratings need not be normal. Raises a
    `StatisticsError` where a rating is missing or nothing varies.
    """
    _refuse_bound(above)
    table = _table(ratings)
    gaps = np.flatnonzero(np.isnan(table).any(axis=1))
    if gaps.size:
        raise MissingValue(
            f"a rating is missing in {rows_text(gaps)}; leave these things out, or take "
            "Krippendorff's alpha"
        )
    n, k = table.shape
    if np.isclose(((table - table.mean()) ** 2).sum(), 0):
        raise ConstantResponse("all ratings are the same; there is nothing to agree about")
    ss_all, ss_things, ss_raters = _sums_of_squares(table)
    between, raters = ss_things / (n - 1), ss_raters / (k - 1)
    inside = (ss_all - ss_things) / (n * (k - 1))
    error = (ss_all - ss_things - ss_raters) / ((n - 1) * (k - 1))
    tail = (1 - level) / 2
    df1, df_inside, df_error = n - 1, n * (k - 1), (n - 1) * (k - 1)
    estimates: list[tuple[str, float, Interval, float, int]] = []
    for kind, scale, df2 in (("ICC1", inside, df_inside), ("ICC3", error, df_error)):
        F = _ratio(between, scale)
        low = F / special.fdtri(df1, df2, 1 - tail)
        high = F * special.fdtri(df2, df1, 1 - tail)
        single = _single(F, k)
        estimates.append((kind, single, Interval(_single(low, k), _single(high, k), level), F, df2))
        ends = Interval(1 - 1 / low, 1 - 1 / high, level)
        estimates.append((f"{kind}k", 1 - 1 / F, ends, F, df2))
    estimates += _of_random_raters(between, raters, error, n, k, level)
    provenance = Provenance(
        "Intraclass correlation", n, unit="things rated", notes=(f"{n} things by {k} raters",)
    )
    tests = {
        kind: _above(kind, above, (between, raters, error), F, n, k)
        for kind, _, _, F, _ in estimates
    }
    without_each = single_without_each(table)
    return tuple(
        Icc(
            kind,
            value,
            _widened(kind, value, ends, without_each, k),
            ends,
            F,
            df1,
            df2,
            float(special.fdtrc(df1, df2, F)),
            provenance,
            above,
            float(special.fdtrc(df1, tests[kind][1] or df2, tests[kind][0])),
        )
        for kind, value, ends, F, df2 in sorted(estimates, key=lambda m: (m[0].endswith("k"), m[0]))
    )


def _sums_of_squares(table: Array) -> tuple[float, float, float]:
    """Return sums of squares of all ratings, of things and of raters, of (things, raters)."""
    n, k = table.shape
    away = table - table.mean()
    things, raters = away.mean(axis=1), away.mean(axis=0)
    return float((away**2).sum()), float(k * things @ things), float(n * raters @ raters)


def single_without_each(table: Array) -> dict[str, Array]:
    """Return log((1 + (k − 1)ρ) / (1 − ρ)) of ICC1 to ICC3 without each of n things, (n,).

    On this scale errors are nearly even. It is −log(1 − ρ) of the mean of k raters, so that of
    ICC3 is the one of Cronbach's alpha where raters are items.
    """
    n, k = table.shape
    away = table - table.mean()
    of_thing = away.mean(axis=1)
    of_rater = (away.sum(axis=0) - away) / (n - 1)
    mean = of_rater.mean(axis=1)
    every = (away**2).sum() - (away**2).sum(axis=1) - (n - 1) * k * mean**2
    things = k * (of_thing @ of_thing - of_thing**2 - (n - 1) * mean**2)
    raters = (n - 1) * ((of_rater**2).sum(axis=1) - k * mean**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        between, inside = things / (n - 2), (every - things) / ((n - 1) * (k - 1))
        error = (every - things - raters) / ((n - 2) * (k - 1))
        levels = (raters / (k - 1) - error) / (n - 1)
        return {
            "ICC1": np.log(between / inside),
            "ICC2": np.log((between + levels) / (error + levels)),
            "ICC3": np.log(between / error),
        }


def _widened(
    kind: str, value: float, ends: Interval, without_each: Mapping[str, Array], k: int
) -> Interval:
    """Return an interval that is at least that of the jackknife over things."""
    of_mean = kind.endswith("k")

    def even(rho: float) -> float:
        above = 1.0 if of_mean else 1 + (k - 1) * rho
        return float(np.log(above / (1 - rho))) if above > 0 and rho < 1 else float("nan")

    def back(z: float) -> float:
        odds = float(np.exp(-z))
        return 1 - odds if of_mean else (1 - odds) / (1 + (k - 1) * odds)

    plain = (even(value), even(ends.low), even(ends.high))
    if not np.isfinite(plain).all():
        return ends
    low, high = at_least_jackknife(*plain, without_each[kind.removesuffix("k")], ends.level)
    return Interval(back(low), back(high), ends.level)


def _above(
    kind: str, limit: float, squares: tuple[float, float, float], F: float, n: int, k: int
) -> tuple[float, float]:
    """Return F against a correlation of at most `limit`, and its second df where that differs.

    McGraw and Wong (1996), table 8; `squares` are mean squares of things, raters and error.
    """
    of_mean = kind.endswith("k")
    if not kind.startswith("ICC2"):
        return F * (1 - limit) / (1 if of_mean else 1 + (k - 1) * limit), 0.0
    between, raters, error = squares
    times = limit / (n * (1 - limit)) * (1 if of_mean else k)
    of_raters, of_error = times * raters, (1 + times * (n - 1)) * error
    if of_raters + of_error <= 0:
        return float("inf"), 0.0
    df = (of_raters + of_error) ** 2 / (of_raters**2 / (k - 1) + of_error**2 / ((n - 1) * (k - 1)))
    return between / (of_raters + of_error), df


def _refuse_bound(above: float) -> None:
    if not -1 < above < 1:
        raise UnknownMethod(f"agreement lies below 1, so it cannot be tested against {above:g}")


def _above_text(above: float, p: float) -> str:
    return f", above {number(above)}: {p_text(p)}"


def _ratio(a: float, b: float) -> float:
    return a / b if b > 0 else float("inf")


def _single(F: float, k: int) -> float:
    return 1.0 if np.isinf(F) else float((F - 1) / (F + k - 1))


def _of_random_raters(
    between: float, raters: float, error: float, n: int, k: int, level: float
) -> list[tuple[str, float, Interval, float, int]]:
    value = (between - error) / (between + (k - 1) * error + k * (raters - error) / n)
    of_mean = (between - error) / (between + (raters - error) / n)
    F_raters = _ratio(raters, error)
    if np.isinf(F_raters):
        ends = Interval(float("nan"), float("nan"), level)
    else:
        a = n * (1 + (k - 1) * value) - k * value
        df = (k - 1) * (n - 1) * (k * value * F_raters + a) ** 2
        df /= (n - 1) * (k * value * F_raters) ** 2 + a**2
        up = float(special.fdtri(n - 1, df, (1 + level) / 2))
        down = float(special.fdtri(df, n - 1, (1 + level) / 2))
        rest = k * raters + (k * n - k - n) * error
        ends = Interval(
            n * (between - up * error) / (up * rest + n * between),
            n * (down * between - error) / (rest + n * down * between),
            level,
        )
    spread = Interval(
        ends.low * k / (1 + ends.low * (k - 1)), ends.high * k / (1 + ends.high * (k - 1)), level
    )
    F, df2 = _ratio(between, error), (n - 1) * (k - 1)
    return [("ICC2", value, ends, F, df2), ("ICC2k", of_mean, spread, F, df2)]


@dataclass(frozen=True)
class Agreement(Result):
    """A coefficient of agreement, 1 where raters agree and 0 where they do so by chance."""

    name: str
    value: float
    interval: Interval
    scale: Scale
    provenance: Provenance
    above: float = 0.0
    p_above: float = float("nan")
    se: float = float("nan")
    """Of kappa the large-sample error (Fleiss, Cohen and Everitt 1969), which the interval does
    not use: it is too small for a few things."""

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return (
            f"{self.name} = {number(self.value)}, {self.interval}, {self.scale} scale"
            f"{_above_text(self.above, self.p_above)}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "kind": self.name,
            "agreement": self.value,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            "scale": self.scale,
            "above": self.above,
            "p_above": self.p_above,
            **self.provenance.row(),
        }


def krippendorff_alpha(
    ratings: npt.ArrayLike, *, scale: Scale, level: float = 0.95, above: float = 0.0
) -> Agreement:
    """Return Krippendorff's alpha of ratings (things, raters), NaN where there is none.

    Any number of raters, missing ratings left out; categories of a nominal scale are numbers
    standing for them. The interval is that of the jackknife over things on Fisher's z, by t, and at
    least that of a one-way intraclass correlation, which alpha of interval scales nearly is;
    `p_above` follows from it.
    Raises a `StatisticsError` where nothing was rated twice, or all ratings are the same.
    """
    if scale not in get_args(Scale):
        raise UnknownMethod(f"no scale {scale!r}; it is {', '.join(get_args(Scale))}")
    _refuse_bound(above)
    table = _table(ratings)
    there = ~np.isnan(table)
    table, there = table[there.sum(axis=1) > 1], there[there.sum(axis=1) > 1]
    if not len(table):
        raise TooFewSubjects("nothing was rated by two raters")
    values = np.unique(table[there])
    if values.size < 2:
        raise ConstantResponse("all ratings are the same; there is nothing to agree about")
    if scale == "ratio" and values[0] < 0:
        raise UnknownMethod("a ratio scale has no values below 0; take interval")
    counts = np.array(
        [[(row[ok] == v).sum() for v in values] for row, ok in zip(table, there, strict=True)],
        dtype=float,
    )
    apart = _distances(values, counts.sum(axis=0), scale)
    of_thing = np.einsum("uc,ck,uk->u", counts, apart, counts) / (counts.sum(axis=1) - 1)
    n_of_thing = counts.sum(axis=1)

    def alpha(weights: Array) -> Array:
        n = weights @ n_of_thing
        category_counts = weights @ counts
        chance = np.einsum("bc,ck,bk->b", category_counts, apart, category_counts) / (n - 1)
        disagreement = weights @ of_thing
        alphas: Array = 1 - np.divide(
            disagreement, chance, out=np.zeros_like(disagreement), where=chance > 0
        )
        return alphas

    n = len(table)
    value = float(alpha(np.ones((1, n)))[0])
    largest = float(apart.max()) / float(_chance_distance(counts.sum(axis=0), apart))
    interval, p_above = _jackknife(value, alpha(1.0 - np.eye(n)), above, level, largest)
    if value < NEARLY_ONE:
        by_f, p_by_f = _as_one_way(value, above, level, n, float(n_of_thing.mean()))
        interval = Interval(
            min(interval.low, by_f.low), max(interval.high, by_f.high), interval.level
        )
        p_above = max(p_above, p_by_f)
    return Agreement(
        "Krippendorff's α",
        value,
        interval,
        scale,
        Provenance(
            "Krippendorff's alpha",
            len(table),
            unit="things rated",
            notes=(f"{int(n_of_thing.sum())} ratings of {len(table)} things rated twice or more",),
        ),
        above,
        p_above,
    )


def _chance_distance(category_counts: Array, apart: Array) -> float:
    """Return the mean distance of two ratings drawn from all."""
    n = category_counts.sum()
    return float(category_counts @ apart @ category_counts / (n * (n - 1)))


def _jackknife(
    value: float, without_each: Array, above: float, level: float, largest: float
) -> tuple[Interval, float]:
    """Return the interval of a coefficient of agreement, and p of one of at most `above`.

    `without_each` are the coefficients without each thing; their spread on Fisher's z is the error,
    with t. Where raters agree throughout, nothing spreads: then the interval ends where not one
    thing in n would be rated as far apart as can be; `largest` is that distance over the one
    expected by chance.
    """
    n = without_each.size
    if value >= NEARLY_ONE:
        share = 1 - ((1 - level) / 2) ** (1 / n)
        apart = float(np.clip((1 - above) / largest, 0.0, 1.0))
        return Interval(max(-1.0, 1 - share * largest), 1.0, level), float((1 - apart) ** n)
    # Without the only thing rated differently the coefficient is 1, of unbounded z; a third of
    # the disagreement is left then (of two things rated differently, a half is left).
    cap = 1 - (1 - value) / 3
    each = _fisher_z(np.minimum(without_each[np.isfinite(without_each)], cap))
    here, at = float(_fisher_z(np.float64(value))), float(_fisher_z(np.float64(above)))
    se = jackknife_error(each)
    reach = float(special.stdtrit(n - 1, (1 + level) / 2)) * se
    interval = Interval(float(np.tanh(here - reach)), float(np.tanh(here + reach)), level)
    beyond = (here - at) / se if se > 0 else np.copysign(np.inf, here - at)
    return interval, float(special.stdtr(n - 1, -beyond))


def _as_one_way(
    value: float, above: float, level: float, n: int, k: float
) -> tuple[Interval, float]:
    """Return interval and p as of a one-way intraclass correlation of n things with k ratings."""
    df1, df2, tail = n - 1, n * (k - 1), (1 - level) / 2
    F, F_above = (max(0.0, (1 + (k - 1) * v) / (1 - v)) for v in (value, above))
    ends = (F / special.fdtri(df1, df2, 1 - tail), F * special.fdtri(df2, df1, 1 - tail))
    low, high = ((f - 1) / (f + k - 1) for f in ends)
    p = special.fdtrc(df1, df2, F / F_above) if F_above > 0 else 0.0
    return Interval(float(low), float(high), level), float(p)


def _fisher_z(value: npt.NDArray[np.float64] | np.float64) -> npt.NDArray[np.float64]:
    inside = np.clip(value, -NEARLY_ONE, NEARLY_ONE)
    return np.asarray(np.arctanh(inside), dtype=np.float64)


def _distances(values: Array, counts: Array, scale: Scale) -> Array:
    """Return squared distances (v, v) of categories."""
    if scale == "nominal":
        return 1.0 - np.eye(values.size)
    if scale == "ordinal":  # categories lie apart by the ratings between them
        place = np.cumsum(counts) - counts / 2
        return np.asarray(np.subtract.outer(place, place) ** 2, dtype=np.float64)
    apart = np.subtract.outer(values, values)
    if scale == "ratio":
        both = np.add.outer(values, values)
        apart = np.divide(apart, both, out=np.zeros_like(apart), where=both != 0)
    return np.asarray(apart**2, dtype=np.float64)


def cohen_kappa(
    ratings: npt.ArrayLike, *, scale: Scale = "nominal", level: float = 0.95, above: float = 0.0
) -> Agreement:
    """Return Cohen's kappa of two raters: plain, or weighted by how far categories are apart.

    Weights are linear in the categories' places for an ordinal scale and quadratic in their
    values for an interval scale. The interval, and `p_above` (of a kappa no larger than `above`),
    are those of the jackknife over things on Fisher's z, by t; `se` is the large-sample error.
    Things that one rater left out are left out.
    Raises a `StatisticsError` for other than two raters, or where both gave one answer throughout.
    """
    if scale not in ("nominal", "ordinal", "interval"):
        raise UnknownMethod(f"kappa takes a nominal, ordinal or interval scale, not {scale}")
    _refuse_bound(above)
    table = _table(ratings)
    if table.shape[1] != 2:
        raise TooFewLevels(
            f"kappa takes two raters, not {table.shape[1]}; take Krippendorff's alpha"
        )
    both = ~np.isnan(table).any(axis=1)
    first, second = table[both].T
    n = first.size
    if n < 2:
        raise TooFewSubjects(f"{n} things were rated by both")
    values, codes = np.unique(np.concatenate([first, second]), return_inverse=True)
    if values.size < 2:
        raise ConstantResponse("all ratings are the same; there is nothing to agree about")
    k = values.size
    joint = np.zeros((k, k))
    np.add.at(joint, (codes[:n], codes[n:]), 1 / n)
    place = values if scale == "interval" else np.arange(k, dtype=float)
    gap = np.abs(np.subtract.outer(place, place)) / np.ptp(place)
    weight = np.eye(k) if scale == "nominal" else 1 - (gap**2 if scale == "interval" else gap)
    rows, columns = joint.sum(axis=1), joint.sum(axis=0)
    agreement, chance = float((weight * joint).sum()), float(rows @ weight @ columns)
    value = (agreement - chance) / (1 - chance)
    # Without each thing: its cell has one less, and so have the row and the column.
    a, b = codes[:n], codes[n:]
    rest = n - 1
    agreement_of_rest = (n * agreement - weight[a, b]) / rest
    chance_of_rest = (
        n**2 * chance - n * (weight @ columns)[a] - n * (rows @ weight)[b] + weight[a, b]
    ) / rest**2
    with np.errstate(divide="ignore", invalid="ignore"):
        without_each = (agreement_of_rest - chance_of_rest) / (1 - chance_of_rest)
    own = np.add.outer(weight @ columns, rows @ weight)
    spread = (joint * (weight * (1 - chance) - own * (1 - agreement)) ** 2).sum()
    variance = (spread - (agreement * chance - 2 * chance + agreement) ** 2) / (
        n * (1 - chance) ** 4
    )
    se = float(np.sqrt(max(variance, 0.0)))
    interval, p_above = _jackknife(value, without_each, above, level, 1 / (1 - chance))
    left = int((~both).sum())
    exclusions = (f"{left} things that one rater left out",) if left else ()
    return Agreement(
        "Cohen's κ" if scale == "nominal" else "weighted κ",
        value,
        interval,
        scale,
        Provenance(
            "Cohen's kappa",
            n,
            unit="things rated",
            dropped=exclusions,
            notes=(f"both raters alike in {100 * float(np.trace(joint)):.0f} % of {n} things",),
        ),
        above,
        p_above,
        se,
    )


def _table(ratings: npt.ArrayLike) -> Array:
    table = np.asarray(ratings, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] < 2 or table.shape[1] < 2:
        raise TooFewLevels("agreement needs two things rated by two raters at least")
    return table
