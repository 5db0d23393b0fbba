"""What the study compares: four families of the source's tests, and a second view of fixations."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from experiments.stare import published
from experiments.stare.design import CONDITIONS, DEPTHS, ZONES
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import CONDITION_NAMES, DWELL, FIRST_TIME, FIXATION_COUNT, MEASURES
from visavis.looks import IDT, IVT
from visavis.measures import Measure, aggregated
from visavis.pairs import Correlate, CorrelationTest, Family, Pairs, PairTest, Printed

COLUMNS: Final = tuple(m.column for m in MEASURES)
SCORE_COLUMN: Final = "social_anxiety_total"
"""Liebowitz total, 0 to 144, in the table of participants' answers."""
LEVELS: Final[dict[str, tuple[str, ...]]] = {
    "condition": CONDITIONS,
    "zone": ZONES,
    "place": tuple(f"{zone}_{depth}" for zone in ZONES for depth in DEPTHS),
}
"""What the whole study varies."""
SECOND_VIEW_MEASURES: Final = (
    Measure(IVT + "on_active_count", "1", "Number of fixations on the agent by velocity (I-VT)"),
    Measure(IDT + "on_active_count", "1", "Number of fixations on the agent by dispersion (I-DT)"),
)
ALL_MEASURES: Final = {m.column: m for m in (*MEASURES, *SECOND_VIEW_MEASURES)}


def _of_conditions(test: PairTest) -> Printed:
    row = published.published_test(test.first, test.second, test.measure.column)
    first, second = (published.MEANS[c][row.measure].mean for c in (test.first, test.second))
    return Printed(
        row.is_significant,
        row.p,
        row.stars,
        int(np.sign(second - first)),
        t=row.t,
        eta_p2=row.eta_p2,
        is_wilcoxon=row.t is None,
        where=row.table,
    )


def _of_places(test: PairTest) -> Printed:
    row = published.POSITION_TESTS[test.where][test.measure.column]
    return Printed(row.stars > 0, row.p, row.stars, where="table A.4")


def _of_zones(test: PairTest) -> Printed:
    row = published.ZONE_TESTS[test.where][test.first, test.second]
    return Printed(row.stars > 0, row.p, row.stars, where="table A.5")


def _of_anxiety(test: CorrelationTest) -> Printed:
    """Return a printed correlation; what the source does not print was not significant."""
    for row in published.CORRELATIONS:
        if (row.condition, row.measure) == (test.level, test.measure.column):
            return Printed(True, row.p, direction=int(np.sign(row.r_s)), r=row.r_s)
    return Printed(False)


_GAZE: Final[dict[str, Any]] = {"names": CONDITION_NAMES, "noun": "gaze"}
CONDITION_TESTS: Final = Pairs(
    "conditions", COLUMNS, "condition", COMPARISONS, printed=_of_conditions,
    words="the thirty tests: five comparisons of six measures", **_GAZE,
)  # fmt: skip
PLACE_TESTS: Final = Pairs(
    "places", [DWELL.column, FIXATION_COUNT.column], "condition", [("A", "D")], each="place",
    shared=("each",), printed=_of_places,
    words="averted against directed gaze at each of nine places", **_GAZE,
)  # fmt: skip
"""Measures that every trial has, so that a mean over two trials per place is rarely missing."""
ZONE_TESTS: Final = Pairs(
    "zones", [FIRST_TIME.column], "condition", COMPARISONS, each="zone", shared=("each",),
    printed=_of_zones, words="first fixation time by zone", **_GAZE,
)  # fmt: skip
ANXIETY_TESTS: Final = Correlate(
    "anxiety", COLUMNS, "condition", SCORE_COLUMN, "social anxiety", "the anxiety score",
    printed=_of_anxiety, words="Spearman correlations with the social anxiety score", **_GAZE,
)  # fmt: skip
SECOND_VIEW_TESTS: Final = tuple(
    Pairs(
        "second view", [m.column], "condition", COMPARISONS,
        words="comparisons on fixations found by velocity and by dispersion", **_GAZE,
    )
    for m in SECOND_VIEW_MEASURES
)  # fmt: skip
FAMILIES: Final[tuple[Family, ...]] = (
    CONDITION_TESTS,
    PLACE_TESTS,
    ZONE_TESTS,
    ANXIETY_TESTS,
    *SECOND_VIEW_TESTS,
)


def condition_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant and condition: means over trials and `n_trials`."""
    return aggregated(rows, MEASURES, ["condition"]).rename(columns={"n": "n_trials"})


def place_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant, condition and place with the mean measures."""
    return aggregated(rows, MEASURES, ["condition", "place"])


@dataclass(frozen=True)
class Descriptive:
    """One measure in one condition over participants; `sd` NaN below two of them."""

    measure: Measure
    condition: str
    n: int
    mean: float
    sd: float


def describe(means: pd.DataFrame) -> tuple[Descriptive, ...]:
    """Describe every measure in every condition over the participants who have it."""
    described = []
    for measure in MEASURES:
        for condition in CONDITIONS:
            values = means.loc[means["condition"] == condition, measure.column].dropna()
            described.append(
                Descriptive(
                    measure,
                    condition,
                    len(values),
                    float(values.mean()) if len(values) else float("nan"),
                    float(values.std(ddof=1)) if len(values) > 1 else float("nan"),
                )
            )
    return tuple(described)


def mean_deviation_01(found: Descriptive) -> float:
    """Return how far a mean lies from the published one, as a signed share of it."""
    return found.mean / published.MEANS[found.condition][found.measure.column].mean - 1.0
