"""Split a power simulation into jobs that give the same answer anywhere and in any order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from visavis.analysis.power.contract import PowerStudy, Verdicts
from visavis.lab.errors import UsageError


@dataclass(frozen=True)
class PowerRequest:
    """A power simulation to run; `numbers` of participants rise."""

    numbers: tuple[int, ...]
    tests: tuple[str, ...]
    replicates: int
    effect: float
    alpha: float
    seed: int

    def __post_init__(self) -> None:
        if not self.numbers or list(self.numbers) != sorted(set(self.numbers)):
            raise UsageError(f"numbers of participants must rise, got {list(self.numbers)}")
        if self.replicates < 1:
            raise UsageError(f"{self.replicates} replicates say nothing; ask for hundreds")
        if not 0 < self.alpha < 1:
            raise UsageError(f"alpha must lie between 0 and 1, got {self.alpha:g}")
        if not self.effect >= 0:
            raise UsageError(f"the effect is a multiplier from 0 up, got {self.effect:g}")
        if self.seed < 0:
            raise UsageError(f"the seed must not be negative, got {self.seed}")


@dataclass(frozen=True)
class ReplicateJob:
    """Some replicates, by number from 0; `people` to draw from, None to simulate anew."""

    study: PowerStudy
    request: PowerRequest
    replicates: tuple[int, ...]
    people: pd.DataFrame | None = None


@dataclass(frozen=True)
class Replicate:
    """One simulated study, tested at every number of participants."""

    number: int
    verdicts: Mapping[int, Verdicts]


def study_seed(seed: int, replicate: int) -> int:
    """Return the seed of one replicate: its own whatever the number of replicates or processes."""
    return int(np.random.SeedSequence([seed, replicate]).generate_state(1, np.uint32)[0])


def jobs_of(
    study: PowerStudy, request: PowerRequest, *, size: int, people: pd.DataFrame | None = None
) -> list[ReplicateJob]:
    """Split the replicates into jobs of `size`."""
    if size < 1:
        raise UsageError(f"a job needs at least one replicate, got {size}")
    return [
        ReplicateJob(
            study, request, tuple(range(first, min(first + size, request.replicates))), people
        )
        for first in range(0, request.replicates, size)
    ]


def run_job(job: ReplicateJob) -> list[Replicate]:
    """Perform a job; the same on any machine with the same version of everything."""
    return [Replicate(number, _verdicts(job, number)) for number in job.replicates]


def _verdicts(job: ReplicateJob, number: int) -> Mapping[int, Verdicts]:
    request = job.request
    seed = study_seed(request.seed, number)
    numbers: Sequence[int] = request.numbers
    if job.people is None:
        return job.study.simulate(
            numbers, request.tests, effect=request.effect, seed=seed, alpha=request.alpha
        )
    return job.study.resample(job.people, numbers, request.tests, seed=seed, alpha=request.alpha)
