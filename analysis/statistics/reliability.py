"""Internal consistency of questionnaire items: Cronbach's alpha."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from visavis.analysis.statistics.agreement import single_without_each
from visavis.analysis.statistics.design import Frame, column_of
from visavis.analysis.statistics.effects import at_least_jackknife
from visavis.analysis.statistics.errors import TooFewLevels, UnequalLength, UnknownColumn
from visavis.analysis.statistics.inputs import sample
from visavis.analysis.statistics.results import (
    Array,
    Interval,
    Provenance,
    Result,
    Row,
    number,
    percent,
)


@dataclass(frozen=True)
class CronbachAlpha(Result):
    """Cronbach's alpha after reversing the `reverse` items.

    `standardised` is alpha of standardised items, `without_item` alpha with each item left out,
    `unreversed` alpha of the items as answered (equal to `alpha` when nothing is reversed).
    """

    alpha: float
    interval: Interval
    standardised: float
    average_r: float
    items: tuple[str, ...]
    reversed_items: tuple[str, ...]
    without_item: tuple[float, ...]
    unreversed: float
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        low, high = number(self.interval.low), number(self.interval.high)
        return (
            f"Cronbach's α = {number(self.alpha)}, {percent(self.interval.level)} CI "
            f"[{low}, {high}], {len(self.items)} items, n = {self.provenance.n}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "alpha": self.alpha,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            "standardised_alpha": self.standardised,
            "average_r": self.average_r,
            **self.provenance.row(),
        }


def cronbach_alpha(
    frame: Frame,
    items: Sequence[str],
    *,
    reverse: Sequence[str] = (),
    level: float = 0.95,
) -> CronbachAlpha:
    """Return Cronbach's alpha of item columns, one row per person; `reverse` are keyed the other
    way. The interval is Feldt's (1965), from the F distribution, and at least that of the jackknife
    over persons, as answers need not be normal.
    """
    if len(items) < 2:
        raise TooFewLevels(f"alpha needs two items, got {len(items)}")
    for name in reverse:
        if name not in items:
            raise UnknownColumn(f"item {name!r} is to be reversed but is not among the items")
    columns = [sample(column_of(frame, name), name=name) for name in items]
    if len({c.size for c in columns}) > 1:
        raise UnequalLength("the items differ in their number of rows")
    answers = np.column_stack(columns)
    signs = np.array([-1.0 if name in reverse else 1.0 for name in items])
    scored_answers = answers * signs
    n, k = scored_answers.shape
    r = np.corrcoef(scored_answers, rowvar=False)
    average = float((r.sum() - k) / (k * (k - 1)))
    alpha = _alpha(scored_answers)
    tail, df = (1 - level) / 2, (n - 1, (n - 1) * (k - 1))
    low, high = (
        1 - (1 - alpha) * float(special.fdtri(*df, quantile)) for quantile in (1 - tail, tail)
    )
    if high < 1:
        without_each = single_without_each(scored_answers)["ICC3"]
        even = [-float(np.log(1 - v)) for v in (alpha, low, high)]
        ends = at_least_jackknife(even[0], even[1], even[2], without_each, level)
        low, high = (1 - float(np.exp(-v)) for v in ends)
    left_out = tuple(
        _alpha(np.delete(scored_answers, i, axis=1)) if k > 2 else float("nan") for i in range(k)
    )
    return CronbachAlpha(
        alpha,
        Interval(low, high, level),
        k * average / (1 + (k - 1) * average),
        average,
        tuple(items),
        tuple(name for name in items if name in reverse),
        left_out,
        _alpha(answers),
        Provenance("Cronbach's alpha", n, unit="persons", error_term="items by persons"),
    )


def _alpha(items: Array) -> float:
    k = items.shape[1]
    total = float(items.sum(axis=1).var(ddof=1))
    if total == 0:
        return float("nan")
    return float(k / (k - 1) * (1 - items.var(axis=0, ddof=1).sum() / total))
