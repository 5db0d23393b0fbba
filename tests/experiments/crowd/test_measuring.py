"""Measuring goes on where it was stopped, and gives the same numbers wherever it is done."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from tests.experiments.crowd.sessions import session
from tests.experiments.crowd.tables import OPENED
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.experiments.crowd.measuring import PIECES, trials_of
from visavis.lab.errors import ConfigError, DataError, UsageError
from visavis.recording.integrity import damage_of
from visavis.recording.reader import Recording
from visavis.results.intake import SessionIntake
from visavis.running.sessions.piecewise import (
    TrialJob,
    measure_job,
    measure_sessions,
    read_stored_trial,
    stored_trial_path,
)
from visavis.running.sessions.runners import on_scheduler, on_this_machine
from visavis.study.pieces import MeasuredTrial

QUICK = {"surface": "capsules"}
HOW = MeasureParameters(surface="capsules")
LIMIT_S = 4.0
"""Walks end after so long: three short walks are enough to be measured and kept."""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return session(tmp_path_factory.mktemp("measured"), limit_s=LIMIT_S).path


@pytest.fixture(scope="module")
def whole(path: Path, tmp_path_factory: pytest.TempPathFactory) -> list[SessionIntake]:
    return measured([path], tmp_path_factory.mktemp("whole"), here)


def here(work, jobs: list[TrialJob]) -> Iterator[tuple[int, MeasuredTrial]]:
    return on_this_machine(work, jobs, 1)


def measured(paths, store, run, settings=QUICK, told=None) -> list[SessionIntake]:
    return measure_sessions(OPENED, PIECES, paths, store, run, settings, told)


def rows(intakes: list[SessionIntake]) -> list[str]:
    tables = [intakes[0].rows, *intakes[0].tables.values()]
    return [table.to_json(double_precision=15) for table in tables]


def walks_of(intake: SessionIntake) -> list[dict]:
    lost = intake.rows.get("lost_01")  # no column where no walk could be measured
    return [] if lost is None else intake.rows[lost.notna()].to_dict("records")


def test_stopped_measuring_goes_on_with_what_is_missing(path, whole, tmp_path):
    asked = []

    def stops(work, jobs):
        for number, job in enumerate(jobs):
            asked.append(job.trial_id)
            if len(asked) == 2:
                raise KeyboardInterrupt
            yield number, work(job)

    def goes_on(work, jobs):
        asked.extend(job.trial_id for job in jobs)
        return here(work, jobs)

    with pytest.raises(KeyboardInterrupt):
        measured([path], tmp_path, stops)
    told = []
    again = measured([path], tmp_path, goes_on, told=lambda done, of: told.append((done, of)))
    first, *others = [row["trial_id"] for row in walks_of(whole[0])]
    assert [first, others[0], *others] == asked
    assert [(1, 3), (2, 3), (3, 3)] == told
    assert rows(whole) == rows(again)


def test_only_a_walk_whose_file_is_damaged_is_measured_again(path, tmp_path):
    counts = []

    def counting(work, jobs):
        counts.append(len(jobs))
        return here(work, jobs)

    measured([path], tmp_path, counting)
    measured([path], tmp_path, counting)
    kept = sorted(tmp_path.glob("*.json"))
    kept[0].write_text("{", encoding="utf-8")
    assert read_stored_trial(kept[0]) is None
    measured([path], tmp_path, counting)
    assert [3, 1] == counts


def test_walks_measured_another_way_are_not_taken_for_these(path, tmp_path):
    recording, trial = Recording(path), "T01"
    others = [MeasureParameters("centres"), MeasureParameters("published"), HOW]
    names = {stored_trial_path(tmp_path, recording, trial, PIECES, how) for how in others}
    newer = replace(PIECES, version=PIECES.version + 1)
    names.add(stored_trial_path(tmp_path, recording, trial, newer, HOW))
    names.add(stored_trial_path(tmp_path, recording, "T02", PIECES, HOW))
    assert 5 == len(names)


def test_settings_of_measuring_are_taken_by_name():
    assert MeasureParameters("published", "light") == PIECES.how_with(
        {"rule": "published", "surface": "light", "alpha": 0.01}
    )
    assert MeasureParameters() == PIECES.how_with({})


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"rule": "publishd"}, "choose volume, centres, published"),
        ({"narrow_gap_m": "wide"}, "narrow_gap_m is 'wide': give a number"),
        ({"rule": "published", "surface": "capsules"}, "choose another surface"),
    ],
)
def test_a_setting_of_measuring_that_does_not_exist_is_named(settings, said):
    with pytest.raises(ConfigError, match=said):
        PIECES.how_with(settings)


def test_a_scheduler_gives_identical_numbers(path, whole, tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="install Dask's scheduler: pip install 'visavis[cluster]'"
    )
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        dashboard_address=None,
        host="127.0.0.1",
        protocol="tcp://",
    ) as cluster:
        found = measured(
            [path],
            tmp_path,
            lambda work, jobs: on_scheduler(work, jobs, cluster.scheduler_address),
        )
    assert rows(whole) == rows(found)


def test_a_worker_that_does_not_see_the_folder_says_so(path):
    job = TrialJob("crowd", str(path), trials_of(Recording(path))[0], HOW)
    gone = TrialJob("crowd", str(Path(job.session) / "gone"), job.trial_id, HOW)
    with pytest.raises(DataError, match="every worker must see"):
        measure_job(gone)


def test_a_session_without_its_body_stream_says_which_file_to_restore(path, tmp_path):
    copy = tmp_path / "ses-001"
    shutil.copytree(path, copy)
    job = TrialJob("crowd", str(copy), trials_of(Recording(copy))[0], HOW)
    (copy / "part-01" / "body.arrows").unlink()
    with pytest.raises(DataError, match=r"body\.arrows.*restore it"):
        measure_job(job)


def test_a_stream_cut_off_leaves_later_walks_out_and_says_so(path, tmp_path):
    copy = tmp_path / "ses-001"
    shutil.copytree(path, copy)
    stream = copy / "part-01" / "body.arrows"
    stream.write_bytes(stream.read_bytes()[: stream.stat().st_size // 2])
    intake = OPENED.measure(Recording(copy), QUICK)
    assert intake.source.status.startswith("damaged; body (part 1): ")
    assert "T03" in intake.source.status
    assert "T03" not in [row["trial_id"] for row in walks_of(intake)]


@pytest.mark.parametrize("stream", ["body", "head", "haptics_armband_left_forearm", "frames"])
def test_a_walk_that_lost_samples_of_any_stream_is_marked_and_has_no_measures(
    stream, path, tmp_path
):
    copy = tmp_path / "ses-001"
    shutil.copytree(path, copy)
    file = copy / "part-01" / f"{stream}.arrows"
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 9 // 10])
    recording = Recording(copy)
    before = {f"T0{i}": MeasuredTrial({"lost_01": 0.25}) for i in (1, 2, 3)}
    walked = OPENED.measure(recording, QUICK, before).rows.set_index("trial_id")

    struck = {trial.trial_id for trial in damage_of(recording).trials}
    assert "T03" in struck
    assert set(walked.index[walked["status"] == "damaged"]) == struck
    assert set(walked.index[walked["lost_01"].isna()]) == {"P1", *struck}
    assert walked["reason"]["T03"] == f"recording damaged: samples of {stream} cannot be read"


@pytest.mark.parametrize("content", ["null", "[]", "3", '{"row": {}, "cells": [3]}', ""])
def test_a_kept_file_of_another_shape_is_measured_again(content, tmp_path):
    kept = tmp_path / "kept.json"
    kept.write_text(content, encoding="utf-8")
    assert read_stored_trial(kept) is None


def test_a_walk_that_does_not_exist_is_named(path):
    job = TrialJob("crowd", str(path), trials_of(Recording(path))[0], HOW)
    with pytest.raises(UsageError, match="holds no finished walk 'T99'"):
        measure_job(TrialJob("crowd", job.session, "T99", HOW))


def test_a_measured_trial_survives_json_bit_for_bit():
    trial = MeasuredTrial.plain(
        {"a": np.float64(0.1), "b": np.int64(3), "c": float("nan")}, {"met": [{"v": 1 / 3}]}
    )
    assert MeasuredTrial({"a": 0.1, "b": 3, "c": None}, {"met": [{"v": 1 / 3}]}) == trial
    assert trial == MeasuredTrial(**json.loads(json.dumps(asdict(trial))))


def test_another_width_of_narrow_gaps_measures_no_walk_again(path, tmp_path):
    narrow = MeasureParameters(surface="capsules", narrow_gap_m=0.9)
    at = [stored_trial_path(tmp_path, Recording(path), "T01", PIECES, how) for how in (HOW, narrow)]
    assert at[0] == at[1]
