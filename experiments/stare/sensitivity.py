"""Do the conclusions depend on padding, minimum duration, or the way fixations are found."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from analysis.statistics.results import Cell
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.comparisons import (
    Comparison,
    compare,
    compare_conditions,
    condition_means,
    find,
)
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import DWELL, FIXATION_COUNT, Measure
from lab.errors import DataError
from visavis.looks import IDT, IVT

PAD_COLUMN = "pad_deg"
MINIMUM_COLUMN = "minimum_fixation_ms"
SECOND_VIEW_MEASURES = (
    Measure(IVT + "on_active_count", "Number of fixations on the agent by velocity (I-VT)", "", 2),
    Measure(
        IDT + "on_active_count", "Number of fixations on the agent by dispersion (I-DT)", "", 2
    ),
)


@dataclass(frozen=True)
class SensitivityRow:
    """The thirty tests made again with one padding and one minimum duration.

    `same_verdicts` of the thirty equal the main analysis, `significant` are significant.
    """

    pad_deg: float
    minimum_fixation_ms: float
    dwell: Comparison
    count: Comparison
    significant: int
    same_verdicts: int
    n_tests: int

    def row(self) -> dict[str, Cell]:
        """Return the flat row of the sensitivity table."""
        return {
            "pad_deg": self.pad_deg,
            "minimum_fixation_ms": self.minimum_fixation_ms,
            "dwell_ms_A": self.dwell.first_mean,
            "dwell_ms_D": self.dwell.second_mean,
            "dwell_p": None if self.dwell.outcome is None else self.dwell.outcome.p,
            "fixation_count_A": self.count.first_mean,
            "fixation_count_D": self.count.second_mean,
            "fixation_count_p": None if self.count.outcome is None else self.count.outcome.p,
            "significant_tests": self.significant,
            "same_verdicts": self.same_verdicts,
            "n_tests": self.n_tests,
        }


def same_verdicts(first: Sequence[Comparison], second: Sequence[Comparison]) -> int:
    """Count the tests, in the same order, with the same verdict and direction."""
    return sum(
        a.is_significant == b.is_significant
        and (not a.is_significant or a.direction == b.direction)
        for a, b in zip(first, second, strict=True)
    )


def sensitivity(
    rows: pd.DataFrame,
    kept: pd.DataFrame,
    main: Sequence[Comparison],
    parameters: AnalysisParameters,
) -> tuple[SensitivityRow, ...]:
    """Repeat the thirty tests for every padding and minimum duration in `rows`.

    `rows` holds the six measures by participant, trial_id (and session), pad_deg and
    minimum_fixation_ms; the condition is taken from `kept`, and trials that are not kept are
    left out. Raises DataError when a key is missing.
    """
    keys = [k for k in ("participant", "session", "trial_id") if k in rows and k in kept]
    needed = ("participant", "trial_id")
    missing = [k for k in (*needed, PAD_COLUMN, MINIMUM_COLUMN) if k not in rows]
    if missing:
        raise DataError(
            f"the sensitivity table lacks {', '.join(missing)}; make it with "
            "`sensitivity_rows` of the study's measures and add participant and trial_id"
        )
    values = rows.drop(columns=[c for c in ("condition",) if c in rows])
    values = values.assign(participant=values["participant"].astype(str))
    joined = values.merge(kept[[*keys, "condition"]], on=keys, how="inner")
    table = []
    grid = joined[[PAD_COLUMN, MINIMUM_COLUMN]].drop_duplicates().astype(float)
    for pad_deg, minimum_ms in sorted(map(tuple, grid.to_numpy().tolist())):
        part = joined[(joined[PAD_COLUMN] == pad_deg) & (joined[MINIMUM_COLUMN] == minimum_ms)]
        tests = compare_conditions(condition_means(part), parameters, family="sensitivity")
        table.append(
            SensitivityRow(
                pad_deg,
                minimum_ms,
                find(tests, DWELL, ("A", "D")),
                find(tests, FIXATION_COUNT, ("A", "D")),
                sum(bool(t.is_significant) for t in tests),
                same_verdicts(tests, main),
                len(tests),
            )
        )
    return tuple(table)


def second_view(kept: pd.DataFrame, parameters: AnalysisParameters) -> tuple[Comparison, ...]:
    """Compare the conditions on fixations found by I-VT and I-DT, where the table has them."""
    tests = []
    for measure in SECOND_VIEW_MEASURES:
        if measure.column not in kept:
            continue
        values = kept.assign(**{measure.column: kept[measure.column].astype(float)})
        grouped = values.groupby(["participant", "condition"], sort=True)[[measure.column]]
        means = grouped.mean().reset_index()
        tests += [
            compare(
                means, measure, pair, parameters, family="second view", n_tests=len(COMPARISONS)
            )
            for pair in COMPARISONS
        ]
    return tuple(tests)
