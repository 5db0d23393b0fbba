from typing import Any

import numpy as np
import pandas as pd
import pytest

from lab.errors import UsageError
from visavis.exclusions import Exclusion, limits_in_force, select

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
    found = select(
        table, rules, limits_in_force(rules, {}), cells=(), planned={"a": len(table)}, cell_count=1
    )
    return [str(why) for why in found.rows["left_out_because"]]


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
    found = select(table, (LOST,), {"max_lost_01": 0.3}, cells=(), planned={}, cell_count=1)
    assert [("T3", 1), ("T1", 2)] == list(
        found.finished[["trial_id", "attempt"]].itertuples(index=False, name=None)
    )


@pytest.mark.parametrize("value", [1.2, -0.1, "much", float("nan")])
def test_limit_that_is_no_share_is_refused(value: object) -> None:
    with pytest.raises(UsageError, match="max_lost_01"):
        limits_in_force((LOST,), {"max_lost_01": value})


def test_rule_without_a_limit_is_off() -> None:
    assert {"max_lost_01": None} == limits_in_force((LOST,), {"max_lost_01": None})
