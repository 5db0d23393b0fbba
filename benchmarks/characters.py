"""Measure the default cast: size, loading, and how honest its copies for measuring are.

    python -m benchmarks.characters [--json]

Loading: all files from disk into arrays, CPU time of the best of three, limit 0.5 s. Bias:
the largest deviation, over persons and tagged parts, of the area seen on a copy for measuring from
that of the full mesh, limit 5 %. "ratio" is limit / value.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.table import Row, show
from visavis.lab.clock import cpu_time_s
from visavis.stimuli.characters.body_parts import PARTS
from visavis.stimuli.characters.cast import DATA, cast_names, load_cast
from visavis.stimuli.characters.coverage import seen_areas_m2
from visavis.stimuli.characters.measuring import MEASURING_TRIANGLES
from visavis.stimuli.characters.storage import read_character

LOAD_LIMIT_S, SIZE_LIMIT_MB, BIAS_LIMIT_PERCENT = 0.5, 15.0, 5.0
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


def main(argv: Sequence[str] | None = None) -> int:
    """Print all figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.characters")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    options = parser.parse_args(argv)
    return show([size(), loading(), *biases()], as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
