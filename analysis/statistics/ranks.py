"""Rank numbers, ties sharing the average rank."""

import numpy as np

from visavis.analysis.statistics.results import Array


def average_ranks(values: Array) -> Array:
    """Return ranks 1..n of a column (n,); tied values share their average rank."""
    order = np.argsort(values, kind="stable")
    rising = values[order]
    starts = np.flatnonzero(np.concatenate(([True], rising[1:] != rising[:-1])))
    ends = np.concatenate((starts[1:], [values.size]))
    ranks = np.empty(values.size)
    ranks[order] = np.repeat((starts + ends + 1) / 2, ends - starts)
    return ranks


def tie_sizes(values: Array) -> Array:
    """Return how many values share each distinct value."""
    return np.unique(values, return_counts=True)[1].astype(np.float64)
