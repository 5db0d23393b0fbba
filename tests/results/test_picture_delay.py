"""What pictures of a room are late by is taken off gaze and answers, where that is asked for."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import visavis
from tests.sessions import opened, perform
from visavis.lab.errors import DataError, UsageError
from visavis.results.locked_plan.deviations import deviations_between
from visavis.results.picture_delay import LATE, read_sync_test, required_for
from visavis.running.sessions.plan_lock import content_now
from visavis.running.sessions.studies import analyse_study

DELAY_MS = 12.5
STUDY = """
from visavis import Compare, Factor, Keys, Rating, Scene, Study, dwell_on, first_fixation_on

study = Study(
    "late", "Whom do people look at?", factors=[Factor("side", ["left", "right"])], repetitions=4,
    measures=[dwell_on("active"), first_fixation_on("active")],
    compare=[Compare("dwell_ms", within="side"), Compare("seen_ms", within="side")],
)

@study.trial
def trial(t):
    yield t.dark(0.3)
    yield t.show(Scene("two_people", active=t.side), seconds=1.5)
    yield t.show(Scene("two_people", active=t.side), seconds=0.1, name="probe")
    yield t.key(Keys("seen", ("trigger",), limit_s=4.0))
    yield t.ask(Rating("realism", 1, 9))
"""


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, object]:
    """A study of gaze and keys, and one simulated session of it."""
    folder = tmp_path_factory.mktemp("late")
    file = folder / "late.py"
    file.write_text(STUDY, "utf-8")
    return str(file), perform(str(file), folder / "data")


def kept(folder: Path, *, simulated: bool = True, **offsets: float) -> Path:
    file = folder / "sync-20260101T120000-1.json"
    record = {"made": "2026-01-01T12:00:00+00:00", "is_simulated": simulated, "offsets_ms": offsets}
    file.write_text(json.dumps(record), "utf-8")
    return file


def test_times_run_from_the_light_at_the_eye(late):
    file, recording = late
    study = opened(file)
    before = study.measure(recording).rows
    after = study.measure(recording, {"picture_delay_ms": DELAY_MS}).rows
    assert LATE.name not in before
    frames = recording.stream_arrays("frames")
    for (_, old), (_, new) in zip(before.iterrows(), after.iterrows(), strict=True):
        inside = (frames["t_host_ns"] >= old["t_start_ns"]) & (
            frames["t_host_ns"] <= old["t_end_ns"]
        )
        ahead_ms = np.median((frames["predicted_display_ns"] - frames["t_host_ns"])[inside]) / 1e6
        assert ahead_ms > 0
        assert new[LATE.name] == pytest.approx(ahead_ms + DELAY_MS)
        for name in ("seen", "realism"):
            if pd.notna(old[f"{name}_ms"]) and old[f"{name}_by"] in ("keys", "gaze", "ray"):
                earlier_ms = old[f"{name}_ms"] - new[f"{name}_ms"]
                assert earlier_ms == pytest.approx(new[LATE.name], abs=1e-6)
            else:
                assert pd.isna(old[f"{name}_ms"]) == pd.isna(new[f"{name}_ms"])
    assert (after["seen_by"] == "keys").any()


def test_a_first_fixation_is_earlier_by_what_the_picture_was_late(late):
    file, recording = late
    study = opened(file)
    before = study.measure(recording).rows
    after = study.measure(recording, {"picture_delay_ms": DELAY_MS}).rows
    column = "first_fixation_time_ms"
    whole = before[column].notna() & after[column].notna() & (before[column] > 100)
    assert whole.sum() >= 3
    earlier_ms = (before[column] - after[column])[whole]
    np.testing.assert_allclose(earlier_ms, after[LATE.name][whole], atol=1e-3)


def test_without_being_asked_nothing_is_taken_off(late):
    file, recording = late
    pd.testing.assert_frame_equal(
        opened(file).measure(recording).rows, opened(file).measure(recording, {}).rows
    )


@pytest.mark.parametrize("value", [-1.0, 501.0, "much", True, float("nan")])
def test_a_delay_that_is_none_is_refused(late, value):
    with pytest.raises(UsageError, match="picture_delay_ms is a number from 0 to 500"):
        opened(late[0]).check_settings({"picture_delay_ms": value})


def test_analysis_by_a_kept_test_says_so_in_tables_and_report(late, tmp_path):
    file, _ = late
    data = visavis.simulate(file, 2, output=tmp_path, processes=1)
    test = kept(tmp_path, picture_delay_ms=DELAY_MS)
    report = analyse_study(data.path, processes=1, sync=test)
    rows = pd.read_csv(report.parent / "trials.csv")
    assert (rows[LATE.name].dropna() > DELAY_MS).all()
    told = json.loads((report.parent / "trials.json").read_text("utf-8"))
    assert LATE.name in json.dumps(told)
    page = report.read_text("utf-8")
    assert f"--sync {test.name}" in page
    assert "pictures reached the eye" in page
    scripted = data.analysis(picture_delay_ms=DELAY_MS).selection.rows
    np.testing.assert_allclose(
        scripted["seen_ms"].astype(float), rows["seen_ms"], rtol=0, atol=1e-6
    )


def test_a_locked_plan_knows_that_it_was_not_planned(late):
    study = opened(late[0])
    experiment = study.experiment({})
    planned = content_now(study, experiment, 1)
    done = content_now(study, experiment, 1, {"picture_delay_ms": DELAY_MS})
    (deviation,) = deviations_between(planned, done)
    assert (deviation.part, deviation.name) == ("tests", "picture_delay_ms")
    assert deviation.done == "12.5"


def test_a_test_of_another_kind_of_sessions_is_refused(tmp_path):
    rehearsed = read_sync_test(kept(tmp_path, picture_delay_ms=9.0))
    assert required_for(rehearsed, [True]) == 9.0
    with pytest.raises(DataError, match="rehearsed test and these sessions are real"):
        required_for(rehearsed, [False])
    real = read_sync_test(kept(tmp_path, simulated=False, picture_delay_ms=9.0))
    with pytest.raises(DataError, match="real test and these sessions are simulated"):
        required_for(real, [True, False])


def test_a_test_without_flashes_and_a_file_that_is_none_are_named(tmp_path):
    with pytest.raises(DataError, match="names no delay of pictures"):
        read_sync_test(kept(tmp_path, sound_delay_ms=20.0))
    broken = tmp_path / "notes.json"
    broken.write_text("[]", "utf-8")
    with pytest.raises(DataError, match=r"notes\.json is no test that visavis sync-test saved"):
        read_sync_test(broken)
