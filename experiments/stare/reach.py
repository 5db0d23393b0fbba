"""Whether a test could have reached its threshold with the participants it had."""

from math import factorial

from analysis.statistics import SignedRank
from experiments.stare.anxiety import AnxietyCorrelation
from experiments.stare.comparisons import Comparison


def can_reach(test: Comparison) -> bool | None:
    """Tell whether any data of this size could be significant; None when there was no test.

    The exact signed-rank test of n non-zero differences cannot go below p = 2/2ⁿ; a t test has
    no such bound.
    """
    if test.outcome is None:
        return None
    ranks = test.outcome.test
    if not isinstance(ranks, SignedRank) or ranks.method != "exact":
        return True
    return 2.0 / 2.0**ranks.n_nonzero < test.threshold


def correlation_can_reach(correlation: AnxietyCorrelation) -> bool | None:
    """Tell the same of a correlation: exact, Spearman's p cannot go below 2/n!."""
    if correlation.outcome is None:
        return None
    if correlation.outcome.method != "exact":
        return True
    return 2.0 / factorial(correlation.n) < correlation.alpha
