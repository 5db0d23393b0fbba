"""Damage bytes the way disks, wires and hands do, and some ways that only an enemy does.

Files with checksums refuse nearly every damaged byte at once; what reads them behind that is
reached by values that are changed and then sealed again, as another version or an enemy would write
them.
"""

import io
import json
import zlib
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from visavis.recording.journal import encode_line
from visavis.recording.sealed import seal

EDGES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\xff\xff\xff\x7f", b"\x00\x00\xc0\x7f", b"\xff" * 8)
WORDS = (
    b"[" * 3000, b'{"a":' * 500, b"1e999", b"-1", b"NaN", b"9" * 400, b"null", b'""', b"\n", b";",
    b"&a [*a,*a]", b"..", b"\xed\xa0\x80", b"18446744073709551616", b"<!DOCTYPE x>", b"[]", b"{}",
)  # fmt: skip
ODD: tuple[Any, ...] = (
    None, True, -1, 0, 1, 1 << 63, 10**400, 1e308, 0.5, "", "../up", "/", "a\nb", "\0", "=1+1",
    "NaN", "9" * 300, [], {}, [[]], [None, None], {"a": {"a": []}}, [[[[[[[[1]]]]]]]],
)  # fmt: skip
"""Values that stand where another was meant."""
ONE_TO_THREE = (1, 1, 1, 2, 3)


def draws(rng: np.random.Generator) -> Iterator[int]:
    """Yield whole numbers from 0 to 2³¹, drawn many at a time."""
    while True:
        yield from rng.integers(1 << 31, size=1024).tolist()


def damaged(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return `data` with one to three things done to it; `other` is another sample to splice."""
    for _ in range(ONE_TO_THREE[next(drawn) % 5]):
        kind, at = next(drawn) % 9, next(drawn) % (len(data) + 1)
        if kind <= 2 and data:
            flipped = bytearray(data)
            for _ in range(1 + next(drawn) % 3):
                flipped[next(drawn) % len(data)] ^= 1 << next(drawn) % 8
            data = bytes(flipped)
        elif kind == 3:
            data = data[:at]
        elif kind == 4:
            edge = EDGES[next(drawn) % len(EDGES)]
            data = data[:at] + edge + data[at + len(edge) :]
        elif kind == 5:
            word = WORDS[next(drawn) % len(WORDS)]
            data = data[:at] + word + data[at + next(drawn) % 6 :]
        elif kind == 6:
            data = data[:at] + other[next(drawn) % (len(other) + 1) :]
        elif kind == 7:
            end = at + next(drawn) % (len(data) + 1 - at)
            data = data[:end] + data[at:end] + data[end:]
        elif next(drawn) % 3 == 0:
            data = bytes(next(drawn) % 256 for _ in range(next(drawn) % 64))
        else:
            data = data[at:]
    return data


def changed(value: Any, drawn: Iterator[int]) -> Any:
    """Return a JSON value with one to three places of it changed, doubled, renamed or gone."""
    for _ in range(ONE_TO_THREE[next(drawn) % 5]):
        value = _changed_once(value, drawn)
    return value


def _changed_once(value: Any, drawn: Iterator[int]) -> Any:
    if not isinstance(value, dict | list) or not value or next(drawn) % 6 == 0:
        return ODD[next(drawn) % len(ODD)]
    found, kind = value.copy(), next(drawn) % 16
    keys = list(found) if isinstance(found, dict) else range(len(found))
    key = keys[next(drawn) % len(keys)]
    if kind == 0:
        del found[key]
    elif kind == 1 and isinstance(found, dict):
        found[f"{key}_"] = found.pop(key)
    elif kind == 1 and isinstance(found, list):
        found.append(found[key])
    else:
        found[key] = _changed_once(found[key], drawn)
    return found


def json_or_bytes(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return a JSON text with values changed, or its bytes damaged."""
    if next(drawn) % 2:
        return damaged(data, other, drawn)
    return json.dumps(changed(json.loads(data), drawn)).encode("utf-8", "surrogatepass")


def sealed_again(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return a sealed file with values changed and a checksum that agrees."""
    content = json.loads(data)
    content.pop("sha256", None)
    found = changed(content, drawn)
    return seal(found if isinstance(found, dict) and found else {"a": found})


def chained_again(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return a file of chained lines with values changed, every line vouching for those before."""
    written = b""
    for record in _records(data, drawn):
        written += encode_line({**record, "after": f"{zlib.crc32(written):08x}"})
    return written


def journal_again(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return a journal with values changed, every line with a checksum that agrees."""
    return b"".join(map(encode_line, _records(data, drawn)))


def arrays_again(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return an .npz file of which one to three arrays are others; texts in them are JSON."""
    arrays = dict(_arrays_of(data))
    for _ in range(ONE_TO_THREE[next(drawn) % 5]):
        name = list(arrays)[next(drawn) % len(arrays)]
        found = _array_again(arrays.pop(name), drawn)
        if found is not None:
            arrays[name] = found
        if not arrays:
            break
    written = io.BytesIO()
    np.savez(written, allow_pickle=False, **arrays)
    return written.getvalue()


@lru_cache(maxsize=4)
def _arrays_of(data: bytes) -> dict[str, Any]:
    with np.load(io.BytesIO(data)) as file:
        return {name: file[name] for name in file.files}


def _is_json(data: bytes) -> bool:
    """Tell whether it is a whole object; one that was cut before is bytes like others."""
    try:
        return isinstance(json.loads(data), dict)
    except ValueError:
        return False


def _array_again(array: Any, drawn: Iterator[int]) -> Any:
    """Return another array, None for none at all."""
    kind = next(drawn) % 8
    if array.dtype == np.uint8 and _is_json(array.tobytes()):
        text = json.dumps(changed(json.loads(array.tobytes()), drawn)).encode()
        return np.frombuffer(text if kind else text[: len(text) // 2], np.uint8)
    if kind == 0:
        return None
    if kind == 1:
        return array[: next(drawn) % (len(array) + 1)] if array.ndim else array.reshape(1)
    if kind == 2:
        return array.reshape(-1)
    if kind == 3:
        wanted = (np.float64, np.uint8, "U9", bool, np.complex128)[next(drawn) % 5]
        with np.errstate(invalid="ignore"):  # a missing number becomes any whole one
            return array.astype("U9" if array.dtype.kind not in "fiub" else wanted)
    if array.dtype.kind not in "fiub" or not array.size:
        return np.zeros((2, 0))
    is_float = array.dtype.kind == "f"
    edges = (np.nan, np.inf, -1, 0, 1e300) if is_float else (-1, 0, 255, 1 << 30, -(1 << 62))
    edged = array.astype(np.float64 if is_float else np.int64)
    at = next(drawn) % edged.size
    edged.reshape(-1)[slice(None) if kind == 4 else at] = edges[next(drawn) % len(edges)]
    return edged


def _records(data: bytes, drawn: Iterator[int]) -> list[dict[str, Any]]:
    whole = [json.loads(line) for line in data.splitlines()]
    found = changed(whole, drawn)
    records = [r for r in found if isinstance(r, dict)] if isinstance(found, list) else []
    bare = ({k: v for k, v in record.items() if k not in CHECKED} for record in records)
    return [record for record in bare if record]


CHECKED = ("crc32", "after")
