"""From the rows of a study's trials to cell means and an answer to each comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import pandas as pd

from analysis.statistics import adjust_p
from analysis.statistics_report import Outcome, answer
from lab.errors import DataError, LabError
from protocol.steps import Scalar
from visavis.compare import Compare
from visavis.exclusions import Selection
from visavis.measures import Measure, aggregated
from visavis.study import Study

SIMULATED_COLUMN: Final = "is_simulated"
MIN_PARTICIPANTS: Final = 3
"""Below this nothing is tested."""


@dataclass(frozen=True)
class Term:
    """One effect of a comparison: its p, and its p corrected over the family."""

    name: str
    p: float
    p_corrected: float
    alpha: float
    row: Mapping[str, Any] = field(repr=False)

    @property
    def is_significant(self) -> bool:
        """The corrected decision, the only one that headlines are made of."""
        return self.p_corrected < self.alpha


@dataclass(frozen=True)
class Finding:
    """What came of one planned comparison; `outcome` is None where nothing was tested."""

    compare: Compare
    measure: Measure
    outcome: Outcome | None
    terms: tuple[Term, ...]
    why_not: str = ""


@dataclass(frozen=True)
class StudyAnalysis:
    """Everything the analysis of a study found."""

    study: Study
    is_simulated: bool
    selection: Selection
    people: pd.DataFrame = field(repr=False)
    levels: Mapping[str, tuple[Scalar, ...]]
    measures: tuple[Measure, ...]
    findings: tuple[Finding, ...]
    cells: tuple[str, ...]
    """The factors whose combinations tables describe."""

    @property
    def n_participants(self) -> int:
        """Participants with trials that count."""
        return int(self.selection.counted["participant"].nunique())

    def measure(self, column: str) -> Measure:
        """Return a measure by its column."""
        return next(m for m in self.measures if m.column == column)

    def cell_means(self) -> pd.DataFrame:
        """Return one row per participant and cell, levels in their order, with every measure."""
        found = aggregated(self.selection.counted, self.measures, self.cells)
        order = {f: {level: i for i, level in enumerate(self.levels[f])} for f in self.cells}
        kept: pd.DataFrame = found.sort_values(
            ["participant", *self.cells],
            key=lambda c: c if c.name == "participant" else c.map(order[str(c.name)]),
            ignore_index=True,
        )
        return kept


def measures_of(study: Study, responses: Mapping[str, Any]) -> tuple[Measure, ...]:
    """Return what a study measures: its own, every answer that is a number, share or time."""
    found = {m.column: m for m in study.measures}
    for name, response in responses.items():
        words = name.replace("_", " ").capitalize()
        if response.aggregate == "mean":
            found.setdefault(name, Measure(name, getattr(response, "unit", "1"), words))
        if getattr(response, "right", None) is not None and response.aggregate == "share":
            right = f"{name}_is_right"
            found.setdefault(right, Measure(right, "1", f"{words} right", None, "share"))
        found.setdefault(
            f"{name}_ms", Measure(f"{name}_ms", "ms", f"Time to answer {name.replace('_', ' ')}",
                                  None, "median")
        )  # fmt: skip
    return tuple(found.values())


def analyse_rows(
    study: Study,
    selection: Selection,
    people: pd.DataFrame,
    *,
    levels: Mapping[str, tuple[Scalar, ...]],
    measures: Sequence[Measure],
    is_simulated: bool,
    cells: Sequence[str] = (),
) -> StudyAnalysis:
    """Answer every planned comparison; what cannot be tested says why.

    Raises:
        DataError: no trial counts.
    """
    if selection.counted.empty:
        why = "; ".join(f"{left.count} {left.level}s: {left.words}" for left in selection.left)
        raise DataError(f"no trial of {study.name} counts ({why or 'there is none'}); nothing can "
                        "be analysed")  # fmt: skip
    known = {m.column: m for m in measures}
    found = [
        answered(c, selection.counted, known, dict(levels), is_simulated=is_simulated)
        for c in study.compare
    ]
    return StudyAnalysis(
        study, is_simulated, selection, people, dict(levels), tuple(measures), corrected(found),
        tuple(cells or levels),
    )  # fmt: skip


def answered(
    compare: Compare,
    trials: pd.DataFrame,
    measures: Mapping[str, Measure],
    levels: dict[str, tuple[Scalar, ...]],
    *,
    is_simulated: bool,
) -> Finding:
    """Test one comparison on the trials that count.

    Raises:
        DataError: there is no such measure or factor.
    """
    measure = measures.get(compare.dv)
    if measure is None:
        raise DataError(
            f"the comparison {compare.name} asks for {compare.dv}, which is no measure of this "
            f"study; there are {', '.join(measures)}"
        )
    factors = (*compare.within, *compare.between)
    unknown = [f for f in factors if f not in levels]
    if unknown:
        raise DataError(
            f"the comparison {compare.name} names {', '.join(unknown)}, which is no factor of this "
            f"study; there are {', '.join(levels)}"
        )
    if measure.column not in trials:
        return Finding(compare, measure, None, (), f"no trial has {measure.column}")
    if compare.model:  # which takes single trials
        frame = trials[["participant", *factors, measure.column]].copy()
        frame[measure.column] = pd.to_numeric(frame[measure.column], errors="coerce").astype(float)
    else:
        frame = aggregated(trials, [measure], factors).drop(columns="n")
    n = frame.dropna(subset=[measure.column])["participant"].nunique()
    if n < MIN_PARTICIPANTS:
        why = f"{n} participants have {measure.column}; tests need {MIN_PARTICIPANTS}"
        return Finding(compare, measure, None, (), why)
    question = compare.question({f: tuple(map(str, levels[f])) for f in factors})
    frame = frame.assign(**{SIMULATED_COLUMN: is_simulated})
    try:
        outcome = answer(frame, question, name="the trials that count")
    except LabError as error:
        return Finding(compare, measure, None, (), str(error))
    terms = tuple(
        Term(
            str(row.get("term") or ":".join(factors)),
            float(p),
            float(p),
            compare.alpha,
            row,
        )
        for row in outcome.rows
        if (p := row.get("p_used", row.get("p"))) is not None and isinstance(p, float)
    )
    return Finding(compare, measure, outcome, terms)


def corrected(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings with every term's p corrected over its family."""
    families: dict[tuple[str, str], list[float]] = {}
    for finding in findings:
        key = (finding.compare.family, finding.compare.correction)
        families.setdefault(key, []).extend(t.p for t in finding.terms)
    adjusted = {
        key: iter(adjust_p(ps, key[1]).tolist() if ps else [])  # type: ignore[arg-type]  # the corrections of Compare are those of adjust_p
        for key, ps in families.items()
    }
    return tuple(
        replace(
            f,
            terms=tuple(
                replace(t, p_corrected=next(adjusted[(f.compare.family, f.compare.correction)]))
                for t in f.terms
            ),
        )
        for f in findings
    )
