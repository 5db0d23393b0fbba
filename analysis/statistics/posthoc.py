"""Compare the levels of a within factor after a repeated-measures test, by a named error."""

from collections.abc import Sequence
from itertools import combinations
from typing import Literal, TypeAlias, get_args

import numpy as np

from visavis.analysis.statistics.anova import Anova
from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    contrast_family,
    pair_labels,
    pair_matrix,
)
from visavis.analysis.statistics.effects import standardised_mean
from visavis.analysis.statistics.errors import ConstantResponse, UnknownMethod
from visavis.analysis.statistics.results import Array, Provenance
from visavis.analysis.statistics.strata import Strata

PosthocError: TypeAlias = Literal["per_pair", "pooled"]


def posthoc(
    table: Anova,
    factor: str,
    *,
    error: PosthocError = "per_pair",
    adjust: ContrastAdjustment = "holm",
) -> Contrasts:
    """Compare all pairs of levels of a within factor of a repeated-measures ANOVA.

    `error` "per_pair" is the paired t test on subject means (separate error, df n − groups);
    "pooled" uses the error of the factor's own stratum, df (k − 1)(n − groups), and trusts
    sphericity. The two, and their Tukey forms (`adjust="tukey"`), differ: the provenance says
    which this is.

    Per pair the effect size is dz, with groups by the SD of the differences within them.
    """
    if error not in get_args(PosthocError):
        raise UnknownMethod(f"no error {error!r}; use 'per_pair' or 'pooled'")
    design = table.design
    the = design.factor(factor)
    if not the.is_within:
        raise UnknownMethod(f"{factor} varies between subjects; use tukey_hsd or pairwise_t")
    # Every contrast is a column of one value per subject; groups count alike, whatever their size.
    strata = Strata(design, table.subject)
    means = _subject_means(design.table(design.y), [f.name for f in design.within].index(factor))
    L = pair_matrix(the.k)
    n_groups = int(design.group_sizes.size)
    df = design.n - n_groups
    estimates, residuals = strata.estimates(means @ L.T)
    # Variance of an unweighted mean of group means, in units of the variance of one subject.
    weight = float((1 / design.group_sizes).sum() / n_groups**2)
    if error == "per_pair":
        spread = (residuals**2).sum(axis=0) / df
        dfs = np.full(L.shape[0], float(df))
        term = "differences of the two levels"
    else:
        stratum = strata.test(design.table(design.y), (factor,))
        rows_per_level = design.table(design.y)[0].size / the.k
        spread = np.full(L.shape[0], 2 * stratum.ss_error / stratum.df2 / rows_per_level)
        dfs = np.full(L.shape[0], float(stratum.df2))
        term = stratum.error_term + ", pooled over levels"
    # Rounding leaves a spread of about 1e-12 of the values where there is none.
    labels = [str(v) for v in the.levels]
    for i, (a, b) in enumerate(combinations(labels, 2)):
        if spread[i] <= 1e-24 * float(np.abs(means).max()) ** 2:
            raise ConstantResponse(
                f"{design.dv} differs by the same amount between {a} and {b} in all subjects; "
                "t is not defined"
            )
    ses = np.sqrt(spread * weight)
    effects = None
    if error == "per_pair":
        root = float(np.sqrt(weight))
        effects = [
            standardised_mean("dz", float(e / s), df, root, value=float(e / s) * root)
            for e, s in zip(estimates, ses, strict=True)
        ]
    return contrast_family(
        (factor,),
        pair_labels(labels),
        estimates,
        ses,
        dfs,
        k=the.k,
        provenance=Provenance(
            "paired t on subject means" if error == "per_pair" else "pairwise t, stratum error",
            design.n,
            error_term=term,
            dropped=design.dropped,
        ),
        adjustment=adjust,
        effects=effects,
    )


def _subject_means(table: Array, axis: int) -> Array:
    """Average a response table over all within factors but one: (n, k)."""
    others: Sequence[int] = [i + 1 for i in range(table.ndim - 1) if i != axis]
    means: Array = table.mean(axis=tuple(others)) if others else table
    return means
