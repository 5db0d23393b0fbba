"""Choose between parametric and rank tests by a stated rule, and show every branch taken."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy.typing as npt

from visavis.analysis.statistics.adjust import (
    ADJUSTMENT_NAME,
    Adjustment,
    adjust_p,
    bonferroni_thresholds,
    stars,
)
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.inputs import differences, is_constant, paired
from visavis.analysis.statistics.normality import ShapiroWilk, shapiro_wilk
from visavis.analysis.statistics.results import (
    MINUS,
    Effect,
    Provenance,
    Result,
    Row,
    p_text,
    quantities,
    threshold_text,
)
from visavis.analysis.statistics.signed_rank import (
    SignedRank,
    SignedRankMethod,
    wilcoxon_signed_rank,
)
from visavis.analysis.statistics.t_tests import TTest, paired_t


@dataclass(frozen=True)
class Step:
    """One branch of a decision path: what was asked, the numbers, what followed."""

    question: str
    numbers: str
    answer: str

    def __str__(self) -> str:
        return f"{self.question}: {self.numbers} → {self.answer}"


@dataclass(frozen=True)
class PairedComparison(Result):
    """A comparison of two paired samples with the path that led to its test.

    `p` is as tested. Without correction and with Bonferroni, `p` below `threshold` is
    significant; with Holm and Benjamini-Hochberg, `p_adjusted` below `threshold` (= alpha) is.
    `means` are those of the two samples, in `unit`. `normality` is None where all differences are
    one and the same.
    `stars` count how many of alpha, alpha/5 and alpha/50 the adjusted p stays below.
    """

    names: tuple[str, str]
    normality: ShapiroWilk | None
    test: TTest | SignedRank
    p: float
    p_adjusted: float
    alpha: float
    threshold: float
    n_tests: int
    correction: Adjustment
    significant: bool
    stars: str
    steps: tuple[Step, ...]
    provenance: Provenance
    means: tuple[float, float]
    unit: str = ""

    @property
    def is_parametric(self) -> bool:
        """Tell whether the paired t test ran."""
        return isinstance(self.test, TTest)

    @property
    def effect(self) -> Effect:
        """The effect size of the test that ran: dz or the rank-biserial correlation."""
        return self.test.effect

    @property
    def eta(self) -> Effect | None:
        """Partial eta squared when the t test ran."""
        return self.test.eta if isinstance(self.test, TTest) else None

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        kind = "paired t test" if self.is_parametric else "Wilcoxon signed-rank test"
        eta = "" if self.eta is None else f", {self.eta}"
        verdict = "differ" if self.significant else "do not differ significantly"
        rule = f"threshold {threshold_text(self.threshold)}"
        if self.correction != "none":
            rule = f"adjusted {p_text(self.p_adjusted)}, {rule} ({self.provenance.correction})"
        unit = f" {self.unit}" if self.unit else ""
        first, second = quantities(*self.means)
        return (
            f"{self.names[0]} and {self.names[1]} {verdict} (means {first}{unit} and "
            f"{second}{unit}): {kind} of {self.names[0]} {MINUS} {self.names[1]}, "
            f"{self.test.sentence()}{eta}; {rule}."
        )

    def path(self) -> str:
        """Return the decision path, one line per branch."""
        return "\n".join(f"{i}. {step}" for i, step in enumerate(self.steps, 1))

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "first": self.names[0],
            "second": self.names[1],
            "shapiro_W": None if self.normality is None else self.normality.W,
            "shapiro_p": None if self.normality is None else self.normality.p,
            **{k: v for k, v in self.test.row().items() if k not in self.provenance.row()},
            "eta_p2": None if self.eta is None else self.eta.value,
            "p_adjusted": self.p_adjusted,
            "threshold": self.threshold,
            "significant": self.significant,
            "stars": self.stars,
            **self.provenance.row(),
        }


def compare_paired(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    names: tuple[str, str] = ("x", "y"),
    alpha: float = 0.05,
    n_tests: int = 1,
    normality_alpha: float = 0.05,
    wilcoxon: SignedRankMethod = "auto",
    level: float = 0.95,
    unit: str = "",
) -> PairedComparison:
    """Compare two paired samples: Shapiro-Wilk on x − y, then paired t or Wilcoxon.

    The difference counts as normal when p > `normality_alpha`. Where everybody differs alike, t has
    no error, and Wilcoxon's ranks decide. `n_tests` is the size of the
    family for Bonferroni; use `correct_family` to correct several comparisons by Holm or
    Benjamini-Hochberg. `wilcoxon` picks the p of the rank test.
    """
    if not 0 < alpha < 1:
        raise StatisticsError(f"alpha must lie between 0 and 1, got {alpha}")
    first, second = paired(x, y, names=names)
    between = f"{names[0]} {MINUS} {names[1]}"
    d = differences(first, second)
    differs_alike = is_constant(d) and d[0] != 0
    normality = None if differs_alike else shapiro_wilk(d, name=between)
    is_normal = normality is not None and normality.p > normality_alpha
    test: TTest | SignedRank
    if is_normal:
        test = paired_t(first, second, names=names, level=level, unit=unit)
    else:
        test = wilcoxon_signed_rank(first, second, names=names, method=wilcoxon, level=level)
    threshold = bonferroni_thresholds(alpha, n_tests)[0]
    correction: Adjustment = "bonferroni" if n_tests > 1 else "none"
    p_adjusted = min(1.0, test.p * n_tests)
    cut = threshold_text(normality_alpha)
    answer = f"all {d.size} are {d[0]:g}" if normality is None else normality.sentence()
    check = Step(
        f"Are the differences {between} normal (Shapiro-Wilk, α = {cut})",
        answer,
        "yes, paired t test" if is_normal else "no, Wilcoxon signed-rank test",
    )
    run = Step("Test", test.sentence(), p_text(test.p))
    return PairedComparison(
        names=names,
        normality=normality,
        test=test,
        p=test.p,
        p_adjusted=p_adjusted,
        alpha=alpha,
        threshold=threshold,
        n_tests=n_tests,
        correction=correction,
        significant=test.p < threshold,
        stars=stars(test.p, alpha=alpha, n_tests=n_tests),
        steps=(check, run, _verdict(test.p, p_adjusted, threshold, correction, n_tests)),
        provenance=replace(
            test.provenance,
            correction=_correction_text(correction, n_tests),
            notes=(*test.provenance.notes, f"chosen by {answer}"),
        ),
        means=(float(first.mean()), float(second.mean())),
        unit=unit,
    )


def correct_family(
    comparisons: Sequence[PairedComparison], correction: Adjustment = "holm"
) -> tuple[PairedComparison, ...]:
    """Correct several comparisons as one family, in the order given.

    The verdict compares the adjusted p with alpha, which for Bonferroni is the same as comparing
    p with alpha over the family.
    """
    if not comparisons:
        return ()
    m = len(comparisons)
    raw = [c.p for c in comparisons]
    all_p_adjusted = adjust_p(raw, correction)
    results = []
    for comparison, p_adjusted in zip(comparisons, all_p_adjusted.tolist(), strict=True):
        alpha = comparison.alpha
        threshold = alpha / m if correction == "bonferroni" else alpha
        significant = p_adjusted < alpha
        results.append(
            replace(
                comparison,
                p_adjusted=p_adjusted,
                threshold=threshold,
                n_tests=m,
                correction=correction,
                significant=significant,
                stars="*" * sum(p_adjusted < level for level in (alpha, alpha / 5, alpha / 50)),
                steps=(
                    *comparison.steps[:-1],
                    _verdict(comparison.p, p_adjusted, threshold, correction, m),
                ),
                provenance=replace(
                    comparison.provenance, correction=_correction_text(correction, m)
                ),
            )
        )
    return tuple(results)


def _correction_text(correction: Adjustment, n_tests: int) -> str:
    return "none" if correction == "none" else f"{ADJUSTMENT_NAME[correction]}, {n_tests} tests"


def _verdict(
    p: float, p_adjusted: float, threshold: float, correction: Adjustment, n_tests: int
) -> Step:
    limit = f"threshold {threshold_text(threshold)}"
    if correction == "none":
        numbers, question = f"{p_text(p)}, {limit}", "Is it significant (no correction)"
    else:
        p_values = f"{p_text(p)}, adjusted {p_text(p_adjusted)}"
        of = "" if correction == "bonferroni" else " for the adjusted p"
        numbers = f"{p_values}, {limit}{of}"
        question = f"Is it significant ({_correction_text(correction, n_tests)})"
    decisive_p = p if correction in ("none", "bonferroni") else p_adjusted
    return Step(question, numbers, "yes" if decisive_p < threshold else "no")
