from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.lab.errors import UsageError
from visavis.results.opened_study import find_study
from visavis.results.selection import Selection, left_out_lines, select
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.exclusions import STANDARD_RULES, Exclusion, limits_in_force

LOST = Exclusion("max_lost_01", "trial", "lost_01", 0.3, "{value:.0%} lost", missing_is_out=True)


def rows(**columns: list[Any]) -> pd.DataFrame:
    n = len(next(iter(columns.values())))
    usual: dict[str, list[Any]] = {
        "participant": ["a"] * n,
        "session": [1] * n,
        "is_practice": [False] * n,
        "trial_id": [f"T{i}" for i in range(n)],
        "attempt": [1] * n,
        "status": ["complete"] * n,
    }
    return pd.DataFrame(usual | columns)


def left_out(table: pd.DataFrame, *rules: Exclusion) -> list[str]:
    selection = select(
        table,
        rules,
        limits_in_force(rules, {}),
        cells=(),
        planned_counts={"a": len(table)},
        cell_count=1,
    )
    return [str(why) for why in selection.rows["left_out_because"]]


def test_missing_value_is_out_where_the_rule_says_so_and_says_that_it_is_missing() -> None:
    table = rows(lost_01=[0.3, 0.301, np.nan])
    assert ["", "30% lost", "lost_01 is not known"] == left_out(table, LOST)


def test_attempt_of_unknown_value_takes_the_place_of_the_one_before() -> None:
    table = rows(lost_01=[0.1, np.nan], trial_id=["T1", "T1"], attempt=[1, 2])
    assert ["performed again later", "lost_01 is not known"] == left_out(table, LOST)


def test_finished_trials_are_those_that_would_count_without_rules() -> None:
    table = rows(
        lost_01=[0.9, 0.1, np.nan, 0.1, 0.1],
        status=["complete", "damaged", "complete", "interrupted", "complete"],
        trial_id=["T1", "T2", "T3", "T4", "T1"],
        attempt=[1, 1, 1, 1, 2],
    )
    selection = select(
        table, (LOST,), {"max_lost_01": 0.3}, cells=(), planned_counts={}, cell_count=1
    )
    assert [("T3", 1), ("T1", 2)] == list(
        selection.finished[["trial_id", "attempt"]].itertuples(index=False, name=None)
    )


@pytest.mark.parametrize("value", [1.2, -0.1, "much", float("nan")])
def test_limit_that_is_no_share_is_refused(value: object) -> None:
    with pytest.raises(UsageError, match="max_lost_01"):
        limits_in_force((LOST,), {"max_lost_01": value})


def test_rule_without_a_limit_is_off() -> None:
    assert {"max_lost_01": None} == limits_in_force((LOST,), {"max_lost_01": None})


def standard(table: pd.DataFrame, planned: int, answered: float | None = None) -> Selection:
    """Select by the kit's own rules among trials of two sides, of one person."""
    facts = pd.DataFrame({"participant": ["a"], "answered_01": [answered]})
    return select(
        table,
        STANDARD_RULES,
        limits_in_force(STANDARD_RULES, {}),
        cells=("side",),
        planned_counts={"a": planned},
        cell_count=2,
        facts=facts,
    )


def sides(left: int, right: int, **columns: Any) -> pd.DataFrame:
    table = rows(side=["left"] * left + ["right"] * right)
    return table.assign(**columns)


@pytest.mark.parametrize(
    ("table", "answered", "why"),
    [
        (sides(3, 2), 1.0, "62% of the planned trials finished (limit 75%)"),
        (sides(4, 1), 1.0, "25% of the trials planned for a cell count"),
        (sides(4, 4), 0.4, "40% of the questionnaires' required questions answered"),
        (sides(4, 4, calibration_accuracy_deg=3.5), 1.0, "mean calibration error 3.50°"),
        (sides(4, 4, gaze_lost_01=0.6), 1.0, "100% of the trials left out"),
        (sides(4, 4, head_lost_01=0.6), 1.0, "100% of the trials left out"),
    ],
)
def test_standard_rules_leave_a_person_out_by_name_and_with_the_limit(
    table: pd.DataFrame, answered: float, why: str
) -> None:
    selection = standard(table, 8, answered)
    assert 0 == len(selection.counted)
    said = [line for line in left_out_lines(selection, STANDARD_RULES) if "participant a" in line]
    assert 1 == len(said)
    assert why in said[0]


def test_whole_person_is_left_in_and_nothing_is_said() -> None:
    selection = standard(sides(4, 4, gaze_lost_01=0.1), 8, 0.5)
    assert 8 == len(selection.counted)
    assert [] == left_out_lines(selection, STANDARD_RULES)


def test_trials_left_out_are_told_by_rule_with_the_number() -> None:
    selection = standard(sides(4, 4, head_lost_01=[0.9, *[0.0] * 7]), 8, 1.0)
    assert [
        "left out: 1 trial, share of the trial without a tracked head above 0.5"
    ] == left_out_lines(selection, STANDARD_RULES)


def test_cell_that_a_damaged_recording_emptied_in_part_is_judged_by_the_rest() -> None:
    table = sides(4, 4, status=["complete"] * 5 + ["damaged"] * 3)
    assert 1.0 == standard(table, 8, 1.0).people["smallest_cell_01"].item()


@pytest.mark.parametrize("name", sorted(SHIPPED_STUDIES))
def test_every_rule_of_the_studies_that_come_along_is_told_in_words(name: str) -> None:
    for rule in find_study(name).study.analysis.exclusions:
        if not rule.if_missing:
            assert rule.column_words != rule.column.replace("_", " "), rule.name
            assert not rule.column_words.endswith(" 01"), rule.name
