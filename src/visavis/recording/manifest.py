"""The manifest of a session: its plan, its equipment, and how every part ended."""

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from visavis.lab.errors import RecordingError
from visavis.recording.journal import JOURNAL_NAME, as_json, can_name_files
from visavis.recording.provenance import Provenance
from visavis.recording.sealed import copy_path, read_sealed, write_sealed
from visavis.recording.summary import FileSummary, JournalSummary, StreamSummary

MANIFEST_NAME = "manifest.json"
DESIGN_KEY = "design"
"""Where a session's configuration keeps the design it was made with."""
PRACTICE_UNTIL_KEY = "practice_until"
"""Where the design keeps the criterion of practice; {} for none."""
MANIFEST_VERSION = 2
"""Version of manifests; a reader understands this and all earlier ones."""

SEALED_SINCE = 2
"""Manifests of this version and later end in their own checksum."""

PARTICIPANT = re.compile(r"[A-Za-z0-9]+")
STUDY = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
STREAM = re.compile(r"[A-Za-z0-9_-]+")
MAX_SESSION = 999
MAX_PART = 999

PartStatus = Literal["running", "complete", "aborted", "crashed"]


@dataclass(frozen=True)
class Part:
    """One uninterrupted stretch of recording; times are session nanoseconds.

    `reason` says why it ended early; `journal` and the streams' hashes are None and empty while
    it runs, and describe the files as found when it crashed. `others` are further files in its
    folder, such as what the doctor said.
    """

    number: int
    status: PartStatus
    started_ns: int
    started_wall_iso: str
    ended_ns: int | None = None
    ended_wall_iso: str | None = None
    reason: str = ""
    streams: tuple[StreamSummary, ...] = ()
    journal: JournalSummary | None = None
    others: tuple[FileSummary, ...] = ()

    __pydantic_config__: ClassVar[Mapping[str, str]] = {"extra": "forbid"}

    @property
    def folder(self) -> str:
        """Name of the folder that holds its files."""
        return f"part-{self.number:02d}"


@dataclass(frozen=True)
class Manifest:
    """Everything about a session that is not a sample or an event.

    `plan`, `configuration`, `devices` and `calibrations` are whatever the session gives, as JSON
    can hold it (dataclasses become objects). `created_wall_iso` is the only wall time besides
    the parts' own.
    """

    study: str
    participant: str
    session: int
    is_simulated: bool
    plan: Any
    seed: int
    configuration: Any
    devices: Sequence[Any]
    consent_version: str
    created_wall_iso: str
    provenance: Provenance
    calibrations: Sequence[Any] = ()
    parts: tuple[Part, ...] = ()
    format_version: int = MANIFEST_VERSION
    configuration_sha256: str = field(default="")

    __pydantic_config__: ClassVar[Mapping[str, str]] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        for name in ("plan", "configuration", "devices", "calibrations"):
            object.__setattr__(self, name, as_json(getattr(self, name)))
        if not self.configuration_sha256:
            text = json.dumps(self.configuration, sort_keys=True, ensure_ascii=False)
            digest = hashlib.sha256(text.encode()).hexdigest()
            object.__setattr__(self, "configuration_sha256", digest)

    def with_part(self, part: Part) -> "Manifest":
        """Return the manifest with this part added, or put in the place of its number."""
        others = tuple(p for p in self.parts if p.number != part.number)
        return replace(self, parts=tuple(sorted((*others, part), key=lambda p: p.number)))


def write_manifest(session_dir: Path, manifest: Manifest) -> None:
    """Replace the session's manifest and its copy atomically, each with its checksum."""
    now = replace(manifest, format_version=MANIFEST_VERSION)
    write_sealed(session_dir / MANIFEST_NAME, {f.name: getattr(now, f.name) for f in fields(now)})


def read_manifest(session_dir: Path) -> Manifest:
    """Read a session's manifest; raises RecordingError when it is missing, damaged or newer.

    Also when anything in the session's folder is a link: what it leads to is not the session's,
    and may be somebody else's file.
    """
    return read_with_seal(session_dir)[0]


def refuse_links(session_dir: Path) -> None:
    """Raise RecordingError when anything in a session's folder is a symbolic link."""
    for folder, folders, files in os.walk(session_dir):
        for path in (Path(folder, name) for name in (*folders, *files)):
            if path.is_symlink():
                raise RecordingError(
                    f"{path} is a link, to {os.readlink(path)}; a session holds its files itself: "
                    "put the file in the link's place if it is the session's (in a DataLad folder "
                    "`git annex unlock` does so), or delete the link"
                )


def read_with_seal(session_dir: Path) -> tuple[Manifest, bool]:
    """Read a manifest, and return whether it has a valid checksum (since version 2)."""
    path = session_dir / MANIFEST_NAME
    refuse_links(session_dir)
    try:
        file = read_sealed(path)
    except FileNotFoundError as error:
        if copy_path(path).exists():
            raise RecordingError(f"{path} is gone; {_repair(session_dir)}") from error
        raise RecordingError(
            f"{session_dir} is not a session: it has no {MANIFEST_NAME}; "
            "give the path of a folder named ses-…"
        ) from error
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read ({error}); {_repair(session_dir)}") from error
    raw = file.content
    version = raw.get("format_version")
    if not isinstance(version, int) or version < 1:
        raise RecordingError(f"{path} states no format version; it is not a Visavis manifest")
    if version > MANIFEST_VERSION:
        raise RecordingError(
            f"{path} has format version {version}, this Visavis reads up to {MANIFEST_VERSION}; "
            "install a newer Visavis"
        )
    if version >= SEALED_SINCE and not file.is_sealed:
        raise RecordingError(f"{path} lost its checksum; {_repair(session_dir)}")
    try:
        manifest = _manifest_of(raw)
    except ValueError as error:
        raise RecordingError(
            f"{path} lacks or misstates a field ({error}); {_repair(session_dir)}"
        ) from error
    return manifest, file.is_sealed


def _repair(session_dir: Path) -> str:
    if copy_path(session_dir / MANIFEST_NAME).exists():
        return f"`visavis recover {session_dir}` puts its copy in its place"
    return "restore it from a copy; the streams in its folder are untouched"


@cache
def _adapter() -> Any:
    from pydantic import TypeAdapter  # slow to import, and not needed to write

    return TypeAdapter(Manifest)


def _manifest_of(raw: Mapping[str, Any]) -> Manifest:
    """Return a manifest; raises ValueError, in one line, for invalid content."""
    from pydantic import ValidationError

    try:
        manifest: Manifest = _adapter().validate_json(json.dumps(raw), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{where}: {first['msg']}") from None
    for problem in (*_label_problems(manifest), *_plan_problems(manifest.plan)):
        raise ValueError(problem)
    return manifest


def _label_problems(manifest: Manifest) -> Iterator[str]:
    """Yield what is wrong with the texts that name files and folders."""
    if not PARTICIPANT.fullmatch(manifest.participant):
        yield f"participant: {manifest.participant!r} may hold only letters and digits"
    if not STUDY.fullmatch(manifest.study):
        yield f"study: {manifest.study!r} may hold only letters, digits, - and _"
    if not 1 <= manifest.session <= MAX_SESSION:
        yield f"session: {manifest.session} must lie between 1 and {MAX_SESSION}"
    numbers = [part.number for part in manifest.parts]
    if numbers != sorted(set(numbers)) or not all(1 <= n <= MAX_PART for n in numbers):
        yield f"parts: the numbers {numbers} must grow from 1"
    for part in manifest.parts:
        for stream in part.streams:
            if not STREAM.fullmatch(stream.name) or stream.file != f"{stream.name}.arrows":
                yield f"parts: {stream.file!r} is not a file of a stream"
        if part.journal is not None and part.journal.file != JOURNAL_NAME:
            yield f"parts: {part.journal.file!r} is not a journal"
        for other in part.others:
            if Path(other.file).name != other.file or other.file in ("", ".", ".."):
                yield f"parts: {other.file!r} is not a file of a part"


def _plan_problems(plan: Any) -> Iterator[str]:
    """Yield the problems that prevent comparing a plan with the recorded trials."""
    if not isinstance(plan, dict):
        yield "plan: it is not an object"
        return
    blocks = plan.get("blocks", [])
    if not isinstance(blocks, list) or not all(isinstance(b, dict) for b in blocks):
        yield "plan.blocks: it is not a list of blocks"
        return
    for i, block in enumerate(blocks):
        trials = block.get("trials")
        if not isinstance(trials, list) or not all(isinstance(t, dict) for t in trials):
            yield f"plan.blocks.{i}.trials: it is not a list of trials"
            continue
        for trial in trials:
            wrong = [name for name, kind in _TRIAL.items() if not isinstance(trial.get(name), kind)]
            if wrong:
                yield f"plan.blocks.{i}.trials: a trial lacks or misstates {wrong[0]}"
            elif not can_name_files(trial["trial_id"]):
                yield f"plan.blocks.{i}.trials: {trial['trial_id']!r} cannot name a file"
    if blocks and not isinstance(plan.get("questionnaires", []), list):
        yield "plan.questionnaires: it is not a list"


_TRIAL: Mapping[str, type] = {
    "trial_id": str,
    "number": int,
    "block": int,
    "is_practice": bool,
    "factors": dict,
}
