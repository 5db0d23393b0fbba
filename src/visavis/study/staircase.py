"""Staircases: the level of a trial follows from the answers before it.

The state is nothing but the rows of finished trials: a resumed session reads them and goes on at
the level at which an unbroken one would be, to the bit.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import Scalar


@dataclass(frozen=True)
@of_kinds()
class Staircase:
    """A rule by which a level goes down after `down` right answers in a row and up after `up` wrong
    ones, from `start` by `step` (upwards by `step_up`, if that differs), within `low` and `high`.

    `down=2, up=1` leads to where 70.7 % are right, `down=3` to 79.4 % (Levitt 1971, J. Acoust. Soc.
    Am. 49:467, doi:10.1121/1.1912375); with other steps up the weighted rule of Kaernbach (1991),
    Percept. Psychophys. 49:227, doi:10.3758/BF03214307. With `is_ratio` steps are factors: a level
    is multiplied or divided by 1 + step. The first `skip` reversals count for no threshold.

    Raises:
        DesignError: a number is not possible.
    """

    name: str
    start: float
    step: float
    down: int = 2
    up: int = 1
    low: float = 0.0
    high: float = 1.0
    step_up: float | None = None
    is_ratio: bool = False
    skip: int = 2

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise DesignError(f"a staircase is called {self.name!r}; give letters, digits and _")
        if not self.low <= self.start <= self.high or self.low == self.high:
            raise DesignError(
                f"staircase {self.name}: start {self.start:g} lies between low {self.low:g} and "
                f"high {self.high:g}, which differ"
            )
        if not (self.step > 0 and (self.step_up is None or self.step_up > 0)):
            raise DesignError(f"staircase {self.name}: steps are above 0")
        if self.is_ratio and not self.low > 0:
            raise DesignError(f"staircase {self.name}: with is_ratio low is above 0")
        if self.down < 1 or self.up < 1 or self.skip < 0:
            raise DesignError(f"staircase {self.name}: down and up are 1 or more, skip 0 or more")


@dataclass(frozen=True)
class StaircaseState:
    """Where a staircase stands: its level, the answers in a row that count, and its reversals.

    `direction` is -1 after a step down, 1 after one up, 0 before the first.
    """

    level: float
    right: int = 0
    wrong: int = 0
    direction: int = 0
    reversals: int = 0


def after(staircase: Staircase, state: StaircaseState, is_right: bool) -> StaircaseState:
    """Return where a staircase stands after an answer."""
    right, wrong = (state.right + 1, 0) if is_right else (0, state.wrong + 1)
    if right < staircase.down and wrong < staircase.up:
        return StaircaseState(state.level, right, wrong, state.direction, state.reversals)
    direction = -1 if is_right else 1
    step = staircase.step if is_right or staircase.step_up is None else staircase.step_up
    if staircase.is_ratio:
        next_level = state.level * (1.0 + step) ** direction
    else:
        next_level = state.level + direction * step
    level = min(max(next_level, staircase.low), staircase.high)
    reverses = state.direction != 0 and direction != state.direction
    return StaircaseState(level, 0, 0, direction, state.reversals + reverses)


def state_after(staircase: Staircase, answers: Iterable[bool]) -> StaircaseState:
    """Return where a staircase stands after all its answers, in their order."""
    state = StaircaseState(staircase.start)
    for is_right in answers:
        state = after(staircase, state, is_right)
    return state


def answers_in(rows: Sequence[Mapping[str, Any]], name: str, of: str) -> tuple[bool, ...]:
    """Return the answers to a staircase, one of several with its name, in the rows of trials."""
    return tuple(
        bool(row[f"{name}_is_right"])
        for row in rows
        if row.get(f"{name}_of") == of and row.get(f"{name}_is_right") in (True, False)
    )


class StaircaseTrial:
    """A staircase in one trial: `level` is what to show, `take` hears whether the answer is right.

    It writes the columns `NAME_of`, `NAME_level`, `NAME_is_right` and `NAME_threshold`; the last is
    the level where the direction reverses in this trial, once enough turns lie behind.
    """

    def __init__(
        self,
        staircase: Staircase,
        of: str,
        rows: Sequence[Mapping[str, Any]],
        row: dict[str, Scalar | None],
    ) -> None:
        self._staircase, self._row = staircase, row
        self._state = state_after(staircase, answers_in(rows, staircase.name, of))
        self.level = self._state.level
        name = staircase.name
        row |= {
            f"{name}_of": of,
            f"{name}_level": self.level,
            f"{name}_is_right": None,
            f"{name}_threshold": None,
        }

    def take(self, is_right: bool | None) -> None:
        """Hear whether the answer is right; None, for no answer, leaves the staircase as it is.

        Raises:
            DesignError: it is told something else.
        """
        require_verdict(self._staircase.name, is_right)
        if is_right is None:
            return
        name, coming = self._staircase.name, after(self._staircase, self._state, bool(is_right))
        self._row[f"{name}_is_right"] = bool(is_right)
        has_turned = coming.reversals > self._state.reversals
        if has_turned and coming.reversals > self._staircase.skip:
            self._row[f"{name}_threshold"] = self.level


def require_verdict(name: str, is_right: object) -> None:
    """Refuse what does not say whether an answer was right, such as the answer itself.

    Raises:
        DesignError: it is neither True, False nor None.
    """
    if is_right not in (True, False, None):
        raise DesignError(
            f"staircase {name}: take({is_right!r}); True or False (answer.is_right), or None where "
            "nothing was answered"
        )


def columns_of(staircase: Staircase) -> tuple[Column, ...]:
    """Return the columns that a staircase adds to a trial's row."""
    name = staircase.name
    words = name.replace("_", " ")
    return (
        Column(f"{name}_of", "", f"which of several staircases of {words}"),
        Column(f"{name}_level", "1", f"level of {words} in this trial"),
        Column(f"{name}_is_right", "", "whether the staircase heard of a right answer"),
        Column(f"{name}_threshold", "1", "level where the staircase reverses; empty elsewhere"),
    )
