"""Create, hold and list session folders.

`<data_root>/<real|simulated>/<study>/sub-<ID>/ses-<NNN>/` holds `manifest.json` and one folder
per part. Every resumption begins a new part, so no file is ever appended to after a crash.
"""

import shlex
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from visavis.lab.clock import Clock
from visavis.lab.closing import Closing
from visavis.lab.errors import UsageError
from visavis.recording.durable import make_folder, sha256_of, sync_folder, write_failure
from visavis.recording.lock import SessionLock
from visavis.recording.manifest import (
    MAX_SESSION,
    PARTICIPANT,
    Manifest,
    Part,
    PartStatus,
    read_manifest,
    write_manifest,
)
from visavis.recording.recovery import RecoveryReport, other_files, recover_held
from visavis.recording.summary import JournalSummary, PartSummary, StreamSummary

FileOfPart = TypeVar("FileOfPart", StreamSummary, JournalSummary)
SIMULATED_ROOT = "simulated"
REAL_ROOT = "real"


def study_dir(data_root: Path, study: str, *, is_simulated: bool) -> Path:
    """Return the folder of a study; simulated and real studies have different roots."""
    return data_root / (SIMULATED_ROOT if is_simulated else REAL_ROOT) / study


def session_dir(
    data_root: Path, study: str, participant: str, session: int, *, is_simulated: bool
) -> Path:
    """Return the folder of a session, whether or not it exists."""
    if not PARTICIPANT.fullmatch(participant):
        raise UsageError(
            f"participant label {participant!r} may hold only letters and digits; "
            "use the one that the ledger issued"
        )
    if not 1 <= session <= MAX_SESSION:
        raise UsageError(f"session number {session} must lie between 1 and {MAX_SESSION}")
    folder = study_dir(data_root, study, is_simulated=is_simulated)
    return folder / f"sub-{participant}" / f"ses-{session:03d}"


class SessionFolder(Closing):
    """A session held for writing; release it with `close`."""

    def __init__(self, path: Path, manifest: Manifest, lock: SessionLock) -> None:
        self.path = path
        self.manifest = manifest
        self._lock = lock

    def begin_part(self, clock: Clock) -> Path:
        """Add a part, marked running, and return its new, empty folder for a `Recorder`."""
        if any(p.status == "running" for p in self.manifest.parts):
            raise UsageError(f"{self.path}: a part is being recorded already; end it first")
        number = 1 + max((p.number for p in self.manifest.parts), default=0)
        part = Part(number, "running", clock.now_ns(), clock.wall_iso())
        self._write(self.manifest.with_part(part))
        folder = self.path / part.folder
        make_folder(folder)
        return folder

    def end_part(
        self,
        clock: Clock,
        summary: PartSummary | None,
        *,
        reason: str = "",
        status: PartStatus | None = None,
    ) -> None:
        """Record how the running part ended; `summary` is None when the recorder is lost."""
        running = next((p for p in self.manifest.parts if p.status == "running"), None)
        if running is None:
            raise UsageError(f"{self.path}: no part is being recorded")
        folder = self.path / running.folder
        if summary is None:
            outcome: PartStatus = status or "crashed"
        else:
            outcome = status or ("crashed" if summary.failure else summary.status)
        finished_part = replace(
            running,
            status=outcome,
            ended_ns=clock.now_ns(),
            ended_wall_iso=clock.wall_iso(),
            reason="; ".join(t for t in (reason, summary.failure if summary else "") if t),
            streams=tuple(_as_found(folder, s) for s in summary.streams) if summary else (),
            journal=_as_found(folder, summary.journal) if summary else None,
            others=other_files(folder),
        )
        self._write(self.manifest.with_part(finished_part))

    def describe(
        self,
        *,
        devices: Sequence[Any] | None = None,
        calibrations: Sequence[Any] | None = None,
    ) -> None:
        """Replace the devices or calibrations in the manifest."""
        manifest = self.manifest
        if devices is not None:
            manifest = replace(manifest, devices=devices)
        if calibrations is not None:
            manifest = replace(manifest, calibrations=calibrations)
        self._write(manifest)

    def close(self) -> None:
        """Release the session for other processes; idempotent."""
        self._lock.release()

    def _write(self, manifest: Manifest) -> None:
        write_manifest(self.path, manifest)
        self.manifest = manifest


def _as_found(folder: Path, summary: FileOfPart) -> FileOfPart:
    """Return the summary of a file with the hash of what was written before writing failed."""
    path = folder / summary.file
    if summary.sha256 or not path.is_file():
        return summary
    try:
        return replace(summary, bytes=path.stat().st_size, sha256=sha256_of(path))
    except OSError:  # the disk that refused to write refuses to read
        return summary


def create_session(data_root: Path, manifest: Manifest) -> SessionFolder:
    """Create a session folder with its manifest, atomically, and hold it.

    Raises UsageError when the session exists or another process holds it.
    """
    path = session_dir(
        data_root,
        manifest.study,
        manifest.participant,
        manifest.session,
        is_simulated=manifest.is_simulated,
    )
    make_folder(path.parent, exist_ok=True)
    lock = SessionLock(path)
    try:
        if path.exists():
            raise UsageError(
                f"session {path} exists already and is never overwritten; {_way_on(path)}"
                f"run a further one: add --session {manifest.session + 1}"
            )
        _put_in_place(path, manifest)
    except BaseException:
        lock.release()
        raise
    return SessionFolder(path, manifest, lock)


def _way_on(path: Path) -> str:
    """Return the beginning of what can be done with a session that is there already."""
    parts = read_manifest(path).parts
    if parts and parts[-1].status == "complete":
        return ""
    return f"go on with it: visavis resume {shlex.quote(str(path))}, or "


def _put_in_place(path: Path, manifest: Manifest) -> None:
    # A folder appears under its name only with its manifest in it; what a killed process left
    # under the temporary name holds no data.
    temporary = path.with_name(f".{path.name}.new")
    try:
        if temporary.exists():
            shutil.rmtree(temporary)
        make_folder(temporary)
        write_manifest(temporary, manifest)
        temporary.rename(path)
        sync_folder(path.parent)
    except OSError as error:
        raise write_failure(path, error) from error


def open_session(path: Path) -> tuple[SessionFolder, RecoveryReport]:
    """Lock an existing session in order to continue it; parts whose process died are marked
    crashed.
    """
    read_manifest(path)
    lock = SessionLock(path)
    try:
        report = recover_held(path)
        manifest = read_manifest(path)
    except BaseException:
        lock.release()
        raise
    return SessionFolder(path, manifest, lock), report
