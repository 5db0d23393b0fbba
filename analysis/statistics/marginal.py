"""Compare marginal means of a fitted model: cells of some factors, the others averaged.

Every contrast, of whatever test, is a weighted sum of the cells of the design (all levels of all
factors). A `CellModel` says what such sums are, how far they may be off and with how many degrees
of freedom; all else here is the same for every model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Literal, Protocol, TypeAlias, get_args

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.anova import Anova
from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    LevelPairs,
    contrast_family,
    pair_labels,
    pair_matrix,
    pairs_text,
)
from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.effects import Tails, standardised_mean, tails_of
from visavis.analysis.statistics.errors import ConstantResponse, UnknownMethod, option_text
from visavis.analysis.statistics.linear import FittedModel
from visavis.analysis.statistics.mixed import RandomIntercept, level_rows
from visavis.analysis.statistics.results import Array, Effect, Interval, Provenance
from visavis.analysis.statistics.strata import Strata

CellWeights: TypeAlias = Literal["equal", "proportional", "cells"]
"""How cells of the other factors count in a mean: alike, by how many rows those factors' cells hold
over all levels, or by how many rows each cell holds (then the mean of all rows of a level, where
nobody lacks a cell)."""
ContrastError: TypeAlias = Literal["per_pair", "pooled"]
NO_SPREAD = 1e-24
"""Variance, as a share of the squared values, that is left of rounding where there is none."""


@dataclass(frozen=True)
class Comparison:
    """Weighted sums of cells: estimates (m,), covariance (m, m), df (m,), and effect sizes."""

    estimates: Array
    covariance: Array
    dfs: Array
    effects: tuple[Effect | None, ...]


class CellModel(Protocol):
    """A fitted model that can compare the cells of its design."""

    @property
    def design(self) -> Design:
        """The design whose cells are compared."""

    def compare(self, C: Array) -> Comparison:
        """Return the sums of cells with weights C (m, cells), cells in the design's order."""

    def varies(self, C: Array) -> npt.NDArray[np.bool_]:
        """Tell of each of these sums whether it has an error to be tested against."""

    def error_of(self, C: Array) -> str:
        """Return the words for the error of these sums; empty where the model's own say it."""


@dataclass(frozen=True)
class FixedEffects:
    """Cells of a model with sum-coded fixed effects (mixed, gee, clmm), on the model's scale.

    `scale` names the model's scale where it is not that of the response; `error` the error, where
    it is not that of the table; `ratio` and `sd` say what the effect size of a contrast is, as in
    `estimate_effect`, and without either there is none.
    """

    design: Design
    model: FittedModel
    scale: str = ""
    error: str = ""
    ratio: str = ""
    sd: float = 0.0

    def compare(self, C: Array) -> Comparison:
        """Return Lβ of the rows that these sums of cells have in the model."""
        L = C @ level_rows(self.design, [f.name for f in self.design.factors])
        estimates = L @ self.model.beta
        covariance = L @ self.model.covariance @ L.T
        dfs = np.array([self.model.test(row[None, :])[1] for row in L])
        ses = np.sqrt(np.diag(covariance))
        effects: tuple[Effect | None, ...] = (None,) * len(L)
        if self.ratio or self.sd:
            tails = tails_of(self.design.around_cell_means(self.design.y), people=self.design.n)
            effects = tuple(
                estimate_effect(
                    float(e), float(s), float(d), ratio=self.ratio, sd=self.sd, tails=tails
                )
                for e, s, d in zip(estimates, ses, dfs, strict=True)
            )
        return Comparison(estimates, covariance, dfs, effects)

    def varies(self, C: Array) -> npt.NDArray[np.bool_]:
        """Every sum does: a model without an error is refused when it is fitted."""
        return np.ones(len(C), dtype=np.bool_)

    def error_of(self, C: Array) -> str:
        """Return the error's name, the same for all sums."""
        return self.error


@dataclass(frozen=True)
class GroupCells:
    """Cells of a complete design: the linear model of people's cells, groups with own means.

    The response `y` has one value per row of the design. `error` "own" is the spread of just the
    differences compared, within groups, with n − groups df; "strata" takes the errors of the
    effects that a contrast consists of, which trusts sphericity; "one" pools all within effects.
    """

    design: Design
    subject: str
    y: Array
    error: Literal["own", "strata", "one"] = "own"

    def compare(self, C: Array) -> Comparison:
        """Return sums of cell means, groups of unequal size with their own weight in the error."""
        design = self.design
        if not design.is_complete:
            raise UnknownMethod(
                "cells are missing; contrasts need a mixed model, "
                + option_text("missing", "mixed")
            )
        strata = Strata(design, self.subject)
        table = design.table(self.y).reshape(design.n, -1)
        sizes = design.group_sizes
        weights = C.reshape(len(C), sizes.size, -1)
        means = strata.group_means(table).reshape(sizes.size, -1)
        estimates = np.einsum("mgw,gw->m", weights, means)
        if self.error != "own":
            covariance, dfs = self._of_strata(strata, weights)
            return Comparison(estimates, covariance, dfs, (None,) * len(C))
        away = strata.residuals(table)
        df = strata.df
        spread = away.T @ away / df
        of_groups = strata.group_covariance
        covariance = np.einsum("mgw,wv,lhv,gh->ml", weights, spread, weights, of_groups)
        ses = np.sqrt(np.diag(covariance))
        effects = tuple(
            _standardised(float(e), float(s), df, w, away)
            for e, s, w in zip(estimates, ses, weights, strict=True)
        )
        return Comparison(estimates, covariance, np.full(len(C), float(df)), effects)

    def varies(self, C: Array) -> npt.NDArray[np.bool_]:
        """Tell of each sum whether people differ in it, within their groups."""
        if self.error != "own":
            return np.ones(len(C), dtype=np.bool_)
        strata = Strata(self.design, self.subject)
        table = self.design.table(self.y).reshape(self.design.n, -1)
        weights = C.reshape(len(C), self.design.group_sizes.size, -1)
        # Sums of each person: from the covariance of cells more float noise would be left.
        own = np.einsum("nw,mgw->mgn", strata.residuals(table), weights)
        spread = np.einsum("mgn,gh,mhn->m", own, strata.group_covariance, own) / strata.df
        return np.asarray(spread > NO_SPREAD * float(np.abs(table).max()) ** 2)

    def _of_strata(self, strata: Strata, weights: Array) -> tuple[Array, Array]:
        """Return covariance and Satterthwaite's df from the mean squares of the strata."""
        of_groups = strata.group_covariance
        table = self.design.table(self.y)
        parts, dfs = [], []
        for basis, mean_square, df, _ in self._strata(strata, table):
            scores = weights @ basis
            parts.append(mean_square * np.einsum("mgq,lhq,gh->ml", scores, scores, of_groups))
            dfs.append(df)
        variances = np.array([np.diag(part) for part in parts])
        total = variances.sum(axis=0)
        inverse = (variances**2 / np.array(dfs, dtype=float)[:, None]).sum(axis=0)
        return np.sum(parts, axis=0), total**2 / inverse

    def _strata(self, strata: Strata, table: Array) -> list[tuple[Array, float, int, str]]:
        """Return orthonormal within contrasts, mean square, df and name of every stratum."""
        names = [f.name for f in self.design.within]
        unit = np.eye(table[0].size).reshape(-1, *table.shape[1:])
        terms = [t for size in range(len(names) + 1) for t in combinations(names, size)]
        errors = []
        for term in terms:
            stratum = strata.test(table, term)
            square, df, name = stratum.ss_error / stratum.df2, stratum.df2, stratum.error_term
            if term and self.error == "one":
                ss, df = strata.pooled_within_error(table)
                square, name = ss / df, "Within, pooled"
            errors.append((strata.scores(unit, term), square, df, name))
        return errors

    def error_of(self, C: Array) -> str:
        """Return which spread or which strata these sums of cells are judged by."""
        weights = C.reshape(len(C), self.design.group_sizes.size, -1)
        if self.error == "own":
            is_within = np.abs(weights.sum(axis=2)).max() < 1e-9
            return "differences of the two levels" if is_within else "spread within groups"
        strata = Strata(self.design, self.subject)
        names = [
            name
            for basis, _, _, name in self._strata(strata, self.design.table(self.y))
            if np.abs(weights @ basis).max() > 1e-9
        ]
        return " and ".join(dict.fromkeys(names)) + ", pooled over levels"


def _standardised(
    estimate: float, se: float, df: int, weights: Array, away: Array
) -> Effect | None:
    """Return a sum of cells (groups, within cells) over the SD of people's own sums, in groups.

    `away` (people, within cells) are values less their group's means.

    It is dz where conditions are compared, d where groups are, or groups' differences between
    conditions. Cells of different groups *and* conditions have no one SD, and no effect size.
    """
    left, values, right = np.linalg.svd(weights)
    if values.size > 1 and values[1] > 1e-9 * values[0]:
        return None
    groups, cells = left[:, 0], right[0]
    name = "d"
    if abs(cells.sum()) > 1e-9:  # groups compared on people's means
        unit = cells / cells.sum()
    else:
        name = "dz" if abs(groups.sum()) > 1e-9 else "d"
        of_group = groups.sum() if name == "dz" else np.abs(groups).sum() / 2
        unit = cells * values[0] * of_group
    own = away @ unit
    sd = float(np.sqrt((own**2).sum() / df))
    is_within = bool(abs(cells.sum()) <= 1e-9)
    tails = tails_of(own, of_differences=is_within, of_one_mean=name == "dz")
    return standardised_mean(name, estimate / se, df, se / sd, value=estimate / sd, tails=tails)


class ModelTable(Protocol):
    """A table of tests with the model of cells that they are tests of."""

    @property
    def cell_model(self) -> CellModel:
        """The model."""

    @property
    def provenance(self) -> Provenance:
        """Where its numbers come from."""


def cell_model(table: Anova | ModelTable, error: ContrastError = "per_pair") -> CellModel:
    """Return what compares the cells of a fitted ANOVA or model."""
    if error not in get_args(ContrastError):
        raise UnknownMethod(f"no error {error!r}; use 'per_pair' or 'pooled'")
    if not isinstance(table, Anova):
        return table.cell_model
    if table.model is not None:
        return FixedEffects(table.design, table.model, sd=table.model.total_sd)
    own: Literal["own", "strata"] = "own" if error == "per_pair" else "strata"
    return GroupCells(table.design, table.subject, table.design.y, own)


def posthoc(
    table: Anova | ModelTable,
    term: str | Sequence[str],
    *,
    error: ContrastError = "per_pair",
    adjust: ContrastAdjustment = "holm",
    weights: CellWeights = "equal",
) -> Contrasts:
    """Compare all pairs of levels of a factor, or of cells of several, by the model of an ANOVA.

    Means are those of the model that the ANOVA fits, with all its factors (estimated marginal
    means); `weights` says how cells of the other factors count. `error` "per_pair" is the spread
    of the very differences compared within groups (for one within factor the paired t test), df
    n − groups; "pooled" takes the errors of the effects' own strata and trusts sphericity. A mixed
    model has one error of its own. The provenance says which it is.

    The effect size of conditions is dz and that of groups d, both by the SD within groups; mixed
    models have d_total.
    """
    model = cell_model(table, error)
    provenance = _provenance(table.provenance, model)
    return cell_contrasts(model, term, provenance=provenance, adjust=adjust, weights=weights)


def simple_effects(
    table: Anova | ModelTable,
    term: str | Sequence[str],
    by: str | Sequence[str],
    *,
    error: ContrastError = "per_pair",
    adjust: ContrastAdjustment = "holm",
    weights: CellWeights = "equal",
) -> tuple[Contrasts, ...]:
    """Compare levels at each cell of other factors, every cell a family of its own.

    Options are those of `posthoc`; the families' provenances name the cell.
    """
    model = cell_model(table, error)
    design = model.design
    names, at = design.term(term), design.term(by)
    if set(names) & set(at):
        raise UnknownMethod(f"{':'.join(names)} cannot be compared at levels of its own factors")
    labels = _labels(design, names)
    cells = list(product(*(design.factor(n).levels for n in at)))
    # Cells of both together, with the factors compared before those at whose cells they are.
    every = mean_weights(design, (*names, *at), weights).reshape(len(labels), len(cells), -1)
    families = []
    for i, cell in enumerate(cells):
        where = ", ".join(f"{n} = {v}" for n, v in zip(at, cell, strict=True))
        provenance = _provenance(table.provenance, model, f" at {where}")
        C = pair_matrix(len(labels)) @ every[:, i]
        pairs = pair_labels(labels)
        families.append(_family(model, names, pairs, C, len(labels), provenance, adjust))
    return tuple(families)


def interaction_contrasts(
    table: Anova | ModelTable,
    term: str | Sequence[str],
    *,
    error: ContrastError = "per_pair",
    adjust: ContrastAdjustment = "holm",
    weights: CellWeights = "equal",
) -> Contrasts:
    """Compare differences of differences of an interaction; options are those of `posthoc`."""
    model = cell_model(table, error)
    provenance = _provenance(table.provenance, model)
    return cell_contrasts(
        model, term, double=True, provenance=provenance, adjust=adjust, weights=weights
    )


def linear_hypotheses(
    table: Anova | ModelTable,
    term: str | Sequence[str],
    hypotheses: Mapping[str, Mapping[str, float]],
    *,
    error: ContrastError = "per_pair",
    adjust: ContrastAdjustment = "holm",
    weights: CellWeights = "equal",
) -> Contrasts:
    """Test that sums of marginal means are zero: name → level (of several, "a1,b2") → weight.

    `linear_hypotheses(table, "dose", {"linear trend": {"low": -1, "high": 1}})`. Levels left out
    weigh 0. Options are those of `posthoc`. Raises `UnknownMethod` for a level that is not there.
    """
    model = cell_model(table, error)
    names = model.design.term(term)
    labels = _labels(model.design, names)
    rows = np.zeros((len(hypotheses), len(labels)))
    for row, (name, of_level) in zip(rows, hypotheses.items(), strict=True):
        for level, weight in of_level.items():
            if level not in labels:
                raise UnknownMethod(
                    f"{name}: no level {level!r} of {':'.join(names)}; there are "
                    f"{', '.join(labels)}"
                )
            row[labels.index(level)] = weight
        if not row.any():
            raise UnknownMethod(f"{name}: all weights are 0")
    C = rows @ mean_weights(model.design, names, weights)
    provenance = _provenance(table.provenance, model)
    return _family(model, names, list(hypotheses), C, len(labels), provenance, adjust)


def cell_contrasts(
    model: CellModel,
    term: str | Sequence[str],
    *,
    double: bool = False,
    provenance: Provenance,
    adjust: ContrastAdjustment = "holm",
    weights: CellWeights = "equal",
    effects: Sequence[Effect | None] | None = None,
) -> Contrasts:
    """Compare the levels of a factor, or the cells of several, by any model of cells.

    All pairs, or with `double` the differences of differences of an interaction.
    """
    design = model.design
    names = design.term(term)
    if double and len(names) < 2:
        raise UnknownMethod(f"{names[0]} is a main effect; its levels are compared in pairs")
    # In pairs the cells are the levels of one joined factor; else every factor has its own pairs.
    sides = [_labels(design, (n,)) for n in names] if double else [_labels(design, names)]
    L: Array = np.ones((1, 1))
    for side in sides:
        L = np.asarray(np.kron(L, pair_matrix(len(side))), dtype=np.float64)
    pairs = list(product(*(combinations(side, 2) for side in sides)))
    C = L @ mean_weights(design, names, weights)
    return _family(model, names, pairs, C, L.shape[1], provenance, adjust, effects)


def mean_weights(design: Design, names: Sequence[str], weights: CellWeights = "equal") -> Array:
    """Return the weights of all cells in the mean of every level of some factors, (levels, cells).

    Levels are in the order of `names`, cells in the design's; of both the last factor's levels are
    neighbours.
    """
    if weights not in get_args(CellWeights):
        raise UnknownMethod(
            f"no weights {weights!r}; use one of {', '.join(get_args(CellWeights))}"
        )
    shape = tuple(f.k for f in design.factors)
    count = int(np.prod(shape))
    codes = np.unravel_index(np.arange(count), shape)
    order = [f.name for f in design.factors]
    sizes = tuple(design.factor(n).k for n in names)
    level = np.ravel_multi_index(tuple(codes[order.index(n)] for n in names), sizes)
    is_in = level[None, :] == np.arange(int(np.prod(sizes)))[:, None]
    rows = np.ones(count)
    if weights != "equal":
        rows = np.bincount(design.cells, minlength=count).astype(np.float64)
    if weights == "proportional":
        others = [i for i, n in enumerate(order) if n not in names]
        rest = np.zeros(count, dtype=np.intp)
        for i in others:
            rest = rest * shape[i] + codes[i]
        rows = np.asarray(np.bincount(rest, weights=rows), dtype=np.float64)[rest]
    by_cell = is_in * rows
    return np.asarray(by_cell / by_cell.sum(axis=1, keepdims=True), dtype=np.float64)


def estimate_effect(
    estimate: float,
    se: float,
    df: float,
    *,
    ratio: str = "",
    sd: float = 0.0,
    tails: Tails | None = None,
) -> Effect:
    """Return the effect size of a difference on a model's scale, with an interval from its t.

    `ratio` names what exp(estimate) is, for models of a logarithm ("odds ratio"). Otherwise it is
    d = estimate / `sd`, the SD of a single response from all sources together (Westfall, Kenny and
    Judd 2014), with the noncentral t interval, in which `sd` is taken for known, widened for
    `tails`.
    """
    if ratio:
        reach = float(special.stdtrit(df, 0.975)) * se
        low, value, high = (
            float(np.exp(v)) for v in (estimate - reach, estimate, estimate + reach)
        )
        return Effect(ratio, value, Interval(low, high))
    return standardised_mean(
        "d_total", estimate / se, df, se / sd, value=estimate / sd, tails=tails
    )


def _labels(design: Design, names: Sequence[str]) -> list[str]:
    return [",".join(map(str, v)) for v in product(*(design.factor(n).levels for n in names))]


def _provenance(table: Provenance, model: CellModel, where: str = "") -> Provenance:
    """Return what contrasts of a table say of themselves; the family adds the error of cells."""
    test, error_term = "marginal means", ""
    if isinstance(model, FixedEffects):
        test += f" ({model.scale} scale)" if model.scale else ""
        error_term = table.error_term
    elif isinstance(model, GroupCells) and model.error != "own":
        test += ", stratum error"
    return replace(table, test=test + where, error_term=error_term, correction="none", notes=())


def _family(
    model: CellModel,
    names: Sequence[str],
    contrasts: Sequence[LevelPairs | str],
    C: Array,
    k: int,
    provenance: Provenance,
    adjust: ContrastAdjustment,
    effects: Sequence[Effect | None] | None = None,
) -> Contrasts:
    varies = model.varies(C)
    notes = provenance.notes
    if not varies.all():
        alike = [one for one, has_error in zip(contrasts, varies, strict=True) if not has_error]
        names_of = ", ".join(one if isinstance(one, str) else pairs_text(one) for one in alike)
        problem = (
            f"{names_of} not compared: {model.design.dv} differs by the same amount in all "
            "subjects, so t has no error (tests of ranks need none)"
        )
        if not varies.any():
            raise ConstantResponse(problem)
        notes, C = (*notes, problem), C[varies]
        contrasts = [one for one, has_error in zip(contrasts, varies, strict=True) if has_error]
        if effects is not None:
            effects = [one for one, has_error in zip(effects, varies, strict=True) if has_error]
    comparison = model.compare(C)
    ses = np.sqrt(np.diag(comparison.covariance))
    fit = model.model if isinstance(model, FixedEffects) else None
    if isinstance(fit, RandomIntercept) and fit.is_singular:
        notes = (*notes, "the random intercept has no variance (singular fit)")
    return contrast_family(
        names,
        contrasts,
        comparison.estimates,
        ses,
        comparison.dfs,
        k=k,
        provenance=replace(
            provenance, error_term=provenance.error_term or model.error_of(C), notes=notes
        ),
        adjustment=adjust,
        effects=comparison.effects if effects is None else effects,
        correlation=comparison.covariance / np.outer(ses, ses),
    )
