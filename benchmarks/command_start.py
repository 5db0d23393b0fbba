"""Measure how long `visavis` takes to answer before any work: help, version, shell completion.

    python -m benchmarks.command_start [--repeats 15] [--json]

Every run is a process of its own, as a shell starts it, interpreter included. The quickest run
is shown, since others measure what else the computer was doing, and the median CPU time of all.
"Ratio" is limit / value: 1 or more is within the limit, which holds for the quickest run.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
from dataclasses import asdict, dataclass
from typing import Any

from visavis.lab.clock import StopWatch

LIMIT_S = 0.25
PROGRAM = "import sys; sys.argv[0] = 'visavis'; from visavis.cli.main import main; main()"
COMPLETE = {"_VISAVIS_COMPLETE": "complete_bash"}
ANSWERS: dict[str, tuple[list[str], dict[str, str]]] = {
    "visavis --help": (["--help"], {}),
    "visavis --version": (["--version"], {}),
    "visavis re<TAB>": ([], {**COMPLETE, "COMP_WORDS": "visavis re", "COMP_CWORD": "1"}),
}
"""By what is typed: arguments, and what the shell puts into the environment."""


@dataclass(frozen=True)
class Row:
    """One printed figure: seconds of the quickest run, and CPU seconds of the median one."""

    name: str
    value: float
    cpu_s: float
    limit: float
    ratio: float


def measure(name: str, repeats: int) -> Row:
    """Start the command so many times, once more beforehand to fill the file cache."""
    arguments, more = ANSWERS[name]
    walls, cpus = [], []
    for _ in range(repeats + 1):
        before, watch = children_cpu_s(), StopWatch()
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, *arguments],
            env={**os.environ, **more},
            capture_output=True,
            text=True,
            check=True,
        )
        walls.append(watch.elapsed_s())
        cpus.append(children_cpu_s() - before)
        assert done.stdout, f"{name} answered nothing"
    quickest = min(walls[1:])
    return Row(name, quickest, statistics.median(cpus[1:]), LIMIT_S, LIMIT_S / quickest)


def children_cpu_s() -> float:
    """Return the CPU seconds that ended children have used so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(arguments: list[str]) -> int:
    """Print every row; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(prog="benchmarks.command_start", description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options: Any = parser.parse_args(arguments)
    rows = [measure(name, options.repeats) for name in ANSWERS]
    if options.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
    else:
        for row in rows:
            print(
                f"{row.name:<20} {row.value:6.3f} s   (CPU {row.cpu_s:.3f} s)   "
                f"limit {row.limit} s   ratio {row.ratio:.2f}"
            )
    return 1 if any(row.ratio < 1 for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
