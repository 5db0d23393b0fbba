"""Read an event journal, whole, torn or damaged."""

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from visavis.lab.errors import RecordingError
from visavis.lab.plain_files import read_plain
from visavis.recording.columns import FORMAT_VERSION
from visavis.recording.journal import decode_line, is_entry
from visavis.recording.manifest import STREAM

MAX_JOURNAL_BYTES = 4 * 1024**3


@dataclass(frozen=True)
class JournalContent:
    """What a journal held, in written order.

    `headers` maps each declared stream to the header of its file; `is_ended` tells whether the
    end line is there and counts the lines before it. `damaged_lines` are unreadable ones before
    the last, which a killed process never leaves behind; what it does is the `tail_problem`.
    """

    events: tuple[dict[str, Any], ...]
    trials: tuple[dict[str, Any], ...]
    headers: dict[str, bytes]
    n_lines: int
    is_simulated: bool | None
    is_ended: bool
    problems: tuple[str, ...]
    damaged_lines: int = 0
    tail_problem: str = ""


def read_journal(path: Path) -> JournalContent:
    """Read every intact line; never raises for damage, RecordingError for a newer version."""
    try:
        data = read_plain(path, max_bytes=MAX_JOURNAL_BYTES)
    except FileNotFoundError:
        return JournalContent((), (), {}, 0, None, False, (f"{path} is missing",))
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}; check the disk") from error
    problems: list[str] = []
    entries = []
    n_damaged, tail_problem = 0, ""
    lines = data.split(b"\n")
    for number, line in enumerate(lines, start=1):
        entry = decode_line(line)
        if entry is not None and is_entry(entry):
            entries.append(entry)
        elif line and number == len(lines):
            tail_problem = f"{path}: line {number} is cut; {len(line)} bytes were left out"
            problems.append(tail_problem)
        elif line:
            n_damaged += 1
            problems.append(f"{path}: line {number} is damaged and was left out")
    head = next((e for e in entries if e["kind"] == "header"), None)
    if head is not None and head["format"] > FORMAT_VERSION:
        raise RecordingError(
            f"{path} has format version {head['format']}, this Visavis reads up to "
            f"{FORMAT_VERSION}; install a newer Visavis"
        )
    end = entries[-1] if entries and entries[-1]["kind"] == "end" else None
    if end is not None and end["lines"] != len(entries):
        problems.append(f"{path}: {end['lines']} lines were written, {len(entries)} are there")
    return JournalContent(
        events=tuple(e for e in entries if e["kind"] == "event"),
        trials=tuple(e for e in entries if e["kind"] == "trial"),
        headers=_headers(entries, path, problems),
        n_lines=len(entries),
        is_simulated=None if head is None else bool(head["is_simulated"]),
        is_ended=end is not None,
        problems=tuple(problems),
        damaged_lines=n_damaged,
        tail_problem=tail_problem,
    )


def _headers(entries: list[dict[str, Any]], path: Path, problems: list[str]) -> dict[str, bytes]:
    headers = {}
    for entry in entries:
        if entry["kind"] == "stream":
            try:
                if not STREAM.fullmatch(entry["name"]):
                    raise ValueError("it names no file")
                headers[str(entry["name"])] = base64.b64decode(entry["header"], validate=True)
            except ValueError as error:  # or binascii.Error, which is one
                problems.append(f"{path}: the header of {entry['name']!r} is damaged ({error})")
    return headers
