"""The words of the study: conditions and measures, as they are reported."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from visavis.looks import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIRST_FIXATION_TIME_MS,
    SECOND_FIXATION_DURATION_MS,
    SECOND_FIXATION_TIME_MS,
)
from visavis.looks import FIXATION_COUNT as COUNT_COLUMN


@dataclass(frozen=True)
class Measure:
    """A measure of one trial: its column, its name in text, its unit, digits to print."""

    column: str
    label: str
    unit: str
    digits: int

    @property
    def short(self) -> str:
        """The name as short as the published tables have it."""
        text = self.label.replace("First fixation", "1st fix.")
        return text.replace("Second fixation", "2nd fix.")

    @property
    def axis(self) -> str:
        """The label of an axis: name and unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


DWELL: Final = Measure(DWELL_MS, "Dwell time", "ms", 0)
FIXATION_COUNT: Final = Measure(COUNT_COLUMN, "Fixation count", "", 2)
FIRST_TIME: Final = Measure(FIRST_FIXATION_TIME_MS, "First fixation time", "ms", 0)
MEASURES: Final[tuple[Measure, ...]] = (
    DWELL,
    FIXATION_COUNT,
    Measure(FIRST_FIXATION_DURATION_MS, "First fixation duration", "ms", 0),
    FIRST_TIME,
    Measure(SECOND_FIXATION_DURATION_MS, "Second fixation duration", "ms", 0),
    Measure(SECOND_FIXATION_TIME_MS, "Second fixation time", "ms", 0),
)
"""The six measures, in the order of the published tables."""

CONDITION_NAMES: Final[Mapping[str, str]] = {
    "A": "averted",
    "D": "directed",
    "AD": "averted-then-directed",
    "DA": "directed-then-averted",
}
