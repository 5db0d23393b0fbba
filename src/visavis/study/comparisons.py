"""A planned comparison: a question of `statistics_report` with its claim and its family."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, get_args

import pandas as pd

from visavis.analysis.report.notation import fraction
from visavis.analysis.statistics.agreement import ICC_KINDS, Scale
from visavis.analysis.statistics.published import check_f
from visavis.analysis.statistics_report import Question
from visavis.analysis.statistics_report.outcome import TESTS_OF_FACTORS
from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.steps import Scalar
from visavis.study.conditions import Groups, condition_of, fulfils
from visavis.study.expectations import HOW_TO_WRITE, Order, orders_of
from visavis.study.pairs import Printed

Correction = Literal["none", "holm", "bonferroni", "bh"]
Test = Literal[
    "",
    "art",
    "rm",
    "mixed",
    "lmm",
    "gee",
    "clmm",
    "anova",
    "welch",
    "friedman",
    "conditions",
    "kruskal",
    "bradleyterry",
    "sign",
    "binomial",
    "paired",
    "t",
    "wilcoxon",
    "mannwhitney",
    "shapiro",
    "spearman",
    "pearson",
    "tost",
    "cronbach",
    "icc",
    "krippendorff",
    "kappa",
]
Model = Literal["", "lmm", "gee", "clmm", "bradleyterry"]
ALONE: Final = ("sign", "binomial", "t", "tost")
"""Tests that can also compare one measure with a number, without a factor."""
AGREEMENT: Final = ("icc", "krippendorff", "kappa")
"""Tests of the agreement of raters about the items that the factors distinguish."""
DIRECTED: Final = ("tost", *AGREEMENT)
"""Tests that have their direction: within bounds, or agreement above a number."""
TWO_LEVELS: Final = (
    "paired",
    "conditions",
    "friedman",
    "wilcoxon",
    "t",
    "welch",
    "mannwhitney",
    "kruskal",
    "sign",
)
"""Tests of one factor, which have no interaction: of that the design decides the test."""
THING: Final = "thing rated"
"""Column that names the rated item in tests of agreement."""
_SYMBOLS: Final = {"p": "p", "eta2p": "partial η²"}


def published_f(
    F: str,
    df1: int | str,
    df2: int | str,
    *,
    p: str,
    eta2p: str,
    is_significant: bool,
    order: str | None = None,
    where: str = "",
) -> Printed:
    """Return a printed F test; its numbers are texts, so that their rounding is known.

    Degrees of freedom that were corrected for sphericity are texts, too ("1.56"). `order` says
    which levels had the greater values, as `Compare.expects` does ("warping > orientation"); a
    significant result needs one, "" where the source does not print it. `where` is its table or
    page.

    Raises:
        DesignError: a significant result has no order, or the text is none.
    """
    if is_significant and order is None:
        raise DesignError(
            f"the published F({df1}, {df2}) = {F} is significant; say which levels it found "
            'greater: order="a > b", or order="" where the source does not print it'
        )
    if order:
        orders_of(order, f"the published F({df1}, {df2}) = {F}")
    test = f"F({df1}, {df2}) = {F}"
    sign = "< " if p.startswith("<") else "= "
    text = f"{test}, p {sign}{p.lstrip('< ').replace('0.', '.')}, η²p = {eta2p.removeprefix('0')}"
    check = check_f(F, df1, df2, p=p, eta=eta2p)
    misfits = tuple(
        f"the published {_SYMBOLS[name]} of {verdict.printed.removeprefix('0')} does not follow "
        f"from its {test}, which implies {fraction(verdict.computed, 3)}"
        for name, verdict in check.verdicts.items()
        if not verdict.is_consistent
    )
    df = float(df1), float(df2)
    return Printed(
        is_significant,
        statistic=float(F),
        eta_p2=float(eta2p),
        df=df,
        text=text,
        where=where,
        misfits=misfits,
        order=order or "",
    )


@dataclass(frozen=True)
@of_kinds()
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

    `claim` says in words what the comparison should show, and `expects` in which direction: which
    levels give the greater values ("waves > stands"; of more levels "a > b > c" or "a > b, c"; of
    one of several factors "motion: waves > stands"; of an interaction "motion: waves > stands;
    distance: near > far": the advantage of waving is greater when near). Without a factor it is the
    measure and the number ("vote > 3"). A claim is shown only where every difference it expects is
    significant in that direction. Tests of equivalence and of agreement have their own direction
    and take none. `one_sided` tests a claim about two levels in its direction only: its p is half
    the other's, and the opposite is never found.

    Comparisons of one `family` are corrected together. An `exploratory` one has
    a place of its own in the report and makes no headline. `only` are levels of other factors that
    trials must have ({"group": "haptics"}). `pairs` are published results of two levels, compared
    after the overall test of a factor.

    `where` are conditions on columns of trials or on answers of participants ("age >= 30", "gender
    = 1, 3", or a column of truths by its name), which must all hold. `by` repeats the comparison at
    every level of another factor, or of a group of people that the study declares (`groups`), and
    adds whether what is compared differs between these levels: its interaction with `by`. All of
    them are corrected as one family; `published` may then be given by level of `by`.

    The option `covariates` holds numbers of people constant (ANCOVA, `test` "rm" or "anova"):
    `options=[("covariates", ("age",))]`.

    `simple` names a factor of several: after a significant interaction its levels are compared at
    each level of the other factor (simple effects), instead of all cells with one another.
    """

    dv: str
    within: str | Sequence[str] = ()
    between: str | Sequence[str] = ()
    test: Test = ""
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
    expects: str = ""
    one_sided: bool = False
    by: str = ""
    where: str | Sequence[str] = ()
    simple: str = ""

    def __post_init__(self) -> None:
        for name in ("within", "between", "where"):
            value = getattr(self, name)
            object.__setattr__(self, name, (value,) if isinstance(value, str) else tuple(value))
        if not self.within and not self.between:
            if self.test not in ALONE:
                raise DesignError(
                    f"the comparison of {self.dv} names no factor; add within= or between=, or a "
                    f"test that needs none ({', '.join(ALONE)})"
                )
            if not self.claim and not self.expects:
                raise DesignError(
                    f"the comparison of {self.dv} has no factor whose effect it could name; say "
                    "what it would show: claim= or expects="
                )
        if self.model and self.test:
            raise DesignError(f"the comparison of {self.dv} names a test and a model; choose one")
        object.__setattr__(self, "options", tuple(self.options))
        for condition in self.where:
            condition_of(condition, f"the comparison of {self.dv}, where")
        self._refuse_by()
        self._refuse_simple()
        self._refuse_agreement()
        self._refuse_direction()
        self._refuse_one_sided()

    def _refuse_by(self) -> None:
        """Refuse a repetition over levels that this comparison cannot have."""
        if not self.by:
            return
        about = f"the comparison of {self.dv} by {self.by}"
        if not self.within and not self.between:
            raise DesignError(f"{about} needs a factor whose effect it repeats: within=, between=")
        if self.by in self.only:
            raise DesignError(f"{about} names {self.by} in only=, too; leave one of them out")
        if self.model == "bradleyterry" or self.test in (*AGREEMENT, "tost"):
            raise DesignError(
                f"{about}: {self.model or self.test} has no interaction with {self.by}; name the "
                'levels one by one: where="..."'
            )

    def _refuse_simple(self) -> None:
        """Refuse simple effects of what is no factor of an interaction."""
        factors = (*self.within, *self.between)
        if self.simple and (len(factors) < 2 or self.simple not in factors):
            raise DesignError(
                f"the comparison of {self.dv} has no simple effects of {self.simple!r}; name one "
                f"of its factors, of which it needs two (there are {names_or_none(factors)})"
            )
        test = self.model or self.test
        if self.simple and test and test not in TESTS_OF_FACTORS:
            raise DesignError(
                f"the comparison of {self.dv} by {test} has no simple effects; "
                f"{', '.join(TESTS_OF_FACTORS)} have"
            )

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
            raise DesignError(
                f"{about} names raters {self.raters!r}, which is not a factor of within"
            )
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

    def _refuse_direction(self) -> None:
        """Refuse a claim without a direction, and a direction that this test cannot have."""
        about = f"the comparison of {self.dv}"
        if self.test in DIRECTED:
            if self.expects:
                raise DesignError(
                    f"{about} by {self.test} has its own direction; leave expects= out"
                )
            return
        if not self.expects:
            if self.claim:
                raise DesignError(
                    f"{about} claims {self.claim!r} and has no direction; "
                    f"{self._expects_example()}. Without a direction leave the claim out"
                )
            return
        factors = (*self.within, *self.between)
        orders = self.orders
        if not factors:
            is_order = len(orders) == 1 and len(orders[0].names) == 2
            number = next((n for n in orders[0].names if n != self.dv), "") if is_order else ""
            if not is_order or self.dv not in orders[0].names or _number(number) != self.mu:
                raise DesignError(
                    f"{about} expects {self.expects!r}; it is tested against {self.mu:g}, so write "
                    f'expects="{self.dv} > {self.mu:g}" or expects="{self.dv} < {self.mu:g}"'
                )
            return
        named = [order.factor for order in orders]
        if self.model == "bradleyterry":
            if named != [""]:
                raise DesignError(
                    f"{about} expects {self.expects!r}; a Bradley–Terry model orders the items: "
                    'expects="a > b, c"'
                )
            return
        if named == [""] and len(factors) > 1:
            raise DesignError(
                f"{about} expects {self.expects!r} and has several factors; say of which: "
                f'expects="{factors[0]}: {self.expects}"'
            )
        for name in (n for n in named if n and n not in factors):
            raise DesignError(
                f"{about} expects something of {name!r}, which is no factor of it; there are "
                f"{', '.join(factors)}"
            )

    def _refuse_one_sided(self) -> None:
        """Refuse a one-sided test of what has no single direction."""
        if not self.one_sided:
            return
        about = f"the comparison of {self.dv} is one-sided"
        if not self.expects or any(len(order.names) != 2 for order in self.orders):
            raise DesignError(
                f"{about}, which needs a direction between two levels: "
                'expects="waves > stands", or leave one_sided out'
            )
        if self.model == "bradleyterry" or (self.test == "binomial" and self.mu != 0.5):
            raise DesignError(f"{about}; {self.model or self.test} is tested on both sides only")

    def _expects_example(self) -> str:
        """Return how to write the direction of this comparison."""
        if not (self.within or self.between):
            return f'add expects="{self.dv} > {self.mu:g}" or expects="{self.dv} < {self.mu:g}"'
        return HOW_TO_WRITE

    @property
    def mu(self) -> float:
        """The number with which a test without a factor compares."""
        usual = 0.5 if self.test == "binomial" else 0.0
        return float(dict(self.options).get("mu", usual))

    @property
    def orders(self) -> tuple[Order, ...]:
        """What it expects: one order of levels, two of an interaction; none without a direction.

        Every order names its factor, except that of a Bradley–Terry model and of no factor.
        """
        if not self.expects:
            return ()
        orders = orders_of(self.expects, f"the comparison of {self.dv}")
        factors = (*self.within, *self.between)
        if len(orders) == 1 and not orders[0].factor and len(factors) == 1:
            is_of_items = self.model == "bradleyterry"
            return orders if is_of_items else (replace(orders[0], factor=factors[0]),)
        return orders

    @property
    def has_claim(self) -> bool:
        """Tell whether it should show something, in words or as a direction."""
        return bool(self.claim or self.expects)

    @property
    def claim_words(self) -> str:
        """What it should show in words; without a claim the direction itself."""
        return self.claim or (f"{self.dv}: {self.expects}" if self.expects else "")

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
        return tuple(t for t in dict.fromkeys((*names, *pairs, every)) if self.is_asked(t))

    def is_asked(self, term: str) -> bool:
        """Tell whether an effect is one of those asked for.

        Where `by` is a factor already, those are its interactions with the others. Effects of what
        is held constant are none.
        """
        names, factors = (*self.within, *self.between), set(term.split(":"))
        return factors.isdisjoint(self.covariates) and (self.by not in names or {self.by} < factors)

    @property
    def covariates(self) -> tuple[str, ...]:
        """Columns of numbers of people that the test holds constant (option `covariates`)."""
        names = dict(self.options).get("covariates", ())
        return (names,) if isinstance(names, str) else tuple(names)

    def parts(self, levels: Sequence[Scalar], *, is_between: bool) -> tuple["Compare", ...]:
        """Return what a comparison `by` another factor consists of; without `by` only itself.

        One comparison at each of the `levels` of `by`, then the interaction with it; `is_between`
        tells whether it groups people.
        """
        if not self.by or self.by in (*self.within, *self.between):
            return (self,)
        printed_by_level = (
            self.published
            if isinstance(self.published, Mapping) and set(self.published) & set(map(str, levels))
            else None
        )
        at_levels = (
            replace(
                self,
                by="",
                only={**self.only, self.by: level},
                published=(
                    self.published if printed_by_level is None else printed_by_level.get(str(level))
                ),
            )
            for level in levels
        )
        interaction = replace(
            self,
            within=tuple(self.within) if is_between else (*self.within, self.by),
            between=(*self.between, self.by) if is_between else tuple(self.between),
            test="" if self.test in TWO_LEVELS else self.test,
            claim="",
            expects="",
            one_sided=False,
            published=None,
            pairs={},
        )
        return (*at_levels, interaction)

    @property
    def claimed_term(self) -> str:
        """The effect that the claim is about; "" without one."""
        if not self.has_claim:
            return ""
        named = {order.factor for order in self.orders} - {""}
        if not named:
            return self.terms[0] if self.model == "bradleyterry" else self.terms[-1]
        return next(term for term in self.terms if set(term.split(":")) == named)

    def is_claimed(self, term: str) -> bool:
        """Tell whether an effect, its factors in any order, is the one claimed."""
        return self.has_claim and set(term.split(":")) == set(self.claimed_term.split(":"))

    @property
    def name(self) -> str:
        """The comparison's name in tables: measure, factors and selected levels."""
        of = f" ({', '.join(self.restrictions)})" if self.restrictions else ""
        if self.test in AGREEMENT:
            of = f", {self.test}{of}"
        names = (*self.within, *self.between)
        each = f", each {self.by}" if self.by and self.by not in names else ""
        return f"{self.dv} by {' × '.join(names) or 'itself'}{each}{of}"

    @property
    def restrictions(self) -> tuple[str, ...]:
        """What trials it is about: levels of other factors, and conditions."""
        return (*map(str, self.only.values()), *self.where)

    def select(self, trials: pd.DataFrame) -> pd.DataFrame:
        """Return the trials that it uses, which have the columns its conditions are about."""
        trials = trials_of(trials, self.only)
        for text in self.where:
            trials = trials[fulfils(trials, condition_of(text, self.name))]
        return trials

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
        # Levels are compared as a model with covariates adjusts them, which headlines give.
        options: dict[str, Any] = {"always_posthoc": True} if self.covariates else {}
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
            simple=self.simple,
            **(options | dict(self.options)),
        )

    def _usual(self, levels: dict[str, tuple[str, ...]]) -> str:
        if self.covariates:
            return "rm" if self.within else "anova"
        if self.between and not self.within:
            two = len(self.between) == 1 and len(levels[self.between[0]]) == 2
            return "t" if two else "anova"
        if self.between or len(self.within) > 1:
            return "art"
        return "paired" if len(levels[self.within[0]]) == 2 else "conditions"


def _number(text: str) -> float | None:
    """Return the number that a text writes; None for other texts."""
    try:
        return float(text)
    except ValueError:
        return None


def trials_of(trials: pd.DataFrame, only: Mapping[str, Scalar]) -> pd.DataFrame:
    """Return the trials that have the levels of `only`."""
    for name, level in only.items():
        trials = trials[trials[name] == level]
    return trials


def possible(
    compare: Sequence[Compare],
    in_force: Mapping[str, Sequence[Scalar]],
    design_factors: Sequence[str],
    between: Sequence[str] = (),
    groups: Groups | None = None,
) -> tuple[Compare, ...]:
    """Return the comparisons that a design can make, those `by` a factor in their parts.

    `in_force` are the levels of every factor, `design_factors` the factors that vary in the design,
    `between` those between people, `groups` the groups of people that follow from answers. A group
    to which everybody belongs is not a factor. Comparisons about an absent level, or between absent
    groups, are left out.
    """
    groups = groups or {}
    comparisons: list[Compare] = []
    for whole in compare:
        levels = in_force.get(whole.by) or tuple(groups.get(whole.by, ()))
        is_between = whole.by in (*groups, *between)
        comparisons += whole.parts(levels, is_between=is_between) if levels else (whole,)
    possible_ones = []
    for one in comparisons:
        factors = (*one.within, *one.between)
        if any(level not in in_force.get(name, (level,)) for name, level in one.only.items()):
            continue
        if any(name in in_force and name not in design_factors for name in factors):
            continue
        restriction = {
            name: level
            for name, level in one.only.items()
            if name in design_factors or name in groups
        }
        possible_ones.append(replace(one, only=restriction))
    return tuple(possible_ones)
