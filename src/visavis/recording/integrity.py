"""Find damage to a recording: which files, rows and trials are gone, in plain words.

Damage is what happened to files after they were written. What a killed process or a full disk
leaves behind (a torn last batch, line or header, a part without its end or its journal) costs no
finished trial and is none.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import pandas as pd

from visavis.lab.errors import DataError
from visavis.recording.journal import JOURNAL_NAME
from visavis.recording.journal_file import JournalContent
from visavis.recording.manifest import MANIFEST_NAME, Part
from visavis.recording.reader import CHANGED, PART_COLUMN, Recording
from visavis.recording.sealed import copy_path, copy_state
from visavis.recording.stream_file import Gap, StreamContent
from visavis.recording.summary import JournalSummary, StreamSummary

DAMAGED_STATUS = "damaged"
"""Status of a finished trial some of whose samples cannot be read any more."""

LOST_STATUS = "lost"
"""Status of a trial whose row cannot be read any more."""


@dataclass(frozen=True)
class StreamDamage:
    """What one stream of a part lost; `rows_lost` None where nothing says how many.

    `is_untrusted`: no row can be trusted, because the whole file was replaced by another.
    """

    part: int
    stream: str
    rows_written: int | None
    rows_lost: int | None
    gaps: tuple[Gap, ...]
    is_untrusted: bool = False

    def strikes(self, t_start_ns: int | None, t_end_ns: int | None) -> bool:
        """Return whether samples between two times may be lost."""
        if self.is_untrusted:
            return True
        if t_start_ns is None or t_end_ns is None:
            return bool(self.gaps)
        return any(
            (gap.after_ns is None or t_end_ns > gap.after_ns)
            and (gap.before_ns is None or t_start_ns < gap.before_ns)
            for gap in self.gaps
        )


@dataclass(frozen=True)
class TrialDamage:
    """A trial that cannot be analysed as it was performed, and why.

    `status` is DAMAGED_STATUS or LOST_STATUS; `part` and `attempt` are None where no trace of them
    is left.
    `streams` are those with rows lost during the trial; an `untrusted` one is without its journal.
    """

    part: int | None
    trial_id: str
    attempt: int | None
    status: str
    streams: tuple[str, ...]
    reason: str


@dataclass(frozen=True)
class DamageReport:
    """Everything found wrong with one session's files; see `damage_of`.

    `notes` is what no number depends on, and is not damage: a copy that cannot be read.
    """

    session: Path
    participant: str
    number: int
    problems: tuple[str, ...]
    streams: tuple[StreamDamage, ...]
    trials: tuple[TrialDamage, ...]
    journal_lines_lost: int
    notes: tuple[str, ...] = ()

    @property
    def is_damaged(self) -> bool:
        """Return whether anything is wrong."""
        return bool(self.problems)

    def summary(self) -> tuple[str, ...]:
        """Return in plain words what is missing, a line each."""
        lines = []
        lost_ids = [t.trial_id for t in self.trials if t.status == LOST_STATUS]
        if self.journal_lines_lost:
            n = self.journal_lines_lost
            of = (
                f": with them {_count_and_names(lost_ids, 'trial')} and perhaps answers"
                if lost_ids
                else ""
            )
            lines.append(f"{n} line{'s' if n != 1 else ''} of the journal cannot be read{of}")
        for stream in self.streams:
            trial_ids = [t.trial_id for t in self.trials if stream.stream in t.streams]
            where = (
                f", during {_count_and_names(trial_ids, 'trial')}"
                if trial_ids
                else ", outside all trials"
            )
            lines.append(f"{stream.stream} (part {stream.part}): {_rows(stream)}{where}")
        if not lines or not self.streams:
            lines += self.problems
        return tuple(lines)


_REPORTS: "WeakKeyDictionary[Recording, DamageReport]" = WeakKeyDictionary()


def damage_of(recording: Recording) -> DamageReport:
    """Compare every file of a session with its SHA-256, and read what has none or another again.

    Per stream, which rows are gone; per trial, what of it is missing. Never raises for damage.
    As with all that a `Recording` reads, files are looked at once: open it anew to look again.
    """
    if recording not in _REPORTS:
        _REPORTS[recording] = _damage_of(recording)
    return _REPORTS[recording]


def adopt_report(recording: Recording, report: DamageReport) -> None:
    """Let `damage_of` give a report that another process made of the same files just before."""
    _REPORTS[recording] = report


def confirm_report(recording: Recording) -> None:
    """Look again where a file that was read after an adopted report had something wrong.

    Raises:
        DataError: the files are no longer what the report says of them.
    """
    if not recording.has_met_problems:
        return
    report_now = _damage_of(Recording(recording.path), reads_all=True)
    if report_now != damage_of(recording):
        raise DataError(
            f"{recording.path} was damaged or changed after its files had been verified: "
            f"{'; '.join(report_now.summary()) or 'nothing is missing now'}; give the same command "
            "again; where that does not help, leave the person out (visavis exclude)"
        )


def _damage_of(recording: Recording, *, reads_all: bool = False) -> DamageReport:
    problems: list[str] = [*_place_problems(recording)]
    streams: list[StreamDamage] = []
    trials: list[TrialDamage] = []
    lines_lost = 0
    for part in recording.manifest.parts:
        changed_files = recording.changed_files(part.number)
        if not reads_all and _is_as_written(recording, part, changed_files):
            continue
        part_problems = _problems(recording, part, changed_files)
        if not part_problems:
            continue
        problems += part_problems
        stream_damage = [
            damage
            for name, state in recording.stream_states(part.number).items()
            if (damage := _stream_damage(part, name, state, changed_files)) is not None
        ]
        streams += stream_damage
        journal = recording.journal(part.number)
        n_lost_lines = journal.damaged_lines
        if part.journal is not None:
            n_lost_lines = max(n_lost_lines, part.journal.lines - journal.n_lines)
        lines_lost += n_lost_lines
        is_foreign = JOURNAL_NAME in changed_files and not journal.problems
        trials += _struck_trials(recording, part, stream_damage, is_foreign=is_foreign)
        if n_lost_lines:
            trials += _lost_rows(recording, part)
    if lines_lost:
        trials += _without_trace(recording, trials)
    return DamageReport(
        session=recording.path,
        participant=recording.manifest.participant,
        number=recording.manifest.session,
        problems=tuple(problems),
        streams=tuple(streams),
        trials=tuple(trials),
        journal_lines_lost=lines_lost,
        notes=tuple(_notes(recording)),
    )


def analysed_trials(recording: Recording, needs: Collection[str] | None = None) -> pd.DataFrame:
    """Return the rows of `recording.trials()` as analysis may take them.

    A finished trial that lost rows of a stream in `needs` (any stream when None) has the status
    DAMAGED and is not to be measured; one whose row is gone has a row of what was planned, with
    the status LOST. `reason` says what is missing. Without damage nothing changes.
    """
    rows = recording.trials()
    damage = damage_of(recording)
    damage_of_row = {
        (t.part, t.trial_id, t.attempt): t
        for t in damage.trials
        if t.status == DAMAGED_STATUS
        and (needs is None or not t.streams or set(t.streams) & set(needs))
    }
    lost_trials = [t for t in damage.trials if t.status == LOST_STATUS]
    if not damage_of_row and not lost_trials:
        return rows
    records: list[dict[str, Any]] = []
    for row in rows.to_dict("records"):
        row_damage = damage_of_row.get((row[PART_COLUMN], str(row["trial_id"]), row.get("attempt")))
        if row_damage is not None and row.get("status", "complete") == "complete":
            row |= {"status": row_damage.status, "reason": row_damage.reason}
        records.append({str(k): v for k, v in row.items()})
    plan_of_trial = {t["trial_id"]: t for t in planned_trials(recording.manifest.plan)}
    records += [_planned_row(recording, t, plan_of_trial.get(t.trial_id)) for t in lost_trials]
    return pd.DataFrame(records)


def planned_trials(plan: Any) -> Iterator[Mapping[str, Any]]:
    """Yield the trials of a recorded plan in order; nothing when the plan has no blocks."""
    for block in plan.get("blocks", ()) if isinstance(plan, Mapping) else ():
        yield from block["trials"]


def _planned_row(
    recording: Recording, trial: TrialDamage, plan_row: Mapping[str, Any] | None
) -> dict[str, Any]:
    manifest = recording.manifest
    row: dict[str, Any] = {
        PART_COLUMN: trial.part,
        "participant": manifest.participant,
        "session": manifest.session,
        "trial_id": trial.trial_id,
        "attempt": trial.attempt,
        "status": trial.status,
        "reason": trial.reason,
        "flags": "",
    }
    if plan_row is not None:
        row |= {k: plan_row[k] for k in ("number", "block", "is_practice")}
        row |= {k: manifest.plan[k] for k in ("participant_index", "group")}
        row |= plan_row["factors"]
    return row


def _place_problems(recording: Recording) -> Iterator[str]:
    """Yield the problem when a session lies in another's folder, or a strange part in it."""
    manifest, path = recording.manifest, recording.path.resolve()
    own = f"sub-{manifest.participant}/ses-{manifest.session:03d}"
    here = f"{path.parent.name}/{path.name}"
    if re.fullmatch(r"sub-[^/]+/ses-[0-9]{3}", here) and here != own:
        yield f"{path / MANIFEST_NAME} is of {own}, not of {here}"
    folders = {part.folder for part in manifest.parts}
    for folder in sorted(path.glob("part-*")):
        if folder.name not in folders:
            yield f"{folder} does not belong to this recording: {MANIFEST_NAME} does not list it"


def _notes(recording: Recording) -> Iterator[str]:
    path = recording.path / MANIFEST_NAME
    if not recording.is_sealed:
        yield (
            "the manifest was written before manifests had checksums, so that changes to it "
            "cannot be seen"
        )
        return
    state = copy_state(path)
    if state != "same":
        state_texts = {
            "missing": "is missing",
            "damaged": "is damaged",
            "other": "says something else",
        }
        yield (
            f"{copy_path(path)} {state_texts[state]}; `visavis recover {recording.path}` renews it"
        )


def _is_as_written(recording: Recording, part: Part, changed_files: Collection[str]) -> bool:
    """Tell whether a part is closed, and its files are the bytes that were hashed as they left.

    Then nothing is to be found in them; reading them takes longer than hashing.
    """
    if part.status not in ("complete", "aborted") or part.journal is None or changed_files:
        return False
    files: tuple[JournalSummary | StreamSummary, ...] = (part.journal, *part.streams)
    if not all(file.closed_cleanly and file.sha256 for file in files):
        return False
    folder = recording.path / part.folder
    there = {path.name for path in folder.glob("*.arrows")} | {part.journal.file}
    return (
        recording.is_sealed
        and there == {f.file for f in files}
        and (folder / part.journal.file).exists()
    )


def _problems(recording: Recording, part: Part, changed_files: Collection[str]) -> list[str]:
    folder = recording.path / part.folder
    journal = recording.journal(part.number)
    states = recording.stream_states(part.number)
    tails = {journal.tail_problem, *(s.tail_problem for s in states.values())}
    if part.status in ("complete", "aborted"):
        tails = set()
    if part.status == "running":  # or killed before it was begun: nothing says what there was
        tails |= {f"{folder / name}.arrows is missing" for name in states}
        tails.add(f"{folder / JOURNAL_NAME} is missing")
    if part.status == "crashed" and part.journal is None and not any(s.rows for s in part.streams):
        tails.add(f"{folder / JOURNAL_NAME} is missing")  # as recovery met it: it ended before that
    if part.status == "crashed":
        tails -= set(_after_the_crash(part, journal, states))
    problems = [p for p in recording.part_problems(part.number) if p not in tails]
    if part.status != "running":
        declared_names = {*journal.headers, *(s.name for s in part.streams)}
        # Versions before 0.4 named a stream last: a disk that ran full between left a bare header.
        is_cut_short = part.journal is None or not part.journal.closed_cleanly
        problems += [
            f"{folder / name}.arrows is no file of this part"
            for name, state in states.items()
            if name not in declared_names
            and not state.is_unbegun
            and not (is_cut_short and not state.n_batches and not state.problems)
        ]
    return problems + [f"{folder / file}: {CHANGED}" for file in changed_files]


def _after_the_crash(
    part: Part, journal: JournalContent, states: Mapping[str, StreamContent]
) -> Iterator[str]:
    """Yield the torn ends of files that had more in them when their part was found crashed."""
    if part.journal is not None and part.journal.lines > journal.n_lines:
        yield journal.tail_problem
    for summary in part.streams:
        state = states.get(summary.name)
        if state is not None and summary.rows > state.n_rows:
            yield state.tail_problem


def _stream_damage(
    part: Part, name: str, state: StreamContent, changed_files: Collection[str]
) -> StreamDamage | None:
    summary = next((s for s in part.streams if s.name == name), None)
    n_written = None if summary is None else summary.rows
    is_changed = summary is not None and summary.file in changed_files
    if is_changed and not state.problems:
        return StreamDamage(part.number, name, n_written, None, (), is_untrusted=True)
    gaps = [g for g in state.gaps if g.n_rows is not None]
    n_lost = sum(g.n_rows or 0 for g in gaps)
    if n_written is None:
        if len(gaps) < len(state.gaps) and part.status in ("complete", "aborted"):
            gaps, lost_all = list(state.gaps), None
            return StreamDamage(part.number, name, None, lost_all, tuple(gaps))
    elif n_written > state.n_rows + n_lost:
        rest = n_written - state.n_rows - n_lost
        gaps.append(Gap(n_written - rest, rest, state.last_ns, None))
        n_lost += rest
    return StreamDamage(part.number, name, n_written, n_lost, tuple(gaps)) if gaps else None


def _struck_trials(
    recording: Recording, part: Part, stream_damage: Collection[StreamDamage], *, is_foreign: bool
) -> Iterator[TrialDamage]:
    for entry in recording.trial_entries(part.number):
        row = entry["row"]
        if row.get("status", "complete") != "complete":
            continue
        times = row.get("t_start_ns"), row.get("t_end_ns")
        names = tuple(d.stream for d in stream_damage if d.strikes(*times))
        if is_foreign:
            reason = f"{part.folder}/{JOURNAL_NAME} is not the file that was recorded"
        elif names:
            reason = f"recording damaged: samples of {', '.join(names)} cannot be read"
        else:
            continue
        yield TrialDamage(
            part.number, str(row["trial_id"]), row.get("attempt"), DAMAGED_STATUS, names, reason
        )


def _lost_rows(recording: Recording, part: Part) -> Iterator[TrialDamage]:
    """Yield the trials of a part that began and have no row, where lines are unreadable."""
    journal = recording.journal(part.number)
    rows = {(str(t["row"]["trial_id"]), t["row"].get("attempt")) for t in journal.trials}
    starts = [
        (str(e["payload"]["trial_id"]), e["payload"].get("attempt"))
        for e in journal.events
        if e["name"] == "trial_start"
    ]
    if part.status != "complete":
        starts = starts[:-1]  # which the end of the part interrupted
    for trial_id, attempt in starts:
        if (trial_id, attempt) not in rows:
            yield TrialDamage(
                part.number, trial_id, attempt, LOST_STATUS, (), _row_gone(part.folder)
            )


def _without_trace(
    recording: Recording, damaged_trials: Collection[TrialDamage]
) -> Iterator[TrialDamage]:
    """Yield planned trials of a finished session that have neither a row nor a start event."""
    parts = recording.manifest.parts
    if not parts or parts[-1].status != "complete":
        return
    there = {str(t["row"]["trial_id"]) for p in parts for t in recording.trial_entries(p.number)}
    there |= {t.trial_id for t in damaged_trials if t.status == LOST_STATUS}
    for trial in planned_trials(recording.manifest.plan):
        if trial["trial_id"] not in there:
            yield TrialDamage(
                None, trial["trial_id"], None, LOST_STATUS, (), _row_gone("the journal")
            )


def _row_gone(where: str) -> str:
    return f"recording damaged: the trial's row in {where} cannot be read"


def _rows(stream: StreamDamage) -> str:
    if stream.is_untrusted:
        return "the file is not the one that was recorded"
    if stream.rows_lost is None or stream.rows_written is None:
        return "rows at its end cannot be read"
    return f"{stream.rows_lost:,} of {stream.rows_written:,} rows cannot be read"


def _count_and_names(names: Collection[str], what: str, most: int = 12) -> str:
    unique = list(dict.fromkeys(names))
    more = f" and {len(unique) - most} more" if len(unique) > most else ""
    plural = "s" if len(unique) != 1 else ""
    return f"{len(unique)} {what}{plural} ({', '.join(unique[:most])}{more})"
