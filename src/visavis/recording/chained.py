"""Append-only files of JSON lines. Every line holds a checksum of all lines before it, and there is
a copy.

A line ends in its own CRC-32 and names that of everything before it (`after`), so that no byte of
the file can change, and no line go or move, unseen. What a cut would take from the end is in the
copy, which is written first.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from visavis.lab.plain_files import parse_json, read_plain
from visavis.recording.durable import add_to_file, replace_file
from visavis.recording.journal import decode_line, encode_line
from visavis.recording.sealed import copy_path


@dataclass(frozen=True)
class Lines:
    """What a file holds: its records up to the first damaged line, if any, with its number and
    what is wrong with it. `notes` say how its copy differs where nothing was lost by it.
    """

    records: tuple[dict[str, Any], ...]
    damaged_line: tuple[int, str] | None = None
    notes: tuple[str, ...] = ()


def read_lines(path: Path) -> Lines:
    """Read a file of lines; a missing file has none.

    Where it was cut short, what its copy has more is read from there. Raises OSError when neither
    can be read.
    """
    data, copy = _content(path), _content(copy_path(path))
    own = _decode(data or b"")
    if copy is None:
        notes = () if data is None else (f"{copy_path(path)} is missing",)
        return Lines(own.records, own.damaged_line, notes if own.records else ())
    whole, spare = _whole(data or b""), _whole(copy)
    if whole == spare:
        return own
    if spare.startswith(whole):  # cut short, or its writer died before it was written to both
        longer = _decode(spare)
        if longer.damaged_line is None:
            n_lost_bytes = len(spare) - len(whole)
            return Lines(longer.records, None, (f"{path} lacks {n_lost_bytes} bytes of its copy",))
    if own.damaged_line is None:
        if _decode(spare).damaged_line is None and not whole.startswith(spare):
            return Lines(own.records, (len(own.records), "and its copy say different things"))
        return Lines(own.records, None, (f"{copy_path(path)} is damaged or cut short",))
    return own


def append_lines(path: Path, records: Sequence[Mapping[str, Any]]) -> None:
    """Add records durably, first to the copy; what an earlier writer left torn is cut off.

    The caller keeps others from writing. Raises OSError; ValueError where the file is damaged.
    """
    content = read_lines(path)
    if content.damaged_line is not None:
        raise ValueError(f"{path}:{content.damaged_line[0]} {content.damaged_line[1]}")
    data, copy = _whole(_content(path) or b""), _whole(_content(copy_path(path)) or b"")
    whole = copy if copy.startswith(data) and content.notes else data
    new_bytes = b""
    for record in records:
        after = f"{zlib.crc32(whole + new_bytes):08x}"
        new_bytes += encode_line({**record, "after": after})
    for target in (copy_path(path), path):
        _extend(target, whole, new_bytes)


def repair_lines(path: Path) -> str | None:
    """Make a file and its copy equal where one of them is intact; return what was done.

    Raises ValueError when neither is.
    """
    data, copy = _content(path), _content(copy_path(path))
    if data is None and copy is None:
        return None
    own, spare = _whole(data or b""), _whole(copy or b"")
    if own == spare:
        if _decode(own).damaged_line is not None:
            raise ValueError(f"{path} and its copy are damaged; restore one from a backup")
        return None
    sound = [d for d in (own, spare) if _decode(d).damaged_line is None]
    if not sound:
        raise ValueError(f"{path} and its copy are damaged; restore one from a backup")
    best = max(sound, key=len)
    if len(sound) == 2 and not best.startswith(min(sound, key=len)):
        raise ValueError(f"{path} and its copy say different things; restore both from a backup")
    if best == own:
        replace_file(copy_path(path), own)
        return f"{copy_path(path)} was renewed"
    if path.exists():
        path.replace(path.with_name(path.name + ".damaged"))
    replace_file(path, spare)
    return f"{path} was put back from its copy"


def _content(path: Path) -> bytes | None:
    try:
        return read_plain(path)
    except FileNotFoundError:
        return None


def _whole(data: bytes) -> bytes:
    """Return all whole lines: what follows the last line's end was never acknowledged."""
    return data[: data.rfind(b"\n") + 1]


def _decode(data: bytes) -> Lines:
    records: list[dict[str, Any]] = []
    crc, is_chained = 0, False
    for number, line in enumerate(_whole(data).split(b"\n")[:-1], start=1):
        record = decode_line(line)
        if record is None and not is_chained:
            record = _decode_unchained(line)
        elif record is None or record.pop("after", None) != f"{crc:08x}":
            return Lines(tuple(records), (number, "or one before it is not as it was written"))
        else:
            is_chained = True
        if record is None:
            return Lines(tuple(records), (number, "is not a record"))
        crc = zlib.crc32(line + b"\n", crc)
        record.pop("crc32", None)
        records.append(record)
    return Lines(tuple(records))


def _decode_unchained(line: bytes) -> dict[str, Any] | None:
    """Return a line in the older format without chained checksums; None when it is not one."""
    try:
        record = parse_json(line)
    except ValueError:
        return None
    is_one = isinstance(record, dict) and not {"after", "crc32"} & record.keys()
    return record if is_one else None


def _extend(path: Path, whole: bytes, new_bytes: bytes) -> None:
    if (_content(path) or b"") != whole:
        replace_file(path, whole)
    add_to_file(path, new_bytes)
