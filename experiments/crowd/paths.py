"""Do people take the same way through a crowd in every block? Similarity as published, and fair."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.cells import (
    BlockComparison,
    Paths,
    Variant,
    between_blocks,
    compare_blocks_together,
    jackknifed_excess,
    own_block_excess,
    within_block,
)
from analysis.cells.triangulation import Cell
from analysis.statistics import Equivalence, tost_one_sample
from analysis.statistics.errors import StatisticsError
from experiments.crowd.analysis_parameters import AnalysisParameters
from experiments.crowd.design import CONDITIONS
from experiments.crowd.terms import PAIRS
from lab.geometry import Vector

VARIANTS: Final[tuple[Variant, ...]] = ("union", "frequency", "pairs")
VARIANT_NAMES: Final = {
    "union": "union of the group's cells",
    "frequency": "frequency of visits",
    "pairs": "mean over pairs of people",
}
MIN_PEOPLE: Final = 4

CellsBy = Mapping[tuple[str, int, str], frozenset[Cell]]
"""Cells of a walk by condition, configuration and participant."""


@dataclass(frozen=True)
class PairSimilarity:
    """Paths of two blocks in one variant of Dice.

    `by_configuration` (configurations,) between whole blocks, as published. `fair` compares at
    equal group sizes with different people on both sides, None with `problem` where too few.
    """

    pair: tuple[str, str]
    variant: Variant
    by_configuration: Vector
    fair: BlockComparison | None
    problem: str = ""

    @property
    def mean(self) -> float:
        """Mean over configurations."""
        return _mean(self.by_configuration)

    @property
    def sd(self) -> float:
        """Standard deviation over configurations."""
        return _sd(self.by_configuration)


@dataclass(frozen=True)
class PathEquivalence:
    """Whether people's own paths are the same in two blocks, person by person.

    `excess` (people,) how much more each path resembles others' in its own block than in the
    other one; `test` whether its mean lies within the bounds, by the scatter of jackknife values
    because excesses of people depend on one another; None with `problem`.
    """

    pair: tuple[str, str]
    excess: Vector
    test: Equivalence | None
    problem: str = ""


@dataclass(frozen=True)
class PathAnalysis:
    """Similarity of paths: `within` (blocks × splits) per variant, as published."""

    configurations: tuple[int, ...]
    n_people: int
    within: Mapping[Variant, Vector]
    pairs: tuple[PairSimilarity, ...]
    equivalence: tuple[PathEquivalence, ...]

    def pair(self, pair: tuple[str, str], variant: Variant = "union") -> PairSimilarity:
        """Return the similarity of two blocks in a variant."""
        return next(p for p in self.pairs if p.pair == pair and p.variant == variant)


def analyse_paths(cells: CellsBy, parameters: AnalysisParameters) -> PathAnalysis:
    """Compare the cells that people walked through; every random split comes from one seed."""
    people = sorted({person for _, _, person in cells})
    configurations = tuple(sorted({configuration for _, configuration, _ in cells}))

    def paths(condition: str, configuration: int) -> Paths:
        return [cells.get((condition, configuration, person)) for person in people]

    within: dict[Variant, Vector] = {}
    pairs = []
    for variant in VARIANTS:
        within[variant] = _within(cells, people, configurations, variant, parameters)
        for pair in PAIRS:
            crowds = [(paths(pair[0], c), paths(pair[1], c)) for c in configurations]
            fair, problem = _fair(crowds, variant, parameters)
            values = np.array([_between(a, b, variant) for a, b in crowds])
            pairs.append(PairSimilarity(pair, variant, values, fair, problem))
    equivalence = []
    for pair in PAIRS:
        crowds = [(paths(pair[0], c), paths(pair[1], c)) for c in configurations]
        equivalence.append(_equivalence(pair, crowds, parameters))
    return PathAnalysis(configurations, len(people), within, tuple(pairs), tuple(equivalence))


def _known(paths: Paths) -> list[frozenset[Cell]]:
    return [p for p in paths if p is not None]


def _between(a: Paths, b: Paths, variant: Variant) -> float:
    one, other = _known(a), _known(b)
    return between_blocks(one, other, variant) if one and other else float("nan")


def _within(
    cells: CellsBy,
    people: Sequence[str],
    configurations: Sequence[int],
    variant: Variant,
    parameters: AnalysisParameters,
) -> Vector:
    """Return (blocks, splits): halves of a block, averaged over configurations, as published."""
    rows = []
    for number, condition in enumerate(CONDITIONS):
        by_crowd = []
        for configuration in configurations:
            block = _known([cells.get((condition, configuration, p)) for p in people])
            if len(block) < 2:
                continue
            seed = np.random.SeedSequence(parameters.splits_seed, spawn_key=(number, configuration))
            split = within_block(
                block,
                np.random.default_rng(seed),
                variant=variant,
                n_splits=parameters.n_splits,
            )
            by_crowd.append(split.values)
        rows.append(np.mean(by_crowd, axis=0) if by_crowd else np.full(parameters.n_splits, np.nan))
    return np.array(rows)


def _fair(
    crowds: Sequence[tuple[Paths, Paths]], variant: Variant, parameters: AnalysisParameters
) -> tuple[BlockComparison | None, str]:
    n = len(crowds[0][0]) if crowds else 0
    if n < MIN_PEOPLE:
        return None, f"{n} people; halves need {MIN_PEOPLE}"
    rng = np.random.default_rng(np.random.SeedSequence(parameters.splits_seed, spawn_key=(9,)))
    compared = compare_blocks_together(
        crowds,
        rng,
        variant=variant,
        n_splits=parameters.n_splits,
        n_permutations=parameters.n_permutations,
    )
    return compared, ""


def _equivalence(
    pair: tuple[str, str],
    crowds: Sequence[tuple[Paths, Paths]],
    parameters: AnalysisParameters,
) -> PathEquivalence:
    excess = own_block_excess(crowds) if crowds else np.empty(0)
    values = jackknifed_excess(crowds) if crowds else np.empty(0)
    known = values[np.isfinite(values)]
    bound = parameters.dice_bound
    try:
        test = tost_one_sample(
            known, low=-bound, high=bound, alpha=parameters.alpha, name="own-block excess"
        )
    except StatisticsError as error:
        return PathEquivalence(pair, excess, None, str(error))
    return PathEquivalence(pair, excess, test)


def _mean(values: Vector) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _sd(values: Vector) -> float:
    known = values[np.isfinite(values)]
    return float(known.std(ddof=1)) if known.size > 1 else float("nan")
