"""Count the lines of the studies, the kit, the command line and the drivers' wiring.

    python -m benchmarks.source_lines [--json]

A study should be short because the kit does the rest, so its length is a figure like any other.
Tests are not counted. "Ratio" is limit / value: 1 or more is within the limit.
"""

import argparse
import sys
from pathlib import Path
from typing import Final

from benchmarks.table import Row, show

ROOT: Final = Path(__file__).resolve().parent.parent
WIRING: Final = ("building", "options", "registry", "spec", "wires", "wiring")
"""Modules of `devices` that only say which driver is which."""
LIMITS: Final = {
    "studies and kit": 12_500,
    "waving": 1_400,
    "command line and driver wiring": 5_500,
    "duel, a study of one file": 150,
}
KIT_PARTS: Final = {
    "page of a screen, its server and bundles": ("page",),
    "sessions, simulated ones too": ("sessions",),
    "simulated observer": ("observer",),
    "plan locks": ("locked",),
}
COMMAND_PARTS: Final = ("viewer", "desk", "doctor", "film", "preview")


def lines_of(*places: Path) -> int:
    """Return the lines of Python below some folders, or of files."""
    files = [f for p in places for f in ([p] if p.is_file() else p.rglob("*.py"))]
    return sum(len(f.read_text("utf-8").splitlines()) for f in files)


def rows() -> list[Row]:
    """Count everything."""
    studies, kit, commands = ROOT / "experiments", ROOT / "visavis", ROOT / "cli"
    wiring = [p for n in WIRING if (p := ROOT / "devices" / f"{n}.py").exists()]
    counted = {"studies and kit": lines_of(studies, kit)}
    counted |= {p.name: lines_of(p) for p in sorted(studies.iterdir()) if p.is_dir()}
    counted |= {"kit": lines_of(kit)}
    counted |= {f"  {of}": lines_of(*(kit / n for n in at)) for of, at in KIT_PARTS.items()}
    counted |= {"command line and driver wiring": lines_of(commands, *wiring)}
    counted |= {f"  {name}": lines_of(commands / name) for name in COMMAND_PARTS}
    counted |= {"duel, a study of one file": lines_of(ROOT / "tests/visavis/studies/duel.py")}
    return [Row(name, value, "lines", LIMITS.get(name)) for name, value in counted.items()]


def main() -> int:
    """Print the figures; return 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    return show(rows(), as_json=parser.parse_args().json)


if __name__ == "__main__":
    sys.exit(main())
