"""Select rating scales raters agree on, and cluster them by Ward's method."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import (
    MissingValue,
    StatisticsError,
    TooFewLevels,
    TooFewSubjects,
    UnknownMethod,
)
from visavis.analysis.statistics.results import Array

Spread: TypeAlias = Literal["sd", "variance"]


@dataclass(frozen=True)
class Selection:
    """Scales kept: `indices` indices, `profiles` (kept, motions) scaled to 0..1.

    `max_abs_mean` and `mean_spread` are of every scale, kept or not.
    """

    indices: npt.NDArray[np.intp]
    profiles: Array
    max_abs_mean: Array
    mean_spread: Array


@dataclass(frozen=True)
class Ward:
    """A Ward clustering.

    `increases` are the increases in within-cluster sum of squares in merge order, `heights` =
    √(2·increase) as dendrograms draw them; `labels` number clusters from 1 by first appearance;
    `means` (clusters, columns).
    """

    increases: Array
    heights: Array
    labels: npt.NDArray[np.intp]
    means: Array


def select_scales(
    ratings: npt.ArrayLike,
    *,
    least_abs_mean: float = 1.0,
    largest_spread: float = 0.85,
    spread: Spread = "sd",
    scale: tuple[float, float] = (-2.0, 2.0),
) -> Selection:
    """Keep scales some motion moves and raters agree on (Oshita et al.).

    `ratings` (raters, scales, motions). A scale stays when the largest |mean rating| over motions
    reaches `least_abs_mean` and the mean spread over motions is at most `largest_spread`; the
    source does not say whether its spread is SD or variance, so it is an option. `scale` gives
    the ends of the rating scale, mapped to 0 and 1.
    """
    array = np.asarray(ratings, dtype=np.float64)
    if array.ndim != 3:
        raise StatisticsError(f"ratings need raters × scales × motions, got shape {array.shape}")
    if array.shape[0] < 2:
        raise TooFewSubjects("agreement needs at least two raters")
    if not np.isfinite(array).all():
        rater, item, motion = (int(i) + 1 for i in np.argwhere(~np.isfinite(array))[0])
        raise MissingValue(f"no rating of scale {item}, motion {motion} by rater {rater}")
    if spread not in ("sd", "variance"):
        raise UnknownMethod(f"no spread {spread!r}; use 'sd' or 'variance'")
    means = array.mean(axis=0)
    variances = array.var(axis=0, ddof=1)
    spreads = np.sqrt(variances) if spread == "sd" else variances
    reach, mean_spread = np.abs(means).max(axis=1), spreads.mean(axis=1)
    indices = np.flatnonzero((reach >= least_abs_mean - 1e-12) & (mean_spread <= largest_spread))
    low, high = scale
    return Selection(indices, (means[indices] - low) / (high - low), reach, mean_spread)


def ward(points: npt.ArrayLike, n_clusters: int) -> Ward:
    """Merge points (n, columns) by the smallest increase in within-cluster sum of squares."""
    data = np.asarray(points, dtype=np.float64)
    n = data.shape[0]
    if data.ndim != 2 or not 1 <= n_clusters <= n:
        raise TooFewLevels(f"{n} points cannot form {n_clusters} clusters")
    if n == 1:
        return Ward(np.empty(0), np.empty(0), np.ones(1, dtype=np.intp), data.copy())
    from scipy.cluster.hierarchy import cut_tree, linkage  # late: tables need not pay for it

    tree = linkage(data, "ward")
    heights: Array = np.asarray(tree[:, 2], dtype=np.float64)
    numbers = cut_tree(tree, [n_clusters])[:, 0]
    first = [int(c) for c in dict.fromkeys(numbers.tolist())]
    labels = np.array([first.index(int(c)) + 1 for c in numbers], dtype=np.intp)
    means = np.stack([data[labels == c].mean(axis=0) for c in range(1, n_clusters + 1)])
    return Ward(heights**2 / 2, heights, labels, means)
