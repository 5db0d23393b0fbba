"""Fingerprint of a study folder: what its sessions recorded and every cell of its tables.

A fingerprint is a mapping from a name that says where ("sub-S01B/ses-001: stream gaze: valid") to
what stands there. Whole numbers, truths and texts are pinned exactly; numbers with a fraction by
value, or by weighted sums over eight stretches of a column, and compared with a tolerance that the
last bit of another processor's arithmetic stays within. Hashes, wall times, versions and paths of
the computer are no part of it: of a recording only streams, events and trial rows are read, of
`derived` only the CSV files.

`python -m tests.experiments.fingerprint FOLDER [OTHER]` prints a folder's fingerprint, or the
first difference between two folders.
"""

import csv
import hashlib
import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.recording.reader import Recording
from visavis.running.sessions.study_folder import DERIVED_FOLDER, sessions_of

Fingerprint = Mapping[str, Any]

RELATIVE: Final = 1e-9
ABSOLUTE: Final = 1e-12
STRETCHES: Final = 8
MAX_CELL_ROWS: Final = 400
"""Tables with more rows are pinned column by column."""
MAX_PAYLOAD_CHARACTERS: Final = 400
HASH_SUFFIX: Final = "_sha256"
"""Columns and keys of this ending are left out: the last bit of a float changes all of a hash."""


def fingerprint_of_sessions(folder: Path) -> dict[str, Any]:
    """Return the fingerprint of what a study's sessions recorded."""
    found: dict[str, Any] = {}
    for session in sessions_of(folder):
        where = f"{session.parent.name}/{session.name}"
        for name, value in _of_recording(Recording(session)):
            found[f"{where}: {name}"] = value
    return found


def fingerprint_of_study(folder: Path) -> dict[str, Any]:
    """Return the fingerprint of a study's sessions and of its tables, where it was analysed."""
    found = fingerprint_of_sessions(folder)
    for path in sorted((folder / DERIVED_FOLDER).glob("*.csv")):
        found.update(fingerprint_of_table(path))
    return found


def fingerprint_of_table(path: Path) -> dict[str, Any]:
    """Return the fingerprint of a CSV file, cell by cell or, when it is long, by columns."""
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))
    name, headings = path.name, lines[0] if lines else []
    kept = [i for i, heading in enumerate(headings) if not heading.endswith(HASH_SUFFIX)]
    rows = [[line[i] for i in kept] for line in lines[1:]]
    names = [headings[i] for i in kept]
    found: dict[str, Any] = {f"{name}: columns": names, f"{name}: rows": len(rows)}
    if len(rows) <= MAX_CELL_ROWS:
        for number, row in enumerate(rows, start=1):
            found[f"{name}: row {number}"] = [_cell(text) for text in row]
        return found
    for i, column in enumerate(names):
        found[f"{name}: {column}"] = _of_values([_cell(row[i]) for row in rows])
    return found


def first_difference(pinned: Fingerprint, found: Fingerprint) -> str:
    """Return what differs first and how; empty when nothing does."""
    for name, expected in pinned.items():
        if name not in found:
            return f"{name} is gone"
        table, is_row, _ = name.partition(": row ")
        headings = pinned.get(f"{table}: columns") if is_row else None
        where, difference = _differs(expected, found[name], headings)
        if difference:
            return f"{name}{where}: {difference}"
    new = [name for name in found if name not in pinned]
    return f"{new[0]} is new" if new else ""


def in_layout(
    pinned: Fingerprint,
    found: Fingerprint,
    moved: Mapping[str, str] = MappingProxyType({}),
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """Return what was found as the pinned tables lay it out, for `first_difference`.

    Tables and columns may be added, and columns change places. `moved` leads from a pinned table
    ("condition_means.csv") or column ("condition_means.csv: n_trials") to the name it has now;
    `renamed` from a text in a cell to the one that stands there now. Nothing pinned is left out:
    what is not found stays missing. Streams and events are compared as they are.
    """
    result: dict[str, Any] = {}
    for name, value in pinned.items():
        place, _, what = name.partition(".csv: ")
        if not what:
            if name in found:
                result[name] = found[name]
            continue
        table = f"{place}.csv"
        now = moved.get(table, table)
        if f"{now}: columns" not in found:
            continue
        headings = list(found[f"{now}: columns"])
        columns = pinned[f"{table}: columns"]
        at = [moved.get(f"{table}: {c}", c) for c in columns]
        if what == "columns":
            result[name] = [c for c, new in zip(columns, at, strict=True) if new in headings]
        elif what.startswith("row ") and f"{now}: {what}" in found:
            row = dict(zip(headings, found[f"{now}: {what}"], strict=True))
            cells = [row[new] for new in at if new in row]
            result[name] = [
                pin if isinstance(pin, str) and renamed.get(pin) == cell else cell
                for pin, cell in zip(value, cells, strict=False)
            ]
        elif f"{now}: {moved.get(name, what)}" in found:
            result[name] = found[f"{now}: {moved.get(name, what)}"]
    return result | {
        name: value
        for name, value in found.items()
        if name not in pinned and ".csv: " not in name and ": trial rows: " not in name
    }


def write_fingerprint(fingerprint: Fingerprint, path: Path) -> None:
    """Write a fingerprint as JSON, one line for each thing that is pinned."""
    lines = [
        f"{json.dumps(name, ensure_ascii=False)}: {json.dumps(value, ensure_ascii=False)}"
        for name, value in fingerprint.items()
    ]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def read_fingerprint(path: Path) -> dict[str, Any]:
    """Return a fingerprint that was written."""
    read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return read


# ---- what was recorded ------------------------------------------------------------------------


def _of_recording(recording: Recording) -> Iterator[tuple[str, Any]]:
    for stream in recording.stream_names:
        columns = recording.stream_arrays(stream)
        yield f"stream {stream}", list(columns)
        for column, values in columns.items():
            yield f"stream {stream}: {column}", _of_array(values)
    for number, event in enumerate(recording.events().to_dict("records"), start=1):
        yield f"event {number}", [event["name"], event["t_ns"], _of_payload(event["payload"])]
    rows = [t["row"] for p in recording.manifest.parts for t in recording.trial_entries(p.number)]
    for column in dict.fromkeys(name for row in rows for name in row):
        if not column.endswith(HASH_SUFFIX):
            yield f"trial rows: {column}", _of_values([row.get(column) for row in rows])


def _of_payload(payload: Any) -> Any:
    kept = _without_hashes(payload)
    if len(json.dumps(kept)) <= MAX_PAYLOAD_CHARACTERS:
        return kept
    numbers: list[float] = []
    exactly = _hash(json.dumps(_masked(kept, numbers)))
    return {"exactly": exactly, "numbers": _summed(numbers, stretches=1)}


def _without_hashes(value: Any) -> Any:
    """Return a JSON value without hashes; texts that are JSON themselves are read."""
    if isinstance(value, Mapping):
        return {k: _without_hashes(v) for k, v in value.items() if not k.endswith(HASH_SUFFIX)}
    if isinstance(value, list):
        return [_without_hashes(v) for v in value]
    if isinstance(value, str) and value[:1] in ("[", "{"):
        try:
            return _without_hashes(json.loads(value))
        except ValueError:
            return value
    return value


def _masked(value: Any, numbers: list[float]) -> Any:
    """Return a JSON value with its fractional numbers moved to `numbers`."""
    if isinstance(value, float):
        numbers.append(value)
        return "#"
    if isinstance(value, Mapping):
        return {k: _masked(v, numbers) for k, v in value.items()}
    if isinstance(value, list):
        return [_masked(v, numbers) for v in value]
    return value


# ---- columns ----------------------------------------------------------------------------------


def _of_array(values: npt.NDArray[Any]) -> dict[str, Any]:
    what: dict[str, Any] = {"dtype": values.dtype.str, "shape": list(values.shape)}
    if values.dtype.kind == "f":
        return {**what, "numbers": _summed(values.astype(np.float64).ravel())}
    if values.dtype.kind in "OU":
        return {**what, "exactly": _hash(json.dumps(values.tolist()))}
    return {**what, "exactly": _hash(np.ascontiguousarray(values).tobytes())}


def _of_values(values: Sequence[Any]) -> dict[str, Any]:
    """Return the fingerprint of a column of plain values, of which None is missing."""
    numbers: list[float] = []
    masked = _masked(list(values), numbers)
    found: dict[str, Any] = {"rows": len(values), "exactly": _hash(json.dumps(masked))}
    return {**found, "numbers": _summed(numbers)} if numbers else found


def _summed(
    values: Sequence[float] | npt.NDArray[np.float64], stretches: int = STRETCHES
) -> list[list[float]]:
    """Return of each stretch: count of finite values, weighted sum, sum of sizes.

    The weights, between 0.5 and 1.5, differ from place to place, so that values that changed
    places are seen.
    """
    every = np.asarray(values, np.float64)
    place = np.arange(every.size, dtype=np.uint64)
    weights = 0.5 + (place * np.uint64(2654435761) % np.uint64(1 << 32)) / float(1 << 32)
    found = []
    for part, weight in zip(
        np.array_split(every, stretches), np.array_split(weights, stretches), strict=True
    ):
        finite = np.isfinite(part)
        known, w = part[finite], weight[finite]
        found.append([int(finite.sum()), float((w * known).sum()), float(np.abs(known).sum())])
    return found


def _cell(text: str) -> Any:
    """Return what a cell holds: a fractional number as such, everything else as its text."""
    if text.lstrip("+-").isdigit():
        return text
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text


def _hash(content: str | bytes) -> str:
    raw = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(raw).hexdigest()[:16]


# ---- differences ------------------------------------------------------------------------------


def _differs(expected: Any, found: Any, headings: Sequence[str] | None = None) -> tuple[str, str]:
    """Return where in a value it differs and how; two empty texts when it does not.

    `headings` name the places of a list.
    """
    if isinstance(expected, Mapping) and isinstance(found, Mapping):
        if "numbers" in expected and "numbers" in found:
            rest = [{k: v for k, v in d.items() if k != "numbers"} for d in (expected, found)]
            where, difference = _differs(*rest)
            if difference:
                return where, difference
            return "", _sums_differ(expected["numbers"], found["numbers"])
        if expected.keys() != found.keys():
            odd = sorted(expected.keys() ^ found.keys())
            return "", f"{', '.join(odd)} only {'before' if odd[0] in expected else 'now'}"
        return _first((f", {k}", v, found[k]) for k, v in expected.items())
    if isinstance(expected, list) and isinstance(found, list):
        if len(expected) != len(found):
            return "", f"{len(expected)} pinned, {len(found)} found: {expected} against {found}"
        names = headings or [f"place {i}" for i in range(1, len(expected) + 1)]
        return _first(
            (f", {name}", e, f) for name, e, f in zip(names, expected, found, strict=True)
        )
    if isinstance(expected, float) and isinstance(found, float):
        same = math.isclose(expected, found, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
        same = same or (math.isnan(expected) and math.isnan(found))
    else:
        same = type(expected) is type(found) and expected == found
    return "", "" if same else f"{expected!r} pinned, {found!r} found"


def _first(pairs: Iterable[tuple[str, Any, Any]]) -> tuple[str, str]:
    for name, expected, found in pairs:
        where, difference = _differs(expected, found)
        if difference:
            return name + where, difference
    return "", ""


def _sums_differ(expected: list[list[float]], found: list[list[float]]) -> str:
    for number, ((n, total, size), (m, now, _)) in enumerate(
        zip(expected, found, strict=True), start=1
    ):
        which = f"in stretch {number} of {len(expected)}"
        if n != m:
            return f"{n} finite values pinned, {m} found {which}"
        if abs(total - now) > RELATIVE * size + ABSOLUTE:
            return f"weighted sum {total!r} pinned, {now!r} found {which}"
    return ""


if __name__ == "__main__":
    first, *others = (fingerprint_of_study(Path(folder)) for folder in sys.argv[1:])
    if others:
        sys.stdout.write((first_difference(first, others[0]) or "no difference") + "\n")
    else:
        sys.stdout.write(json.dumps(first, indent=1, ensure_ascii=False) + "\n")
