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
    art_simple_effects,
    between_anova,
    compare_conditions,
    dunn,
    friedman,
    games_howell,
    interaction_contrasts,
    kruskal_wallis,
    mixed_anova,
    posthoc,
    posthoc_signed_rank,
    rm_anova,
    simple_effects,
    welch_anova,
)
from visavis.analysis.statistics.adjust import Adjustment
from visavis.analysis.statistics.anova import Correction
from visavis.analysis.statistics.art import ArtError, Transform
from visavis.analysis.statistics.bayes import (
    FIXED_SCALE,
    PERSON_SCALE,
    bayes_text,
    jzs_anova_bayes_factor,
)
from visavis.analysis.statistics.clmm import Clmm, clmm
from visavis.analysis.statistics.contrasts import ContrastAdjustment
from visavis.analysis.statistics.errors import StatisticsError, option_text
from visavis.analysis.statistics.gee import Family, Gee, GeeEffect, gee
from visavis.analysis.statistics.lmm import LinearMixed, RandomEffects, linear_mixed
from visavis.analysis.statistics.mixed import fit_mixed
from visavis.analysis.statistics.nonlinear_scales import nonlinear_scale_interactions
from visavis.analysis.statistics.results import Row, number, p_text, threshold_text
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.prepare import (
    TidyTable,
    outcome_of,
    prepare,
    read,
    uneven_changes,
    uneven_groups,
)
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import UsageError

TestRun: TypeAlias = Callable[[DataTable, Question], Outcome]
CONTRAST_WAYS = ("tukey", "mvt", "holm", "bonferroni", "bh")
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

    def asks_for(self, effect: AnovaEffect | GeeEffect, adjust: str) -> bool:
        """Tell whether an effect gets contrasts, and note why."""
        q = self._question
        significant = effect.p_used < q.decision.alpha
        result = f"{effect.name}: {p_text(effect.p_used)}, α = {threshold_text(q.decision.alpha)}"
        if adjust == "none":
            self.path.append(f"{result} → {_verdict(significant)}, no contrasts asked for")
            return False
        if not self.available(effect):
            self.path.append(f"{result} → {_verdict(significant)}")
            if significant or q.decision.always_posthoc:
                self.notes.append(
                    f"{effect.name} has no contrasts, which compare two factors at most; look at "
                    "the cells"
                )
            return False
        if significant or q.decision.always_posthoc:
            self.path.append(f"{result} → {_verdict(significant)}, contrasts ({adjust})")
            return True
        self.path.append(f"{result} → {_verdict(significant)}, no contrasts")
        return False

    def add_simple(
        self,
        effect: AnovaEffect | GeeEffect,
        make: Callable[[str, str], Sequence[Contrasts]],
        further: str = "",
    ) -> bool:
        """Add the simple effects of the factor asked for, a family at each level of the other.

        Tell whether these are asked for; `make` takes both factors.
        """
        simple = self._question.decision.simple
        if simple not in effect.term or len(effect.term) != 2:
            return False
        (other,) = (name for name in effect.term if name != simple)
        try:
            families = make(simple, other)
        except StatisticsError as error:
            self.notes.append(f"simple effects of {simple}: {error}")
            return True
        for contrasts in families:
            where = contrasts.provenance.test.rpartition(" at ")[2]
            self.add(f"{simple} at {where}", partial(_same, contrasts), further)
        return True

    def add(self, family: str, make: Callable[[], Contrasts], further: str = "") -> None:
        """Add a family; `further` ends its sentence. One that cannot be made is a note."""
        try:
            contrasts = make()
        except StatisticsError as error:
            self.notes.append(f"contrasts of {family}: {error}")
            return
        self.rows += [{"family": family, **row} for row in contrasts.rows()]
        self.sentences.append("\n".join(filter(None, (contrasts.sentence(), further))))
        self.notes += list(contrasts.provenance.notes)


def _same(contrasts: Contrasts) -> Contrasts:
    return contrasts


def _verdict(significant: bool) -> str:
    return "significant" if significant else "not significant"


def _art(table: DataTable, q: Question) -> Outcome:
    _refuse_method("error", q.model.error, get_args(ArtError))
    _refuse_method("transform", q.model.transform, get_args(Transform))
    if q.within:
        q.need("subject")
    tidy = prepare(table, q)
    adjust = q.adjustment("tukey" if q.model.transform == "art" else "holm", CONTRAST_WAYS)
    anova = art_anova(
        tidy.frame,
        q.dv,
        subject=q.subject or None,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        error=cast(ArtError, q.model.error),
        missing=q.missing,
        transform=cast(Transform, q.model.transform),
        correction=_correction(q, "gg"),
        alpha=q.decision.alpha,
    )
    families = _Families(q, lambda effect: len(effect.term) <= 2)
    families.notes += [*_beside_listwise(table, q, anova), *uneven_changes(anova.design)]
    for effect in anova.effects:
        if families.asks_for(effect, adjust):
            _art_contrasts(families, anova, effect, adjust)
    return _anova_outcome(table, q, tidy, anova, families, _art_path(anova))


def _correction(q: Question, default: Correction) -> Correction:
    if q.model.correction:
        _refuse_method("correction", q.model.correction, get_args(Correction))
    return cast(Correction, q.model.correction) if q.model.correction else default


def _sphericity_path(anova: Anova) -> list[str]:
    path = []
    for effect in anova.effects:
        if effect.sphericity is not None:
            correction = "no correction" if effect.correction == "none" else effect.correction
            path.append(
                f"Is the error of {effect.name} spherical (Mauchly): {effect.sphericity} → "
                f"{correction}"
            )
    return path


def _art_path(anova: ArtAnova) -> list[str]:
    complete = "yes" if anova.design.is_complete else "no, mixed model"
    path = [f"Has every subject every cell: n = {anova.design.n} → {complete}"]
    check = anova.check
    if anova.transform == "art" and check is not None:
        path.append(
            "Is alignment clean (other effects' F in aligned columns): largest "
            f"{number(check.largest_other_f)} → {'yes' if check.is_clean else 'no, see notes'}"
        )
    path += _sphericity_path(anova)
    skew = anova.residual_skewness
    path.append(
        f"Are the residuals skewed: skewness {number(skew)} → "
        + (f"yes, prefer {option_text('transform', 'int')}" if abs(skew) > 1 else "not much")
    )
    beside = "inverse-normal ranks" if anova.transform == "art" else "the aligned rank transform"
    for effect in anova.effects:
        other = (anova.second_opinion or {}).get(effect.name)
        if other is not None:
            path.append(f"{effect.name}: {p_text(effect.p)} here → {p_text(other)} by {beside}")
    return path


def _art_contrasts(families: _Families, anova: ArtAnova, effect: AnovaEffect, adjust: str) -> None:
    way = cast(ContrastAdjustment, adjust)
    if anova.transform == "int":
        scores = _of_scores(anova, effect)
        if not families.add_simple(effect, lambda a, b: simple_effects(scores, a, b, adjust=way)):
            families.add(effect.name, lambda: posthoc(scores, effect.term, adjust=way))
        return
    differences = (
        f"Estimates and SE are in aligned ranks, not in the unit of {anova.design.dv}; there the "
        f"means differ by {_mean_differences(anova.design, effect.term)}."
    )
    if not families.add_simple(
        effect, lambda a, b: art_simple_effects(anova, a, b, adjust=way), differences
    ):
        families.add(
            effect.name, lambda: art_contrasts(anova, effect.term, adjust=way), differences
        )
    if len(effect.term) == 2:
        families.add(
            f"{effect.name}, differences of differences",
            lambda: art_interaction_contrasts(anova, effect.term, adjust=_without_means(way)),
            f"Estimates and SE are in aligned ranks, not in the unit of {anova.design.dv}.",
        )


def _of_scores(anova: ArtAnova, effect: AnovaEffect) -> ArtAnova:
    """Return the ANOVA of normal scores of one effect as one of a response of its own."""
    design = replace(anova.design, y=(anova.ranks or {})[effect.name])
    if design.is_complete:
        return replace(anova, design=design)
    fit, _ = fit_mixed(design, design.y, random=anova.random, ddf=anova.ddf)
    return replace(anova, design=design, model=fit)


def _mean_differences(design: Design, term: Sequence[str]) -> str:
    """Return how the means of levels, or of joined cells, differ two by two: "a − b 0.5; …"."""
    labels = [
        [str(design.factor(name).levels[int(code)]) for code in design.factor(name).codes]
        for name in term
    ]
    cells = [",".join(at) for at in zip(*labels, strict=True)]
    means = pd.Series(design.y, dtype=float).groupby(cells, sort=False).mean()
    every = [",".join(map(str, at)) for at in product(*(design.factor(n).levels for n in term))]
    cells_with_rows = [cell for cell in every if cell in means.index]
    return "; ".join(
        f"{a} − {b} {number(means[a] - means[b])}" for a, b in combinations(cells_with_rows, 2)
    )


def _rm(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    tidy = prepare(table, q)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    design = read(tidy, q)
    anova = rm_anova(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing="listwise" if q.missing == "listwise" else "error",
        correction=_correction(q, "mauchly"),
        covariates=q.model.covariates,
    )
    path = [f"Has every subject every cell: n = {design.n} → yes"]
    path += _sphericity_path(anova)
    families = _mean_contrasts(q, anova, adjust)
    families.notes += uneven_changes(anova.design)
    return _with_bayes(_anova_outcome(table, q, tidy, anova, families, path), anova)


def _with_bayes(outcome: Outcome, anova: Anova) -> Outcome:
    """Return an outcome with the Bayes factor of its one factor, where that was asked for."""
    if not outcome.question.model.bayes:
        return outcome
    factor = jzs_anova_bayes_factor(anova.design)
    (row,), (head, sentence) = outcome.rows, outcome.sentences
    note = (
        f"Bayes factor with Cauchy priors of scale {FIXED_SCALE:g} on effects in residual SD"
        + (f" and {PERSON_SCALE:g} on people's levels" if anova.design.within else "")
        + " (JZS); above 1 it speaks for differences, below 1 for none"
    )
    return replace(
        outcome,
        rows=({**row, "BF10": factor},),
        sentences=(head, f"{sentence.rstrip('.')}, {bayes_text(factor)}."),
        notes=(*outcome.notes, note),
    )


def _mean_contrasts(q: Question, table: Anova | Gee | Clmm, adjust: str) -> _Families:
    """Compare the marginal means of every effect of one or two factors that asks for it."""
    families = _Families(q, lambda effect: len(effect.term) <= 2)
    way = cast(ContrastAdjustment, adjust)
    covariates = set(q.model.covariates)  # numbers have no levels to compare
    for effect in (e for e in table.effects if covariates.isdisjoint(e.term)):
        if not families.asks_for(effect, adjust):
            continue
        if not families.add_simple(effect, partial(simple_effects, table, adjust=way)):
            families.add(effect.name, partial(posthoc, table, effect.term, adjust=way))
        if len(effect.term) == 2 and effect.df1 > 1:  # with one df it is the effect itself
            families.add(
                f"{effect.name}, differences of differences",
                partial(interaction_contrasts, table, effect.term, adjust=_without_means(way)),
            )
    return families


def _without_means(way: ContrastAdjustment) -> ContrastAdjustment:
    """Return how double differences are adjusted, for which Tukey has no range."""
    return "holm" if way == "tukey" else way


def _mixed_model(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    tidy = prepare(table, replace(q, missing="mixed"))
    anova = mixed_anova(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
    )
    state = "yes" if anova.design.is_complete else "no, the model uses what is there"
    families = _mean_contrasts(q, anova, q.adjustment("holm", CONTRAST_WAYS))
    families.notes += [
        *_beside_listwise(table, q, anova),
        *_not_spherical(table, q),
        *uneven_changes(anova.design),
    ]
    path = [f"Has every subject every cell: n = {anova.design.n} → {state}"]
    return _anova_outcome(table, q, tidy, anova, families, path)


def _beside_listwise(table: DataTable, q: Question, anova: Anova) -> list[str]:
    """Say where leaving out people with missing cells leads to another verdict."""
    if anova.design.is_complete:
        return []
    test = "art" if q.test == "art" else "rm"
    try:
        other = FACTORIAL_TESTS[test](
            table,
            replace(
                q,
                test=test,
                missing="listwise",
                decision=replace(q.decision, posthoc="none"),
                model=replace(q.model, error="strata"),
            ),
        )
    except StatisticsError as error:
        return [f"without the people who lack cells there is nothing to compare with: {error}"]
    notes = []
    for effect in anova.effects:
        p = other.p(effect.name)
        if (p < q.decision.alpha) != (effect.p_used < q.decision.alpha):
            notes.append(
                f"{effect.name}: {p_text(effect.p_used)} with the cells that are there but "
                f"{p_text(p)} of the {other.row(effect.name)['n']} people who have all "
                f"({option_text('missing', 'listwise')}), each against its own error; error here: "
                f"{anova.provenance.error_term}"
            )
    return notes


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
        and (effect.sphericity.p is None or effect.sphericity.p < q.decision.alpha)
    ]


def _complete_anova(table: DataTable, q: Question) -> Anova:
    """Return the repeated-measures ANOVA of the people who have all cells."""
    tidy = prepare(table, replace(q, missing="listwise"))
    return rm_anova(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing="listwise",
    )


def _lmm(table: DataTable, q: Question) -> Outcome:
    q.need("subject", "within")
    random = q.model.random or "maximal"
    _refuse_method("random", random, get_args(RandomEffects))
    tidy = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    model = linear_mixed(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing=q.missing,
        random=cast(RandomEffects, random),
    )
    return _model_outcome(table, q, tidy, model, list(model.steps), adjust)


def _gee(table: DataTable, q: Question) -> Outcome:
    q.need("subject")
    if not q.within and not q.between:
        raise UsageError("the test gee needs a within or a between factor")
    _refuse_method("family", q.model.family, get_args(Family))
    tidy = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    model = gee(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing=q.missing,
        family=cast(Family, q.model.family),
    )
    return _model_outcome(table, q, tidy, model, [], adjust)


def _clmm(table: DataTable, q: Question) -> Outcome:
    if q.within:
        q.need("subject")
    elif not q.between:
        raise UsageError("the test clmm needs a within or a between factor")
    tidy = prepare(table, q, average=False)
    adjust = q.adjustment("holm", CONTRAST_WAYS)
    model = clmm(
        tidy.frame,
        q.dv,
        subject=q.subject,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing=q.missing,
        random=q.model.random or "intercept",
        nodes=q.model.nodes,
    )
    return _model_outcome(table, q, tidy, model, [], adjust)


def _model_outcome(
    table: DataTable,
    q: Question,
    tidy: TidyTable,
    model: LinearMixed | Gee | Clmm,
    path: list[str],
    adjust: str,
) -> Outcome:
    """Return the outcome of a model of single rows, contrasts of its marginal means."""
    families = _mean_contrasts(q, model, adjust)
    return _anova_outcome(table, q, tidy, model, families, path)


def _between(table: DataTable, q: Question) -> Outcome:
    q.need("between")
    if q.within:
        raise UsageError("the test anova compares groups; with within factors take rm")
    tidy = prepare(table, q)
    adjust = q.adjustment("tukey", CONTRAST_WAYS)
    anova = between_anova(
        tidy.frame,
        q.dv,
        between=q.between,
        subject=q.subject or None,
        levels=tidy.levels,
        missing="listwise" if q.missing == "listwise" else "error",
        covariates=q.model.covariates,
    )
    families = _mean_contrasts(q, anova, adjust)
    families.notes += uneven_groups(anova.design, "the test welch, for one factor")
    return _with_bayes(_anova_outcome(table, q, tidy, anova, families, []), anova)


def _anova_outcome(
    table: DataTable,
    q: Question,
    tidy: TidyTable,
    model: Anova | Gee | Clmm,
    families: _Families,
    path: list[str],
) -> Outcome:
    notes = [*model.provenance.notes, *families.notes]
    if isinstance(model, Anova):
        notes += nonlinear_scale_interactions(model.design, model.effects, q.decision.alpha)
    return outcome_of(
        table,
        q,
        model.provenance.test,
        tidy,
        model.design,
        model.rows(),
        (
            f"{model.provenance.test}, n = {model.provenance.n} {model.provenance.unit}, "
            f"error: {model.provenance.error_term}.",
            *(e.sentence() + "." for e in model.effects),
        ),
        path=(*path, *families.path),
        contrasts=tuple(families.rows),
        contrast_sentences=tuple(families.sentences),
        notes=notes,
    )


def _design_rows(tidy: TidyTable, design: Design) -> pd.DataFrame:
    return tidy.frame.iloc[design.rows].reset_index(drop=True)


def _friedman(table: DataTable, q: Question) -> Outcome:
    within = q.one_within()
    tidy = prepare(table, q)
    adjust = q.adjustment("holm", RANK_WAYS)
    design = read(tidy, q)
    frame, levels = _design_rows(tidy, design), tidy.levels[within]
    test = friedman(frame, q.dv, subject=q.subject, within=within, levels=levels)
    significant = test.p < q.decision.alpha
    path = [f"{test.sentence()}, α = {threshold_text(q.decision.alpha)} → {_verdict(significant)}"]
    pairs: tuple[SignedRankPair, ...] = ()
    if adjust != "none" and (significant or q.decision.always_posthoc):
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
        tidy,
        design,
        (test.row(),),
        (f"Friedman's test of {within} on {q.dv}: {test.sentence()}.",),
        path=tuple(path),
        contrasts=tuple({"family": within, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=test.provenance.notes,
    )


def _conditions(table: DataTable, q: Question) -> Outcome:
    within = q.one_within()
    tidy = prepare(table, q)
    adjust = q.adjustment("bonferroni", RANK_WAYS)
    design = read(tidy, q)
    comparison = compare_conditions(
        _design_rows(tidy, design),
        q.dv,
        subject=q.subject,
        within=within,
        levels=tidy.levels[within],
        alpha=q.decision.alpha,
        normality_alpha=q.decision.normality_alpha,
        adjust=cast(Adjustment, adjust),
        always_posthoc=q.decision.always_posthoc,
    )
    pairs: Any = (
        comparison.pairs.contrasts if isinstance(comparison.pairs, Contrasts) else comparison.pairs
    )
    return outcome_of(
        table,
        q,
        "Repeated-measures ANOVA" if comparison.is_parametric else "Friedman's test",
        tidy,
        design,
        (comparison.row(),),
        (comparison.sentence(),),
        path=tuple(str(s) for s in comparison.steps),
        contrasts=tuple({"family": within, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=comparison.provenance.notes,
    )


def _kruskal(table: DataTable, q: Question) -> Outcome:
    factor = q.one_between()
    tidy = prepare(table, q)
    adjust = q.adjustment("holm", RANK_WAYS)
    design = read(tidy, q)
    frame, levels = _design_rows(tidy, design), tidy.levels[factor]
    test = kruskal_wallis(frame, q.dv, factor=factor, levels=levels)
    significant = test.p < q.decision.alpha
    pairs: tuple[DunnPair, ...] = ()
    if adjust != "none" and (significant or q.decision.always_posthoc):
        pairs = dunn(frame, q.dv, factor=factor, levels=levels, adjust=cast(Adjustment, adjust))
    return outcome_of(
        table,
        q,
        "Kruskal-Wallis test",
        tidy,
        design,
        (test.row(),),
        (f"Kruskal-Wallis test of {factor} on {q.dv}: {test.sentence()}.",),
        path=(
            f"{test.sentence()}, α = {threshold_text(q.decision.alpha)} → {_verdict(significant)}",
        ),
        contrasts=tuple({"family": factor, **p.row()} for p in pairs),
        contrast_sentences=tuple(p.sentence() + "." for p in pairs),
        notes=(*test.provenance.notes, *uneven_groups(design, "the test welch")),
    )


def _welch(table: DataTable, q: Question) -> Outcome:
    factor = q.one_between()
    tidy = prepare(table, q)
    adjust = q.adjustment("tukey", CONTRAST_WAYS)
    design = read(tidy, q)
    frame, levels = _design_rows(tidy, design), tidy.levels[factor]
    test = welch_anova(frame, q.dv, factor=factor, levels=levels)
    significant = test.p < q.decision.alpha
    families = _Families(q, lambda effect: True)
    if adjust != "none" and (significant or q.decision.always_posthoc):
        way = cast(ContrastAdjustment, adjust)
        families.add(
            factor, lambda: games_howell(frame, q.dv, factor=factor, levels=levels, adjust=way)
        )
    return outcome_of(
        table,
        q,
        test.provenance.test,
        tidy,
        design,
        ({"term": factor, **test.row()},),
        (f"{factor} on {q.dv}: {test.sentence()}.",),
        path=(
            f"{factor}: {p_text(test.p)}, α = {threshold_text(q.decision.alpha)} "
            f"→ {_verdict(significant)}",
        ),
        contrasts=tuple(families.rows),
        contrast_sentences=tuple(families.sentences),
        notes=(*test.provenance.notes, *families.notes),
    )


def _refuse_method(option: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise UsageError(f"{option} takes {', '.join(choices)}, not {value!r}")


FACTORIAL_TESTS: Mapping[str, TestRun] = {
    "art": _art,
    "rm": _rm,
    "mixed": _mixed_model,
    "lmm": _lmm,
    "gee": _gee,
    "clmm": _clmm,
    "anova": _between,
    "welch": _welch,
    "friedman": _friedman,
    "conditions": _conditions,
    "kruskal": _kruskal,
}
