"""How often a test finds effects that are not there, in data like those at hand."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
from scipy import special

from visavis.analysis.statistics.art import normal_scores
from visavis.analysis.statistics.design import Design, read_design
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.power_estimates import proportion_interval
from visavis.analysis.statistics.results import Array, Row
from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.prepare import prepare
from visavis.analysis.statistics_report.table_file import DataTable, table_of
from visavis.lab.errors import UsageError

NOMINAL = (0.6, 1.4)
"""Range of rates, in units of α, that counts as holding the level (.03 to .07 at .05)."""
MIN_GROUP = 3
"""Fewest people with all cells in every group, so that their spread can be estimated."""
TRIAL_TESTS = ("lmm", "gee", "clmm")
"""Tests that take several rows per subject and cell as they are."""
NOT_OF_MEASURES = ("bradleyterry", "icc", "krippendorff", "kappa")
Answer = Callable[[DataTable, Question], Outcome]


def error_rates(
    table: DataTable, question: Question, test: Answer, rng: np.random.Generator, n_studies: int
) -> tuple[Row, ...]:
    """Simulate studies like the one at hand in which one effect at a time is taken away.

    Cells, group sizes, missing cells, ties, bounds and skew are those of the data: the response is
    a monotone step or curve of a normal latent score, fitted by ranks; latent people vary and
    covary over conditions as found. For each effect its latent contribution and that of the
    interactions it is part of are removed, all others stay. Returns one row per effect: `rate` of
    studies with p below α and its interval, `expected` α, `holds`, and studies refused.

    Raises UsageError for tests without factors, and for too few people to estimate their spread.
    """
    if not question.within and not question.between:
        raise UsageError("error rates are simulated for tests with a within or between factor")
    if question.test in NOT_OF_MEASURES:
        raise UsageError(f"error rates are simulated for measures; {question.test} tests none")
    tidy = prepare(table, question)
    if question.test in TRIAL_TESTS and prepare(table, question, average=False).frame.shape != (
        tidy.frame.shape
    ):
        raise UsageError(
            f"error rates are simulated for one row per {question.subject} and cell; average the "
            f"rows, or ask the test rm, which takes their means (not {question.test})"
        )
    design = read_design(
        tidy.frame,
        question.dv,
        subject=question.subject or None,
        within=question.within,
        between=question.between,
        levels=tidy.levels,
        missing=question.missing,
    )
    complete_question = replace(
        question,
        decision=replace(question.decision, posthoc="none"),
        levels={f.name: [str(v) for v in f.levels] for f in design.factors},
        missing="listwise" if question.missing == "error" else question.missing,  # none is missing
    )
    # For every term: simulate studies without it and count how often the test finds it.
    people = _People(design, question.subject)
    rows: list[Row] = []
    for term in _tested_terms(design, test, table, complete_question):
        hits = n_tested = n_refused = 0
        for frame in people.studies(term, rng, n_studies):
            try:
                outcome = test(table_of(frame, name="a simulated study"), complete_question)
            except StatisticsError:
                n_refused += 1
                continue
            n_tested += 1
            hits += _p(outcome, term) < question.decision.alpha
        interval = proportion_interval(hits, max(n_tested, 1))
        rate = hits / max(n_tested, 1)
        low_limit, high_limit = (bound * question.decision.alpha for bound in NOMINAL)
        rows.append(
            {
                "term": ":".join(term),
                "rate": rate,
                "low": interval.low,
                "high": interval.high,
                "expected": question.decision.alpha,
                "holds": bool(interval.low <= high_limit and interval.high >= low_limit),
                "studies": n_tested,
                "refused": n_refused,
            }
        )
    return tuple(rows)


def error_rate_notes(rows: tuple[Row, ...]) -> tuple[str, ...]:
    """Say which effects the test finds too often or too rarely in data like these."""
    notes = []
    for row in rows:
        if not row["holds"]:
            often = (
                "too often" if float(row["rate"] or 0) > float(row["expected"] or 0) else "rarely"
            )
            notes.append(
                f"{row['term']}: in {100 * float(row['rate'] or 0):.1f} % of {row['studies']} "
                f"simulated studies like this one, without that effect, it is found ({often}; "
                f"{100 * float(row['expected'] or 0):g} % expected)"
            )
    return tuple(notes)


def _tested_terms(
    design: Design, test: Answer, table: DataTable, question: Question
) -> tuple[tuple[str, ...], ...]:
    """Return the terms a test has rows of; one factor alone where its rows have none."""
    rows = test(table, question).rows
    terms = {str(row["term"]) for row in rows if "term" in row}
    if not terms:
        return (tuple(f.name for f in design.factors[:1]),)
    return tuple(t for t in design.terms if ":".join(t) in terms)


def _p(outcome: Outcome, term: tuple[str, ...]) -> float:
    """Return p of a term, or the smallest adjusted p of a family of pairs."""
    if "term" in outcome.rows[0]:
        return outcome.p(":".join(term))
    return min(replace(outcome, rows=(row,)).p() for row in outcome.rows)


class _People:
    """Latent means, people's deviations from them, and the way back to the response."""

    def __init__(self, design: Design, subject: str) -> None:
        self._subject = subject
        scores = normal_scores(design.y)
        self._design = design
        shape = tuple(f.k for f in design.factors)
        sums = np.bincount(design.cells, scores, minlength=int(np.prod(shape)))
        means = sums / np.bincount(design.cells, minlength=sums.size)
        self._means = means.reshape(shape)
        inside = tuple(f.k for f in design.within)
        n_cells = int(np.prod(inside))
        place = np.zeros(design.y.size, dtype=np.intp)
        if inside:
            place = np.ravel_multi_index(tuple(f.codes for f in design.within), inside)
        deviations = np.full((design.n, n_cells), np.nan)
        deviations[design.subject, place] = scores - means[design.cells]
        outside = tuple(f.k for f in design.between)
        group = np.zeros(design.n, dtype=np.intp)
        if outside:
            group = np.ravel_multi_index(design.group_of_subject, outside)
        complete = ~np.isnan(deviations).any(axis=1)
        self._group, self._n_cells = group, n_cells
        self._has_value = ~np.isnan(deviations)
        self._deviations = []
        for code in range(int(np.prod(outside, dtype=int))):
            own = deviations[(group == code) & complete]
            if own.shape[0] < MIN_GROUP:
                raise UsageError(
                    f"{own.shape[0]} people of a group have all cells; {MIN_GROUP} are needed to "
                    "simulate people like them"
                )
            own = own - own.mean(axis=0)
            self._deviations.append(own / np.sqrt(own.shape[0] - 1))
        self._response = _response_of(design.y)

    def studies(
        self, term: tuple[str, ...], rng: np.random.Generator, n_studies: int
    ) -> Iterator[pd.DataFrame]:
        """Yield tidy frames of studies in which a term has no effect."""
        design = self._design
        means = _without(self._means, [f.name for f in design.factors], term)
        by_group = means.reshape(len(self._deviations), self._n_cells)
        who, cell = np.nonzero(self._has_value)
        columns: dict[str, object] = {self._subject: who} if self._subject else {}
        for axis, factor in enumerate(design.between):
            codes = design.group_of_subject[axis][who]
            columns[factor.name] = [str(factor.levels[int(c)]) for c in codes]
        inside = np.unravel_index(cell, tuple(f.k for f in design.within) or (1,))
        for factor, codes in zip(design.within, inside, strict=False):
            columns[factor.name] = [str(factor.levels[int(c)]) for c in codes]
        for _ in range(n_studies):
            latent = np.empty((design.n, self._n_cells))
            for code, own in enumerate(self._deviations):
                members = np.flatnonzero(self._group == code)
                deviations = rng.normal(size=(members.size, own.shape[0])) @ own
                latent[members] = by_group[code] + deviations
            y = self._response(latent[who, cell])
            yield pd.DataFrame({**columns, design.dv: y})


def _without(means: Array, names: list[str], term: tuple[str, ...]) -> Array:
    """Return cell means less a term and all interactions that hold it."""
    others = [n for n in names if n not in term]
    left = means.copy()
    for size in range(len(others) + 1):
        for more in combinations(others, size):
            part = means
            for axis, name in enumerate(names):
                average = part.mean(axis=axis, keepdims=True)
                part = (
                    part - average
                    if name in (*term, *more)
                    else np.repeat(average, part.shape[axis], axis=axis)
                )
            left -= part
    return left


def _response_of(y: Array) -> Callable[[Array], Array]:
    """Return the monotone way from latent scores to the response.

    Steps between the values where half or more are tied, else a line through all of them, drawn
    on beyond the ends.
    """
    values, counts = np.unique(y, return_counts=True)
    if values.size <= y.size / 2:
        thresholds = special.ndtri(np.cumsum(counts)[:-1] / y.size)
        return lambda z: values[np.searchsorted(thresholds, z)]
    scores = special.ndtri((np.cumsum(counts) - counts / 2 + 0.125) / (y.size + 0.25))
    ends = max(1, values.size // 20)
    low = (values[ends] - values[0]) / (scores[ends] - scores[0])
    high = (values[-1] - values[-1 - ends]) / (scores[-1] - scores[-1 - ends])

    def curve(z: Array) -> Array:
        beyond = np.minimum(z - scores[0], 0) * low + np.maximum(z - scores[-1], 0) * high
        return np.asarray(np.interp(z, scores, values) + beyond, dtype=np.float64)

    return curve
