"""ART-C: contrasts of main effects and joined factors on ranks aligned for them."""

from collections.abc import Sequence
from functools import reduce
from itertools import combinations, product

import numpy as np

from visavis.analysis.statistics.art import (
    ALIGNED_DECIMALS,
    ArtAnova,
    ArtError,
    aligned_columns,
    aligned_ranks,
    require_art,
)
from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    contrast_family,
    pair_labels,
    pair_matrix,
)
from visavis.analysis.statistics.design import Design, Factor
from visavis.analysis.statistics.errors import ConstantResponse, TooFewSubjects, UnknownMethod
from visavis.analysis.statistics.marginal import FittedModel
from visavis.analysis.statistics.mixed import RandomIntercept, fit_mixed, level_rows
from visavis.analysis.statistics.rank_sum import mann_whitney
from visavis.analysis.statistics.results import Array, Effect, Provenance
from visavis.analysis.statistics.signed_rank import signed_rank_effect
from visavis.analysis.statistics.strata import Strata


def art_contrasts(
    table: ArtAnova,
    term: str | Sequence[str],
    *,
    adjust: ContrastAdjustment = "tukey",
    error: ArtError | None = None,
) -> Contrasts:
    """Compare all pairs of levels of a factor, or of cells of several factors joined to one.

    The joined factor is aligned and ranked in the model (joined × remaining factors), after
    Elkin et al. (2021). `error` defaults to that of the ANOVA; "strata" is the joined factor's
    own error. Joining between and within factors needs "mixed" and takes it by default.

    The effect size is the rank-biserial correlation of people's mean ranks: matched where the same
    people have both levels, of two groups where they do not.
    """
    require_art(table)
    design = table.design
    names = design.term(term)
    joint_design = join_factors(design, names)
    kinds = {design.factor(n).is_within for n in names}
    crosses = len(kinds) > 1
    error = error or ("mixed" if crosses else table.error)
    if crosses and error != "mixed":
        raise UnknownMethod(
            f"{':'.join(names)} joins between and within factors, whose pairs have different "
            "errors; use error='mixed'"
        )
    if error != "mixed" and not design.is_complete:
        raise UnknownMethod("cells are missing; contrasts need error='mixed'")
    label = ":".join(names)
    ranks = aligned_ranks(aligned_columns(joint_design)[label])
    labels = [",".join(str(v) for v in level) for level in product(*_levels(design, names))]
    L = pair_matrix(len(labels))
    fit = None
    if error == "mixed":
        fit, text = _fit(joint_design, ranks, table)
        estimates, ses, dfs = _estimates_of_fit(fit, level_rows(joint_design, (label,)), L)
    else:
        estimates, ses, dfs, text = _stratum(joint_design, ranks, table.subject, label, L, error)
    return contrast_family(
        names,
        pair_labels(labels),
        estimates,
        ses,
        dfs,
        k=len(labels),
        provenance=_provenance(table, text, fit),
        adjustment=adjust,
        effects=_pair_effects(joint_design, ranks, label),
    )


def art_interaction_contrasts(
    table: ArtAnova,
    term: str | Sequence[str],
    *,
    adjust: ContrastAdjustment = "holm",
    error: ArtError | None = None,
) -> Contrasts:
    """Compare differences of differences of an interaction on its own aligned ranks.

    The effect size is the rank-biserial correlation of people's double differences, or of their
    differences in two groups; a double difference of groups has none.
    """
    require_art(table)
    design = table.design
    names = design.term(term)
    if len(names) < 2:
        raise UnknownMethod(f"{names[0]} is a main effect; use art_contrasts")
    error = error or table.error
    ranks = aligned_ranks(aligned_columns(design)[":".join(names)])
    factors = [design.factor(n) for n in names]
    L: Array = np.ones((1, 1))
    for factor in factors:
        L = np.asarray(np.kron(L, pair_matrix(factor.k)), dtype=np.float64)
    pairs = list(product(*(combinations([str(v) for v in f.levels], 2) for f in factors)))
    fit = None
    if error == "mixed":
        fit, text = _fit(design, ranks, table)
        estimates, ses, dfs = _estimates_of_fit(fit, level_rows(design, names), L)
    else:
        estimates, ses, dfs, text = _interaction(design, ranks, table.subject, names, L, error)
    return contrast_family(
        names,
        pairs,
        estimates,
        ses,
        dfs,
        k=L.shape[1],
        provenance=_provenance(table, text, fit),
        adjustment=adjust,
        effects=_double_effects(design, ranks, names),
    )


def join_factors(design: Design, names: tuple[str, ...]) -> Design:
    """Return the design with some factors replaced by one of all their combinations."""
    if len(names) == 1:
        return design
    codes = np.zeros(design.y.size, dtype=np.intp)
    for name in names:
        codes = codes * design.factor(name).k + design.factor(name).codes
    is_within = any(design.factor(n).is_within for n in names)
    joint_factor = Factor(
        ":".join(names), tuple(product(*_levels(design, names))), codes, is_within
    )
    rest = tuple(f for f in design.factors if f.name not in names)
    order = (
        (joint_factor, *rest)
        if not is_within
        else (
            *(f for f in rest if not f.is_within),
            joint_factor,
            *(f for f in rest if f.is_within),
        )
    )
    return Design(
        design.dv,
        design.y,
        design.subject,
        design.subjects,
        order,
        design.rows,
        design.is_complete,
        design.dropped,
    )


def _levels(design: Design, names: Sequence[str]) -> list[tuple[object, ...]]:
    return [design.factor(n).levels for n in names]


def _stratum(
    design: Design, ranks: Array, subject: str, name: str, L: Array, error: ArtError
) -> tuple[Array, Array, Array, str]:
    """Return estimates, standard errors and df against a stratum's error."""
    strata = Strata(design, subject)
    table = design.table(ranks)
    factor = design.factor(name)
    stratum = strata.test(table, (name,))
    ss, df, text = stratum.ss_error, stratum.df2, stratum.error_term
    sizes = design.group_sizes
    if factor.is_within:
        if error == "pooled":
            ss, df = strata.pooled_within_error(table)
            text = "Within, pooled"
        axis = [f.name for f in design.within].index(name) + 1
        others = tuple(i for i in range(1, table.ndim) if i != axis)
        means, _ = strata.estimates(table.mean(axis=others) if others else table)
        rows_per_level = table[0].size / factor.k
        weight = (1 / sizes).sum() / sizes.size**2 / rows_per_level
        variance = ss / df * weight * (L**2).sum(axis=1)
    else:
        # one value per subject; a level is the plain mean of its cells of the other factors
        cells = np.prod(table.shape[1:], dtype=float)
        group_means = strata.group_means(table.reshape(design.n, -1).mean(axis=1))
        axis = [f.name for f in design.between].index(name)
        others = tuple(i for i in range(group_means.ndim) if i != axis)
        means = group_means.mean(axis=others)
        shape = group_means.shape
        inverse = (1 / sizes).reshape(shape).sum(axis=others) / (sizes.size / factor.k) ** 2
        variance = ss / df / cells * (L**2 @ inverse)
    return L @ means, np.sqrt(variance), np.full(L.shape[0], float(df)), text


def _interaction(
    design: Design,
    ranks: Array,
    subject: str,
    names: tuple[str, ...],
    L: Array,
    error: ArtError,
) -> tuple[Array, Array, Array, str]:
    """Return double differences against the interaction's own (or the pooled) error."""
    if not design.is_complete:
        raise UnknownMethod("cells are missing; contrasts need error='mixed'")
    strata = Strata(design, subject)
    table = design.table(ranks)
    stratum = strata.test(table, names)
    ss, df, text = stratum.ss_error, stratum.df2, stratum.error_term
    if error == "pooled" and any(f.is_within and f.name in names for f in design.factors):
        ss, df = strata.pooled_within_error(table)
        text = "Within, pooled"
    inside = [i for i, f in enumerate(design.within) if f.name in names]
    outside = tuple(i + 1 for i in range(len(design.within)) if i not in inside)
    cells = table.mean(axis=outside) if outside else table
    within_k = int(np.prod(cells.shape[1:], dtype=int))
    repeats = table[0].size / within_k
    means = strata.group_means(cells.reshape(design.n, -1))
    axes = [i for i, f in enumerate(design.between) if f.name in names]
    drop = tuple(i for i in range(len(design.between)) if i not in axes)
    inverse = (1 / design.group_sizes).reshape(means.shape[:-1])
    share = np.prod([means.shape[i] for i in drop], dtype=float)
    means = means.mean(axis=drop).reshape(-1)
    per_group = np.asarray(inverse.sum(axis=drop) / share**2).reshape(-1)
    per_cell = np.repeat(per_group, within_k)
    variance = ss / df / repeats * (L**2 @ per_cell)
    return L @ means, np.sqrt(variance), np.full(L.shape[0], float(df)), text


def _pair_effects(design: Design, ranks: Array, name: str) -> list[Effect | None]:
    """Return the rank-biserial correlation of every pair of levels of a factor."""
    cells = _person_cells(design, ranks, (name,))
    effects = []
    for a, b in combinations(range(design.factor(name).k), 2):
        differences = _person_means(cells[:, a] - cells[:, b])
        if differences.size:
            effects.append(_of_differences(differences))
        else:
            effects.append(_of_groups(_person_means(cells[:, a]), _person_means(cells[:, b])))
    return effects


def _double_effects(design: Design, ranks: Array, names: tuple[str, ...]) -> list[Effect | None]:
    """Return the rank-biserial correlation of every double difference of an interaction."""
    cells = _person_cells(design, ranks, names)
    factors = [design.factor(n) for n in names]
    groups = [f for f in factors if not f.is_within]
    effects: list[Effect | None] = []
    for pairs in product(*(combinations(range(f.k), 2) for f in factors)):
        if len(groups) > 1:
            effects.append(None)
            continue
        sides = [cells[:, level] for level in pairs[0]] if groups else [cells]
        inner = pairs[1:] if groups else pairs
        of_groups = [
            _person_means(reduce(lambda c, pair: c[:, pair[0]] - c[:, pair[1]], inner, side))
            for side in sides
        ]
        effects.append(_of_groups(*of_groups) if groups else _of_differences(of_groups[0]))
    return effects


def _person_cells(design: Design, values: Array, names: Sequence[str]) -> Array:
    """Return one value per person, level of each named factor and cell of the other within factors.

    NaN where a person has none, as in the levels of a between factor that are not theirs.
    """
    others = np.zeros(values.size, dtype=np.intp)
    count = 1
    for factor in (f for f in design.within if f.name not in names):
        others = others * factor.k + factor.codes
        count *= factor.k
    factors = [design.factor(n) for n in names]
    cells = np.full((design.n, *(f.k for f in factors), count), np.nan)
    cells[(design.subject, *(f.codes for f in factors), others)] = values
    return cells


def _person_means(cells: Array) -> Array:
    """Return the mean of every person who has any of the cells (people, cells)."""
    there = np.isfinite(cells)
    has_any = there.any(axis=1)
    sums = np.where(there, cells, 0.0).sum(axis=1)[has_any]
    means: Array = np.round(sums / there.sum(axis=1)[has_any], ALIGNED_DECIMALS)
    return means


def _of_differences(differences: Array) -> Effect | None:
    return signed_rank_effect(differences) if differences.any() else None


def _of_groups(first: Array, second: Array) -> Effect | None:
    try:
        return mann_whitney(first, second, method="normal").effect
    except (ConstantResponse, TooFewSubjects):
        return None


def _fit(design: Design, ranks: Array, table: ArtAnova) -> tuple[FittedModel, str]:
    fit, text = fit_mixed(design, ranks, random=table.random, ddf=table.ddf)
    return fit, f"{text} per subject, REML"


def _estimates_of_fit(fit: FittedModel, rows: Array, L: Array) -> tuple[Array, Array, Array]:
    hypotheses = L @ rows
    ses = np.sqrt(np.einsum("ij,jk,ik->i", hypotheses, fit.covariance, hypotheses))
    dfs = np.array([fit.test(h[None, :])[1] for h in hypotheses])
    return hypotheses @ fit.beta, ses, dfs


def _provenance(table: ArtAnova, text: str, fit: FittedModel | None) -> Provenance:
    notes: tuple[str, ...] = ()
    if isinstance(fit, RandomIntercept) and fit.is_singular:
        notes = ("the random intercept has no variance (singular fit); prefer error='strata'",)
    return Provenance(
        "ART-C", table.provenance.n, error_term=text, dropped=table.provenance.dropped, notes=notes
    )
