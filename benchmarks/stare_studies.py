"""Simulate many stare studies over the quick path, on several processes."""

from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context

from benchmarks.simulated_tracker import tracker_of
from experiments.stare.analysis_parameters import DEFAULT_PARAMETERS
from experiments.stare.anxiety import AnxietyCorrelation, anxiety_scores, correlate_anxiety
from experiments.stare.comparisons import (
    Comparison,
    Descriptive,
    compare_conditions,
    condition_means,
    describe,
)
from experiments.stare.positions import compare_zones
from experiments.stare.quick_study import run_study


@dataclass(frozen=True)
class StudyOutcome:
    """What one simulated study concludes."""

    seed: int
    descriptives: tuple[Descriptive, ...]
    comparisons: tuple[Comparison, ...]
    zones: tuple[Comparison, ...]
    anxiety: tuple[AnxietyCorrelation, ...]


@dataclass(frozen=True)
class _Job:
    seed: int
    participants: int
    effect: bool


def _simulate(job: _Job) -> StudyOutcome:
    study = run_study(
        tracker_of, seed=job.seed, participants=range(job.participants), effect=job.effect
    )
    means = condition_means(study.trials)
    return StudyOutcome(
        job.seed,
        describe(means),
        compare_conditions(means, DEFAULT_PARAMETERS),
        compare_zones(study.trials, DEFAULT_PARAMETERS) if job.effect else (),
        correlate_anxiety(means, anxiety_scores(study.answers), DEFAULT_PARAMETERS),
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
