"""Additions of a study to its report: its own sections, and answers to its questions."""

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column

if TYPE_CHECKING:
    import pandas as pd

    from visavis.analysis.plots import ReportFigure
    from visavis.analysis.report import Section
    from visavis.analysis.report.blocks import Status

# Functions of a study get its analysis and its experiment. Both hold the study, so their classes
# stand above its declaration: visavis.results.analysis.StudyAnalysis and
# visavis.study.experiment.StudyExperiment. Study files name these classes in their own functions;
# with a protocol here type checkers would refuse them.
AnalysisOfStudy: TypeAlias = Any
ExperimentOfStudy: TypeAlias = Any


@dataclass(frozen=True)
class TrialToSee:
    """A participant's trial, its session's folder, and why somebody should look at it."""

    participant: str
    session: str
    trial_id: str
    why: str


@dataclass(frozen=True)
class Extra:
    """A section of a study's report, or figures and tables alone.

    A figure with the name of a family of tests appears in that family's section. `figures` are
    written beside the report like the standard ones, `tables` as NAME.csv with a dictionary;
    `columns` describe the columns that no other table has. `trials` are those that the
    figures show, each listed below them with its page.
    """

    section: "Section | None" = None
    figures: "tuple[ReportFigure, ...]" = ()
    tables: "Mapping[str, pd.DataFrame]" = field(default_factory=dict)
    columns: tuple[Column, ...] = ()
    trials: tuple[TrialToSee, ...] = ()


SectionOf: TypeAlias = Callable[[AnalysisOfStudy, ExperimentOfStudy], Extra]
"""Makes a section from the analysis of a study, with the parameters in force."""


@dataclass(frozen=True)
@of_kinds()
class Confusion:
    """Confusion matrices of a choice; goes into a study's `sections`.

    `shown` is the column of the right answer, `answered` the `Choice`, whose options are the
    rows and columns in their order; `by` makes one matrix for each level of a factor. A study that
    has no such column, choice or factor is refused when it is opened. Trials without an answer are
    reported, but not counted. Writes NAME.csv and the figure NAME.
    """

    shown: str
    answered: str
    by: str | None = None
    title: str = "Which was taken for which"
    name: str = "confusion"


@dataclass(frozen=True)
class Conclusion:
    """One question of a study with its answer and the sentences of all the tests it rests on.

    `was_tested` is False when a test it needs could not be made at all; `name` is that of
    `Study.questions`, where the question has one.
    """

    status: "Status"
    question: str
    answer: str
    evidence: tuple[str, ...]
    was_tested: bool = True
    name: str = ""

    @property
    def headline(self) -> str:
        """Question and answer in one line."""
        return f"{self.question}: {self.answer}"

    @property
    def is_found(self) -> bool | None:
        """Tell whether the effect was found in full; None when it was not tested."""
        return self.status == "found" if self.was_tested else None


ConcludeOf: TypeAlias = Callable[[AnalysisOfStudy], Sequence[Conclusion]]
"""Answers the questions of a study from its analysis."""


def import_object(reference: str) -> Any:
    """Return the object that "module:name" names; imports the module."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)
