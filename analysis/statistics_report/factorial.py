"""Tests of designs with factors, each with its contrasts and the path that led to them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from typing import Any, TypeAlias, cast, get_args

import pandas as pd

from visavis.analysis.statistics import (
    Anova,
    AnovaEffect,
    ArtAnova,
    Contrasts,
    Design,
    DunnPair,
    SignedRankPair,
    art_anova,
    art_contrasts,
    art_interaction_contrasts,
    between_anova,
    compare_conditions,
    dunn,
    friedman,
    games_howell,
    kruskal_wallis,
    mixed_anova,
    pairwise_t,
    posthoc,
    posthoc_signed_rank,
    rm_anova,
    tukey_hsd,
    welch_anova,
)
from visavis.analysis.statistics.adjust import Adjustment
from visavis.analysis.statistics.anova import Correction
from visavis.analysis.statistics.art import ArtError, Transform
from visavis.analysis.statistics.bent_scales import bent_interactions
from visavis.analysis.statistics.clmm import Clmm, clmm
from visavis.analysis.statistics.contrasts import ContrastAdjustment
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.gee import Family, Gee, GeeEffect, gee
from visavis.analysis.statistics.lmm import LinearMixed, RandomEffects, linear_mixed
from visavis.analysis.statistics.results import Row, number, p_text, threshold_text
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.prepare import (
    Prepared,
    outcome_of,
    prepare,
    read,
    uneven_changes,
    uneven_groups,
)
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import UsageError

TestRun: TypeAlias = Callable[[DataTable, Question], Outcome]
CONTRAST_WAYS = ("tukey", "holm", "bonferroni", "bh")
RANK_WAYS = ("holm", "bonferroni", "bh")


class _Families:
    """Contrasts gathered effect by effect, with a line of the path for each decision."""

    def __init__(
        self, question: Question, available: Callable[[AnovaEffect | GeeEffect], bool]
    ) -> None:
        self._question = question
        self.available = available
        self.rows: list[Row] = []
        self.sentences: list[str] = []
        self.path: list[str] = []
        self.notes: list[str] = []

    def wanted(self, effect: AnovaEffect | GeeEffect, adjust: str) -> bool:
        """Tell whether an effect gets contrasts, and note why."""
        q = self._question
        significant = effect.p_used < q.alpha
        shown = f"{effect.name}: {p_text(effect.p_used)}, α = {threshold_text(q.alpha)}"
        if adjust == "none":
            self.path.append(f"{shown} → {_verdict(significant)}, no contrasts asked for")
            return False
        if not self.available(effect):
            self.path.append(f"{shown} → {_verdict(significant)}")
            if significant or q.always_posthoc:
                self.notes.append(
                    f"{effect.name} has no contrasts in this test; look at the cells, or take "
                    "the test art or lmm, whose contrasts include interactions of two factors"
                )
            return False
        if significant or q.always_posthoc:
            self.path.append(f"{shown} → {_verdict(significant)}, contrasts ({adjust})")
            return True
        self.path.append(f"{shown} → {_verdict(significant)}, no contrasts")
        return False

    def add(self, family: str, make: Callable[[], Contrasts], further: str = "") -> None:
        """Add a family; `further` ends its sentence. One that cannot be made is a note."""
        try:
            made = make()
        except StatisticsError as error:
            self.notes.append(f"contrasts of {family}: {error}")
            return
        self.rows += [{"family": family, **row} for row in made.rows()]
        self.sentences.append("\n".join(filter(None, (made.sentence(), further))))
        self.notes += list(made.provenance.notes)


def _is_main(effect: AnovaEffect | GeeEffect) -> bool:
    return len(effect.term) == 1


def _verdict(significant: bool) -> str:
    return "significant" if significant else "not significant"


def _art(table: DataTable, q: Question) -> Outcome:
    _refuse_method("error", q.error, get_args(ArtError))
    _refuse_method("transform", q.transform, get_args(Transform))
    if q.within:
        q.need("subject")
    prepared = prepare(table, q)
    adjust = q.adjustment("tukey" if q.transform == "art" else "holm", CONTRAST_WAYS)
    made = art_anova(
        prepared.frame,
        q.dv,
        subject=q.subject or None,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        error=cast(ArtError, q.error),
        missing=q.missing,
        transform=cast(Transform, q.transform),
        correction=_correction(q, "gg"),
        alpha=q.alpha,
    )
    families = _Families(q, lambda effect: _art_has_contrasts(made, effect))
    families.notes += [*_beside_listwise(table, q, made), *uneven_changes(made.design)]
    for effect in made.effects:
        if families.wanted(effect, adjust):
            _art_contrasts(families, made, effect, adjust)
    return _anova_outcome(table, q, prepared, made, families, _art_path(made))


def _correction(q: Question, default: Correction) -> Correction:
    if q.correction:
        _refuse_method("correction", q.correction, get_args(Correction))
    return cast(Correction, q.correction) if q.correction else default


def _sphericity_path(made: Anova) -> list[str]:
    path = []
    for effect in made.effects:
        if effect.sphericity is not None:
            used = "no correction" if effect.correction == "none" else effect.correction
            path.append(
                f"Is the error of {effect.name} spherical (Mauchly): {effect.sphericity} → {used}"
            )
    return path


def _art_path(made: ArtAnova) -> list[str]:
    complete = "yes" if made.design.is_complete else "no, mixed model"
    path = [f"Has every subject every cell: n = {made.design.n} → {complete}"]
    check = made.check
    if made.transform == "art" and check is not None:
        path.append(
            "Is alignment clean (other effects' F in aligned columns): largest "
            f"{number(check.largest_other_f)} → {'yes' if check.is_clean else 'no, see notes'}"
        )
    path += _sphericity_path(made)
    skew = made.residual_skewness
    path.append(
        f"Are the residuals skewed: skewness {number(skew)} → "
        f"{'yes, prefer transform=int' if abs(skew) > 1 else 'not much'}"
    )
    beside = "inverse-normal ranks" if made.transform == "art" else "the aligned rank transform"
    for effect in made.effects:
        other = (made.second_opinion or {}).get(effect.name)
        if other is not None:
            path.append(f"{effect.name}: {p_text(effect.p)} here → {p_text(other)} by {beside}")
    return path


def _art_has_contrasts(made: ArtAnova, effect: AnovaEffect | GeeEffect) -> bool:
    """Tell whether there are contrasts: aligned for two factors at most, scores for one within."""
    if made.transform == "art":
        return len(effect.term) <= 2
    return _is_main(effect) and made.design.factor(effect.term[0]).is_within


def _art_contrasts(families: _Families, made: ArtAnova, effect: AnovaEffect, adjust: str) -> None:
    way = cast(ContrastAdjustment, adjust)
    if made.transform == "int":
        scores = (made.ranks or {})[effect.name]
        on_scores = replace(made, design=replace(made.design, y=scores))
        families.add(effect.name, lambda: posthoc(on_scores, effect.term[0], adjust=way))
        return
    differences = (
        f"Estimates and SE are in aligned ranks, not in the unit of {made.design.dv}; there the "
        f"means differ by {_mean_differences(made.design, effect.term)}."
    )
    families.add(effect.name, lambda: art_contrasts(made, effect.term, adjust=way), differences)
    if len(effect.term) == 2:
        other: ContrastAdjustment = "holm" if way == "tukey" else way
        families.add(
            f"{effect.name}, differences of differences",
            lambda: art_interaction_contrasts(made, effect.term, adjust=other),
            f"Estimates and SE are in aligned ranks, not in the unit of {made.design.dv}.",
        )


def _mean_differences(design: Design, term: Sequence[str]) -> str:
    """Return how the means of levels, or of joined cells, differ two by two: "a − b 0.5; …"."""
    labels = [
        [str(design.factor(name).levels[int(code)]) for code in design.factor(name).codes]
        for name in term
    ]
    cells = [",".join(at) for at in zip(*labels, strict=True)]
    means = pd.Series(design.y, dtype=float).groupby(cells, sort=False).mean()
    every = [",".join(map(str, at)) for at in product(*(design.factor(n).levels for n in term))]
    known = [cell for cell in every if cell in means.index]
    return "; ".join(f"{a} − {b} {number(means[a] - means[b])}" for a, b in combinations(known, 2))


def _rm(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    prepared = prepare(table, q)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    design = read(prepared, q)
    made = rm_anova(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        missing="listwise" if q.missing == "listwise" else "error",
        correction=_correction(q, "mauchly"),
    )
    path = [f"Has every subject every cell: n = {design.n} → yes"]
    path += _sphericity_path(made)
    families = _Families(q, _is_main)
    families.notes += uneven_changes(made.design)
    for effect in made.effects:
        if families.wanted(effect, adjust):
            _mean_contrasts(families, made, effect, adjust)
    return _anova_outcome(table, q, prepared, made, families, path)


def _mean_contrasts(families: _Families, made: Anova, effect: AnovaEffect, adjust: str) -> None:
    way = cast(ContrastAdjustment, adjust)
    factor = made.design.factor(effect.term[0])
    if factor.is_within:
        families.add(effect.name, lambda: posthoc(made, factor.name, adjust=way))
        return
    means = _subject_means(made.design, factor.name)
    order = list(factor.levels)
    if way == "tukey":
        families.add(
            effect.name, lambda: tukey_hsd(means, made.design.dv, factor=factor.name, levels=order)
        )
    else:
        families.add(
            effect.name,
            lambda: pairwise_t(means, made.design.dv, factor=factor.name, levels=order, adjust=way),
        )


def _subject_means(design: Design, factor: str) -> pd.DataFrame:
    place = [f.name for f in design.between].index(factor)
    codes = design.group_of_subject[place]
    labels = [design.factor(factor).levels[int(c)] for c in codes]
    y = design.table(design.y).reshape(design.n, -1).mean(axis=1)
    return pd.DataFrame({factor: labels, design.dv: y})


def _mixed(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    prepared = prepare(table, replace(q, missing="mixed"))
    made = mixed_anova(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
    )
    state = "yes" if made.design.is_complete else "no, the model uses what is there"
    families = _Families(q, lambda effect: False)
    families.notes += [
        *_beside_listwise(table, q, made),
        *_not_spherical(table, q),
        *uneven_changes(made.design),
    ]
    path = [f"Has every subject every cell: n = {made.design.n} → {state}"]
    return _anova_outcome(table, q, prepared, made, families, path)


def _beside_listwise(table: DataTable, q: Question, made: Anova) -> list[str]:
    """Say where leaving out people with missing cells leads to another verdict."""
    if made.design.is_complete:
        return []
    test = "art" if q.test == "art" else "rm"
    try:
        other = FACTORIAL_TESTS[test](
            table, replace(q, test=test, missing="listwise", error="strata", posthoc="none")
        )
    except StatisticsError as error:
        return [f"with missing=listwise there is nothing to compare with: {error}"]
    told = []
    for effect in made.effects:
        p = other.p(effect.name)
        if (p < q.alpha) != (effect.p_used < q.alpha):
            told.append(
                f"{effect.name}: {p_text(effect.p_used)} with the cells that are there but "
                f"{p_text(p)} of the {other.row(effect.name)['n']} people who have all "
                f"(missing=listwise), each against its own error; error here: "
                f"{made.provenance.error_term}"
            )
    return told


def _not_spherical(table: DataTable, q: Question) -> list[str]:
    """Name effects whose error a mixed model of cells takes for spherical though it is not."""
    try:
        complete = _complete_anova(table, q)
    except StatisticsError:
        return []
    return [
        f"{effect.name}: people's differences are not spherical ({effect.sphericity}), which this "
        "model takes them to be; the test rm corrects for it"
        for effect in complete.effects
        if effect.sphericity is not None
        and (effect.sphericity.p is None or effect.sphericity.p < q.alpha)
    ]


def _complete_anova(table: DataTable, q: Question) -> Anova:
    """Return the repeated-measures ANOVA of the people who have all cells."""
    prepared = prepare(table, replace(q, missing="listwise"))
    return rm_anova(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        missing="listwise",
    )


def _lmm(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    random = q.random or "maximal"
    _refuse_method("random", random, get_args(RandomEffects))
    prepared = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    made = linear_mixed(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        missing=q.missing,
        random=cast(RandomEffects, random),
    )
    return _model_outcome(table, q, prepared, made, list(made.steps), adjust)


def _gee(table: DataTable, q: Question) -> Outcome:
    q.need("subject")
    if not q.within and not q.between:
        raise UsageError("the test gee needs a within or a between factor")
    _refuse_method("family", q.family, get_args(Family))
    prepared = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    made = gee(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        missing=q.missing,
        family=cast(Family, q.family),
    )
    return _model_outcome(table, q, prepared, made, [], adjust)


def _clmm(table: DataTable, q: Question) -> Outcome:
    if q.within:
        q.need("subject")
    elif not q.between:
        raise UsageError("the test clmm needs a within or a between factor")
    prepared = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    made = clmm(
        prepared.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=prepared.levels,
        missing=q.missing,
        random=q.random or "intercept",
        nodes=q.nodes,
    )
    return _model_outcome(table, q, prepared, made, [], adjust)


def _model_outcome(
    table: DataTable,
    q: Question,
    prepared: Prepared,
    made: LinearMixed | Gee | Clmm,
    path: list[str],
    adjust: str,
) -> Outcome:
    """Return the outcome of a model of single rows, contrasts of its marginal means."""
    families = _Families(q, lambda effect: len(effect.term) <= 2)
    for effect in made.effects:
        if families.wanted(effect, adjust):
            way = cast(ContrastAdjustment, adjust)
            families.add(effect.name, partial(made.contrasts, effect.term, adjust=way))
    return _anova_outcome(table, q, prepared, made, families, path)


def _between(table: DataTable, q: Question) -> Outcome:
    q.need("between")
    if q.within:
        raise UsageError("the test anova compares groups; with within factors take rm")
    prepared = prepare(table, q)
    adjust = q.adjustment("tukey", CONTRAST_WAYS)
    made = between_anova(
        prepared.frame,
        q.dv,
        between=q.between,
        subject=q.subject or None,
        levels=prepared.levels,
        missing="listwise" if q.missing == "listwise" else "error",
    )
    families = _Families(q, _is_main)
    families.notes += uneven_groups(made.design, "the test welch, for one factor")
    for effect in made.effects:
        if families.wanted(effect, adjust):
            _mean_contrasts(families, made, effect, adjust)
    return _anova_outcome(table, q, prepared, made, families, [])


def _anova_outcome(
    table: DataTable,
    q: Question,
    prepared: Prepared,
    made: Anova | Gee | Clmm,
    families: _Families,
    path: list[str],
) -> Outcome:
    notes = [*made.provenance.notes, *families.notes]
    if isinstance(made, Anova):
        notes += bent_interactions(made.design, made.effects, q.alpha)
    return outcome_of(
        table,
        q,
        made.provenance.test,
        prepared,
        made.design,
        made.rows(),
        (
            f"{made.provenance.test}, n = {made.provenance.n} {made.provenance.unit}, "
            f"error: {made.provenance.error_term}.",
            *(e.sentence() + "." for e in made.effects),
        ),
        path=(*path, *families.path),
        contrasts=tuple(families.rows),
        contrast_sentences=tuple(families.sentences),
        notes=notes,
    )


def _kept(prepared: Prepared, design: Design) -> pd.DataFrame:
    return prepared.frame.iloc[design.rows].reset_index(drop=True)


def _friedman(table: DataTable, q: Question) -> Outcome:
    within = q.one_within()
    prepared = prepare(table, q)
    adjust = q.adjustment("holm", RANK_WAYS)
    design = read(prepared, q)
    frame, levels = _kept(prepared, design), prepared.levels[within]
    made = friedman(frame, q.dv, subject=q.subject, within=within, levels=levels)
    significant = made.p < q.alpha
    path = [f"{made.sentence()}, α = {threshold_text(q.alpha)} → {_verdict(significant)}"]
    pairs: tuple[SignedRankPair, ...] = ()
    if adjust != "none" and (significant or q.always_posthoc):
        pairs = posthoc_signed_rank(
            frame,
            q.dv,
            subject=q.subject,
            within=within,
            levels=levels,
            adjust=cast(Adjustment, adjust),
        )
    return outcome_of(
        table,
        q,
        "Friedman's test",
        prepared,
        design,
        (made.row(),),
        (f"Friedman's test of {within} on {q.dv}: {made.sentence()}.",),
        path=tuple(path),
        contrasts=tuple({"family": within, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=made.provenance.notes,
    )


def _conditions(table: DataTable, q: Question) -> Outcome:
    within = q.one_within()
    prepared = prepare(table, q)
    adjust = q.adjustment("bonferroni", RANK_WAYS)
    design = read(prepared, q)
    made = compare_conditions(
        _kept(prepared, design),
        q.dv,
        subject=q.subject,
        within=within,
        levels=prepared.levels[within],
        alpha=q.alpha,
        normality_alpha=q.normality_alpha,
        adjust=cast(Adjustment, adjust),
        always_posthoc=q.always_posthoc,
    )
    pairs: Any = made.pairs.contrasts if isinstance(made.pairs, Contrasts) else made.pairs
    return outcome_of(
        table,
        q,
        "Repeated-measures ANOVA" if made.is_parametric else "Friedman's test",
        prepared,
        design,
        (made.row(),),
        (made.sentence(),),
        path=tuple(str(s) for s in made.steps),
        contrasts=tuple({"family": within, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=made.provenance.notes,
    )


def _kruskal(table: DataTable, q: Question) -> Outcome:
    factor = q.one_between()
    prepared = prepare(table, q)
    adjust = q.adjustment("holm", RANK_WAYS)
    design = read(prepared, q)
    frame, levels = _kept(prepared, design), prepared.levels[factor]
    made = kruskal_wallis(frame, q.dv, factor=factor, levels=levels)
    significant = made.p < q.alpha
    pairs: tuple[DunnPair, ...] = ()
    if adjust != "none" and (significant or q.always_posthoc):
        pairs = dunn(frame, q.dv, factor=factor, levels=levels, adjust=cast(Adjustment, adjust))
    return outcome_of(
        table,
        q,
        "Kruskal-Wallis test",
        prepared,
        design,
        (made.row(),),
        (f"Kruskal-Wallis test of {factor} on {q.dv}: {made.sentence()}.",),
        path=(f"{made.sentence()}, α = {threshold_text(q.alpha)} → {_verdict(significant)}",),
        contrasts=tuple({"family": factor, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=(*made.provenance.notes, *uneven_groups(design, "the test welch")),
    )


def _welch(table: DataTable, q: Question) -> Outcome:
    factor = q.one_between()
    prepared = prepare(table, q)
    adjust = q.adjustment("tukey", CONTRAST_WAYS)
    design = read(prepared, q)
    frame, levels = _kept(prepared, design), prepared.levels[factor]
    made = welch_anova(frame, q.dv, factor=factor, levels=levels)
    significant = made.p < q.alpha
    families = _Families(q, lambda effect: True)
    if adjust != "none" and (significant or q.always_posthoc):
        way = cast(ContrastAdjustment, adjust)
        families.add(
            factor, lambda: games_howell(frame, q.dv, factor=factor, levels=levels, adjust=way)
        )
    return outcome_of(
        table,
        q,
        made.provenance.test,
        prepared,
        design,
        ({"term": factor, **made.row()},),
        (f"{factor} on {q.dv}: {made.sentence()}.",),
        path=(
            f"{factor}: {p_text(made.p)}, α = {threshold_text(q.alpha)} → {_verdict(significant)}",
        ),
        contrasts=tuple(families.rows),
        contrast_sentences=tuple(families.sentences),
        notes=(*made.provenance.notes, *families.notes),
    )


def _refuse_method(option: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise UsageError(f"{option} takes {', '.join(known)}, not {value!r}")


FACTORIAL_TESTS: Mapping[str, TestRun] = {
    "art": _art,
    "rm": _rm,
    "mixed": _mixed,
    "lmm": _lmm,
    "gee": _gee,
    "clmm": _clmm,
    "anova": _between,
    "welch": _welch,
    "friedman": _friedman,
    "conditions": _conditions,
    "kruskal": _kruskal,
}
