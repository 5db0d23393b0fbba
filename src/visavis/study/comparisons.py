"""A planned comparison: a question of `statistics_report` with its claim and its family."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, get_args

import pandas as pd

from visavis.analysis.report.notation import fraction
from visavis.analysis.statistics.agreement import ICC_KINDS, Scale
from visavis.analysis.statistics.published import check_f
from visavis.analysis.statistics_report import Question
from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import Scalar
from visavis.study.pairs import Printed

Correction = Literal["none", "holm", "bonferroni", "bh"]
Model = Literal["", "lmm", "gee", "clmm", "bradleyterry"]
ALONE: Final = ("sign", "binomial", "t", "tost")
"""Tests that can also compare one measure with a number, without a factor."""
AGREEMENT: Final = ("icc", "krippendorff", "kappa")
"""Tests of the agreement of raters about the items that the factors distinguish."""
THING: Final = "thing rated"
"""Column that names the rated item in tests of agreement."""
_SYMBOLS: Final = {"p": "p", "eta2p": "partial η²"}


def published_f(
    F: str, df1: int | str, df2: int | str, *, p: str, eta2p: str, is_significant: bool
) -> Printed:
    """Return a printed F test; its numbers are texts, so that their rounding is known.

    Degrees of freedom that were corrected for sphericity are texts, too ("1.56").
    """
    test = f"F({df1}, {df2}) = {F}"
    sign = "" if p.startswith("<") else "= "
    text = f"{test}, p {sign}{p.replace('0.', '.')}, η²p = {eta2p.removeprefix('0')}"
    check = check_f(F, df1, df2, p=p, eta=eta2p)
    misfits = tuple(
        f"the published {_SYMBOLS[name]} of {verdict.printed.removeprefix('0')} does not follow "
        f"from its {test}, which implies {fraction(verdict.computed, 3)}"
        for name, verdict in check.verdicts.items()
        if not verdict.is_consistent
    )
    df = float(df1), float(df2)
    return Printed(is_significant, statistic=float(F), df=df, text=text, misfits=misfits)


@dataclass(frozen=True)
class Compare:
    """A planned comparison of one measure over factors.

    Without `test` the design decides. Two levels within people get a paired comparison (t or
    Wilcoxon, by its own decision path), more levels repeated measures or Friedman's test, several
    factors an aligned rank transform, and groups alone Welch's t test or an ANOVA.

    `model` asks for a model instead: a mixed model ("lmm"), generalised estimating equations
    ("gee"), for ratings a cumulative link mixed model ("clmm"), or for choices between two items a
    Bradley–Terry model ("bradleyterry"). In the last, `within` are the factors of the first and the
    second item, or one factor whose levels name both ("A|B"), and the measure is above 0 where the
    first was preferred.

    Without a factor, a test of one sample ("sign", "binomial", "t", "tost") compares people's means
    with a number (option `mu`) or with bounds (options `low` and `high`).

    Tests of agreement ("icc" with the option `kind`, "krippendorff" and "kappa" with `scale`) ask
    how far participants agree about the items that the `within` factors distinguish, above the
    option `mu` (default 0). `raters` may name a factor whose levels are the raters (the occasion of
    a rating and its repetition); each participant then rates items of their own.

    `claim` says in words what a significant result would show; with several factors it is about
    their interaction. Comparisons of one `family` are corrected together. An `exploratory` one has
    a place of its own in the report and makes no headline. `only` are levels of other factors that
    trials must have ({"group": "haptics"}). `pairs` are published results of two levels, compared
    after the overall test of a factor.
    """

    dv: str
    within: str | Sequence[str] = ()
    between: str | Sequence[str] = ()
    test: str = ""
    model: Model = ""
    claim: str = ""
    family: str = "planned"
    correction: Correction = "holm"
    alpha: float = 0.05
    published: Printed | Mapping[str, Printed] | None = None
    exploratory: bool = False
    options: Sequence[tuple[str, Any]] = ()
    only: Mapping[str, Scalar] = field(default_factory=dict)
    pairs: Mapping[tuple[str, str], Printed] = field(default_factory=dict, repr=False)
    raters: str = "participant"

    def __post_init__(self) -> None:
        for name in ("within", "between"):
            value = getattr(self, name)
            object.__setattr__(self, name, (value,) if isinstance(value, str) else tuple(value))
        if not self.within and not self.between:
            if self.test not in ALONE:
                raise DesignError(
                    f"the comparison of {self.dv} names no factor; add within= or between=, or a "
                    f"test that needs none ({', '.join(ALONE)})"
                )
            if not self.claim:
                raise DesignError(
                    f"the comparison of {self.dv} has no factor whose effect it could name; say "
                    "what it would show: claim="
                )
        if self.model not in get_args(Model):
            models = ", ".join(name for name in get_args(Model) if name)
            raise DesignError(f"model is {self.model!r}; it is {models} or left out")
        if self.model and self.test:
            raise DesignError(f"the comparison of {self.dv} names a test and a model; choose one")
        object.__setattr__(self, "options", tuple(self.options))
        self._refuse_agreement()

    def _refuse_agreement(self) -> None:
        """Refuse tests of agreement without raters, items or a coefficient."""
        options = dict(self.options)
        about = f"the comparison of {self.dv} by {self.test}"
        if self.test not in AGREEMENT:
            if self.raters != "participant":
                raise DesignError(
                    f"the comparison of {self.dv} names raters, which only tests of agreement "
                    f"have ({', '.join(AGREEMENT)})"
                )
            return
        if not self.claim:
            raise DesignError(f"{about} needs a claim: what would agreement show? claim=")
        if self.between:
            raise DesignError(f"{about} has no between factor; take only= for one group")
        if self.raters != "participant" and self.raters not in self.within:
            raise DesignError(f"{about} names raters {self.raters!r}, which is no factor of within")
        if self.test == "icc" and options.get("kind") not in ICC_KINDS:
            raise DesignError(
                f'{about} decides by one coefficient; name it: options=[("kind", "ICC2")] '
                f"({', '.join(ICC_KINDS)})"
            )
        if self.test != "icc" and options.get("scale", self.test == "kappa") not in (
            *get_args(Scale),
            True,
        ):
            raise DesignError(
                f'{about} needs a scale: options=[("scale", "ordinal")] '
                f"({', '.join(get_args(Scale))})"
            )
        if self.test == "kappa" and self.raters == "participant":
            raise DesignError(
                f"{about} is of two raters; name the factor of two levels that tells them apart: "
                "raters=, or take krippendorff for all participants"
            )

    @property
    def things(self) -> tuple[str, ...]:
        """The columns that distinguish the rated items, for tests of agreement."""
        factors = tuple(name for name in self.within if name != self.raters)
        return factors if self.raters == "participant" else ("participant", *factors)

    def published_of(self, term: str) -> Printed | None:
        """Return the published result of one effect, or the only one if it names no effect."""
        if isinstance(self.published, Mapping):
            return self.published.get(term)
        return self.published

    @property
    def published_terms(self) -> Mapping[str, Printed]:
        """All published results, by effect; a single unnamed one by the comparison's factors."""
        if isinstance(self.published, Mapping):
            return self.published
        names = ":".join((*self.within, *self.between))
        return {} if self.published is None else {names: self.published}

    @property
    def terms(self) -> tuple[str, ...]:
        """The effects tested, as tests name them: "a", "b", "a:b"; without factors the measure."""
        names = (*self.within, *self.between)
        if self.model == "bradleyterry":
            items = ":".join(self.within)
            return (items, *(f"{items}:{group}" for group in self.between))
        every = ":".join(names) or self.dv
        if self.test in AGREEMENT:
            return (every,)
        pairs = [f"{a}:{b}" for i, a in enumerate(names) for b in names[i + 1 :]]
        return tuple(dict.fromkeys((*names, *pairs, every)))

    @property
    def claimed_term(self) -> str:
        """The effect of the claim, of several factors their interaction; "" without a claim."""
        return self.terms[-1] if self.claim else ""

    def is_claimed(self, term: str) -> bool:
        """Tell whether an effect, its factors in any order, is the one claimed."""
        return bool(self.claim) and set(term.split(":")) == set(self.claimed_term.split(":"))

    @property
    def name(self) -> str:
        """The comparison's name in tables: measure, factors and selected levels."""
        of = f" ({', '.join(map(str, self.only.values()))})" if self.only else ""
        if self.test in AGREEMENT:
            of = f", {self.test}{of}"
        return f"{self.dv} by {' × '.join((*self.within, *self.between)) or 'itself'}{of}"

    def select(self, trials: pd.DataFrame) -> pd.DataFrame:
        """Return the trials that it uses."""
        return trials_of(trials, self.only)

    def with_alphas(self, settings: Mapping[str, Any]) -> "Compare":
        """Return a copy with the thresholds `alpha` and `normality_alpha` that were set."""
        options = {k: v for k, v in settings.items() if k == "normality_alpha"}
        return replace(
            self,
            alpha=settings.get("alpha", self.alpha),
            options=tuple({**dict(self.options), **options}.items()),
        )

    def question(
        self,
        levels: dict[str, tuple[str, ...]],
        *,
        level_words: Mapping[str, str] | None = None,
        unit: str = "",
    ) -> Question:
        """Return the question for `visavis.analysis.statistics_report`; `levels` in their order.

        `level_words` are the words for levels in sentences, `unit` is the measure's unit.
        """
        test = self.model or self.test or self._usual(levels)
        factors = (*self.within, *self.between)
        factor_levels = {f: levels[f] for f in factors}
        agreement = test in AGREEMENT
        return Question(
            test=test,
            dv=self.dv,
            within=(self.raters,) if agreement else tuple(self.within),
            between=tuple(self.between),
            subject=THING if agreement else "participant",
            missing="listwise",
            alpha=self.alpha,
            levels=factor_levels,
            level_words={} if self.model == "bradleyterry" else dict(level_words or {}),
            measured_in=unit,
            **dict(self.options),
        )

    def _usual(self, levels: dict[str, tuple[str, ...]]) -> str:
        if self.between and not self.within:
            two = len(self.between) == 1 and len(levels[self.between[0]]) == 2
            return "t" if two else "anova"
        if self.between or len(self.within) > 1:
            return "art"
        return "paired" if len(levels[self.within[0]]) == 2 else "conditions"


def trials_of(trials: pd.DataFrame, only: Mapping[str, Scalar]) -> pd.DataFrame:
    """Return the trials that have the levels of `only`."""
    for name, level in only.items():
        trials = trials[trials[name] == level]
    return trials


def possible(
    compare: Sequence[Compare],
    in_force: Mapping[str, Sequence[Scalar]],
    design_factors: Sequence[str],
) -> tuple[Compare, ...]:
    """Return the comparisons that a design can make.

    `in_force` are the levels of every factor, `design_factors` the factors that vary in the design.
    A group to which everybody belongs is not a factor. Comparisons about an absent level, or
    between absent groups, are left out.
    """
    comparisons = []
    for one in compare:
        factors = (*one.within, *one.between)
        if any(level not in in_force.get(name, (level,)) for name, level in one.only.items()):
            continue
        if any(name in in_force and name not in design_factors for name in factors):
            continue
        restriction = {name: level for name, level in one.only.items() if name in design_factors}
        comparisons.append(replace(one, only=restriction))
    return tuple(comparisons)
