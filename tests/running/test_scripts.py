"""Studies from a script: open, measure, simulate, analyse; folders that hide ours are told."""

import sys

import numpy as np
import pytest

import visavis
from tests.sessions import STUDIES
from visavis.lab.errors import UsageError


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> visavis.StudyData:
    return visavis.simulate(
        STUDIES / "duel.py",
        2,
        output=tmp_path_factory.mktemp("out"),
        parameters={"repetitions": 1, "practice": 0},
        processes=1,
    )


def test_trials_are_measured_and_say_what_counts(data: visavis.StudyData) -> None:
    trials = visavis.open_study(data.path).trials()
    assert (8, True) == (len(trials), bool(trials["is_analysed"].all()))
    assert trials["dwell_ms"].notna().all()


def test_streams_are_frames_whose_columns_are_described(data: visavis.StudyData) -> None:
    session = data.session("S01B")
    gaze = session.stream("gaze_targets")
    described = set(session.columns("gaze_targets")["name"])
    assert {"gaze_seq", "valid", "hit"} <= described
    assert len(gaze) > 1000
    assert "gaze" in session.streams


def test_session_of_somebody_unknown_names_those_there(data: visavis.StudyData) -> None:
    with pytest.raises(UsageError, match="there are S01B, S02C"):
        data.session("S09")


def test_analysis_takes_other_limits(data: visavis.StudyData) -> None:
    assert 0.2 == data.analysis(max_trial_lost_01=0.2).selection.limits["max_trial_lost_01"]


def test_tables_are_read_as_written(data: visavis.StudyData) -> None:
    with pytest.raises(UsageError, match="make them"):
        visavis.tables(data)
    visavis.analyse(data, processes=1)
    assert {"trials", "participants", "cell_means", "statistics"} <= set(visavis.tables(data))


def test_every_public_name_can_be_imported() -> None:
    assert all(getattr(visavis, name) is not None for name in dir(visavis))


def test_name_that_is_none_lists_those_that_are() -> None:
    with pytest.raises(AttributeError, match="visavis has no 'Studi'; it has"):
        _ = visavis.Studi


@pytest.mark.parametrize("who", ["S02C", "s02c", "02C", "2", 2, "02"])
def test_a_person_is_found_by_label_and_by_number(data: visavis.StudyData, who: str | int) -> None:
    assert "S02C" == data.session(who).participant


@pytest.mark.parametrize("who", ["S02D", "2D", "C", "T02C", "S2"])
def test_a_label_that_is_wrong_is_nobodys(data: visavis.StudyData, who: str) -> None:
    with pytest.raises(UsageError, match="there are S01B, S02C"):
        data.session(who)


def test_a_column_has_one_name_in_measures_and_in_scripts(data: visavis.StudyData) -> None:
    session = data.session(1)
    table = session.stream("gaze_targets")
    record = visavis.TrialRecord({"recording_part": 1}, session.recording)
    columns = record.stream("gaze_targets", 0, 2**62)
    for name in ("direction_world", "direction_world_x", "hit"):
        assert np.array_equal(columns[name], table[name].to_numpy(), equal_nan=name != "hit")
    valid_rows = table[table["valid"]]
    assert len(valid_rows) == len(
        valid_rows["direction_world"]
    )  # what is selected knows its fields, too
    for of in (columns, table):
        with pytest.raises(KeyError, match=r"no 'direction'; there are .*gaze_seq"):
            _ = of["direction"]


def test_progress_is_shown_where_somebody_looks(
    data: visavis.StudyData, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    visavis.open_study(data.path).trials()
    assert "" == capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    visavis.open_study(data.path).trials()
    assert capsys.readouterr().err.endswith("\rmeasuring 1 of 2\rmeasuring 2 of 2\n")
