"""Does this study say what the published one says, test by test."""

from collections.abc import Sequence
from dataclasses import dataclass

from experiments.stare import published
from experiments.stare.anxiety import AnxietyCorrelation
from experiments.stare.comparisons import Comparison, Descriptive
from experiments.stare.reach import can_reach, correlation_can_reach


@dataclass(frozen=True)
class Agreement:
    """One published verdict beside ours.

    `ours` None: not tested. `is_decidable` False: with so few participants the test could not
    reach its threshold, so it neither agrees nor disagrees. Verdicts agree when both are not
    significant, or both are and the difference (or correlation) has the same sign; the sign
    counts only where one is printed.
    """

    published: bool
    ours: bool | None
    same_direction: bool = True
    is_decidable: bool = True

    @property
    def agrees(self) -> bool | None:
        """Tell whether the verdicts agree; None when there is none to compare."""
        if self.ours is None or not self.is_decidable:
            return None
        return self.published == self.ours and (not self.published or self.same_direction)


@dataclass(frozen=True)
class AgreementCount:
    """How many verdicts agree among those compared, of all published ones."""

    agree: int
    compared: int
    published: int

    def __str__(self) -> str:
        text = f"{self.agree} of {self.published}"
        left = self.published - self.compared
        return f"{text} ({left} undecided)" if left else text


def condition_agreement(comparison: Comparison) -> Agreement:
    """Hold one of the thirty tests against its published row."""
    row = published.published_test(comparison.first, comparison.second, comparison.measure.column)
    first, second = (
        published.MEANS[c][comparison.measure.column].mean
        for c in (comparison.first, comparison.second)
    )
    direction = (second > first) - (second < first)
    return Agreement(
        row.is_significant,
        comparison.is_significant,
        direction == comparison.direction,
        can_reach(comparison) is not False,
    )


def place_agreement(comparison: Comparison) -> Agreement:
    """Hold a test of one place or zone against its published p."""
    return Agreement(
        place_p(comparison).stars > 0,
        comparison.is_significant,
        is_decidable=can_reach(comparison) is not False,
    )


def place_p(comparison: Comparison) -> published.PValue:
    """Return the published p of one place or zone."""
    if comparison.family == "zones":
        return published.ZONE_TESTS[comparison.where][comparison.first, comparison.second]
    return published.POSITION_TESTS[comparison.where][comparison.measure.column]


def anxiety_agreement(correlation: AnxietyCorrelation) -> Agreement:
    """Hold a correlation against the source: what it does not print was not significant."""
    row = published_correlation(correlation)
    decidable = correlation_can_reach(correlation) is not False
    if row is None:
        return Agreement(False, correlation.is_significant, is_decidable=decidable)
    r = None if correlation.outcome is None else correlation.outcome.r
    same = r is not None and r * row.r_s > 0
    return Agreement(True, correlation.is_significant, same, decidable)


def published_correlation(correlation: AnxietyCorrelation) -> published.RankCorrelation | None:
    """Return the printed correlation, or None where the source prints none."""
    for row in published.CORRELATIONS:
        if (row.condition, row.measure) == (correlation.condition, correlation.measure.column):
            return row
    return None


def count(agreements: Sequence[Agreement]) -> AgreementCount:
    """Count the verdicts that agree."""
    compared = [a for a in agreements if a.agrees is not None]
    return AgreementCount(sum(bool(a.agrees) for a in compared), len(compared), len(agreements))


def mean_deviation_01(descriptive: Descriptive) -> float:
    """Return how far a mean lies from the published one, as a signed share of it."""
    mean = published.MEANS[descriptive.condition][descriptive.measure.column].mean
    return descriptive.mean / mean - 1.0
