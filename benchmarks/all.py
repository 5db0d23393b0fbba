"""Print every row that speed is held to beside the last run on the same machine.

    python -m benchmarks.all [--only NAME ...] [--compare FILE] [--start CHECKOUT]

Each group of rows is measured by the benchmark it is named for, in a process of its own. "Ratio"
is how much better than the goal a figure is. With `--compare` the file, kept by whoever measures,
is read for the last figure of each row on a machine with the same processor and as many cores;
"before" and "better by" say it and the ratio to it, and this run is added to the file.

Goals are figures of the computer they were set on. With `--start`, a checkout of commit c947f481
from which they were set, that commit's benchmarks run in the same run, and each goal is asked for
as the same improvement, whatever this computer takes for that very row (`benchmarks.start`).

Beneath a
row that misses its goal stands its floor: what the same computer needs, in the same run, for the
part that nobody can leave out. On a machine that does other work wall times say little; its load
is printed at the end.
"""

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from benchmarks import (
    armband_round_trip,
    collision_volume,
    crowd_contact,
    crowd_speed,
    frame_loop,
    gaze_speed,
    hybrid_motion,
    stage,
    statistics,
    viewer,
    warping,
)
from benchmarks.start import AT_START, goal_here, rows_at_start
from benchmarks.table import Row
from visavis.lab.clock import cpu_time_s
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.warping.cases import case_named, stage_case

PEOPLE: Final = (20, 200)
PAIR_GOALS_MS: Final = (0.35, 0.45)


def _frame_loop() -> list[Row]:
    return [row for wire in frame_loop.WIRES for row in frame_loop.rows_of(wire, 10.0)]


def _contacts() -> list[Row]:
    times = crowd_contact.time_frames(300, 5000)
    return [
        Row(
            "contacts, 6 × 300",
            times["cpu_ms"],
            "CPU ms",
            floor=times["floor_cpu_ms"],
            floor_name="the call, and whoever is touched posed and described",
            floor_is_ours=True,
        )
    ]


def _volumes() -> list[Row]:
    sizes = zip(collision_volume.BODIES, PAIR_GOALS_MS, strict=True)
    return [
        row
        for (edge, _, ms), goal_ms in sizes
        for row in collision_volume.measure(edge, ms, 120, 0, 0, mean_ms=goal_ms)
    ]


def _walks() -> list[Row]:
    return crowd_speed.measure(2, "characters")


def _statistics() -> list[Row]:
    lines = statistics.measure(200)
    rows = [Row(line.name, line.value, line.unit) for line in lines if line.peer == "limit"]
    floor_s = statistics.import_s("numpy, scipy.special")
    probabilities = "NumPy and SciPy's special functions, from which all p come, alone"
    return [
        replace(row, floor=floor_s, floor_name=probabilities)
        if row.name == "import of the package"
        else row
        for row in rows
    ]


def _motion() -> list[Row]:
    squad = hybrid_motion.squad_mquat_per_s()
    rows = [Row("Squad", squad, "million/s", 90.0, at_least=True)]
    ratios = [row for name in hybrid_motion.INCREMENTS for row in hybrid_motion.rows_of(name)]
    for people, goal in zip(PEOPLE, (0.9, 0.95), strict=True):
        least = min(row.ratio for row in ratios if row.people == people)
        loops = min(hybrid_motion.ratio_of_loops(name, people) for name in hybrid_motion.ROUNDS)
        rows.append(
            Row(
                f"hybrid beside clip, {people} people",
                least,
                "",
                goal,
                at_least=True,
                floor=loops,
                floor_name="Squad turns three arcs where a clip turns one: its loop alone reaches",
                floor_is_ours=True,
            )
        )
    return rows


def _armband() -> list[Row]:
    with armband_round_trip.EchoBand() as band:
        return armband_round_trip.round_trips(band.port, 500)


def _warping() -> list[Row]:
    case = stage_case(case_named("view_change"), load_character("anna"))
    return [
        Row(
            row["name"],
            row["value"],
            row["unit"],
            at_least=True,
            floor=row.get("floor"),
            floor_name=row.get("floor_name", ""),
        )
        for row in warping.steps(case)
    ]


def _viewer() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        session = viewer.recorded("stare", Path(folder))
        page, film = Path(folder) / "page.html", Path(folder) / "film.mp4"
        viewer.run("view", str(session), "--trial", "T01", "-o", str(page))
        before_s = cpu_time_s()
        viewer.run("film", str(session), "--trial", "T01", "-o", str(film))
        film_row = Row("film, CPU", cpu_time_s() - before_s, "s")
        page_rows = viewer.of_page(page)
    faster = "pictures a second"
    rows = [(str(row["what"]), float(str(row["value"]))) for row in page_rows]
    return [film_row, *(Row(n, v, "", at_least=n.endswith(faster)) for n, v in rows)]


GROUPS: Final[Mapping[str, Callable[[], list[Row]]]] = {
    "frame_loop": _frame_loop,
    "stage": stage.rows,
    "crowd_contact": _contacts,
    "collision_volume": _volumes,
    "crowd_speed": _walks,
    "gaze_speed": gaze_speed.measure,
    "statistics": _statistics,
    "hybrid_motion": _motion,
    "armband_round_trip": _armband,
    "warping": _warping,
    "viewer": _viewer,
}
GOALS: Final[Mapping[str, float]] = {
    "sockets: work per frame, median": 0.25,
    "sockets: work per frame, p99": 0.6,
    "memory: work per frame, median": 0.25,
    "memory: work per frame, p99": 0.6,
    "main thread, 12 people at full detail": 0.4,
    "main thread, 150 people": 1.0,
    "off-screen, 12 people, stereo": 120.0,
    "off-screen, 150 people, stereo": 45.0,
    "  12 people, the near ones finer": 60.0,
    "contacts, 6 × 300": 0.008,
    "15,020 triangles: pair, mean": PAIR_GOALS_MS[0],
    "26,960 triangles: pair, mean": PAIR_GOALS_MS[1],
    "15,020 triangles: pair, slowest": 1.5,
    "26,960 triangles: pair, slowest": 1.5,
    "15,020 triangles: worst error above 5e-6 m3": 2.0,
    "26,960 triangles: worst error above 5e-6 m3": 2.0,
    "I-VT, 4 M samples at once": 8e6,
    "1000 ART studies 16x2x3": 0.8,
    "driver overhead, median": 0.08,
    "renders in them, one core, 4000 triangles": 220.0 * 45,
    "film, CPU": 25.0,
    "eyes: pictures a second": 60.0,
    "import of the package": 0.3,
}
"""What a row is held to, where that is more than its benchmark asks."""


def measure(group: str) -> list[Row]:
    """Return the rows of a group, with its goals."""
    return [replace(row, limit=GOALS.get(row.name, row.limit)) for row in GROUPS[group]()]


def with_goals_here(rows: Sequence[Row], at_start: Mapping[str, float]) -> list[Row]:
    """Return rows whose goals are what they come to on this computer, where the start says it."""
    here = [(row, goal_here(row.name, row.limit or 0.0, at_start)) for row in rows]
    return [row if goal is None else replace(row, limit=goal) for row, goal in here]


def this_machine() -> str:
    """Return the processor and how many cores of it there are."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(line for line in lines if line.startswith("model name")).partition(":")[2]
    except (OSError, StopIteration):
        name = platform.processor()
    return f"{name.strip()}, {os.cpu_count()} cores"


def last_run(file: Path, machine: str) -> dict[str, float]:
    """Return the last figure of each row that a file holds of a machine; one run is one line."""
    figures: dict[str, float] = {}
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        run = json.loads(line)
        if run["machine"] == machine:
            figures |= run["values"]
    return figures


def line_of(row: Row, before: float | None, at_start: float | None = None) -> str:
    """Return a row as a line: its value, its goal, how much better than before and at the start."""
    line = f"  {row.name:<50} {row.value:>11.4g} {row.unit:<14}"
    goal = "" if row.ratio is None else f"goal {row.limit:>8g}  ratio {row.ratio:>5.2f}"
    line += f" {goal:<28}"
    if before is not None:
        times = replace(row, limit=before).ratio
        line += f" before {before:>9.4g}  better by {times:.2f}"
    if at_start is not None and row.name in AT_START:
        times = replace(row, limit=at_start).ratio
        line += f" start {at_start:>9.4g} (there {AT_START[row.name]:g})  better by {times:.2f}"
    floor = f"\n      {row.floor_line}" if row.is_missed and row.floor is not None else ""
    return line.rstrip() + floor


def main(arguments: list[str]) -> int:
    """Print every row as its group ends; return 1 where a goal is missed that is within reach."""
    parser = argparse.ArgumentParser(prog="benchmarks.all", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=tuple(GROUPS), default=tuple(GROUPS))
    parser.add_argument("--compare", type=Path, metavar="FILE", help="runs so far; made if missing")
    parser.add_argument("--start", type=Path, metavar="CHECKOUT", help="of commit c947f481")
    options = parser.parse_args(arguments)
    machine = this_machine()
    before = {} if options.compare is None else last_run(options.compare, machine)
    values: dict[str, float] = {}
    missed = False
    for group in options.only:
        print(group, flush=True)
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            try:
                rows = pool.submit(measure, group).result()
                at_start = rows_at_start(options.start, group) if options.start else {}
            except Exception as problem:  # the other groups are measured all the same
                print(f"  not measured: {type(problem).__name__}: {problem}")
                missed = True
                continue
        for row in with_goals_here(rows, at_start):
            name = f"{group}: {row.name}"
            print(line_of(row, before.get(name), at_start.get(row.name)), flush=True)
            values[name] = row.value
            missed = missed or (row.is_missed and not row.is_explained)
    load = os.getloadavg()[0]
    print(f"{machine}; load {load:.1f}")
    if options.compare is not None:
        run: dict[str, Any] = {"machine": machine, "load": load, "values": values}
        with options.compare.open("a", encoding="utf-8") as file:
            file.write(json.dumps(run) + "\n")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
