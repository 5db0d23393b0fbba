"""ART-C: contrasts of main effects and joined factors on ranks aligned for them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from itertools import combinations, product

import numpy as np

from visavis.analysis.statistics.art import (
    ArtAnova,
    ArtError,
    aligned_columns,
    aligned_ranks,
    require_art,
    without_noise,
)
from visavis.analysis.statistics.contrasts import ContrastAdjustment, Contrasts
from visavis.analysis.statistics.design import Design, Factor
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    TooFewSubjects,
    UnknownMethod,
    option_text,
)
from visavis.analysis.statistics.marginal import (
    CellModel,
    FixedEffects,
    GroupCells,
    cell_contrasts,
)
from visavis.analysis.statistics.mixed import fit_mixed
from visavis.analysis.statistics.rank_sum import mann_whitney
from visavis.analysis.statistics.results import Array, Effect, Provenance
from visavis.analysis.statistics.signed_rank import signed_rank_effect


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
            f"errors; take {option_text('error', 'mixed')}"
        )
    if error != "mixed" and not design.is_complete:
        raise UnknownMethod("cells are missing; contrasts need " + option_text("error", "mixed"))
    label = ":".join(names)
    ranks = aligned_ranks(aligned_columns(joint_design)[label], joint_design.y)
    contrasts = cell_contrasts(
        _cells(joint_design, ranks, table, error),
        (label,),
        provenance=_provenance(table),
        adjust=adjust,
        effects=_pair_effects(joint_design, ranks, label),
    )
    return replace(contrasts, term=names)


def art_simple_effects(
    table: ArtAnova,
    term: str,
    by: str,
    *,
    adjust: ContrastAdjustment = "tukey",
    error: ArtError | None = None,
) -> tuple[Contrasts, ...]:
    """Compare the levels of a factor at every level of another, each a family of its own.

    They are those of `art_contrasts` of both factors joined whose cells share the other's level.
    """
    design = table.design
    (name,), (at,) = design.term(term), design.term(by)
    if name == at:
        raise UnknownMethod(f"{name} cannot be compared at its own levels")
    joint = art_contrasts(table, (name, at), adjust="none", error=error)
    labels = [str(v) for v in design.factor(name).levels]
    levels = [str(v) for v in design.factor(at).levels]
    # The joined factor's levels are in the order of the design, whichever factor is compared.
    is_first = design.term((name, at))[0] == name
    of = product(labels, levels) if is_first else ((b, a) for a, b in product(levels, labels))
    cells = list(combinations(of, 2))
    families = []
    for level in levels:
        rows = [i for i, (a, b) in enumerate(cells) if a[1] == level == b[1]]
        contrasts = tuple(
            replace(joint.contrasts[i], pairs=((cells[i][0][0], cells[i][1][0]),)) for i in rows
        )
        correlation = None if joint.correlation is None else joint.correlation[np.ix_(rows, rows)]
        provenance = replace(joint.provenance, test=f"{joint.provenance.test} at {at} = {level}")
        family = replace(
            joint,
            term=(name,),
            contrasts=contrasts,
            k=len(labels),
            provenance=provenance,
            correlation=correlation,
        )
        families.append(family.with_adjustment(adjust))
    return tuple(families)


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
    ranks = aligned_ranks(aligned_columns(design)[":".join(names)], design.y)
    return cell_contrasts(
        _cells(design, ranks, table, error),
        names,
        double=True,
        provenance=_provenance(table),
        adjust=adjust,
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
        ":".join(names),
        tuple(",".join(map(str, v)) for v in product(*_levels(design, names))),
        codes,
        is_within,
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


def _cells(design: Design, ranks: Array, table: ArtAnova, error: ArtError) -> CellModel:
    """Return the model of a column of ranks by a named error."""
    if error == "mixed":
        fit, words = fit_mixed(design, ranks, random=table.random, ddf=table.ddf)
        return FixedEffects(design, fit, error=f"{words} per subject, REML")
    return GroupCells(design, table.subject, ranks, "strata" if error == "strata" else "one")


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
    means: Array = sums / there.sum(axis=1)[has_any]
    return without_noise(means, float(np.abs(means).max(initial=0.0)))


def _of_differences(differences: Array) -> Effect | None:
    return signed_rank_effect(differences) if differences.any() else None


def _of_groups(first: Array, second: Array) -> Effect | None:
    try:
        return mann_whitney(first, second, method="normal").effect
    except (ConstantResponse, TooFewSubjects):
        return None


def _provenance(table: ArtAnova) -> Provenance:
    return Provenance("ART-C", table.provenance.n, dropped=table.provenance.dropped)
