"""Perform a recorded session again, and find the first thing in which the two differ.

Plan, seed and devices determine a simulated session. The same code performs it again on the virtual
clock, through the same drivers and simulated wires, and every sample, event and trial row must be
equal bit for bit. A resumed part starts again from the earlier parts as recorded, and commands of
the operator are repeated at the same times. Sessions with people, and simulations in real time,
cannot be repeated, since their times differ in every run; there the engine is fed with the recorded
samples of the devices.
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S, SIMULATED_EPOCH_ISO, SimClock
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.errors import DataError, SessionAborted, UsageError
from visavis.protocol.session.operator import (
    Action,
    Command,
    Operator,
    SessionStatus,
    UnattendedOperator,
)
from visavis.recording.folder import session_dir
from visavis.recording.journal import as_json
from visavis.recording.manifest import Part, write_manifest
from visavis.recording.reader import PART_COLUMN, Recording, component_names
from visavis.recording.stream_file import Columns
from visavis.results.opened_study import OpenedStudy, overrides_of
from visavis.results.reevaluation import TARGETS, targets_again
from visavis.running.sessions.perform import of_no_session, perform_new, perform_rest
from visavis.running.sessions.session_request import Request, SessionPerson

DRAWN_STREAMS: Final = ("drawn", "drawn_gpu", "drawn_views", "mirror")
"""Streams of what was drawn: nothing is drawn when a session is performed again."""


@dataclass(frozen=True)
class Difference:
    """The first thing in which two recordings of a session differ.

    `where` names the stream, or events or trial rows; `row` counts in it from 0 within the part,
    `frame` is the display's then, None before the first. `old_value` and `new_value` are the
    recorded value and that of the repetition, or what is missing.
    """

    t_ns: int
    where: str
    row: int
    column: str
    old_value: str
    new_value: str
    frame: int | None = None
    trial_id: str | None = None
    part: int = 1
    has_frames: bool = True

    def as_sentence(self) -> str:
        """Return the difference as a sentence."""
        frame = "before the first frame" if self.frame is None else f"in frame {self.frame}"
        frame = frame if self.has_frames else "on the page"
        frame = f"part {self.part}, {frame}" if self.part > 1 else frame
        trial = f", trial {self.trial_id}" if self.trial_id else ""
        return (
            f"{frame} ({self.t_ns / NS_PER_S:.6f} s{trial}): {self.where}, row {self.row}, "
            f"{self.column}: recorded {self.old_value}, again {self.new_value}"
        )


@dataclass(frozen=True)
class Verdict:
    """The result of performing a session again.

    `row_counts` counts rows by stream, in the longer of both recordings, and `differing` those that
    are not equal. `ended_early` are parts that were cut off, of which the existing rows were
    compared. `is_fed` means that people, or a simulation in real time, were recorded, and that the
    engine was fed with the samples of the devices.
    """

    first: Difference | None
    differing: Mapping[str, int]
    row_counts: Mapping[str, int]
    left_out: tuple[str, ...]
    ended_early: tuple[int, ...] = ()
    is_fed: bool = False


def verify(recording: Recording, study: OpenedStudy, lab: LabConfig, scratch: Path) -> Verdict:
    """Perform a session again below an empty folder and compare, part by part.

    `lab` gives what a recording does not keep: the wording of its questionnaires.

    Raises:
        UsageError: it is being recorded, or has nothing that can be performed again.
        DataError: this version plans the session in another way.
    """
    if recording.status == "running":
        raise UsageError(f"{recording.path} is being recorded; verify it when it has ended")
    if not recording.manifest.is_simulated:
        return _verify_by_feeding(recording, study)
    if is_in_real_time(recording):
        _require_same_plan(recording, study)
        return _verify_by_feeding(recording, study)
    verdicts = []
    for part in recording.manifest.parts:
        below = scratch / part.folder
        again = Recording(perform_again(recording, study, lab, below, part.number))
        verdicts.append(compare_recordings(recording, again, part.number))
        shutil.rmtree(below)
    return _join(verdicts)


def is_in_real_time(recording: Recording) -> bool:
    """Tell whether any part of a session ran on the machine's clock, which no other run repeats."""
    return any(p.started_wall_iso != SIMULATED_EPOCH_ISO for p in recording.manifest.parts)


def _require_same_plan(recording: Recording, study: OpenedStudy) -> None:
    """Refuse a session that this version would plan otherwise; see `verify`."""
    manifest = recording.manifest
    plan: Mapping[str, Any] = manifest.plan
    new_plan = as_json(
        study.experiment(overrides_of(plan), is_recorded=True)
        .of_session(manifest.session)
        .plan(int(plan["participant_index"]), manifest.seed, str(plan.get("group") or ""))
    )
    if new_plan != plan:
        raise DataError(
            f"{recording.path}: this version of Visavis, or of the study, plans another session "
            f"({_first_of(plan, new_plan)}); check out the version named in manifest.json "
            "(provenance)"
        )


def perform_again(
    recording: Recording, study: OpenedStudy, lab: LabConfig, scratch: Path, part: int = 1
) -> Path:
    """Perform a part of a simulated session again; return its new folder; raises as `verify`.

    Earlier parts lie in that folder as they were recorded.
    """
    manifest = recording.manifest
    if not manifest.is_simulated:
        raise UsageError(
            f"{recording.path} was recorded with people or real devices, whom nothing performs "
            "again; `visavis check` compares it with its plan, `visavis view` shows it"
        )
    configuration: Mapping[str, Any] = manifest.configuration
    devices = {role: DeviceConfig(**options) for role, options in configuration["devices"].items()}
    on = str(configuration.get("on", ""))
    if on == "browser":  # a simulated participant of a page needs no device
        devices = dict(lab.devices)
    config = lab.model_copy(update={"data_root": scratch, "devices": devices})
    _require_same_plan(recording, study)
    plan: Mapping[str, Any] = manifest.plan
    experiment = study.experiment(overrides_of(plan))
    if study.took_heads_at_onset(recording, part):
        experiment = replace(experiment, heads_move=False)
    clock = SimClock()
    request = Request(
        study=study,
        experiment=experiment,
        config=config,
        person=SessionPerson(
            manifest.participant,
            int(plan["participant_index"]),
            str(plan.get("group") or ""),
            manifest.session,
        ),
        seed=manifest.seed,
        clock=clock,
        operator=_operator_of(recording, part, clock),
        effect=bool(configuration.get("effect", True)),
        on=on,
    )
    path = session_dir(
        scratch, manifest.study, manifest.participant, manifest.session, is_simulated=True
    )
    before = tuple(p for p in manifest.parts if p.number < part)
    with suppress(SessionAborted), of_no_session():  # the recorded part may have ended early, too
        if before:
            _copy_parts(recording, before, path)
            perform_rest(request, path, in_any_light=True)
        else:
            perform_new(request)
    return path


def _copy_parts(recording: Recording, parts: Sequence[Part], path: Path) -> None:
    """Copy parts of a session into a folder, without the parts after them."""
    for part in parts:
        shutil.copytree(recording.path / part.folder, path / part.folder)
    write_manifest(path, replace(recording.manifest, parts=tuple(parts)))


class RecordedOperator:
    """Repeat the commands of a part's operator at the same times."""

    status_period_ns = 1

    def __init__(self, commands: Sequence[tuple[int, Command]], clock: SimClock) -> None:
        self._commands, self._clock = list(commands), clock

    def poll(self) -> Sequence[Command]:
        """Return what was asked for up to now."""
        now_ns = self._clock.now_ns()
        due = [command for t_ns, command in self._commands if t_ns <= now_ns]
        self._commands = self._commands[len(due) :]
        return due

    def show(self, status: SessionStatus) -> None:
        """Show nothing: nobody watches."""

    def waits_for_advance(self, prompt: str) -> bool:
        """Wait for the recorded key."""
        del prompt
        return True


def _operator_of(recording: Recording, part: int, clock: SimClock) -> Operator:
    """Return an operator who repeats the commands of a part's operator, if there were any."""
    commands = [
        (int(event["t_ns"]), Command(Action(payload["action"]), payload.get("text") or ""))
        for event in recording.journal(part).events
        if event["name"] == "operator" and "action" in (payload := event["payload"])
    ]
    return RecordedOperator(commands, clock) if commands else UnattendedOperator()


def _verify_by_feeding(recording: Recording, study: OpenedStudy) -> Verdict:
    """Feed the engine with the recorded samples of real devices, and compare what it makes."""
    if TARGETS not in recording.stream_names:
        of = "with people, whom"
        if recording.manifest.is_simulated:
            of = "in real time (run or simulate with --fast gives sessions that repeat), which"
        raise UsageError(
            f"{recording.path} was recorded {of} nothing performs again, and without gaze, which "
            "could be evaluated again; `visavis check` compares it with its plan"
        )
    verdicts = []
    for part in recording.manifest.parts:
        old = recording.stream_arrays(TARGETS, part=part.number)
        new = targets_again(recording, study.views_of, part.number)
        first, count = _of_stream(TARGETS, old, new)
        difference = None if first is None else _with_place(first, recording, part.number)
        differing = {TARGETS: count} if count else {}
        rows = {TARGETS: max(len(old["seq"]), len(new["seq"]))}
        verdicts.append(Verdict(difference, differing, rows, (), is_fed=True))
    return _join(verdicts)


def _join(verdicts: Sequence[Verdict]) -> Verdict:
    """Combine the verdicts of all parts; the first difference is that of the earliest part."""
    differing: dict[str, int] = {}
    rows: dict[str, int] = {}
    for verdict in verdicts:
        for into, counts in ((differing, verdict.differing), (rows, verdict.row_counts)):
            for name, count in counts.items():
                into[name] = into.get(name, 0) + count
    return Verdict(
        next((v.first for v in verdicts if v.first is not None), None),
        differing,
        rows,
        tuple(dict.fromkeys(name for v in verdicts for name in v.left_out)),
        tuple(number for v in verdicts for number in v.ended_early),
        any(v.is_fed for v in verdicts),
    )


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


def compare_recordings(recording: Recording, again: Recording, part: int = 1) -> Verdict:
    """Compare two recordings of one part of a session, bit for bit.

    If a part was cut off (killed, or ended from the keyboard), only its existing rows are compared,
    because the repetition goes on to the end.
    """
    cut_off = (_closed(recording, part), _closed(again, part)) == (False, True)
    differences: list[Difference] = []
    differing: dict[str, int] = {}
    rows: dict[str, int] = {}
    left_out = []
    names = [*recording.stream_states(part), *again.stream_states(part)]
    for name in dict.fromkeys(names):
        if name in DRAWN_STREAMS:
            left_out.append(name)
            continue
        old, new = (
            r.stream_arrays(name, part=part) if name in r.stream_names else {}
            for r in (recording, again)
        )
        if cut_off:
            n = int((old["t_host_ns"] < _last_frame_ns(recording, part)).sum()) if old else 0
            old, new = ({c: values[:n] for c, values in side.items()} for side in (old, new))
        rows[name] = max(len(old.get("seq", ())), len(new.get("seq", ())))
        first, count = _of_stream(name, old, new)
        if first is not None:
            differences.append(first)
            differing[name] = count
    old_journal, new_journal = recording.journal(part), again.journal(part)
    for where, old_lines, new_lines in (
        ("events", old_journal.events, new_journal.events),
        ("trial rows", old_journal.trials, new_journal.trials),
    ):
        new_part = new_lines[: len(old_lines)] if cut_off else new_lines
        rows[where] = max(len(old_lines), len(new_part))
        different = list(_of_lines(where, old_lines, new_part))
        if different:
            differences.append(different[0])
            differing[where] = len(different)
    first = min(differences, key=lambda d: d.t_ns, default=None)
    difference = None if first is None else _with_place(first, again, part)
    return Verdict(difference, differing, rows, tuple(left_out), (part,) if cut_off else ())


def _last_frame_ns(recording: Recording, part: int) -> int:
    """Return when the last frame of a part began; later samples came while devices closed."""
    if "frames" not in recording.stream_names:
        return int(np.iinfo(np.int64).max)
    return int(recording.stream_arrays("frames", part=part)["t_host_ns"].max(initial=0))


def _closed(recording: Recording, part: int) -> bool:
    """Tell whether a part was performed to its end."""
    return any(p.number == part and p.status == "complete" for p in recording.manifest.parts)


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
        presence = ("there", "missing") if n_old > n_new else ("missing", "there")
        return Difference(int(longer["t_host_ns"][n]), name, n, "the row", *presence), count
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
            presence = ("there", "missing") if row < len(old) else ("missing", "there")
            yield Difference(int(line["t_ns"]), where, row, _what(line), *presence)
        elif old[row] != new[row]:
            a, b = old[row], new[row]
            t_ns = min(int(a["t_ns"]), int(b["t_ns"]))
            place, _, values = _first_of(a, b, _what(a)).rpartition(": recorded ")
            was, _, now = values.rpartition(", now ")
            yield Difference(t_ns, where, row, place, was, now)


def _what(line: Mapping[str, Any]) -> str:
    return str(line.get("name") or line.get("row", {}).get("trial_id") or "line")


def _with_place(difference: Difference, recording: Recording, part: int) -> Difference:
    """Add the frame and the trial in which a difference lies."""
    has_frames = "frames" in recording.stream_names
    frame = None
    if has_frames:
        frames = recording.stream_arrays("frames", part=part)
        before = np.flatnonzero(frames["t_host_ns"] <= difference.t_ns)
        frame = int(frames["frame_index"][before[-1]]) if len(before) else None
    trial_starts = recording.events_named("trial_start", part)
    past = trial_starts[trial_starts["t_ns"] <= difference.t_ns]
    trial = str(past.iloc[-1]["payload"]["trial_id"]) if len(past) else None
    return replace(difference, frame=frame, trial_id=trial, part=part, has_frames=has_frames)
