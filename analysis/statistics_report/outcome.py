"""Questions about a table, and the outcomes of tests that answer them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import pandas as pd

from visavis.analysis.statistics.design import Missing
from visavis.analysis.statistics.results import NO_CLAIM, Array, Row
from visavis.lab.errors import UsageError


@dataclass(frozen=True)
class Question:
    """A test asked for: columns by their role, and how to test.

    `test` is a name of `TESTS`, `dv` the response, `within` and `between` the factors, `subject`
    the column that names the person; what the other fields mean stands in docs/statistics.md
    ("Questions"). Raises UsageError for a level of significance or a rule that does not exist.
    """

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
    normality_alpha: float = 0.05
    partner: str = ""
    items: tuple[str, ...] = ()
    reverse: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    unit: str = "raw"
    mu: float = 0.0
    levels: Mapping[str, Sequence[str]] = field(default_factory=dict)
    family: str = "gaussian"
    random: str = ""
    nodes: int = 0
    correction: str = ""
    equal_variances: bool = False
    bayes: bool = False
    side: bool = False
    scale: str = ""
    kind: str = ""
    level_words: Mapping[str, str] = field(default_factory=dict)
    measured_in: str = ""

    def __post_init__(self) -> None:
        """Refuse values that no test knows."""
        if self.missing not in get_args(Missing):
            raise UsageError(f"missing takes {', '.join(get_args(Missing))}, not {self.missing!r}")
        if not 0 < self.alpha < 1:
            raise UsageError(f"alpha lies between 0 and 1, not {self.alpha:g}")
        if self.bayes and self.test != "t":
            raise UsageError(
                f"a Bayes factor stands beside the test t, not {self.test}; take --test t, or "
                "leave --bayes out"
            )
        for name, tests in (
            ("random", ("lmm", "clmm", "bradleyterry")),
            ("nodes", ("clmm", "bradleyterry")),
        ):
            if getattr(self, name) and self.test not in tests:
                raise UsageError(f"{name} goes with {', '.join(tests)}, not with {self.test}")
        if self.kind and self.test != "icc":
            raise UsageError(f"a kind is chosen of intraclass correlations, not of {self.test}")
        if self.nodes and self.test != "clmm":
            raise UsageError(f"nodes of quadrature are chosen for clmm, not for {self.test}")
        if (self.low is not None or self.high is not None) and self.test not in ("t", "tost"):
            raise UsageError(
                f"bounds of equivalence (low, high) go with the tests tost and t, not {self.test}"
            )

    def need(self, *roles: str) -> None:
        """Raise UsageError for a role this test needs and nobody named."""
        for role in roles:
            if not getattr(self, role):
                option = {"partner": "with"}.get(role, role)
                raise UsageError(f"the test {self.test} needs {option}")

    def one_within(self) -> str:
        """Return the single within factor; UsageError otherwise."""
        self.need("subject", "within")
        if len(self.within) > 1:
            raise UsageError(
                f"the test {self.test} compares the levels of one factor, not of "
                f"{' and '.join(self.within)}; name one (the others are averaged over), or take "
                "the test art or rm"
            )
        return self.within[0]

    def one_between(self) -> str:
        """Return the single between factor; UsageError otherwise."""
        self.need("between")
        if len(self.between) > 1:
            raise UsageError(
                f"the test {self.test} compares the groups of one factor, not of "
                f"{' and '.join(self.between)}; name one, or take the test anova"
            )
        return self.between[0]

    def adjustment(self, default: str, choices: Sequence[str]) -> str:
        """Return how post-hoc tests are adjusted; UsageError for a way this test does not offer."""
        choice = self.posthoc or default
        if choice not in (*choices, "none"):
            raise UsageError(
                f"posthoc={choice} does not go with the test {self.test}; it takes "
                f"{', '.join(choices)} or none"
            )
        return choice


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
    """A test's answer.

    `rows` hold one row per effect (or pair of conditions) with its statistic, df, p and effect
    size; `sentences` say them in words; `path` tells every decision on the way; `contrasts` are
    post-hoc rows, each with the `family` they were corrected in; `cells` describe the data
    tested; `notes` are what a reader must know; `samples` are what the figures draw;
    `error_rates` say how often simulated studies like this one find what is not there; `data` are
    the rows tested, factors categorical.
    """

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
    error_rates: tuple[Row, ...] = ()
    data: pd.DataFrame | None = field(default=None, repr=False, compare=False)

    def row(self, term: str = "") -> Row:
        """Return the row of an effect, or of a pair of conditions, or the only row.

        `term` is 'A:B', in any order. Raises UsageError where there is none, or several rows and
        no term was given.
        """
        if not term and len(self.rows) == 1:
            return self.rows[0]
        terms = [_term(row) for row in self.rows]
        for name, row in zip(terms, self.rows, strict=True):
            if set(name.split(":")) == set(term.split(":")):
                return row
        raise UsageError(f"{self.title} has no row {term!r}; there are {', '.join(terms)}")

    def doubts(self, term: str) -> tuple[str, ...]:
        """Return the notes that say why no claim may rest on an effect, its name left out."""
        begin = f"{term}: "
        return tuple(
            note.removeprefix(begin)
            for note in self.notes
            if note.startswith(begin) and NO_CLAIM in note
        )

    def p(self, term: str = "") -> float:
        """Return the p to report of an effect: corrected for sphericity, adjusted in a family."""
        row = self.row(term)
        for name in ("p_used", "p_adjusted", "p"):
            value = row.get(name)
            if isinstance(value, float):
                return value
        raise UsageError(f"{self.title} has no p")


def _term(row: Row) -> str:
    return str(row["term"]) if "term" in row else f"{row.get('first')}:{row.get('second')}"
