"""Does the place of the active agent matter: nine places, three zones."""

import pandas as pd

from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.comparisons import Comparison, compare
from experiments.stare.design import ZONES
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import DWELL, FIRST_TIME, FIXATION_COUNT, MEASURES
from stimuli.scenes.audience import ACTIVE_PLACES

PLACE_MEASURES = (DWELL, FIXATION_COUNT)
"""The measures every trial has, so that a mean over two trials per place is rarely missing."""


def place_means(rows: pd.DataFrame, by: str = "place") -> pd.DataFrame:
    """Return one row per participant, condition and place (or zone) with the mean measures."""
    columns = [m.column for m in MEASURES]
    return rows.groupby(["participant", "condition", by], sort=True)[columns].mean().reset_index()


def compare_places(rows: pd.DataFrame, parameters: AnalysisParameters) -> tuple[Comparison, ...]:
    """Compare A with D at each of the nine places: alpha over nine for each measure."""
    means = place_means(rows)
    return tuple(
        compare(
            means[means["place"] == place],
            measure,
            ("A", "D"),
            parameters,
            family="places",
            n_tests=len(ACTIVE_PLACES),
            where=place,
        )
        for place in ACTIVE_PLACES
        for measure in PLACE_MEASURES
    )


def compare_zones(rows: pd.DataFrame, parameters: AnalysisParameters) -> tuple[Comparison, ...]:
    """Compare the first fixation time in each zone: alpha over three for each comparison."""
    means = place_means(rows, "zone")
    return tuple(
        compare(
            means[means["zone"] == zone],
            FIRST_TIME,
            pair,
            parameters,
            family="zones",
            n_tests=len(ZONES),
            where=zone,
        )
        for zone in ZONES
        for pair in COMPARISONS
    )
