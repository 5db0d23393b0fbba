"""How alike are the cells that groups of paths visit: Dice's coefficient in named variants.

The published figure compares unions of cells of groups; larger groups, and the same people on both
sides, raise it without any effect of the block. `compare_blocks` therefore matches group sizes,
keeps people apart, and tests by permutation.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from analysis.cells.errors import CellError, TooFewPeople
from analysis.cells.triangulation import Cell
from analysis.cells.walk import CellPath
from lab.geometry import Vector

Variant: TypeAlias = Literal["union", "frequency", "pairs"]
Group: TypeAlias = Sequence[frozenset[Cell]]

N_SPLITS = 30
"""Random halves of the published within-block comparison (Berton et al. 2020)."""


def dice(a: Iterable[object], b: Iterable[object]) -> float:
    """Return twice the shared over the summed sizes of two sets, NaN when both are empty."""
    one, other = set(a), set(b)
    size = len(one) + len(other)
    return 2 * len(one & other) / size if size else float("nan")


def frequency_dice(a: Group, b: Group) -> float:
    """Return Dice on visit frequencies: the share of each group that visits a cell counts."""
    shares = []
    for group in (a, b):
        visits = Counter(cell for cells in group for cell in cells)
        shares.append({cell: n / len(group) for cell, n in visits.items()})
    total = sum(shares[0].values()) + sum(shares[1].values())
    common = sum(min(share, shares[1].get(cell, 0.0)) for cell, share in shares[0].items())
    return 2 * common / total if total else float("nan")


def group_dice(a: Group, b: Group, variant: Variant = "union") -> float:
    """Compare two groups of paths, each the set of cells it visits.

    - `union`: Dice of the cells visited by anyone of each group;
    - `frequency`: Dice of how large a share of each group visits each cell;
    - `pairs`: mean Dice over all pairs with one path of each group.
    """
    if not a or not b:
        raise TooFewPeople("a group without a path cannot be compared; leave it out")
    if variant == "union":
        return dice(frozenset().union(*a), frozenset().union(*b))
    if variant == "frequency":
        return frequency_dice(a, b)
    if variant == "pairs":
        return float(np.mean([dice(one, other) for one in a for other in b]))
    raise CellError(f"unknown variant {variant!r}; use 'union', 'frequency' or 'pairs'")


@dataclass(frozen=True)
class SplitSimilarity:
    """Mean and standard deviation over random splits; `values` (n_splits,), `sizes` of halves."""

    mean: float
    sd: float
    values: Vector
    sizes: tuple[int, int]
    variant: Variant


@dataclass(frozen=True)
class BlockComparison:
    """Two blocks compared at matched group sizes with different people on both sides.

    `within` and `between` are mean similarities over the same splits, `difference` = within -
    between (positive where blocks differ), `p` its one-sided permutation probability under
    exchange of the two blocks within each person; `n_splits`, `n_permutations`, `n_people`.
    """

    within: float
    between: float
    difference: float
    p: float
    variant: Variant
    n_people: int
    n_splits: int
    n_permutations: int


def between_blocks(a: Group, b: Group, variant: Variant = "union") -> float:
    """Compare all paths of one block with all of another, as published: groups of full size."""
    return group_dice(a, b, variant)


def within_block(
    block: Group, rng: np.random.Generator, *, variant: Variant = "union", n_splits: int = N_SPLITS
) -> SplitSimilarity:
    """Compare random halves of one block, as published; halves differ by one when n is odd."""
    n = len(block)
    if n < 2:
        raise TooFewPeople(f"{n} path makes no two halves; give at least two")
    values = np.empty(n_splits)
    for i, (one, other) in enumerate(_splits(n, rng, n_splits)):
        values[i] = group_dice([block[k] for k in one], [block[k] for k in other], variant)
    sd = float(values.std(ddof=1)) if n_splits > 1 else float("nan")
    return SplitSimilarity(float(values.mean()), sd, values, (n // 2, n - n // 2), variant)


def compare_blocks(
    a: Group,
    b: Group,
    rng: np.random.Generator,
    *,
    variant: Variant = "union",
    n_splits: int = N_SPLITS,
    n_permutations: int = 999,
) -> BlockComparison:
    """Ask whether paths differ between two blocks walked by the same people, row k one person.

    Every split halves the people. Within: one half against the other in the same block, for
    both blocks. Between: one half in one block against the other half in the other, both ways. So
    group sizes match and nobody is on both sides. Under the null hypothesis a person's two paths
    could be exchanged; the test does so at random, `n_permutations` times, on the same splits.
    """
    if len(a) != len(b) or len(a) < 4:
        raise TooFewPeople(
            f"blocks hold {len(a)} and {len(b)} paths; give one path per person in both, "
            "of at least four people"
        )
    splits = _splits(len(a), rng, n_splits)
    within, between = _matched(a, b, splits, variant)
    observed = within - between
    as_extreme = 1
    for _ in range(n_permutations):
        swap = rng.random(len(a)) < 0.5
        one = [y if s else x for x, y, s in zip(a, b, swap, strict=True)]
        other = [x if s else y for x, y, s in zip(a, b, swap, strict=True)]
        w, v = _matched(one, other, splits, variant)
        as_extreme += w - v >= observed - 1e-12
    return BlockComparison(
        within=within,
        between=between,
        difference=observed,
        p=as_extreme / (n_permutations + 1),
        variant=variant,
        n_people=len(a),
        n_splits=n_splits,
        n_permutations=n_permutations,
    )


def cell_sets(paths: Iterable[CellPath]) -> list[frozenset[Cell]]:
    """Return the set of cells of each path."""
    return [path.cell_set for path in paths]


def _splits(
    n: int, rng: np.random.Generator, n_splits: int
) -> list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    orders = [rng.permutation(n) for _ in range(n_splits)]
    return [(order[: n // 2], order[n // 2 :]) for order in orders]


def _matched(
    a: Group,
    b: Group,
    splits: Sequence[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]],
    variant: Variant,
) -> tuple[float, float]:
    within = between = 0.0
    for one, other in splits:
        a_one, a_other = [a[k] for k in one], [a[k] for k in other]
        b_one, b_other = [b[k] for k in one], [b[k] for k in other]
        within += group_dice(a_one, a_other, variant) + group_dice(b_one, b_other, variant)
        between += group_dice(a_one, b_other, variant) + group_dice(b_one, a_other, variant)
    return within / (2 * len(splits)), between / (2 * len(splits))
