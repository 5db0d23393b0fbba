"""The register of a study's exports: what left the study's folders, of whom, where to, with hashes.

`<study_root>/exports.jsonl` only grows (visavis.recording.chained). A withdrawal reads it to
delete, or at least to name, what was made of a person's data.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from visavis.lab.clock import Clock
from visavis.lab.errors import LedgerError
from visavis.protocol.people.file_lock import locked
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.durable import sha256_of

REGISTER_NAME = "exports.jsonl"
LOCK_NAME = ".exports.lock"
ANALYSIS = "analysis"


@dataclass(frozen=True)
class Export:
    """One export: `what` is its format, or ANALYSIS; `labels` whose data it holds.

    `where` is the folder; `files` maps names below it to their SHA-256.
    """

    at: str
    what: str
    where: Path
    labels: tuple[str, ...]
    files: Mapping[str, str]


def register_export(
    study_root: Path,
    clock: Clock,
    what: str,
    where: Path,
    labels: Sequence[str],
    files: Iterable[Path],
) -> None:
    """Note an export of a study.

    Raises:
        LedgerError: the register cannot be written; the export is there all the same.
    """
    folder = where.resolve()
    hashes = {path.resolve().relative_to(folder).as_posix(): sha256_of(path) for path in files}
    root = study_root.resolve()
    # Relative inside the study, so that it is found again where the study has moved or was copied.
    at = folder.relative_to(root).as_posix() if folder.is_relative_to(root) else str(folder)
    record = {
        "event": "export",
        "at": clock.wall_iso(),
        "what": what,
        "where": at,
        "labels": list(labels),
        "files": hashes,
    }
    path = study_root / REGISTER_NAME
    try:
        with locked(study_root / LOCK_NAME):
            append_lines(path, [record])
    except (OSError, ValueError) as error:
        raise LedgerError(
            f"{path} cannot be written ({error}), so that a withdrawal would not find this export; "
            f"`visavis recover {study_root}` mends a damaged one, then export again"
        ) from error


def registered_exports(study_root: Path) -> tuple[Export, ...]:
    """Return every export of a study, oldest first.

    Raises:
        LedgerError: the register is damaged.
    """
    path = study_root / REGISTER_NAME
    try:
        register = read_lines(path)
    except OSError as error:
        raise LedgerError(
            f"{path} cannot be read: {error.strerror}; check its rights and the disk"
        ) from error
    if register.damaged_line is not None:
        raise LedgerError(
            f"{path}:{register.damaged_line[0]}: the register is damaged, the line "
            f"{register.damaged_line[1]}; `visavis recover {study_root}` puts its copy in its place"
        )
    try:
        return tuple(
            Export(
                str(r["at"]),
                str(r["what"]),
                study_root.resolve() / str(r["where"]),
                tuple(map(str, r["labels"])),
                {str(k): str(v) for k, v in r["files"].items()},
            )
            for r in register.records
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise LedgerError(
            f"{path}: a line lacks or misstates {error}; `visavis recover {study_root}` puts its "
            "copy in its place"
        ) from error
