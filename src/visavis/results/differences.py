"""Differences between the levels of a factor, with intervals, and which way a test points."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from visavis.analysis.statistics.results import Interval, number, percent, quantities
from visavis.results.findings import Finding, Term, levels_of
from visavis.study.expectations import Order

Kind = Literal["difference", "odds", "share", "equivalence", "agreement"]
INTERVAL_LEVEL: Final = 0.95


@dataclass(frozen=True)
class Difference:
    """The greater of two levels minus the other, as a claim expects them.

    `value` is the difference of means over people with its interval, in the unit of the measure; of
    a Bradley–Terry model the odds of being preferred, of a test against a number the mean minus it,
    or the share of people above it. `sign` is +1 where the test itself points as expected, −1 where
    the other way round, 0 where it says neither. `is_tested` is False where the effect is
    significant and nothing compared just these two.
    """

    greater: tuple[str, ...]
    less: tuple[str, ...]
    kind: Kind
    value: float
    interval: Interval | None
    sign: int
    is_significant: bool
    is_tested: bool = True

    @property
    def is_contradictory(self) -> bool:
        """Tell whether means and test (of ranks) point in opposite directions."""
        return self.kind == "difference" and self.sign * np.sign(self.value) < 0


def differences_of(finding: Finding, term: Term, orders: Sequence[Order]) -> Iterator[Difference]:
    """Yield every difference that these orders expect of an effect; the first level is greater."""
    compare = finding.compare
    if not (compare.within or compare.between):
        yield _against_number(finding, term, orders[0])
    elif len(orders) == 2:
        pairs = {o.factor: (o.names[0], o.names[1]) for o in orders}
        value, interval = difference_of_means(finding, pairs)
        yield Difference(
            tuple(a for a, _ in pairs.values()),
            tuple(b for _, b in pairs.values()),
            "difference",
            value,
            interval,
            _sign(value),
            term.is_significant,
        )
    else:
        for greater, less in orders[0].pairs:
            yield _of_two_levels(finding, term, orders[0].factor, greater, less)


def as_planned_sided(finding: Finding) -> Finding:
    """Return a finding whose claimed effect has a one-sided p, where that was planned."""
    compare = finding.compare
    if not compare.one_sided:
        return finding
    terms = []
    for term in finding.terms:
        if compare.is_claimed(term.name):
            (difference,) = differences_of(finding, term, compare.orders)
            p = term.p / 2 if difference.sign > 0 else 1 - term.p / 2
            term = replace(term, p=p, p_corrected=p, is_one_sided=True)
        terms.append(term)
    return replace(finding, terms=tuple(terms))


def _of_two_levels(
    finding: Finding, term: Term, factor: str, greater: str, less: str
) -> Difference:
    sign, is_significant, row = _tested(finding, term, greater, less)
    if finding.compare.model == "bradleyterry":
        odds, low, high = (
            float(row.get(name) or np.nan)
            for name in ("effect_size", "effect_ci_low", "effect_ci_high")
        )
        if row and levels_of(row) != (greater, less):
            odds, low, high = 1 / odds, 1 / high, 1 / low
        between = Interval(low, high) if np.isfinite(low) else None
        return Difference((greater,), (less,), "odds", odds, between, sign, is_significant)
    value, interval = difference_of_means(finding, {factor: (greater, less)})
    if finding.compare.covariates and row.get("ci_low") is not None and "contrast" in row:
        value, interval = _as_adjusted(row, (greater, less))
    is_tested = bool(row) or is_significant or not (term.is_significant or "first" in term.row)
    sign = sign or _sign(value)
    return Difference(
        (greater,), (less,), "difference", value, interval, sign, is_significant, is_tested
    )


def _as_adjusted(row: Mapping[str, Any], pair: tuple[str, str]) -> tuple[float, Interval]:
    """Return the difference that a model finds with what it holds constant, and its interval."""
    sign = 1 if levels_of(row) == pair else -1
    interval = Interval(float(row["ci_low"]), float(row["ci_high"]), INTERVAL_LEVEL)
    return sign * float(row["estimate"]), _turned(interval, sign)


def _tested(
    finding: Finding, term: Term, greater: str, less: str
) -> tuple[int, bool, Mapping[str, Any]]:
    """Return sign, verdict and row of the test of two levels of an effect.

    That of rows about these two; else of the contrasts after the effect; else of the effect itself,
    where it has only two levels: the sign is then 0, and the means tell it.
    """
    outcome = finding.outcome
    pair = {greater, less}
    for one in finding.terms if outcome is not None else ():
        if (
            one.name == term.name
            and {str(one.row.get("first")), str(one.row.get("second"))} == pair
        ):
            sign = _sign_of_row(one.row) * (1 if str(one.row["first"]) == greater else -1)
            return sign, one.is_significant, one.row
    families = (term.name, "items")
    for row in () if outcome is None else outcome.contrasts:
        if str(row.get("family")) in families and set(levels_of(row)) == pair:
            sign = _sign_of_row(row) * (1 if levels_of(row)[0] == greater else -1)
            # A contrast of the only two levels is the effect, which its family has corrected.
            is_whole = levels_there(finding, term.name) == pair
            p = term.p_corrected if is_whole else float(row["p_adjusted"])  # type: ignore[arg-type]  # a number, as tests write it
            return sign, term.is_significant and p < finding.compare.alpha, row
    is_whole = levels_there(finding, term.name) == pair
    return 0, is_whole and term.is_significant, {}


def _sign_of_row(row: Mapping[str, Any]) -> int:
    """Return the direction of a test's own statistic: of ranks where it ranks."""
    if row.get("t") is not None:
        return _sign(row["t"])
    if "hits" in row:
        return _sign(2 * row["hits"] - row["of"])
    return _sign(row.get("effect_size") if row.get("effect") == "r_rb" else row.get("estimate"))


def _sign(value: Any) -> int:
    return int(np.sign(value)) if value is not None and np.isfinite(value) else 0


def levels_there(finding: Finding, term: str = "") -> set[str]:
    """Return the levels of all factors of a comparison, or of one, in the rows tested."""
    outcome, compare = finding.outcome, finding.compare
    if outcome is None or outcome.data is None:
        return set()
    items = ["first", "second"] if compare.model == "bradleyterry" else []
    names = [term] if term and not items else [*compare.within, *compare.between, *items]
    return {
        str(level)
        for name in names
        if name in outcome.data
        for level in outcome.data[name].dropna().unique()
    }


def _against_number(finding: Finding, term: Term, order: Order) -> Difference:
    """Return people's values against the number of a test without a factor."""
    compare, row = finding.compare, term.row
    points_up = 1 if order.names[0] == compare.dv else -1
    names = ((order.names[0],), (order.names[1],))
    if compare.test == "t":
        interval = Interval(float(row["ci_low"]), float(row["ci_high"]))
        value = float(row["estimate"])
        return Difference(
            *names, "difference", value * points_up, _turned(interval, points_up),
            _sign(row["t"]) * points_up, term.is_significant,
        )  # fmt: skip
    share = float(row["effect_size"])
    expected = compare.mu if compare.test == "binomial" else 0.5
    bounds = Interval(float(row["effect_ci_low"]), float(row["effect_ci_high"]))
    sign = _sign(share - expected) * points_up
    return Difference(*names, "share", share, bounds, sign, term.is_significant)


def difference_of_directed(finding: Finding, term: Term) -> Difference:
    """Return the number of a test that has its direction: equivalence or agreement."""
    compare, row = finding.compare, term.row
    kind: Kind = "equivalence" if compare.test == "tost" else "agreement"
    value = float(row["estimate" if kind == "equivalence" else "agreement"])
    low, high = row.get("ci_low"), row.get("ci_high")
    level = 1 - 2 * compare.alpha if kind == "equivalence" else INTERVAL_LEVEL
    interval = None if low is None or high is None else Interval(float(low), float(high), level)
    factors = (*compare.within, *compare.between)
    levels = finding.outcome.question.levels if finding.outcome is not None else {}
    names = tuple(map(str, levels[factors[0]])) if kind == "equivalence" and factors else ()
    greater, less = (names[:1], names[1:2]) if names else ((str(row.get("kind", "")),), ())
    return Difference(greater, less, kind, value, interval, 0, term.is_significant)


def _turned(interval: Interval, sign: int) -> Interval:
    if sign > 0:
        return interval
    return Interval(-interval.high, -interval.low, interval.level)


def difference_of_means(
    finding: Finding, pairs: Mapping[str, tuple[str, str]]
) -> tuple[float, Interval | None]:
    """Return how much greater the first of two levels is on average over people, with interval.

    `pairs` name two levels of one factor, or of two: then it is the difference of differences.
    Every cell of a person weighs alike, and so does every group; groups keep their variances
    (Welch).
    """
    outcome, compare = finding.outcome, finding.compare
    if outcome is None or outcome.data is None:
        return float("nan"), None
    factors = [*compare.within, *compare.between]
    frame = outcome.data[["participant", *factors, compare.dv]].copy()
    frame[factors] = frame[factors].astype(str)
    # A person's score: cells weighed by +1 or -1 for the levels compared, the others averaged.
    cells = frame.groupby(["participant", *factors])[compare.dv].mean().dropna().reset_index()
    between = list(compare.between)
    own = [f for f in compare.within if f in pairs]
    means = cells.groupby(["participant", *between, *own])[compare.dv].mean().reset_index()
    means["weight"] = 1.0
    for factor in own:
        means["weight"] *= means[factor].map({pairs[factor][0]: 1.0, pairs[factor][1]: -1.0})
    means = means.dropna(subset=["weight"])
    means["score"] = means["weight"] * means[compare.dv]
    people = means.groupby(["participant", *between])["score"].agg(["sum", "size"]).reset_index()
    people = people[people["size"] == 2 ** len(own)]
    return _of_groups(people, between, pairs)


def means_of_levels(finding: Finding, term: Term) -> dict[tuple[str, ...], float]:
    """Return the mean over people of each cell of an effect, by its levels in their order.

    In a Bradley–Terry model it is the mean preference for each item.
    """
    outcome, compare = finding.outcome, finding.compare
    if outcome is None or outcome.data is None:
        return {}
    data = outcome.data
    if compare.model == "bradleyterry":
        first, second = (c for c in data if c not in ("participant", compare.dv, *compare.between))
        against = data.assign(**{compare.dv: -data[compare.dv]})
        sides = [data[[first, compare.dv]], against[[second, compare.dv]]]
        both = pd.concat([side.set_axis(["item", "value"], axis=1) for side in sides])
        items = both.groupby(both["item"].astype(str))["value"].mean()
        return {(str(item),): float(value) for item, value in items.items()}
    factors = term.name.split(":")
    if not set(factors) <= set(data):
        return {}
    every = ["participant", *compare.within, *compare.between]
    cells = data.groupby(every, observed=True)[compare.dv].mean().dropna().reset_index()
    means = cells.groupby(factors, observed=True, sort=True)[compare.dv].mean().reset_index()
    levels = means[factors].astype(str).itertuples(index=False)
    return dict(zip(map(tuple, levels), means[compare.dv].tolist(), strict=True))


def _of_groups(
    people: pd.DataFrame, between: Sequence[str], pairs: Mapping[str, tuple[str, str]]
) -> tuple[float, Interval | None]:
    """Return the difference between groups, or the mean over groups, of people's scores."""
    groups = people.groupby(list(between)) if between else [((), people)]
    value = variance = squares = 0.0
    n_others = int(np.prod([people[f].nunique() for f in between if f not in pairs] or [1]))
    for levels, group in groups:
        weight = 1.0 / n_others
        for factor, level in zip(between, levels, strict=True):
            if factor in pairs:
                greater, less = pairs[factor]
                weight *= 1.0 if level == greater else -1.0 if level == less else 0.0
        if weight == 0.0:
            continue
        scores, n = group["sum"].to_numpy(float), len(group)
        value += weight * float(scores.mean())
        own = weight**2 * float(scores.var(ddof=1)) / n if n > 1 else float("nan")
        variance += own
        squares += own**2 / (n - 1) if n > 1 else float("nan")
    if people.empty or not np.isfinite(variance):
        return (value if not people.empty else float("nan")), None
    if variance == 0.0:
        return value, Interval(value, value, INTERVAL_LEVEL)
    half = float(stdtrit(variance**2 / squares, 0.5 + INTERVAL_LEVEL / 2)) * variance**0.5
    return value, Interval(value - half, value + half, INTERVAL_LEVEL)


def difference_words(difference: Difference, words: Mapping[str, str], unit: str) -> str:
    """Return a difference with its interval in words; `words` are those of levels and measures."""
    greater = " ".join(words.get(name, name) for name in difference.greater)
    less = " ".join(words.get(name, name) for name in difference.less)
    unit = "" if unit in ("", "1") else f" {unit}"
    interval, value = difference.interval, difference.value
    if difference.kind == "odds":
        return f"{greater} over {less}: odds {number(value)}{_bounds(interval, number)}"
    if difference.kind == "share":
        return f"{number(value)} of people above{_bounds(interval, number)}"
    if difference.kind == "agreement":
        return f"{greater} {number(value)}{_bounds(interval, number)}".strip()
    ends = [value] if interval is None else [value, interval.low, interval.high]
    first, *rest = quantities(*ends)
    between = (
        f", {percent(interval.level)} CI [{rest[0]}, {rest[1]}]" if interval is not None else ""
    )
    if difference.kind == "equivalence" and not less:
        return f"mean {first}{unit}{between}"
    if len(difference.greater) == 2:
        (a, c), (b, d) = (
            [words.get(n, n) for n in names] for names in (difference.greater, difference.less)
        )
        return f"{a} minus {b}, with {c} minus with {d}: {first}{unit}{between}"
    return f"{greater} minus {less}: {first}{unit}{between}"


def _bounds(interval: Interval | None, text: Any) -> str:
    if interval is None:
        return ""
    return f", {percent(interval.level)} CI [{text(interval.low)}, {text(interval.high)}]"
