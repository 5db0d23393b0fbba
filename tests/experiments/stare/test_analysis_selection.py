import numpy as np
import pandas as pd
import pytest

from experiments.stare.analysis_parameters import DEFAULT_PARAMETERS, AnalysisParameters
from experiments.stare.exclusions import mean_error_deg, select_trials
from lab.errors import DataError, UsageError
from tests.experiments.stare.synthetic_rows import study_rows


@pytest.fixture
def rows() -> pd.DataFrame:
    table = study_rows(4)
    table["lost_01"] = 0.05
    return table


def test_trial_with_thirty_percent_lost_stays_and_more_goes_out(rows):
    rows.loc[0, "lost_01"] = 0.30
    rows.loc[1, "lost_01"] = 0.3001

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert selection.flow.lost == 1
    assert [(e.participant, e.trial_id) for e in selection.excluded] == [("S01", "T02")]
    assert selection.flow.analysed == len(rows) - 1


def test_participant_with_exactly_the_allowed_share_of_lost_trials_stays(rows):
    quarter = AnalysisParameters(max_bad_trials_01=0.25)
    rows.loc[:17, "lost_01"] = 0.9  # 18 of 72 trials of S01: 25 %
    rows.loc[72:90, "lost_01"] = 0.9  # 19 of 72 trials of S02

    selection = select_trials(rows, quarter)

    assert ["S02"] == [e.participant for e in selection.excluded if e.trial_id is None]


def test_participant_with_exactly_the_allowed_calibration_error_stays(rows):
    limit_deg = DEFAULT_PARAMETERS.max_error_deg
    beyond_deg = np.nextafter(limit_deg, 90.0)
    rows.loc[rows["participant"] == "S01", "calibration_accuracy_deg"] = limit_deg
    rows.loc[rows["participant"] == "S02", "calibration_accuracy_deg"] = beyond_deg

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert ["S02"] == [e.participant for e in selection.excluded]


def test_trial_of_unknown_loss_goes_out(rows):
    rows.loc[3, "lost_01"] = np.nan

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert selection.excluded[0].trial_id == "T04"
    assert "unknown" in selection.excluded[0].reason


def test_participant_goes_out_when_more_than_thirty_percent_of_trials_are_lost(rows):
    rows.loc[:21, "lost_01"] = 0.9  # 22 of 72 trials of S01: 30.6 %
    rows.loc[72:92, "lost_01"] = 0.9  # 21 of 72 trials of S02: 29.2 %

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert [e.participant for e in selection.excluded if e.trial_id is None] == ["S01"]
    assert selection.flow.with_participants == 72
    assert selection.flow.lost == 21
    assert "S01" not in set(selection.kept["participant"])


def test_participant_goes_out_when_mean_calibration_error_exceeds_the_limit(rows):
    rows.loc[rows["participant"] == "S03", "calibration_accuracy_deg"] = 2.6

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert [e.participant for e in selection.excluded] == ["S03"]
    assert "2.6°" in selection.excluded[0].reason
    assert selection.flow.participants_in == 3


def test_calibration_error_averages_calibrations_not_trials():
    part = pd.DataFrame(
        {"calibration_id": ["C1", "C1", "C1", "C2"], "calibration_accuracy_deg": [1.0] * 3 + [3.0]}
    )

    assert mean_error_deg(part) == 2.0


def test_participant_without_validation_stays_and_is_named(rows):
    rows.loc[rows["participant"] == "S02", "calibration_accuracy_deg"] = np.nan

    selection = select_trials(rows, DEFAULT_PARAMETERS)

    assert selection.uncalibrated == ("S02",)
    assert selection.flow.participants_out == 0


def test_last_finished_attempt_counts_and_unfinished_ones_are_listed(rows):
    again = rows.iloc[[0, 1]].copy()
    again["attempt"], again["dwell_ms"] = 2, 4321.0
    rows.loc[1, "status"] = "interrupted"
    table = pd.concat([rows, again], ignore_index=True)

    flow = select_trials(table, DEFAULT_PARAMETERS).flow
    kept = select_trials(table, DEFAULT_PARAMETERS).kept

    first = kept[(kept["participant"] == "S01") & kept["trial_id"].isin(["T01", "T02"])]
    assert first["dwell_ms"].tolist() == [4321.0, 4321.0]
    assert (flow.performed, flow.unfinished, flow.superseded) == (len(rows) + 2, 1, 1)
    assert flow.complete == len(rows)


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_the_attempt_made_last_counts_wherever_its_row_stands(rows, order):
    twice = pd.concat([rows.iloc[[0]]] * 2, ignore_index=True)
    twice["attempt"], twice["dwell_ms"] = order, [1000.0 * attempt for attempt in order]

    kept = select_trials(twice, DEFAULT_PARAMETERS).kept

    assert kept["dwell_ms"].tolist() == [2000.0]


def test_practice_is_never_analysed(rows):
    rows.loc[:3, "is_practice"] = True

    assert select_trials(rows, DEFAULT_PARAMETERS).flow.performed == len(rows) - 4


def test_counts_of_the_flow_add_up(rows):
    rows.loc[:30, "lost_01"] = 0.9
    rows.loc[100, "lost_01"] = 0.9
    rows.loc[200, "status"] = "skipped"

    flow = select_trials(rows, DEFAULT_PARAMETERS).flow

    assert flow.performed - flow.unfinished - flow.superseded == flow.complete
    assert flow.complete - flow.with_participants - flow.lost == flow.analysed


def test_missing_column_is_named(rows):
    with pytest.raises(DataError, match="lacks lost_01"):
        select_trials(rows.drop(columns="lost_01"), DEFAULT_PARAMETERS)


def test_condition_of_another_study_is_refused(rows):
    rows.loc[0, "condition"] = "X"

    with pytest.raises(DataError, match="'X'"):
        select_trials(rows, DEFAULT_PARAMETERS)


@pytest.mark.parametrize(
    ("name", "value"),
    [("alpha", 0.0), ("max_trial_lost_01", 1.2), ("max_error_deg", 0.0)],
)
def test_impossible_threshold_is_refused(name, value):
    with pytest.raises(UsageError, match=name):
        AnalysisParameters(**{name: value})
