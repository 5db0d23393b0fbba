"""Choose between repeated-measures ANOVA and Friedman for several conditions, step by step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME, Adjustment
from visavis.analysis.statistics.anova import Anova, AnovaEffect, anova_of_design
from visavis.analysis.statistics.contrasts import Contrasts
from visavis.analysis.statistics.decision import Step
from visavis.analysis.statistics.design import Frame, Levels, read_design
from visavis.analysis.statistics.errors import StatisticsError, TooFewLevels
from visavis.analysis.statistics.friedman import (
    Friedman,
    SignedRankPair,
    friedman,
    posthoc_signed_rank,
)
from visavis.analysis.statistics.inputs import differences, is_constant
from visavis.analysis.statistics.marginal import posthoc
from visavis.analysis.statistics.normality import ShapiroWilk, shapiro_wilk
from visavis.analysis.statistics.results import Provenance, Result, Row, p_text, threshold_text


@dataclass(frozen=True)
class ConditionsComparison(Result):
    """A comparison of three or more conditions of the same subjects with its decision path.

    `normality` by condition (None where a condition does not vary). `pairs` is empty when the
    test is not significant and post-hocs were not asked for in any case.
    """

    within: str
    normality: tuple[tuple[str, ShapiroWilk | None], ...]
    test: AnovaEffect | Friedman
    significant: bool
    alpha: float
    pairs: Contrasts | tuple[SignedRankPair, ...]
    steps: tuple[Step, ...]
    provenance: Provenance

    @property
    def is_parametric(self) -> bool:
        """Tell whether the ANOVA ran."""
        return isinstance(self.test, AnovaEffect)

    @property
    def p(self) -> float:
        """The p that was compared with alpha."""
        return self.test.p_used if isinstance(self.test, AnovaEffect) else self.test.p

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        kind = "Repeated-measures ANOVA" if self.is_parametric else "Friedman"
        verdict = "differ" if self.significant else "do not differ significantly"
        return f"Conditions of {self.within} {verdict}: {kind}, {self.test.sentence()}."

    def path(self) -> str:
        """Return the decision path, one line per branch."""
        return "\n".join(f"{i}. {step}" for i, step in enumerate(self.steps, 1))

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {**self.test.row(), **self.provenance.row(), "significant": self.significant}


def compare_conditions(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: str,
    levels: Sequence[object] | None = None,
    alpha: float = 0.05,
    normality_alpha: float = 0.05,
    adjust: Adjustment = "bonferroni",
    always_posthoc: bool = False,
) -> ConditionsComparison:
    """Compare conditions: Shapiro-Wilk per condition, then ANOVA or Friedman, then post-hocs.

    All conditions normal (p > `normality_alpha`) → repeated-measures ANOVA, Greenhouse-Geisser
    where Mauchly's p < .05, paired t post-hocs; otherwise Friedman and signed-rank post-hocs, also
    where all subjects differ by the same amount between conditions, so that t has no error.
    Post-hocs run when the test is significant, adjusted by `adjust`.
    """
    if not 0 < alpha < 1:
        raise StatisticsError(f"alpha must lie between 0 and 1, got {alpha}")
    order: Levels | None = None if levels is None else {within: levels}
    design = read_design(frame, dv, subject=subject, within=(within,), levels=order)
    factor = design.factors[0]
    if factor.k < 3:
        raise TooFewLevels(f"{within} has two levels; use compare_paired")
    table = design.table(design.y)
    normality = tuple(
        (str(level), None if is_constant(column) else shapiro_wilk(column, name=f"{dv} {level}"))
        for level, column in zip(factor.levels, table.T, strict=True)
    )
    # 1. The branch: a condition that does not vary counts as not normal.
    is_normal = all(s is not None and s.p > normality_alpha for _, s in normality)
    steps = [_normality_step(normality, normality_alpha, is_normal)]
    test: AnovaEffect | Friedman
    anova: Anova | None = None
    # Where everybody differs alike between conditions there is no error, and ranks decide.
    alike = [
        f"{factor.levels[i]} and {factor.levels[j]}"
        for i, j in combinations(range(factor.k), 2)
        if is_constant(differences(table[:, i], table[:, j]))
    ]
    if is_normal and alike:
        answer = f"none between {', '.join(alike)}"
        steps.append(Step("Is there an error to test against", answer, "no, Friedman"))
    elif is_normal:
        anova = anova_of_design(design, subject=subject)
    if anova is not None:
        test = anova.effects[0]
        p, provenance = test.p_used, anova.provenance
        correction = test.correction if test.correction != "none" else "no correction"
        steps.append(
            Step("Is the error spherical (Mauchly, α = .05)", str(test.sphericity), correction)
        )
    else:
        test = friedman(frame, dv, subject=subject, within=within, levels=levels)
        p, provenance = test.p, test.provenance
    steps.append(Step("Test", test.sentence(), p_text(p)))
    # 2. The verdict.
    significant = bool(np.less(p, alpha))
    steps.append(
        Step(
            "Is it significant",
            f"{p_text(p)}, α = {threshold_text(alpha)}",
            "yes" if significant else "no",
        )
    )
    # 3. Post-hocs of the same kind as the test: paired t, or signed ranks.
    pairs: Contrasts | tuple[SignedRankPair, ...] = ()
    if significant or always_posthoc:
        if anova is not None:
            pairs = posthoc(anova, within, adjust=adjust)
            lines = [(c.label, c.sentence(), c.p_adjusted) for c in pairs.contrasts]
        else:
            pairs = posthoc_signed_rank(
                frame, dv, subject=subject, within=within, levels=levels, adjust=adjust
            )
            lines = [(f"{c.level_1} − {c.level_2}", c.sentence(), c.p_adjusted) for c in pairs]
        kind = "paired t" if anova is not None else "Wilcoxon signed-rank"
        steps += [
            Step(
                f"Post-hoc {label} ({kind}, {ADJUSTMENT_NAME[adjust]})",
                text,
                _pair_verdict(p_pair, alpha, significant),
            )
            for label, text, p_pair in lines
        ]
    return ConditionsComparison(
        within,
        normality,
        test,
        significant,
        alpha,
        pairs,
        tuple(steps),
        replace(provenance, notes=(*provenance.notes, f"post-hoc {ADJUSTMENT_NAME[adjust]}")),
    )


def _pair_verdict(p_pair: float, alpha: float, significant: bool) -> str:
    """Return what a pair of levels shows: something only where the test over all levels does."""
    if p_pair >= alpha:
        return "no difference shown"
    return "differ" if significant else "no difference shown, as none is over all levels"


def _normality_step(
    normality: Sequence[tuple[str, ShapiroWilk | None]], alpha: float, is_normal: bool
) -> Step:
    results = "; ".join(
        f"{level}: " + ("does not vary" if s is None else s.sentence()) for level, s in normality
    )
    return Step(
        f"Are all conditions normal (Shapiro-Wilk, α = {threshold_text(alpha)})",
        results,
        "yes, repeated-measures ANOVA" if is_normal else "no, Friedman",
    )
