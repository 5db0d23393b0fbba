"""Share the trials of a factorial design out over blocks, as evenly as arithmetic allows."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.orders import Cell

STARTS = 20
PLATEAU_STEPS = 60
HELD_WEIGHT = 10.0


def balanced_blocks(
    cells: Sequence[Cell],
    n_blocks: int,
    balanced: Sequence[str],
    rng: np.random.Generator,
) -> list[list[Cell]]:
    """Share cells out over blocks of equal size.

    Every block holds equally many of every level of each factor in `balanced` (DesignError when
    that cannot be). Levels of the other factors and every combination of factors are then spread
    over the blocks as evenly as possible, by swaps that lower the squared distance from an even
    spread until each count lies within one of it or no better allocation is found. Combinations
    of few factors weigh more than those of many. Returned in no particular order within a block.
    """
    if n_blocks < 1 or len(cells) < n_blocks:
        raise DesignError(f"{len(cells)} trials cannot fill {n_blocks} blocks")
    if len(cells) % n_blocks:
        raise DesignError(
            f"{len(cells)} trials do not divide into {n_blocks} equal blocks; "
            "change the repetitions or the number of blocks"
        )
    names = list(cells[0])
    _check_divisible(cells, n_blocks, balanced, names)
    margins = _margins(cells, names)
    weights = [
        HELD_WEIGHT if len(subset) == 1 and subset[0] in balanced else 1.0 / len(subset)
        for subset, _ in margins
    ]
    goal = sum(
        w * _least_cost(level, n_blocks) for w, (_, level) in zip(weights, margins, strict=True)
    )
    levels = [level for _, level in margins]
    balanced_levels = [
        level for subset, level in margins if len(subset) == 1 and subset[0] in balanced
    ]
    best: npt.NDArray[np.int64] | None = None
    best_cost = np.inf
    for _ in range(STARTS):
        block, cost = _descend(
            _deal(len(cells), n_blocks, balanced_levels, rng), levels, weights, n_blocks, goal, rng
        )
        if cost < best_cost - 1e-9 and _is_even(block, balanced_levels, n_blocks):
            best, best_cost = block, cost
        if best_cost <= goal + 1e-9:
            break
    if best is None:
        raise DesignError(
            f"no allocation to {n_blocks} blocks with equal numbers of every level of "
            f"{', '.join(balanced)} was found; balance fewer factors"
        )
    return [[cells[int(i)] for i in np.flatnonzero(best == b)] for b in range(n_blocks)]


def _check_divisible(
    cells: Sequence[Cell], n_blocks: int, balanced: Sequence[str], names: Sequence[str]
) -> None:
    for name in balanced:
        if name not in names:
            raise DesignError(
                f"cannot balance {name!r}: the factors within participants are "
                f"{names_or_none(names)}"
            )
        values = [cell[name] for cell in cells]
        for value in dict.fromkeys(values):
            if values.count(value) % n_blocks:
                raise DesignError(
                    f"{name} {value!r} occurs {values.count(value)} times, which does not divide "
                    f"over {n_blocks} blocks; change the repetitions or the number of blocks, or "
                    f"leave {name!r} out of the balanced factors"
                )


def _margins(
    cells: Sequence[Cell], names: Sequence[str]
) -> list[tuple[tuple[str, ...], npt.NDArray[np.int64]]]:
    """Return, for every subset of factors that tells cells apart, each cell's level number."""
    margins = []
    for size in range(1, len(names) + 1):
        for subset in combinations(names, size):
            numbers: dict[tuple[object, ...], int] = {}
            level = np.array(
                [
                    numbers.setdefault(tuple(cell[name] for name in subset), len(numbers))
                    for cell in cells
                ],
                dtype=np.int64,
            )
            if len(numbers) > 1:
                margins.append((subset, level))
    return margins


def _least_cost(level: npt.NDArray[np.int64], n_blocks: int) -> float:
    """Return the squared distance of the evenest whole-number spread from the even one."""
    rest = np.bincount(level) % n_blocks
    return float(np.sum(rest * (n_blocks - rest)) / n_blocks)


def _deal(
    n: int, n_blocks: int, even_levels: Sequence[npt.NDArray[np.int64]], rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Deal shuffled cells to the blocks like cards, sorted by the factors that must be equal."""
    order = rng.permutation(n)
    if even_levels:
        order = order[np.lexsort([level[order] for level in reversed(even_levels)])]
    block = np.empty(n, dtype=np.int64)
    block[order] = np.arange(n) % n_blocks
    return block


def _is_even(
    block: npt.NDArray[np.int64], even_levels: Sequence[npt.NDArray[np.int64]], n_blocks: int
) -> bool:
    return all(
        bool(np.ptp(_counts(block, level, n_blocks), axis=1).max() == 0) for level in even_levels
    )


def _counts(
    block: npt.NDArray[np.int64], level: npt.NDArray[np.int64], n_blocks: int
) -> npt.NDArray[np.int64]:
    n_levels = int(level.max()) + 1
    flat = np.bincount(level * n_blocks + block, minlength=n_levels * n_blocks)
    counts: npt.NDArray[np.int64] = flat.reshape(n_levels, n_blocks)
    return counts


def _descend(
    block: npt.NDArray[np.int64],
    levels: Sequence[npt.NDArray[np.int64]],
    weights: Sequence[float],
    n_blocks: int,
    goal: float,
    rng: np.random.Generator,
) -> tuple[npt.NDArray[np.int64], float]:
    """Swap pairs of cells between blocks while that helps, or does no harm for a while."""
    n = len(block)
    counts = [_counts(block, level, n_blocks) for level in levels]
    cost = sum(
        w * float(np.sum((c - c.sum(axis=1, keepdims=True) / n_blocks) ** 2))
        for w, c in zip(weights, counts, strict=True)
    )
    plateau = 0
    while cost > goal + 1e-9 and plateau < PLATEAU_STEPS:
        change = np.zeros((n, n))
        for w, level, count in zip(weights, levels, counts, strict=True):
            here = count[level]
            leave = here[np.arange(n), block]
            # gain[i, j]: how much fuller i's level would make j's block than its own
            gain = here[:, block] - leave[:, None]
            change += w * np.where(level[:, None] == level, 0.0, 2.0 * (gain + gain.T) + 4.0)
        change[block[:, None] == block] = np.inf
        least = float(change.min())
        if least > 1e-9:
            break
        plateau = plateau + 1 if least > -1e-9 else 0
        pairs = np.argwhere(change <= least + 1e-9)
        i, j = pairs[int(rng.integers(len(pairs)))]
        for level, count in zip(levels, counts, strict=True):
            count[level[i], block[i]] -= 1
            count[level[i], block[j]] += 1
            count[level[j], block[j]] -= 1
            count[level[j], block[i]] += 1
        block[i], block[j] = block[j], block[i]
        cost += least
    return block, cost
