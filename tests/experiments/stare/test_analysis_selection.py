import numpy as np
import pandas as pd
import pytest

from tests.experiments.stare.synthetic_rows import analysed, anxiety_answers, study_rows
from visavis.experiments.stare.study import study
from visavis.lab.errors import UsageError
from visavis.results.opened_study import OpenedStudy
from visavis.results.selection import Selection, mean_error_deg

LIMIT_DEG = 2.5


def select_trials(rows: pd.DataFrame, **settings: float | None) -> Selection:
    """Decide by the study's rules which trials count."""
    opened = OpenedStudy(study)
    return opened.selection_of(opened.experiment({}), rows, planned_counts={}, settings=settings)


def left(selection: Selection) -> dict[str, int]:
    """Return how many trials or people each step left out."""
    return {step.rule: step.count for step in selection.left}


def trials_out(selection: Selection) -> list[tuple[str, str]]:
    """Return the trials that rules about trials left out."""
    why = selection.rows["left_out_because"]
    out = selection.rows[(why != "") & ~why.str.startswith("participant")]
    return list(out[["participant", "trial_id"]].itertuples(index=False, name=None))


def people_out(selection: Selection) -> list[str]:
    """Return who was left out with all trials."""
    people = selection.people
    return people.loc[~people["is_analysed"], "participant"].tolist()


@pytest.fixture
def rows() -> pd.DataFrame:
    table = study_rows(4)
    table["lost_01"] = 0.05
    return table


def test_trial_with_thirty_percent_lost_stays_and_more_goes_out(rows):
    rows.loc[0, "lost_01"] = 0.30
    rows.loc[1, "lost_01"] = 0.3001

    selection = select_trials(rows)

    assert left(selection) == {"max_trial_lost_01": 1}
    assert trials_out(selection) == [("S01", "T02")]
    assert len(selection.counted) == len(rows) - 1


def test_participant_with_exactly_the_allowed_share_of_lost_trials_stays(rows):
    rows.loc[:17, "lost_01"] = 0.9  # 18 of 72 trials of S01: 25 %
    rows.loc[72:90, "lost_01"] = 0.9  # 19 of 72 trials of S02

    assert ["S02"] == people_out(select_trials(rows, max_bad_trials_01=0.25, min_cell_trials=None))


def test_participant_with_exactly_the_allowed_calibration_error_stays(rows):
    beyond_deg = np.nextafter(LIMIT_DEG, 90.0)
    rows.loc[rows["participant"] == "S01", "calibration_accuracy_deg"] = LIMIT_DEG
    rows.loc[rows["participant"] == "S02", "calibration_accuracy_deg"] = beyond_deg

    assert ["S02"] == people_out(select_trials(rows))


def test_trial_of_unknown_loss_goes_out(rows):
    rows.loc[3, "lost_01"] = np.nan

    selection = select_trials(rows)

    assert trials_out(selection) == [("S01", "T04")]
    assert selection.rows.loc[3, "left_out_because"] == "lost_01 is not known"


def test_participant_goes_out_when_more_than_thirty_percent_of_trials_are_lost(rows):
    rows.loc[:21, "lost_01"] = 0.9  # 22 of 72 trials of S01: 30.6 %
    rows.loc[72:92, "lost_01"] = 0.9  # 21 of 72 trials of S02: 29.2 %

    selection = select_trials(rows, min_cell_trials=None)

    assert people_out(selection) == ["S01"]
    assert left(selection) == {"max_trial_lost_01": 22 + 21, "max_bad_trials_01": 1}
    assert "S01" not in set(selection.counted["participant"])


def test_participant_goes_out_when_mean_calibration_error_exceeds_the_limit(rows):
    rows.loc[rows["participant"] == "S03", "calibration_accuracy_deg"] = 2.6

    selection = select_trials(rows)

    assert people_out(selection) == ["S03"]
    assert "2.6°" in selection.people.set_index("participant").loc["S03", "left_out_because"]
    assert selection.counted["participant"].nunique() == 3


def test_calibration_error_averages_calibrations_not_trials():
    part = pd.DataFrame(
        {"calibration_id": ["C1", "C1", "C1", "C2"], "calibration_accuracy_deg": [1.0] * 3 + [3.0]}
    )

    assert mean_error_deg(part) == 2.0


def test_participant_without_validation_stays(rows):
    rows.loc[rows["participant"] == "S02", "calibration_accuracy_deg"] = np.nan

    selection = select_trials(rows)

    assert np.isnan(selection.people.loc[1, "calibration_error_deg"])
    assert people_out(selection) == []


def test_last_finished_attempt_counts_and_unfinished_ones_are_listed(rows):
    again = rows.iloc[[0, 1]].copy()
    again["attempt"], again["dwell_ms"] = 2, 4321.0
    rows.loc[1, "status"] = "interrupted"
    table = pd.concat([rows, again], ignore_index=True)

    selection = select_trials(table)
    kept = selection.counted

    first = kept[(kept["participant"] == "S01") & kept["trial_id"].isin(["T01", "T02"])]
    assert first["dwell_ms"].tolist() == [4321.0, 4321.0]
    assert selection.row_count == len(rows) + 2
    assert left(selection) == {"unfinished": 1, "repeated": 1}
    assert len(selection.finished) == len(rows)


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_the_attempt_made_last_counts_wherever_its_row_stands(rows, order):
    twice = pd.concat([rows.iloc[[0]]] * 2, ignore_index=True)
    twice["attempt"], twice["dwell_ms"] = order, [1000.0 * attempt for attempt in order]

    kept = select_trials(twice, min_cell_trials=None).counted

    assert kept["dwell_ms"].tolist() == [2000.0]


def test_practice_is_never_analysed(rows):
    rows.loc[:3, "is_practice"] = True

    assert len(select_trials(rows).finished) == len(rows) - 4


def test_counts_of_the_flow_add_up(rows):
    rows.loc[:30, "lost_01"] = 0.9
    rows.loc[100, "lost_01"] = 0.9
    rows.loc[200, "status"] = "skipped"

    selection = select_trials(rows)
    trials = sum(step.count for step in selection.left if step.level == "trial")
    out = selection.rows["participant"].isin(people_out(selection))
    with_people = int((out & (selection.rows["lost_01"] <= 0.3)).sum())

    assert selection.row_count - trials - with_people == len(selection.counted)


@pytest.mark.parametrize(
    ("name", "value"),
    [("alpha", 0.0), ("max_trial_lost_01", 1.2), ("max_error_deg", -1.0)],
)
def test_impossible_threshold_is_refused(rows, name, value):
    with pytest.raises(UsageError, match=name):
        analysed(rows, anxiety_answers(4), **{name: value})


def test_threshold_of_tests_is_set_for_the_whole_analysis(rows):
    selection = analysed(rows, anxiety_answers(4), alpha=0.01)

    assert {0.01 / 30} == {t.threshold for t in selection.pairs_of("conditions")}
    assert {0.01} == {t.alpha for t in selection.correlations_of("anxiety")}


def test_person_who_broke_off_half_way_is_left_out(rows):
    kept = rows[(rows["participant"] != "S02") | (rows.groupby("participant").cumcount() % 2 == 0)]
    opened = OpenedStudy(study)
    planned = dict.fromkeys(sorted(set(rows["participant"])), 72)

    selection = opened.selection_of(opened.experiment({}), kept, planned_counts=planned)

    assert ["S02"] == people_out(selection)
