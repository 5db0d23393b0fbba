"""Analysis of variance: repeated measures, mixed designs (type III), sphericity, effect sizes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy import special

from visavis.analysis.statistics.design import (
    Design,
    Frame,
    Levels,
    Missing,
    read_design,
    with_covariates,
)
from visavis.analysis.statistics.effect_table import EffectTable
from visavis.analysis.statistics.effects import partial_eta_squared, tails_of
from visavis.analysis.statistics.errors import ConstantResponse, UnknownMethod
from visavis.analysis.statistics.linear import FittedMixedModel, model_matrix, residual_ss
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    f_text,
    p_text,
)
from visavis.analysis.statistics.sphericity import Sphericity, p_at_epsilon, sphericity
from visavis.analysis.statistics.strata import Strata, Stratum

Correction: TypeAlias = Literal["mauchly", "gg", "hf", "none"]


@dataclass(frozen=True)
class AnovaEffect(Result):
    """One line of an ANOVA table.

    `F`, `df1`, `df2` and `p` are uncorrected; `df1_used`, `df2_used` and `p_used` are those to
    report, after the correction `correction` names. `ges` is generalised eta squared with every
    factor manipulated (None where it is not defined); `sphericity` is None for two levels,
    between effects and models without strata.
    """

    term: tuple[str, ...]
    F: float
    df1: float
    df2: float
    p: float
    ss: float | None
    ss_error: float | None
    error_term: str
    eta: Effect
    ges: float | None
    sphericity: Sphericity | None
    correction: str
    df1_used: float
    df2_used: float
    p_used: float

    @property
    def name(self) -> str:
        """The term as text, 'A:B'."""
        return ":".join(self.term)

    def sentence(self) -> str:
        """Return the effect as an APA sentence."""
        label = " × ".join(self.term)
        text = f"{label}: {f_text(self.F, self.df1_used, self.df2_used)}, {p_text(self.p_used)}, "
        correction_text = "" if self.correction == "none" else f" ({self.correction}-corrected df)"
        return f"{text}{self.eta}{correction_text}"

    def row(self) -> Row:
        """Return the effect as one flat table row."""
        s = self.sphericity
        return {
            "term": self.name,
            "F": self.F,
            "df1": self.df1,
            "df2": self.df2,
            "p": self.p,
            "ss": self.ss,
            "ss_error": self.ss_error,
            "error_term": self.error_term,
            **self.eta.row(),
            "ges": self.ges,
            "mauchly_W": None if s is None else s.W,
            "mauchly_p": None if s is None else s.p,
            "gg_epsilon": None if s is None else s.gg,
            "p_gg": None if s is None else s.p_gg,
            "hf_epsilon": None if s is None else s.hf_used,
            "p_hf": None if s is None else s.p_hf,
            "sphericity_correction": self.correction,
            "p_used": self.p_used,
        }


@dataclass(frozen=True)
class Anova(EffectTable[AnovaEffect]):
    """An ANOVA table with its design and provenance.

    `model` is the mixed model behind it; None where the cells of the design are the model.
    """

    subject: str = "subject"
    model: FittedMixedModel | None = None


def rm_anova(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: Sequence[str],
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Literal["error", "listwise"] = "error",
    correction: Correction = "mauchly",
    covariates: Sequence[str] = (),
) -> Anova:
    """Test all effects of a design with within factors, type III, each against its own error.

    `covariates` are numbers of people that are held constant (ANCOVA), centred at their means; each
    is tested, too, and so is whether effects within people change with it.

    `correction` decides what is reported: "mauchly" applies Greenhouse-Geisser where Mauchly's
    p < .05, "gg" and "hf" always, "none" never. For missing cells without dropping subjects use
    `mixed_anova`. Raises a `StatisticsError` naming the row or cell.
    """
    design = read_design(
        frame,
        dv,
        subject=subject,
        within=within,
        between=between,
        levels=levels,
        missing=_no_mixed(missing),
    )
    design = with_covariates(design, frame, covariates)
    return anova_of_design(design, subject=subject, correction=correction)


def between_anova(
    frame: Frame,
    dv: str,
    *,
    between: Sequence[str],
    subject: str | None = None,
    levels: Levels | None = None,
    missing: Literal["error", "listwise"] = "error",
    ss_type: Literal[2, 3] = 3,
    covariates: Sequence[str] = (),
) -> Anova:
    """Test all effects of a between-subject factorial design, sums of squares of type II or III.

    `covariates` are numbers that are held constant (ANCOVA, type III), centred at their means.
    """
    design = read_design(
        frame, dv, subject=subject, between=between, levels=levels, missing=_no_mixed(missing)
    )
    design = with_covariates(design, frame, covariates)
    if covariates and ss_type != 3:
        raise UnknownMethod("covariates are held constant by type III sums of squares; leave 2 out")
    table = anova_of_design(design, subject=subject or "row", correction="none")
    if ss_type == 3:
        return table
    return replace(
        table,
        effects=_type_two_effects(design, table.effects),
        provenance=replace(table.provenance, notes=("type II sums of squares",)),
    )


def _type_two_effects(design: Design, effects: tuple[AnovaEffect, ...]) -> tuple[AnovaEffect, ...]:
    """Replace sums of squares by type II: each term after all that do not contain it."""
    names = [f.name for f in design.factors]
    X, place = model_matrix(
        [f.codes for f in design.factors], [f.k for f in design.factors], design.y.size
    )
    tails = tails_of(design.around_cell_means(design.y))
    of_type_two = []
    for effect in effects:
        term = tuple(names.index(n) for n in effect.term)
        others = [t for t in place if not set(term) <= set(t)]
        smaller = np.hstack([X[:, place[t]] for t in others])
        ss = residual_ss(smaller, design.y) - residual_ss(
            np.hstack([smaller, X[:, place[term]]]), design.y
        )
        mse = (effect.ss_error or 0.0) / effect.df2
        F = ss / effect.df1 / mse
        p = float(special.fdtrc(effect.df1, effect.df2, F))
        eta = partial_eta_squared(F, effect.df1, effect.df2, cases=design.y.size, tails=tails)
        of_type_two.append(replace(effect, F=F, p=p, p_used=p, ss=ss, eta=eta, ges=None))
    return tuple(of_type_two)


def anova_of_design(design: Design, *, subject: str, correction: Correction = "mauchly") -> Anova:
    """Test all effects of a design already read and complete."""
    if correction not in get_args(Correction):
        raise UnknownMethod(
            f"no correction {correction!r}; use one of {', '.join(get_args(Correction))}"
        )
    strata = Strata(design, subject)
    table = design.table(design.y)
    tests = [strata.test(table, term) for term in _terms(design)]
    errors = {s.error_term: s.ss_error for s in tests}
    if subject not in errors:
        errors[subject] = float(strata.test(table, ()).ss_error)
    total_error = sum(errors.values())
    effects = tuple(
        effect_of_stratum(s, design, correction, total_error=total_error) for s in tests
    )
    kind = "Repeated-measures ANOVA" if design.within else "Between-subject ANOVA"
    if design.within and design.between:
        kind = "Mixed ANOVA (type III)"
    notes: tuple[str, ...] = ()
    if not design.is_balanced:
        notes = ("groups differ in size; type III tests compare unweighted group means",)
    if design.covariates:
        kind = f"{kind} with {' and '.join(design.covariates)} held constant"
        notes += _unequal_slopes(design, table)
    provenance = Provenance(
        kind,
        design.n,
        error_term="each effect's own subject-by-effect error" if design.within else "residual",
        correction="sphericity: " + CORRECTION_NAME[correction] if design.within else "none",
        dropped=design.dropped,
        notes=notes,
    )
    return Anova(effects, design, provenance, subject)


def _terms(design: Design) -> tuple[tuple[str, ...], ...]:
    """Return the effects tested: of the factors, then of covariates, alone and with conditions."""
    names = [f.name for f in design.within]
    of_conditions = [t for size in range(len(names) + 1) for t in combinations(names, size)]
    return (*design.terms, *((name, *t) for name in design.covariates for t in of_conditions))


def _unequal_slopes(design: Design, table: Array) -> tuple[str, ...]:
    """Note covariates on which people's means depend differently in different groups."""
    groups, sizes = design.group_of_subject, [f.k for f in design.between]
    if not groups:
        return ()
    y = table.reshape(design.n, -1).mean(axis=1)
    X, place = model_matrix(groups, sizes, design.n)
    X = np.column_stack([X, *design.covariates.values()])
    notes = []
    for name, values in design.covariates.items():
        of_groups = X[:, place[()].stop : X.shape[1] - len(design.covariates)] * values[:, None]
        whole = np.hstack([X, of_groups])
        df1, df2 = of_groups.shape[1], design.n - whole.shape[1]
        rest = residual_ss(whole, y)
        if df2 < 1 or rest <= 0:
            continue
        F = (residual_ss(X, y) - rest) / df1 / (rest / df2)
        p = float(special.fdtrc(df1, df2, max(F, 0.0)))
        if p < 0.05:
            notes.append(
                f"{design.dv} depends on {name} differently in the groups "
                f"({f_text(F, df1, df2)}, {p_text(p)}): differences of groups are those at its "
                "mean and not elsewhere"
            )
    return tuple(notes)


CORRECTION_NAME = {
    "mauchly": "Greenhouse-Geisser where Mauchly p < .05",
    "gg": "Greenhouse-Geisser",
    "hf": "Huynh-Feldt",
    "none": "none applied",
}


def effect_of_stratum(
    s: Stratum, design: Design, correction: Correction, *, total_error: float | None
) -> AnovaEffect:
    """Turn sums of squares into an `AnovaEffect`; a zero error is a `ConstantResponse`.

    `total_error` is the error of all strata together, for generalised eta squared.
    """
    refuse_zero_error(design.dv, s.term, s.ss, s.ss_error)
    F = (s.ss / s.df1) / (s.ss_error / s.df2)
    p = float(special.fdtrc(s.df1, s.df2, F))
    check = _sphericity_of(s, design, F)
    epsilon, p_used, name = _report(p, check, correction)
    cases = s.df2 * s.errors.shape[0] / (s.errors.shape[0] - s.n_groups)
    tails = tails_of(s.errors, of_differences=any(f.name in s.term for f in design.within))
    return AnovaEffect(
        term=s.term,
        F=F,
        df1=s.df1,
        df2=s.df2,
        p=p,
        ss=s.ss,
        ss_error=s.ss_error,
        error_term=s.error_term,
        eta=partial_eta_squared(
            F, s.df1 * epsilon, s.df2 * epsilon, cases=cases * epsilon, tails=tails
        ),
        ges=None if total_error is None else s.ss / (s.ss + total_error),
        sphericity=check,
        correction=name,
        df1_used=s.df1 * epsilon,
        df2_used=s.df2 * epsilon,
        p_used=p_used,
    )


def p_of_stratum(s: Stratum, design: Design, correction: Correction) -> float:
    """Return the p to report of sums of squares, 1 without effect and 0 without error."""
    if s.ss == 0 or s.ss_error == 0:
        return 1.0 if s.ss == 0 else 0.0
    F = (s.ss / s.df1) / (s.ss_error / s.df2)
    if correction == "mauchly":
        p = float(special.fdtrc(s.df1, s.df2, F))
        return _report(p, _sphericity_of(s, design, F), correction)[1]
    if correction == "none" or not _has_sphericity(s, design):
        return float(special.fdtrc(s.df1, s.df2, F))
    return p_at_epsilon(s.errors, s.errors.shape[0] - s.n_groups, F, s.df1, correction)


def _has_sphericity(s: Stratum, design: Design) -> bool:
    return any(f.name in s.term for f in design.within) and s.errors.shape[1] >= 2


def _sphericity_of(s: Stratum, design: Design, F: float) -> Sphericity | None:
    if not _has_sphericity(s, design):
        return None
    cells = math.prod(f.k for f in design.within)
    return sphericity(s.errors, s.errors.shape[0] - s.n_groups, F, s.df1, n_cells=cells)


def refuse_zero_error(dv: str, term: Sequence[str], ss: float, ss_error: float) -> None:
    """Raise `ConstantResponse` where the error of a term is zero and F has no value."""
    if ss_error <= 1e-18 * ss:
        raise ConstantResponse(
            f"all subjects show exactly the same effect of {':'.join(term)} on {dv}, so its error "
            "is zero and F is not defined; tests of ranks need none (friedman, of two levels "
            "wilcoxon, of groups kruskal), but look for copied or constructed rows first"
        )


def _report(p: float, s: Sphericity | None, correction: Correction) -> tuple[float, float, str]:
    if s is None or correction == "none":
        return 1.0, p, "none"
    if correction == "hf":
        return s.hf_used, s.p_hf, "Huynh-Feldt"
    if correction == "gg" or s.p is None or s.p < 0.05:
        return s.gg, s.p_gg, "Greenhouse-Geisser"
    return 1.0, p, "none"


def _no_mixed(missing: Missing) -> Missing:
    if missing == "mixed":
        raise UnknownMethod("an ANOVA needs complete cells; use mixed_anova")
    return missing
