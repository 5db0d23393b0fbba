"""Kill sessions at random instants, resume them, and compare with one that was left alone.

python -m benchmarks.kill_resume --kills 1000 [--study stare] [--minutes 60] [--json] [--seed 1]
                                [--output DIR]

Kills are shared by the three studies, or are all `--study`'s; `--minutes` ends each study's share
of the time early. Every life of a session is a forked process that performs a short session of the
study on the virtual clock through `visavis.running.sessions.perform`; SIGKILL comes at an instant
drawn over what is expected to be left of the session, start-up and close included. After every kill
each trial that the process had acknowledged must be in the recording; a finished session must lack
no planned trial, and its trial table, measures included, must equal that of an uninterrupted
session. SIGKILL tests the death of a process, not the loss of power (`benchmarks.power_loss`).
"""

import argparse
import json
import math
import mmap
import os
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from visavis.analysis.session_check import check_session
from visavis.lab.clock import NS_PER_S, StopWatch, SystemClock
from visavis.lab.config import DeviceConfig, LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import SessionStatus, UnattendedOperator
from visavis.protocol.session.progress import FINAL_STATUSES
from visavis.protocol.session.states import SessionState
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.study.experiment import StudyExperiment


@dataclass(frozen=True)
class Short:
    """What makes a session of a study short: parameters, and how much of the plan is kept."""

    parameters: Mapping[str, Any]
    blocks_kept: int
    trials_kept: int


SHORT: Mapping[str, Short] = {
    "stare": Short(
        {"trial_s": 1.0, "practice_s": 1.0, "intertrial_s": 0.2, "repetitions": 1}, 3, 8
    ),
    "crowd": Short({"configuration": [1], "limit_s": 3.0, "intertrial_s": 0.2}, 3, 2),
    "waving": Short(
        {
            "clerk": ["clerk_left"],
            "increment": 0.1,
            "before_s": 0.2,
            "wave_s": 0.4,
            "after_s": 0.1,
            "intertrial_s": 0.1,
            "blocks": 1,
        },
        2,
        3,
    ),
}

TIMING = TargetTiming(100, 300, 500, 700)
RATES_HZ = {"headset": ("display_rate_hz", 30), "eye_tracker": ("rate_hz", 60)}
STATUS_PERIOD_NS = NS_PER_S // 10
MAX_LIVES = 8
"""A session is killed so often at most, then left to finish."""

INTERRUPTION_COLUMNS = {
    "recording_part": "the part of the recording that holds the row",
    "part": "the same, as the session counts it",
    "attempt": "a trial that was running when the process died is performed again",
    "t_start_ns": "session time goes on differently after a new start; others count from it",
    "clock_offset_ns": "host minus device time, anew with every start of the simulated device",
    "calibration_id": "counts the session's validations; resuming adds one",
    "calibration_age_s": "resuming calibrates anew, so the calibration is younger",
}
"""Columns that tell the interruption, each with the reason why it may differ."""

ROUNDING_NS = 2
"""Frames are not whole nanoseconds apart."""

LABEL, INDEX, SEED = "S01", 0, 1
STATES = tuple(SessionState)
BEGUN_01 = 0.75
"""Share of the lives whose time to live counts from when their session has begun."""
LOOK_NS = 2_000_000


@dataclass
class Outcome:
    """What the kills did; `unequal_cells` counts cells of the trial tables that differ."""

    kills: int = 0
    sessions: int = 0
    resumes: int = 0
    lost_trials: int = 0
    missing_trials: int = 0
    unequal_cells: int = 0
    cells_compared: int = 0
    failed_lives: int = 0
    wall_s: float = 0.0
    killed_in: dict[str, int] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)

    @property
    def is_clean(self) -> bool:
        """Tell whether nothing was lost and nothing differs."""
        return not (
            self.lost_trials or self.missing_trials or self.unequal_cells or self.failed_lives
        )


class ShortStudy(StudyExperiment):
    """A study with the first trials of its first blocks alone."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        kept = SHORT[self.study.name]
        whole = super().plan(participant_index, seed, group)
        blocks = tuple(replace(b, trials=b.trials[: kept.trials_kept]) for b in whole.blocks)
        return replace(whole, blocks=blocks[: kept.blocks_kept])


class _StateOperator(UnattendedOperator):
    """Keep the session's state where the parent can read it after the kill."""

    status_period_ns = STATUS_PERIOD_NS

    def __init__(self, shared: mmap.mmap) -> None:
        self._shared = shared

    def show(self, status: SessionStatus) -> None:
        self._shared[0] = STATES.index(status.state)


def kill_sessions(
    kills: int, *, seed: int, root: Path, study: str = "stare", limit_s: float = math.inf
) -> Outcome:
    """Perform, kill and resume sessions below `root` until so many kills were survived.

    Once `limit_s` has passed no further session is begun.
    """
    rng = np.random.default_rng(seed)
    watch = StopWatch()
    outcome = Outcome()
    short = _ShortSessions(find_study(study), fast_config())
    reference = short.uninterrupted(root / study / "reference")
    while outcome.kills < kills and watch.elapsed_s() < limit_s:
        outcome.sessions += 1
        folder = root / study / f"session-{outcome.sessions:04d}"
        session = _one_session(short, folder, rng, kills, outcome)
        _compare(short, session, reference, outcome)
        shutil.rmtree(folder)
    outcome.wall_s = watch.elapsed_s()
    return outcome


def fast_config() -> LabConfig:
    """Return the shipped lab at low rates."""
    config = load_config(EXAMPLE)
    devices = dict(config.devices)
    for role, (option, rate_hz) in RATES_HZ.items():
        device = devices[role]
        options = {**device.options, option: rate_hz}
        devices[role] = DeviceConfig(
            role=role, driver=device.driver, simulated=True, options=options
        )
    return config.model_copy(update={"devices": devices})


@dataclass
class _ShortSessions:
    """Short sessions of a study, and how their trials are measured.

    `life_s` is how long one lasts, by the latest that was left alone from its beginning; other
    programs on the machine change that.
    """

    study: OpenedStudy
    config: LabConfig
    life_s: float = 1.0

    def request(self, data_root: Path) -> Request:
        """Return what to perform."""
        request = simulated_request(
            self.study,
            ShortStudy(self.study.study, SHORT[self.study.name].parameters),
            self.config.model_copy(update={"data_root": data_root}),
            label=LABEL,
            index=INDEX,
            seed=SEED,
        )
        return replace(request, timing=TIMING)

    def uninterrupted(self, data_root: Path) -> pd.DataFrame:
        """Return the trial table to compare with; note how long a session lasts once warm."""
        path = perform_new(self.request(data_root / "cold"))
        watch = StopWatch()
        perform_new(self.request(data_root / "warm"))
        self.life_s = watch.elapsed_s()
        return self.trial_table(path)

    def trial_table(self, session: Path) -> pd.DataFrame:
        """Return the finished trials, measured; times count from the trial's start."""
        taken = self.study.measure(Recording(session))
        walks = getattr(taken, "walks", None)
        rows = taken.rows if walks is None else pd.DataFrame([w.row for w in walks])
        rows = rows[rows["status"].isin(FINAL_STATUSES)].set_index("trial_id").sort_index()
        times = [c for c in map(str, rows) if c.endswith("_ns") and c not in INTERRUPTION_COLUMNS]
        for column in times:
            rows[column] = rows[column] - rows["t_start_ns"]
        return rows


# ---- lives and deaths ------------------------------------------------------------------------


def _one_session(
    short: _ShortSessions,
    folder: Path,
    rng: np.random.Generator,
    kills: int,
    outcome: Outcome,
) -> Path:
    session = session_dir(folder, short.study.name, LABEL, 1, is_simulated=True)
    finished: set[str] = set()
    planned = 1
    for life in range(MAX_LIVES + 1):
        left_s = short.life_s * (1.05 - 0.9 * min(len(finished) / planned, 1.0))
        is_spared = life == MAX_LIVES or outcome.kills >= kills
        wait_s = None if is_spared else float(rng.uniform(0.0, left_s))
        outcome.resumes += session.exists() and life > 0
        # A process that starts on a busy computer would mostly be killed before its session begins.
        ended = _live(short, folder, session, wait_s, once_begun=rng.random() < BEGUN_01)
        finished |= ended.acknowledged
        planned = max(planned, ended.planned)
        if not ended.was_killed:
            if life == 0:
                short.life_s = ended.lasted_s
            if ended.exit_status != 0:
                outcome.failed_lives += 1
                outcome.problems.append(f"{session}: {ended.complaint}")
            if ended.exit_status == 0 or is_spared:
                break
            continue
        outcome.kills += 1
        where = "before the first frame" if ended.state is None else ended.state.value
        if ended.state is SessionState.VALIDATING and len(finished) == planned:
            where = "after the last trial"  # last validation, questions, closing
        outcome.killed_in[where] = outcome.killed_in.get(where, 0) + 1
        _check_kept(session, finished, outcome)
    return session


@dataclass(frozen=True)
class _End:
    was_killed: bool
    lasted_s: float
    exit_status: int
    acknowledged: frozenset[str]
    planned: int
    state: SessionState | None
    complaint: str


def _live(
    short: _ShortSessions, folder: Path, session: Path, wait_s: float | None, *, once_begun: bool
) -> _End:
    """Fork a process that performs what is left; kill it after `wait_s`, None for never.

    `once_begun` counts from when its session is there.
    """
    clock = SystemClock()
    shared = mmap.mmap(-1, 1)
    shared[0] = len(STATES)
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        _child(short, folder, session, writing, shared)
    os.close(writing)
    begun_ns = clock.now_ns()
    if wait_s is not None:
        while once_begun and not session.exists() and not _has_ended(pid):
            clock.sleep_until_ns(clock.now_ns() + LOOK_NS)
        end_ns = (clock.now_ns() if once_begun else begun_ns) + round(wait_s * NS_PER_S)
        while (now_ns := clock.now_ns()) < end_ns and not _has_ended(pid):
            clock.sleep_until_ns(min(end_ns, now_ns + LOOK_NS))
        os.kill(pid, signal.SIGKILL)
    with os.fdopen(reading, encoding="utf-8") as pipe:
        *lines, tail = pipe.read().split("\n")
    _, status = os.waitpid(pid, 0)
    lasted_s = (clock.now_ns() - begun_ns) / NS_PER_S
    code = shared[0]
    shared.close()
    trials = [line.split() for line in lines if not line.startswith("!")]
    return _End(
        was_killed=os.WIFSIGNALED(status),
        lasted_s=lasted_s,
        exit_status=os.waitstatus_to_exitcode(status),
        acknowledged=frozenset(t[0] for t in trials),
        planned=max((int(t[1]) for t in trials), default=1),
        state=STATES[code] if code < len(STATES) else None,
        complaint=" ".join([*(line for line in lines if line.startswith("!")), tail]).strip(),
    )


def _has_ended(pid: int) -> bool:
    return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def _child(
    short: _ShortSessions, folder: Path, session: Path, writing: int, shared: mmap.mmap
) -> None:
    """Perform until killed; never returns."""
    status = 1
    try:
        request = replace(
            short.request(folder),
            operator=_StateOperator(shared),
            respondent=None,
            on_trial=lambda trial_id, _, planned: _tell(writing, f"{trial_id} {planned}"),
        )
        if session.exists():
            perform_rest(request, session)
        else:
            perform_new(request)
        status = 0
    except BaseException:  # a process top: the parent prints it
        _tell(writing, "! " + traceback.format_exc().replace("\n", " | "))
    finally:
        os._exit(status)


def _tell(pipe: int, line: str) -> None:
    os.write(pipe, f"{line}\n".encode())


def _check_kept(session: Path, finished: set[str], outcome: Outcome) -> None:
    if not session.exists():
        kept: set[str] = set()
    else:
        trials = Recording(session).trials()
        kept = set(trials["trial_id"]) if len(trials) else set()
    lost = finished - kept
    if lost:
        outcome.lost_trials += len(lost)
        outcome.problems.append(f"{session}: lost {', '.join(sorted(lost))}")


# ---- comparison ------------------------------------------------------------------------------


def _compare(
    short: _ShortSessions, session: Path, reference: pd.DataFrame, outcome: Outcome
) -> None:
    recording = Recording(session)
    missing = [t for t in check_session(recording).trials if t.status not in FINAL_STATUSES]
    if missing or recording.status != "complete":
        outcome.missing_trials += max(len(missing), 1)
        outcome.problems.append(f"{session}: {recording.status}, {len(missing)} trials missing")
        return
    differing, compared = unequal_cells(short.trial_table(session), reference)
    outcome.cells_compared += compared
    outcome.unequal_cells += len(differing)
    outcome.problems += [f"{session}: {text}" for text in differing[:20]]


def unequal_cells(table: pd.DataFrame, reference: pd.DataFrame) -> tuple[list[str], int]:
    """Return every cell that differs, and how many were compared; all columns but those above."""
    if list(table.index) != list(reference.index):
        return [f"trials {list(table.index)} for {list(reference.index)}"], 0
    columns = [c for c in reference.columns if c not in INTERRUPTION_COLUMNS]
    differing = [f"{c} is missing" for c in columns if c not in table.columns]
    for column in (c for c in columns if c in table.columns):
        found, expected = table[column], reference[column]
        is_time = column.endswith("_ns") and pd.api.types.is_numeric_dtype(expected)
        same = (found - expected).abs() <= ROUNDING_NS if is_time else found == expected
        unequal = ~(same | (found.isna() & expected.isna()))
        differing += [
            f"{trial_id} {column}: {found[trial_id]!r} for {expected[trial_id]!r}"
            for trial_id in reference.index[unequal]
        ]
    return differing, len(columns) * len(reference)


# ---- command ---------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the outcome; exit status 1 when anything was lost or differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--study", choices=list(SHORT), help="one study; all without")
    parser.add_argument("--minutes", type=float, default=math.inf, help="limit, of all studies")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path, help="where to record; a temporary folder without")
    options = parser.parse_args(arguments)
    studies = [options.study] if options.study else list(SHORT)
    shares = [
        options.kills * (i + 1) // len(studies) - options.kills * i // len(studies)
        for i in range(len(studies))
    ]
    limit_s = options.minutes * 60 / len(studies)
    with tempfile.TemporaryDirectory(dir=options.output) as root:
        found = {
            study: kill_sessions(
                share, seed=options.seed, root=Path(root), study=study, limit_s=limit_s
            )
            for study, share in zip(studies, shares, strict=True)
        }
    is_clean = all(outcome.is_clean for outcome in found.values())
    if options.json:
        said = {study: asdict(outcome) for study, outcome in found.items()}
        sys.stdout.write(json.dumps({**said, "is_clean": is_clean}) + "\n")
        return 0 if is_clean else 1
    for study, outcome in found.items():
        _print(study, outcome)
    sys.stdout.write(f"{sum(o.kills for o in found.values())} kills in all\n")
    return 0 if is_clean else 1


def _print(study: str, outcome: Outcome) -> None:
    where = ", ".join(f"{name} {n}" for name, n in sorted(outcome.killed_in.items()))
    rows = [
        (f"{study}: kills", outcome.kills, f"({where})"),
        ("sessions", outcome.sessions, f"in {outcome.wall_s:.0f} s"),
        ("resumes", outcome.resumes, ""),
        ("acknowledged trials lost", outcome.lost_trials, "limit 0"),
        ("planned trials missing at the end", outcome.missing_trials, "limit 0"),
        ("lives ended by an error", outcome.failed_lives, "limit 0"),
        ("unequal cells", outcome.unequal_cells, f"of {outcome.cells_compared}, limit 0"),
    ]
    for name, value, note in rows:
        sys.stdout.write(f"{name:36} {value:8} {note}\n")
    sys.stdout.writelines(f"  {problem}\n" for problem in outcome.problems[:40])


if __name__ == "__main__":
    sys.exit(main())
