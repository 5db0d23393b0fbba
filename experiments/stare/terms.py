"""The words of the study: conditions and measures, as they are reported."""

from collections.abc import Mapping
from typing import Final

from visavis.looks import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIRST_FIXATION_TIME_MS,
    SECOND_FIXATION_DURATION_MS,
    SECOND_FIXATION_TIME_MS,
)
from visavis.looks import (
    FIXATION_COUNT as COUNT_COLUMN,
)
from visavis.measures import Measure

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

CONDITION_NAMES: Final[Mapping[str, str]] = {
    "A": "averted",
    "D": "directed",
    "AD": "averted-then-directed",
    "DA": "directed-then-averted",
}


def short(measure: Measure) -> str:
    """Return a measure's name as short as the published tables have it."""
    return measure.words.replace("First fixation", "1st fix.").replace("Second fix", "2nd fix")
