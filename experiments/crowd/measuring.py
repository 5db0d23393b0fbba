"""Measure the walks of a study one by one: kept as they are done, so that a stop loses one walk."""

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from analysis.gait import step_length_m
from experiments.crowd.intake import SessionIntake, answers_of, take_in
from experiments.crowd.measures import (
    DEFAULT_MEASURES,
    MeasuredWalk,
    MeasureParameters,
    measure_walk,
)
from experiments.crowd.replay import walk_of, walk_records
from lab.errors import DataError
from recording.durable import replace_file
from recording.reader import Recording
from recording.sealed import read_sealed, seal

MEASURE_VERSION: Final = 6
"""Raise it when measures change: what was kept before is then measured again."""
STORE_NAME: Final = "measured"


@dataclass(frozen=True)
class WalkJob:
    """One walk to be measured, with everything it depends on but the recording itself."""

    session: str
    trial_id: str
    step_m: float
    sex: str | None
    params: MeasureParameters


Runner: TypeAlias = Callable[
    [Callable[[WalkJob], MeasuredWalk], list[WalkJob]], Iterator[tuple[int, MeasuredWalk]]
]
"""Does a function for every job, anywhere, and yields (job number, result) as they finish."""


def measure_job(job: WalkJob) -> MeasuredWalk:
    """Measure one walk of a session on disk.

    Raises:
        DataError: the session is not there, as on a worker that does not share the folder.
    """
    path = Path(job.session)
    if not (path / "manifest.json").exists():
        raise DataError(
            f"{path} is not there; every worker must see the study's folder under the same path"
        )
    walk = walk_of(Recording(path), job.trial_id)
    return measure_walk(walk, job.step_m, job.params, sex=job.sex)


def measure_sessions(
    sessions: Sequence[Path],
    store: Path,
    run: Runner,
    *,
    params: MeasureParameters = DEFAULT_MEASURES,
    on_walk: Callable[[int, int], None] | None = None,
) -> list[SessionIntake]:
    """Measure every walk that `store` does not hold yet, then take in the sessions.

    Each walk is written to `store` as soon as it is measured, so a later call goes on where
    this one was stopped. `on_walk` is told how many of how many walks are done.
    """
    recordings = [Recording(path) for path in sessions]
    jobs: list[WalkJob] = []
    wanted: list[dict[str, Path]] = []
    missing: list[tuple[WalkJob, Path]] = []
    for recording in recordings:
        own = {
            job.trial_id: (job, _kept_at(store, recording, job))
            for job in jobs_of(recording, params)
        }
        wanted.append({trial: path for trial, (_, path) in own.items()})
        jobs += [job for job, _ in own.values()]
        missing += [(job, path) for job, path in own.values() if read_kept(path) is None]
    done = len(jobs) - len(missing)
    if on_walk is not None:
        on_walk(done, len(jobs))
    if missing:
        store.mkdir(parents=True, exist_ok=True)
        for number, measured in run(measure_job, [job for job, _ in missing]):
            replace_file(missing[number][1], seal(as_json(measured)))
            done += 1
            if on_walk is not None:
                on_walk(done, len(jobs))
    return [
        take_in(recording, params, measured=[_kept(path) for path in paths.values()])
        for recording, paths in zip(recordings, wanted, strict=True)
    ]


def jobs_of(recording: Recording, params: MeasureParameters) -> list[WalkJob]:
    """Return one job per intact walk of a session, training left out."""
    person, _ = answers_of(recording)
    sex = person.get("gender")
    step_m = step_length_m(sex)
    session = str(recording.path.resolve())
    return [
        WalkJob(session, record.trial_id, step_m, sex, params)
        for record in walk_records(recording, intact=True)
    ]


def as_json(measured: MeasuredWalk) -> dict[str, Any]:
    """Return a measured walk as JSON holds it; numbers come back bit for bit."""
    return {
        "row": {k: _plain(v) for k, v in measured.row.items()},
        "collisions": [{k: _plain(v) for k, v in c.items()} for c in measured.collisions],
        "crossings": [{k: _plain(v) for k, v in c.items()} for c in measured.crossings],
        "cells": [None if c is None else [int(k) for k in c] for c in measured.cells],
        "track_m": np.round(measured.track_m, 6).tolist(),
    }


def from_json(content: dict[str, Any]) -> MeasuredWalk:
    """Return what `as_json` was given."""
    return MeasuredWalk(
        row=content["row"],
        collisions=content["collisions"],
        crossings=content["crossings"],
        cells=tuple(None if c is None else (c[0], c[1], c[2]) for c in content["cells"]),
        track_m=np.array(content["track_m"], float).reshape(-1, 2),
    )


def read_kept(path: Path) -> MeasuredWalk | None:
    """Return a walk measured before; None when there is none, or a damaged file."""
    try:
        kept = read_sealed(path)
        return from_json(kept.content) if kept.is_sealed else None
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None


def _kept(path: Path) -> MeasuredWalk:
    measured = read_kept(path)
    if measured is None:
        raise DataError(f"{path} was measured and is gone or damaged; run the analysis again")
    return measured


def _kept_at(store: Path, recording: Recording, job: WalkJob) -> Path:
    """Return where a walk is kept: the name changes with the recording and with how it is
    measured, so nothing out of date is ever used.
    """
    manifest = recording.manifest
    content = [
        MEASURE_VERSION,
        manifest.study,
        [[s.name, s.rows, s.sha256] for part in manifest.parts for s in part.streams],
        [part.journal.sha256 if part.journal else "" for part in manifest.parts],
        job.trial_id,
        job.step_m,
        job.sex,
        asdict(job.params),
    ]
    digest = hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()[:16]
    trial = re.sub(r"[^A-Za-z0-9_-]", "_", job.trial_id)  # which foreign data may make a path
    return store / f"{recording.path.parent.name}_{recording.path.name}_{trial}_{digest}.json"


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value
