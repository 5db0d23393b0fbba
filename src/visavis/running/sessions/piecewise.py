"""Measure the trials of a study one by one, on any machines; stored results are not repeated."""

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

from visavis.lab.errors import DataError
from visavis.recording.durable import replace_file
from visavis.recording.reader import Recording
from visavis.recording.sealed import read_sealed, seal
from visavis.results.intake import SessionIntake
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.study.cast import use_recorded_cast
from visavis.study.catalogue import reference_of
from visavis.study.pieces import MeasuredTrial, Pieces


@dataclass(frozen=True)
class TrialJob:
    """One trial to be measured, with everything it depends on but the recording itself."""

    study: str
    session: str
    trial_id: str
    how: Any


Runner: TypeAlias = Callable[
    [Callable[[TrialJob], MeasuredTrial], list[TrialJob]], Iterator[tuple[int, MeasuredTrial]]
]
"""Calls a function for every job, on any machine; yields (job number, result) as they finish."""


def measure_job(job: TrialJob) -> MeasuredTrial:
    """Measure one trial of a session on disk.

    Raises:
        DataError: the session is not there, as on a worker that does not share the folder.
    """
    path = Path(job.session)
    if not (path / "manifest.json").exists():
        raise DataError(
            f"{path} is not there; every worker must see the study's folder under the same path"
        )
    recording = Recording(path)
    use_recorded_cast(recording)
    pieces = find_study(job.study).pieces
    if pieces is None:
        raise DataError(f"trials of {job.study} are not measured one by one")
    return pieces.measure(recording, job.trial_id, job.how)


def measure_sessions(
    study: OpenedStudy,
    pieces: Pieces,
    sessions: Sequence[Path],
    store: Path,
    run: Runner,
    settings: Mapping[str, Any],
    on_trial: Callable[[int, int], None] | None = None,
) -> list[SessionIntake]:
    """Measure every trial that `store` does not hold yet, then take in the sessions.

    Each trial is written to `store` as soon as it is measured, so a later call goes on where
    this one was stopped. `on_trial` is called with the number of trials done and of all.
    """
    how, reference = pieces.how_with(settings), reference_of(study.study)
    recordings = [Recording(path) for path in sessions]
    for recording in recordings:  # an error is better now than after hours of measuring
        study.experiment_of(recording)
    jobs: list[tuple[TrialJob, Path]] = []
    paths_by_session: list[dict[str, Path]] = []
    for recording in recordings:
        session = str(recording.path.resolve())
        own = {
            trial: stored_trial_path(store, recording, trial, pieces, how)
            for trial in pieces.trials(recording)
        }
        paths_by_session.append(own)
        jobs += [(TrialJob(reference, session, trial, how), at) for trial, at in own.items()]
    missing = [(job, at) for job, at in jobs if read_stored_trial(at) is None]
    stored_count = len(jobs) - len(missing)
    report_progress = on_trial or (lambda count, total: None)
    report_progress(stored_count, len(jobs))
    if missing:
        store.mkdir(parents=True, exist_ok=True)
        for number, result in run(measure_job, [job for job, _ in missing]):
            replace_file(missing[number][1], seal(asdict(result)))
            stored_count += 1
            report_progress(stored_count, len(jobs))
    return [
        study.measure(
            recording, settings, {trial: _stored_trial(at) for trial, at in paths.items()}
        )
        for recording, paths in zip(recordings, paths_by_session, strict=True)
    ]


def read_stored_trial(path: Path) -> MeasuredTrial | None:
    """Return a trial measured before; None when there is none, or a damaged file."""
    try:
        sealed_file = read_sealed(path)
        if not sealed_file.is_sealed:
            return None
        row, tables = sealed_file.content["row"], sealed_file.content["tables"]
        return MeasuredTrial({**row}, {name: [{**r} for r in tables[name]] for name in tables})
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None


def _stored_trial(path: Path) -> MeasuredTrial:
    trial = read_stored_trial(path)
    if trial is None:
        raise DataError(f"{path} was measured and is gone or damaged; run the analysis again")
    return trial


def stored_trial_path(
    store: Path, recording: Recording, trial_id: str, pieces: Pieces, how: Any
) -> Path:
    """Return the file of a measured trial. Its name changes with the recording and with the way of
    measuring, so an outdated result is never used.
    """
    manifest = recording.manifest
    content = [
        pieces.version,
        manifest.study,
        [[s.name, s.rows, s.sha256] for part in manifest.parts for s in part.streams],
        [part.journal.sha256 if part.journal else "" for part in manifest.parts],
        trial_id,
        pieces.marks(how),
    ]
    digest = hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()[:16]
    trial = re.sub(r"[^A-Za-z0-9_-]", "_", trial_id)  # foreign ones may hold a slash
    return store / f"{recording.path.parent.name}_{recording.path.name}_{trial}_{digest}.json"
