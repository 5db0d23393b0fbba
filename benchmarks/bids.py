"""Measure what the BIDS export of a whole session costs, as the command does it.

    python -m benchmarks.bids [--study stare] [--rounds 3] [--json]

One person of the study is simulated as `visavis simulate` does, once, beforehand; then
`visavis export SESSION --format bids` runs in a process of its own, start and imports included.
CPU seconds of all its threads and children, the median of the rounds, as the computer may be busy;
seconds by the clock stand beside them. "Ratio" is limit / value.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.command_start import children_cpu_s
from benchmarks.table import Row, show
from visavis.lab.clock import StopWatch
from visavis.lab.config_files import EXAMPLE

LIMIT_S = 4.0
REPOSITORY = Path(__file__).resolve().parents[1]


def visavis(root: Path, *arguments: str) -> tuple[float, float]:
    """Run a command in a lab's folder; return its CPU seconds and those by the clock."""
    before, watch = children_cpu_s(), StopWatch()
    done = subprocess.run(
        [sys.executable, "-m", "visavis", *arguments],
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"visavis {' '.join(arguments)} failed:\n{done.stdout}{done.stderr}")
    return children_cpu_s() - before, watch.elapsed_s()


def exports(root: Path, study: str, rounds: int) -> list[Row]:
    """Return the figures of exports of one simulated session."""
    shutil.copy(EXAMPLE, root / "lab_config.yaml")
    visavis(root, "simulate", study, "--participants", "1", "--processes", "1", "--output", "data")
    (session,) = (root / "data").glob(f"simulated/{study}/sub-*/ses-*")
    spent = []
    for turn in range(rounds):
        given = ("--format", "bids", "--output", f"bids{turn}")
        spent.append(visavis(root, "export", str(session), *given))
    written = [path for path in (root / "bids0").rglob("*") if path.is_file()]
    cpu_s, wall_s = (statistics.median(column) for column in zip(*spent, strict=True))
    return [
        Row("files written", len(written), ""),
        Row("their size", sum(path.stat().st_size for path in written) / 1e6, "MB"),
        Row("BIDS export of a session, processor", cpu_s, "s", LIMIT_S),
        Row("the same, by the clock", wall_s, "s"),
    ]


def main(arguments: list[str]) -> int:
    """Print every row; return 1 when the limit is missed."""
    parser = argparse.ArgumentParser(prog="benchmarks.bids", description=__doc__)
    parser.add_argument("--study", default="stare")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        rows = exports(Path(scratch), options.study, options.rounds)
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
