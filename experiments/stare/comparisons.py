"""Measures and comparisons of the study: families of the source's tests, a second view, rules."""

from typing import Any, Final

from visavis.experiments.stare import published
from visavis.experiments.stare.published import COMPARISONS
from visavis.results.family_tests import CorrelationTest, PairTest
from visavis.study.exclusions import CLOCK_RULE, COMPLETENESS_RULES, Exclusion
from visavis.study.look_measures import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIRST_FIXATION_TIME_MS,
    IDT,
    IVT,
    SECOND_FIXATION_DURATION_MS,
    SECOND_FIXATION_TIME_MS,
)
from visavis.study.look_measures import (
    FIXATION_COUNT as COUNT_COLUMN,
)
from visavis.study.measures import Measure
from visavis.study.pairs import Correlate, Family, Pairs, Printed

DWELL: Final = Measure(DWELL_MS, "ms", "Dwell time", needs_gaze=True)
FIXATION_COUNT: Final = Measure(COUNT_COLUMN, "1", "Fixation count", needs_gaze=True)
FIRST_TIME: Final = Measure(FIRST_FIXATION_TIME_MS, "ms", "First fixation time", needs_gaze=True)
MEASURES: Final[tuple[Measure, ...]] = (
    DWELL,
    FIXATION_COUNT,
    Measure(FIRST_FIXATION_DURATION_MS, "ms", "First fixation duration", needs_gaze=True),
    FIRST_TIME,
    Measure(SECOND_FIXATION_DURATION_MS, "ms", "Second fixation duration", needs_gaze=True),
    Measure(SECOND_FIXATION_TIME_MS, "ms", "Second fixation time", needs_gaze=True),
)
"""The six measures, in the order of the published tables."""
SECOND_VIEW_MEASURES: Final = (
    Measure(IVT + "on_active_count", "1", "Number of fixations on the agent by velocity (I-VT)"),
    Measure(IDT + "on_active_count", "1", "Number of fixations on the agent by dispersion (I-DT)"),
)
ALL_MEASURES: Final = {m.column: m for m in (*MEASURES, *SECOND_VIEW_MEASURES)}
COLUMNS: Final = tuple(m.column for m in MEASURES)
SCORE_COLUMN: Final = "social_anxiety_total"
"""Liebowitz total, 0 to 144, in the table of participants' answers."""

RULES: Final = (
    CLOCK_RULE,
    Exclusion(
        "max_trial_lost_01",
        "trial",
        "lost_01",
        0.30,
        "{value:.0%} lost (limit {limit:.0%})",
        missing_is_out=True,
    ),
    Exclusion(
        "max_bad_trials_01",
        "participant",
        "bad_trials_01",
        0.30,
        "{value:.0%} of the trials without enough gaze (limit {limit:.0%})",
    ),
    Exclusion(
        "max_error_deg",
        "participant",
        "calibration_error_deg",
        2.5,
        "mean calibration error {value:.1f}° (limit {limit:.1f}°)",
    ),
    *COMPLETENESS_RULES,
)
"""This platform's: the source names none."""


def _of_conditions(test: PairTest) -> Printed | None:
    return published.TESTS.get((test.first, test.second, test.measure.column))


def _of_places(test: PairTest) -> Printed | None:
    return published.POSITION_TESTS[test.where].get(test.measure.column)


def _of_zones(test: PairTest) -> Printed | None:
    return published.ZONE_TESTS[test.where].get((test.first, test.second))


def _of_anxiety(test: CorrelationTest) -> Printed:
    """Return a printed correlation; what the source does not print was not significant."""
    other = Printed(False, where="section 3.3.2")
    return published.CORRELATIONS.get((test.level, test.measure.column), other)


_GAZE: Final[dict[str, Any]] = {
    "noun": "gaze",
    "names": {
        "A": "averted",
        "D": "directed",
        "AD": "averted-then-directed",
        "DA": "directed-then-averted",
    },
}
CONDITION_TESTS: Final = Pairs(
    "conditions",
    COLUMNS,
    "condition",
    COMPARISONS,
    printed=_of_conditions,
    words="the thirty tests: five comparisons of six measures",
    **_GAZE,
)
PLACE_TESTS: Final = Pairs(
    "places",
    [DWELL.column, FIXATION_COUNT.column],
    "condition",
    [("A", "D")],
    each="place",
    shared=("each",),
    printed=_of_places,
    words="averted against directed gaze at each of nine places",
    **_GAZE,
)
"""Measures that every trial has, so that a mean over two trials per place is rarely missing."""
ZONE_TESTS: Final = Pairs(
    "zones",
    [FIRST_TIME.column],
    "condition",
    COMPARISONS,
    each="zone",
    shared=("each",),
    printed=_of_zones,
    words="first fixation time by zone",
    **_GAZE,
)
ANXIETY_TESTS: Final = Correlate(
    "anxiety",
    COLUMNS,
    "condition",
    SCORE_COLUMN,
    "social anxiety",
    "the anxiety score",
    printed=_of_anxiety,
    words="Spearman correlations with the social anxiety score",
    **_GAZE,
)
SECOND_VIEW_TESTS: Final = tuple(
    Pairs(
        "second view",
        [m.column],
        "condition",
        COMPARISONS,
        words="comparisons on fixations found by velocity and by dispersion",
        exploratory=True,
        **_GAZE,
    )
    for m in SECOND_VIEW_MEASURES
)
FAMILIES: Final[tuple[Family, ...]] = (
    CONDITION_TESTS,
    PLACE_TESTS,
    ZONE_TESTS,
    ANXIETY_TESTS,
    *SECOND_VIEW_TESTS,
)
