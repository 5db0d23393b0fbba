"""Counts against chance: the exact binomial test, and the sign test of pairs."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import ConstantResponse, NotNumeric, TooFewSubjects
from visavis.analysis.statistics.inputs import differences, paired, sample
from visavis.analysis.statistics.results import (
    Effect,
    Interval,
    Provenance,
    Result,
    Row,
    number,
    p_text,
)


@dataclass(frozen=True)
class Binomial(Result):
    """An exact test of `hits` in `n` against a share `expected`, two-sided.

    The effect is the share with Clopper and Pearson's interval. p sums all counts that are no
    likelier than the one found, as R's `binom.test` does.
    """

    hits: int
    n: int
    expected: float
    p: float
    effect: Effect
    provenance: Provenance

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        return (
            f"{self.hits} of {self.n}, {self.effect}, against {number(self.expected)}: "
            f"{p_text(self.p)}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "hits": self.hits,
            "of": self.n,
            "p": self.p,
            **self.effect.row(),
            **self.provenance.row(),
        }


def binomial_test(hits: int, n: int, *, expected: float = 0.5, level: float = 0.95) -> Binomial:
    """Test a count against a share expected; choices must be independent (one per person).

    Raises:
        TooFewSubjects: nothing was counted.
    """
    if n < 1 or not 0 <= hits <= n:
        raise TooFewSubjects(f"{hits} of {n} cannot be tested")
    if not 0 < expected < 1:
        raise NotNumeric(f"the share expected lies between 0 and 1, not {expected:g}")
    from scipy import stats  # late: half a second that other tests need not pay

    test = stats.binomtest(hits, n, expected)
    ends = test.proportion_ci(level, "exact")
    effect = Effect("share", hits / n, Interval(float(ends.low), float(ends.high), level))
    return Binomial(
        hits, n, expected, float(test.pvalue), effect, Provenance("Exact binomial test", n)
    )


def clustered_share(
    hits: npt.ArrayLike, of: npt.ArrayLike, *, level: float = 0.95
) -> tuple[float, Interval]:
    """Return the share of hits and an interval that allows for several answers per person.

    `hits` and `of` (n,) count per person. Answers of one person are alike, so they are worth fewer
    than as many of different people: the interval is Clopper and Pearson's of the effective number
    of answers, after Korn and Graubard (1998, Survey Methodology 24, 193), with the variance of a
    ratio over people. Where nobody differs from the others, answers count as fully independent;
    for one person the interval is 0 to 1.

    Raises:
        TooFewSubjects: nothing was answered.
    """
    counts, answers = np.asarray(hits, float), np.asarray(of, float)
    counts, answers = counts[answers > 0], answers[answers > 0]
    people, total = counts.size, float(answers.sum())
    if not people:
        raise TooFewSubjects("nobody answered, so there is no share")
    share = float(counts.sum()) / total
    if people == 1:
        return share, Interval(0.0, 1.0, level)
    from scipy import stats  # late, as below

    apart = counts - share * answers
    variance = people / (people - 1) * float(apart @ apart) / total**2
    worth = float(people)
    if variance > 0:
        tail = (1 + level) / 2
        t_ratio_squared = float(stats.t.ppf(tail, total - 1) / stats.t.ppf(tail, people - 1)) ** 2
        worth = min(total, share * (1 - share) / variance * t_ratio_squared)
    effective_hits = share * worth
    low = (
        0.0
        if share <= 0
        else stats.beta.ppf((1 - level) / 2, effective_hits, worth - effective_hits + 1)
    )
    high = (
        1.0
        if share >= 1
        else stats.beta.ppf((1 + level) / 2, effective_hits + 1, worth - effective_hits)
    )
    return share, Interval(float(low), float(high), level)


def sign_test(
    x: npt.ArrayLike, y: npt.ArrayLike, *, names: tuple[str, str] = ("x", "y"), level: float = 0.95
) -> Binomial:
    """Test whether x is above y in as many pairs as below; equal pairs are left out.

    Assumes neither distances nor symmetric differences; the share is that of pairs with x above.
    Raises a `StatisticsError` where no pair differs.
    """
    first, second = paired(x, y, names=names, at_least=1)
    return _signs(differences(first, second), f"{names[0]} and {names[1]}", level)


def sign_test_of_one(
    x: npt.ArrayLike, *, mu: float = 0.0, name: str = "x", level: float = 0.95
) -> Binomial:
    """Test whether values lie above `mu` as often as below; those equal to it are left out."""
    values = sample(x, name=name, at_least=1, vary=False)
    return _signs(differences(values, np.full(values.size, mu)), f"{name} and {mu:g}", level)


def _signs(off: npt.NDArray[np.float64], what: str, level: float) -> Binomial:
    above, below = int((off > 0).sum()), int((off < 0).sum())
    if above + below == 0:
        raise ConstantResponse(f"{what} are equal in all {off.size} pairs; nothing to test")
    test = binomial_test(above, above + below, level=level)
    equal = off.size - above - below
    notes = (f"{equal} of {off.size} equal, left out",) if equal else ()
    return Binomial(
        test.hits,
        test.n,
        test.expected,
        test.p,
        test.effect,
        Provenance("Sign test", int(off.size), unit="pairs", notes=notes),
    )
