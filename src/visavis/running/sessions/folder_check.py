"""Check every file of a study's folder, and restore files that have an intact copy."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from visavis.lab.clock import SystemClock
from visavis.lab.errors import LabError, RecordingError
from visavis.lab.luminance import LUMINANCE_KEY
from visavis.protocol.people.exports_register import LOCK_NAME as REGISTER_LOCK
from visavis.protocol.people.exports_register import REGISTER_NAME, registered_exports
from visavis.protocol.people.ledger import LEDGER_NAME, Ledger
from visavis.protocol.people.own_body import FILE_NAMES, OWN_BODY_NAME, read_own_body
from visavis.recording.annotations import ANNOTATIONS_NAME
from visavis.recording.chained import read_lines, repair_lines
from visavis.recording.durable import replace_file, sha256_of
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.integrity import damage_of
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover
from visavis.recording.remarks import REMARKS_NAME, remarks_of
from visavis.recording.sealed import copy_path, copy_state, restore
from visavis.running.sessions.coding_check import coding_problems
from visavis.running.sessions.plan_lock import LOCK_NAME, PEEKS_NAME, read_lock, read_peeks
from visavis.running.sessions.session_list import LIST_NAME, complete_list, list_problems
from visavis.running.sessions.study_folder import (
    SETTINGS_NAME,
    SIMULATED_PREFIX,
    read_settings,
    session_folders,
)


def is_study(folder: Path) -> bool:
    """Tell whether a folder is that of a study: it has settings, a ledger, or a copy of one."""
    names = (SETTINGS_NAME, LEDGER_NAME)
    return any((folder / n).exists() or copy_path(folder / n).exists() for n in names)


def session_problems(session: Path) -> tuple[str, ...]:
    """Return everything wrong with the files of a session, copies included."""
    try:
        report = damage_of(Recording(session))
    except RecordingError as error:
        return (str(error),)
    return (*report.problems, *report.notes)


def study_problems(
    folder: Path,
    problems_of: Callable[[Path], tuple[str, ...]] = session_problems,
) -> tuple[str, ...]:
    """Return everything wrong with any file of a study: settings, ledger, every session.

    Copies that differ are named, too, though nothing reads them while the original is intact.
    `problems_of` reads one session's files: who checks a study again and again may remember those
    of which nothing changed.
    """
    problems = [*_settings_problems(folder), *_ledger_problems(folder), *_export_problems(folder)]
    problems += _lock_problems(folder)
    problems += [problem for path in _bodies(folder) for problem in _body_problems(path)]
    problems += [problem for path in _remarks(folder) for problem in _remark_problems(path)]
    annotation_files = sorted(folder.glob(f"sub-*/{ANNOTATIONS_NAME}"))
    problems += [problem for path in annotation_files for problem in coding_problems(path.parent)]
    problems += [*list_problems(folder), *_unknown_people(folder)]
    for session in session_folders(folder):
        problems += problems_of(session)
    return tuple(problems)


def luminances_of(sessions: Sequence[Path]) -> dict[tuple[str, str], list[Path]]:
    """Return the sessions before a monitor by the table of luminances that drew them.

    A table is its SHA-256 (hex) and the screen that it is of, both "" where nothing was measured.
    Sessions whose manifests are damaged are left out.
    """
    by_table: dict[tuple[str, str], list[Path]] = {}
    for session in sessions:
        with suppress(RecordingError):
            configuration = Recording(session).manifest.configuration
            if not isinstance(configuration, Mapping) or not configuration.get("screen"):
                continue
            entry = configuration.get(LUMINANCE_KEY)
            entry = entry if isinstance(entry, Mapping) and entry.get("sha256") else {}
            table = str(entry.get("sha256", "")), str(entry.get("screen", ""))
            by_table.setdefault(table, []).append(session)
    return by_table


def _unknown_people(folder: Path) -> list[str]:
    """Name people with sessions whom neither ledger nor settings of the study know any more."""
    names = sorted({p.parent.name for p in session_folders(folder)})
    if not names:
        return []
    problems = []
    if not (folder / SETTINGS_NAME).exists() and not copy_path(folder / SETTINGS_NAME).exists():
        problems.append(
            f"{folder / SETTINGS_NAME} and its copy are gone: restore one from a backup"
        )
    try:
        labels = {entry.label for entry in _ledger(folder).list()}
    except (LabError, OSError):
        return problems  # which is among the ledger's own problems
    unknown_names = [name for name in names if name.removeprefix("sub-") not in labels]
    if unknown_names:
        problems.append(
            f"{folder / LEDGER_NAME} does not know {', '.join(unknown_names)}: restore it from a "
            "backup; nobody is added to the study before"
        )
    return problems


def repair_study(folder: Path) -> tuple[str, ...]:
    """Put settings, ledger and manifests back from their copies; return what was done.

    Raises RecordingError where the ledger and its copy are both damaged.
    """
    repairs = []
    if _settings_problems(folder):
        repairs += _mend(folder / SETTINGS_NAME, lambda: read_settings(folder))
    lists = [folder / name for name in (LEDGER_NAME, REGISTER_NAME, PEEKS_NAME, LIST_NAME)]
    for path in (*lists, *_remarks(folder)):
        try:
            note = repair_lines(path)
        except (ValueError, OSError) as error:
            raise RecordingError(str(error)) from error
        repairs += [note] if note else []
    for name in complete_list(folder):
        repairs.append(f"{folder / LIST_NAME} says how {name} ended")
    if _lock_problems(folder):
        repairs += _mend(folder / LOCK_NAME, lambda: read_lock(folder))
    for path in _bodies(folder):
        if _body_problems(path):
            repairs += _mend(path, partial(read_own_body, path.parent))
    for session in session_folders(folder):
        repairs += recover(session).repaired
    return tuple(repairs)


def _mend(path: Path, read: Callable[[], object]) -> list[str]:
    """Put a sealed file back from its copy, or renew the copy of one that `read` returns."""
    try:
        is_intact = read() is not None
    except LabError:
        is_intact = False
    if not is_intact:
        return [f"{path} was put back from its copy"] if restore(path) else []
    if copy_state(path) == "same":
        return []
    replace_file(copy_path(path), path.read_bytes())
    return [f"{copy_path(path)} was renewed"]


def _settings_problems(folder: Path) -> list[str]:
    path = folder / SETTINGS_NAME
    try:
        settings = read_settings(folder)
    except LabError as error:
        return [str(error)]
    if settings is None:
        return []
    state = copy_state(path)
    is_old = settings.format_version == 1 and state == "missing"
    return [] if state == "same" or is_old else [f"{copy_path(path)} is {state}"]


def _lock_problems(folder: Path) -> list[str]:
    """Name what is wrong with the locked plan, its copy, and the record of looks at results."""
    path = folder / LOCK_NAME
    try:
        locked_plan, _ = read_lock(folder), read_peeks(folder)
    except LabError as error:
        return [str(error)]
    state = copy_state(path)
    problems = [] if locked_plan is None or state == "same" else [f"{copy_path(path)} is {state}"]
    return problems + list(read_lines(folder / PEEKS_NAME).notes)


def _bodies(folder: Path) -> list[Path]:
    """Return the paths of people's own bodies, also those of which only the copy is left."""
    paths = (path for name in FILE_NAMES for path in folder.glob(f"sub-*/{name}"))
    return sorted({path.with_name(OWN_BODY_NAME) for path in paths})


def _body_problems(path: Path) -> list[str]:
    try:
        read_own_body(path.parent)
    except LabError as error:
        return [str(error)]
    state = copy_state(path)
    return [] if state == "same" else [f"{copy_path(path)} is {state}"]


def _remarks(folder: Path) -> list[Path]:
    """Return the paths of remarks on people, also those of which only the copy is left."""
    copies = copy_path(Path(REMARKS_NAME)).name
    paths = (path for name in (REMARKS_NAME, copies) for path in folder.glob(f"sub-*/{name}"))
    return sorted({path.with_name(REMARKS_NAME) for path in paths})


def _remark_problems(path: Path) -> list[str]:
    try:
        remarks_of(path.parent)
        return list(read_lines(path).notes)
    except (RecordingError, OSError) as error:
        return [str(error)]


def _export_problems(folder: Path) -> list[str]:
    """Name what is wrong with the register, and what changed inside the study since it was made."""
    try:
        exports = registered_exports(folder)
        problems = list(read_lines(folder / REGISTER_NAME).notes)
        if not exports and (folder / REGISTER_LOCK).exists():
            problems.append(
                f"{folder / REGISTER_NAME}, the register of exports, is gone or empty, so that a "
                "withdrawal would not find them; restore it from a copy of the study"
            )
    except LabError as error:
        return [str(error)]
    latest = {(e.where, tuple(e.files)): e for e in exports}
    inside = folder.resolve()
    for export in latest.values():
        for name, digest in export.files.items() if export.where.is_relative_to(inside) else ():
            path = export.where / name
            if not path.is_file():
                problems.append(f"{path} is gone; make it again")
            elif sha256_of(path) != digest:
                problems.append(f"{path} is not as {export.what} wrote it on {export.at[:10]}")
    return problems


def _ledger_problems(folder: Path) -> list[str]:
    path = folder / LEDGER_NAME
    if not path.exists() and not copy_path(path).exists():
        return []
    try:
        _ledger(folder).list()
        return list(read_lines(path).notes)
    except (LabError, OSError) as error:
        return [str(error)]


def _ledger(folder: Path) -> Ledger:
    prefix = SIMULATED_PREFIX if folder.resolve().parent.name == SIMULATED_ROOT else ""
    return Ledger(folder, SystemClock(), prefix=prefix)
