"""Perform one long session in real time and watch what the process holds meanwhile. Linux only.

python -m benchmarks.long_session [--hours 2] [--json] [--output DIR] [--series FILE.csv]

`visavis run crowd` performs a session on the machine's clock with every simulated device (headset,
eye tracker, body tracker, four bands, two of them on wires of their own) and ends by SIGTERM when
the time is up, as an operator ends it. From outside, memory (private pages that are resident),
threads, open handles and the recording's size are read from /proc every `PERIOD_S`. Whatever a
process needs only once lies in the first tenth, which is left out: growth is what the last tenth
holds above the second, medians of both. The recording must verify afterwards, and no sample may
have been dropped on its way to the disk.
"""

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from visavis.lab.clock import NS_PER_S, StopWatch, SystemClock
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE
from visavis.recording.reader import Recording

STUDY = "crowd"
SETTINGS = ("repetitions=40", "record_gaze=true")
"""Four hours of walks and more: time ends the session, not the plan."""

PERIOD_S = 5.0
ENDING_S = 1800.0
"""Closing hashes and checks hours of data, which a busy machine does slowly."""
MAX_GROWTH_01 = 0.05
REPOSITORY = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Held:
    """What a process held at an instant since its start."""

    t_s: float
    memory_mb: float
    threads: int
    handles: int
    recorded_mb: float


@dataclass(frozen=True)
class Outcome:
    """What was held after the first tenth and at the end, and what became of the recording."""

    hours: float
    readings: int
    memory_before_mb: float
    memory_after_mb: float
    memory_worst_mb: float
    threads_before: float
    threads_after: float
    handles_before: float
    handles_after: float
    recorded_mb: float
    cpu_share: float
    trials: int
    rows_dropped: int
    status: str
    problems: tuple[str, ...]

    @property
    def is_flat(self) -> bool:
        """Tell whether nothing grew and nothing is missing."""
        return (
            self.memory_after_mb <= self.memory_before_mb * (1 + MAX_GROWTH_01)
            and self.threads_after <= self.threads_before
            and self.handles_after <= self.handles_before
            and not self.problems
            and not self.rows_dropped
        )


def held_by(pid: int, t_s: float, root: Path) -> Held:
    """Read what a process holds.

    Raises:
        OSError: it has ended.
    """
    status = dict(
        line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text("ascii").splitlines()
    )
    return Held(
        t_s,
        int(status["RssAnon"].split()[0]) / 1024,
        int(status["Threads"]),
        len(os.listdir(f"/proc/{pid}/fd")),
        sum(p.stat().st_size for p in root.rglob("*") if p.is_file()) / 1e6,
    )


def watch(seconds: float, root: Path, series: Path) -> tuple[list[Held], float]:
    """Perform a session below `root` for so long; return the readings and the CPU seconds.

    Every reading is written to `series` at once, so that none is lost with this process.
    """
    (root / CONFIG_NAME).write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    clock = SystemClock()
    settings = [f"--set={setting}" for setting in SETTINGS]
    command = [
        sys.executable,
        "-m",
        "visavis.cli.main",
        "run",
        STUDY,
        "--participant",
        "1",
        *settings,
    ]
    readings: list[Held] = []
    with (
        (root / "terminal.txt").open("wb") as terminal,
        series.open("w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.DictWriter(file, [field.name for field in fields(Held)])
        rows.writeheader()
        running = subprocess.Popen(
            command,
            cwd=root,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
            stdin=subprocess.DEVNULL,
            stdout=terminal,
            stderr=subprocess.STDOUT,
        )
        elapsed = StopWatch()
        try:
            while (t_s := elapsed.elapsed_s()) < seconds and running.poll() is None:
                readings.append(held_by(running.pid, t_s, root))
                rows.writerow(asdict(readings[-1]))
                file.flush()
                clock.sleep_until_ns(clock.now_ns() + round(PERIOD_S * NS_PER_S))
            cpu_s = _cpu_s(running.pid)
        finally:
            running.send_signal(signal.SIGTERM)
            running.wait(ENDING_S)
    return readings, cpu_s


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def judge(readings: Sequence[Held], cpu_s: float, root: Path) -> Outcome:
    """Compare the second tenth with the last, and verify what was recorded."""
    tenth = len(readings) // 10
    if tenth < 1:
        raise SystemExit(f"only {len(readings)} readings; {root / 'terminal.txt'} says why")
    before, after = readings[tenth : 2 * tenth], readings[-tenth:]

    def middle(some: Sequence[Held], name: str) -> float:
        return float(np.median([getattr(held, name) for held in some]))

    session = next(root.glob("*/*/*/sub-*/ses-*"))
    recording = Recording(session)
    return Outcome(
        hours=readings[-1].t_s / 3600,
        readings=len(readings),
        memory_before_mb=middle(before, "memory_mb"),
        memory_after_mb=middle(after, "memory_mb"),
        memory_worst_mb=max(held.memory_mb for held in readings),
        threads_before=middle(before, "threads"),
        threads_after=middle(after, "threads"),
        handles_before=middle(before, "handles"),
        handles_after=middle(after, "handles"),
        recorded_mb=readings[-1].recorded_mb,
        cpu_share=cpu_s / readings[-1].t_s,
        trials=len(recording.trials()),
        rows_dropped=sum(s.dropped for part in recording.manifest.parts for s in part.streams),
        status=recording.status,
        problems=tuple(recording.verify().problems),
    )


def main() -> int:
    """Print what was held; exit status 1 where something grew or is missing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path, help="where to record; a temporary folder without")
    parser.add_argument("--series", type=Path, help="write every reading here")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.output) as scratch:
        series = options.series or Path(scratch) / "series.csv"
        readings, cpu_s = watch(options.hours * 3600, Path(scratch), series)
        found = judge(readings, cpu_s, Path(scratch))
    if options.json:
        print(json.dumps({**asdict(found), "is_flat": found.is_flat}))
    else:
        for name, value in asdict(found).items():
            print(f"{name:<20} {value:.3f}" if isinstance(value, float) else f"{name:<20} {value}")
        print(f"flat: {'yes' if found.is_flat else 'NO'}")
    return 0 if found.is_flat else 1


if __name__ == "__main__":
    sys.exit(main())
