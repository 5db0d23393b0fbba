"""Bring a table to one row per subject and cell, and say what was done to get there."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from visavis.analysis.statistics import Design, cell_means, describe, read_design
from visavis.analysis.statistics.errors import (
    MissingCell,
    MissingValue,
    SubjectInTwoGroups,
    option_text,
)
from visavis.analysis.statistics.inputs import is_constant
from visavis.analysis.statistics.nonlinear_scales import SKEW_LIMIT
from visavis.analysis.statistics.normality import excess_kurtosis, skewness
from visavis.analysis.statistics.results import Array, Row, number
from visavis.analysis.statistics_report.outcome import Outcome, Question, Samples
from visavis.analysis.statistics_report.table_file import DataTable, natural_order
from visavis.lab.errors import UsageError

STANDARDISED_BY_SD = ("rm", "anova", "welch", "t", "paired", "conditions")
"""Tests whose effect sizes divide by a standard deviation of people."""
LONG_TAILS = 2.0
"""Excess kurtosis of residuals from which intervals of such effect sizes carry a warning."""
MAX_CELLS_DRAWN = 12
MAX_CELLS_NAMED = 6
MAX_SPREAD_RATIO = 2.0
"""Largest over smallest SD of groups from which a test of pooled spread carries a warning."""
SUBJECT_CODE = " subject"
"""Column of subject codes in frames made here; the names of a file's columns are stripped."""


@dataclass(frozen=True)
class TidyTable:
    """A frame with one row per subject and cell (or per trial), levels in their order."""

    frame: pd.DataFrame = field(repr=False)
    levels: dict[str, list[str]]
    notes: tuple[str, ...]


def prepare(table: DataTable, question: Question, *, average: bool = True) -> TidyTable:
    """Read the columns a question names; average rows repeated within subject and cell.

    Missing responses among repeated rows are left out only when the question says what to do
    with missing ones. `average` off keeps the rows, for models of single trials. Raises a
    `StatisticsError` naming row, subject and cell.
    """
    q = question
    q.need("dv")
    _refuse_roles(q)
    keys = [*([q.subject] if q.subject else []), *q.between, *q.within]
    labels = {key: table.labels(key) for key in keys}
    y = table.numbers(q.dv, _where(labels, q)) if keys else table.numbers(q.dv)
    frame = pd.DataFrame({**labels, **_covariates(table, q), q.dv: y})
    levels = {f: _levels(table, q, f, labels[f]) for f in (*q.between, *q.within)}
    notes = list(table.notes)
    for name in (q.dv, *q.model.covariates) if any(table.lines) else ():
        notes += table.remarks(name)
    frame, covariate_notes = _with_known_covariates(table, frame, q)
    notes += covariate_notes
    keys += q.model.covariates
    if q.subject:
        _refuse_two_groups(table, frame, q)
        if frame.duplicated(keys).any():
            _refuse_missing_rows(table, frame, keys, q)
            if average:
                frame, average_notes = _average_rows(frame, keys, q)
                notes += average_notes
        if q.within and q.missing == "error":
            _refuse_missing(table, frame, levels, q)
    return TidyTable(frame, levels, tuple(notes))


def _covariates(table: DataTable, q: Question) -> dict[str, Array]:
    return {name: table.numbers(name) for name in q.model.covariates}


def _with_known_covariates(
    table: DataTable, frame: pd.DataFrame, q: Question
) -> tuple[pd.DataFrame, list[str]]:
    """Return the rows whose covariates are known; unknown ones are refused unless left out."""
    notes = []
    for name in q.model.covariates:
        unknown = frame[name].isna()
        if not unknown.any():
            continue
        if q.missing != "listwise":
            row = int(np.flatnonzero(unknown)[0])
            raise MissingValue(
                f"{table.name}: {name} is missing in {table.place(row)}; repair it, or leave such "
                f"people out with {option_text('missing', 'listwise')}"
            )
        people = frame.loc[unknown, q.subject].nunique() if q.subject else int(unknown.sum())
        notes.append(f"left out: {people} without {name}")
        frame = frame[~unknown].reset_index(drop=True)
    return frame, notes


def read(tidy: TidyTable, question: Question) -> Design:
    """Return the design of a question, incomplete subjects treated as it says."""
    q = question
    if q.missing == "mixed":
        raise UsageError(
            f"the test {q.test} cannot keep subjects with missing cells; take "
            f"{option_text('missing', 'listwise')}, or the test mixed, art or lmm"
        )
    return read_design(
        tidy.frame,
        q.dv,
        subject=q.subject or None,
        within=q.within,
        between=q.between,
        levels=tidy.levels,
        missing=q.missing,
    )


def outcome_of(
    table: DataTable,
    q: Question,
    title: str,
    tidy: TidyTable,
    design: Design | None,
    rows: tuple[Row, ...],
    sentences: tuple[str, ...],
    *,
    notes: Sequence[str] = (),
    **more: Any,
) -> Outcome:
    """Return an outcome with the cells, notes, samples and rows that its design gives."""
    exclusions = () if design is None else left_out(design)
    if design is not None and q.test in STANDARDISED_BY_SD:
        notes = (*notes, *far_from_normal(design, (*rows, *more.get("contrasts", ()))))
    return Outcome(
        question=q,
        title=title,
        rows=rows,
        sentences=sentences,
        cells=() if design is None else cell_rows(design),
        notes=tuple(dict.fromkeys((*tidy.notes, *exclusions, *notes))),
        samples=() if design is None else samples_of(design),
        is_simulated=table.is_simulated,
        **{"data": None if design is None else tested_rows(design, q.subject), **more},
    )


def far_from_normal(design: Design, rows: Sequence[Row]) -> tuple[str, ...]:
    """Note that intervals of effects are widened for skewed or long-tailed residuals."""
    effects = {
        str(row["effect"])
        for row in rows
        if row.get("effect") in ("dz", "d", "η²", "η²p") and row.get("effect_ci_low") is not None
    }
    if not effects:
        return ()
    groups = [design.cells, design.subject] if design.within else [design.cells]
    away = design.y
    for codes in groups:
        away = away - (np.bincount(codes, away) / np.maximum(np.bincount(codes), 1))[codes]
    return not_normal(
        away,
        f"the noncentral intervals of {' and '.join(sorted(effects))} take them to be, and are "
        "widened",
    )


def of_two_ways(ratings: Array) -> Array:
    """Return what is left of ratings (things, raters) without the means of rows and columns."""
    rows, columns = ratings.mean(axis=1, keepdims=True), ratings.mean(axis=0, keepdims=True)
    left: Array = (ratings - rows - columns + ratings.mean()).ravel()
    return left


def not_normal(residuals: Array, what: str) -> tuple[str, ...]:
    """Note residuals that are skewed or have long tails; `what` takes them to be normal."""
    if is_constant(residuals) or float(np.abs(residuals).max()) < 1e-12:
        return ()
    skew, tails = skewness(residuals), excess_kurtosis(residuals)
    if abs(skew) <= SKEW_LIMIT and tails <= LONG_TAILS:
        return ()
    return (
        f"residuals are not normal (skewness {number(skew)}, excess kurtosis {number(tails)}), as "
        f"{what}",
    )


def left_out(design: Design) -> tuple[str, ...]:
    """Return what a design left out, as notes."""
    return tuple(f"left out: {what}" for what in design.dropped)


def cell_rows(design: Design) -> tuple[Row, ...]:
    """Describe every cell over the subjects tested, one value per subject."""
    design = average_trials(design)
    labels = {f.name: [str(f.levels[int(c)]) for c in f.codes] for f in design.factors}
    levels = {f.name: [str(v) for v in f.levels] for f in design.factors}
    columns = {**labels, design.dv: design.y}
    return tuple(c.row() for c in describe(columns, design.dv, factors=list(labels), levels=levels))


def tested_rows(design: Design, subject: str) -> pd.DataFrame:
    """Return the rows a test saw, factors as categories in the order of their levels."""
    columns: dict[str, object] = {}
    if subject:
        columns[subject] = [str(design.subjects[int(i)]) for i in design.subject]
    for factor in design.factors:
        names = [str(v) for v in factor.levels]
        columns[factor.name] = pd.Categorical.from_codes(factor.codes, pd.Index(names))
    covariates = {name: values[design.subject] for name, values in design.covariates.items()}
    return pd.DataFrame({**columns, **covariates, design.dv: design.y})


def average_trials(design: Design) -> Design:
    """Return a design of single trials with one mean per subject and cell."""
    if not design.is_repeated:
        return design
    names = [f.name for f in design.factors]
    columns = {f.name: f.codes for f in design.factors}
    trials = {SUBJECT_CODE: design.subject, **columns, design.dv: design.y}
    means = cell_means(trials, design.dv, by=(SUBJECT_CODE, *names))
    codes = {name: np.asarray(means[name], dtype=np.intp) for name in (SUBJECT_CODE, *names)}
    return replace(
        design,
        y=np.asarray(means[design.dv], dtype=np.float64),
        subject=codes[SUBJECT_CODE],
        factors=tuple(replace(f, codes=codes[f.name]) for f in design.factors),
        rows=np.arange(codes[SUBJECT_CODE].size),
        is_repeated=False,
    )


def uneven_groups(design: Design, instead: str) -> tuple[str, ...]:
    """Note groups whose spreads differ so far that pooling them, or their ranks, misleads."""
    shape = tuple(f.k for f in design.between)
    group = np.ravel_multi_index(design.group_of_subject, shape)
    person = np.bincount(design.subject, design.y) / np.bincount(design.subject)
    spreads = [
        (float(person[group == g].std(ddof=1)), int((group == g).sum())) for g in np.unique(group)
    ]
    return _if_uneven(spreads, "SD", instead)


def uneven_changes(design: Design) -> tuple[str, ...]:
    """Note groups in which people's differences between conditions spread differently far.

    Interactions of group and condition pool them. Nothing without both kinds of factors.
    """
    if not design.between or not design.within or not design.is_complete:
        return ()
    group = np.ravel_multi_index(design.group_of_subject, tuple(f.k for f in design.between))
    table = design.table(design.y).reshape(design.n, -1)
    off = table - table.mean(axis=1, keepdims=True)
    spreads = []
    for g in np.unique(group):
        own = off[group == g]
        df = (len(own) - 1) * (own.shape[1] - 1)
        if df == 0:
            return ()
        spreads.append((float(np.sqrt(((own - own.mean(axis=0)) ** 2).sum() / df)), len(own)))
    return _if_uneven(
        spreads,
        "the SD of people's differences between conditions",
        "each group by itself, or the groups' differences by the test t, which is Welch's",
    )


def _if_uneven(spreads: Sequence[tuple[float, int]], what: str, instead: str) -> tuple[str, ...]:
    """Note spreads of groups, each with its size, that differ too far to be pooled."""
    (low, n_low), (high, n_high) = min(spreads), max(spreads)
    if high < MAX_SPREAD_RATIO * low or n_low == n_high:
        return ()
    return (
        f"{what} is {number(high)} in a group of {n_high} and {number(low)} in one of {n_low}; "
        "with unequal sizes this test then finds differences that are not there, or misses some: "
        f"take {instead}",
    )


def samples_of(design: Design) -> tuple[Samples, ...]:
    """Return what to draw: each factor with the others averaged, and the cells of two.

    Nothing where subjects lack cells.
    """
    if not design.is_complete:
        return ()
    design = average_trials(design)
    table = design.table(design.y)
    within = design.within
    samples = []
    for axis, factor in enumerate(within):
        others = tuple(i + 1 for i in range(len(within)) if i != axis)
        means: Array = table.mean(axis=others) if others else table
        by_level = {str(v): means[:, i] for i, v in enumerate(factor.levels)}
        samples.append(Samples(factor.name, f"{design.dv} by {factor.name}", by_level))
    person: Array = table.reshape(design.n, -1).mean(axis=1)
    for factor, codes in zip(design.between, design.group_of_subject, strict=True):
        by_level = {str(v): person[codes == i] for i, v in enumerate(factor.levels)}
        samples.append(
            Samples(factor.name, f"{design.dv} by {factor.name}", by_level, paired=False)
        )
    cells = int(np.prod([f.k for f in within])) if len(within) == 2 else 0
    if 0 < cells <= MAX_CELLS_DRAWN:
        both = list(product(*(f.levels for f in within)))
        flat = table.reshape(design.n, -1)
        name = "_x_".join(f.name for f in within)
        title = f"{design.dv} by {' and '.join(f.name for f in within)}"
        samples.append(
            Samples(name, title, {f"{a}\n{b}": flat[:, i] for i, (a, b) in enumerate(both)})
        )
    return tuple(samples)


def _refuse_roles(q: Question) -> None:
    roles = [q.dv, *([q.subject] if q.subject else []), *q.between, *q.within]
    for name in roles:
        if roles.count(name) > 1:
            raise UsageError(f"column {name} is named in two roles; give each column one")
    for name in q.levels:
        if name not in (*q.between, *q.within):
            raise UsageError(f"levels names {name}, which is no factor of this test")


def _levels(table: DataTable, q: Question, factor: str, labels: Sequence[str]) -> list[str]:
    if factor in q.levels:
        return [str(level) for level in q.levels[factor]]
    return list(table.levels.get(factor, ())) or natural_order(labels)


def _where(labels: dict[str, list[str]], q: Question) -> list[str]:
    columns = []
    for key, values in labels.items():
        word = "subject" if key == q.subject else key
        columns.append([f"{word} {v}" for v in values])
    return [", ".join(row) for row in zip(*columns, strict=True)]


def _refuse_two_groups(table: DataTable, frame: pd.DataFrame, q: Question) -> None:
    for factor in q.between:
        for name, rows in frame.groupby(q.subject, sort=False)[factor]:
            if rows.nunique() > 1:
                other = rows.index[rows != rows.iloc[0]][0]
                raise SubjectInTwoGroups(
                    f"{table.name}: subject {name} is {factor} {rows.iloc[0]} in "
                    f"{table.place(int(rows.index[0]))} and {rows[other]} in "
                    f"{table.place(int(other))}; make {factor} a within factor, or repair the rows"
                )


def _refuse_missing(
    table: DataTable, frame: pd.DataFrame, levels: dict[str, list[str]], q: Question
) -> None:
    keys = [q.subject, *q.within]
    there = set(frame.loc[frame[q.dv].notna(), keys].itertuples(index=False, name=None))
    rows = set(frame[keys].itertuples(index=False, name=None))
    people = list(dict.fromkeys(frame[q.subject]))
    empty_cells = [
        cell for cell in product(people, *(levels[f] for f in q.within)) if cell not in there
    ]
    if not empty_cells:
        return
    descriptions = [
        ", ".join(
            [f"subject {cell[0]}", *(f"{f} {v}" for f, v in zip(q.within, cell[1:], strict=True))]
        )
        + (f" (no {q.dv} in its row)" if cell in rows else " (no row)")
        for cell in empty_cells[:MAX_CELLS_NAMED]
    ]
    n_more = len(empty_cells) - len(descriptions)
    more = f" and {n_more} more" if n_more else ""
    cells = f"{len(empty_cells)} cell{'s' if len(empty_cells) > 1 else ''}"
    raise MissingCell(
        f"{table.name}: {q.dv} is missing in {cells}: {'; '.join(descriptions)}{more}. "
        f"Repair them, or drop these subjects with {option_text('missing', 'listwise')}, or "
        f"keep what is there with {option_text('missing', 'mixed')} (tests art, mixed, lmm and gee)"
    )


def _refuse_missing_rows(
    table: DataTable, frame: pd.DataFrame, keys: list[str], q: Question
) -> None:
    rows_without_value = frame[frame[q.dv].isna()]
    if len(rows_without_value) and q.missing == "error":
        row = int(rows_without_value.index[0])
        where = ", ".join(
            f"{'subject' if k == q.subject else k} {rows_without_value.iloc[0][k]}" for k in keys
        )
        raise MissingValue(
            f"{table.name}: {q.dv} is missing in {table.place(row)} ({where})"
            + (
                f" and {len(rows_without_value) - 1} more rows"
                if len(rows_without_value) > 1
                else ""
            )
            + "; repair them, or average the rows that are there with "
            f"{option_text('missing', 'listwise')} (then dropping subjects "
            f"without a value in some cell) or {option_text('missing', 'mixed')}"
        )


def _average_rows(
    frame: pd.DataFrame, keys: list[str], q: Question
) -> tuple[pd.DataFrame, list[str]]:
    n_missing = int(frame[q.dv].isna().sum())
    groups = frame.groupby(keys, sort=True, observed=True)[q.dv]
    sizes = groups.size()
    low, high = int(sizes.min()), int(sizes.max())
    each = f"{low}" if low == high else f"{low} to {high}"
    notes = [
        f"{len(frame)} rows averaged to {len(sizes)}, one per {q.subject} and cell ({each} rows "
        "each); a test of the single rows would take repetitions for people"
    ]
    if n_missing:
        notes.append(f"{n_missing} rows without {q.dv} were left out of these means")
    return groups.mean().reset_index(), notes
