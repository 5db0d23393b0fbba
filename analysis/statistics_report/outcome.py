"""What is asked of a table, and what a test answered."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from analysis.statistics.results import Array, Row
from lab.errors import UsageError

Missing: TypeAlias = Literal["error", "listwise", "mixed"]


@dataclass(frozen=True)
class Question:
    """A test asked for: columns by their role, and how to test."""

    test: str
    dv: str = ""
    within: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    subject: str = ""
    missing: Missing = "error"
    transform: str = "art"
    error: str = "strata"
    posthoc: str = ""
    always_posthoc: bool = False
    alpha: float = 0.05
    partner: str = ""
    items: tuple[str, ...] = ()
    reverse: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    unit: str = "raw"
    mu: float = 0.0
    levels: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def need(self, *roles: str) -> None:
        """Raise UsageError for a role this test needs and nobody named."""
        for role in roles:
            if not getattr(self, role):
                option = {"partner": "with"}.get(role, role)
                raise UsageError(f"--test {self.test} needs --{option}")

    def one_within(self) -> str:
        """Return the single within factor; UsageError otherwise."""
        self.need("subject", "within")
        if len(self.within) > 1:
            raise UsageError(
                f"--test {self.test} compares the levels of one factor, not of "
                f"{' and '.join(self.within)}; name one (the others are averaged over), or take "
                "--test art or rm"
            )
        return self.within[0]

    def one_between(self) -> str:
        """Return the single between factor; UsageError otherwise."""
        self.need("between")
        if len(self.between) > 1:
            raise UsageError(
                f"--test {self.test} compares the groups of one factor, not of "
                f"{' and '.join(self.between)}; name one, or take --test anova"
            )
        return self.between[0]

    def adjustment(self, default: str, allowed: Sequence[str]) -> str:
        """Return how post-hoc tests are adjusted; UsageError for a way this test has not."""
        wanted = self.posthoc or default
        if wanted not in (*allowed, "none"):
            raise UsageError(
                f"--posthoc {wanted} does not go with --test {self.test}; it takes "
                f"{', '.join(allowed)} or none"
            )
        return wanted


@dataclass(frozen=True)
class Samples:
    """Values to draw: by condition, one per participant when `paired`; `kind` of figure."""

    name: str
    title: str
    conditions: Mapping[str, Array]
    paired: bool = True
    kind: Literal["estimation", "scatter"] = "estimation"


@dataclass(frozen=True)
class Outcome:
    """A test's answer: rows of its table, sentences, the path of decisions, contrasts."""

    question: Question
    title: str
    rows: tuple[Row, ...]
    sentences: tuple[str, ...]
    path: tuple[str, ...] = ()
    contrasts: tuple[Row, ...] = ()
    contrast_sentences: tuple[str, ...] = ()
    cells: tuple[Row, ...] = ()
    notes: tuple[str, ...] = ()
    samples: tuple[Samples, ...] = ()
    is_simulated: bool = False
