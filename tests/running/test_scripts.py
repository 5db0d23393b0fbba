"""Studies from a script: open, measure, simulate, analyse; folders that hide ours are told."""

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
