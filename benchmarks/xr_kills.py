"""Kill the server and the browser of a session in a headset, cut its wire; count batches.

    python -m benchmarks.xr_kills [--server N] [--browser N] [--cuts N] [--json]

Chromium runs the study's page with a headset that follows the standard's order of events and
draws 72 frames a second. Its samples go out in batches, while the server's process is killed
(SIGKILL) and begun anew at its address, all processes of the browser are killed and its profile is
opened again, or posts are broken off on their way. Every batch that the page's store had taken must
be in the recording once, with its own bytes, and each of its rows once; a row is missing only where
the page said that frames were left out. Exits with 1 where anything is lost or doubled.
"""

import argparse
import base64
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.page_faults import serving
from benchmarks.page_faults.browser_kills import OPTIONS_OF_BROWSER, Chromium
from benchmarks.page_faults.study import NAME, session_path
from visavis.lab.clock import StopWatch, SystemClock
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording

HEADSETS: Final = Path(__file__).parents[1] / "tests" / "running" / "page" / "headsets"
SEED: Final = 45
TRIAL: Final = "fieldset:not(:has-text('unwell'))"
"""The question of a trial, and not the one that comes before the headset."""
TRIALS: Final = 10
FAULTS_A_TRIAL: Final = 4
PATIENCE_S: Final = 120.0
MAX_WAIT_S: Final = 0.8
"""A batch is closed twice a second: faults come at any moment of it."""
MAX_CUT_MS: Final = 30.0
STUDY: Final = f"""
from visavis import Factor, Rating, Study

study = Study("{NAME}", factors=[Factor("place", list(range({TRIALS})))], on="browser", uses=(),
              calibrate=False, xr="required")


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""
WATCH: Final = """
(() => {
  window.acknowledged = 0;
  const put = IDBObjectStore.prototype.put;
  IDBObjectStore.prototype.put = function (value, ...rest) {
    if (value?.kind === "stream") {
      const { stream, seq0, rows, data } = value;
      const [of, text] = [this.transaction, JSON.stringify({ stream, seq0, rows, data })];
      of.addEventListener("complete", () => window.stored(text));
    }
    return put.call(this, value, ...rest);
  };
  const plain = window.fetch;
  window.fetch = async (path, options) => {
    if (path !== "/api/events") return plain(path, options);
    if (window.cutMs !== undefined && JSON.parse(options.body).events.length) {
      const off = new AbortController();
      setTimeout(() => { off.abort(); window.isCut = true; }, window.cutMs);
      window.cutMs = undefined;
      return plain(path, { ...options, signal: off.signal });
    }
    const answer = await plain(path, options);
    if (answer.ok) window.acknowledged = (await answer.clone().json()).ack;
    return answer;
  };
})();
"""
"""Says which batches the page's store has taken and what is acknowledged; breaks a post off."""


@dataclass
class Kind:
    """What came of one kind of fault."""

    kind: str
    wanted: int
    faults: int = 0
    resumes_s: list[float] = field(default_factory=list)
    """From the fault to the next acknowledgement of samples."""


@dataclass
class Batches:
    """What became of the batches and rows of all sessions."""

    sessions: int = 0
    stored: int = 0
    rows: int = 0
    lost: int = 0
    doubled: int = 0
    other_bytes: int = 0
    rows_lost: int = 0
    rows_doubled: int = 0
    not_whole: int = 0

    @property
    def is_bad(self) -> bool:
        """Whether anything was lost, doubled or changed."""
        faults = (self.lost, self.doubled, self.other_bytes, self.rows_lost, self.rows_doubled)
        return any(faults) or bool(self.not_whole)

    def look_through(self, path: Path, stored: dict[tuple[str, int], tuple[int, str]]) -> None:
        """Compare what a page's store had taken, by stream and first row, with its recording."""
        recording = Recording(path)
        events = recording.events()
        pages = events.loc[events["name"] == "page_event", "payload"]
        journal = [p for p in pages if p["kind"] == "stream"]
        times = Counter((p["stream"], p["seq0"]) for p in journal)
        said = {(p["stream"], p["seq0"]): (p["rows"], p["digest"]) for p in journal}
        self.sessions += 1
        self.stored += len(stored)
        self.lost += sum(batch not in said for batch in stored)
        self.doubled += sum(n > 1 for n in times.values())
        self.other_bytes += sum(said.get(b, content) != content for b, content in stored.items())
        self.not_whole += recording.status != "complete" or len(recording.trials()) != TRIALS
        timing = recording.stream_arrays("frame_timing")
        left_out = dict(zip(timing["seq"].tolist(), timing["skipped"].tolist(), strict=True))
        for name in recording.stream_names:
            numbers = recording.stream_arrays(name)["seq"]
            steps = np.diff(numbers)
            self.rows += len(numbers)
            on_disk = set(numbers.tolist())
            self.rows_doubled += len(numbers) - len(on_disk) + int((steps < 0).sum())
            batches = (p for p in journal if p["stream"] == name)
            named = {n for p in batches for n in range(p["seq0"], p["seq0"] + p["rows"])}
            self.rows_lost += len(named - on_disk)
            for at in np.flatnonzero(steps > 1):
                missing = int(steps[at]) - 1
                by_frames = name in ("head", "frame_timing")
                if not by_frames or left_out.get(int(numbers[at + 1])) != missing:
                    self.rows_lost += missing


class Servers:
    """Own a process that is warm and forks one server after another, each to be killed alone."""

    def __init__(self, root: Path) -> None:
        self._fork = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.xr_kills", "--serve", str(root)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._pid = 0
        self.address = ""

    def start(self, label: str) -> None:
        """Begin or go on with a session.

        Raises:
            DataError: it could not be served.
        """
        assert self._fork.stdin is not None
        assert self._fork.stdout is not None
        self._fork.stdin.write(f"{label}\n")
        self._fork.stdin.flush()
        self._pid = int(self._fork.stdout.readline())
        self.address = self._fork.stdout.readline().strip()
        if not self.address.startswith("http"):
            raise DataError(f"the session of {label} could not be served: {self.address}")

    def kill(self) -> None:
        """Kill the server."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)
        wait_for(lambda: not self.is_alive)

    @property
    def is_alive(self) -> bool:
        """Whether the server runs."""
        try:
            os.kill(self._pid, 0)
        except ProcessLookupError:
            return False
        return True

    def close(self) -> None:
        """End all of it."""
        if self._pid:
            self.kill()
        self._fork.communicate()


def serve(root: Path) -> None:
    """Fork a server for each label that is read; their ends are nobody's concern."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    for line in sys.stdin:
        pid = os.fork()
        if pid:
            continue
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        print(os.getpid(), flush=True)
        try:
            serving.main(root, line.strip())
        except BaseException as error:
            print(repr(error), flush=True)
            os._exit(1)
        os._exit(0)


def pause(seconds: float) -> None:
    """Wait."""
    clock = SystemClock()
    clock.sleep_until_ns(clock.now_ns() + round(seconds * 1e9))


def wait_for(condition: Callable[[], object], state: Callable[[], str] = lambda: "") -> None:
    """Wait until something holds; `state` says in an error how things are instead.

    Raises:
        DataError: it does not.
    """
    watch = StopWatch()
    while not condition():
        if watch.elapsed_s() > PATIENCE_S:
            raise DataError(f"a page or a server does not go on {state()}")
        pause(0.02)


class Session:
    """Own one person's session: its server, its browser, and what the page's store had taken."""

    def __init__(self, servers: Servers, browser: Chromium, label: str) -> None:
        self._servers, self._browser, self._label = servers, browser, label
        self.stored: dict[tuple[str, int], tuple[int, str]] = {}
        self._servers.start(label)
        self._address = self._servers.address
        self._open()

    @property
    def page(self) -> Any:
        """The page."""
        return self._browser.page

    def _open(self) -> None:
        self._browser.start()
        page = self.page
        page.set_viewport_size({"width": 400, "height": 300})
        page.expose_function("stored", self._note)
        page.add_init_script(WATCH)
        for name in ("standard.js", "people.js"):
            page.add_init_script(path=HEADSETS / name)
        page.goto(self._address)
        self._go_on(lambda: self.is_streaming, answers=False)

    def _note(self, text: str) -> None:
        batch = json.loads(text)
        digest = hashlib.sha256(base64.b64decode(batch["data"])).hexdigest()[:16]
        self.stored[batch["stream"], batch["seq0"]] = batch["rows"], digest

    @property
    def is_streaming(self) -> bool:
        """Whether somebody is in the headset."""
        return bool(self.page.evaluate("Boolean(window.worn?.isPresenting())"))

    @property
    def acknowledged(self) -> int:
        """The number of the page's last acknowledged event since it was opened."""
        return int(self.page.evaluate("window.acknowledged"))

    def _go_on(self, is_there: Callable[[], object], *, answers: bool = True) -> None:
        """Do what the page asks for, until something holds; `answers` says whether the questions
        of trials are answered on the page, too.
        """
        from playwright.sync_api import Error

        def step() -> object:
            if is_there():
                return True
            with suppress(Error):  # the page went on meanwhile
                self.page.evaluate("document.querySelector('#agree:not(:checked)')?.click()")
                again = self.page.query_selector("#headset button")
                button = again or self.page.query_selector("#main button:not([disabled])")
                is_vr = button is not None and "VR" in button.inner_text()
                if not (is_vr or answers) and self.page.query_selector(TRIAL):
                    return False
                for box in self.page.query_selector_all("fieldset:not(:has(:checked)) input"):
                    box.evaluate("box => box.click()")
                    break
                if button is not None and is_vr:
                    button.click(timeout=30_000)  # which browsers demand of a person
                    wait_for(lambda: self.is_streaming)
                elif button is not None:
                    button.evaluate("button => button.click()")
            return False

        wait_for(step, lambda: str(self.page.evaluate("document.body.innerText")))

    def answer(self) -> None:
        """Answer what is asked, and go on to the next trial or the end."""
        before = self.progress
        self._go_on(lambda: self.progress != before or self.is_over)

    @property
    def progress(self) -> str:
        """Which trial the page shows."""
        return str(self.page.evaluate("document.getElementById('progress').textContent"))

    @property
    def is_over(self) -> bool:
        """Whether the page has said its thanks."""
        return "Thank" in str(self.page.evaluate("document.getElementById('main').innerText"))

    def kill_server(self) -> None:
        """Kill the server and begin it anew."""
        self._servers.kill()
        self._servers.start(self._label)
        self._until_acknowledged(self.acknowledged)

    def kill_browser(self) -> None:
        """Kill the browser, open its profile again, and enter the headset again."""
        self._browser.kill()
        self._open()
        self._until_acknowledged(self.acknowledged)

    def cut(self, after_ms: float) -> None:
        """Break off a post while it is under way."""
        self.page.evaluate("ms => { window.isCut = false; window.cutMs = ms; }", after_ms)
        wait_for(lambda: self.page.evaluate("window.isCut"))
        self._until_acknowledged(self.acknowledged)

    def _until_acknowledged(self, before: int) -> None:
        wait_for(lambda: self.acknowledged > before)

    def finish(self) -> None:
        """Go on to the thanks, and wait until the server has closed the recording."""
        self._go_on(lambda: self.is_over)
        wait_for(lambda: not self._servers.is_alive)


def perform(root: Path, kinds: list[Kind], found: Batches, rng: np.random.Generator) -> None:
    """Perform sessions until there were enough faults of each kind.

    Raises:
        DataError: there is no Chromium, or something does not go on.
    """
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        raise DataError("there is no chromium; apt install chromium")
    (root / f"{NAME}.py").write_text(STUDY, "utf-8")
    servers = Servers(root)
    try:
        while any(kind.faults < kind.wanted for kind in kinds):
            label = f"S{found.sessions + 1:03d}"
            with sync_playwright() as playwright:
                browser = Chromium(program, root / f"profile-{label}", playwright, OPTIONS)
                try:
                    session = Session(servers, browser, label)
                    _disturb(session, kinds, rng)
                    session.finish()
                finally:
                    browser.kill()
            found.look_through(session_path(root, label), session.stored)
            print(_line(found), ", ".join(f"{k.faults} {k.kind}" for k in kinds), file=sys.stderr)
    finally:
        servers.close()


OPTIONS: Final = (
    *(o for o in OPTIONS_OF_BROWSER if o != "--disable-gpu"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


def _disturb(session: Session, kinds: list[Kind], rng: np.random.Generator) -> None:
    """Answer a session's trials, with faults in each while any are wanted."""
    for _ in range(TRIALS - 1):
        for _ in range(FAULTS_A_TRIAL):
            left = [kind for kind in kinds if kind.faults < kind.wanted]
            if not left or session.is_over:
                break
            weights = np.array([kind.wanted - kind.faults for kind in left], float)
            kind = left[int(rng.choice(len(left), p=weights / weights.sum()))]
            pause(rng.uniform(0, MAX_WAIT_S))
            watch = StopWatch()
            match kind.kind:
                case "server":
                    session.kill_server()
                case "browser":
                    session.kill_browser()
                case _:
                    session.cut(rng.uniform(0, MAX_CUT_MS))
            kind.faults += 1
            kind.resumes_s.append(watch.elapsed_s())
        session.answer()


def main(arguments: list[str]) -> int:
    """Print what was lost."""
    parser = argparse.ArgumentParser(prog="benchmarks.xr_kills", description=__doc__)
    parser.add_argument("--server", type=int, default=100, help="kills of the server")
    parser.add_argument("--browser", type=int, default=100, help="kills of the browser")
    parser.add_argument("--cuts", type=int, default=50, help="posts that are broken off")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.serve is not None:
        serve(options.serve)
        return 0
    kinds = [
        Kind("server", options.server),
        Kind("browser", options.browser),
        Kind("cut", options.cuts),
    ]
    found = Batches()
    with tempfile.TemporaryDirectory(prefix="xr_kills") as folder:
        lab = Path(folder) / "lab"  # its keys are beside it
        lab.mkdir()
        perform(lab, kinds, found, np.random.default_rng(SEED))
    if options.json:
        print(json.dumps({**asdict(found), "faults": [asdict(kind) for kind in kinds]}))
    else:
        _print(kinds, found)
    return int(found.is_bad)


def _print(kinds: list[Kind], found: Batches) -> None:
    words = {"server": "kills of the server", "browser": "kills of the browser"}
    for kind in kinds:
        if kind.faults:
            print(
                f"{kind.faults} {words.get(kind.kind, 'cuts of the wire')}: samples acknowledged "
                f"again after {np.median(kind.resumes_s):.1f} s (median), "
                f"{max(kind.resumes_s):.1f} s at most"
            )
    print(_line(found))


def _line(found: Batches) -> str:
    return (
        f"{found.sessions} sessions, {found.stored} batches in the page's store, {found.rows} rows "
        f"recorded: {found.lost} batches lost, {found.doubled} doubled, {found.other_bytes} with "
        f"other bytes; {found.rows_lost} rows lost, {found.rows_doubled} doubled; "
        f"{found.not_whole} sessions not whole (limit 0 each)"
    )


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
