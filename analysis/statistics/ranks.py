"""Rank numbers, ties sharing the average rank."""

import numpy as np

from visavis.analysis.statistics.results import Array

JACKKNIFE_UP_TO = 2000
"""Cases up to which each is left out once; beyond, memory runs short."""


def average_ranks(values: Array) -> Array:
    """Return ranks 1..n of a column (n,); tied values share their average rank."""
    order = np.argsort(values, kind="stable")
    rising = values[order]
    is_start = np.ones(values.size + 1, np.bool_)
    np.not_equal(rising[1:], rising[:-1], out=is_start[1:-1])
    ranks = np.empty(values.size)
    if is_start.all():  # no ties, as of most measures
        ranks[order] = np.arange(1, values.size + 1)
        return ranks
    bounds = np.flatnonzero(is_start)
    starts, ends = bounds[:-1], bounds[1:]
    ranks[order] = np.repeat((starts + ends + 1) / 2, ends - starts)
    return ranks


def tie_sizes(values: Array) -> Array:
    """Return how many values share each distinct value."""
    return np.unique(values, return_counts=True)[1].astype(np.float64)


def ranks_without_each(ranks: Array) -> Array:
    """Return ranks (n,) counted anew without each case, (n, n); the diagonal has no meaning."""
    of_all, gone = ranks[None, :], ranks[:, None]
    anew: Array = of_all - (of_all > gone) - 0.5 * (of_all == gone)
    return anew
