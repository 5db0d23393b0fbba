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

from visavis.analysis.cells.errors import CellError, TooFewPeople
from visavis.analysis.cells.triangulation import Cell
from visavis.lab.geometry import Vector

Variant: TypeAlias = Literal["union", "frequency", "pairs"]
Group: TypeAlias = Sequence[frozenset[Cell]]
Paths: TypeAlias = Sequence[frozenset[Cell] | None]
"""The cells each person's path visits, by person; None where the walk is missing."""

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
    raise unknown_variant(variant)


def unknown_variant(variant: str) -> CellError:
    """Return the error for a variant that does not exist."""
    return CellError(f"unknown variant {variant!r}; use 'union', 'frequency' or 'pairs'")


def check_variant(variant: str) -> None:
    """Raise CellError unless the variant exists."""
    if variant not in ("union", "frequency", "pairs"):
        raise unknown_variant(variant)


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
    if len(a) != len(b):
        raise TooFewPeople(
            f"blocks hold {len(a)} and {len(b)} paths; give one path per person in both, "
            "of at least four people"
        )
    return compare_blocks_together(
        [(a, b)], rng, variant=variant, n_splits=n_splits, n_permutations=n_permutations
    )


def compare_blocks_together(
    crowds: Sequence[tuple[Paths, Paths]],
    rng: np.random.Generator,
    *,
    variant: Variant = "union",
    n_splits: int = N_SPLITS,
    n_permutations: int = 999,
) -> BlockComparison:
    """Compare two blocks over several crowds that the same people walked through.

    Each crowd gives the paths of both blocks, row k the same person everywhere, None where that
    walk is missing; a person without one of the two is left out of that crowd. Similarities are
    means over crowds, and a permutation exchanges all walks of a person or none.
    """
    check_variant(variant)
    n = len(crowds[0][0]) if crowds else 0
    if n < 4 or any(len(a) != n or len(b) != n for a, b in crowds):
        raise TooFewPeople(
            f"{n} people, or a different number by crowd or block; give one path per person and "
            "block, of at least four people, None where one is missing"
        )
    visits = [Visits(a, b) for a, b in crowds]
    halves = np.zeros((n_splits, n))
    for i, (one, _) in enumerate(_splits(n, rng, n_splits)):
        halves[i, one] = 1.0
    stay = np.zeros(n, bool)
    within, between = _over_crowds(visits, halves, stay, variant)
    difference = within - between
    as_extreme = 1
    for _ in range(n_permutations):
        w, v = _over_crowds(visits, halves, rng.random(n) < 0.5, variant)
        as_extreme += w - v >= difference - 1e-12
    return BlockComparison(
        within=within,
        between=between,
        difference=difference,
        p=as_extreme / (n_permutations + 1),
        variant=variant,
        n_people=n,
        n_splits=n_splits,
        n_permutations=n_permutations,
    )


def own_block_excess(crowds: Sequence[tuple[Paths, Paths]]) -> Vector:
    """Return (people,) how much more each path is like others' of its block than of the other.

    Mean Dice with every other person's path in the same block, less that with their paths in the
    other block; averaged over crowds, both blocks alike. 0 is expected where blocks do not matter.
    NaN for people without two paths in any crowd.
    """
    pairs = np.array([Visits(a, b).pair_excess for a, b in crowds])
    return _mean_over_crowds(pairs)


def jackknifed_excess(crowds: Sequence[tuple[Paths, Paths]]) -> Vector:
    """Return (people,) the jackknife values of the mean of `own_block_excess`.

    A person's excess is measured against everybody else's paths, so the excesses of people are
    not independent: their own scatter gives intervals that are half as wide as they should be.
    The scatter of these values, each n times the mean less n - 1 times the mean without that
    person, does not (Arvesen 1969, for means over pairs); their mean is the mean excess.
    """
    pairs = np.array([Visits(a, b).pair_excess for a, b in crowds])
    people = np.flatnonzero(np.isfinite(_mean_over_crowds(pairs)))
    values = np.full(pairs.shape[1], np.nan)
    if len(people) < 3:
        return values
    pairs = pairs[:, people][:, :, people]
    whole = float(np.mean(_mean_over_crowds(pairs)))
    n = len(people)
    for k, person in enumerate(people):
        rest = np.delete(np.delete(pairs, k, axis=1), k, axis=2)
        left = float(np.nanmean(_mean_over_crowds(rest)))
        values[person] = n * whole - (n - 1) * left
    return values


def _mean_over_crowds(pairs: Vector) -> Vector:
    """Return (people,) means over others, then over crowds, of (crowds, people, people)."""
    by_crowd = _mean_of_known(pairs, 2)
    return _mean_of_known(by_crowd, 0)


def _mean_of_known(values: Vector, axis: int) -> Vector:
    is_known = np.isfinite(values)
    total = np.where(is_known, values, 0.0).sum(axis=axis)
    count = is_known.sum(axis=axis)
    mean: Vector = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean


class Visits:
    """Cells visited in two blocks of one crowd: `first`, `second` (people, cells) hold 0 or 1.

    `present` (people,) tells who walked in both blocks; rows of others are empty.
    """

    def __init__(self, a: Paths, b: Paths) -> None:
        self.n = len(a)
        both = [x is not None and y is not None for x, y in zip(a, b, strict=True)]
        self.present = np.array(both, bool)
        sets = [
            [
                p if keep and p is not None else frozenset()
                for p, keep in zip(block, both, strict=True)
            ]
            for block in (a, b)
        ]
        cells = {c: k for k, c in enumerate(sorted(frozenset().union(*sets[0], *sets[1])))}
        self.first, self.second = (_matrix(block, cells) for block in sets)
        self._dice: Vector | None = None

    @property
    def dice(self) -> Vector:
        """Dice (2n, 2n) of every two paths: first block, then second; NaN where both are empty."""
        if self._dice is None:
            rows = np.concatenate([self.first, self.second])
            sizes = rows.sum(axis=1)
            total = sizes[:, None] + sizes
            with np.errstate(invalid="ignore"):
                self._dice = 2 * (rows @ rows.T) / np.where(total > 0, total, np.nan)
        return self._dice

    def with_exchange(self, swap: npt.NDArray[np.bool_]) -> tuple[Vector, Vector]:
        """Return both blocks' matrices with the paths of some people exchanged."""
        swap_rows = swap[:, None]
        return np.where(swap_rows, self.second, self.first), np.where(
            swap_rows, self.first, self.second
        )

    def order(self, swap: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.intp], ...]:
        """Return the rows of `dice` that hold each block when some people's are exchanged."""
        people = np.arange(self.n)
        return np.where(swap, people + self.n, people), np.where(swap, people, people + self.n)

    @property
    def pair_excess(self) -> Vector:
        """How much more two people's paths are alike in one block than across blocks, (people,
        people), both blocks alike; NaN with oneself and with people not in both.
        """
        n, dice = self.n, self.dice
        excess: Vector = (dice[:n, :n] + dice[n:, n:] - dice[:n, n:] - dice[n:, :n]) / 2
        excess[~(self.present[:, None] & self.present)] = np.nan
        np.fill_diagonal(excess, np.nan)
        return excess


def _matrix(block: Sequence[frozenset[Cell]], cells: dict[Cell, int]) -> Vector:
    matrix = np.zeros((len(block), len(cells)))
    for row, path in enumerate(block):
        matrix[row, [cells[c] for c in path]] = 1.0
    return matrix


def _splits(
    n: int, rng: np.random.Generator, n_splits: int
) -> list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    orders = [rng.permutation(n) for _ in range(n_splits)]
    return [(order[: n // 2], order[n // 2 :]) for order in orders]


def _over_crowds(
    visits: Sequence[Visits], halves: Vector, swap: npt.NDArray[np.bool_], variant: Variant
) -> tuple[float, float]:
    """Return mean similarity within and between blocks over crowds and splits."""
    pairs = np.array([_within_and_between(v, halves, swap, variant) for v in visits])
    within, between = np.nanmean(pairs, axis=0)
    return float(within), float(between)


def _within_and_between(
    visits: Visits, halves: Vector, swap: npt.NDArray[np.bool_], variant: Variant
) -> tuple[float, float]:
    one, other = halves * visits.present, (1 - halves) * visits.present
    if variant == "pairs":
        rows_a, rows_b = visits.order(swap)
        dice = visits.dice

        def pairs(p: npt.NDArray[np.intp], q: npt.NDArray[np.intp]) -> Vector:
            block = np.nan_to_num(dice[np.ix_(p, q)])
            is_known = np.isfinite(dice[np.ix_(p, q)]).astype(float)
            total = ((one @ block) * other).sum(axis=1)
            count = ((one @ is_known) * other).sum(axis=1)
            means: Vector = total / np.where(count > 0, count, np.nan)
            return means

        within = pairs(rows_a, rows_a) + pairs(rows_b, rows_b)
        between = pairs(rows_a, rows_b) + pairs(rows_b, rows_a)
    else:
        a, b = visits.with_exchange(swap)
        sums = [_visit_shares(half, block, variant) for half in (one, other) for block in (a, b)]
        a_one, b_one, a_other, b_other = sums
        within = _dice_rows(a_one, a_other) + _dice_rows(b_one, b_other)
        between = _dice_rows(a_one, b_other) + _dice_rows(b_one, a_other)
    return float(np.nanmean(within)) / 2, float(np.nanmean(between)) / 2


def _visit_shares(half: Vector, block: Vector, variant: Variant) -> Vector:
    """Return (splits, cells) what a half visits: yes or no, or by what share of it."""
    visits: Vector = half @ block
    if variant == "union":
        return np.asarray(visits > 0, float)
    size = half.sum(axis=1, keepdims=True)
    return np.asarray(visits / np.where(size > 0, size, np.nan))


def _dice_rows(a: Vector, b: Vector) -> Vector:
    total = a.sum(axis=1) + b.sum(axis=1)
    dice: Vector = 2 * np.minimum(a, b).sum(axis=1) / np.where(total > 0, total, np.nan)
    return dice
