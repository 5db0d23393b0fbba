"""Measure how long it takes to simulate and analyse a study of stare in the crowd.

    python -m benchmarks.study_speed --participants 4 [--processes 2] [--json]

Every participant performs the whole design on the virtual clock through session engine, drivers
and recorder; then every session is measured and all are analysed together, report included. The
extrapolation is what 30 participants take on two cores by the CPU time of sessions and measuring
(median of those seen) and of the analysis; wall time depends on what else runs. The start of
the processes is counted as wall time only. "Ratio" is limit / value. The three modules in which
sessions, measuring and analysis together spend most are named.
"""

import argparse
import resource
import signal
import statistics
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Generic, TypeVar

from benchmarks.table import Row, show
from visavis.cli.app import load_lab
from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.lab.config_files import EXAMPLE
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.runners import on_this_machine
from visavis.running.sessions.simulation import (
    MeasuringTask,
    SimulationTask,
    measure_one,
    simulate_one,
)

STUDY = "stare"
SEED = 1
STUDY_PARTICIPANTS = 30
STUDY_CORES = 2
STUDY_LIMIT_S = 120.0
MEMORY_LIMIT_MB = 1000.0
SAMPLE_EVERY_S = 0.005
"""A sample takes some 20 us."""
SLOWEST = 3


Work = TypeVar("Work")
Done = TypeVar("Done")


@dataclass(frozen=True)
class Job(Generic[Done]):
    """What a piece of work returned, its CPU seconds, its process' peak memory, and how often each
    module was at work.
    """

    result: Done
    cpu_s: float
    peak_mb: float
    parts: Counter[str]


@contextmanager
def sampled() -> Iterator[Counter[str]]:
    """Count which module is at work, every few milliseconds of processor time in this block."""
    parts: Counter[str] = Counter()

    def look(_: int, frame: FrameType | None) -> None:
        # the innermost of ours: libraries count for what called them; methods that Python makes
        # of a dataclass's fields may have no module
        while frame is not None and not frame.f_globals.get("__name__", "").startswith("visavis."):
            frame = frame.f_back
        parts[frame.f_globals["__name__"] if frame is not None else "other"] += 1

    former = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, SAMPLE_EVERY_S, SAMPLE_EVERY_S)
    try:
        yield parts
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, former)


def slowest(parts: Counter[str], cpu_s: float) -> list[Row]:
    """Return the modules that take most, with their share of the processor time."""
    total = max(parts.total(), 1)
    return [
        Row(f"{module}, CPU", cpu_s * count / total, "s")
        for module, count in parts.most_common(SLOWEST)
    ]


def timed_session(task: SimulationTask) -> Job[Path]:
    """Simulate one session in this process."""
    before_s = cpu_time_s()
    with sampled() as parts:
        path = simulate_one(task)
    return Job(path, cpu_time_s() - before_s, peak_mb(), parts)


def timed_measure(session: Path) -> Job[Any]:
    """Measure one session in this process."""
    before_s = cpu_time_s()
    with sampled() as parts:
        measured = measure_one(MeasuringTask(STUDY, session))
    return Job(measured, cpu_time_s() - before_s, peak_mb(), parts)


def peak_mb() -> float:
    """Return the largest resident size this process has had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def in_order(
    work: Callable[[Work], Job[Done]], jobs: list[Work], processes: int
) -> list[Job[Done]]:
    """Do jobs in parallel; return what they gave in the order of the jobs."""
    done = dict(on_this_machine(work, jobs, processes))
    return [done[i] for i in range(len(jobs))]


def rows_of(participants: int, processes: int, root: Path) -> list[Row]:
    """Simulate and analyse; return every figure."""
    lab = load_lab(EXAMPLE, "sim", quiet=True).model_copy(update={"data_root": root / "data"})
    tasks = [
        SimulationTask(STUDY, lab, f"S{i + 1:02d}A", i, "", SEED, True, {})
        for i in range(participants)
    ]
    watch = StopWatch()
    sessions = in_order(timed_session, tasks, processes)
    simulated_s = watch.elapsed_s()
    paths = [job.result for job in sessions]
    watch = StopWatch()
    measured = in_order(timed_measure, paths, processes)
    measured_s = watch.elapsed_s()
    out_dir = root / "derived"
    out_dir.mkdir()
    watch, before_s = StopWatch(), cpu_time_s()
    with sampled() as parts:
        find_study(STUDY).analyse(
            [job.result for job in measured],
            out_dir,
            is_simulated=True,
            commands=(),
            example=Recording(paths[0]),
        )
    analysed_s, analysis_cpu_s = watch.elapsed_s(), cpu_time_s() - before_s
    frames = sum(
        stream.rows
        for path in paths
        for part in read_manifest(path).parts
        for stream in part.streams
        if stream.name == "frames"
    )
    session_cpu_s = statistics.median(job.cpu_s for job in sessions)
    measure_cpu_s = statistics.median(job.cpu_s for job in measured)
    study_s = STUDY_PARTICIPANTS * (session_cpu_s + measure_cpu_s) / STUDY_CORES + analysis_cpu_s
    jobs: list[Job[Any]] = [*sessions, *measured]
    parts = sum((job.parts for job in jobs), parts)
    all_cpu_s = sum(job.cpu_s for job in jobs) + analysis_cpu_s
    peak = max(peak_mb(), *(job.peak_mb for job in jobs))
    return [
        Row("participants", participants, ""),
        Row("processes", processes, ""),
        Row("simulating, wall", simulated_s, "s"),
        Row("measuring, wall", measured_s, "s"),
        Row("analysis and report, wall", analysed_s, "s"),
        Row("session, CPU, median", session_cpu_s, "s"),
        Row("session, CPU per frame", sum(j.cpu_s for j in sessions) / frames * 1e6, "us"),
        Row("measuring a session, CPU, median", measure_cpu_s, "s"),
        Row("analysis and report, CPU", analysis_cpu_s, "s"),
        Row("peak memory of a process", peak, "MB", MEMORY_LIMIT_MB),
        *slowest(parts, all_cpu_s),
        Row("30 participants on two cores", study_s, "s", STUDY_LIMIT_S),
    ]


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.study_speed", description=__doc__)
    parser.add_argument("--participants", type=int, default=4)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        rows = rows_of(options.participants, options.processes, Path(scratch))
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
