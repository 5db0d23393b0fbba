"""Measure what the desk costs a session: per frame, and until its page is painted.

    python -m benchmarks.desk [--seconds 20] [--json]

The session of `benchmarks.frame_loop` runs in real time by itself and with a desk that reads along,
in turn and twice each, as the machine's other work changes from minute to minute. "Status" is what
the frame thread itself does for a desk eight times a second, on a status of a trial with eleven
people. "First paint" is from the request of the page to its first picture in Chromium; without one
that row is left out. "Picture" is what asking for the participant's view and taking it cost the
thread that draws, twice a second each, an eye of a headset drawn beforehand and done; a computer
that draws on its processor copies it there, within the frame. "Ratio" is limit / value.
"""

import argparse
import asyncio
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.frame_loop import work_per_frame_ms
from benchmarks.table import Row, show
from visavis.cli.desk.link import About, SessionLink
from visavis.cli.desk.server import DeskServer
from visavis.cli.desk.watch import SessionWatch
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import StopWatch
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.session.operator import Operator, SessionStatus, UnattendedOperator
from visavis.stage.card.context import draws_on_processor, offscreen_context, release_offscreen
from visavis.stage.card.small_picture import SmallPicture
from visavis.stage.errors import StageError

LIMIT_MS = 0.5
PAINT_LIMIT_S = 1.0
WIRE = "sockets"
PASSES = 2
STATUSES = 2000
PICTURES = 60
EYE_PX = (1440, 1600)


class Keeping(SessionLink):
    """A link that keeps the fullest status it was shown."""

    fullest: SessionStatus | None = None

    def show(self, status: SessionStatus) -> None:
        """Pass it on as any link does."""
        if (
            status.scene_frame is not None
            and status.scene_frame.scene.agents
            and status.trial_left_s
        ):
            self.fullest = status
        super().show(status)


@contextmanager
def beside(work: Any) -> Iterator[None]:
    """Run a coroutine in a thread of its own until the block is left."""
    loops: list[tuple[asyncio.AbstractEventLoop, asyncio.Task[Any]]] = []
    begun = threading.Event()

    async def all_of_it() -> None:
        task = asyncio.create_task(work())
        loops.append((asyncio.get_running_loop(), task))
        begun.set()
        await asyncio.wait([task])

    thread = threading.Thread(target=lambda: asyncio.run(all_of_it()))
    thread.start()
    begun.wait()
    try:
        yield
    finally:
        loop, task = loops[0]
        loop.call_soon_threadsafe(task.cancel)
        thread.join()


@contextmanager
def reader(root: Path) -> Iterator[None]:
    """Let a desk read along in a process of its own, as `visavis desk` does."""
    with subprocess.Popen([sys.executable, "-m", "benchmarks.desk", "--read", str(root)]) as desk:
        try:
            yield
        finally:
            desk.kill()


def sessions(seconds: float, root: Path) -> tuple[list[Row], SessionStatus]:
    """Return the figures of sessions with and without a desk, and a status of a trial."""
    work: dict[str, list[float]] = {"alone": [], "desk": []}
    about = About("stare", "B01", 1, str(root), is_simulated=True, is_blind=False)
    fullest: SessionStatus | None = None
    for turn in range(PASSES):
        for name in work:
            place = root / f"{name}{turn}"
            place.mkdir()
            operator: Operator = UnattendedOperator()
            if name == "alone":
                work[name] += work_per_frame_ms(WIRE, seconds, place, operator)[0]
                continue
            with Keeping(operator, about, root) as link, reader(root):
                work[name] += work_per_frame_ms(WIRE, seconds, place, link)[0]
            fullest = link.fullest
    if fullest is None:
        raise SystemExit("no trial was seen: give more --seconds")
    rows = []
    for words, share in (("median", 50), ("p99", 99)):
        alone_ms, desk_ms = (float(np.percentile(work[name], share)) for name in ("alone", "desk"))
        rows.append(Row(f"work per frame alone, {words}", alone_ms, "ms"))
        rows.append(Row(f"work per frame with a desk, {words}", desk_ms, "ms"))
        more_ms = desk_ms - alone_ms  # below zero where other work of the machine outweighs it
        rows.append(Row(f"of it for the desk, {words}", more_ms, "ms", LIMIT_MS))
    return rows, fullest


def status_cost(status: SessionStatus, root: Path) -> list[Row]:
    """Return what keeping a status takes of the frame thread, a desk reading along."""
    about = About("stare", "B01", 1, str(root), is_simulated=True, is_blind=False)
    took_ms = []
    with SessionLink(UnattendedOperator(), about, root) as link, reader(root):
        for _ in range(STATUSES):
            timed = StopWatch()
            link.poll()
            link.show(status)
            took_ms.append(timed.elapsed_s() * 1e3)
    return [
        Row(f"status of a frame, {words}", ms, "ms", LIMIT_MS)
        for words, ms in zip(("median", "p99"), np.percentile(took_ms, [50, 99]), strict=True)
    ]


def picture_cost() -> list[Row]:
    """Return what the participant's view takes of the thread that draws; nothing undrawn."""
    try:
        context = offscreen_context()
    except StageError:
        return []
    eye = context.texture(EYE_PX, 4, np.zeros((*EYE_PX[::-1], 4), np.uint8).tobytes())
    small = SmallPicture(context, EYE_PX)
    asked_ms, taken_ms = [], []
    for _ in range(PICTURES):
        context.finish()
        timed = StopWatch()
        small.ask(eye)
        asked_ms.append(timed.elapsed_s() * 1e3)
        context.finish()  # which the frames in between do
        timed = StopWatch()
        small.take()
        taken_ms.append(timed.elapsed_s() * 1e3)
    by = "processor" if draws_on_processor(context) else "card"
    release_offscreen(context)
    return [
        Row(f"picture {words} ({by} draws), median", float(np.median(ms)), "ms", LIMIT_MS)
        for words, ms in (("asked for", asked_ms), ("taken", taken_ms))
    ]


def first_paint(status: SessionStatus, root: Path) -> list[Row]:
    """Return how long the page takes to its first picture, a session going on."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        return []
    if browser is None:
        return []
    lab = load_config(EXAMPLE, OPTION_MODELS).model_copy(update={"data_root": root})
    addresses: list[str] = []
    listens = threading.Event()

    async def serve() -> None:
        desk = DeskServer(lab)
        addresses.append(await desk.start())
        listens.set()
        await desk.run()

    about = About("stare", "B01", 1, str(root), is_simulated=True, is_blind=False)
    with (
        SessionLink(UnattendedOperator(), about, root) as link,
        beside(serve),
        sync_playwright() as started,
    ):
        link.show(status)
        listens.wait()
        page = started.chromium.launch(executable_path=browser, args=["--no-sandbox"]).new_page()
        page.goto(addresses[0])
        page.wait_for_selector("#f-trial")
        paint_ms = page.evaluate(
            "() => performance.getEntriesByName('first-contentful-paint')[0].startTime"
        )
    seconds = float(paint_ms) / 1e3
    return [Row("first paint of the page", seconds, "s", PAINT_LIMIT_S)]


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.desk", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of the scenes")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.read:
        asyncio.run(SessionWatch(options.read).run())
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        os.environ["XDG_CACHE_HOME"] = str(root / "cache")
        rows, status = sessions(options.seconds, root)
        rows += status_cost(status, root)
        rows += picture_cost()
        rows += first_paint(status, root)
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
