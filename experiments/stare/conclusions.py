"""The study's questions answered in words, each by a stated rule."""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.report.blocks import Status
from analysis.report.notation import counted, fraction
from experiments.stare.anxiety import AnxietyCorrelation
from experiments.stare.comparisons import Comparison, find
from experiments.stare.terms import DWELL, FIXATION_COUNT

STARED_AT = ("D", "AD", "DA")
"""Conditions in which the active agent looks at the participant for some time."""

RULE = (
    "An effect counts as found when dwell time and fixation count both differ significantly, "
    "after correction, in the direction the hypothesis names; as partly found when one of them "
    "does; otherwise as not found, which is no proof of its absence."
)


@dataclass(frozen=True)
class Conclusion:
    """One question with its answer and the sentences it rests on."""

    status: Status
    question: str
    answer: str
    evidence: tuple[str, ...]

    @property
    def headline(self) -> str:
        """Question and answer in one line."""
        return f"{self.question}: {self.answer}"


def conclude(
    comparisons: Sequence[Comparison], anxiety: Sequence[AnxietyCorrelation]
) -> tuple[Conclusion, ...]:
    """Answer hypothesis 1 in its static and two dynamic forms, and hypothesis 2."""
    return (
        _effect("Stare-in-the-crowd effect", ("A", "D"), comparisons),
        _effect("Being caught staring (averted to directed)", ("A", "AD"), comparisons),
        _effect("Catching someone staring (directed to averted)", ("A", "DA"), comparisons),
        _anxiety(anxiety),
    )


def _effect(question: str, pair: tuple[str, str], comparisons: Sequence[Comparison]) -> Conclusion:
    tests = [find(comparisons, measure, pair) for measure in (DWELL, FIXATION_COUNT)]
    evidence = tuple(t.sentence() for t in tests)
    if any(t.outcome is None for t in tests):
        return Conclusion("undecided", question, "not tested", evidence)
    more = [t for t in tests if t.is_significant and t.direction > 0]
    less = [t for t in tests if t.is_significant and t.direction < 0]
    if less:
        return Conclusion("not_found", question, "reversed or mixed", evidence)
    if len(more) == len(tests):
        return Conclusion("found", question, "found", evidence)
    if more:
        only = f"found for {more[0].measure.label.lower()} only"
        return Conclusion("partly", question, only, evidence)
    return Conclusion("not_found", question, "not found", evidence)


def _anxiety(correlations: Sequence[AnxietyCorrelation]) -> Conclusion:
    question = "Less looking with more social anxiety"
    dwell = [c for c in correlations if c.measure == DWELL and c.condition in STARED_AT]
    tested = [c for c in dwell if c.outcome is not None]
    evidence = tuple(c.sentence() for c in dwell)
    if not tested:
        return Conclusion("undecided", question, "not tested", evidence)
    negative = [c for c in tested if c.is_significant and c.outcome is not None and c.outcome.r < 0]
    if not negative:
        return Conclusion("not_found", question, "not found", evidence)
    listed = ", ".join(
        f"{c.condition} rs = {fraction(c.outcome.r)}" for c in negative if c.outcome is not None
    )
    answer = f"found in {len(negative)} of {counted(len(dwell), 'condition')} ({listed})"
    status: Status = "found" if len(negative) == len(dwell) else "partly"
    return Conclusion(status, question, answer, evidence)
