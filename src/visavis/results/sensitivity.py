"""How verdicts depend on the padding of heads and the minimum duration of a fixation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from visavis.analysis.statistics.results import Cell
from visavis.lab.errors import DataError
from visavis.protocol.plan.columns import Column
from visavis.results.family_tests import (
    DEFAULT_TEST_RULES,
    PairTest,
    TestRules,
    compare_pairs,
    find_test,
    same_verdicts,
)
from visavis.study.measures import Measure
from visavis.study.pairs import Pairs

PAD_COLUMN = "pad_deg"
MINIMUM_COLUMN = "minimum_fixation_ms"


@dataclass(frozen=True)
class SensitivityRow:
    """A family of paired tests made again with one padding and one minimum duration.

    `first_tests` are those of the family's first two measures between its first pair of levels.
    `same_verdicts` is how many verdicts equal those of the main analysis, `significant` how many
    tests are significant.
    """

    pad_deg: float
    minimum_fixation_ms: float
    first_tests: tuple[PairTest, ...]
    significant: int
    same_verdicts: int
    n_tests: int

    def row(self) -> dict[str, Cell]:
        """Return the flat row of the sensitivity table."""
        row: dict[str, Cell] = {
            "pad_deg": self.pad_deg,
            "minimum_fixation_ms": self.minimum_fixation_ms,
        }
        for test in self.first_tests:
            name = test.measure.column
            row |= {
                f"{name}_{test.first}": test.first_mean,
                f"{name}_{test.second}": test.second_mean,
                f"{name}_p": None if test.outcome is None else test.outcome.p,
            }
        return row | {
            "significant_tests": self.significant,
            "same_verdicts": self.same_verdicts,
            "n_tests": self.n_tests,
        }


def sensitivity(
    rows: pd.DataFrame,
    counted_trials: pd.DataFrame,
    main: Sequence[PairTest],
    of: Pairs,
    measures: Mapping[str, Measure],
    levels: Mapping[str, Sequence[Any]],
    rules: TestRules = DEFAULT_TEST_RULES,
) -> tuple[SensitivityRow, ...]:
    """Repeat a family for every padding and minimum duration in `rows`.

    `rows` holds the family's measures by participant, trial_id (session, attempt), pad_deg and
    minimum_fixation_ms; levels are taken from `counted_trials`, and trials that are not in it are
    left out.

    Raises:
        DataError: a key is missing.
    """
    names = ("participant", "session", "trial_id", "attempt")
    keys = [k for k in names if k in rows and k in counted_trials]
    missing = [k for k in ("participant", "trial_id", PAD_COLUMN, MINIMUM_COLUMN) if k not in rows]
    if missing:
        raise DataError(
            f"the sensitivity table lacks {', '.join(missing)}; make it with "
            "`sensitivity_rows` of visavis.study.look_measures and add participant and trial_id"
        )
    trial_levels = counted_trials[[*keys, of.factor]]
    table = []
    # Joined cell by cell to save memory: joined at once, it would be as large as all trials.
    cells: dict[Any, Any] = rows.groupby([PAD_COLUMN, MINIMUM_COLUMN]).indices
    for pad_deg, minimum_ms in sorted(cells):
        values = rows.iloc[cells[pad_deg, minimum_ms]]
        values = values.drop(columns=[of.factor], errors="ignore")
        values = values.assign(participant=values["participant"].astype(str))
        part = values.merge(trial_levels, on=keys, how="inner")
        if part.empty:
            continue
        tests = compare_pairs(of, part, measures, levels, rules, family="sensitivity")
        table.append(
            SensitivityRow(
                float(pad_deg),
                float(minimum_ms),
                tuple(find_test(tests, name, of.levels[0]) for name in of.measures[:2]),
                sum(bool(t.is_significant) for t in tests),
                same_verdicts(tests, main),
                len(tests),
            )
        )
    return tuple(table)


def sensitivity_columns(of: Pairs, measures: Mapping[str, Measure]) -> dict[str, Column]:
    """Return the columns of a family's sensitivity table, by name."""
    first, second = of.levels[0]
    test_columns = [
        column
        for name in of.measures[:2]
        for column in (
            *(
                Column(
                    f"{name}_{v}",
                    measures[name].unit,
                    f"{measures[name].words}, mean: {of.level_words(v)}",
                )
                for v in (first, second)
            ),
            Column(
                f"{name}_p",
                "1",
                f"p of {measures[name].words}, {first} against {second}, uncorrected",
            ),
        )
    ]
    columns = (
        Column(PAD_COLUMN, "deg", "angular padding of heads"),
        Column(MINIMUM_COLUMN, "ms", "shortest look that counts as a fixation"),
        *test_columns,
        Column("significant_tests", "1", "significant tests of the family"),
        Column("same_verdicts", "1", "tests with the verdict of the main analysis"),
        Column("n_tests", "1", "tests made"),
    )
    return {c.name: c for c in columns}
