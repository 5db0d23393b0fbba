"""Compare the marginal means of a fitted model: cells of some factors, the others averaged."""

from collections.abc import Sequence
from itertools import product
from typing import Protocol

import numpy as np
from scipy import special

from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    contrast_family,
    pair_labels,
    pair_matrix,
)
from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.effects import standardised_mean
from visavis.analysis.statistics.mixed import level_rows
from visavis.analysis.statistics.results import Array, Effect, Interval, Provenance


class FittedModel(Protocol):
    """A fitted model with the sum-coded fixed effects of a design, as contrasts need it."""

    @property
    def beta(self) -> Array:
        """Fixed effects, (p,)."""

    @property
    def covariance(self) -> Array:
        """Their covariance, (p, p)."""

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of Lβ = 0."""


def marginal_contrasts(
    design: Design,
    model: FittedModel,
    term: str | Sequence[str],
    *,
    provenance: Provenance,
    adjust: ContrastAdjustment = "holm",
    ratio: str = "",
    sd: float = 0.0,
) -> Contrasts:
    """Compare all pairs of levels of a factor, or of cells of several, on the model's scale.

    Cells of the other factors count alike. `ratio` and `sd` say what the effect size is, as in
    `estimate_effect`.
    """
    names = design.term(term)
    labels = [",".join(map(str, v)) for v in product(*(design.factor(n).levels for n in names))]
    L = pair_matrix(len(labels)) @ level_rows(design, names)
    estimates = L @ model.beta
    ses = np.sqrt(np.einsum("ij,jk,ik->i", L, model.covariance, L))
    dfs = np.array([model.test(row[None, :])[1] for row in L])
    effects = [
        estimate_effect(float(e), float(s), float(d), ratio=ratio, sd=sd)
        for e, s, d in zip(estimates, ses, dfs, strict=True)
    ]
    return contrast_family(
        names,
        pair_labels(labels),
        estimates,
        ses,
        dfs,
        k=len(labels),
        provenance=provenance,
        adjustment=adjust,
        effects=effects,
    )


def estimate_effect(
    estimate: float, se: float, df: float, *, ratio: str = "", sd: float = 0.0
) -> Effect:
    """Return the effect size of a difference on a model's scale, with an interval from its t.

    `ratio` names what exp(estimate) is, for models of a logarithm ("odds ratio"). Otherwise it is
    d = estimate / `sd`, the SD of a single response from all sources together (Westfall, Kenny and
    Judd 2014), with the noncentral t interval, in which `sd` is taken for known.
    """
    if ratio:
        reach = float(special.stdtrit(df, 0.975)) * se
        low, value, high = (
            float(np.exp(v)) for v in (estimate - reach, estimate, estimate + reach)
        )
        return Effect(ratio, value, Interval(low, high))
    return standardised_mean("d_total", estimate / se, df, se / sd, value=estimate / sd)
