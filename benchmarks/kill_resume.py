"""Kill sessions at random instants, resume them, and compare with one that was left alone.

python -m benchmarks.kill_resume --kills 200 [--json] [--seed 1] [--output DIR]

Every life of a session is a forked process that performs a short stare session on the virtual
clock through `visavis.sessions.perform`; SIGKILL comes at an instant drawn over what is expected to
be left of the session, start-up and close included. After every kill each trial that the process
had acknowledged must be in the recording; a finished session must lack no planned trial, and its
trial table, measures included, must equal that of an uninterrupted session. SIGKILL tests the
death of a process, not the loss of power.
"""

import argparse
import json
import mmap
import os
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.session_check import check_session
from experiments.stare.study import study
from lab.clock import NS_PER_S, StopWatch, SystemClock
from lab.config import DeviceConfig, LabConfig, load_config
from lab.config_files import EXAMPLE
from protocol.gaze_setup import TargetTiming
from protocol.operator import SessionStatus, UnattendedOperator
from protocol.plan import SessionPlan
from protocol.progress import DONE
from protocol.states import SessionState
from recording.folder import session_dir
from recording.reader import Recording
from visavis.catalogue import find_study
from visavis.experiment import StudyExperiment
from visavis.sessions.perform import Request, perform_new, perform_rest, simulated_request

BLOCKS_KEPT = 3
TRIALS_KEPT = 8
"""Training and the first two blocks, eight trials of each, so that lives are short."""

TIMING = TargetTiming(100, 300, 500, 700)
RATES_HZ = {"headset": ("display_rate_hz", 30), "eye_tracker": ("rate_hz", 60)}
STATUS_PERIOD_NS = NS_PER_S // 10
LIVES_AT_MOST = 8
"""A session is killed so often at most, then left to finish."""

INTERRUPTION_COLUMNS = {
    "recording_part": "the part of the recording that holds the row",
    "part": "the same, as the session counts it",
    "attempt": "a trial that was running when the process died is performed again",
    "t_start_ns": "session time goes on differently after a new start",
    "t_end_ns": "as t_start_ns; the duration is compared",
    "switch_ns": "as t_start_ns; switch_ms is compared",
    "look_ns": "as t_start_ns; its distance from t_start_ns is compared",
    "clock_offset_ns": "host minus device time, anew with every start of the simulated device",
    "calibration_id": "counts the session's validations; resuming adds one",
    "calibration_age_s": "resuming calibrates anew, so the calibration is younger",
}
"""Columns that tell the interruption, each with the reason why it may differ."""

LABEL, INDEX, SEED = "S01", 0, 1
STATES = tuple(SessionState)


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


class ShortStare(StudyExperiment):
    """The stare study with the first trials of its first blocks alone."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        whole = super().plan(participant_index, seed, group)
        blocks = tuple(replace(b, trials=b.trials[:TRIALS_KEPT]) for b in whole.blocks)
        return replace(whole, blocks=blocks[:BLOCKS_KEPT])


class _StateOperator(UnattendedOperator):
    """Keep the session's state where the parent can read it after the kill."""

    status_period_ns = STATUS_PERIOD_NS

    def __init__(self, shared: mmap.mmap) -> None:
        self._shared = shared

    def show(self, status: SessionStatus) -> None:
        self._shared[0] = STATES.index(status.state)


def kill_sessions(kills: int, *, seed: int, root: Path) -> Outcome:
    """Perform, kill and resume sessions below `root` until so many kills were survived."""
    rng = np.random.default_rng(seed)
    watch = StopWatch()
    outcome = Outcome()
    config = _fast_config()
    reference, life_s = _uninterrupted(config, root / "reference")
    while outcome.kills < kills:
        outcome.sessions += 1
        folder = root / f"session-{outcome.sessions:04d}"
        session = _one_session(config, folder, rng, life_s, kills, outcome)
        _compare(session, reference, outcome)
        shutil.rmtree(folder)
    outcome.wall_s = watch.elapsed_s()
    return outcome


def _fast_config() -> LabConfig:
    config = load_config(EXAMPLE)
    devices = dict(config.devices)
    for role, (option, rate_hz) in RATES_HZ.items():
        device = devices[role]
        options = {**device.options, option: rate_hz}
        devices[role] = DeviceConfig(
            role=role, driver=device.driver, simulated=True, options=options
        )
    return config.model_copy(update={"devices": devices})


def _request(config: LabConfig, data_root: Path) -> Request:
    request = simulated_request(
        find_study("stare"),
        ShortStare(
            study, {"trial_s": 1.0, "practice_s": 1.0, "intertrial_s": 0.2, "repetitions": 1}
        ),
        config.model_copy(update={"data_root": data_root}),
        label=LABEL,
        index=INDEX,
        seed=SEED,
    )
    return replace(request, timing=TIMING)


def _uninterrupted(config: LabConfig, data_root: Path) -> tuple[pd.DataFrame, float]:
    """Return the trial table to compare with, and how long a session lasts once warm."""
    path = perform_new(_request(config, data_root / "cold"))
    watch = StopWatch()
    perform_new(_request(config, data_root / "warm"))
    return _trial_table(path), watch.elapsed_s()


def _trial_table(session: Path) -> pd.DataFrame:
    rows: pd.DataFrame = find_study("stare").measure(Recording(session)).rows
    rows = rows[rows["status"].isin(DONE)].set_index("trial_id").sort_index()
    rows["duration_ns"] = rows["t_end_ns"] - rows["t_start_ns"]
    rows["look_after_ns"] = rows["look_ns"] - rows["t_start_ns"]
    return rows


# ---- lives and deaths ------------------------------------------------------------------------


def _one_session(
    config: LabConfig,
    folder: Path,
    rng: np.random.Generator,
    life_s: float,
    kills: int,
    outcome: Outcome,
) -> Path:
    session = session_dir(folder, "stare", LABEL, 1, is_simulated=True)
    finished: set[str] = set()
    planned = 1
    for life in range(LIVES_AT_MOST + 1):
        left_s = life_s * (1.05 - 0.9 * min(len(finished) / planned, 1.0))
        is_spared = life == LIVES_AT_MOST or outcome.kills >= kills
        wait_s = None if is_spared else float(rng.uniform(0.0, left_s))
        outcome.resumes += session.exists() and life > 0
        ended = _live(config, folder, session, wait_s)
        finished |= ended.acknowledged
        planned = max(planned, ended.planned)
        if not ended.was_killed:
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
    exit_status: int
    acknowledged: frozenset[str]
    planned: int
    state: SessionState | None
    complaint: str


def _live(config: LabConfig, folder: Path, session: Path, wait_s: float | None) -> _End:
    """Fork a process that performs what is left; kill it after `wait_s`, None for never."""
    clock = SystemClock()
    shared = mmap.mmap(-1, 1)
    shared[0] = len(STATES)
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        _child(config, folder, session, writing, shared)
    os.close(writing)
    if wait_s is not None:
        clock.sleep_until_ns(clock.now_ns() + round(wait_s * NS_PER_S))
        os.kill(pid, signal.SIGKILL)
    with os.fdopen(reading, encoding="utf-8") as pipe:
        *lines, tail = pipe.read().split("\n")
    _, status = os.waitpid(pid, 0)
    code = shared[0]
    shared.close()
    trials = [line.split() for line in lines if not line.startswith("!")]
    return _End(
        was_killed=os.WIFSIGNALED(status),
        exit_status=os.waitstatus_to_exitcode(status),
        acknowledged=frozenset(t[0] for t in trials),
        planned=max((int(t[1]) for t in trials), default=1),
        state=STATES[code] if code < len(STATES) else None,
        complaint=" ".join([*(line for line in lines if line.startswith("!")), tail]).strip(),
    )


def _child(config: LabConfig, folder: Path, session: Path, writing: int, shared: mmap.mmap) -> None:
    """Perform until killed; never returns."""
    status = 1
    try:
        request = replace(
            _request(config, folder),
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


def _compare(session: Path, reference: pd.DataFrame, outcome: Outcome) -> None:
    recording = Recording(session)
    missing = [t for t in check_session(recording).trials if t.status not in DONE]
    if missing or recording.status != "complete":
        outcome.missing_trials += max(len(missing), 1)
        outcome.problems.append(f"{session}: {recording.status}, {len(missing)} trials missing")
        return
    differing, compared = unequal_cells(_trial_table(session), reference)
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
        unequal = ~((found == expected) | (found.isna() & expected.isna()))
        differing += [
            f"{trial_id} {column}: {found[trial_id]!r} for {expected[trial_id]!r}"
            for trial_id in reference.index[unequal]
        ]
    return differing, len(columns) * len(reference)


# ---- command ---------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the outcome; exit status 1 when anything was lost or differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path, help="where to record; a temporary folder without")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(dir=options.output) as root:
        outcome = kill_sessions(options.kills, seed=options.seed, root=Path(root))
    if options.json:
        sys.stdout.write(json.dumps({**asdict(outcome), "is_clean": outcome.is_clean}) + "\n")
        return 0 if outcome.is_clean else 1
    where = ", ".join(f"{name} {n}" for name, n in sorted(outcome.killed_in.items()))
    rows = [
        ("kills", outcome.kills, f"({where})"),
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
    return 0 if outcome.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
