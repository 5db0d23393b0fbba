"""Count the lines of the studies, the kit, the command line and the drivers' wiring.

    python -m benchmarks.source_lines [--json]

A study should be short because the kit does the rest, so its length is a figure like any other.
Tests are not counted. "Ratio" is limit / value: 1 or more is within the limit.
"""

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent
WIRING: Final = (
    "building",
    "option_models",
    "options",
    "driver_facts",
    "registry",
    "spec",
    "wires",
)
"""Modules of `devices` that only say which driver is which."""
LIMITS: Final = {
    "studies and kit": 12_500,
    "stare": None,
    "crowd": None,
    "waving": 1_400,
    "kit": None,
    "command line and driver wiring": 5_500,
    "duel, a study of one file": 150,
}


@dataclass(frozen=True)
class Row:
    """One printed figure; no limit is None."""

    name: str
    value: int
    unit: str
    limit: int | None
    ratio: float | None


def lines_of(*places: Path) -> int:
    """Return the lines of Python below some folders, or of files."""
    files = [f for p in places for f in ([p] if p.is_file() else p.rglob("*.py"))]
    return sum(len(f.read_text("utf-8").splitlines()) for f in files)


def rows() -> list[Row]:
    """Count everything."""
    studies, kit = ROOT / "experiments", ROOT / "visavis"
    wiring = [p for n in WIRING if (p := ROOT / "devices" / f"{n}.py").exists()]
    counted = {
        "studies and kit": lines_of(studies, kit),
        "stare": lines_of(studies / "stare"),
        "crowd": lines_of(studies / "crowd"),
        "waving": lines_of(studies / "waving"),
        "kit": lines_of(kit),
        "command line and driver wiring": lines_of(ROOT / "cli", *wiring),
        "duel, a study of one file": lines_of(ROOT / "tests/visavis/studies/duel.py"),
    }
    return [
        Row(name, value, "lines", limit, None if limit is None else round(limit / value, 2))
        for name, value in counted.items()
        for limit in [LIMITS[name]]
    ]


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    found = rows()
    if parser.parse_args().json:
        print(json.dumps([asdict(r) for r in found], indent=1))
        return
    for r in found:
        limit = "" if r.limit is None else f"   limit {r.limit:6d}   ratio {r.ratio}"
        print(f"{r.name:32} {r.value:6d} {r.unit}{limit}")


if __name__ == "__main__":
    main()
