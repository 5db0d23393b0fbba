"""Simulate and analyse studies of waving in memory, with people of any population.

Over the study's own quick path (`visavis.experiments.waving.quick_study`), which
`tests/experiments/waving/test_session.py` holds to a session.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from visavis.experiments.waving.judgement import DEFAULT_POPULATION, Population
from visavis.experiments.waving.participant import WavingParticipant
from visavis.experiments.waving.quick_study import quick_trials
from visavis.experiments.waving.study import making_of, study
from visavis.results.analysis import StudyAnalysis
from visavis.results.opened_study import OpenedStudy
from visavis.study.experiment import StudyExperiment


def quick_session(
    experiment: StudyExperiment,
    index: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
) -> list[dict[str, Any]]:
    """Return the rows of one participant's trials, practice left out."""
    person = WavingParticipant(index, seed, effect, population=population)
    making = making_of(experiment.parameters)
    return [
        {
            "participant": f"{index:02d}",
            "trial_id": trial.trial_id,
            **{name: str(value) for name, value in trial.factors.items()},
            **answers,
            "is_practice": False,
            "status": "complete",
            "session": 1,
            "attempt": 1,
            "is_simulated": True,
        }
        for trial, answers in quick_trials(person, experiment.plan(index, seed), making)
    ]


def quick_study(
    participants: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
    parameters: Mapping[str, Any] | None = None,
) -> pd.DataFrame:
    """Simulate a study; one row per trial, as a session's measures have them."""
    experiment = OpenedStudy(study).experiment(parameters or {})
    people = range(participants)
    return pd.DataFrame(
        [
            row
            for i in people
            for row in quick_session(experiment, i, seed, effect=effect, population=population)
        ]
    )


def quick_analysis(
    trials: pd.DataFrame, parameters: Mapping[str, Any] | None = None
) -> StudyAnalysis:
    """Analyse trials of `quick_study` as those of sessions are."""
    opened = OpenedStudy(study)
    planned = trials.groupby("participant").size()
    return opened.analysis_of_rows(
        opened.experiment(parameters or {}),
        trials,
        trials[["participant"]].drop_duplicates(),
        planned_counts={str(name): int(n) for name, n in planned.items()},
    )
