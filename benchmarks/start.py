"""Measure what goals were set from, on this computer: rows of an older checkout of Visavis.

A goal is a figure of the computer that it was set on. `AT_START` holds what commit c947f481 took
there, row by row. The same commit, measured here in the same run, says how much slower this
computer is at just that work, and so what the goal is here.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

COMMANDS: Final[Mapping[str, tuple[str, ...]]] = {
    "frame_loop": ("frame_loop", "--seconds", "10"),
    "stage": ("stage",),
    "crowd_contact": ("crowd_contact", "--frames", "5000"),
    "collision_volume": ("collision_volume", "--small-pairs", "0", "--peer-pairs", "0"),
    "gaze_speed": ("gaze_speed",),
    "statistics": ("statistics", "--studies", "200"),
    "hybrid_motion": ("hybrid_motion",),
    "armband_round_trip": ("armband_round_trip", "--commands", "500", "--frames", "1000"),
    "warping": ("warping", "--cases", "view_change"),
    "viewer": ("viewer",),
}
"""What the older checkout runs for each group of rows, without `--json`."""
AT_START: Final[Mapping[str, float]] = {
    "sockets: work per frame, median": 0.42,
    "sockets: work per frame, p99": 0.73,
    "memory: work per frame, median": 0.62,
    "memory: work per frame, p99": 0.98,
    "main thread, 12 people at full detail": 0.59,
    "main thread, 150 people": 1.91,
    "off-screen, 12 people, stereo": 83.0,
    "off-screen, 150 people, stereo": 24.0,
    "  12 people, the near ones finer": 39.0,
    "contacts, 6 × 300": 0.017,
    "15,020 triangles: pair, mean": 0.62,
    "26,960 triangles: pair, mean": 0.70,
    "26,960 triangles: pair, slowest": 3.1,
    "I-VT, 4 M samples at once": 6.1e6,
    "1000 ART studies 16x2x3": 1.35,
    "Squad": 67.0,
    "driver overhead, median": 0.20,
    "renders in them, one core, 4000 triangles": 150.0 * 45,
    "film, CPU": 51.0,
    "eyes: pictures a second": 41.0,
    "import of the package": 0.52,
}
"""What c947f481 took where the goals were set, by the names of today's rows, in their units."""


def rows_at_start(checkout: Path, group: str) -> dict[str, float]:
    """Return the figures of a group in an older checkout by today's names, none of new groups."""
    if group not in COMMANDS:
        return {}
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    module, *arguments = COMMANDS[group]
    child = subprocess.run(
        [sys.executable, "-m", f"benchmarks.{module}", *arguments, "--json"],
        cwd=checkout,
        env=environment,
        capture_output=True,
        text=True,
        check=False,  # it returns 1 where it misses limits of its own
    )
    text = child.stdout
    if not text.lstrip().startswith(("[", "{")):
        last_words = child.stderr[-300:].strip()
        raise RuntimeError(f"{checkout}: {module} printed no figures: {last_words}")
    figures: dict[str, float] = {}
    for name, value in _rows_by_name(json.JSONDecoder().raw_decode(text.lstrip())[0]):
        figures.setdefault(name, value)
    return figures


def _rows_by_name(output: Any) -> Iterator[tuple[str, float]]:
    """Yield names and values of what benchmarks of that time print, by today's names."""
    if isinstance(output, dict):
        yield "Squad", output["squad_mquat_per_s"]
        return
    for row in output:
        if "people" in row and "cpu_ms" in row:
            yield f"contacts, 6 × {round(row['people'] / 100) * 100}", row["cpu_ms"]
            continue
        name, value = str(row.get("name", row.get("what"))), float(row["value"])
        if name == "control steps, one core, 4000 triangles":
            yield "renders in them, one core, 4000 triangles", value * 45
        yield ("film, CPU" if name == "film, CPU s" else name), value


def goal_here(name: str, goal: float, at_start: Mapping[str, float]) -> float | None:
    """Return a row's goal on this computer; None where the start was not measured on both."""
    if name not in AT_START or name not in at_start:
        return None
    return goal * at_start[name] / AT_START[name]
