"""From rows of trials to every conclusion of the stare study.

`analyse_rows` computes; `analyse_study` also writes the tables and figures into a folder.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import pandas as pd

from analysis.statistics.results import Cell
from experiments.stare import agreement
from experiments.stare.agreement import Agreement, AgreementCount
from experiments.stare.analysis_parameters import DEFAULT_PARAMETERS, AnalysisParameters
from experiments.stare.anxiety import AnxietyCorrelation, anxiety_scores, correlate_anxiety
from experiments.stare.comparisons import (
    Comparison,
    Descriptive,
    compare_conditions,
    condition_means,
    describe,
)
from experiments.stare.conclusions import Conclusion, conclude
from experiments.stare.exclusions import Selection, select_trials
from experiments.stare.gaze_changes import GazeChanges, gaze_changes
from experiments.stare.positions import compare_places, compare_zones
from experiments.stare.sensitivity import SensitivityRow, second_view, sensitivity
from lab.errors import DataError

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
    comparisons: tuple[Comparison, ...] = field(repr=False)
    without_rules: tuple[Comparison, ...] = field(repr=False)
    places: tuple[Comparison, ...] = field(repr=False)
    zones: tuple[Comparison, ...] = field(repr=False)
    anxiety: tuple[AnxietyCorrelation, ...] = field(repr=False)
    sensitivity: tuple[SensitivityRow, ...] = field(repr=False)
    second_view: tuple[Comparison, ...] = field(repr=False)
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
            "conditions": self._counted(
                [agreement.condition_agreement(c) for c in self.comparisons]
            ),
            "places": self._counted([agreement.place_agreement(c) for c in self.places]),
            "zones": self._counted([agreement.place_agreement(c) for c in self.zones]),
            "anxiety": self._counted([agreement.anxiety_agreement(c) for c in self.anxiety]),
        }

    @staticmethod
    def _counted(found: list[Agreement]) -> AgreementCount:
        return agreement.count(found)

    def statistics_rows(self) -> Iterator[dict[str, Cell]]:
        """Yield one flat row per test of every family, with the published verdict beside it."""
        for comparison in self.comparisons:
            found = agreement.condition_agreement(comparison)
            yield comparison.row() | _agreement_cells(found)
        for comparison in (*self.places, *self.zones):
            yield comparison.row() | _agreement_cells(agreement.place_agreement(comparison))
        for correlation in self.anxiety:
            yield correlation.row() | _agreement_cells(agreement.anxiety_agreement(correlation))
        for comparison in self.second_view:
            yield comparison.row()
        for comparison in self.without_rules:
            yield comparison.row()


def analyse_rows(
    trials: pd.DataFrame,
    answers: pd.DataFrame,
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    *,
    is_simulated: bool,
    sensitivity_rows: pd.DataFrame | None = None,
    allow_mixture: bool = False,
) -> StareAnalysis:
    """Analyse a study from its tidy trial table and its participants' answers.

    `trials` has one row per trial attempt, practice and interrupted ones included, with the
    columns of the study's measures; `answers` one row per participant with `participant` and
    `anxiety_total`; `sensitivity_rows` the measures by padding and minimum duration. Works with
    any number of participants: what cannot be tested says why. Raises DataError for a table
    that is not this study's or that mixes simulated and real data; `allow_mixture` takes a
    mixture, which then counts as simulated.
    """
    if not (allow_mixture and is_simulated):
        _refuse_mixture(trials, is_simulated)
    selection = select_trials(trials, parameters)
    means = condition_means(selection.kept)
    comparisons = compare_conditions(means, parameters)
    scores = anxiety_scores(answers)
    anxiety = correlate_anxiety(means, scores, parameters)
    varied: tuple[SensitivityRow, ...] = ()
    if sensitivity_rows is not None and len(sensitivity_rows):
        varied = sensitivity(sensitivity_rows, selection.kept, comparisons, parameters)
    return StareAnalysis(
        parameters=parameters,
        is_simulated=is_simulated,
        trials=trials,
        selection=selection,
        means=means,
        anxiety_scores=scores,
        descriptives=describe(means),
        comparisons=comparisons,
        without_rules=compare_conditions(
            condition_means(selection.complete), parameters, family="without exclusions"
        ),
        places=compare_places(selection.kept, parameters),
        zones=compare_zones(selection.kept, parameters),
        anxiety=anxiety,
        sensitivity=varied,
        second_view=second_view(selection.kept, parameters),
        conclusions=conclude(comparisons, anxiety),
        changes=gaze_changes(selection.kept),
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


def _agreement_cells(found: Agreement) -> dict[str, Cell]:
    return {"published_significant": found.published, "agrees_with_published": found.agrees}
