"""What happens when somebody comes back to a visit to a page that they have begun and left."""

from dataclasses import dataclass
from math import inf
from typing import Final, Literal

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds

Resumes = Literal["step", "trial", "block", "start"]
Later = Literal["refuse", "restart"]
EXPIRED: Final = "expired"
"""Outcome of a visit that is too old to go on."""


@dataclass(frozen=True, kw_only=True)
@of_kinds()
class Returning:
    """How old a begun visit may be, where it goes on, and what happens to an older one.

    Somebody comes back who closed the page, or loads it anew. Nothing that they did before is
    deleted: what is done again are further attempts, of which the last finished one counts.
    """

    within_h: float = inf
    """How many hours after they came for the first time people may go on."""
    resumes: Resumes = "step"
    """Where they go on: at the "step" where they were, at the beginning of that "trial" (or of the
    questionnaire), of that "block", or at the "start", after their consent."""
    later: Later = "refuse"
    """What happens after `within_h`: "refuse", with what is finished kept, or "restart"."""

    def __post_init__(self) -> None:
        if not self.within_h > 0:
            raise DesignError(f"returning: within_h is {self.within_h}; give hours above 0")

    @property
    def is_usual(self) -> bool:
        """Whether everybody goes on where they were, whenever they come."""
        return self == Returning()

    def checkpoint(self, age_h: float) -> Resumes | None:
        """Return where a visit of an age goes on; None where it is too old."""
        if age_h <= self.within_h:
            return self.resumes
        return "start" if self.later == "restart" else None
