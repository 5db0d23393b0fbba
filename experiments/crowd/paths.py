"""Do people take the same way through a crowd in every block? Similarity as published, and fair."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.cells import (
    BlockComparison,
    Paths,
    Variant,
    between_blocks,
    compare_blocks_together,
    jackknifed_excess,
    own_block_excess,
    within_block,
)
from visavis.analysis.cells.triangulation import Cell
from visavis.analysis.statistics import Equivalence, tost_one_sample, tost_paired
from visavis.analysis.statistics.errors import StatisticsError
from visavis.experiments.crowd.comparisons import PAIRS, PathThresholds
from visavis.experiments.crowd.design import CONDITIONS, CONTROL_GROUP
from visavis.lab.chance import generator
from visavis.lab.geometry import Vector
from visavis.results.analysis import StudyAnalysis

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
    """Test of whether people's own paths are the same in two blocks, person by person.

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

    blocks: tuple[str, ...]
    configurations: tuple[int, ...]
    n_people: int
    within: Mapping[Variant, Vector]
    pairs: tuple[PairSimilarity, ...]
    equivalence: tuple[PathEquivalence, ...]

    @property
    def block_pairs(self) -> tuple[tuple[str, str], ...]:
        """Every two of the blocks that there were."""
        return tuple(e.pair for e in self.equivalence)

    def pair(self, pair: tuple[str, str], variant: Variant = "union") -> PairSimilarity:
        """Return the similarity of two blocks in a variant."""
        return next(p for p in self.pairs if p.pair == pair and p.variant == variant)


@dataclass(frozen=True)
class GroupPaths:
    """The paths of one group of participants; `counted_walks` are its walks that count.

    `lengths` says per pair of blocks whether people walk as far, or why that was not tested.
    """

    group: str
    counted_walks: pd.DataFrame = field(repr=False)
    paths: PathAnalysis
    lengths: Mapping[tuple[str, str], Equivalence | str]

    def rows_of(self, table: pd.DataFrame) -> pd.DataFrame:
        """Return the rows of a table that are of the group's walks that count."""
        if table.empty:
            return table
        keys = ["participant", "trial_id"]
        mine = pd.MultiIndex.from_frame(self.counted_walks[keys].astype(str))
        return table[pd.MultiIndex.from_frame(table[keys].astype(str)).isin(mine)]


def paths_by_group(analysis: StudyAnalysis) -> tuple[GroupPaths, ...]:
    """Compare the paths of those who felt vibrations, then of controls, where there are any."""
    counted_walks = analysis.selection.counted
    group_names = (
        counted_walks.get("group", pd.Series("", counted_walks.index)).fillna("").astype(str)
    )
    blocks = tuple(c for c in CONDITIONS if c in analysis.levels["condition"])
    groups = []
    for own_walks in (
        counted_walks[group_names != CONTROL_GROUP],
        counted_walks[group_names == CONTROL_GROUP],
    ):
        if own_walks.empty:
            continue
        cells = cells_by(analysis.tables["cells"], own_walks)
        paths = analyse_paths(cells, analysis.thresholds, analysis.rules.alpha, blocks)
        lengths = {
            pair: _same_lengths(own_walks, pair, analysis.thresholds, analysis.rules.alpha)
            for pair in paths.block_pairs
        }
        groups.append(GroupPaths(str(group_names[own_walks.index[0]]), own_walks, paths, lengths))
    return tuple(groups)


def cells_by(cells: pd.DataFrame, walks: pd.DataFrame) -> CellsBy:
    """Return the cells of every kept walk by condition, configuration and participant."""
    keys = set(zip(walks["participant"].astype(str), walks["trial_id"].astype(str), strict=True))
    return {
        (str(row["condition"]), int(row["configuration"]), str(row["participant"])): frozenset(
            (int(c[0]), int(c[1]), int(c[2])) for c in json.loads(row["cells"]) if c is not None
        )
        for row in cells.to_dict("records")
        if (str(row["participant"]), str(row["trial_id"])) in keys
    }


def _same_lengths(
    walks: pd.DataFrame, pair: tuple[str, str], thresholds: PathThresholds, alpha: float
) -> Equivalence | str:
    """Test whether people walk as far in two blocks, within a share of the mean; or say why not."""
    if "path_m" not in walks:
        return "not measured"
    values = walks.assign(path_m=pd.to_numeric(walks["path_m"], errors="coerce"))
    wide = values.pivot_table(index="participant", columns="condition", values="path_m")
    wide = wide.dropna()
    if not set(pair) <= set(wide.columns):
        return "no path of both blocks was measured"
    bound = thresholds.path_bound_01 * float(wide.to_numpy().mean()) if len(wide) else 0.0
    a, b = (wide[c].to_numpy(float) for c in pair)
    try:
        return tost_paired(a, b, low=-bound, high=bound, alpha=alpha, names=pair)
    except StatisticsError as error:
        return str(error)


def analyse_paths(
    cells: CellsBy,
    parameters: PathThresholds,
    alpha: float = 0.05,
    blocks: tuple[str, ...] = CONDITIONS,
) -> PathAnalysis:
    """Compare the cells that people walked through; every random split comes from one seed."""
    block_pairs = [pair for pair in PAIRS if set(pair) <= set(blocks)]
    people = sorted({person for _, _, person in cells})
    configurations = tuple(sorted({configuration for _, configuration, _ in cells}))

    def paths(condition: str, configuration: int) -> Paths:
        return [cells.get((condition, configuration, person)) for person in people]

    within: dict[Variant, Vector] = {}
    pairs = []
    for variant in VARIANTS:
        within[variant] = _within(cells, people, configurations, variant, parameters, blocks)
        for pair in block_pairs:
            crowds = [(paths(pair[0], c), paths(pair[1], c)) for c in configurations]
            fair, problem = _fair(crowds, variant, parameters)
            values = np.array([_between(a, b, variant) for a, b in crowds])
            pairs.append(PairSimilarity(pair, variant, values, fair, problem))
    equivalence = []
    for pair in block_pairs:
        crowds = [(paths(pair[0], c), paths(pair[1], c)) for c in configurations]
        equivalence.append(_equivalence(pair, crowds, parameters, alpha))
    return PathAnalysis(
        blocks, configurations, len(people), within, tuple(pairs), tuple(equivalence)
    )


def _without_missing(paths: Paths) -> list[frozenset[Cell]]:
    return [p for p in paths if p is not None]


def _between(a: Paths, b: Paths, variant: Variant) -> float:
    one, other = _without_missing(a), _without_missing(b)
    return between_blocks(one, other, variant) if one and other else float("nan")


def _within(
    cells: CellsBy,
    people: Sequence[str],
    configurations: Sequence[int],
    variant: Variant,
    parameters: PathThresholds,
    blocks: tuple[str, ...],
) -> Vector:
    """Return (blocks, splits): halves of a block, averaged over configurations, as published."""
    rows = []
    for condition in blocks:
        number = CONDITIONS.index(condition)
        by_crowd = []
        for configuration in configurations:
            block = _without_missing([cells.get((condition, configuration, p)) for p in people])
            if len(block) < 2:
                continue
            split = within_block(
                block,
                generator(parameters.splits_seed, number, configuration),
                variant=variant,
                n_splits=parameters.n_splits,
            )
            by_crowd.append(split.values)
        rows.append(np.mean(by_crowd, axis=0) if by_crowd else np.full(parameters.n_splits, np.nan))
    return np.array(rows)


def _fair(
    crowds: Sequence[tuple[Paths, Paths]], variant: Variant, parameters: PathThresholds
) -> tuple[BlockComparison | None, str]:
    n = len(crowds[0][0]) if crowds else 0
    if n < MIN_PEOPLE:
        return None, f"{n} people; halves need {MIN_PEOPLE}"
    comparison = compare_blocks_together(
        crowds,
        generator(parameters.splits_seed, 9),
        variant=variant,
        n_splits=parameters.n_splits,
        n_permutations=parameters.n_permutations,
    )
    return comparison, ""


def _equivalence(
    pair: tuple[str, str],
    crowds: Sequence[tuple[Paths, Paths]],
    parameters: PathThresholds,
    alpha: float,
) -> PathEquivalence:
    excess = own_block_excess(crowds) if crowds else np.empty(0)
    values = jackknifed_excess(crowds) if crowds else np.empty(0)
    finite = values[np.isfinite(values)]
    bound = parameters.dice_bound
    try:
        test = tost_one_sample(finite, low=-bound, high=bound, alpha=alpha, name="own-block excess")
    except StatisticsError as error:
        return PathEquivalence(pair, excess, None, str(error))
    return PathEquivalence(pair, excess, test)


def _mean(values: Vector) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")


def _sd(values: Vector) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1)) if finite.size > 1 else float("nan")
