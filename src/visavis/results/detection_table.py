"""The table of signal detection: hits, false alarms, d′ and criterion of every person and cell."""

from typing import Final

import pandas as pd

from visavis.protocol.plan.columns import Column
from visavis.results.analysis import StudyAnalysis
from visavis.study.measures import Measure, aggregate_cells, count_column
from visavis.study.sections import Extra
from visavis.study.signal_detection import DetectionValue

NAME: Final = "detection"


def detection_table(analysis: StudyAnalysis) -> Extra:
    """Return what the study measures of signal detection, in the cells of all factors but the one
    that tells of a signal, which means of cells are apart by; empty where it measures none.
    """
    trials = analysis.selection.counted
    together: dict[tuple[str, ...], list[Measure]] = {}
    for measure in analysis.measures:
        if isinstance(measure.of_cell, DetectionValue) and measure.is_in(trials):
            together.setdefault(measure.of_cell.reads, []).append(measure)
    tables, counts = [], {}
    for reads, measures in together.items():
        factors = [name for name in analysis.cells if name not in reads]
        count = count_column(factors)
        counts[count] = Column(count, "1", "trials, with those without an answer")
        tables.append(aggregate_cells(trials, measures, factors))
    if not tables:
        return Extra()
    table = pd.concat(tables, ignore_index=True)
    return Extra(tables={NAME: table}, columns=tuple(counts.values()))
