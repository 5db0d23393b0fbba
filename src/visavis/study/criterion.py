"""Practice until a criterion: when it is over, and what follows where it is not reached."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds


@dataclass(frozen=True)
@of_kinds()
class Criterion:
    """Practice is repeated until the column `of` is true in `min_01` of the trials of a round.

    After `max_rounds` rounds the session goes on, or with `otherwise="end"` it ends with its
    questions. `of` is a column of the trials that is true or false, such as "answer_is_right"; a
    trial in which it is empty does not reach it.

    Raises:
        DesignError: a number is not possible.
    """

    of: str
    min_01: float = 0.8
    max_rounds: int = 3
    otherwise: Literal["go on", "end"] = "go on"

    def __post_init__(self) -> None:
        if not 0 < self.min_01 <= 1:
            raise DesignError(f"Criterion: min_01 is {self.min_01!r}; a share above 0, up to 1")
        if self.max_rounds < 1:
            raise DesignError(f"Criterion: max_rounds is {self.max_rounds!r}; 1 or more")
        if self.otherwise not in ("go on", "end"):
            raise DesignError(f'Criterion: otherwise is {self.otherwise!r}; "go on" or "end"')

    @property
    def words(self) -> str:
        """The rule as a sentence, for plans and reports."""
        then = "the session ends" if self.otherwise == "end" else "it goes on all the same"
        return (
            f"Practice is repeated until {self.of} holds in {self.min_01:.0%} of its trials; after "
            f"{self.max_rounds} rounds {then}."
        )


@dataclass(frozen=True)
class PracticeState:
    """How many of the last trials of practice were right."""

    right: int
    trials: int

    def is_reached(self, criterion: Criterion) -> bool:
        """Tell whether the criterion is reached; by nobody who performed no trial."""
        return self.trials > 0 and self.right >= criterion.min_01 * self.trials - 1e-9


def practice_state(
    criterion: Criterion, rows: Sequence[Mapping[str, Any]], trials: int
) -> PracticeState:
    """Return the state of practice after all rows of a session's complete trials.

    `trials` is the number of trials in a round. It follows from the rows alone, so that a resumed
    session comes to the same.
    """
    last = [row for row in rows if row["is_practice"]][-trials:]
    return PracticeState(sum(row.get(criterion.of) in (True, 1) for row in last), len(last))
