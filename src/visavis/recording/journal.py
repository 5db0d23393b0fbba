"""The event journal: one JSON line per event or trial row, each with its own CRC-32."""

import json
import math
import re
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from visavis.lab.plain_files import parse_json

JOURNAL_NAME = "events.jsonl"
_PLAIN = frozenset({str, int, bool, type(None)})


def as_json(value: Any) -> Any:
    """Return `value` as JSON can hold it.

    Dataclasses become objects, sets sorted lists, NumPy values Python ones. NaN becomes null
    (missing); infinities become the texts "Infinity" and "-Infinity".
    """
    if type(value) in _PLAIN:  # nearly everything of a plan, which is large
        return value
    if value is None or (isinstance(value, str | bool | int) and not isinstance(value, Enum)):
        return value
    if isinstance(value, np.generic):
        return as_json(value.item())
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return None if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    if isinstance(value, Enum):
        return as_json(value.value)
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, np.ndarray):
        return [as_json(v) for v in value.tolist()]
    if isinstance(value, Mapping):
        return {str(k): as_json(v) for k, v in value.items()}
    if isinstance(value, set | frozenset):
        return sorted((as_json(v) for v in value), key=str)
    if isinstance(value, list | tuple):
        return [as_json(v) for v in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: as_json(getattr(value, f.name)) for f in fields(value)}
    raise TypeError(f"{type(value).__name__} cannot be written to a recording")


def encode_line(entry: Mapping[str, Any]) -> bytes:
    """Return one journal line: the entry, and the CRC-32 of the line without it, at its end."""
    text = json.dumps(as_json(entry), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    body = text.encode()
    return body[:-1] + b',"crc32":"%08x"}\n' % zlib.crc32(body)


_TAIL_BYTES = len(b',"crc32":"00000000"}')


def decode_line(line: bytes) -> dict[str, Any] | None:
    """Return the entry of one line (without newline), None when it is torn, damaged or foreign."""
    body, tail = line[:-_TAIL_BYTES] + b"}", line[-_TAIL_BYTES:]
    if tail != b',"crc32":"%08x"}' % zlib.crc32(body):
        return None
    try:
        entry = parse_json(body)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None


_ENTRIES: Mapping[str, Mapping[str, type]] = {
    "header": {"format": int, "is_simulated": bool},
    "stream": {"name": str, "header": str},
    "event": {"name": str, "t_ns": int, "payload": dict},
    "trial": {"t_ns": int, "row": dict},
    "end": {"lines": int},
}


def is_entry(entry: Mapping[str, Any]) -> bool:
    """Return whether an entry has the fields that readers need; unknown kinds need none.

    A trial's name may not be a path: files are named after it.
    """
    kind_of_field = _ENTRIES.get(str(entry.get("kind")), {"kind": str})
    if not all(isinstance(entry.get(name), kind) for name, kind in kind_of_field.items()):
        return False
    return entry["kind"] != "trial" or can_name_files(entry["row"].get("trial_id"))


def can_name_files(name: object) -> bool:
    """Tell whether a name can be part of a file's name in every folder."""
    return not isinstance(name, str) or re.search(r"^[.]|[/\\\x00-\x1f]", name) is None
