"""Measure the page that shows a session again, and films of it.

    python -m benchmarks.viewer [--study stare|crowd] [--json]

One simulated session with a trial of 16 seconds; its page in Chromium, which draws with the
processor (SwiftShader) a stage of 640 by 360 pixels: from the address to everything being there,
pictures a second while every picture shows another moment, and what a picture costs in CPU time of
all the browser's processes. Then the film of the trial, 960 by 540 pixels at 25 a second: CPU time
of the whole. Wall times (opening, pictures a second) say little on a machine that does other work:
its load is printed, and CPU time a picture beside them. "Ratio" is limit / value, or value / limit
where more is better.
"""

import argparse
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from visavis.cli.app import app
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.recording.folder import study_dir
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import settle, wanted_settings

Row = dict[str, object]
PARAMETERS: dict[str, dict[str, Any]] = {
    "stare": {"repetitions": 1, "trial_s": 16.0, "intertrial_s": 0.3, "practice_s": 0.5},
    "crowd": {"configurations": 1, "intertrial_s": 0.5, "limit_s": 16.0},
}
MAX_OPEN_S, MIN_PICTURES_PER_S, MAX_PAGE_MB = 3.0, 30.0, 15.0
MAX_FILM_CPU_S = 60.0
OTHER_CAMERAS = ("eyes", "follow", "above", "topology")
"""A camera that stands still has its room drawn once: that of an opened page, and `above`."""
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
STAGE = """() => { const s = document.getElementById('stage').style;
  s.width = '640px'; s.height = '360px'; s.flex = 'none'; s.position = 'fixed'; }"""
SCRUB = """async seconds => { const v = viewer, scene = v.header.scenes[0]; let k = 0;
  const begun = performance.now(), frames = v.frames;
  await new Promise(done => { const next = () => {
    v.seek(scene.t0 + (k++ % 480) / 480 * (scene.t1 - scene.t0));
    if (performance.now() - begun > 1000 * seconds) done(); else requestAnimationFrame(next); };
    requestAnimationFrame(next); });
  return [v.frames - frames, (performance.now() - begun) / 1000]; }"""


def measured(name: str, value: float, limit: float | None = None, *, most: bool = True) -> Row:
    """Return one line of the table."""
    row: Row = {"what": name, "value": value, "limit": limit}
    if limit is not None:
        row["ratio"] = limit / value if most else value / limit
    return row


def recorded(study_name: str, folder: Path) -> Path:
    """Return a simulated session."""
    study = find_study(study_name)
    config = load_config(EXAMPLE, OPTION_MODELS).model_copy(update={"data_root": folder})
    at = study_dir(folder, study.name, is_simulated=True)
    settle(at, wanted_settings(at, study, is_simulated=True), seed_given=False)
    experiment = study.experiment(PARAMETERS[study_name])
    request = simulated_request(study, experiment, config, label="S01", index=0, seed=3)
    return perform_new(request)


def run(*arguments: str) -> None:
    """Run a command of Visavis; raise what it raises."""
    done = CliRunner().invoke(app, list(arguments))
    if done.exception is not None:
        raise done.exception


def of_page(page: Path) -> list[Row]:
    """Measure a page in the browser; nothing where there is none."""
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        print("playwright is not installed: no figures of the page", file=sys.stderr)
        return []
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        print("there is no chromium: no figures of the page", file=sys.stderr)
        return []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        tab = browser.new_page(viewport={"width": 960, "height": 640})
        watch = StopWatch()
        tab.goto(page.as_uri())
        tab.wait_for_selector("body[data-ready]", timeout=120_000)
        open_s = watch.elapsed_s()
        tab.evaluate(STAGE)
        tab.evaluate(SCRUB, 2)  # code and pictures get warm
        before_s = children_cpu_s()
        pictures, wall_s = tab.evaluate(SCRUB, 8)
        cpu_s = children_cpu_s() - before_s
        coarse = tab.evaluate("viewer.coarse")
        others = [row for name in OTHER_CAMERAS for row in by_camera(tab, name)]
        browser.close()
    return [
        measured("page opens, s", open_s, MAX_OPEN_S),
        measured("pictures a second", pictures / wall_s, MIN_PICTURES_PER_S, most=False),
        measured("CPU time a picture, ms", 1000 * cpu_s / max(1, pictures)),
        measured("steps of coarseness it took to keep pace", coarse),
        *others,
    ]


def by_camera(tab: Any, name: str) -> list[Row]:
    """Measure a page by another camera than the one it opens with."""
    tab.evaluate(f"viewer.setCamera('{name}')")
    tab.evaluate(SCRUB, 1)
    before_s = children_cpu_s()
    pictures, wall_s = tab.evaluate(SCRUB, 4)
    cpu_s = children_cpu_s() - before_s
    return [
        measured(f"{name}: pictures a second", pictures / wall_s),
        measured(f"{name}: CPU time a picture, ms", 1000 * cpu_s / max(1, pictures)),
    ]


def children_cpu_s() -> float:
    """Return the CPU time of all processes below this one."""
    ticks, left = 0, [os.getpid()]
    while left:
        pid = left.pop()
        for task in Path(f"/proc/{pid}/task").glob("*/children"):
            left += map(int, task.read_text().split())
        if pid != os.getpid():
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--study", choices=[*PARAMETERS], default="stare")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        session = recorded(options.study, Path(folder))
        page, film = Path(folder) / "page.html", Path(folder) / "film.mp4"
        before_s = cpu_time_s()
        run("view", str(session), "--trial", "T01", "-o", str(page))
        rows = [
            measured("page is written, CPU s", cpu_time_s() - before_s),
            measured("page, MB", page.stat().st_size / 1e6, MAX_PAGE_MB),
            *of_page(page),
        ]
        before_s = cpu_time_s()
        run("film", str(session), "--trial", "T01", "-o", str(film))
        rows.append(measured("film, CPU s", cpu_time_s() - before_s, MAX_FILM_CPU_S))
    rows.append(measured("load of the machine", os.getloadavg()[0]))
    if options.json:
        print(json.dumps(rows, indent=2))
        return
    print(f"{options.study:42s}{'value':>10s}{'limit':>10s}{'ratio':>9s}")
    for row in rows:
        value, limit, ratio = (row.get(k) for k in ("value", "limit", "ratio"))
        told = "".join(
            f"{x:>{w}.4g}" if x is not None else " " * w
            for x, w in ((value, 10), (limit, 10), (ratio, 9))
        )
        print(f"{row['what']:42s}{told}")


if __name__ == "__main__":
    main()
