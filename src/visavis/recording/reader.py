"""Open a recorded session: finished, aborted, crashed or still running."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.lab.errors import RecordingError, UsageError
from visavis.lab.schema import StreamSchema
from visavis.recording.durable import sha256_of
from visavis.recording.journal_file import JournalContent, read_journal
from visavis.recording.lock import is_held
from visavis.recording.manifest import STREAM, Manifest, Part, PartStatus, read_with_seal
from visavis.recording.stream_file import Columns, StreamContent, empty_columns, read_stream_file

PART_COLUMN = "recording_part"
"""The column that says in which part of the session a row was recorded."""

CHANGED = "SHA-256 differs from the manifest's"


@dataclass(frozen=True)
class Verification:
    """The outcome of reading every byte of a session again."""

    status: PartStatus
    problems: tuple[str, ...]

    @property
    def is_intact(self) -> bool:
        """Return whether everything is intact."""
        return not self.problems


class Recording:
    """A session folder, read only.

    Files are read when first asked for; open it anew to see what a running session wrote since.
    `is_sealed` tells whether a checksum vouches for the manifest. Raises RecordingError when the
    folder has no manifest, a damaged one, or was written by a newer Visavis.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manifest: Manifest
        self.manifest, self.is_sealed = read_with_seal(path)
        self._journals: dict[int, JournalContent] = {}
        self._states: dict[tuple[int, str], StreamContent] = {}
        self._amended: dict[tuple[int, str], Columns] = {}
        self._names_of_part: dict[int, tuple[str, ...]] = {}

    @property
    def is_simulated(self) -> bool:
        """Return whether the data come from a simulated participant or simulated devices."""
        return self.manifest.is_simulated

    @property
    def status(self) -> PartStatus:
        """Return what became of the session.

        "complete" and "aborted" only when end marker, row count and written order of every file
        agree with the manifest in every part that was closed; "running" while a process holds it.
        """
        statuses = [self.part_status(p.number) for p in self.manifest.parts]
        if not statuses:
            return "running" if is_held(self.path) else "crashed"
        claimed_whole = [p.status in ("complete", "aborted") for p in self.manifest.parts]
        if any(w and s == "crashed" for w, s in zip(claimed_whole, statuses, strict=True)):
            return "crashed"
        return statuses[-1]

    def part_status(self, number: int) -> PartStatus:
        """Return what became of one part."""
        part = self._part(number)
        if part.status == "running":
            last = part.number == self.manifest.parts[-1].number
            return "running" if last and is_held(self.path) else "crashed"
        if part.status == "crashed" or self.part_problems(number):
            return "crashed"
        return part.status

    def part_problems(self, number: int) -> tuple[str, ...]:
        """Return all problems with the files of one part, except for hashes."""
        part, journal = self._part(number), self._journal(number)
        problems = [*journal.problems]
        folder = self.path / part.folder
        is_closed = part.status in ("complete", "aborted")
        if is_closed and not journal.is_ended:
            problems.append(f"{folder / 'events.jsonl'}: the end line is missing")
        if is_closed and part.journal is not None and part.journal.lines != journal.n_lines:
            problems.append(
                f"{folder / 'events.jsonl'}: the manifest counts {part.journal.lines} lines, "
                f"{journal.n_lines} are there"
            )
        problems += [
            f"{folder / other.file} is missing"
            for other in part.others
            if not (folder / other.file).exists()
        ]
        rows_of_stream = {s.name: s.rows for s in part.streams}
        for name in self._names(number):
            state = self._state(number, name)
            file = folder / f"{name}.arrows"
            problems.extend(state.problems)
            if is_closed and not state.is_ended:
                problems.append(f"{file}: the end marker is missing")
            if is_closed and state.n_rows != rows_of_stream.get(name, 0):
                problems.append(
                    f"{file}: the manifest counts {rows_of_stream.get(name, 0)} rows, "
                    f"{state.n_rows} are there"
                )
        kinds = {journal.is_simulated}
        kinds |= {self._state(number, n).is_simulated for n in self._names(number)}
        if (not self.is_simulated) in kinds:
            problems.append(f"{folder} mixes simulated and real data; separate the files first")
        return tuple(problems)

    @property
    def stream_names(self) -> tuple[str, ...]:
        """Names of all streams in the order they were declared."""
        return tuple(dict.fromkeys(n for p in self.manifest.parts for n in self._names(p.number)))

    def stream_schema(self, name: str) -> StreamSchema | None:
        """Return a stream's schema; None when every copy of it was cut away."""
        self._require(name)
        schemas = (self._state(p.number, name).schema for p in self._parts_with(name))
        return next((s for s in schemas if s is not None), None)

    def stream(self, name: str) -> pd.DataFrame:
        """Return a stream as a table, all parts in order.

        Vectors become one column per component: `_x _y _z` for three, `_w _x _y _z` for four
        when the name ends in `_wxyz` (which is dropped), otherwise `_0 _1 …`, row-major. The
        component goes before a unit suffix: `origin_m` gives `origin_x_m`.
        """
        arrays = self.stream_arrays(name)
        return pd.DataFrame(
            {
                flat: column
                for field, values in arrays.items()
                for flat, column in flat_components(field, values)
            }
        )

    def stream_arrays(
        self,
        name: str,
        *,
        part: int | None = None,
        t_start_ns: int | None = None,
        t_end_ns: int | None = None,
    ) -> Columns:
        """Return a stream as arrays: seq, t_device_ns, t_host_ns, its fields, `recording_part`.

        Arrays have shape (n, *field shape) and may be read-only. With times, only samples with
        t_start_ns <= t_host_ns < t_end_ns are kept; session time may begin anew in every part,
        so give `part` with them.
        """
        self._require(name)
        pieces = []
        for p in self._parts_with(name):
            if part is not None and p.number != part:
                continue
            content = self._content(p.number, name)
            if content.schema is not None:
                number = np.full(content.n_rows, p.number, dtype=np.int16)
                columns = {**content.columns, PART_COLUMN: number}
                pieces.append(rows_between(columns, t_start_ns, t_end_ns))
        if not pieces:
            schema = self.stream_schema(name)
            columns = {} if schema is None else empty_columns(schema)
            return {**columns, PART_COLUMN: np.zeros(0, dtype=np.int16)}
        if len(pieces) == 1:
            return pieces[0]
        return self._join(name, pieces)

    def events(self) -> pd.DataFrame:
        """Return all events in written order: recording_part, t_ns, name, payload (a dict)."""
        rows = [
            (p.number, e["t_ns"], e["name"], e["payload"])
            for p in self.manifest.parts
            for e in self._journal(p.number).events
        ]
        return pd.DataFrame(rows, columns=[PART_COLUMN, "t_ns", "name", "payload"])

    def events_named(self, name: str, part: int) -> pd.DataFrame:
        """Return a part's events of one name, columns as in `events`."""
        events = self.events()
        return events[(events["name"] == name) & (events[PART_COLUMN] == part)]

    def trials(self) -> pd.DataFrame:
        """Return one row per performed trial attempt, in order; None and NaN are missing."""
        rows = [
            {PART_COLUMN: p.number, **t["row"]}
            for p in self.manifest.parts
            for t in Recording.trial_entries(self, p.number)
        ]
        return pd.DataFrame(rows) if rows else pd.DataFrame({PART_COLUMN: np.zeros(0, np.int64)})

    def trial_entries(self, part: int) -> tuple[dict[str, Any], ...]:
        """Return a part's trial rows with the session time of writing: keys t_ns and row.

        Rows name the participant as the manifest does, whose label may have been corrected.
        """
        own = {"participant": self.manifest.participant}
        return tuple(
            {**t, "row": {**t["row"], **own}} if "participant" in t["row"] else t
            for t in self._journal(part).trials
        )

    def verify(self) -> Verification:
        """Read everything again and compare counts, order, checksums and SHA-256."""
        problems: list[str] = []
        for part in self.manifest.parts:
            problems.extend(self.part_problems(part.number))
            folder = self.path / part.folder
            problems += [f"{folder / file}: {CHANGED}" for file in self.changed_files(part.number)]
        return Verification(self.status, tuple(problems))

    def changed_files(self, number: int) -> tuple[str, ...]:
        """Return the files of a part that are not, byte for byte, what the manifest says of them.

        Missing files and files without a hash in the manifest are not included.
        """
        part = self._part(number)
        digests = [(s.file, s.sha256) for s in part.streams]
        digests += [(s.file, s.sha256) for s in part.others]
        if part.journal is not None:
            digests.append((part.journal.file, part.journal.sha256))
        folder = self.path / part.folder
        try:
            return tuple(
                file
                for file, digest in digests
                if digest and (folder / file).exists() and sha256_of(folder / file) != digest
            )
        except OSError as error:
            raise RecordingError(
                f"{error.filename or folder} cannot be read: {error.strerror}; check the disk"
            ) from error

    def journal(self, number: int) -> JournalContent:
        """Return what the event journal of a part holds, and what is wrong with it."""
        return self._journal(number)

    @property
    def has_met_problems(self) -> bool:
        """Whether anything was wrong with a stream's file that was read so far."""
        return any(state.problems for state in self._states.values())

    def stream_states(self, number: int) -> dict[str, StreamContent]:
        """Return what is there of every stream of a part, without samples."""
        return {name: self._state(number, name) for name in self._names(number)}

    # ---- private --------------------------------------------------------------------------

    def _part(self, number: int) -> Part:
        for part in self.manifest.parts:
            if part.number == number:
                return part
        raise UsageError(
            f"{self.path} has no part {number}; it has "
            f"{', '.join(str(p.number) for p in self.manifest.parts) or 'none yet'}"
        )

    def _journal(self, number: int) -> JournalContent:
        if number not in self._journals:
            path = self.path / self._part(number).folder / "events.jsonl"
            self._journals[number] = read_journal(path)
        return self._journals[number]

    def _names(self, number: int) -> tuple[str, ...]:
        if number not in self._names_of_part:
            part = self._part(number)
            header_names = [s.name for s in part.streams] + list(self._journal(number).headers)
            stems = (p.stem for p in (self.path / part.folder).glob("*.arrows"))
            files = sorted(name for name in stems if STREAM.fullmatch(name))
            self._names_of_part[number] = tuple(dict.fromkeys(header_names + files))
        return self._names_of_part[number]

    def _parts_with(self, name: str) -> list[Part]:
        return [p for p in self.manifest.parts if name in self._names(p.number)]

    def _require(self, name: str) -> None:
        if name not in self.stream_names:
            raise UsageError(
                f"{self.path} has no stream {name!r}; it has "
                f"{', '.join(self.stream_names) or 'none'}"
            )

    def amend(self, part: int, name: str, columns: Columns) -> None:
        """Give these columns, of as many rows, for a part's stream from now on; no file changes."""
        self._amended[part, name] = {n: c for n, c in columns.items() if n != PART_COLUMN}

    def is_amended(self, part: int, name: str) -> bool:
        """Tell whether other columns than those of the file are given for a part's stream."""
        return (part, name) in self._amended

    def _content(self, number: int, name: str, *, with_columns: bool = True) -> StreamContent:
        content = self._content_of_file(number, name, with_columns=with_columns)
        columns = self._amended.get((number, name))
        return content if columns is None or not with_columns else replace(content, columns=columns)

    def _content_of_file(self, number: int, name: str, *, with_columns: bool) -> StreamContent:
        path = self.path / self._part(number).folder / f"{name}.arrows"
        header = self._journal(number).headers.get(name)
        content = read_stream_file(path, header, with_columns=with_columns)
        self._states[number, name] = replace(content, columns={})
        return content

    def _state(self, number: int, name: str) -> StreamContent:
        if (number, name) not in self._states:
            self._content(number, name, with_columns=False)
        return self._states[number, name]

    def _join(self, name: str, pieces: list[Columns]) -> Columns:
        names = list(pieces[0])
        for piece in pieces[1:]:
            if list(piece) != names:
                raise RecordingError(
                    f"{self.path}: stream {name!r} has other fields in a later part; read its "
                    "parts one by one"
                )
        return {n: np.concatenate([p[n] for p in pieces]) for n in names}


def require_one_kind(recordings: Iterable[Recording], *, allow_mixture: bool = False) -> None:
    """Raise an error when some recordings are simulated and some are real."""
    kinds: dict[bool, Path] = {}
    for recording in recordings:
        kinds.setdefault(recording.is_simulated, recording.path)
    if len(kinds) == 2 and not allow_mixture:
        raise RecordingError(
            f"{kinds[True]} is simulated and {kinds[False]} is real; analyse them separately"
        )


def rows_between(columns: Columns, t_start_ns: int | None, t_end_ns: int | None) -> Columns:
    """Return a stream's rows that arrived between two times; all rows when no time is given."""
    if t_start_ns is None and t_end_ns is None:
        return columns
    t = columns["t_host_ns"]
    lowest, highest = np.iinfo(np.int64).min, np.iinfo(np.int64).max
    first = lowest if t_start_ns is None else t_start_ns
    last = highest if t_end_ns is None else t_end_ns
    if bool(np.all(t[1:] >= t[:-1])):
        selection: slice | npt.NDArray[np.bool_] = slice(
            int(np.searchsorted(t, first)), int(np.searchsorted(t, last))
        )
    else:
        selection = (t >= first) & (t < last)
    return {name: values[selection] for name, values in columns.items()}


_UNIT_SUFFIXES = ("_m", "_mm", "_deg", "_ns", "_ms", "_s", "_hz", "_01")


def component_names(field: str, n_components: int) -> list[str]:
    """Return the column names of a vector field's components; see `Recording.stream`."""
    suffix = next((s for s in _UNIT_SUFFIXES if field.endswith(s)), "")
    stem = field.removesuffix(suffix)
    if field.endswith("_wxyz") and n_components == 4:
        return [f"{field.removesuffix('_wxyz')}_{c}" for c in "wxyz"]
    parts = "xyz" if n_components == 3 else [str(i) for i in range(n_components)]
    return [f"{stem}_{c}{suffix}" for c in parts]


def components_of(field: str, columns: Sequence[str]) -> list[str]:
    """Return the columns among these that hold a field of several numbers, in their order."""
    for n in range(2, len(columns) + 1):
        names = component_names(field, n)
        if names[0] not in columns:
            continue
        if all(name in columns for name in names):
            longer = component_names(field, n + 1)
            if all(name in columns for name in longer):
                continue
            return list(names)
    return []


def flat_components(field: str, values: npt.NDArray[Any]) -> list[tuple[str, npt.NDArray[Any]]]:
    """Return a field's components as columns with their names; see `Recording.stream`."""
    if values.ndim == 1:
        return [(field, values)]
    flat = values.reshape((len(values), int(np.prod(values.shape[1:]))))
    names = component_names(field, flat.shape[1])
    return [(name, flat[:, i]) for i, name in enumerate(names)]
