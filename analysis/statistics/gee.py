"""Estimating equations for choices, counts and scores of the same people, by statsmodels."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy import special

from visavis.analysis.statistics.contrasts import ContrastAdjustment, Contrasts, pairs_text
from visavis.analysis.statistics.design import Design, Frame, Levels, Missing, read_design
from visavis.analysis.statistics.effect_table import EffectTable
from visavis.analysis.statistics.effects import tails_of
from visavis.analysis.statistics.errors import (
    RANKS_NEED_NO_ERROR,
    ConstantResponse,
    NotConverged,
    NotNumeric,
    TooFewSubjects,
    UnknownColumn,
    UnknownMethod,
)
from visavis.analysis.statistics.linear import FittedModel
from visavis.analysis.statistics.marginal import FixedEffects, estimate_effect, posthoc
from visavis.analysis.statistics.mixed import design_matrix
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Provenance,
    Result,
    Row,
    f_text,
    number,
    p_text,
)

Family: TypeAlias = Literal["gaussian", "binomial", "poisson"]
LINK = {"gaussian": "identity", "binomial": "logit", "poisson": "log"}
RATIO = {"gaussian": "", "binomial": "odds ratio", "poisson": "rate ratio"}
"""Name of the exponential of a contrast; empty where contrasts are not on a log scale."""

MAX_ITERATIONS = 200
PARAMETER_TOLERANCE = 1e-10
NO_ERROR = 1e-12
"""Variance of a difference, as a share of the largest of a coefficient, that is float noise."""


@dataclass(frozen=True)
class GeeModel:
    """Fitted estimating equations.

    `covariance` (p, p) is Mancl and DeRouen's (2001), `robust` the uncorrected sandwich;
    `correlation` that of any two rows of a subject; `df` subjects − groups; `sd` that of scores
    about their fitted means (0 in the other families).
    """

    beta: Array
    covariance: Array
    robust: Array
    correlation: float
    df: int
    sd: float

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of Lβ = 0 (q, p): Hotelling's T² of the subjects' scores.

        F = W (df − q + 1) / (df q) with df − q + 1 denominator df, W the Wald statistic. For one
        row it is t² with `df`.
        """
        return hotelling(L, self.beta, self.covariance, self.df)


def hotelling(L: Array, beta: Array, covariance: Array, df: int) -> tuple[float, float]:
    """Return F and denominator df of Lβ = 0 from a covariance estimated with `df` subjects.

    Raises:
        TooFewSubjects: as many coefficients as subjects.
        ConstantResponse: a difference that is tested has no error.
    """
    q = L.shape[0]
    df2 = df - q + 1
    if df2 < 1:
        raise TooFewSubjects(
            f"a test of {q} coefficients needs more than {q} subjects beyond the groups"
        )
    estimate = L @ beta
    contrast_covariance = L @ covariance @ L.T
    if np.linalg.eigvalsh(contrast_covariance)[0] <= NO_ERROR * float(np.diag(covariance).max()):
        raise ConstantResponse(
            "responses differ between some conditions by the same amount in all subjects, so F has "
            f"no error and is not defined; {RANKS_NEED_NO_ERROR}"
        )
    wald = float(estimate @ np.linalg.solve(contrast_covariance, estimate))
    return wald * df2 / (df * q), float(df2)


@dataclass(frozen=True)
class GeeEffect(Result):
    """The test of one term.

    With one df it has an effect size, of the difference that `comparison` names ("left − right";
    of differences of differences for an interaction). Several df together have none.
    """

    term: tuple[str, ...]
    F: float
    df1: int
    df2: float
    p: float
    effect: Effect | None
    comparison: str

    @property
    def name(self) -> str:
        """The term as text, 'A:B'."""
        return ":".join(self.term)

    @property
    def p_used(self) -> float:
        """The p to report."""
        return self.p

    def sentence(self) -> str:
        """Return the effect as an APA sentence."""
        size = f"no effect size for {self.df1} df together"
        if self.effect is not None:
            size = f"{self.effect} ({self.comparison})"
        test = f"{f_text(self.F, self.df1, self.df2)}, {p_text(self.p)}"
        return f"{' × '.join(self.term)}: {test}, {size}"

    def row(self) -> Row:
        """Return the effect as one flat table row."""
        return {
            "term": self.name,
            "F": self.F,
            "df1": self.df1,
            "df2": self.df2,
            "p": self.p,
            "p_used": self.p,
            "contrast": self.comparison or None,
            **({"effect_size": None} if self.effect is None else self.effect.row()),
        }


@dataclass(frozen=True)
class Gee(EffectTable[GeeEffect]):
    """Tests of all terms of estimating equations, with model, design and provenance."""

    model: GeeModel
    family: Family

    @property
    def cell_model(self) -> FixedEffects:
        """The model on the scale of its link."""
        return FixedEffects(
            self.design,
            self.model,
            scale=LINK[self.family],
            ratio=RATIO[self.family],
            sd=self.model.sd,
        )

    def contrasts(
        self, term: str | Sequence[str], *, adjust: ContrastAdjustment = "holm"
    ) -> Contrasts:
        """Compare marginal means on the scale of the link; the effect is a ratio, or d."""
        return posthoc(self, term, adjust=adjust)


def gee(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Missing = "error",
    family: Family = "gaussian",
) -> Gee:
    """Test all effects of a marginal model of single trials, exchangeable within subjects.

    `family`: "binomial" for choices (0 or 1), "poisson" for counts, "gaussian" for scores. Errors
    are robust, corrected for few subjects (Mancl and DeRouen 2001), and terms are tested by F
    with subjects − groups − q + 1 df. Raises a `StatisticsError` naming the row or cell.
    """
    if family not in get_args(Family):
        raise UnknownMethod(f"no family {family!r}; use one of {', '.join(get_args(Family))}")
    if not subject:
        raise UnknownColumn("estimating equations need the column that names the subject")
    design = read_design(
        frame,
        dv,
        subject=subject,
        within=within,
        between=between,
        levels=levels,
        missing=missing,
        allow_repeats=True,
    )
    _refuse_responses(design, family)
    X, place = design_matrix(design)
    if family == "gaussian":
        _refuse_no_error(design, X)
    model = _fit(design, X, family)
    effects = []
    for term, columns in place.items():
        if not term:
            continue
        L = np.eye(X.shape[1])[columns]
        F, df = model.test(L)
        p = float(special.fdtrc(L.shape[0], df, F))
        size = term_effect(design, model, term, L, df, ratio=RATIO[family], sd=model.sd)
        effects.append(GeeEffect(term, F, L.shape[0], df, p, *size))
    notes = [f"{design.y.size} rows of {design.n} subjects"] if design.is_repeated else []
    notes.append(f"working correlation of two rows of a subject {number(model.correlation)}")
    provenance = Provenance(
        f"Generalized estimating equations ({family}, {LINK[family]} link)",
        design.n,
        error_term=f"exchangeable within {subject}, robust errors after Mancl and DeRouen",
        dropped=design.dropped,
        notes=tuple(notes),
    )
    return Gee(tuple(effects), design, provenance, model, family)


def term_effect(
    design: Design,
    model: FittedModel,
    term: tuple[str, ...],
    L: Array,
    df: float,
    *,
    ratio: str = "",
    sd: float = 0.0,
) -> tuple[Effect | None, str]:
    """Return the effect size of a term of one df and what it compares; None and "" with more.

    In sum coding a difference of two levels is twice the coefficient, one of differences four
    times. `ratio` and `sd` are those of `estimate_effect`.
    """
    if L.shape[0] > 1:
        return None, ""
    estimate = 2 ** len(term) * float(L[0] @ model.beta)
    se = 2 ** len(term) * float(np.sqrt(L[0] @ model.covariance @ L[0]))
    pairs = [(str(a), str(b)) for a, b in (design.factor(name).levels for name in term)]
    of = f"ratio of {'ratios of ' * (len(term) - 2)}{ratio}s" if len(term) > 1 else ratio
    tails = tails_of(design.around_cell_means(design.y), people=design.n)
    effect = estimate_effect(estimate, se, df, ratio=ratio and of, sd=sd, tails=tails)
    return effect, pairs_text(pairs)


def _refuse_responses(design: Design, family: Family) -> None:
    """Refuse what a family cannot hold, and cells without which its link has no finite value."""
    y = design.y
    wrong = np.zeros(y.size, dtype=bool)
    if family == "binomial":
        wrong = (y != 0) & (y != 1)
    elif family == "poisson":
        wrong = (y < 0) | (y != np.round(y))
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        of = "0 or 1" if family == "binomial" else "a count, 0, 1, 2, …"
        raise NotNumeric(
            f"{design.dv} is {y[row]:g} in row {int(design.rows[row]) + 1}; "
            f"the {family} family needs {of}"
        )
    if family == "gaussian":
        return
    for cell in np.unique(design.cells):
        values = y[design.cells == cell]
        if (values == 0).all() or (family == "binomial" and (values == 1).all()):
            where = design.cell_text(cell)
            raise ConstantResponse(
                f"{design.dv} is {values[0]:g} in all {values.size} rows of {where}, so its "
                f"{LINK[family]} is infinite and the model cannot be estimated; leave the "
                "condition out, or compare subject means"
            )


def _refuse_no_error(design: Design, X: Array) -> None:
    """Refuse scores of which people's levels and the effects leave nothing over."""
    people = np.eye(design.n)[design.subject]
    every = np.hstack([X, people])
    left = design.y - every @ np.linalg.lstsq(every, design.y, rcond=None)[0]
    if float(left @ left) <= 1e-20 * float(design.y @ design.y):
        raise ConstantResponse(
            f"{design.dv} does not vary within subjects beyond the effects, so F is not defined; "
            f"{RANKS_NEED_NO_ERROR}"
        )


def _fit(design: Design, X: Array, family: Family) -> GeeModel:
    import statsmodels.api as sm  # late: a second that other tests need not pay

    families = {
        "gaussian": sm.families.Gaussian,
        "binomial": sm.families.Binomial,
        "poisson": sm.families.Poisson,
    }
    unit = float(design.y.std()) if family == "gaussian" else 1.0
    order = np.argsort(design.subject, kind="stable")
    model = sm.GEE(
        design.y[order] / unit,
        X[order],
        groups=design.subject[order],
        family=families[family](),
        cov_struct=sm.cov_struct.Exchangeable(),
    )
    with warnings.catch_warnings(record=True) as caught_warnings:
        warnings.simplefilter("always")
        fit = model.fit(
            cov_type="bias_reduced", ctol=PARAMETER_TOLERANCE, maxiter=MAX_ITERATIONS, ddof_scale=0
        )
    beta = np.asarray(fit.params, dtype=np.float64) * unit
    covariance = np.asarray(fit.cov_params(), dtype=np.float64) * unit**2
    convergence_warnings = [str(w.message) for w in caught_warnings if "onverge" in str(w.message)]
    if convergence_warnings or not (np.isfinite(beta).all() and np.isfinite(covariance).all()):
        raise NotConverged(
            f"the estimating equations of {design.dv} did not converge; "
            "take fewer factors, or compare subject means"
        )
    away = design.y - X @ beta if family == "gaussian" else np.zeros(0)
    sd = float(np.sqrt(away @ away / max(1, away.size - beta.size)))
    return GeeModel(
        beta,
        covariance,
        np.asarray(fit.cov_robust, dtype=np.float64) * unit**2,
        float(fit.cov_struct.dep_params),
        design.n - design.group_sizes.size,
        sd,
    )
