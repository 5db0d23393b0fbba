"""Aligned rank transform ANOVA, with the checks and the second opinion it needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, TypeAlias, Unpack, get_args

import numpy as np
from scipy import special

from visavis.analysis.statistics.anova import (
    CORRECTION_NAME,
    Anova,
    AnovaEffect,
    Correction,
    effect_of_stratum,
    p_of_stratum,
)
from visavis.analysis.statistics.design import Codes, Design, DesignColumns, Frame, read_design
from visavis.analysis.statistics.errors import StatisticsError, UnknownMethod, option_text
from visavis.analysis.statistics.mixed import Ddf, RandomPart, mixed_effects
from visavis.analysis.statistics.nonlinear_scales import (
    SKEW_LIMIT,
    nonlinear_scale_interactions,
    residual_skewness,
)
from visavis.analysis.statistics.ranks import average_ranks
from visavis.analysis.statistics.results import NO_CLAIM, Array, Provenance, number, p_text
from visavis.analysis.statistics.strata import Strata, Stratum

ArtError: TypeAlias = Literal["strata", "pooled", "mixed"]
Transform: TypeAlias = Literal["art", "int"]

ALIGNED_DECIMALS = 8
"""Aligned values are ranked after rounding to this many decimals, so that ties survive: of values
between 1 and 10 as ARTool does, of others in proportion.
"""


@dataclass(frozen=True)
class AlignmentCheck:
    """Check of an alignment, which should leave column sums of 0 and F = 0 for other effects.

    `column_sums` by term; `largest_other_f` is the largest F of any other effect on an aligned
    column: 0 when the design is balanced, otherwise a measure of how far alignment is off.
    """

    column_sums: Mapping[str, float]
    largest_other_f: float

    @property
    def is_clean(self) -> bool:
        """Tell whether the columns are stripped of every other effect."""
        sums = max((abs(s) for s in self.column_sums.values()), default=0.0)
        return self.largest_other_f < 1e-6 and sums < 1e-4


@dataclass(frozen=True)
class ArtAnova(Anova):
    """An ART ANOVA table.

    `aligned` and `ranks` hold one column per term, one value per kept row (`design.rows`); with
    transform "int" both hold the normal scores of the plain ranks. `second_opinion` is p of every
    term after the other transform.
    """

    aligned: Mapping[str, Array] | None = None
    ranks: Mapping[str, Array] | None = None
    check: AlignmentCheck | None = None
    second_opinion: Mapping[str, float] | None = None
    residual_skewness: float = 0.0
    error: ArtError = "strata"
    transform: Transform = "art"
    ddf: Ddf = "kenward-roger"
    random: RandomPart = "slopes"


def art_anova(
    frame: Frame,
    dv: str,
    *,
    error: ArtError = "strata",
    transform: Transform = "art",
    correction: Correction = "gg",
    ddf: Ddf = "kenward-roger",
    random: RandomPart = "slopes",
    alpha: float = 0.05,
    **columns: Unpack[DesignColumns],
) -> ArtAnova:
    """Test all effects by the aligned rank transform (Wobbrock et al. 2011).

    `columns` are `subject`, `within`, `between`, `levels` and `missing`, as `read_design` takes
    them; without `subject` every row is another one.
    `error`: "strata" tests each within effect against its own subject-by-effect error, "pooled"
    all of them against one error, "mixed" by a mixed model (REML, `ddf`) whose `random` part lets
    people differ in every within effect ("slopes") or in their level alone ("intercept").
    `missing="mixed"` keeps incomplete subjects and implies the mixed model. `transform="int"`
    runs the ANOVA on normal scores of the plain ranks, which holds its error rate on skewed data
    where ART does not (Tsandilas and Casiez 2024); it is computed beside ART in any case, and a
    note says when the two disagree at `alpha`. `correction` for sphericity is that of
    `rm_anova`, applied to the ranks of the strata tests; "none" is ARTool's.
    """
    for value, kind in ((error, ArtError), (transform, Transform)):
        if value not in get_args(kind):
            raise UnknownMethod(f"no {value!r} here; use one of {', '.join(get_args(kind))}")
    subject = columns.setdefault("subject", None)
    design = read_design(frame, dv, **columns)
    if not design.is_complete:
        error = "mixed"
    if error == "mixed" and not design.within:
        raise UnknownMethod(
            "without within factors there is no random subject; take "
            + option_text("error", "strata")
        )
    name = subject or "row"
    # Align and rank for every effect by itself (Wobbrock et al. 2011) ...
    aligned = aligned_columns(design)
    scale = _scale_of(design.y)
    ranks = {term: average_ranks(without_noise(c, scale)) for term, c in aligned.items()}
    # ... and, as the second opinion, take normal scores of the plain ranks for all effects alike.
    scores = normal_scores(design.y)
    plain = dict.fromkeys(aligned, scores)
    own_columns, other = (ranks, plain) if transform == "art" else (plain, ranks)
    strata = Strata(design, name) if design.is_complete else None
    if error == "mixed" or strata is None:
        effects = _mixed(design, own_columns, ddf, random)
        second = {e.name: e.p_used for e in _mixed(design, other, ddf, random)}
    else:
        rule = correction if error == "strata" else "none"
        effects = tuple(
            effect_of_stratum(s, design, rule, total_error=None)
            for s in _tests(strata, design, own_columns, error)
        )
        tests = _tests(strata, design, other, error)
        second = {":".join(s.term): p_of_stratum(s, design, rule) for s in tests}
    # Reasons not to trust the result: leaks of alignment, skew, a verdict that depends on ranks.
    check = _alignment_check(strata, design, aligned)
    skew = residual_skewness(design)
    notes = _notes(design, effects, second, check, skew, transform, alpha)
    provenance = Provenance(
        "Aligned rank transform ANOVA" if transform == "art" else "Inverse-normal-rank ANOVA",
        design.n,
        unit="subjects" if subject else "rows",
        error_term=_error_text(design, error, ddf, effects),
        correction="sphericity: " + CORRECTION_NAME[correction] if design.within else "none",
        dropped=design.dropped,
        notes=notes,
    )
    return ArtAnova(
        effects,
        design,
        provenance,
        name,
        aligned=aligned if transform == "art" else plain,
        ranks=own_columns,
        check=check,
        second_opinion=second,
        residual_skewness=skew,
        error=error,
        transform=transform,
        ddf=ddf,
        random=random,
    )


def aligned_columns(design: Design) -> dict[str, Array]:
    """Return the aligned response of every term, one value per row.

    Residual (row minus mean of its full cell) plus the term's effect, the inclusion-exclusion sum
    of the means of all its sub-terms; subjects play no part.
    """
    full = design.terms[-1]
    means: dict[tuple[str, ...], Array] = {(): np.full(design.y.size, design.y.mean())}
    for term in design.terms:
        means[term] = _mean_by(design.y, _cell_codes(design, term))
    residual = design.y - means[full]
    columns = {}
    for term in design.terms:
        effect = np.zeros(design.y.size)
        for size in range(len(term) + 1):
            for part in combinations(term, size):
                effect += (-1) ** (len(term) - size) * means[part]
        columns[":".join(term)] = residual + effect
    return columns


def aligned_ranks(column: Array, y: Array) -> Array:
    """Rank an aligned column of a response, float noise removed."""
    return average_ranks(without_noise(column, _scale_of(y)))


def _scale_of(y: Array) -> float:
    """Return the size below whose last decimals differences of aligned values are noise."""
    spread, largest = float(np.abs(y - y.mean()).max()), float(np.abs(y).max())
    # Noise is a share of the values themselves, which may lie far from zero.
    noise: float = largest * float(np.finfo(np.float64).eps) * 10.0**ALIGNED_DECIMALS
    return max(spread, noise)


def without_noise(values: Array, scale: float) -> Array:
    """Round values to `ALIGNED_DECIMALS` of the decimal power below a scale."""
    if scale == 0:
        return values
    unit = 10.0 ** np.floor(np.log10(scale))
    rounded: Array = np.round(values / unit, ALIGNED_DECIMALS) * unit
    return rounded


def normal_scores(y: Array) -> Array:
    """Return normal quantiles of (rank − 3/8) / (N + 1/4) (Blom 1958)."""
    scores: Array = special.ndtri((average_ranks(y) - 0.375) / (y.size + 0.25))
    return scores


def _alignment_check(
    strata: Strata | None, design: Design, columns: Mapping[str, Array]
) -> AlignmentCheck:
    """Check aligned columns: sums, and the largest F of an effect they should not hold."""
    sums = {term: float(column.sum()) for term, column in columns.items()}
    uneven_terms = [of for of, column in columns.items() if column.max() != column.min()]
    largest = 0.0
    if strata is not None and uneven_terms:
        F = strata.f_of_terms([design.table(columns[of]) for of in uneven_terms])
        names = [":".join(term) for term in design.terms]
        F[[names.index(of) for of in uneven_terms], range(len(uneven_terms))] = 0.0
        largest = float(F.max())
    elif uneven_terms:
        for of in uneven_terms:
            tests = mixed_effects(design, columns[of], random="intercept")
            largest = max([largest, *(e.F for e in tests if e.name != of)])
    return AlignmentCheck(sums, largest)


def _mixed(
    design: Design, columns: Mapping[str, Array], ddf: Ddf, random: RandomPart
) -> tuple[AnovaEffect, ...]:
    return tuple(
        next(e for e in mixed_effects(design, column, ddf=ddf, random=random, only=term))
        for term, column in _by_term(design, columns)
    )


def _by_term(design: Design, columns: Mapping[str, Array]) -> list[tuple[tuple[str, ...], Array]]:
    return [(term, columns[":".join(term)]) for term in design.terms]


def _tests(
    strata: Strata, design: Design, columns: Mapping[str, Array], error: ArtError
) -> list[Stratum]:
    tests = []
    within = {f.name for f in design.within}
    last, table = None, np.empty(0)
    for term, column in _by_term(design, columns):
        if column is not last:  # normal scores are one column for all terms
            last, table = column, design.table(column)
        result = strata.test(table, term)
        if error == "pooled" and within & set(term):
            ss, df = strata.pooled_within_error(table)
            result = replace(result, ss_error=ss, df2=df, error_term="Within")
        tests.append(result)
    return tests


def _notes(
    design: Design,
    effects: tuple[AnovaEffect, ...],
    second: Mapping[str, float],
    check: AlignmentCheck,
    skew: float,
    transform: Transform,
    alpha: float,
) -> tuple[str, ...]:
    notes = []
    beside = "inverse-normal ranks" if transform == "art" else "the aligned rank transform"
    for effect in effects:
        p = second[effect.name]
        if (effect.p_used < alpha) != (p < alpha):
            notes.append(
                f"{effect.name}: {p_text(effect.p_used)} here but {p_text(p)} by {beside}; "
                f"the verdict depends on the transform, {NO_CLAIM}"
            )
    if abs(skew) > SKEW_LIMIT and transform == "art":
        notes.append(
            f"residuals are skewed ({number(skew)}); ART may report effects that are not there, "
            f"prefer {option_text('transform', 'int')} or a model of the response"
        )
    notes += nonlinear_scale_interactions(design, effects, alpha)
    for effect in effects:
        s = effect.sphericity
        if s is not None and effect.correction == "none" and (s.p is None or s.p < alpha):
            notes.append(
                f"{effect.name}: the error is not spherical and not corrected for it; "
                f"Greenhouse-Geisser gives {p_text(s.p_gg)}"
            )
    if not check.is_clean:
        notes.append(
            "cells are unequal, so alignment is approximate: other effects reach "
            f"F = {number(check.largest_other_f)} in an aligned column"
        )
    return tuple(notes)


def _error_text(design: Design, error: ArtError, ddf: Ddf, effects: Sequence[AnovaEffect]) -> str:
    if not design.within:
        return "residual"
    if error == "mixed":
        name = "Kenward-Roger" if ddf == "kenward-roger" else "Satterthwaite"
        return f"{effects[0].error_term} per subject, REML, {name} df"
    return {
        "strata": "each effect's own subject-by-effect error",
        "pooled": "one error pooled over all within effects",
    }[error]


def _cell_codes(design: Design, term: Sequence[str]) -> Codes:
    codes = np.zeros(design.y.size, dtype=np.intp)
    for name in term:
        factor = design.factor(name)
        codes = codes * factor.k + factor.codes
    return codes


def _mean_by(values: Array, codes: Codes) -> Array:
    counts = np.maximum(np.bincount(codes), 1)
    means: Array = (np.bincount(codes, values) / counts)[codes]
    return means


def require_art(table: ArtAnova) -> None:
    """Refuse an ANOVA on normal scores where aligned ranks are needed."""
    if table.transform != "art":
        raise StatisticsError(
            f"ART-C contrasts need {option_text('transform', 'art')}; use posthoc on the scores"
        )
