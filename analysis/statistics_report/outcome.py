"""Questions about a table, and the outcomes of tests that answer them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

import pandas as pd

from visavis.analysis.statistics.design import Missing
from visavis.analysis.statistics.results import NO_CLAIM, Array, Row
from visavis.lab.errors import UsageError
from visavis.lab.parts import missing_attribute, parts_from, takes_keywords_of


@dataclass(frozen=True, kw_only=True)
class DecisionRule:
    """When an effect counts, and which levels are then compared."""

    alpha: float = 0.05
    """The level of significance."""
    normality_alpha: float = 0.05
    """For conditions: the level of the test of normality that decides which test is taken."""
    posthoc: str = ""
    """How contrasts are adjusted, or none; the test's own way if left out."""
    always_posthoc: bool = False
    """Whether levels are compared where the effect is not significant, too."""
    simple: str = ""
    """The factor whose levels are compared at each level of the other, after an interaction of two:
    its simple effects, instead of all cells."""


@dataclass(frozen=True, kw_only=True)
class ModelChoices:
    """How tests that fit a model do it; each test takes some of these."""

    transform: str = "art"
    """For art: "art" ranks aligned values, "int" takes normal scores of plain ranks."""
    error: str = "strata"
    """For art: the error of within effects, "strata", "pooled" or "mixed"."""
    family: str = "gaussian"
    """For gee: gaussian, binomial or poisson."""
    random: str = ""
    """For lmm, clmm and bradleyterry: in what people differ; the test's own choice if left out."""
    nodes: int = 0
    """For clmm and bradleyterry: nodes of quadrature to a random effect; 0 is Laplace."""
    correction: str = ""
    """For rm and art, sphericity: mauchly, gg, hf or none; the test's own choice if left out."""
    equal_variances: bool = False
    """For t between groups: Student's test instead of Welch's."""
    bayes: bool = False
    """For t, and rm and anova of one factor: the Bayes factor beside it."""
    covariates: tuple[str, ...] = ()
    """For rm and anova: columns of numbers of people that are held constant (ANCOVA)."""
    side: bool = False
    """For bradleyterry: whether the odds of the first item (side preference) are reported, too."""


@dataclass(frozen=True, kw_only=True)
class ReferenceValues:
    """The values with which tests compare the response."""

    mu: float = 0.0
    """For t with one sample, sign, binomial, icc, krippendorff, kappa: the value of no effect."""
    low: float | None = None
    """For tost and t: the lower bound of equivalence."""
    high: float | None = None
    """For tost and t: the upper bound of equivalence."""
    unit: str = "raw"
    """What these bounds are given in: "raw", as the response, or "sd", its standard deviation."""


@dataclass(frozen=True, kw_only=True)
class ReliabilityChoices:
    """What tests of reliability and agreement are asked of."""

    items: tuple[str, ...] = ()
    """For cronbach: the columns of the scale's items."""
    reverse: tuple[str, ...] = ()
    """For cronbach: those items that are turned round."""
    scale: str = ""
    """For krippendorff and kappa: nominal, ordinal, interval or ratio."""
    kind: str = ""
    """For icc: the one coefficient to report, such as ICC2; all six if left out."""


@dataclass(frozen=True, kw_only=True)
class Wording:
    """The words of sentences; rows and tables keep names."""

    level_words: Mapping[str, str] = field(default_factory=dict)
    """What sentences call levels, by their names."""
    measured_in: str = ""
    """The unit of the response."""


TESTS_OF_FACTORS: Final = ("art", "rm", "mixed", "lmm", "gee", "clmm", "anova")
"""The tests of several factors, which have interactions."""
WITH_BAYES: Final = ("t", "rm", "anova")
"""The tests that have a Bayes factor."""
WITH_COVARIATES: Final = ("rm", "anova")
"""The tests that hold numbers of people constant."""
PARTS: Final[Mapping[str, type[Any]]] = {
    "decision": DecisionRule,
    "model": ModelChoices,
    "reference": ReferenceValues,
    "reliability": ReliabilityChoices,
    "wording": Wording,
}
"""The parts of a question by the names under which it has them."""


@dataclass(frozen=True)
class _Keywords(Wording, ReliabilityChoices, ReferenceValues, ModelChoices, DecisionRule):
    """The keywords of `Question`: its own, and every field of every part."""

    test: str
    dv: str = ""
    within: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    subject: str = ""
    missing: Missing = field(default="error", kw_only=True)
    partner: str = field(default="", kw_only=True)
    levels: Mapping[str, Sequence[str]] = field(default_factory=dict, kw_only=True)
    decision: DecisionRule | None = field(default=None, kw_only=True)
    model: ModelChoices | None = field(default=None, kw_only=True)
    reference: ReferenceValues | None = field(default=None, kw_only=True)
    reliability: ReliabilityChoices | None = field(default=None, kw_only=True)
    wording: Wording | None = field(default=None, kw_only=True)


@dataclass(frozen=True, init=False)
class Question:
    """A test asked for: columns by their role, and how to test.

    Fields of its parts are given by their names, `Question("tost", dv="error", low=-1, high=1)`;
    it has them as `question.reference.low`. What they mean for users stands in docs/statistics.md
    ("Questions").

    Raises:
        TypeError: there is no such keyword; it says which one is nearest.
        UsageError: a level of significance or a rule that does not exist, or a choice that the
            test does not have.
    """

    test: str
    """A name of `TESTS`."""
    dv: str
    """The column of the response."""
    within: tuple[str, ...]
    """The columns of factors that vary within people."""
    between: tuple[str, ...]
    """The columns of factors that vary between people."""
    subject: str
    """The column that names the person."""
    missing: Missing
    """What becomes of people with missing cells."""
    partner: str
    """The other column of a correlation."""
    levels: Mapping[str, Sequence[str]]
    """The order of a factor's levels, by factor."""
    decision: DecisionRule
    """When an effect counts, and which levels are then compared."""
    model: ModelChoices
    """How tests that fit a model do it."""
    reference: ReferenceValues
    """The values with which tests compare the response."""
    reliability: ReliabilityChoices
    """What is asked of raters or items that should agree."""
    wording: Wording
    """The words of sentences."""

    @takes_keywords_of(_Keywords)
    def __init__(
        self,
        test: str,
        dv: str = "",
        within: tuple[str, ...] = (),
        between: tuple[str, ...] = (),
        subject: str = "",
        *,
        missing: Missing = "error",
        partner: str = "",
        levels: Mapping[str, Sequence[str]] | None = None,
        **keywords: Any,
    ) -> None:
        own = {
            "test": test,
            "dv": dv,
            "within": within,
            "between": between,
            "subject": subject,
            "missing": missing,
            "partner": partner,
            "levels": {} if levels is None else levels,
        }
        for name, value in {**own, **parts_from(PARTS, keywords)}.items():
            object.__setattr__(self, name, value)  # the fields are frozen for everyone else
        self._refuse_bad_values()

    if not TYPE_CHECKING:  # type checkers report a missing attribute themselves

        def __getattr__(self, name: str) -> Any:
            """Raise with the part that has this attribute."""
            raise missing_attribute(self, name, PARTS)

    def _refuse_bad_values(self) -> None:
        """Refuse values that no test knows, and choices that this test does not have."""
        if self.missing not in get_args(Missing):
            raise UsageError(f"missing takes {', '.join(get_args(Missing))}, not {self.missing!r}")
        if not 0 < self.decision.alpha < 1:
            raise UsageError(f"alpha lies between 0 and 1, not {self.decision.alpha:g}")
        model, reference = self.model, self.reference
        if model.bayes and self.test not in WITH_BAYES:
            raise UsageError(
                f"a Bayes factor stands beside the tests {', '.join(WITH_BAYES)}, not {self.test}; "
                "take one of them, or leave --bayes out"
            )
        n_factors = len(self.within) + len(self.between)
        if model.bayes and self.test != "t" and (n_factors != 1 or model.covariates):
            raise UsageError(
                f"the Bayes factor of the test {self.test} is that of one factor without "
                "covariates; take one, leave --bayes out, or take the test t for two conditions"
            )
        if (simple := self.decision.simple) and (
            self.test not in TESTS_OF_FACTORS or simple not in (*self.within, *self.between)
        ):
            factors = ", ".join((*self.within, *self.between))
            raise UsageError(
                f"simple={simple} names no factor whose simple effects the test {self.test} "
                f"compares; of {', '.join(TESTS_OF_FACTORS)} it is a factor ({factors})"
            )
        object.__setattr__(model, "covariates", _as_names(model.covariates))
        for name, choice, tests in (
            ("covariates", model.covariates, WITH_COVARIATES),
            ("random", model.random, ("lmm", "clmm", "bradleyterry")),
            ("nodes", model.nodes, ("clmm", "bradleyterry")),
        ):
            if choice and self.test not in tests:
                raise UsageError(f"{name} goes with {', '.join(tests)}, not with {self.test}")
        if self.reliability.kind and self.test != "icc":
            raise UsageError(f"a kind is chosen of intraclass correlations, not of {self.test}")
        if (reference.low is not None or reference.high is not None) and self.test not in (
            "t",
            "tost",
        ):
            raise UsageError(
                f"bounds of equivalence (low, high) go with the tests tost and t, not {self.test}"
            )

    def need(self, *roles: str) -> None:
        """Raise UsageError for a role this test needs and nobody named."""
        for role in roles:
            if not (self.reliability.items if role == "items" else getattr(self, role)):
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
        choice = self.decision.posthoc or default
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


def _as_names(names: str | Sequence[str]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _term(row: Row) -> str:
    return str(row["term"]) if "term" in row else f"{row.get('first')}:{row.get('second')}"
