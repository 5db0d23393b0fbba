"""JSON files that end in their own checksum and have a copy next to them.

The last line is the SHA-256 of everything before it, so that every byte of the file is covered.
`study.json` has its copy in `study.copy.json`.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from visavis.lab.plain_files import parse_json, read_plain
from visavis.recording.durable import replace_file
from visavis.recording.journal import as_json

_TAIL = ',\n "sha256": "{}"\n}}\n'
_TAIL_BYTES = len(_TAIL.format("0" * 64))
_TAIL_PATTERN = re.compile(rb',\n "sha256": "([0-9a-f]{64})"\n}\n\Z')

CopyState: TypeAlias = Literal["same", "missing", "damaged", "other"]


@dataclass(frozen=True)
class SealedContent:
    """The content of a file; `is_sealed` tells whether its checksum is present and valid."""

    content: dict[str, Any]
    is_sealed: bool


def seal(content: Mapping[str, Any]) -> bytes:
    """Return a JSON text that ends in its own checksum; `content` must not be empty."""
    text = json.dumps(as_json(content), indent=1, ensure_ascii=False, allow_nan=False)
    body = text.removesuffix("\n}").encode()
    return body + _TAIL.format(hashlib.sha256(body).hexdigest()).encode()


def seal_of(data: bytes) -> str:
    """Return the checksum at the end of a text that `seal` made; empty without one."""
    match = _TAIL_PATTERN.search(data[-_TAIL_BYTES:])
    return match[1].decode() if match else ""


def unseal(data: bytes) -> SealedContent:
    """Return the content of a text; ValueError when it is not a JSON object or was changed."""
    match = _TAIL_PATTERN.search(data[-_TAIL_BYTES:])
    if match and hashlib.sha256(data[:-_TAIL_BYTES]).hexdigest().encode() != match[1]:
        raise ValueError("its checksum disagrees with its content")
    content = parse_json(data)
    if not isinstance(content, dict):
        raise ValueError("it is not a JSON object")
    if match:
        content.pop("sha256")
    return SealedContent(content, match is not None)


def read_sealed(path: Path) -> SealedContent:
    """Read a file; raises OSError, or ValueError as `unseal` does."""
    return unseal(read_plain(path))


def write_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Replace a file and its copy, each atomically; RecordingError when the disk refuses."""
    data = seal(content)
    replace_file(path, data)
    replace_file(copy_path(path), data)


def copy_path(path: Path) -> Path:
    """Return where the copy of a file stands: `manifest.copy.json` beside `manifest.json`."""
    return path.with_name(f"{path.stem}.copy{path.suffix}")


def copy_state(path: Path) -> CopyState:
    """Return the state of a file's copy."""
    copy = copy_path(path)
    try:
        data = read_plain(copy)
        if data == read_plain(path):
            return "same"
        return "other" if unseal(data).is_sealed else "damaged"
    except FileNotFoundError:
        return "missing"
    except (OSError, ValueError):
        return "damaged"


def restore(path: Path) -> bool:
    """Put a file's copy in its place where the copy is intact; the damaged one is kept beside it.

    Tells whether it could.
    """
    try:
        data = read_plain(copy_path(path))
        if not unseal(data).is_sealed:
            return False
    except (OSError, ValueError):
        return False
    if path.exists():
        path.replace(path.with_name(path.name + ".damaged"))
    replace_file(path, data)
    return True
