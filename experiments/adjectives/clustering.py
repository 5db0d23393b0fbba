"""From ratings to primary parameters: selection, impression matrix, clusters, reliability."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from visavis.analysis.statistics.agreement import icc
from visavis.analysis.statistics.clusters import Selection, Ward, select_scales, ward
from visavis.analysis.statistics.errors import StatisticsError
from visavis.experiments.adjectives.pairs import FACTORS, PAIRS, PRINTED
from visavis.experiments.adjectives.walks import walk_name
from visavis.lab.geometry import Vector


def rating_cube(rows: pd.DataFrame, walks: Sequence[str]) -> Vector:
    """Return ratings (raters, pairs, walks) of all who rated every walk on every pair."""
    people = []
    for _, own in rows.groupby("participant", sort=True):
        names = [walk_name(e, s) for e, s in zip(own["emotion"], own["speed"], strict=True)]
        table = (
            own.assign(walk=names).drop_duplicates("walk").set_index("walk").reindex(list(walks))
        )
        values = table[list(PAIRS)].apply(pd.to_numeric, errors="coerce").to_numpy(np.float64).T
        if np.isfinite(values).all():
            people.append(values)
    return np.array(people).reshape(len(people), len(PAIRS), len(walks))


@dataclass(frozen=True, eq=False)
class Impressions:
    """Ratings (raters, pairs, walks), and what follows from them."""

    walks: tuple[str, ...]
    ratings: Vector

    @cached_property
    def selection(self) -> Selection:
        """Pairs that some walk moves and raters agree on."""
        return select_scales(self.ratings)

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the pairs kept."""
        return tuple(PAIRS[i] for i in self.selection.indices)

    @cached_property
    def clusters(self) -> Ward:
        """Four clusters of the pairs kept, by their profiles over walks.

        Raises:
            StatisticsError: fewer than four pairs were kept.
        """
        return ward(self.selection.profiles, len(FACTORS))

    @cached_property
    def cluster_of(self) -> tuple[str, ...]:
        """The cluster of each pair kept, called as the source's cluster (set B) with which it
        shares most pairs, each name once.
        """
        labels = self.clusters.labels
        overlap = np.array(
            [
                [
                    sum(
                        pair in PRINTED["B"][factor]
                        for pair, label in zip(self.kept, labels, strict=True)
                        if label == c
                    )
                    for factor in FACTORS
                ]
                for c in range(1, len(FACTORS) + 1)
            ]
        )
        _, columns = linear_sum_assignment(-overlap)
        return tuple(FACTORS[columns[label - 1]] for label in labels)

    @cached_property
    def primary(self) -> Vector:
        """The primary parameters (walks, 4): means of a cluster's pairs, from 0 to 1."""
        profiles = self.selection.profiles
        member = [[c == factor for c in self.cluster_of] for factor in FACTORS]
        return np.array([profiles[np.array(own)].mean(axis=0) for own in member]).T

    def matrix(self) -> pd.DataFrame:
        """Return the impression matrix: a row a walk, primary parameters, then the pairs kept."""
        table = pd.DataFrame(self.primary, columns=list(FACTORS))
        table.insert(0, "name", list(self.walks))
        pairs = pd.DataFrame(self.selection.profiles.T, columns=list(self.kept))
        return pd.concat([table, pairs], axis=1)

    def reliability(self, pair: str) -> tuple[float, float]:
        """Return ICC2 of one rater and Cronbach's α of all raters (ICC3k) about a pair.

        Walks are the things rated; NaN where nobody's ratings differ.
        """
        table = self.ratings[:, PAIRS.index(pair)].T
        try:
            by_kind = {one.kind: one.value for one in icc(table)}
        except StatisticsError:
            return float("nan"), float("nan")
        return by_kind["ICC2"], by_kind["ICC3k"]

    def cluster_alpha(self, factor: str) -> float:
        """Return Cronbach's α of a cluster's pairs over all ratings of walks; NaN for one pair."""
        own = [
            PAIRS.index(p) for p, c in zip(self.kept, self.cluster_of, strict=True) if c == factor
        ]
        if len(own) < 2:
            return float("nan")
        items = self.ratings[:, own].transpose(0, 2, 1).reshape(-1, len(own))
        k = len(own)
        whole = items.sum(axis=1).var(ddof=1)
        return float(k / (k - 1) * (1 - items.var(axis=0, ddof=1).sum() / whole))


def adjusted_rand(a: Sequence[object], b: Sequence[object]) -> float:
    """Return how alike two partitions are: 1 the same, 0 as by chance (Hubert & Arabie 1985)."""
    table = pd.crosstab(pd.Series(list(a)), pd.Series(list(b))).to_numpy(np.float64)

    def pairs(counts: Vector) -> float:
        return float((counts * (counts - 1) / 2).sum())

    same, rows, columns = pairs(table), pairs(table.sum(axis=1)), pairs(table.sum(axis=0))
    chance = rows * columns / pairs(np.array([table.sum()]))
    most = (rows + columns) / 2
    return 1.0 if most == chance else (same - chance) / (most - chance)
