"""What a damaged recording lost is missing from the measures that need it, and from no others."""

import shutil
from pathlib import Path

import pandas as pd
import pytest

from tests.sessions import opened, perform
from visavis.recording.integrity import DAMAGED_STATUS, damage_of
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy
from visavis.study.measures import HEAD_LOST_COLUMN

RATED = """from visavis import Factor, Measure, Rating, Scene, Study

study = Study(
    "rated",
    factors=[Factor("eyes", ["averted", "directed"])],
    repetitions=3,
    calibrate=False,
    measures=[{measures}],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", eyes=t.eyes), seconds=1.5)
    yield t.ask(Rating("comfort", 1, 9))
"""
OF_A_STREAM = """Measure(
    "screens", "1", "Frames shown", lambda r: len(r.stream("{stream}", *r.window())["t_host_ns"])
)"""
WITHOUT_GAZE = OF_A_STREAM.format(stream="frames")
WITH_GAZE = (
    'Measure("looked", "1", "Looked", lambda r: float(r.gaze is not None), needs_gaze=True), '
    + WITHOUT_GAZE
)
INTERTRIAL_S = 0.3


def study_file(folder: Path, measures: str) -> Path:
    path = folder / "rated.py"
    path.write_text(RATED.format(measures=measures), "utf-8")
    return path


@pytest.fixture(scope="module")
def without_gaze(tmp_path_factory: pytest.TempPathFactory) -> tuple[OpenedStudy, Path]:
    folder = tmp_path_factory.mktemp("rated")
    path = study_file(folder, WITHOUT_GAZE)
    return opened(str(path)), perform(str(path), folder, intertrial_s=INTERTRIAL_S).path


@pytest.fixture(scope="module")
def with_gaze(tmp_path_factory: pytest.TempPathFactory) -> tuple[OpenedStudy, Path]:
    folder = tmp_path_factory.mktemp("looked")
    path = study_file(folder, WITH_GAZE)
    return opened(str(path)), perform(str(path), folder, intertrial_s=INTERTRIAL_S).path


def cut_off(
    study: OpenedStudy, session: Path, stream: str, folder: Path
) -> tuple[pd.DataFrame, pd.Series]:
    """Return the rows of a session whose stream lost its second half, and whom it struck."""
    copy = folder / "ses-001"
    shutil.copytree(session, copy)
    file = copy / "part-01" / f"{stream}.arrows"
    file.chmod(0o644)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    recording = Recording(copy)
    rows = study.measure(recording).rows
    struck = rows["trial_id"].isin([t.trial_id for t in damage_of(recording).trials])
    assert struck.any()
    assert not struck.all()
    return rows, struck


def test_a_measure_of_a_stream_that_lost_samples_is_missing_and_answers_stay(
    without_gaze: tuple[OpenedStudy, Path], tmp_path: Path
) -> None:
    rows, struck = cut_off(*without_gaze, "frames", tmp_path)

    assert {"complete"} == set(rows["status"])
    assert rows["comfort"].notna().all()
    assert struck.tolist() == rows["screens"].isna().tolist()
    assert {45} == set(rows["screens"][~struck])  # 1.5 s of thirty frames a second
    assert rows[HEAD_LOST_COLUMN].notna().all()


def test_a_lost_share_is_missing_where_the_heads_own_samples_are(
    without_gaze: tuple[OpenedStudy, Path], tmp_path: Path
) -> None:
    rows, struck = cut_off(*without_gaze, "head", tmp_path)

    assert struck.tolist() == rows[HEAD_LOST_COLUMN].isna().tolist()
    assert rows["screens"].notna().all()


@pytest.mark.parametrize("stream", ["gaze", "gaze_targets"])
def test_a_study_of_gaze_leaves_out_trials_that_lost_gaze(
    stream: str, with_gaze: tuple[OpenedStudy, Path], tmp_path: Path
) -> None:
    rows, struck = cut_off(*with_gaze, stream, tmp_path)

    assert struck.tolist() == (rows["status"] == DAMAGED_STATUS).tolist()
    assert struck.tolist() == rows["looked"].isna().tolist()


def test_a_study_of_gaze_keeps_trials_that_lost_what_it_does_not_need(
    with_gaze: tuple[OpenedStudy, Path], tmp_path: Path
) -> None:
    rows, _ = cut_off(*with_gaze, "head", tmp_path)

    assert {"complete"} == set(rows["status"])
    assert rows[["looked", "screens", "comfort"]].notna().all(axis=None)
