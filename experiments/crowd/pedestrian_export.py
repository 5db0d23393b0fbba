"""Export the walks of a session to files that PedPy reads."""

from pathlib import Path

from visavis.experiments.crowd.pedestrian import write_pedpy_files
from visavis.experiments.crowd.study import study
from visavis.experiments.crowd.walks import load_walk, walk_records
from visavis.lab.errors import UsageError
from visavis.recording.reader import Recording


def export_walks(recording: Recording, output: Path) -> tuple[Path, ...]:
    """Write every finished walk as text, sqlite and (with h5py) HDF5; return what was written.

    Files of simulated sessions say so in their names.

    Raises:
        UsageError: the session is of another study, or holds no finished walk.
    """
    session = recording.path
    if recording.manifest.study != study.name:
        raise UsageError(
            f"{session} is a session of {recording.manifest.study}; only walks of the crowd study "
            "can be exported for PedPy"
        )
    records = walk_records(recording, intact=True)
    if not records:
        raise UsageError(f"{session} holds no finished walk")
    mark = "_simulated" if recording.is_simulated else ""
    paths: list[Path] = []
    for record in records:
        name = f"sub-{recording.manifest.participant}_{record.trial_id}{mark}"
        paths += write_pedpy_files(load_walk(recording, record), output, name)
    return tuple(paths)
