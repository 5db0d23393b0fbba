"""Factorial designs: from factors, blocks and an explicit seed to the plan of one session.

Everything random in a plan depends on the study seed and the participant's index only, through
`numpy.random.SeedSequence` keys, so no participant's plan and no trial's seed depends on what was
drawn before it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.balance import balanced_blocks
from visavis.protocol.plan.orders import (
    Cell,
    Constraint,
    broken_rules,
    latin_square,
    shuffle,
    williams,
)
from visavis.protocol.plan.session_plan import Block, SessionPlan, Trial
from visavis.protocol.plan.steps import Scalar

TrialOrder: TypeAlias = Literal["fixed", "random", "balanced_blocks", "latin_square", "williams"]
BlockOrder: TypeAlias = Literal["fixed", "random", "latin_square", "williams"]

_ORDER, _TRIAL, _PRACTICE, _GROUP, _STREAM = range(5)
SESSION: Final = "session"
"""The name of the factor that sessions of one person make."""


@dataclass(frozen=True)
@of_kinds(levels=Sequence[Any], practice_only=Sequence[Any])
class Factor:
    """A factor and its levels; `between` factors have one level per participant.

    `practice_only` are levels that appear in practice only and are never counted.
    """

    name: str
    levels: Sequence[Scalar]
    between: bool = False
    practice_only: Sequence[Scalar] = ()

    def __post_init__(self) -> None:
        for name in ("levels", "practice_only"):
            object.__setattr__(self, name, tuple(getattr(self, name)))


@dataclass(frozen=True)
class Design:
    """A factorial design: every combination of the within factors, `repetitions` times.

    `blocks` equal blocks (per level of `blocked_by`, when a within factor changes only between
    blocks; its levels come in `block_order` over participants). Within a block trials come in
    `order`:

    - `fixed`: as listed, last factor fastest, repetition after repetition;
    - `random`: shuffled over the whole session, then cut into blocks;
    - `balanced_blocks`: every block holds equally many of every level of the `balanced` factors
      (all that divide, when none is named), the rest as even as arithmetic allows; random
      within the block;
    - `latin_square`, `williams`: each repetition is a row of the square over the combinations,
      the participant's index says which.

    With `phased_by`, a within factor, a block has one part after the other, of its levels as listed
    (such as "guess", then "adjust"); the combinations of the other factors come in `order` within
    each part, the same row of a square in all of them.

    `constraints` hold within blocks (`random`: over the whole session); orders that are not
    random are only checked. `practice` trials come first, in a block of their own: a number of
    random combinations, or the combinations themselves.
    """

    study: str
    version: str
    factors: tuple[Factor, ...]
    repetitions: int = 1
    blocks: int = 1
    order: TrialOrder = "random"
    balanced: tuple[str, ...] = ()
    blocked_by: str | None = None
    block_order: BlockOrder = "fixed"
    phased_by: str | None = None
    constraints: tuple[Constraint, ...] = ()
    practice: int | tuple[Cell, ...] = 0
    practice_instruction: str = ""
    instruction: str = ""
    calibrate_blocks: bool = True
    calibrate_practice: bool = True
    questionnaires: tuple[str, ...] = ()
    parameters: Mapping[str, Scalar] = field(default_factory=dict)
    sessions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _check(self)

    @property
    def within(self) -> tuple[Factor, ...]:
        """Factors every participant meets at all levels."""
        return tuple(f for f in self.factors if not f.between)

    @property
    def between(self) -> tuple[Factor, ...]:
        """Factors with one level per participant."""
        return tuple(f for f in self.factors if f.between)

    @property
    def session_factor(self) -> Factor | None:
        """The factor that changes from session to session of a person; None without one."""
        return Factor(SESSION, self.sessions) if self.sessions else None

    @property
    def all_factors(self) -> tuple[Factor, ...]:
        """Its factors, then that of sessions."""
        of_sessions = self.session_factor
        return self.factors if of_sessions is None else (*self.factors, of_sessions)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups of participants: `("",)` without between factors.

        One between factor: its levels; more: "haptics=on,order=b".
        """
        return tuple(_group_name(cell) for cell in combinations_of(self.between))

    @property
    def trial_count(self) -> int:
        """Trials of a session, practice not counted."""
        return len(combinations_of(self.within)) * self.repetitions


def combinations_of(factors: Sequence[Factor]) -> list[Cell]:
    """Return every combination of levels, last factor fastest."""
    names = [f.name for f in factors]
    return [
        dict(zip(names, levels, strict=True)) for levels in product(*(f.levels for f in factors))
    ]


def trial_seed(
    study_seed: int,
    participant_index: int,
    number: int,
    *,
    practice: bool = False,
    session: int = 1,
) -> int:
    """Return the seed of a trial, 0 <= seed < 2**63; trials run before it do not change it."""
    key = (participant_index, _PRACTICE if practice else _TRIAL, number, *_further(session))
    return int(_sequence(study_seed, key).generate_state(1, np.uint64)[0] >> np.uint64(1))


def group_of(design: Design, *, seed: int, participant_index: int) -> str:
    """Return the participant's group.

    Participants come in runs as long as there are groups, and every run holds each group once
    in an order drawn for that run: sizes never differ by more than one.
    """
    groups = design.groups
    run, place = divmod(participant_index, len(groups))
    rng = np.random.default_rng(_sequence(seed, (run, _GROUP)))
    return groups[int(rng.permutation(len(groups))[place])]


def _further(session: int) -> tuple[int, ...]:
    """Return what sets the chance of a further session apart; nothing for the first."""
    return (session,) if session > 1 else ()


def make_plan(
    design: Design,
    *,
    seed: int,
    participant_index: int,
    group: str | None = None,
    session: int = 1,
) -> SessionPlan:
    """Make the plan of one participant's session.

    Where sessions are a factor of the design, `session` (from 1) has an order and trials of its
    own; otherwise all sessions of a person are alike. `group` overrides the assignment by index
    (the ledger's record).

    Raises:
        DesignError: the design cannot be balanced or ordered as asked.
    """
    group_by_index = group_of(design, seed=seed, participant_index=participant_index)
    own_group = group_by_index if group is None else group
    if own_group not in design.groups:
        raise DesignError(
            f"{design.study}: there is no group {own_group!r}; "
            f"the groups are {', '.join(map(repr, design.groups))}"
        )
    between = combinations_of(design.between)[design.groups.index(own_group)]
    session = session if design.sessions else 1
    rng = np.random.default_rng(_sequence(seed, (participant_index, _ORDER, *_further(session))))
    blocks: list[Block] = []
    practice = _practice_cells(design, rng)
    if practice:
        trials = _trials(
            practice,
            between,
            block=0,
            first=1,
            total=len(practice),
            practice=True,
            seed=seed,
            participant_index=participant_index,
            session=session,
        )
        blocks.append(
            Block(0, "Practice", design.practice_instruction, trials, design.calibrate_practice)
        )
    number = 1
    for name, cells in _blocks_of_cells(design, participant_index, rng):
        trials = _trials(
            cells,
            between,
            block=len(blocks),
            first=number,
            total=design.trial_count,
            practice=False,
            seed=seed,
            participant_index=participant_index,
            session=session,
        )
        blocks.append(Block(len(blocks), name, design.instruction, trials, design.calibrate_blocks))
        number += len(cells)
    return SessionPlan(
        study=design.study,
        study_version=design.version,
        participant_index=participant_index,
        group=own_group,
        seed=seed,
        blocks=tuple(blocks),
        questionnaires=design.questionnaires,
        parameters=dict(design.parameters),
    )


def _sequence(study_seed: int, key: tuple[int, ...]) -> np.random.SeedSequence:
    if study_seed < 0 or min(key) < 0:
        raise DesignError(
            f"seed {study_seed} with key {key}: seeds, indices and trial numbers start at 0"
        )
    return np.random.SeedSequence(study_seed, spawn_key=key)


def _trials(
    cells: Sequence[Cell],
    between: Cell,
    *,
    block: int,
    first: int,
    total: int,
    practice: bool,
    seed: int,
    participant_index: int,
    session: int,
) -> tuple[Trial, ...]:
    width = 1 if practice else max(2, len(str(total)))
    return tuple(
        Trial(
            trial_id=f"{'P' if practice else 'T'}{number:0{width}d}",
            number=number,
            block=block,
            is_practice=practice,
            factors={**between, **cell},
            seed=trial_seed(seed, participant_index, number, practice=practice, session=session),
        )
        for number, cell in enumerate(cells, start=first)
    )


def _practice_cells(design: Design, rng: np.random.Generator) -> list[Cell]:
    if not isinstance(design.practice, int):
        return list(design.practice)
    cells = combinations_of(design.within)
    practice: list[Cell] = []
    while len(practice) < design.practice:
        practice += [cells[i] for i in rng.permutation(len(cells))]
    return practice[: design.practice]


def _blocks_of_cells(
    design: Design, participant_index: int, rng: np.random.Generator
) -> list[tuple[str, list[Cell]]]:
    if design.blocked_by is None:
        blocks = _shared_out(design, combinations_of(design.within), participant_index, rng)
        return [(f"Block {k}", cells) for k, cells in enumerate(blocks, start=1)]
    blocking = next(f for f in design.within if f.name == design.blocked_by)
    n = len(blocking.levels)
    level_order = _row(design.block_order, n, participant_index, rng)
    named_blocks: list[tuple[str, list[Cell]]] = []
    for level in (blocking.levels[i] for i in level_order):
        cells = [c for c in combinations_of(design.within) if c[blocking.name] == level]
        for part in _shared_out(design, cells, participant_index, rng):
            named_blocks.append((f"Block {len(named_blocks) + 1}: {level}", part))
    return named_blocks


def _shared_out(
    design: Design, cells: list[Cell], participant_index: int, rng: np.random.Generator
) -> list[list[Cell]]:
    """Order the repetitions of these cells and cut them into the design's blocks."""
    if design.phased_by is not None:
        phase = next(f for f in design.within if f.name == design.phased_by)
        own = replace(design, phased_by=None)
        phases = [
            _shared_out(own, [c for c in cells if c[phase.name] == level], participant_index, rng)
            for level in phase.levels
        ]
        return [[cell for part in parts for cell in part] for parts in zip(*phases, strict=True)]
    all_cells = cells * design.repetitions
    if design.order == "balanced_blocks":
        balanced_factors = design.balanced or _dividing(all_cells, design.blocks)
        parts = balanced_blocks(all_cells, design.blocks, balanced_factors, rng)
        return [shuffle(part, design.constraints, rng) for part in parts]
    if design.order == "random":
        return _cut(shuffle(all_cells, design.constraints, rng), design.blocks)
    ordered_cells = [
        cells[i]
        for r in range(design.repetitions)
        for i in _row(design.order, len(cells), participant_index + r, rng)
    ]
    parts = _cut(ordered_cells, design.blocks)
    for part in parts:
        for place, rule in broken_rules(part, design.constraints):
            raise DesignError(
                f"{design.study}: the {design.order} order breaks the rule ({rule}) at place "
                f"{place + 1} of a block; leave the rule out or use a random order"
            )
    return parts


def _row(order: str, n: int, row: int, rng: np.random.Generator) -> list[int]:
    if order == "latin_square":
        square = latin_square(n)
        return [int(i) for i in square[row % len(square)]]
    if order == "williams":
        square = williams(n)
        return [int(i) for i in square[row % len(square)]]
    if order == "random":
        return [int(i) for i in rng.permutation(n)]
    return list(range(n))


def _cut(cells: list[Cell], n_blocks: int) -> list[list[Cell]]:
    """Cut an order into blocks whose sizes differ by at most one."""
    bounds = [len(cells) * k // n_blocks for k in range(n_blocks + 1)]
    return [cells[a:b] for a, b in pairwise(bounds)]


def _dividing(cells: Sequence[Cell], n_blocks: int) -> tuple[str, ...]:
    """Return the factors whose every level can occur equally often in every block."""
    names = []
    for name in cells[0]:
        values = [cell[name] for cell in cells]
        if all(values.count(value) % n_blocks == 0 for value in set(values)):
            names.append(name)
    return tuple(names)


def _group_name(cell: Cell) -> str:
    if len(cell) == 1:
        return str(next(iter(cell.values())))
    return ",".join(f"{name}={level}" for name, level in cell.items())


def _check(design: Design) -> None:
    names = [f.name for f in design.factors]
    problems = [f"factor {n!r} is given twice" for n in dict.fromkeys(names) if names.count(n) > 1]
    for f in design.factors:
        if not f.levels:
            problems.append(f"factor {f.name!r} has no levels")
        problems += [
            f"factor {f.name!r} has level {level!r} twice"
            for level in dict.fromkeys(f.levels)
            if f.levels.count(level) > 1
        ]
    within = [f.name for f in design.factors if not f.between]
    if not within:
        problems.append("no factor varies within participants; add one, if need be with one level")
    for role, factor_names in (
        ("balanced", design.balanced),
        ("blocked_by", (design.blocked_by,)),
        ("phased_by", (design.phased_by,)),
    ):
        problems += [
            f"{role} names {name!r}; the factors within participants are {names_or_none(within)}"
            for name in factor_names
            if name is not None and name not in within
        ]
    if design.phased_by is not None and design.phased_by == design.blocked_by:
        problems.append(f"{design.phased_by} makes blocks and phases; name another factor for one")
    if design.repetitions < 1 or design.blocks < 1:
        problems.append("repetitions and blocks start at 1")
    if isinstance(design.practice, int):
        if design.practice < 0:
            problems.append("practice trials cannot be fewer than 0")
    else:
        levels = {f.name: (*f.levels, *f.practice_only) for f in design.factors if not f.between}
        for cell in design.practice:
            if set(cell) != set(levels) or any(cell[n] not in levels[n] for n in cell):
                problems.append(
                    f"practice trial {dict(cell)!r} is not a combination of the factors"
                )
    if not problems and design.trial_count < design.blocks:
        problems.append(f"{design.trial_count} trials cannot fill {design.blocks} blocks")
    if problems:
        raise DesignError(f"design of {design.study}: " + "; ".join(problems))
