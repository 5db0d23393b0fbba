"""Measure how two labellings of the same samples agree, by samples and by events."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.bool_]
Runs = npt.NDArray[np.int64]
"""(k, 2) first row and row after the last of every event."""


def runs_of(labels: Mask) -> Runs:
    """Return the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], labels, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def matched(a: Runs, b: Runs) -> int:
    """Count pairs of runs with intersection over union of at least a half, one to one.

    A run can meet at most one disjoint run by more than half of the union; ties at exactly a
    half are taken once.
    """
    pairs = 0
    taken = -1
    for first, end in a:
        for j in range(taken + 1, len(b)):
            if b[j, 0] >= end:
                break
            common = min(end, b[j, 1]) - max(first, b[j, 0])
            if common > 0 and 2 * common >= max(end, b[j, 1]) - min(first, b[j, 0]):
                pairs, taken = pairs + 1, j
                break
    return pairs


def overlapping(a: Runs, b: Runs) -> int:
    """Count pairs of runs as Hooge et al. (2018) do: any overlap, the earliest, one to one."""
    pairs = j = 0
    for first, end in a:
        while j < len(b) and b[j, 1] <= first:
            j += 1
        if j < len(b) and b[j, 0] < end:
            pairs, j = pairs + 1, j + 1
    return pairs


@dataclass(frozen=True)
class Agreement:
    """How two labellings agree on one class of movement.

    `kappa` Cohen's over pooled samples; `sample_f1` over samples; `f1` over events that overlap
    by half of their union; `overlap_f1` over events that overlap at all; `count_ratio` events of
    the second for each of the first. NaN where neither has the class.
    """

    kappa: float
    sample_f1: float
    f1: float
    overlap_f1: float
    count_ratio: float


def agreement(
    reference: Sequence[Mask],
    other: Sequence[Mask],
    reference_runs: Sequence[Runs] | None = None,
    other_runs: Sequence[Runs] | None = None,
) -> Agreement:
    """Return the agreement over all recordings together; runs default to those of the masks."""
    a, b = np.concatenate(reference), np.concatenate(other)
    runs_a = [runs_of(x) for x in reference] if reference_runs is None else reference_runs
    runs_b = [runs_of(x) for x in other] if other_runs is None else other_runs
    observed = (a == b).mean()
    chance = a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean())
    n_a, n_b = sum(map(len, runs_a)), sum(map(len, runs_b))
    pairs = sum(matched(x, y) for x, y in zip(runs_a, runs_b, strict=True))
    touching = sum(overlapping(x, y) for x, y in zip(runs_a, runs_b, strict=True))
    both = int(a.sum()) + int(b.sum())
    return Agreement(
        kappa=float((observed - chance) / (1 - chance)) if chance < 1 else np.nan,
        sample_f1=2 * int((a & b).sum()) / both if both else np.nan,
        f1=2 * pairs / (n_a + n_b) if n_a + n_b else np.nan,
        overlap_f1=2 * touching / (n_a + n_b) if n_a + n_b else np.nan,
        count_ratio=n_b / n_a if n_a else np.nan,
    )


def averaged(each: Sequence[Agreement]) -> Agreement:
    """Return the mean of several agreements."""
    table = [[e.kappa, e.sample_f1, e.f1, e.overlap_f1, e.count_ratio] for e in each]
    return Agreement(*(float(x) for x in np.mean(table, axis=0)))
