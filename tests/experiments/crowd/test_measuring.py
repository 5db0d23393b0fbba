"""Measuring goes on where it was stopped, and gives the same numbers wherever it is done."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from experiments.crowd.intake import SessionIntake, take_in
from experiments.crowd.measures import MeasuredWalk, MeasureParameters, measure_parameters
from experiments.crowd.measuring import (
    WalkJob,
    as_json,
    from_json,
    jobs_of,
    measure_job,
    measure_sessions,
    read_kept,
)
from lab.errors import ConfigError, DataError, UsageError
from recording.reader import Recording
from tests.experiments.crowd.sessions import session
from visavis.sessions.runners import on_scheduler, on_this_machine

QUICK = MeasureParameters(surface="capsules")
LIMIT_S = 4.0
"""Walks end after so long: three short walks are enough to be measured and kept."""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return session(tmp_path_factory.mktemp("measured"), limit_s=LIMIT_S).path


@pytest.fixture(scope="module")
def whole(path: Path, tmp_path_factory: pytest.TempPathFactory) -> list[SessionIntake]:
    return measure_sessions([path], tmp_path_factory.mktemp("whole"), here, params=QUICK)


def here(work, jobs: list[WalkJob]) -> Iterator[tuple[int, MeasuredWalk]]:
    return on_this_machine(work, jobs, 1)


def rows(intakes: list[SessionIntake]) -> list[dict]:
    return [as_json(w) for w in intakes[0].walks]


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
        measure_sessions([path], tmp_path, stops, params=QUICK)
    told = []
    again = measure_sessions(
        [path], tmp_path, goes_on, params=QUICK, on_walk=lambda done, of: told.append((done, of))
    )
    first, *others = [w.row["trial_id"] for w in whole[0].walks]
    assert [first, others[0], *others] == asked
    assert [(1, 3), (2, 3), (3, 3)] == told
    assert rows(whole) == rows(again)


def test_only_a_walk_whose_file_is_damaged_is_measured_again(path, tmp_path):
    counts = []

    def counting(work, jobs):
        counts.append(len(jobs))
        return here(work, jobs)

    measure_sessions([path], tmp_path, counting, params=QUICK)
    measure_sessions([path], tmp_path, counting, params=QUICK)
    kept = sorted(tmp_path.glob("*.json"))
    kept[0].write_text("{", encoding="utf-8")
    assert read_kept(kept[0]) is None
    measure_sessions([path], tmp_path, counting, params=QUICK)
    assert [3, 1] == counts


def test_walks_measured_another_way_are_not_taken_for_these(path, tmp_path):
    measure_sessions([path], tmp_path, here, params=QUICK)
    other = measure_sessions(
        [path], tmp_path, here, params=MeasureParameters("centres", "capsules")
    )
    assert {"centres"} == {w.row["measure_rule"] for w in other[0].walks}
    assert 6 == len(list(tmp_path.glob("*.json")))


def test_settings_of_measuring_are_taken_by_name():
    assert MeasureParameters("published", "light") == measure_parameters(
        {"rule": "published", "surface": "light"}
    )
    assert MeasureParameters() == measure_parameters({})


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"ruel": "volume"}, "takes rule and surface"),
        ({"rule": "publishd"}, "choose volume, centres, published"),
        ({"rule": "published", "surface": "capsules"}, "choose another surface"),
    ],
)
def test_a_setting_of_measuring_that_does_not_exist_is_named(settings, said):
    with pytest.raises(ConfigError, match=said):
        measure_parameters(settings)


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
        found = measure_sessions(
            [path],
            tmp_path,
            lambda work, jobs: on_scheduler(work, jobs, cluster.scheduler_address),
            params=QUICK,
        )
    assert rows(whole) == rows(found)


def test_a_worker_that_does_not_see_the_folder_says_so(path):
    job = jobs_of(Recording(path), QUICK)[0]
    gone = WalkJob(str(Path(job.session) / "gone"), job.trial_id, 0.7, None, QUICK)
    with pytest.raises(DataError, match="every worker must see"):
        measure_job(gone)


def test_a_session_without_its_body_stream_says_which_file_to_restore(path, tmp_path):
    copy = tmp_path / "ses-001"
    shutil.copytree(path, copy)
    job = jobs_of(Recording(copy), QUICK)[0]
    (copy / "part-01" / "body.arrows").unlink()
    with pytest.raises(DataError, match=r"body\.arrows.*restore it"):
        measure_job(job)


def test_a_stream_cut_off_leaves_later_walks_out_and_says_so(path, tmp_path):
    copy = tmp_path / "ses-001"
    shutil.copytree(path, copy)
    stream = copy / "part-01" / "body.arrows"
    stream.write_bytes(stream.read_bytes()[: stream.stat().st_size // 2])
    intake = take_in(Recording(copy), QUICK)
    assert intake.source.status.startswith("damaged; body (part 1): ")
    assert "T03" in intake.source.status
    assert "T03" not in [walk.row["trial_id"] for walk in intake.walks]


@pytest.mark.parametrize("content", ["null", "[]", "3", '{"row": {}, "cells": [3]}', ""])
def test_a_kept_file_of_another_shape_is_measured_again(content, tmp_path):
    kept = tmp_path / "kept.json"
    kept.write_text(content, encoding="utf-8")
    assert read_kept(kept) is None


def test_a_walk_that_does_not_exist_is_named(path):
    job = jobs_of(Recording(path), QUICK)[0]
    with pytest.raises(UsageError, match="holds no finished walk 'T99'"):
        measure_job(WalkJob(job.session, "T99", 0.7, None, QUICK))


def test_a_measured_walk_survives_json_bit_for_bit():
    walk = MeasuredWalk(
        {"a": np.float64(0.1), "b": np.int64(3), "c": float("nan")},
        [{"v": 1 / 3}],
        [],
        ((1, 2, 3), None),
        np.array([[0.25, -1.5]]),
    )
    back = from_json(json.loads(json.dumps(as_json(walk))))
    assert ({"a": 0.1, "b": 3, "c": None}, [{"v": 1 / 3}]) == (back.row, back.collisions)
    assert ((1, 2, 3), None) == back.cells
    assert (walk.track_m == back.track_m).all()
