"""What a study adds to its report: a section of its own, with the figures and tables it needs."""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from visavis.protocol.plan.columns import Column

if TYPE_CHECKING:
    import pandas as pd

    from visavis.analysis.plots import ReportFigure
    from visavis.analysis.report import Section
    from visavis.results.analysis import StudyAnalysis
    from visavis.study.experiment import StudyExperiment


@dataclass(frozen=True)
class Extra:
    """A section of a study's report, or figures and tables alone.

    A figure called as a family of tests stands in that family's section. `figures` are written
    beside the report as the standard ones are, `tables` as NAME.csv with a dictionary; `columns`
    describe what no other table has.
    """

    section: "Section | None" = None
    figures: "tuple[ReportFigure, ...]" = ()
    tables: "Mapping[str, pd.DataFrame]" = field(default_factory=dict)
    columns: tuple[Column, ...] = ()


SectionOf: TypeAlias = Callable[["StudyAnalysis", "StudyExperiment"], Extra]
"""Makes a section from the analysis of a study, with the parameters in force."""


def made(section: SectionOf | str) -> SectionOf:
    """Return what makes a section; one named "module:function" is imported now."""
    if not isinstance(section, str):
        return section
    found: SectionOf = named(section)
    return found


def named(reference: str) -> Any:
    """Return what "module:name" names, imported now."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)
