"""Measures and comparisons of the study: the source's first, with the numbers it prints."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.experiments.crowd import published
from visavis.experiments.crowd.design import AFTER, BEFORE, CONTROL_GROUP, HAPTIC, HAPTICS_GROUP
from visavis.lab.errors import UsageError
from visavis.study.comparisons import Compare
from visavis.study.exclusions import Exclusion
from visavis.study.measures import Measure
from visavis.study.pairs import Printed

PAIRS: Final = ((BEFORE, HAPTIC), (HAPTIC, AFTER), (BEFORE, AFTER))
"""Every two blocks, in the order of the published table of similarities."""

COLLISIONS: Final = Measure("collisions", "1", "Collisions per walk")
VOLUME: Final = Measure("max_volume_dm3", "dm³", "Largest common volume")
VOLUME_AS_PUBLISHED: Final = Measure(
    published.VOLUME_OF_CUBES, "dm³", "Largest common volume, by the source's rule"
)
"""Cubes that touch both bodies: stands beside printed volumes, and nothing else is compared."""
TO_GAP: Final = Measure("shoulders_to_gap_deg", "deg", "Shoulders to gap")
SPEED: Final = Measure("speed_m_s", "m/s", "Walking speed")
PRIMARY: Final = (COLLISIONS, VOLUME, TO_GAP, SPEED)
FURTHER: Final = (
    Measure("collisions_per_tracked_min", "1/min", "Collisions per tracked minute"),
    Measure("shoulders_to_gap_narrow_deg", "deg", "Shoulders to narrow gaps"),
    Measure("shoulders_to_way_deg", "deg", "Shoulders to walking direction"),
    Measure("collision_s", "s", "Duration of a collision"),
    Measure("collision_speed_m_s", "m/s", "Speed at contact"),
    Measure("clearance_mean_m", "m", "Mean clearance"),
    Measure("path_m", "m", "Path length"),
    Measure("time_s", "s", "Time of a walk"),
    Measure("hesitations", "1", "Hesitations per walk"),
    Measure("density_per_m2", "1/m²", "Density (Voronoi cell)"),
)
RATINGS: Final = tuple(
    Measure(column, "1", column.capitalize())
    for column in ("agency", "change", "ownership", "presence")
)
"""Means of 7-point ratings, asked after every block."""
MEASURES: Final = (*PRIMARY, *FURTHER, *RATINGS)
MEANS_OF: Final = {VOLUME.column: VOLUME_AS_PUBLISHED.column}
"""Measures whose printed means are of another rule."""

RULES: Final = (
    Exclusion(
        "max_lost_01",
        "trial",
        "lost_01",
        0.10,
        "{value:.0%} of the walk not tracked (limit {limit:.0%})",
        what="share of the walk that was not tracked",
    ),
    Exclusion(
        "came_back",
        "trial",
        "came_back",
        1.0,
        "did not come back to the mark in time",
        above=False,
        what="return to the mark in time (1 yes, 0 no)",
    ),
    Exclusion(
        "min_walks_01",
        "participant",
        "smallest_cell_01",
        0.5,
        "{value:.0%} of the walks planned for a block can be used (limit {limit:.0%})",
        above=False,
    ),
)
"""Exclusion rules for walks and participants; all are this platform's, none the source's."""


@dataclass(frozen=True)
class PathThresholds:
    """How paths are compared; all of it appears in the report.

    `n_splits` is the source's. `dice_bound` and `path_bound_01` are the differences of paths that
    are still called equal (about one standard deviation between configurations in the source, and
    a twentieth of the path); they and the rest are this platform's.
    """

    n_splits: int = 30
    n_permutations: int = 999
    dice_bound: float = 0.05
    path_bound_01: float = 0.05
    splits_seed: int = 20200

    def __post_init__(self) -> None:
        for name in ("dice_bound", "path_bound_01"):
            if not 0 < getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a number between 0 and 1")
        for name in ("n_splits", "n_permutations"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a whole number above 0")


def comparisons() -> Iterator[Compare]:
    """Yield the blocks compared in every measure, of those who felt vibrations and of controls,
    and whether the change over blocks differs between the groups.

    A measure that the source did not test is exploratory.
    """
    for measure in MEASURES:
        column = measure.column
        # Four ratings ask one question, so they are corrected together; the source's measures of
        # movement are tested as there, and its hypotheses need two of them each.
        is_rating = measure in RATINGS
        yield Compare(
            column,
            within="condition",
            family="ratings" if is_rating else "planned",
            correction="holm" if is_rating else "none",
            options=(("always_posthoc", True),),
            published=published.TESTS.get(column),
            pairs=dict(_printed_pairs(column)),
            exploratory=column not in published.TESTS,
            only={"group": HAPTICS_GROUP},
        )
    for measure in MEASURES:
        yield Compare(
            measure.column,
            within="condition",
            correction="none",
            options=(("always_posthoc", True),),
            exploratory=True,
            only={"group": CONTROL_GROUP},
        )
    for measure in PRIMARY:
        yield Compare(
            measure.column,
            within="condition",
            between="group",
            test="rm",
            correction="none",
            exploratory=True,
        )


def _printed_pairs(column: str) -> Iterator[tuple[tuple[str, str], Printed]]:
    if column not in published.TESTS:
        return
    different, where = published.DIFFERENT.get(column, {}), published.TESTS[column].where
    means = published.MEANS[MEANS_OF.get(column, column)]
    for pair in PAIRS:
        if pair in different:
            sign = int(np.sign(means[pair[1]].mean - means[pair[0]].mean))
            yield pair, Printed(True, different[pair], direction=sign, where=where)
        else:
            yield pair, Printed(False, where=where)
