"""The bill of lading of a study: who was registered, who came, what each left, and its hash.

The hash is of what people left (identifiers, sessions, parts, files and their own hashes), so that
a copy on another computer has the same one, and a study from which anything is gone another.
"""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from visavis.lab.clock import SystemClock
from visavis.lab.errors import DataError, LabError, LedgerError, RecordingError, UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.recording.durable import sha256_of
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.manifest import Part, read_manifest
from visavis.recording.reader import Recording
from visavis.recording.sealed import read_sealed, write_sealed
from visavis.running.sessions.session_list import listed_sessions
from visavis.running.sessions.study_folder import SIMULATED_PREFIX, session_folders

MIN_HASH: Final = 12
"""So many digits of a hash are enough to compare with."""
SHORT_DIGITS: Final = 16
MISSING: Final = "missing"
NOT_COME: Final = "has not come"


@dataclass(frozen=True)
class BillLine:
    """What a study has of one person's session; `session` is "" of who has not come.

    `state` is how it ended, or that it is missing or withdrawn; `trials` counts finished ones;
    `last_seen` is when the list of sessions last heard of it; `sha256` is of its files' hashes.
    """

    participant: str
    session: str
    state: str
    parts: int = 0
    files: int = 0
    size_bytes: int = 0
    trials: int = 0
    last_seen: str = ""
    sha256: str = ""


@dataclass(frozen=True)
class BillOfLading:
    """Everything that a study's folder should hold, a line for each session."""

    study: str
    lines: tuple[BillLine, ...]

    @property
    def sha256(self) -> str:
        """The hash of all that people left."""
        content = [[line.participant, line.session, line.sha256] for line in self.lines]
        return hashlib.sha256(json.dumps([self.study, content]).encode()).hexdigest()


def bill_of_lading(study: Path) -> BillOfLading:
    """Return what a study's folder holds and misses; files are not read again, `check` does so.

    Raises:
        RecordingError: the list of sessions is damaged.
        LedgerError: the ledger is damaged.
    """
    is_simulated = study.resolve().parent.name == SIMULATED_ROOT
    ledger = Ledger(study, SystemClock(), prefix=SIMULATED_PREFIX if is_simulated else "")
    status_of = {entry.label: entry.status for entry in ledger.list()}
    listed = listed_sessions(study)
    names = {f"{path.parent.name}/{path.name}" for path in session_folders(study)} | set(listed)
    lines = []
    for name in sorted(names):
        folder, _, session = name.partition("/")
        label = folder.removeprefix("sub-")
        seen = listed[name].at if name in listed else ""
        if status_of.get(label, "active") != "active":
            lines.append(BillLine(label, session, status_of[label], last_seen=seen))
        else:
            lines.append(_line_of(study / name, label, session, seen))
    came = {line.participant for line in lines}
    lines += [
        BillLine(label, "", NOT_COME if status == "active" else status)
        for label, status in status_of.items()
        if label not in came
    ]
    return BillOfLading(study.resolve().name, tuple(lines))


def short_bill_hash(study: Path) -> str:
    """Return the first digits of a study's hash, as reports name it; "" where a list is damaged."""
    try:
        return bill_of_lading(study).sha256[:SHORT_DIGITS]
    except (LedgerError, RecordingError):
        return ""


def write_bill(bill: BillOfLading, path: Path) -> None:
    """Write a bill as a file that ends in its own checksum, with a copy beside it.

    Raises:
        RecordingError: it cannot be written.
    """
    content = {"study": bill.study, "hash": bill.sha256, "lines": [asdict(x) for x in bill.lines]}
    write_sealed(path, content)


def compare_bill(bill: BillOfLading, baseline: str) -> tuple[str, ...]:
    """Return in what a study differs from a bill: a file of `write_bill`, or a hash.

    Raises:
        DataError: the file is no bill, or was changed.
        UsageError: it is neither a file nor a hash.
    """
    path = Path(baseline)
    if path.is_file():
        return _differences(bill, _read_bill(path))
    digits = baseline.lower()
    if len(digits) < MIN_HASH or set(digits) - set("0123456789abcdef"):
        raise UsageError(
            f"{baseline} is neither a file that --baseline wrote nor a hash of at least "
            f"{MIN_HASH} digits, as reports name it"
        )
    if bill.sha256.startswith(digits):
        return ()
    return (f"the hash of {bill.study} is {bill.sha256}, not {baseline}",)


def _line_of(path: Path, label: str, session: str, seen: str) -> BillLine:
    try:
        manifest = read_manifest(path)
    except RecordingError:
        return BillLine(label, session, MISSING, last_seen=seen)
    hashes = [[part.folder, *_hashes(path / part.folder, part)] for part in manifest.parts]
    remarks = [[f.name, sha256_of(f)] for f in sorted(path.parent.glob("remarks*")) if f.is_file()]
    trials = 0
    with suppress(LabError, KeyError):
        rows = Recording(path).trials()
        trials = int((rows["status"] == "complete").sum()) if "status" in rows else 0
    return BillLine(
        participant=label,
        session=session,
        state=manifest.parts[-1].status if manifest.parts else NOT_COME,
        parts=len(manifest.parts),
        files=sum(len(part) - 1 for part in hashes),
        size_bytes=sum(f.stat().st_size for f in path.rglob("*") if f.is_file()),
        trials=trials,
        last_seen=seen or (manifest.parts[-1].ended_wall_iso or "" if manifest.parts else ""),
        sha256=hashlib.sha256(json.dumps([*hashes, *remarks]).encode()).hexdigest(),
    )


def _hashes(folder: Path, part: Part) -> list[list[str]]:
    """Return the files of a part with the hashes that the manifest has, or else their own.

    Of a file that is not there it says "gone".
    """
    hashes = {summary.file: summary.sha256 for summary in part.streams}
    hashes |= {summary.file: summary.sha256 for summary in part.others}
    if part.journal is not None:
        hashes[part.journal.file] = part.journal.sha256
    for path in sorted(folder.glob("*")) if folder.is_dir() else ():
        if path.is_file() and not hashes.get(path.name):
            hashes[path.name] = sha256_of(path)
    return [
        [name, digest if (folder / name).is_file() else "gone"]
        for name, digest in sorted(hashes.items())
    ]


def _read_bill(path: Path) -> BillOfLading:
    try:
        file = read_sealed(path)
        if not file.is_sealed:
            raise ValueError("it lost its checksum")
        content: Mapping[str, Any] = file.content
        bill = BillOfLading(str(content["study"]), tuple(BillLine(**x) for x in content["lines"]))
        if bill.sha256 != content["hash"]:
            raise ValueError("its hash is not that of its lines")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"{path} is no bill of lading ({error}); take another copy of it"
        ) from error
    return bill


def _differences(now: BillOfLading, before: BillOfLading) -> tuple[str, ...]:
    if now.study != before.study:
        return (f"the bill is of {before.study}, not of {now.study}",)
    lines_now = {(x.participant, x.session): x for x in now.lines}
    lines_before = {(x.participant, x.session): x for x in before.lines}
    texts = []
    for who in sorted({*lines_now, *lines_before}):
        name = "/".join(filter(None, (f"sub-{who[0]}", who[1])))
        a, b = lines_before.get(who), lines_now.get(who)
        if a is None and b is not None:
            texts.append(f"{name} is not on the bill: {b.state}")
        elif b is None and a is not None:
            texts.append(f"{name} is gone: {a.state}, {a.trials} trials, {a.files} files")
        elif a is not None and b is not None and a.sha256 != b.sha256:
            texts.append(
                f"{name} is not what it was: {a.state}, {a.trials} trials, {a.files} files then; "
                f"{b.state}, {b.trials} trials, {b.files} files now"
            )
    return tuple(texts)
