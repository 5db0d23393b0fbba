"""Simulate many stare studies over the quick path, on several processes."""

from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context

from benchmarks.simulated_tracker import tracker_of
from experiments.stare.comparisons import (
    ALL_MEASURES,
    ANXIETY_TESTS,
    CONDITION_TESTS,
    LEVELS,
    SCORE_COLUMN,
    ZONE_TESTS,
    Descriptive,
    condition_means,
    describe,
)
from experiments.stare.design import CONDITIONS
from experiments.stare.quick_study import run_study
from visavis.pairs import CorrelationTest, PairTest, compare_pairs, correlate, scores_of


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
    study = run_study(
        tracker_of, seed=job.seed, participants=range(job.participants), effect=job.effect
    )
    means = condition_means(study.trials)
    return StudyOutcome(
        job.seed,
        describe(means),
        compare_pairs(CONDITION_TESTS, study.trials, ALL_MEASURES, LEVELS),
        compare_pairs(ZONE_TESTS, study.trials, ALL_MEASURES, LEVELS) if job.effect else (),
        correlate(
            ANXIETY_TESTS, means, scores_of(study.answers, SCORE_COLUMN), ALL_MEASURES, CONDITIONS
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
