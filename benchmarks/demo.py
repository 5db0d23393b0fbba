"""Measure what `visavis demo` takes: simulating a study, analysing it, and its report.

    python -m benchmarks.demo [--participants 16] [--processes 2] [--json]

The command runs as its users start it, in an empty folder; kernels that are not compiled yet are
compiled meanwhile, so the first run after installing takes longer. CPU seconds are those of all its
processes: half of them is the least that two cores can take. "Ratio" is limit / value.
"""

import argparse
import os
import subprocess
import sys
import tempfile

from benchmarks.table import Row, show
from visavis.lab.clock import StopWatch

LIMIT_S = 75.0
LIMIT_PARTICIPANTS = 16


def rows_of(participants: int, processes: int) -> list[Row]:
    """Run the command once."""
    asked = ["demo", "--participants", str(participants), "--processes", str(processes)]
    before, watch = os.times(), StopWatch()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "visavis", *asked],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            check=True,
        )
    wall_s, after = watch.elapsed_s(), os.times()
    cpu_s = (after.children_user - before.children_user) + (
        after.children_system - before.children_system
    )
    limit = LIMIT_S if participants == LIMIT_PARTICIPANTS else None
    return [
        Row("participants", participants, ""),
        Row("processes", processes, ""),
        Row("demo, wall", wall_s, "s", limit),
        Row("demo, CPU of all processes", cpu_s, "s"),
    ]


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.demo", description=__doc__)
    parser.add_argument("--participants", type=int, default=LIMIT_PARTICIPANTS)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    rows = rows_of(options.participants, options.processes)
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
