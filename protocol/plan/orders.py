"""Put things in order: Latin squares, Williams designs, random orders that keep rules."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.kinds import takes_kinds
from visavis.protocol.plan.steps import Scalar

Cell: TypeAlias = Mapping[str, Scalar]
"""One combination of factor levels."""

SHUFFLES = 100
SEARCH_BUDGET = 200_000


@dataclass(frozen=True)
class Constraint:
    """A rule that says whether a cell may follow the cells before it.

    `allows(previous, candidate)` receives at most `lookback` cells, oldest first, and sees only
    the named `factors`. The rule looks back only; the first cells of an order see fewer.
    """

    description: str
    factors: tuple[str, ...]
    lookback: int
    allows: Callable[[Sequence[Cell], Cell], bool]


@takes_kinds()
def no_more_than(count: int, factor: str) -> Constraint:
    """Allow at most `count` equal levels of a factor in a row."""
    if count < 1:
        raise DesignError(f"no_more_than({count}, {factor!r}): the count must be at least 1")

    def allows(previous: Sequence[Cell], candidate: Cell) -> bool:
        same = all(cell[factor] == candidate[factor] for cell in previous)
        return len(previous) < count or not same

    return Constraint(f"at most {count} equal {factor!r} in a row", (factor,), count, allows)


@takes_kinds()
def never_next_to(factor: str, pairs: Collection[tuple[Scalar, Scalar]]) -> Constraint:
    """Forbid pairs of levels, in the order given, as direct neighbours (first, second)."""
    forbidden = frozenset(pairs)

    def allows(previous: Sequence[Cell], candidate: Cell) -> bool:
        return not previous or (previous[-1][factor], candidate[factor]) not in forbidden

    pairs_text = ", ".join(f"{a} then {b}" for a, b in pairs)
    return Constraint(f"{factor!r} never {pairs_text}", (factor,), 1, allows)


def latin_square(n: int) -> npt.NDArray[np.int64]:
    """Return the cyclic Latin square (n, n): every item once in every row and every place."""
    _check_size(n)
    items = np.arange(n, dtype=np.int64)
    square: npt.NDArray[np.int64] = (items[:, None] + items[None, :]) % n
    return square


def williams(n: int) -> npt.NDArray[np.int64]:
    """Return a Williams design: a Latin square in which every item follows every other equally.

    Shape (n, n) for even n and (2n, n) for odd n, where mirrored rows are needed.
    Source: Williams (1949), Australian Journal of Scientific Research A 2, 149-168.
    """
    _check_size(n)
    places = np.arange(n)
    first = np.where(places % 2 == 1, (places + 1) // 2, (n - places // 2) % n)
    rows = (first[None, :] + np.arange(n)[:, None]) % n
    if n % 2 == 1 and n > 1:
        rows = np.concatenate([rows, rows[:, ::-1]])
    return rows.astype(np.int64)


def _check_size(n: int) -> None:
    if n < 1:
        raise DesignError(f"a square of {n} items cannot be made; give at least one item")


def broken_rules(cells: Sequence[Cell], constraints: Sequence[Constraint]) -> list[tuple[int, str]]:
    """Return (position from 0, description) of every break of a rule in an order."""
    rules = _Rules(cells, constraints)
    order = list(range(len(cells)))
    return [
        (place, constraint.description)
        for place in order
        for c, constraint in enumerate(constraints)
        if not rules.keeps(c, order, place)
    ]


def shuffle(
    cells: Sequence[Cell], constraints: Sequence[Constraint], rng: np.random.Generator
) -> list[Cell]:
    """Return the cells in a random order that keeps every rule.

    Orders are drawn until one keeps the rules, so each allowed order is equally likely; when
    rules are too tight for that, a draw is repaired by swaps, and at last an exact search
    decides. Raises DesignError when no order exists, or none was found within the budget.
    """
    n = len(cells)
    if not constraints:
        return [cells[i] for i in rng.permutation(n)]
    rules = _Rules(cells, constraints)
    for _ in range(SHUFFLES):
        order = [int(i) for i in rng.permutation(n)]
        if not any(rules.breaks(order, place) for place in range(n)):
            return [cells[i] for i in order]
    repair = _repair_by_swaps(rules, [int(i) for i in rng.permutation(n)], rng)
    valid_order = repair if repair is not None else _search_exactly(cells, constraints, rng)
    return [cells[i] for i in valid_order]


class _Rules:
    """Rules over numbered cells; every verdict is cached."""

    def __init__(self, cells: Sequence[Cell], constraints: Sequence[Constraint]) -> None:
        self.constraints = tuple(constraints)
        self.lookback = max((c.lookback for c in constraints), default=0)
        self._projections = [[_project(cell, c.factors) for cell in cells] for c in constraints]
        self._classes: list[list[int]] = []
        for projected_cells in self._projections:
            numbers: dict[tuple[Scalar, ...], int] = {}
            self._classes.append(
                [numbers.setdefault(tuple(cell.values()), len(numbers)) for cell in projected_cells]
            )
        self._verdicts: list[dict[tuple[int, ...], bool]] = [{} for _ in constraints]

    def keeps(self, c: int, order: Sequence[int], place: int) -> bool:
        constraint, classes, cells = self.constraints[c], self._classes[c], self._projections[c]
        window = order[max(0, place - constraint.lookback) : place + 1]
        key = tuple([classes[i] for i in window])
        verdict = self._verdicts[c].get(key)
        if verdict is None:
            verdict = bool(constraint.allows([cells[i] for i in window[:-1]], cells[window[-1]]))
            self._verdicts[c][key] = verdict
        return verdict

    def breaks(self, order: Sequence[int], place: int) -> int:
        return sum(not self.keeps(c, order, place) for c in range(len(self.constraints)))

    def breaks_near(self, order: Sequence[int], i: int, j: int) -> int:
        reach = self.lookback + 1
        places = {*range(i, min(i + reach, len(order))), *range(j, min(j + reach, len(order)))}
        return sum(self.breaks(order, place) for place in places)


def _project(cell: Cell, factors: Sequence[str]) -> dict[str, Scalar]:
    missing = [name for name in factors if name not in cell]
    if missing:
        raise DesignError(f"a rule reads factor {missing[0]!r}, which the design does not have")
    return {name: cell[name] for name in factors}


def _repair_by_swaps(rules: _Rules, order: list[int], rng: np.random.Generator) -> list[int] | None:
    n = len(order)
    for _ in range(20 * n):
        broken_places = [place for place in range(n) if rules.breaks(order, place)]
        if not broken_places:
            return order
        i = broken_places[int(rng.integers(len(broken_places)))]
        best: list[int] = []
        best_change = 1
        for j in range(n):
            if j == i:
                continue
            before = rules.breaks_near(order, i, j)
            order[i], order[j] = order[j], order[i]
            change = rules.breaks_near(order, i, j) - before
            order[i], order[j] = order[j], order[i]
            if change < best_change:
                best, best_change = [], change
            if change == best_change:
                best.append(j)
        if not best:
            return None
        j = best[int(rng.integers(len(best)))]
        order[i], order[j] = order[j], order[i]
    return None


def _search_exactly(
    cells: Sequence[Cell], constraints: Sequence[Constraint], rng: np.random.Generator
) -> list[int]:
    """Search depth first over the classes of cells the rules can tell apart."""
    read = tuple(dict.fromkeys(name for c in constraints for name in c.factors))
    members: dict[tuple[Scalar, ...], list[int]] = {}
    for i in rng.permutation(len(cells)):
        members.setdefault(tuple(_project(cells[i], read).values()), []).append(int(i))
    kinds = list(members)
    examples = [cells[members[kind][0]] for kind in kinds]
    rules = _Rules(examples, constraints)
    left = [len(members[kind]) for kind in kinds]
    placed_kinds: list[int] = []
    dead: set[tuple[tuple[int, ...], tuple[int, ...]]] = set()
    choices = [_choices(left, rng)]
    step_count = 0
    while len(placed_kinds) < len(cells):
        if choices[-1]:
            kind = choices[-1].pop()
            placed_kinds.append(kind)
            left[kind] -= 1
            step_count += 1
            if step_count > SEARCH_BUDGET:
                raise DesignError(_refusal(cells, constraints, "was found; loosen a rule"))
            fails = rules.breaks(placed_kinds, len(placed_kinds) - 1)
            if fails or _state(left, placed_kinds, rules.lookback) in dead:
                left[placed_kinds.pop()] += 1
            else:
                choices.append(_choices(left, rng))
        else:
            choices.pop()
            if not choices:
                raise DesignError(_refusal(cells, constraints, "exists; loosen a rule"))
            dead.add(_state(left, placed_kinds, rules.lookback))
            left[placed_kinds.pop()] += 1
    return [members[kinds[kind]].pop() for kind in placed_kinds]


def _choices(left: Sequence[int], rng: np.random.Generator) -> list[int]:
    """Return the kinds that are left, the most frequent last, ties in random order."""
    kinds = [int(k) for k in rng.permutation(len(left)) if left[k]]
    return sorted(kinds, key=lambda k: left[k])


def _state(
    left: Sequence[int], placed_kinds: Sequence[int], lookback: int
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    return tuple(left), tuple(placed_kinds[max(0, len(placed_kinds) - lookback) :])


def _refusal(cells: Sequence[Cell], constraints: Sequence[Constraint], verdict: str) -> str:
    rules = "; ".join(c.description for c in constraints)
    names = dict.fromkeys(name for c in constraints for name in c.factors)
    counts = "; ".join(
        f"{name}: "
        + ", ".join(f"{level} × {k}" for level, k in Counter(c[name] for c in cells).items())
        for name in names
    )
    return f"no order of {len(cells)} trials ({counts}) that keeps the rules ({rules}) {verdict}"
