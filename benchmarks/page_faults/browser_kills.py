"""Kill the browser in which somebody answers, open the same page in the same profile, and count.

Chromium runs with a profile of its own and is killed whole (SIGKILL to every process of it): before
an answer is given, within milliseconds of the last key, or once the next trial is shown. A trial
that the page moved on to says that the answer before it was acknowledged: to the server's disk, or
in a bundle to the browser's own store.
"""

import http.server
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.page_faults.study import (
    FAULT_EVERY,
    OPTIONS,
    TRIALS,
    Found,
    Server,
    kept_replies,
    request_of,
)
from visavis.lab.clock import StopWatch, SystemClock
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording
from visavis.running.film_store import film_store
from visavis.running.page.other_hosts.bundle import write_bundle
from visavis.running.page.other_hosts.results import read_runs
from visavis.running.page.server import LOCAL

PATIENCE_S: Final = 60.0
TRIES: Final = 3
MAX_AFTER_KEY_S: Final = 0.06
"""Writing into the browser's store, sending, writing on the server and the answer take less."""
OPTIONS_OF_BROWSER: Final = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--remote-debugging-port=0",
    "--disable-gpu",
)
SHOWN: Final = """
() => {
  const main = document.getElementById("main");
  if (!main) return {kind: "", trial: 0, asks: false, goes_on: false};
  const found = /(\\d+)/.exec(document.getElementById("progress").textContent || "");
  return {kind: main.className, trial: found ? Number(found[1]) : 0, text: main.innerText,
          asks: Boolean(main.querySelector("input[type=radio]:not([disabled])")),
          goes_on: Boolean(main.className === "narrow" && main.querySelector("button"))};
}
"""
GO_ON: Final = "document.querySelector('#main.narrow button')?.click()"
"""A page of text is read, and left."""


class Chromium:
    """Own a browser with a profile that outlives it."""

    def __init__(
        self,
        program: str,
        profile: Path,
        playwright: Any,
        options: Sequence[str] = OPTIONS_OF_BROWSER,
    ) -> None:
        self._program, self._profile, self._playwright = program, profile, playwright
        self._options = options
        self._process: subprocess.Popen[bytes] | None = None
        self.page: Any = None

    def start(self) -> None:
        """Begin it; one that does not take its driver is begun again.

        Raises:
            DataError: it did not begin.
        """
        from playwright.sync_api import Error

        for _ in range(TRIES):
            try:
                self._start()
                return
            except Error:
                self.kill()
        raise DataError(f"{self._program} took no driver, {TRIES} times")

    def _start(self) -> None:
        told = self._profile / "DevToolsActivePort"
        told.unlink(missing_ok=True)
        self._process = subprocess.Popen(
            [self._program, *self._options, f"--user-data-dir={self._profile}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        watch = StopWatch()
        while not (told.exists() and "\n" in told.read_text("utf-8")):
            if watch.elapsed_s() > PATIENCE_S or self._process.poll() is not None:
                raise DataError(f"{self._program} did not begin")
            _wait(0.02)
        port = told.read_text("utf-8").split("\n")[0]
        browser = self._playwright.chromium.connect_over_cdp(f"http://{LOCAL}:{port}")
        context = browser.contexts[0]
        self.page = context.pages[0] if context.pages else context.new_page()

    def kill(self) -> None:
        """Kill every process of it at once."""
        if self._process is None or self._process.poll() is not None:
            return
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def shown(self) -> dict[str, Any]:
        """Return what the page shows."""
        found: dict[str, Any] = self.page.evaluate(SHOWN)
        return found

    def wait_for_trial(self, wanted: int) -> dict[str, Any]:
        """Wait until a trial of this number or a later one can be answered, or the end is shown.

        Raises:
            DataError: the page shows nothing of the kind.
        """
        watch = StopWatch()
        while True:
            found = self.shown()
            if found["kind"] == "watch" and found["asks"] and found["trial"] >= wanted:
                return found
            if found["kind"] == "narrow" and "Thank" in found["text"]:
                return {**found, "trial": TRIALS + 1}
            if found["goes_on"]:
                self.page.evaluate(GO_ON)
            if watch.elapsed_s() > PATIENCE_S:
                raise DataError(f"trial {wanted} is not shown, but {found}")
            _wait(0.005)


def _wait(seconds: float) -> None:
    clock = SystemClock()
    clock.sleep_until_ns(clock.now_ns() + round(seconds * 1e9))


def _answer_all(
    browser: Chromium, address: str, found: Found, limit: int, rng: np.random.Generator
) -> dict[int, str]:
    """Answer every trial of a page, whose browser is killed meanwhile."""
    taken: dict[int, str] = {}
    given: dict[int, str] = {}
    browser.start()
    browser.page.goto(address)
    trial = browser.wait_for_trial(1)["trial"]
    while trial <= TRIALS:
        where = int(rng.integers(3)) if rng.random() < 1 / FAULT_EVERY else -1
        where = where if found.faults < limit else -1
        address = browser.page.url
        if where != 0:
            given[trial] = str(rng.integers(1, OPTIONS + 1))
            browser.page.keyboard.press(given[trial])
            browser.page.keyboard.press("Enter")
        if where == 1:
            _wait(rng.uniform(0, MAX_AFTER_KEY_S))
        if where in (-1, 2):
            after = browser.wait_for_trial(trial + 1)["trial"]
            taken[trial] = given[trial]
        if where >= 0:
            browser.kill()
            found.faults += 1
            browser.start()
            watch = StopWatch()
            browser.page.goto(address)
            after = browser.wait_for_trial(1)["trial"]
            found.resumes_s.append(watch.elapsed_s())
            if after <= max(taken, default=0):
                found.lost += 1
            elif after > trial:
                taken[trial] = given[trial]
            elif where == 1:
                found.asked_again += 1
        trial = after
    return taken


def kills_of_browser(
    root: Path, served: Found, bundled: Found, limit: int, rng: np.random.Generator
) -> None:
    """Perform sessions until the browser was killed often enough: served ones and a bundle's.

    Raises:
        DataError: there is no Chromium.
    """
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        raise DataError("there is no chromium; apt install chromium, or --browser 0")
    request = request_of(root)
    bundle = root / "bundle"
    write_bundle(request, film_store(request.experiment), bundle, places=1)
    while served.faults < limit:
        label = f"B{served.sessions + 1:03d}"
        server = Server(root, label)
        server.start()
        with sync_playwright() as playwright:
            browser = Chromium(program, root / f"profile-{label}", playwright)
            try:
                taken = _answer_all(browser, server.address, served, limit, rng)
                server.wait()  # the page has said its thanks
            finally:
                browser.kill()
                server.kill()
        recording = Recording(server.path)
        rows = [str(a) for a in recording.trials()["answer"]]
        served.not_whole += recording.status != "complete" or rows != list(taken.values())
        served.look_through(taken, _by_trial(kept_replies(server.path)))
    with _hosted(bundle) as address:
        while bundled.faults < limit:
            profile = root / f"profile-bundle-{bundled.sessions + 1:03d}"
            with sync_playwright() as playwright:
                browser = Chromium(program, profile, playwright)
                file = root / f"{profile.name}.jsonl"
                try:
                    taken = _answer_all(browser, address, bundled, limit, rng)
                    file.write_text(_saved(browser), "utf-8")
                finally:
                    browser.kill()
            runs, unreadable = read_runs([file])
            events = [line["event"] for run in runs for line in run.lines if "event" in line]
            kept: dict[int, list[str]] = {}
            for event in events:
                if event["kind"] == "reply":
                    kept.setdefault(event["n"], []).append(
                        event["reply"].get("answers", {}).get("answer", {}).get("option", "")
                    )
            bundled.not_whole += len(runs) != 1 or unreadable > 0
            bundled.look_through(taken, _by_trial(kept))


def _by_trial(kept: dict[int, list[str]]) -> dict[int, list[str]]:
    """Return answers by the number of their trial: what answers nothing is passed over."""
    answers = [given for _, given in sorted(kept.items()) if any(given)]
    return dict(enumerate(answers, start=1))


def _saved(browser: Chromium) -> str:
    """Return the file of answers that a bundle's page offers after its thanks."""
    with browser.page.expect_download() as download:
        browser.page.click("a[download]")
    return Path(download.value.path()).read_text("utf-8")


@contextmanager
def _hosted(folder: Path) -> Iterator[str]:
    """Serve a folder as any web host would; yields its address."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: Any) -> None: ...

    made = http.server.ThreadingHTTPServer((LOCAL, 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=made.serve_forever, daemon=True).start()
    try:
        yield f"http://{LOCAL}:{made.server_address[1]}/"
    finally:
        made.shutdown()
        made.server_close()
