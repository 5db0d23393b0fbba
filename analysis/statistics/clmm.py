"""Cumulative link mixed models of ratings: categories in an order, no distances between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import special

from visavis.analysis.statistics.answer_likelihood import MAX_QUADRATURE
from visavis.analysis.statistics.contrasts import ContrastAdjustment, Contrasts
from visavis.analysis.statistics.cumulative_link import (
    CumulativeFit,
    fit_cumulative,
    log_likelihood,
)
from visavis.analysis.statistics.design import Design, Frame, Levels, Missing, read_design
from visavis.analysis.statistics.effect_table import EffectTable
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    NotConverged,
    NotNumeric,
    TooFewSubjects,
    UnknownColumn,
    UnknownMethod,
    option_text,
)
from visavis.analysis.statistics.gee import GeeEffect, hotelling, term_effect
from visavis.analysis.statistics.linear import sum_coding
from visavis.analysis.statistics.marginal import FixedEffects, posthoc
from visavis.analysis.statistics.mixed import design_matrix
from visavis.analysis.statistics.random_effects import slope_terms
from visavis.analysis.statistics.results import Array, Provenance, Row, number, p_text

MAX_CATEGORIES = 30
"""A response with more different answers than this is a measure, not a rating."""
MIN_ANSWERS = 3
"""With fewer answers than this in a category, its thresholds are hardly determined."""

Terms: TypeAlias = Sequence[tuple[str, ...]]


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
    """The test of one term, with its likelihood ratio.

    The ratio assumes that people differ only in the effects that vary in the model.
    """

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

    @property
    def cell_model(self) -> FixedEffects:
        """The model of the log odds of a higher answer."""
        return FixedEffects(self.design, self.model, scale="logit", ratio="odds ratio")

    def contrasts(
        self, term: str | Sequence[str], *, adjust: ContrastAdjustment = "holm"
    ) -> Contrasts:
        """Compare log odds of a higher answer; the effect is the cumulative odds ratio."""
        return posthoc(self, term, adjust=adjust)


def clmm(
    frame: Frame,
    dv: str,
    *,
    subject: str = "",
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Missing = "error",
    random: str = "intercept",
    nodes: int = 0,
) -> Clmm:
    """Test all effects of a cumulative link mixed model (logit) of single ratings.

    Where people give several answers each has a normal random intercept, integrated by adaptive
    quadrature as in R's `ordinal::clmm`; else there is none (`clm`). `random` names the within
    effects in which people differ too ("method", "method+gesture", "method:gesture"), with all
    their covariances and the intercept's; "maximal" are all of them. Several random effects are
    integrated by Laplace's approximation, as R does; `nodes` asks for quadrature with so many to
    each, of three at most.

    Terms are tested by Hotelling's T² with robust errors of subjects, which holds its level where
    people differ in the effect; the likelihood ratio reported with it does so only where that
    effect varies in the model. Raises a `StatisticsError` naming the row or cell, or
    `NotConverged`.
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
        allow_repeats=bool(subject),
    )
    # Categories are the answers that occur, in order; thresholds lie between neighbours.
    categories, category = np.unique(design.y, return_inverse=True)
    _refuse_answers(design, categories)
    # Thresholds take the place of the intercept, so its column is left out of the fit.
    X, place = design_matrix(design)
    groups = design.group_sizes.size
    if design.n <= groups:
        raise TooFewSubjects("a group needs more than one subject")
    slopes = _slopes(design, random)
    Z = _random_columns(design, X, place, slopes)
    if Z.shape[1] > 1 and nodes > 1 and Z.shape[1] > MAX_QUADRATURE:
        raise UnknownMethod(
            f"quadrature over {Z.shape[1]} random effects per {subject} takes too long; leave "
            f"nodes out (Laplace), or name fewer slopes ({MAX_QUADRATURE} effects at most)"
        )
    try:
        fit = fit_cumulative(category, X[:, 1:], design.subject, Z, nodes=nodes)
    except NotConverged as error:
        fewer = "fewer factors"
        if slopes:
            fewer = option_text("random", "intercept") + ", fewer factors"
        raise NotConverged(f"{dv}: {error}; take {fewer}, or join categories") from error
    model = _model(fit, design.n, groups)
    # Two tests per term: Hotelling's T² with robust errors, and the likelihood ratio of the model
    # without the term's columns.
    effects = []
    for term, columns in place.items():
        if not term:
            continue
        L = np.eye(X.shape[1])[columns]
        F, df = model.test(L)
        q = L.shape[0]
        fewer_X = np.delete(X, [0, *range(X.shape[1])[columns]], axis=1)
        without = log_likelihood(category, fewer_X, design.subject, Z, nodes=nodes)
        chi2 = max(0.0, 2 * (fit.log_likelihood - without))
        p, chi2_p = float(special.fdtrc(q, df, F)), float(special.chdtrc(q, chi2))
        size = term_effect(design, model, term, L, df, ratio="odds ratio")
        effects.append(ClmmEffect(term, F, q, df, p, *size, chi2, chi2_p))
    notes = [f"{design.y.size} rows of {design.n} subjects"] if design.is_repeated else []
    notes.append(f"{categories.size} categories of {dv}, {_category_list(categories)}")
    if Z.size:
        notes.append(f"SD of people's thresholds {number(fit.sigma)} (logit scale)")
    notes += _people_differ(design, slopes, fit)
    # Thresholds next to a rare answer are hardly determined; say so.
    rare = categories[np.bincount(category) < MIN_ANSWERS]
    if rare.size:
        notes.append(
            f"fewer than {MIN_ANSWERS} answers of {_category_list(rare)}; "
            "the thresholds beside are guesses"
        )
    name = "Cumulative link mixed model" if Z.size else "Cumulative link model"
    provenance = Provenance(
        f"{name} (logit)",
        design.n,
        error_term=f"{_random_text(slopes, subject) if Z.size else ''}robust errors",
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
    robust[1:, 1:] = fit.robust * n / (n - groups)
    return ClmmModel(np.concatenate([[0.0], fit.beta]), robust, likelihood, n - groups)


def _slopes(design: Design, random: str) -> tuple[tuple[str, ...], ...]:
    """Return the within effects in which people differ, as a text names them."""
    if random == "intercept":
        return ()
    possible = slope_terms(design)
    if random == "maximal":
        terms = possible
    else:
        requested_terms = {design.term(name.strip()) for name in random.split("+")}
        terms = tuple(term for term in design.terms if term in requested_terms)
    within = {f.name for f in design.within}
    for term in terms:
        if not within.issuperset(term):
            raise UnknownMethod(
                f"random is {random!r}, but a {':'.join(term)} slope of one person there cannot "
                f"be: only within factors vary in people ({', '.join(sorted(within)) or 'none'})"
            )
    q = 1 + sum(int(np.prod([design.factor(name).k - 1 for name in term])) for term in terms)
    if not terms or design.y.size <= design.n * q:
        raise TooFewSubjects(
            f"{design.y.size} rows do not determine {design.n} × {q} random effects; name fewer "
            f"slopes, or take {option_text('random', 'intercept')}"
        )
    return terms


def _random_columns(
    design: Design, X: Array, place: Mapping[tuple[str, ...], slice], slopes: Terms
) -> Array:
    """Return the columns of intercept and slopes; none where everybody answered once."""
    if design.y.size == design.n:
        return np.zeros((design.y.size, 0))
    return np.hstack([X[:, :1], *(X[:, place[term]] for term in slopes)])


def _random_text(slopes: Terms, subject: str) -> str:
    if not slopes:
        return f"random intercept per {subject}, "
    slope_names = " and ".join(" × ".join(term) for term in slopes)
    return f"random intercept and slopes of {slope_names} per {subject}, correlated, "


def _people_differ(design: Design, slopes: Terms, fit: CumulativeFit) -> list[str]:
    """Say how far people differ in every effect that varies, level by level."""
    lines, first = [], 1
    for term in slopes:
        codes: Array = np.ones((1, 1))
        levels = [""]
        for factor in (design.factor(name) for name in term):
            codes = np.kron(codes, sum_coding(factor.k)).astype(np.float64)
            levels = [f"{a},{b}".strip(",") for a in levels for b in factor.levels]
        at = slice(first, first + codes.shape[1])
        first += codes.shape[1]
        sds = np.sqrt(np.einsum("ij,jk,ik->i", codes, fit.spread[at, at], codes))
        each = "; ".join(f"{v} {number(float(sd))}" for v, sd in zip(levels, sds, strict=True))
        lines.append(f"SD between people of the effect of {' × '.join(term)}: {each} (logit scale)")
    if slopes and fit.is_singular:
        lines.append(
            "people's effects are singular: the ratings do not tell them all apart; name "
            "fewer of them"
        )
    return lines


def _category_list(categories: Array) -> str:
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
    for cell in np.unique(design.cells):
        values = np.unique(design.y[design.cells == cell])
        if values.size == 1 and values[0] in (categories[0], categories[-1]):
            where = design.cell_text(cell)
            raise ConstantResponse(
                f"{design.dv} is {values[0]:g} in all rows of {where}, the end of the scale, so "
                "its log odds are infinite; leave the condition out, or compare subject means"
            )
