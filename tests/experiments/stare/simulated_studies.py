"""Simulate many stare studies over the quick path, on several processes."""

from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context

import pandas as pd

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.stare.comparisons import (
    ALL_MEASURES,
    ANXIETY_TESTS,
    CONDITION_TESTS,
    MEASURES,
    SCORE_COLUMN,
    ZONE_TESTS,
)
from visavis.experiments.stare.design import CONDITIONS
from visavis.experiments.stare.published import MEANS
from visavis.experiments.stare.study import experiment_of, study
from visavis.results.family_tests import (
    CorrelationTest,
    PairTest,
    compare_pairs,
    correlate,
    scores_of,
)
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.study.measures import Measure, aggregate_cells


def condition_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant and condition: means over trials and `n_trials`."""
    return aggregate_cells(rows, MEASURES, ["condition"]).rename(columns={"n": "n_trials"})


@dataclass(frozen=True)
class Descriptive:
    """One measure in one condition over participants; `sd` NaN below two of them."""

    measure: Measure
    condition: str
    n: int
    mean: float
    sd: float

    @property
    def deviation_01(self) -> float:
        """How far the mean lies from the published one, as a signed share of it."""
        return self.mean / MEANS[self.condition][self.measure.column].mean - 1.0


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


@dataclass(frozen=True)
class StudyOutcome:
    """What one simulated study concludes."""

    seed: int
    descriptives: tuple[Descriptive, ...]
    comparisons: tuple[PairTest, ...]
    zones: tuple[PairTest, ...]
    anxiety: tuple[CorrelationTest, ...]


@dataclass(frozen=True)
class _Job:
    seed: int
    participants: int
    effect: bool


def _simulate(job: _Job) -> StudyOutcome:
    experiment, people = experiment_of(), range(job.participants)
    made = quick_study(
        OpenedStudy(study), experiment, tracker_of, people, seed=job.seed, effect=float(job.effect)
    )
    means, levels = condition_means(made.trials), experiment.levels
    return StudyOutcome(
        job.seed,
        describe(means),
        compare_pairs(CONDITION_TESTS, made.trials, ALL_MEASURES, levels),
        compare_pairs(ZONE_TESTS, made.trials, ALL_MEASURES, levels) if job.effect else (),
        correlate(
            ANXIETY_TESTS, means, scores_of(made.people, SCORE_COLUMN), ALL_MEASURES, CONDITIONS
        ),
    )


def simulate_studies(
    seeds: range, *, participants: int, effect: bool, processes: int
) -> Iterator[StudyOutcome]:
    """Yield the outcome of one study per seed, in the order of the seeds."""
    jobs = [_Job(seed, participants, effect) for seed in seeds]
    if processes <= 1:
        yield from map(_simulate, jobs)
        return
    with get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(_simulate, jobs)
