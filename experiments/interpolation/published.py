"""Numbers that the source printed: means per method and p of one-way ANOVAs, by subset."""

from dataclasses import dataclass
from typing import Final

from visavis.analysis.statistics.published import check_integer_mean, check_oneway_from_means
from visavis.study.pairs import Printed

METHODS: Final = ("lineuler", "slerp", "squad")
GESTURES_A_PERSON: Final = 4
TABLES: Final = {
    "pilot": "table 1",
    "main": "table 2",
    "panel": "table 3",
    "novice": "table 4",
    "experienced": "table 4",
    "male": "table 6",
    "female": "table 6",
}
"""Where the source prints a subset; those of one gesture stand in table 5."""


@dataclass(frozen=True)
class Subset:
    """One printed row: `n` people, the means of the three methods and p, as printed.

    `gesture` names the only gesture it is about; `ratings` is how many each mean is of.
    """

    name: str
    n: int
    means: tuple[str, str, str]
    p: str
    gesture: str = ""

    @property
    def where(self) -> str:
        """The table that it stands in."""
        return TABLES.get(self.name, "table 5")

    @property
    def ratings(self) -> int:
        """Ratings per method."""
        return self.n if self.gesture else GESTURES_A_PERSON * self.n


SUBSETS: Final = (
    Subset("pilot", 18, ("2.2500", "2.0694", "3.3611"), "1.99e-12"),
    Subset("main", 97, ("2.6598", "2.7010", "3.4948"), "2e-16"),
    Subset("panel", 42, ("2.8333", "2.8929", "3.3929"), "1.1e-6"),
    Subset("novice", 72, ("2.7778", "2.8125", "3.4688"), "2e-16"),
    Subset("experienced", 25, ("2.3200", "2.3800", "3.5700"), "2e-16"),
    Subset("male", 43, ("2.6512", "2.5581", "3.5872"), "2e-16"),
    Subset("female", 49, ("2.6888", "2.8414", "3.4082"), "1.13e-11"),
    Subset("beat", 97, ("2.5464", "2.5567", "3.3814"), "3.76e-9", "beat"),
    Subset("deictic", 97, ("3.0825", "3.0412", "3.6289"), "4.78e-5", "deictic"),
    Subset("iconic", 97, ("2.5155", "2.6082", "3.6701"), "2.8e-16", "iconic"),
    Subset("metaphoric", 97, ("2.4948", "2.5979", "3.2989"), "6.82e-8", "metaphoric"),
)

TESTS: Final = {
    subset.name: Printed(
        True,
        float(subset.p),
        where=subset.where,
        text=f"one-way ANOVA, ratings as independent, p = {subset.p}",
        order="squad > slerp, lineuler",
    )
    for subset in SUBSETS
}
"""What the source prints of the methods in every subset; Tukey's test found Squad above both."""


def impossible_means() -> tuple[tuple[str, str, str], ...]:
    """Return the printed means that no whole-number ratings have: subset, method, mean."""
    return tuple(
        (subset.name, method, mean)
        for subset in SUBSETS
        for method, mean in zip(METHODS, subset.means, strict=True)
        if not check_integer_mean(mean, subset.ratings).verdicts["mean"].is_consistent
    )


def pooled_sd(subset: Subset) -> float:
    """Return the standard deviation that a subset's means and p imply."""
    return check_oneway_from_means(subset.p, subset.means, subset.ratings, names=METHODS).values[
        "pooled_sd"
    ]
