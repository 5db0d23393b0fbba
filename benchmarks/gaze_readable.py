"""Measure how well direct gaze is told from gaze averted by 10°, from the pixels of a headset.

    python -m benchmarks.gaze_readable [--distances 3.5 5] [--folder FIGURES] [--json]

For everybody of the cast (or every figure of a folder of imported ones), at 12 pixels a degree, as
`visavis.cli.preview.readable_gaze` has it. Limit: 90 % right at 3.5 m for every person; chance is
50 %.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from visavis.cli.preview.readable_gaze import LIMIT_01, readable_at
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.storage import read_character

PX_PER_DEG: Final = 12.0


def main(argv: Sequence[str]) -> int:
    """Print a row per person and distance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--distances", type=float, nargs="+", default=[3.5, 5.0])
    parser.add_argument("--folder", type=Path, help="imported figures (.npz) in place of the cast")
    parser.add_argument("--names", nargs="+", help="only these people")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(argv)
    people = (
        [read_character(p) for p in sorted(given.folder.glob("*.npz"))]
        if given.folder
        else load_cast()
    )
    people = [p for p in people if not given.names or p.name in given.names]
    rows = []
    for character, distance_m, share in readable_at(people, given.distances, PX_PER_DEG):
        rows.append(
            {"person": character.name, "distance_m": distance_m, "right_01": round(share, 3)}
        )
        if not given.json:
            judged = "" if distance_m > 3.5 else "kept" if share >= LIMIT_01 else "MISSED"
            print(f"{character.name:<28} {distance_m:4.1f} m  {share:6.1%}  {judged}", flush=True)
    if given.json:
        print(json.dumps(rows, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
