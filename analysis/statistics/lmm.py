"""Linear mixed models of single trials or cells: random slopes by statsmodels, KR F tests."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from visavis.analysis.statistics.anova import Anova
from visavis.analysis.statistics.contrasts import ContrastAdjustment, Contrasts
from visavis.analysis.statistics.design import Codes, Design, Frame, Levels, Missing, read_design
from visavis.analysis.statistics.effects import tails_of
from visavis.analysis.statistics.errors import NotConverged, UnknownColumn
from visavis.analysis.statistics.linear import model_matrix
from visavis.analysis.statistics.marginal import posthoc
from visavis.analysis.statistics.mixed import contrast_effect, design_matrix, slopes_text
from visavis.analysis.statistics.random_effects import (
    Derivatives,
    LinearMixedModel,
    fit_components,
    model_at,
    slope_terms,
)
from visavis.analysis.statistics.results import Array, Provenance, number

RandomEffects: TypeAlias = Literal["maximal", "components"]
"""Intercept and slopes with all their covariances, or one variance per within effect."""

SINGULAR_VARIANCE_RATIO = 1e-4
"""Smallest over largest variance of the random effects below which a fit counts as singular."""
OPTIMISER_GRADIENT = 1e-9


@dataclass(frozen=True)
class LinearMixed(Anova):
    """F tests of a linear mixed model; `steps` list the random effects that were tried."""

    model: LinearMixedModel | None = None
    random: RandomEffects = "maximal"
    steps: tuple[str, ...] = ()

    def contrasts(
        self, term: str | Sequence[str], *, adjust: ContrastAdjustment = "holm"
    ) -> Contrasts:
        """Compare marginal means in units of the response, each with its own Kenward-Roger df.

        The effect size is d with the SD of single responses from all sources.
        """
        return posthoc(self, term, adjust=adjust)


def linear_mixed(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: Sequence[str],
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Missing = "error",
    random: RandomEffects = "maximal",
) -> LinearMixed:
    """Test all effects (type III) of a linear mixed model by REML and Kenward-Roger.

    Rows may be single trials. Per subject a random intercept and random slopes of all within
    effects, with all their covariances ("maximal", Barr et al. 2013, fitted by statsmodels). Where
    those cannot be estimated, are singular or do not converge, one variance per effect instead
    ("components"); `steps` and the provenance say so. Raises a `StatisticsError` naming the row or
    cell, or `NotConverged`.
    """
    if not within:
        raise UnknownColumn("a mixed model needs a within factor; compare groups by an ANOVA")
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
    # First the maximal model; where it cannot be estimated, one variance per effect, which always
    # can, and a note that says so.
    X, place = design_matrix(design)
    steps: list[str] = []
    model = None
    if random == "maximal":
        model, reason = _maximal(design, X)
        steps.append(f"Random slopes with all covariances: {reason}")
    if model is None:
        model = fit_components(design, X, design.y)
        variances = ", ".join(f"{k} {number(v, 3)}" for k, v in model.parameters.items())
        steps.append(f"One variance per effect: {variances}")
    structure: RandomEffects = (
        "maximal" if random == "maximal" and len(steps) == 1 else "components"
    )
    text = _random_text(design, subject, structure)
    tails = tails_of(design.around_cell_means(design.y), people=design.n)
    effects = tuple(
        contrast_effect(model, term, np.eye(X.shape[1])[columns], text, tails=tails)
        for term, columns in place.items()
        if term
    )
    notes = [f"{design.y.size} rows of {design.n} subjects"] if design.is_repeated else []
    if structure != random:
        notes.append(f"random effects simplified: {steps[0]}; the model has {text}")
    if structure == "components":
        notes += model.negative_variance_notes(subject)
    provenance = Provenance(
        "Linear mixed model",
        design.n,
        error_term=f"{text}, REML, Kenward-Roger df",
        dropped=design.dropped,
        notes=tuple(notes),
    )
    return LinearMixed(
        effects, design, provenance, subject, model=model, random=structure, steps=tuple(steps)
    )


def _random_text(design: Design, subject: str, random: RandomEffects) -> str:
    if random == "components":
        return f"{slopes_text(design)} per {subject}, one variance each"
    slope_names = " and ".join(" × ".join(t) for t in slope_terms(design))
    return f"random intercept and slopes of {slope_names} per {subject}, correlated"


def _maximal(design: Design, X: Array) -> tuple[LinearMixedModel | None, str]:
    """Return the model with all covariances of intercept and slopes, or None and the reason."""
    Z, names = _random_columns(design)
    q = Z.shape[1]
    if q == 1:
        return None, "one row per subject and cell, so the slope of the only factor is the residual"
    if design.y.size <= design.n * q:
        return None, f"{design.y.size} rows do not determine {design.n} × {q} random effects"
    if design.n - design.group_sizes.size < q:
        return None, f"{design.n} subjects do not determine the covariances of {q} effects"
    from statsmodels.regression.mixed_linear_model import MixedLM  # late: a second to import

    unit = float(design.y.std())
    y = (design.y - design.y.mean()) / unit
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the fit itself is checked below
        try:
            fit = MixedLM(y, X, design.subject, exog_re=Z).fit(
                reml=True, method=["bfgs", "lbfgs"], gtol=OPTIMISER_GRADIENT
            )
        except (np.linalg.LinAlgError, ValueError) as error:
            return None, f"not fitted ({error})"
    G = np.asarray(fit.cov_re, dtype=np.float64)
    if not np.isfinite(G).all():
        return None, "did not converge"
    variances = np.linalg.eigvalsh(G)
    if variances[0] < SINGULAR_VARIANCE_RATIO * variances[-1]:
        return None, "singular, the data do not tell these effects apart"
    if not fit.converged:
        return None, "did not converge"
    pairs = [(i, j) for i in range(q) for j in range(i + 1)]
    theta = np.array([*(G[i, j] for i, j in pairs), float(fit.scale)]) * unit**2
    labels = [names[i] if i == j else f"{names[i]} with {names[j]}" for i, j in pairs]
    derivatives = _covariance_derivatives(Z, pairs)
    try:
        model = model_at(X, design.y, design.subject, derivatives, (*labels, "residual"), theta)
    except NotConverged:
        return None, "its covariance is not positive definite"
    return model, f"kept, residual variance {number(float(theta[-1]), 3)}"


def _random_columns(design: Design) -> tuple[Array, list[str]]:
    """Return intercept and sum-coded slopes of the random part, (rows, q), with their names."""
    within = design.within
    model_columns, place = model_matrix(
        [f.codes for f in within], [f.k for f in within], design.y.size
    )
    columns, names = [model_columns[:, place[()]]], ["intercept"]
    for term in slope_terms(design):
        at = place[tuple(i for i, f in enumerate(within) if f.name in term)]
        columns.append(model_columns[:, at])
        count = at.stop - at.start
        label = ":".join(term)
        names += [label] if count == 1 else [f"{label}[{i + 1}]" for i in range(count)]
    return np.hstack(columns), names


def _covariance_derivatives(Z: Array, pairs: Sequence[tuple[int, int]]) -> Derivatives:
    def derivatives(rows: Codes) -> Array:
        z = Z[rows]
        return np.stack(
            [
                *(
                    np.outer(z[:, i], z[:, j]) + (np.outer(z[:, j], z[:, i]) if i != j else 0.0)
                    for i, j in pairs
                ),
                np.eye(rows.size),
            ]
        )

    return derivatives
