"""Numbers that the source printed, with two slips of its text noted."""

from dataclasses import dataclass
from typing import Final

PEOPLE: Final = 21


@dataclass(frozen=True)
class Moments:
    """Mean and standard deviation over people of the ratings of one body, as printed."""

    mean: float
    sd: float


RATINGS: Final = {
    "still": Moments(-0.63, 0.68),
    "corpus": Moments(1.10, 0.38),
    "holds": Moments(0.65, 0.41),
}
TESTS: Final = {
    ("still", "corpus"): -10.19,
    ("still", "holds"): -7.36,
    ("corpus", "holds"): 3.75,
}
"""t(40) of two bodies as if seen by different people, in this order."""
VOTES_MEAN: Final = -0.73
VOTES_T: Final = -5.78
"""Mean vote, −2 for the corpus and +2 for holds, and its t(20) against 0."""
SLIPS: Final = (
    "It calls the body filled from the corpus F, and M once where it prints the mean ratings.",
    "Its discussion speaks of a preference of I over F, against its own means and tests, which "
    "prefer F.",
)
