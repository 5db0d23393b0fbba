"""Perform a recorded session again, and find the first thing in which the two differ.

A simulated session is its plan, its seed and its devices: the same code performs them again on the
virtual clock, through the same drivers over the same simulated wires, and every sample, event and
trial row must come out bit for bit.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from lab.clock import NS_PER_S, SimClock
from lab.config import DeviceConfig, LabConfig
from lab.errors import DataError, UsageError
from protocol.operator import UnattendedOperator
from recording.journal import as_json
from recording.reader import PART_COLUMN, Recording, component_names
from recording.stream_file import Columns
from visavis.opened import OpenedStudy, overrides_of
from visavis.sessions.perform import Request, perform_new

DRAWN: Final = ("drawn", "drawn_views", "mirror")
"""Streams of what was drawn: nothing is drawn when a session is performed again."""


@dataclass(frozen=True)
class Difference:
    """The first thing in which two recordings of a session differ.

    `where` names the stream, or events or trial rows; `row` counts in it from 0, `frame` is the
    display's then, None before the first. `recorded` and `again` are the values, or what is
    missing.
    """

    t_ns: int
    where: str
    row: int
    column: str
    recorded: str
    again: str
    frame: int | None = None
    trial_id: str | None = None

    def told(self) -> str:
        """Return it as a sentence."""
        frame = "before the first frame" if self.frame is None else f"frame {self.frame}"
        trial = f", trial {self.trial_id}" if self.trial_id else ""
        return (
            f"{frame} ({self.t_ns / NS_PER_S:.6f} s{trial}): {self.where}, row {self.row}, "
            f"{self.column}: recorded {self.recorded}, again {self.again}"
        )


@dataclass(frozen=True)
class Verdict:
    """What performing a session again found; `compared` counts rows by stream."""

    first: Difference | None
    differing: Mapping[str, int]
    compared: Mapping[str, int]
    left_out: tuple[str, ...]


def verify(recording: Recording, study: OpenedStudy, lab: LabConfig, scratch: Path) -> Verdict:
    """Perform a session again below an empty folder and compare.

    `lab` gives what a recording does not keep: how its questionnaires are worded.

    Raises:
        UsageError: it is no session that can be performed again.
        DataError: this version plans it in another way.
    """
    again = Recording(perform_again(recording, study, lab, scratch))
    return compared(recording, again)


def perform_again(recording: Recording, study: OpenedStudy, lab: LabConfig, scratch: Path) -> Path:
    """Perform a simulated session again; return its new folder; raises as `verify`."""
    manifest = recording.manifest
    if not manifest.is_simulated:
        raise UsageError(
            f"{recording.path} was recorded with people or real devices, whom nothing performs "
            "again; `visavis check` compares it with its plan, `visavis view` shows it"
        )
    if len(manifest.parts) != 1 or recording.status not in ("complete", "aborted", "crashed"):
        raise UsageError(
            f"{recording.path} has {len(manifest.parts)} parts and is {recording.status}; only a "
            "session performed in one go can be performed again"
        )
    kept: Mapping[str, Any] = manifest.configuration
    devices = {role: DeviceConfig(**told) for role, told in kept["devices"].items()}
    config = lab.model_copy(update={"data_root": scratch, "devices": devices})
    plan: Mapping[str, Any] = manifest.plan
    experiment = study.experiment(overrides_of(plan))
    request = Request(
        study=study,
        experiment=experiment,
        config=config,
        participant_label=manifest.participant,
        participant_index=int(plan["participant_index"]),
        group=str(plan.get("group") or ""),
        session=manifest.session,
        seed=manifest.seed,
        clock=SimClock(),
        operator=UnattendedOperator(),
        effect=bool(kept.get("effect", True)),
    )
    planned = as_json(experiment.plan(request.participant_index, request.seed, request.group))
    if planned != plan:
        raise DataError(
            f"{recording.path}: this version of Visavis, or of the study, plans another session "
            f"({_first_of(plan, planned)}); check out the version named in manifest.json "
            "(provenance)"
        )
    return perform_new(request)


def _first_of(a: Any, b: Any, path: str = "plan") -> str:
    """Return where two JSON values differ first."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(k for k in b if k not in a)]:
            if a.get(key) != b.get(key):
                return _first_of(a.get(key), b.get(key), f"{path}.{key}")
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            if x != y:
                return _first_of(x, y, f"{path}[{k}]")
    return f"{path}: recorded {_short(a)}, now {_short(b)}"


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 80 else f"{text[:77]}…"


def compared(recorded: Recording, again: Recording) -> Verdict:
    """Compare two recordings of one session, bit for bit."""
    found: list[Difference] = []
    differing: dict[str, int] = {}
    rows: dict[str, int] = {}
    left_out = []
    for name in dict.fromkeys([*recorded.stream_names, *again.stream_names]):
        if name in DRAWN:
            left_out.append(name)
            continue
        old, new = (
            r.stream_arrays(name) if name in r.stream_names else {} for r in (recorded, again)
        )
        rows[name] = len(old.get("seq", ()))
        first, count = _of_stream(name, old, new)
        if first is not None:
            found.append(first)
            differing[name] = count
    for where, old_lines, new_lines in (
        ("events", recorded.journal(1).events, again.journal(1).events),
        ("trial rows", recorded.journal(1).trials, again.journal(1).trials),
    ):
        rows[where] = len(old_lines)
        different = list(_of_lines(where, old_lines, new_lines))
        if different:
            found.append(different[0])
            differing[where] = len(different)
    first = min(found, key=lambda d: d.t_ns, default=None)
    placed = None if first is None else _placed(first, again)
    return Verdict(placed, differing, rows, tuple(left_out))


def _of_stream(name: str, old: Columns, new: Columns) -> tuple[Difference | None, int]:
    """Return the first row and column in which a stream differs, and how many rows do."""
    n_old, n_new = len(old.get("seq", ())), len(new.get("seq", ()))
    n = min(n_old, n_new)
    names = [column for column in (old or new) if column != PART_COLUMN]
    differs = np.zeros(n, np.bool_)
    first: tuple[int, str] | None = None
    for column in names:
        if column not in old or column not in new:
            have, lack = ("recorded", "again") if column in old else ("again", "recorded")
            there = {have: "there", lack: "missing"}
            return Difference(0, name, 0, column, there["recorded"], there["again"]), max(
                n_old, n_new
            )
        unequal = _unequal(old[column][:n], new[column][:n])
        differs |= unequal
        if unequal.any():
            row = int(np.flatnonzero(unequal)[0])
            if first is None or row < first[0]:
                first = row, column
    count = int(differs.sum()) + abs(n_old - n_new)
    if first is not None:
        row, column = first
        flat, old_value, new_value = _component(column, old[column][row], new[column][row])
        t_ns = min(int(c["t_host_ns"][row]) for c in (old, new))
        return Difference(t_ns, name, row, flat, old_value, new_value), count
    if n_old != n_new:
        longer = old if n_old > n_new else new
        told = ("there", "missing") if n_old > n_new else ("missing", "there")
        return Difference(int(longer["t_host_ns"][n]), name, n, "the row", *told), count
    return None, 0


def _unequal(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Tell which rows differ in any bit."""
    if a.dtype != b.dtype or a.shape != b.shape:
        return np.ones(len(a), np.bool_)
    if not len(a):
        return np.zeros(0, np.bool_)
    x, y = (np.ascontiguousarray(v).reshape(len(v), -1).view(np.uint8) for v in (a, b))
    different: npt.NDArray[np.bool_] = (x != y).any(axis=1)
    return different


def _component(column: str, old: Any, new: Any) -> tuple[str, str, str]:
    """Return which component of a row's value differs first, and both values."""
    a, b = np.atleast_1d(np.asarray(old)).ravel(), np.atleast_1d(np.asarray(new)).ravel()
    if len(a) != len(b):
        return column, str(a.shape), str(b.shape)
    k = int(np.flatnonzero(_unequal(a, b))[0])
    name = column if len(a) == 1 else component_names(column, len(a))[k]
    return name, repr(a[k].item()), repr(b[k].item())


def _of_lines(
    where: str, old: tuple[dict[str, Any], ...], new: tuple[dict[str, Any], ...]
) -> Iterator[Difference]:
    """Yield the differing lines of a journal."""
    for row in range(max(len(old), len(new))):
        if row >= len(old) or row >= len(new):
            line = (old if row < len(old) else new)[row]
            told = ("there", "missing") if row < len(old) else ("missing", "there")
            yield Difference(int(line["t_ns"]), where, row, _what(line), *told)
        elif old[row] != new[row]:
            a, b = old[row], new[row]
            t_ns = min(int(a["t_ns"]), int(b["t_ns"]))
            place, _, values = _first_of(a, b, _what(a)).rpartition(": recorded ")
            was, _, now = values.rpartition(", now ")
            yield Difference(t_ns, where, row, place, was, now)


def _what(line: Mapping[str, Any]) -> str:
    return str(line.get("name") or line.get("row", {}).get("trial_id") or "line")


def _placed(found: Difference, again: Recording) -> Difference:
    """Say in which frame and trial it lies."""
    frames = again.stream_arrays("frames")
    before = np.flatnonzero(frames["t_host_ns"] <= found.t_ns)
    frame = int(frames["frame_index"][before[-1]]) if len(before) else None
    begun = again.events_named("trial_start", 1)
    past = begun[begun["t_ns"] <= found.t_ns]
    trial = str(past.iloc[-1]["payload"]["trial_id"]) if len(past) else None
    return replace(found, frame=frame, trial_id=trial)
