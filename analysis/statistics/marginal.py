"""Compare the marginal means of a fitted model: cells of some factors, the others averaged."""

from collections.abc import Sequence
from itertools import product
from typing import Protocol

import numpy as np
from scipy import special

from analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    contrast_family,
    pair_labels,
    pair_matrix,
)
from analysis.statistics.design import Design
from analysis.statistics.mixed import level_rows
from analysis.statistics.results import Array, Effect, Interval, Provenance


class FittedModel(Protocol):
    """What contrasts need of a model with the sum-coded fixed effects of a design."""

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
) -> Contrasts:
    """Compare all pairs of levels of a factor, or of cells of several, on the model's scale.

    Cells of the other factors count alike. `ratio` names the effect that exp(estimate) is, for
    models of a logarithm ("odds ratio").
    """
    names = design.term(term)
    labels = [",".join(map(str, v)) for v in product(*(design.factor(n).levels for n in names))]
    L = pair_matrix(len(labels)) @ level_rows(design, names)
    estimates = L @ model.beta
    ses = np.sqrt(np.einsum("ij,jk,ik->i", L, model.covariance, L))
    dfs = np.array([model.test(row[None, :])[1] for row in L])
    effects = None
    if ratio:
        reach = special.stdtrit(dfs, 0.975) * ses
        effects = [
            Effect(ratio, float(np.exp(e)), Interval(float(np.exp(e - r)), float(np.exp(e + r))))
            for e, r in zip(estimates, reach, strict=True)
        ]
    return contrast_family(
        names, pair_labels(labels), estimates, ses, dfs,
        k=len(labels), provenance=provenance, adjustment=adjust, effects=effects,
    )  # fmt: skip
