"""Which points of a space of parameters blends of given examples come to, and which none does.

Weights are drawn of few examples and of many; every blend is measured by its own features, so the
map says what can be made, not what was asked for.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.walk_features import (
    FeatureTable,
    feature_table,
    features_of,
)

SPREADS: Final = (0.05, 0.2, 0.6)
"""Concentrations of Dirichlet's distribution: from single examples to all of them."""
CELLS: Final = 10


@dataclass(frozen=True, eq=False)
class Reach:
    """Where blends come to: `points` (m, d) from 0 to 1, of parameters by `names`."""

    names: tuple[str, ...]
    points: Vector

    def cells(self, i: int, j: int, count: int = CELLS) -> npt.NDArray[np.bool_]:
        """Return which cells (count, count) of the plane of two parameters any blend comes to,
        whatever the others are; rows are of parameter j.
        """
        own = self.points[:, [i, j]]
        inside = own[((own >= 0.0) & (own <= 1.0)).all(axis=1)]
        at = np.minimum((inside * count).astype(np.int64), count - 1)
        reached = np.zeros((count, count), dtype=np.bool_)
        reached[at[:, 1], at[:, 0]] = True
        return reached

    @property
    def planes(self) -> dict[tuple[int, int], float]:
        """The share of cells that any blend comes to, by the two parameters of a plane."""
        pairs = combinations(range(len(self.names)), 2)
        return {(i, j): float(self.cells(i, j).mean()) for i, j in pairs}


def reach_of(
    examples: Examples, names: tuple[str, ...], count: int, rng: np.random.Generator
) -> Reach:
    """Return what so many random blends come to, and the examples, in groups of features."""
    n = len(examples)
    spread = np.array(SPREADS)[np.arange(count) % len(SPREADS)]
    drawn = [rng.dirichlet(np.full(n, concentration)) for concentration in spread]
    weights = [*np.eye(n), *drawn]
    table: FeatureTable = feature_table(examples)
    rows = [list(features_of(Blend(examples, own).sampled()).values()) for own in weights]
    return Reach(names, table.primary_of(table.scaled(np.array(rows))))
