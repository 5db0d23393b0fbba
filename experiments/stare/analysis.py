"""From rows of trials to every conclusion of the stare study.

`analyse_rows` computes; `analyse_study` also writes the tables and figures into a folder.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from analysis.statistics.results import Cell
from experiments.stare.analysis_parameters import DEFAULT_PARAMETERS, AnalysisParameters
from experiments.stare.comparisons import (
    ALL_MEASURES,
    ANXIETY_TESTS,
    CONDITION_TESTS,
    LEVELS,
    PLACE_TESTS,
    SCORE_COLUMN,
    SECOND_VIEW_TESTS,
    ZONE_TESTS,
    Descriptive,
    condition_means,
    describe,
)
from experiments.stare.conclusions import Conclusion, conclude
from experiments.stare.exclusions import Selection, select_trials
from experiments.stare.gaze_changes import GazeChanges, gaze_changes
from lab.errors import DataError
from visavis.pairs import (
    AgreementCount,
    CorrelationTest,
    PairTest,
    Test,
    compare_pairs,
    correlate,
    count_agreement,
    published_cells,
    scores_of,
)
from visavis.sensitivity import SensitivityRow, sensitivity

SIMULATED_COLUMN = "is_simulated"


@dataclass(frozen=True)
class StareAnalysis:
    """Everything the study's analysis found.

    `means` has one row per participant and condition. `comparisons` are the thirty tests,
    `without_rules` the same on every finished trial, without exclusions. `sensitivity` and
    `second_view` are empty when the data for them are not there; `changes` None when the table does
    not say what changed the agents' gaze.
    """

    parameters: AnalysisParameters
    is_simulated: bool
    trials: pd.DataFrame = field(repr=False)
    selection: Selection = field(repr=False)
    means: pd.DataFrame = field(repr=False)
    anxiety_scores: "pd.Series[float]" = field(repr=False)
    descriptives: tuple[Descriptive, ...] = field(repr=False)
    comparisons: tuple[PairTest, ...] = field(repr=False)
    without_rules: tuple[PairTest, ...] = field(repr=False)
    places: tuple[PairTest, ...] = field(repr=False)
    zones: tuple[PairTest, ...] = field(repr=False)
    anxiety: tuple[CorrelationTest, ...] = field(repr=False)
    sensitivity: tuple[SensitivityRow, ...] = field(repr=False)
    second_view: tuple[PairTest, ...] = field(repr=False)
    conclusions: tuple[Conclusion, ...]
    changes: GazeChanges | None = None

    @property
    def n_participants(self) -> int:
        """Participants analysed."""
        return self.selection.flow.participants_in

    @property
    def agreements(self) -> dict[str, AgreementCount]:
        """How many published verdicts come back, by family of tests."""
        return {
            "conditions": count_agreement(self.comparisons),
            "places": count_agreement(self.places),
            "zones": count_agreement(self.zones),
            "anxiety": count_agreement(self.anxiety),
        }

    def statistics_rows(self) -> Iterator[dict[str, Cell]]:
        """Yield one flat row per test of every family, with the published verdict beside it."""
        main: tuple[Test, ...] = (*self.comparisons, *self.places, *self.zones, *self.anxiety)
        for test in main:
            yield test.row() | published_cells(test)
        for other in (*self.second_view, *self.without_rules):
            yield other.row()


def analyse_rows(
    trials: pd.DataFrame,
    answers: pd.DataFrame,
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    *,
    is_simulated: bool,
    sensitivity_rows: pd.DataFrame | None = None,
    levels: Mapping[str, Sequence[str]] = LEVELS,
    allow_mixture: bool = False,
) -> StareAnalysis:
    """Analyse a study from its tidy trial table and its participants' answers.

    `trials` has one row per trial attempt, practice and interrupted ones included, with the
    columns of the study's measures; `answers` one row per participant with `participant` and
    `social_anxiety_total`; `sensitivity_rows` the measures by padding and minimum duration;
    `levels` what this study varied, a part of the source's where it was set so. Works with any
    number of participants: what cannot be tested says why. Raises DataError for a table
    that is not this study's or that mixes simulated and real data; `allow_mixture` takes a
    mixture, which then counts as simulated.
    """
    if not (allow_mixture and is_simulated):
        _refuse_mixture(trials, is_simulated)
    selection = select_trials(trials, parameters)
    means = condition_means(selection.kept)
    rules = parameters.tests
    kept = selection.kept
    comparisons = compare_pairs(CONDITION_TESTS, kept, ALL_MEASURES, levels, rules)
    scores = scores_of(answers, SCORE_COLUMN)
    anxiety = correlate(ANXIETY_TESTS, means, scores, ALL_MEASURES, levels["condition"], rules)
    varied: tuple[SensitivityRow, ...] = ()
    if sensitivity_rows is not None and len(sensitivity_rows):
        varied = sensitivity(
            sensitivity_rows, kept, comparisons, CONDITION_TESTS, ALL_MEASURES, levels, rules
        )
    return StareAnalysis(
        parameters=parameters,
        is_simulated=is_simulated,
        trials=trials,
        selection=selection,
        means=means,
        anxiety_scores=scores,
        descriptives=describe(means),
        comparisons=comparisons,
        without_rules=compare_pairs(
            CONDITION_TESTS,
            selection.complete,
            ALL_MEASURES,
            levels,
            rules,
            family="without exclusions",
        ),
        places=compare_pairs(PLACE_TESTS, kept, ALL_MEASURES, levels, rules),
        zones=compare_pairs(ZONE_TESTS, kept, ALL_MEASURES, levels, rules),
        anxiety=anxiety,
        sensitivity=varied,
        second_view=tuple(
            test
            for family in SECOND_VIEW_TESTS
            if family.measures[0] in kept
            for test in compare_pairs(family, kept, ALL_MEASURES, levels, rules)
        ),
        conclusions=conclude(comparisons, anxiety),
        changes=gaze_changes(kept),
    )


def _refuse_mixture(trials: pd.DataFrame, is_simulated: bool) -> None:
    if SIMULATED_COLUMN not in trials:
        return
    kinds = set(trials[SIMULATED_COLUMN].astype(bool))
    if kinds - {is_simulated}:
        said = "simulated" if is_simulated else "real"
        other = "real" if is_simulated else "simulated"
        raise DataError(
            f"the trial table holds {other} sessions but was given as {said} data; analyse "
            "simulated and real sessions apart"
        )
