"""Find and remove everything recorded or derived from one participant."""

import csv
import io
import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from visavis.lab.plain_files import parse_json, read_plain
from visavis.protocol.people.exports_register import Export
from visavis.protocol.people.own_body import FILE_NAMES
from visavis.recording.durable import modes_in, sha256_of
from visavis.recording.lock import is_held

LABEL_COLUMNS = ("participant", "participant_id", "participant_label")
MANIFEST_NAME = "manifest.json"


@dataclass
class Removal:
    """What a withdrawal did.

    `removed_paths` are folders and files that are gone, `rows` the rows taken out of each table,
    `stale` derived files made with this participant's data that must be made anew, `unreadable`
    manifests outside the participant's own folders that could not be read, `failures` what could
    not be removed and why. `unreached_exports` are registered exports that are not where they were
    written, or were changed since: somebody has to look for them. `sha256` has, by path, the hash
    of every removed session's manifest, which names those of its files, and of exported files as
    they were written.
    """

    removed_paths: list[Path] = field(default_factory=list)
    rows: dict[Path, int] = field(default_factory=dict)
    stale: list[Path] = field(default_factory=list)
    unreadable: list[Path] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    unreached_exports: list[str] = field(default_factory=list)
    sha256: dict[Path, str] = field(default_factory=dict)

    def places(self) -> tuple[tuple[str, Path], ...]:
        """Return every place that held the person's data, after what became of it there."""
        in_removed = {path for path in self.sha256 if _is_below(path, self.removed_paths)}
        removed_paths = dict.fromkeys((*self.removed_paths, *sorted(in_removed)))
        return (
            *(("removed", path) for path in removed_paths),
            *((f"{n} rows cut", path) for path, n in self.rows.items()),
            *(("made with it, make it again", path) for path in self.stale),
            *(("could not be read, look yourself", path) for path in self.unreadable),
        )

    def record(self) -> dict[str, Any]:
        """Return what was done, as the ledger stores it."""
        return {
            "removed": [str(p) for p in self.removed_paths],
            "rows": {str(p): n for p, n in self.rows.items()},
            "stale": [str(p) for p in self.stale],
            "unreached": list(self.unreached_exports),
            "sha256": {str(p): digest for p, digest in self.sha256.items()},
        }


def remove_participant(
    study: str,
    label: str,
    data_roots: Sequence[Path],
    derived_roots: Sequence[Path],
    *,
    required_derived: bool = True,
    aliases: Sequence[str] = (),
    exports: Sequence[Export] = (),
) -> Removal:
    """Remove a participant of a study from data roots, derived tables and exports; repeatable.

    `aliases` are further names the participant bears in what was exported. Goes on after a
    failure, so that one locked file does not keep the rest. A missing data root is a failure: its
    disk may only be unplugged.
    """
    removal = Removal()
    names = (label, *aliases)
    for root in data_roots:
        if not root.is_dir():
            removal.failures.append(f"{root}: the data root is not there; connect its disk")
            continue
        for folder in _own_folders(study, label, root, removal):
            _remove_sessions(folder, removal)
    for root in derived_roots:
        if root.is_dir():
            _clean_derived(names, root, removal)
        elif required_derived:
            removal.failures.append(f"{root}: the folder of derived data is not there")
    clean_roots = {root.resolve() for root in derived_roots}
    for export in exports:
        if label in export.labels and export.where not in clean_roots:
            _clean_export(label, names, export, removal)
    return removal


def may_have_data(study: str, label: str, data_roots: Sequence[Path]) -> bool:
    """Tell whether a participant may have recorded data; a missing root counts as yes."""
    if not all(root.is_dir() for root in data_roots):
        return True
    own = [f for root in data_roots for f in _own_folders(study, label, root, Removal())]
    return any(p.name not in FILE_NAMES for folder in own for p in folder.rglob("*"))


def _clean_export(label: str, names: Sequence[str], export: Export, removal: Removal) -> None:
    """Remove an export of one person; take the person out of one that holds others, too."""
    what = f"{export.what}, {export.at[:10]}"
    name_pattern = _pattern_of(names)
    for name, digest in export.files.items():
        path = export.where / name
        if set(export.labels) == {label} or name_pattern.search(name):
            removal.sha256[path] = digest
        if not path.is_file():
            if path not in removal.removed_paths:
                removal.unreached_exports.append(f"{path} ({what}): it is not there any more")
        elif set(export.labels) == {label}:
            if sha256_of(path) == digest:
                _remove(path, removal)
            else:
                removal.unreached_exports.append(
                    f"{path} ({what}): it was changed since, look yourself"
                )
    if not export.where.is_dir():
        return
    if set(export.labels) != {label}:
        # Only its own files: the folder may hold exports of other studies.
        rest = []
        for name in export.files:
            path = export.where / name
            if path.is_file() and name_pattern.search(name):
                _remove(path, removal)
            elif path.is_file():
                rest.append(path)
        _cut_rows(names, rest, removal)
        for path in (*removal.rows, *removal.stale):
            if path.is_relative_to(export.where):
                digest = export.files.get(path.relative_to(export.where).as_posix(), "")
                removal.sha256.setdefault(path, digest)
    _remove_emptied(export)


def _remove_emptied(export: Export) -> None:
    """Remove the export's own folders that are empty now; the folder we stand in stays."""
    where = export.where
    own = {folder for name in export.files for folder in (where / name).parents}
    for folder in sorted(own, key=lambda path: len(path.parts), reverse=True):
        if not folder.is_relative_to(where) or Path.cwd().is_relative_to(folder):
            continue
        if folder.is_dir() and not folder.is_symlink() and not any(folder.iterdir()):
            folder.rmdir()


def _own_folders(study: str, label: str, root: Path, removal: Removal) -> list[Path]:
    """Return the participant's folders: by the name the recorder gives, and by manifest."""
    own_name = f"sub-{label}".lower()
    own_folders: list[Path] = []
    for folder, folders, files in os.walk(root.resolve()):
        here = Path(folder)
        for name in list(folders):
            if name.lower() == own_name and here.name == study:
                own_folders.append(here / name)
                folders.remove(name)
        if MANIFEST_NAME in files:
            try:
                manifest = parse_json(read_plain(here / MANIFEST_NAME))
            except (OSError, ValueError):
                removal.unreadable.append(here / MANIFEST_NAME)
                continue
            if (
                isinstance(manifest, dict)
                and str(manifest.get("participant", "")).upper() == label
                and manifest.get("study") == study
            ):
                own_folders.append(here)
                folders.clear()
    return own_folders


def _remove_sessions(folder: Path, removal: Removal) -> None:
    sessions = [p.parent for p in folder.rglob(MANIFEST_NAME)]
    busy = [session for session in sessions if is_held(session)]
    if busy:
        removal.failures += [f"{s}: this session is running; end it first" for s in busy]
        return
    for session in sessions:
        with suppress(OSError):  # damaged, and removed all the same
            removal.sha256[session] = sha256_of(session / MANIFEST_NAME)
    _remove(folder, removal)


def _is_below(path: Path, folders: Iterable[Path]) -> bool:
    return any(path.is_relative_to(folder) and path != folder for folder in folders)


def _remove(path: Path, removal: Removal) -> None:
    def note(function: object, failed: str, info: tuple[type, BaseException, object]) -> None:
        error = info[1]
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        removal.failures.append(f"{failed}: {why}; close programs that use it, check its rights")

    before = len(removal.failures)
    if path.is_dir() and not path.is_symlink():
        _make_writable(path)
        shutil.rmtree(path, onerror=note)
    else:
        try:
            path.unlink()
        except OSError as error:
            note(None, str(path), (type(error), error, None))
    if len(removal.failures) == before:
        removal.removed_paths.append(path)


def _make_writable(folder: Path) -> None:
    """Lift the write protection of raw files, which keeps Windows from removing them."""
    if os.name == "nt":
        for file in folder.rglob("*"):
            if file.is_file():
                file.chmod(0o600)


def _clean_derived(names: Sequence[str], root: Path, removal: Removal) -> None:
    own, rest = _pattern_of(names), []
    for path in _walk(root, own):
        if own.search(path.name):
            _remove(path, removal)
        else:
            rest.append(path)
    _cut_rows(names, rest, removal)


def _pattern_of(names: Sequence[str]) -> re.Pattern[str]:
    """Return the pattern that finds one of these names in a path."""
    any_name = "|".join(map(re.escape, names))
    return re.compile(rf"(?<![A-Za-z0-9])(sub-)?({any_name})(?![A-Za-z0-9])", re.IGNORECASE)


def _cut_rows(names: Sequence[str], rest: Sequence[Path], removal: Removal) -> None:
    has_cut_rows = False
    for path in rest:
        try:
            count = _drop_rows(path, {f"{p}{n.upper()}" for n in names for p in ("", "SUB-")})
        except (OSError, ValueError, csv.Error, pa.ArrowException) as error:
            removal.failures.append(f"{path}: its rows cannot be removed ({error})")
            continue
        if count:
            removal.rows[path] = count
            has_cut_rows = True
    tables = {".csv", ".tsv", ".parquet"}
    if has_cut_rows or removal.removed_paths:
        removal.stale += [p for p in rest if p.suffix.lower() not in tables]


def _walk(root: Path, own: re.Pattern[str]) -> Iterator[Path]:
    """Yield files, and whole folders that are the participant's own."""
    for path in sorted(root.iterdir()):
        if path.is_dir() and not path.is_symlink() and not own.search(path.name):
            yield from _walk(path, own)
        else:
            yield path


def _drop_rows(path: Path, labels: Collection[str]) -> int:
    suffix = path.suffix.lower()
    if suffix in (".csv", ".tsv"):
        return _drop_csv_rows(path, labels, "," if suffix == ".csv" else "\t")
    if suffix == ".parquet":
        return _drop_parquet_rows(path, labels)
    return 0


def _drop_csv_rows(path: Path, labels: Collection[str], delimiter: str) -> int:
    text = path.read_bytes().decode("utf-8")
    first_line = text.split("\n", 1)[0]
    if delimiter not in first_line and ";" in first_line:  # saved by a decimal-comma spreadsheet
        delimiter = ";"
    rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=delimiter))
    if not rows:
        return 0
    names = [name.removeprefix("\ufeff").strip() for name in rows[0]]
    columns = [i for i, name in enumerate(names) if name in LABEL_COLUMNS]
    remaining_rows = [rows[0], *(r for r in rows[1:] if not _names(r, columns, labels))]
    if len(remaining_rows) == len(rows):
        return 0
    out = io.StringIO(newline="")
    ending = "\r\n" if "\r\n" in text else "\n"
    csv.writer(out, delimiter=delimiter, lineterminator=ending).writerows(remaining_rows)
    _replace(path, out.getvalue().encode("utf-8"))
    return len(rows) - len(remaining_rows)


def _names(row: Sequence[str], columns: Iterable[int], labels: Collection[str]) -> bool:
    return any(i < len(row) and row[i].strip().upper() in labels for i in columns)


def _drop_parquet_rows(path: Path, labels: Collection[str]) -> int:
    table = pq.read_table(path, partitioning=None)
    drop = pa.chunked_array([pa.array([False] * table.num_rows)])
    for name in LABEL_COLUMNS:
        if name in table.column_names:
            column = pc.utf8_upper(pc.cast(table[name], pa.string()))
            drop = pc.or_(drop, pc.is_in(column, value_set=pa.array(sorted(labels), pa.string())))
    remaining_rows = table.filter(pc.invert(drop))
    if remaining_rows.num_rows == table.num_rows:
        return 0
    buffer = io.BytesIO()
    pq.write_table(remaining_rows, buffer)
    _replace(path, buffer.getvalue())
    return int(table.num_rows - remaining_rows.num_rows)


def _replace(path: Path, data: bytes) -> None:
    temporary = path.with_name(f".{path.name}.new")
    with temporary.open("wb") as file:
        if os.name != "nt":
            temporary.chmod(modes_in(path.parent).file)
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
