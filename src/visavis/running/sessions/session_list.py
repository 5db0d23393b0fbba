"""The list of what must be in a study's folder: every session that was begun, so that one can miss.

A line is added as a part of a session begins and as it ends. Lines are chained and have a copy, as
the ledger's; a study that was begun by an earlier version has a list from its next session on,
whose first line names the sessions before it (`earlier`).
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from visavis.lab.clock import SystemClock
from visavis.lab.errors import DataError, LedgerError, RecordingError
from visavis.protocol.people.file_lock import locked
from visavis.protocol.people.ledger import Ledger
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.manifest import MANIFEST_NAME, Part, read_manifest
from visavis.running.sessions.study_folder import SIMULATED_PREFIX, session_folders

LIST_NAME: Final = "sessions.jsonl"
LOCK_NAME: Final = ".sessions.lock"
RESTORE: Final = "restore the list from a copy of the study"


@dataclass(frozen=True)
class ListedSession:
    """A session as it was last listed: `part` is its newest part, `at` when, `status` how it is."""

    name: str
    part: int
    at: str
    status: str


def list_session(session: Path, part: int, status: str, at: str) -> None:
    """Add a session to its study's list: its newest part, how that is, and when.

    Raises:
        RecordingError: the list is damaged or cannot be written.
    """
    line = {
        "event": "session",
        "participant": session.parent.name.removeprefix("sub-"),
        "session": session.name,
        "part": part,
        "status": status,
        "at": at,
    }
    _append(session.parent.parent, line)


def list_renaming(study: Path, label: str, new_label: str, at: str) -> None:
    """Note in a study's list that somebody's sessions bear a corrected label; once is enough.

    Raises:
        RecordingError: the list is damaged or cannot be written.
    """
    line = {"event": "renamed", "participant": label, "to": new_label, "at": at}
    records = read_lines(study / LIST_NAME).records
    if records and not any(
        (r.get("event"), r.get("participant")) == ("renamed", label) for r in records
    ):
        _append(study, line)


def sign_list(study: Path) -> tuple[str, ...]:
    """Sign off what is in a study's folder now; return the sessions that are no longer missed.

    Raises:
        RecordingError: the list cannot be written.
    """
    absent = tuple(one.name for one in _absent(study))
    if absent:
        _append(study, {"event": "signed", "without": list(absent), "at": SystemClock().wall_iso()})
    return absent


def list_problems(study: Path) -> tuple[str, ...]:
    """Return what is missing of a study, or wrong with its list, a line each."""
    try:
        notes = read_lines(study / LIST_NAME).notes
    except OSError as error:
        return (str(error),)
    return (
        *(f"{note}; `visavis recover {study}` mends it" for note in notes),
        *_missing(study),
        *(
            f"{study / LIST_NAME} does not say how {name} ended; `visavis recover {study}` adds it"
            for name in _without_end(study)
        ),
    )


def complete_list(study: Path) -> tuple[str, ...]:
    """Add how sessions ended whose last line could not be written; return their names.

    Raises:
        RecordingError: the list is damaged or cannot be written.
    """
    names = _without_end(study)
    for name in names:
        part = read_manifest(study / name).parts[-1]
        list_session(study / name, part.number, part.status, part.ended_wall_iso or "")
    return names


def _without_end(study: Path) -> tuple[str, ...]:
    """Return the sessions that ended, of which the list knows only that they began."""
    newest_parts = _newest_parts(study)
    try:
        listed = listed_sessions(study)
    except RecordingError:
        return ()  # which is reported by itself
    return tuple(
        one.name
        for one in listed.values()
        if one.status == "running"
        and (part := newest_parts.get(one.name)) is not None
        and part.status in ("complete", "aborted")
        and part.number == one.part
    )


def _newest_parts(study: Path) -> dict[str, Part]:
    """Return the newest part of every session that is there, by the session's name."""
    parts = {}
    for session in session_folders(study):
        with suppress(RecordingError):  # which is reported where the session is read
            manifest = read_manifest(session)
            if manifest.parts:
                parts[f"{session.parent.name}/{session.name}"] = manifest.parts[-1]
    return parts


def _unlisted(study: Path) -> Iterator[str]:
    """Yield the sessions and parts that are there and of which the list knows nothing."""
    lines = read_lines(study / LIST_NAME)
    if not lines.records:
        if (study / LOCK_NAME).exists() and any(study.glob("sub-*/ses-*")):
            yield f"{study / LIST_NAME}, the list of sessions, is gone or empty; {RESTORE}"
        return
    earlier = lines.records[0].get("earlier")
    if earlier is None:
        return
    known = dict.fromkeys(earlier, 0)
    for record in lines.records:
        if record.get("event") == "renamed":
            known = {_corrected(name, record): part for name, part in known.items()}
            earlier = [_corrected(name, record) for name in earlier]
        elif record.get("event") == "session":
            name = f"sub-{record['participant']}/{record['session']}"
            known[name] = max(known.get(name, 0), record["part"])
    for name, part in _newest_parts(study).items():
        if name not in known:
            yield f"{study / LIST_NAME} does not know {name}, which is there; {RESTORE}"
        elif known[name] < part.number and name not in earlier:
            yield f"{study / LIST_NAME} does not know part {part.number} of {name}; {RESTORE}"


def _missing(study: Path) -> tuple[str, ...]:
    """Return what is missing by the list, or why the list cannot say so, a line each."""
    try:
        absent = _absent(study)
        unlisted = tuple(_unlisted(study))
    except (RecordingError, OSError) as error:
        return (str(error),)
    return (
        *unlisted,
        *(
            f"{study / one.name} is gone: it was there on {one.at[:10]} (part {one.part}, "
            f"{one.status}); restore it from a copy, or sign off that it is no part of the study: "
            f"visavis check {study} --sign"
            for one in absent
        ),
        *(
            f"{path} is a link to {path.readlink()}; move the data themselves here"
            for path in sorted((*study.glob("*"), *study.glob("sub-*/*")))
            if path.is_symlink()
        ),
    )


def require_whole(study: Path, *, accept: bool) -> tuple[str, ...]:
    """Return what a study misses of its list, where that is accepted.

    A list that was cut short is read from its copy, as a full disk may leave it.

    Raises:
        DataError: something is missing, and that was not accepted.
    """
    problems = _missing(study)
    if problems and not accept:
        raise DataError("\n".join([*problems, "--accept-damage analyses what is left"]))
    return problems


def _absent(study: Path) -> tuple[ListedSession, ...]:
    """Return the listed sessions that are not there, though nobody withdrew or signed them off."""
    absent = [one for one in listed_sessions(study).values() if not _is_there(study, one)]
    withdrawn_people = _withdrawn(study) if absent else frozenset()
    return tuple(one for one in absent if one.name.partition("/")[0] not in withdrawn_people)


def listed_sessions(study: Path) -> dict[str, ListedSession]:
    """Return the sessions that belong to a study, as they were last listed, by name.

    Raises:
        RecordingError: the list is damaged, or cannot be read.
    """
    try:
        lines = read_lines(study / LIST_NAME)
    except OSError as error:
        raise RecordingError(
            f"the list of sessions cannot be read ({error}); restore it from a backup"
        ) from error
    if lines.damaged_line is not None:
        number, what = lines.damaged_line
        raise RecordingError(
            f"{study / LIST_NAME}:{number}: the list of sessions is damaged, the line {what}; "
            f"`visavis recover {study}` puts its copy in its place where that is intact"
        )
    last_by_name: dict[str, ListedSession] = {}
    for record in lines.records:
        if record.get("event") == "signed":
            for name in record["without"]:
                last_by_name.pop(name, None)
            continue
        if record.get("event") == "renamed":
            last_by_name = {
                (new_name := _corrected(name, record)): replace(one, name=new_name)
                for name, one in last_by_name.items()
            }
            continue
        name = f"sub-{record['participant']}/{record['session']}"
        last_by_name[name] = ListedSession(name, record["part"], record["at"], record["status"])
    return last_by_name


def _corrected(name: str, record: dict[str, Any]) -> str:
    """Return a session's name with the label that a line of the list says is the right one."""
    folder, _, session = name.partition("/")
    is_own = folder == f"sub-{record['participant']}"
    return f"sub-{record['to']}/{session}" if is_own else name


def _is_there(study: Path, one: ListedSession) -> bool:
    session = study / one.name
    is_begun = one.status != "running"  # a kill may come before the part has a folder
    part = session / f"part-{one.part:02d}"
    return (session / MANIFEST_NAME).exists() and (part.is_dir() or not is_begun)


def _withdrawn(study: Path) -> frozenset[str]:
    """Return the folders of people who withdrew or are being withdrawn, by name."""
    is_simulated = study.resolve().parent.name == SIMULATED_ROOT
    ledger = Ledger(study, SystemClock(), prefix=SIMULATED_PREFIX if is_simulated else "")
    try:
        return frozenset(f"sub-{e.label}" for e in ledger.list() if e.status != "active")
    except LedgerError:
        return frozenset()  # which is reported where the ledger is read


def _names(study: Path) -> list[str]:
    return [f"{path.parent.name}/{path.name}" for path in session_folders(study)]


def _append(study: Path, line: dict[str, Any]) -> None:
    try:
        with locked(study / LOCK_NAME):
            if not read_lines(study / LIST_NAME).records:
                this = f"sub-{line.get('participant')}/{line.get('session')}"
                line = {**line, "earlier": [name for name in _names(study) if name != this]}
            append_lines(study / LIST_NAME, [line])
    except (LedgerError, OSError, ValueError) as error:
        raise RecordingError(
            f"{study / LIST_NAME}, the list of sessions, cannot be written: {error}; "
            f"`visavis recover {study}` puts its copy in its place where that is intact"
        ) from error
