"""Cumulative link mixed models of ratings: categories in an order, no distances between them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from analysis.statistics.contrasts import ContrastAdjustment, Contrasts
from analysis.statistics.cumulative_link import CumulativeFit, fit_cumulative, log_likelihood
from analysis.statistics.design import Design, Frame, Levels, Missing, read_design
from analysis.statistics.effect_table import EffectTable
from analysis.statistics.errors import (
    ConstantResponse,
    NotConverged,
    NotNumeric,
    TooFewSubjects,
    UnknownColumn,
)
from analysis.statistics.gee import GeeEffect, hotelling, term_effect
from analysis.statistics.marginal import marginal_contrasts
from analysis.statistics.mixed import design_matrix
from analysis.statistics.results import Array, Provenance, Row, number, p_text

MAX_CATEGORIES = 30
"""Different answers from which a response is taken for a measure, not for a rating."""
MIN_ANSWERS = 3
"""Answers in a category below which its thresholds rest on next to nothing."""


@dataclass(frozen=True)
class ClmmModel:
    """Fitted log odds of a higher answer: `beta` (p,), the first 0 for the thresholds' place.

    `covariance` is the robust one of subjects' scores, times n/(n − groups); `likelihood` that of
    the observed information; `df` subjects − groups.
    """

    beta: Array
    covariance: Array
    likelihood: Array
    df: int

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of Lβ = 0 (q, p), Hotelling's T² of the subjects' scores."""
        return hotelling(L, self.beta, self.covariance, self.df)


@dataclass(frozen=True)
class ClmmEffect(GeeEffect):
    """The test of one term, beside the likelihood ratio, in which people's effects are alike."""

    chi2: float
    chi2_p: float

    def sentence(self) -> str:
        """Return the effect as an APA sentence."""
        ratio = f"χ²({self.df1}) = {number(self.chi2)}, {p_text(self.chi2_p)}"
        return f"{super().sentence()}; likelihood ratio {ratio}"

    def row(self) -> Row:
        """Return the effect as one flat table row."""
        return {**super().row(), "chi2": self.chi2, "df": self.df1, "chi2_p": self.chi2_p}


@dataclass(frozen=True)
class Clmm(EffectTable[ClmmEffect]):
    """Tests of all terms of a cumulative link mixed model, with fit, design and provenance."""

    model: ClmmModel
    fit: CumulativeFit
    categories: tuple[float, ...]

    def contrasts(
        self, term: str | Sequence[str], *, adjust: ContrastAdjustment = "holm"
    ) -> Contrasts:
        """Compare log odds of a higher answer; the effect is the cumulative odds ratio."""
        return marginal_contrasts(
            self.design,
            self.model,
            term,
            adjust=adjust,
            ratio="odds ratio",
            provenance=replace(self.provenance, test="marginal means (logit scale)", notes=()),
        )


def clmm(
    frame: Frame,
    dv: str,
    *,
    subject: str = "",
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Missing = "error",
) -> Clmm:
    """Test all effects of a cumulative link mixed model (logit) of single ratings.

    Where people give several answers each has a normal random intercept, integrated by adaptive
    quadrature as in R's `ordinal::clmm`; else there is none (`clm`). Terms are tested by
    Hotelling's T² with robust errors of subjects, which holds its level where people differ in the
    effect; the likelihood ratio beside it does not. Raises a `StatisticsError` naming the row or
    cell, or `NotConverged`.
    """
    if not within and not between:
        raise UnknownColumn("a cumulative link model needs a within or a between factor")
    if within and not subject:
        raise UnknownColumn("within factors need the column that names the subject")
    design = read_design(
        frame,
        dv,
        subject=subject or None,
        within=within,
        between=between,
        levels=levels,
        missing=missing,
        repeated=bool(subject),
    )
    categories, category = np.unique(design.y, return_inverse=True)
    _refuse_answers(design, categories)
    X, place = design_matrix(design)
    groups = design.group_sizes.size
    if design.n <= groups:
        raise TooFewSubjects("a group needs more than one subject")
    has_intercept = bool(design.y.size > design.n)
    try:
        fit = fit_cumulative(category, X[:, 1:], design.subject, has_intercept=has_intercept)
    except NotConverged as error:
        raise NotConverged(f"{dv}: {error}; take fewer factors, or join categories") from error
    model = _model(fit, design.n, groups)
    effects = []
    for term, columns in place.items():
        if not term:
            continue
        L = np.eye(X.shape[1])[columns]
        F, df = model.test(L)
        q = L.shape[0]
        fewer = np.delete(X, [0, *range(X.shape[1])[columns]], axis=1)
        without = log_likelihood(category, fewer, design.subject, has_intercept=has_intercept)
        chi2 = max(0.0, 2 * (fit.log_likelihood - without))
        p, chi2_p = float(special.fdtrc(q, df, F)), float(special.chdtrc(q, chi2))
        size = term_effect(design, model, term, L, df, ratio="odds ratio")
        effects.append(ClmmEffect(term, F, q, df, p, *size, chi2, chi2_p))
    notes = [f"{design.y.size} rows of {design.n} subjects"] if design.is_repeated else []
    notes.append(f"{categories.size} categories of {dv}, {_shown(categories)}")
    if has_intercept:
        notes.append(f"SD of people's thresholds {number(fit.sigma)} (logit scale)")
    rare = categories[np.bincount(category) < MIN_ANSWERS]
    if rare.size:
        notes.append(
            f"fewer than {MIN_ANSWERS} answers of {_shown(rare)}; the thresholds beside are guesses"
        )
    name = "Cumulative link mixed model" if has_intercept else "Cumulative link model"
    provenance = Provenance(
        f"{name} (logit)",
        design.n,
        error_term=f"{f'random intercept per {subject}, ' if has_intercept else ''}robust errors",
        dropped=design.dropped,
        notes=tuple(notes),
    )
    answers = tuple(float(c) for c in categories)
    return Clmm(tuple(effects), design, provenance, model, fit, answers)


def _model(fit: CumulativeFit, n: int, groups: int) -> ClmmModel:
    """Return the model with a column for the intercept, whose place the thresholds take."""
    p = fit.beta.size + 1
    robust, likelihood = np.zeros((p, p)), np.zeros((p, p))
    likelihood[1:, 1:] = fit.covariance
    meat = fit.scores.T @ fit.scores * n / (n - groups)
    robust[1:, 1:] = fit.covariance @ meat @ fit.covariance
    return ClmmModel(np.concatenate([[0.0], fit.beta]), robust, likelihood, n - groups)


def _shown(categories: Array) -> str:
    return ", ".join(f"{c:g}" for c in categories)


def _refuse_answers(design: Design, categories: Array) -> None:
    """Refuse measures, and cells in which all gave the highest or the lowest answer."""
    if categories.size < 2:
        raise ConstantResponse(f"all answers of {design.dv} are {categories[0]:g}")
    if categories.size > MAX_CATEGORIES:
        raise NotNumeric(
            f"{design.dv} takes {categories.size} values, more than a rating has "
            f"({MAX_CATEGORIES}); take the test lmm for a measure"
        )
    shape = tuple(f.k for f in design.factors)
    cells = np.ravel_multi_index(tuple(f.codes for f in design.factors), shape)
    for cell in np.unique(cells):
        values = np.unique(design.y[cells == cell])
        if values.size == 1 and values[0] in (categories[0], categories[-1]):
            places = np.unravel_index(cell, shape)
            where = ", ".join(
                f"{f.name} {f.levels[int(i)]}" for f, i in zip(design.factors, places, strict=True)
            )
            raise ConstantResponse(
                f"{design.dv} is {values[0]:g} in all rows of {where}, the end of the scale, so "
                "its log odds are infinite; leave the condition out, or compare subject means"
            )
