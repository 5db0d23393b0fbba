"""The manifest of a session: what was planned, with what, and what became of every part."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from lab.errors import RecordingError
from recording.columns import FORMAT_VERSION
from recording.durable import replace_file
from recording.journal import as_json
from recording.provenance import Provenance
from recording.summary import JournalSummary, StreamSummary

MANIFEST_NAME = "manifest.json"

PartStatus = Literal["running", "complete", "aborted", "crashed"]


@dataclass(frozen=True)
class Part:
    """One uninterrupted stretch of recording; times are session nanoseconds.

    `reason` says why it ended early; `journal` and the streams' hashes are None and empty while
    it runs, and describe the files as found when it crashed.
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
    format_version: int = FORMAT_VERSION
    configuration_sha256: str = field(default="")

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
    """Replace the session's manifest atomically."""
    text = json.dumps(as_json(manifest), indent=1, ensure_ascii=False, allow_nan=False)
    replace_file(session_dir / MANIFEST_NAME, text.encode() + b"\n")


def read_manifest(session_dir: Path) -> Manifest:
    """Read a session's manifest; raises RecordingError when it is missing, damaged or newer."""
    path = session_dir / MANIFEST_NAME
    try:
        raw = json.loads(path.read_bytes())
    except FileNotFoundError as error:
        raise RecordingError(
            f"{session_dir} is not a session: it has no {MANIFEST_NAME}; "
            "give the path of a folder named ses-…"
        ) from error
    except (OSError, ValueError) as error:
        raise RecordingError(
            f"{path} cannot be read ({error}); restore it from a copy, the streams beside it "
            "are untouched"
        ) from error
    version = raw.get("format_version") if isinstance(raw, dict) else None
    if not isinstance(version, int) or version < 1:
        raise RecordingError(f"{path} states no format version; it is not a Visavis manifest")
    if version > FORMAT_VERSION:
        raise RecordingError(
            f"{path} has format version {version}, this Visavis reads up to {FORMAT_VERSION}; "
            "install a newer Visavis"
        )
    try:
        return _manifest_from(raw)
    except (KeyError, TypeError) as error:
        raise RecordingError(
            f"{path} lacks or misstates a field ({error}); restore it from a copy, the streams "
            "beside it are untouched"
        ) from error


def _manifest_from(raw: Mapping[str, Any]) -> Manifest:
    parts = tuple(_part_from(p) for p in raw["parts"])
    return Manifest(**{**raw, "parts": parts, "provenance": Provenance(**raw["provenance"])})


def _part_from(raw: Mapping[str, Any]) -> Part:
    journal = raw["journal"]
    return Part(
        **{
            **raw,
            "streams": tuple(StreamSummary(**s) for s in raw["streams"]),
            "journal": None if journal is None else JournalSummary(**journal),
        }
    )
