"""Bounded and skewed responses, on which additive effects make interactions by themselves."""

from collections.abc import Iterable, Iterator

from visavis.analysis.statistics.anova import AnovaEffect
from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.normality import skewness
from visavis.analysis.statistics.results import NO_CLAIM

BOUND_SHARE = 0.1
"""Share of responses at the lowest or highest value from which a scale counts as bounded."""
SKEW_LIMIT = 1.0
"""Residual skewness beyond which false positives were seen to grow (docs/statistics.md)."""


def residual_skewness(design: Design) -> float:
    """Return the skewness of the responses around the means of their cells."""
    return skewness(design.around_cell_means(design.y))


def nonlinear_scale_interactions(
    design: Design, effects: Iterable[AnovaEffect], alpha: float
) -> Iterator[str]:
    """Name significant interactions of significant factors on a bounded or skewed response."""
    significant_terms = [e.term for e in effects if e.p_used < alpha]
    compound_terms = [
        term
        for term in significant_terms
        if len(term) > 1 and all((name,) in significant_terms for name in term)
    ]
    if not compound_terms:
        return
    shares = (design.y == design.y.min()).mean(), (design.y == design.y.max()).mean()
    if max(shares) >= BOUND_SHARE:
        why = f"{max(shares):.0%} of responses stand at a bound"
    elif abs(residual_skewness(design)) > SKEW_LIMIT:
        why = "residuals are skewed"
    else:
        return
    for term in compound_terms:
        yield (
            f"{':'.join(term)}: {why} and its factors have effects of their own, which make an "
            f"interaction by themselves on such a scale; {NO_CLAIM} "
            "(visavis stats --error-rate shows how often that happens in data like these)"
        )
