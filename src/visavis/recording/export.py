"""Write copies of a recording that other tools read: Parquet and CSV, BIDS, XDF."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from visavis.lab.errors import RecordingError, UsageError
from visavis.recording.bids import NOTHING_SAID, export_bids
from visavis.recording.bids_about import DatasetAbout
from visavis.recording.columns import STAMPS
from visavis.recording.csv_file import write_csv
from visavis.recording.durable import make_folder, write_failure
from visavis.recording.reader import Recording, component_names
from visavis.recording.xdf import export_xdf


def export_tables(recording: Recording, target: Path) -> tuple[Path, ...]:
    """Write `<stream>.parquet` for every stream, `trials.csv` and `trials.parquet`.

    Units, frames and descriptions are field metadata; every table carries `is_simulated`.
    CSV is UTF-8 with dot decimals and commas whatever the locale, missing values are empty;
    text that a spreadsheet would run is neutralised (`visavis.recording.csv_file`).
    Raises RecordingError when a file is there already.
    """
    make_folder(target, exist_ok=True)
    stream_files = [_stream_parquet(recording, name, target) for name in recording.stream_names]
    trials = recording.trials().assign(is_simulated=recording.is_simulated)
    csv = _new_file(target / "trials.csv")
    parquet = _new_file(target / "trials.parquet")
    try:
        write_csv(trials, csv)
        trials.to_parquet(parquet, index=False)
    except OSError as error:
        raise write_failure(csv, error) from error
    return (*stream_files, csv, parquet)


def _new_file(path: Path) -> Path:
    if path.exists():
        raise RecordingError(f"{path} exists already; export into an empty folder")
    return path


def _stream_parquet(recording: Recording, name: str, target: Path) -> Path:
    path = _new_file(target / f"{name}.parquet")
    frame = recording.stream(name)
    table = pa.Table.from_pandas(frame, preserve_index=False)
    schema = recording.stream_schema(name)
    notes: dict[str, dict[str, str]] = {}
    for field in STAMPS + (schema.fields if schema is not None else ()):
        n = 1
        for size in field.shape:
            n *= size
        flat: Sequence[str] = component_names(field.name, n) if field.shape else [field.name]
        for column in flat:
            notes[column] = {
                "unit": field.unit,
                "frame": field.frame,
                "description": field.description,
            }
    fields = [f.with_metadata(notes[f.name]) if f.name in notes else f for f in table.schema]
    metadata = {
        **(table.schema.metadata or {}),
        b"stream": name.encode(),
        b"is_simulated": b"true" if recording.is_simulated else b"false",
        b"study": recording.manifest.study.encode(),
        b"participant": recording.manifest.participant.encode(),
        b"session": str(recording.manifest.session).encode(),
    }
    try:
        pq.write_table(table.cast(pa.schema(fields, metadata=metadata)), path, compression="zstd")
    except OSError as error:
        raise write_failure(path, error) from error
    return path


def export_session(session_dir: Path, format_name: str, target: Path) -> tuple[Path, ...]:
    """Export one session as it was recorded; see `export_recording`."""
    return export_recording(Recording(session_dir), format_name, target)


def export_recording(recording: Recording, format_name: str, target: Path) -> tuple[Path, ...]:
    """Export one session as "parquet" (tables), "bids" or "xdf" and return the files written."""
    if format_name == "parquet":
        return export_tables(recording, target)
    if format_name == "bids":
        return export_together([recording], target)
    if format_name == "xdf":
        return export_xdf(recording, target)
    raise UsageError(f"export format {format_name!r} is unknown; choose parquet, bids or xdf")


def export_together(
    recordings: Sequence[Recording], target: Path, about: DatasetAbout = NOTHING_SAID
) -> tuple[Path, ...]:
    """Write recordings of one study as one BIDS data set and return the files written."""
    study = recordings[0].manifest.study
    task = "".join(c for c in study if c.isascii() and c.isalnum())
    return export_bids(recordings, target, task=task, dataset_name=study, about=about)
