"""Recover a session whose process died, without changing its raw files."""

from dataclasses import dataclass, replace
from pathlib import Path

from visavis.lab.errors import RecordingError
from visavis.recording.durable import protect_files, sha256_of
from visavis.recording.journal import JOURNAL_NAME
from visavis.recording.journal_file import read_journal
from visavis.recording.lock import SessionLock
from visavis.recording.manifest import (
    MANIFEST_NAME,
    SEALED_SINCE,
    Manifest,
    Part,
    PartStatus,
    read_manifest,
    refuse_links,
    write_manifest,
)
from visavis.recording.sealed import copy_path, copy_state, read_sealed, restore
from visavis.recording.stream_file import read_stream_file
from visavis.recording.summary import FileSummary, JournalSummary, StreamSummary


@dataclass(frozen=True)
class StreamFindings:
    """What is left of one stream file; `problems` names every damage."""

    name: str
    rows: int
    is_ended: bool
    problems: tuple[str, ...]


@dataclass(frozen=True)
class PartFindings:
    """What is left of one part, and what the manifest says of it before and now."""

    number: int
    status_before: PartStatus
    status: PartStatus
    trials: int
    events: int
    streams: tuple[StreamFindings, ...]
    problems: tuple[str, ...]


@dataclass(frozen=True)
class RecoveryReport:
    """What recovery found; `changed` tells whether the manifest was replaced.

    `repaired` says what was put in place of which damaged file.
    """

    session: Path
    changed: bool
    parts: tuple[PartFindings, ...]
    repaired: tuple[str, ...] = ()

    @property
    def trials(self) -> int:
        """Number of trial rows that were saved."""
        return sum(p.trials for p in self.parts)


def recover(session_dir: Path) -> RecoveryReport:
    """Mark parts whose process died as crashed and report what is left of every part.

    A damaged or missing manifest is put back from its copy first. Raises UsageError while another
    process still records the session, RecordingError when no copy of the manifest can be read.
    """
    if not copy_path(session_dir / MANIFEST_NAME).exists():
        read_manifest(session_dir)
    lock = SessionLock(session_dir)
    try:
        return recover_held(session_dir)
    finally:
        lock.release()


def recover_held(session_dir: Path) -> RecoveryReport:
    """Do the same as `recover` for a caller that already holds the session's lock."""
    refuse_links(session_dir)
    manifest, repairs = _manifest_or_copy(session_dir)
    findings = []
    is_changed = False
    for part in manifest.parts:
        findings_of_part, part_now = _take_stock(session_dir, part)
        findings.append(findings_of_part)
        if part_now != part:
            manifest = manifest.with_part(part_now)
            is_changed = True
    copy = copy_state(session_dir / MANIFEST_NAME)
    if is_changed or (copy != "same" and manifest.format_version >= SEALED_SINCE):
        write_manifest(session_dir, manifest)
    return RecoveryReport(session_dir, is_changed, tuple(findings), repairs)


def other_files(folder: Path) -> tuple[FileSummary, ...]:
    """Return the files of a part that are neither stream nor journal, kept from others' eyes.

    Other code wrote them: the doctor's findings, a tracker's own recording.
    """
    own_suffixes = (".arrows", ".jsonl")
    paths = [
        path
        for path in (sorted(folder.iterdir()) if folder.is_dir() else ())
        if path.is_file() and path.suffix not in own_suffixes and not path.name.startswith(".")
    ]
    protect_files(paths)
    return tuple(FileSummary(p.name, p.stat().st_size, sha256_of(p)) for p in paths)


def _manifest_or_copy(session_dir: Path) -> tuple[Manifest, tuple[str, ...]]:
    path = session_dir / MANIFEST_NAME
    try:
        manifest = read_manifest(session_dir)
    except RecordingError:
        if not restore(path):
            raise
    else:
        if not _is_strayed(path, manifest) or not restore(path):
            return manifest, ()
    damaged_path = path.with_name(path.name + ".damaged")
    note = f"; the damaged one is kept as {damaged_path.name}" if damaged_path.exists() else ""
    return read_manifest(session_dir), (f"{path} was put back from its copy{note}",)


def _is_strayed(path: Path, manifest: Manifest) -> bool:
    """Tell whether a manifest is another session's while its copy is of this folder."""
    here = path.parent.resolve()
    try:
        own = read_sealed(copy_path(path)).content
        whose = str(own["participant"]), int(own["session"])
    except (OSError, ValueError, KeyError, TypeError):
        return False
    is_of_here = (f"sub-{whose[0]}", f"ses-{whose[1]:03d}") == (here.parent.name, here.name)
    return is_of_here and whose != (manifest.participant, manifest.session)


def _take_stock(session_dir: Path, part: Part) -> tuple[PartFindings, Part]:
    folder = session_dir / part.folder
    journal = read_journal(folder / JOURNAL_NAME)
    names = list(
        dict.fromkeys([*journal.headers, *(p.stem for p in sorted(folder.glob("*.arrows")))])
    )
    streams, summaries = [], []
    for name in names:
        path = folder / f"{name}.arrows"
        content = read_stream_file(path, journal.headers.get(name))
        streams.append(StreamFindings(name, content.n_rows, content.is_ended, content.problems))
        if path.exists():
            t_host_ns = content.columns["t_host_ns"].tolist() if content.n_rows else [None]
            summaries.append(
                StreamSummary(
                    name=name,
                    file=path.name,
                    rows=content.n_rows,
                    bytes=path.stat().st_size,
                    dropped=0,
                    first_t_host_ns=t_host_ns[0],
                    last_t_host_ns=t_host_ns[-1],
                    sha256=sha256_of(path),
                    closed_cleanly=False,
                )
            )
    now = part
    if part.status == "running":
        now = replace(
            part,
            status="crashed",
            reason=part.reason or "the recording process ended without closing its files",
            streams=tuple(summaries),
            journal=_journal_as_found(folder / JOURNAL_NAME, journal.n_lines, len(journal.trials)),
            others=other_files(folder),
        )
    findings = PartFindings(
        number=part.number,
        status_before=part.status,
        status=now.status,
        trials=len(journal.trials),
        events=len(journal.events),
        streams=tuple(streams),
        problems=journal.problems,
    )
    return findings, now


def _journal_as_found(path: Path, lines: int, trials: int) -> JournalSummary | None:
    if not path.exists():
        return None
    return JournalSummary(
        file=path.name,
        lines=lines,
        trials=trials,
        bytes=path.stat().st_size,
        sha256=sha256_of(path),
        closed_cleanly=False,
    )
