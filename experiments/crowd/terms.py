"""The study's measures and blocks in words: columns, labels, units, digits."""

from dataclasses import dataclass
from typing import Final

from experiments.crowd.design import AFTER, BEFORE, HAPTIC

PAIRS: Final = ((BEFORE, HAPTIC), (HAPTIC, AFTER), (BEFORE, AFTER))
"""Every two blocks, in the order of the published table of similarities."""

BLOCK_NAMES: Final = {
    BEFORE: "no haptics, first block",
    HAPTIC: "haptics, second block",
    AFTER: "no haptics, third block",
}


@dataclass(frozen=True)
class Measure:
    """A measure that blocks are compared by.

    `column` of the trial table (or of the table of answers when `is_rating`); `is_primary` for
    those the source tested.
    """

    column: str
    label: str
    unit: str
    digits: int
    is_primary: bool = False
    is_rating: bool = False

    @property
    def axis(self) -> str:
        """Label and unit for an axis."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


COLLISIONS: Final = Measure("collisions", "Collisions per trial", "", 1, is_primary=True)
VOLUME: Final = Measure("max_volume_dm3", "Largest common volume", "dm³", 2, is_primary=True)
TO_GAP: Final = Measure("shoulders_to_gap_deg", "Shoulders to gap", "°", 1, is_primary=True)
SPEED: Final = Measure("speed_m_s", "Walking speed", "m/s", 3, is_primary=True)
RATE: Final = Measure("collisions_per_tracked_min", "Collisions per tracked minute", "1/min", 1)
TO_NARROW_GAP: Final = Measure("shoulders_to_gap_narrow_deg", "Shoulders to narrow gaps", "°", 1)
TO_WAY: Final = Measure("shoulders_to_way_deg", "Shoulders to walking direction", "°", 1)
DURATION: Final = Measure("collision_s", "Duration of a collision", "s", 2)
CONTACT_SPEED: Final = Measure("collision_speed_m_s", "Speed at contact", "m/s", 3)
CLEARANCE: Final = Measure("clearance_mean_m", "Mean clearance", "m", 3)
PATH: Final = Measure("path_m", "Path length", "m", 1)
TIME: Final = Measure("time_s", "Time of a trial", "s", 1)
HESITATIONS: Final = Measure("hesitations", "Hesitations per trial", "", 2)
DENSITY: Final = Measure("density_per_m2", "Density (Voronoi cell)", "1/m²", 2)

PRIMARY: Final = (COLLISIONS, VOLUME, TO_GAP, SPEED)
FURTHER: Final = (
    RATE,
    TO_NARROW_GAP,
    TO_WAY,
    DURATION,
    CONTACT_SPEED,
    CLEARANCE,
    PATH,
    TIME,
    HESITATIONS,
    DENSITY,
)
RATINGS: Final = tuple(
    Measure(column, column.capitalize(), "", 1, is_rating=True)
    for column in ("agency", "change", "ownership", "presence")
)
"""Means of 7-point ratings, asked after every block."""

MEASURES: Final = (*PRIMARY, *FURTHER, *RATINGS)
