"""What a damaged recording cost is left out as such, and counts against nobody."""

import numpy as np
import pandas as pd

from visavis.recording.integrity import DAMAGED_STATUS, LOST_STATUS
from visavis.results.selection import REASON, select
from visavis.study.exclusions import STANDARD_RULES, limits_in_force


def rows(*statuses: str) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "participant": "07H",
            "session": 1,
            "trial_id": [f"T{i}" for i in range(len(statuses))],
            "attempt": [1 if s != LOST_STATUS else np.nan for s in statuses],
            "is_practice": False,
            "status": statuses,
            "side": "left",
        }
    )


def selection(*statuses: str):
    return select(
        rows(*statuses),
        STANDARD_RULES,
        limits_in_force(STANDARD_RULES, {}),
        cells=("side",),
        planned_counts={"07H": len(statuses)},
        cell_count=1,
    )


def test_damaged_trials_are_left_out_with_their_reason_and_their_own_step() -> None:
    result = selection(
        "complete", DAMAGED_STATUS, LOST_STATUS, "interrupted", "complete", "complete"
    )
    said = result.rows.set_index("trial_id")[REASON].to_dict()
    expected = ["", "the recording is damaged", "the recording is damaged", "not finished", "", ""]
    assert expected == list(said.values())
    assert [("damaged", 2), ("unfinished", 1)] == [(s.rule, s.count) for s in result.left]


def test_a_person_is_not_left_out_for_what_a_damaged_recording_cost() -> None:
    result = selection(
        "complete", "complete", DAMAGED_STATUS, DAMAGED_STATUS, LOST_STATUS, LOST_STATUS
    )
    assert 1.0 == result.people["completed_01"].iloc[0]
    assert 2 == len(result.counted)


def test_a_person_who_did_not_finish_still_is() -> None:
    result = selection(
        "complete", "complete", "interrupted", "interrupted", "interrupted", LOST_STATUS
    )
    assert 0.4 == result.people["completed_01"].iloc[0]
    assert 0 == len(result.counted)
